"""The stated round-off of exact frequencies beside what round-off does."""

from __future__ import annotations

import numpy as np
import pytest
from roundoff_draws import spread_and_stated


def check(seeds: range, least: int) -> None:
    pairs = [pair for seed in seeds if (pair := spread_and_stated(seed)) is not None]
    assert len(pairs) >= least
    spread, stated = np.array(pairs).T
    assert (spread <= 1.5 * stated).all()
    assert (spread <= stated).mean() >= 0.99
    assert np.median(stated / np.maximum(spread, 1e-15)) < 30.0  # no mere bound


def test_round_off_is_neither_above_what_is_stated_nor_far_below():
    check(range(5), 3)


@pytest.mark.slow
def test_it_is_so_for_hundreds_of_chains_of_fine_beams_and_stiff_springs():
    check(range(1000, 1400), 300)
