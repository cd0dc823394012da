"""The estimates of fits of the shipped cases beside their true errors."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from fit_calibration import Outcome, outcomes

COVERED, WORST = 0.99, 2.0


def check(found: list[Outcome], least: int) -> None:
    over = np.array([each.overshoot for each in found])
    assert len(over) >= least
    assert (over <= 1.0).mean() >= COVERED
    assert over.max() <= WORST


def test_coefficients_small_by_accident_do_not_make_an_estimate_small() -> None:
    # With the last two coefficients alone the gantry's second mode is wrong by 62 times as much.
    found = [*outcomes([Path("cases/gantry.yaml")], (1e-2,))]
    assert len(found) >= 6
    assert max(each.overshoot for each in found) <= WORST


@pytest.mark.slow
def test_the_estimate_covers_the_fits_of_the_shipped_cases() -> None:
    check([*outcomes()], 1500)
