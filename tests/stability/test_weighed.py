"""Estimates of reduced models and expansions of random mechanisms under weight: none is below."""

from __future__ import annotations

import pytest
from calibration import tally
from test_calibration import COVERED, polynomial, reduced_model
from weighed_draws import weighed

JUDGES = {"reduced model": reduced_model, "polynomial": polynomial}


@pytest.mark.parametrize("judge", JUDGES)
def test_estimates_under_weight_are_not_below_the_error(judge: str) -> None:
    seeds = range(27, 30)  # of the last, an arm that would fall in the pose with another design
    found = tally(seeds, 3, JUDGES[judge], weighed)
    assert found.covered == 1.0


@pytest.mark.slow
@pytest.mark.parametrize("judge", JUDGES)
def test_estimates_of_many_random_mechanisms_under_weight(judge: str) -> None:
    found = tally(range(1_500), 3, JUDGES[judge], weighed)
    assert found.covered >= COVERED
    assert found.refused.mean() < 0.3
