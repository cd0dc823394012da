"""Stated mesh errors of random mechanisms against six times the elements."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from meshes import stated


@pytest.mark.parametrize("count", [24, pytest.param(1_000, marks=pytest.mark.slow)])
def test_stated_errors_are_above_the_true_ones_and_near_them(count: int) -> None:
    found = stated(range(10_000, 10_000 + count))
    sys.stdout.write(f"{found}\n")
    assert (found.ratio >= 1.0).mean() >= 0.99
    assert (found.ratio < 2.0 / 3.0).sum() <= 2
    assert (found.ratio <= 2.0).mean() >= 0.9
    assert np.isinf(found.stated).mean() < 0.05
