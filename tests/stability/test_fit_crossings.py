"""Fits over regions in which modes meet: honest about what lies between their nodes, or refused."""

from __future__ import annotations

import numpy as np
import pytest
from crossings import outcomes, rooted_bars

import eigassign as ea
from eigassign.errors import AccuracyError

WORST = 2.0  # times its estimate an error may be, as of all fits


@pytest.mark.parametrize("place", [-0.999, 0.4, 0.996])
@pytest.mark.parametrize("depth", [1e-4, 1e-2, 1.0])
def test_a_crossing_that_the_nodes_do_not_show_is_no_secret(depth, place):
    """At 0.996 all nodes of twelve solves are on one side: each mode looks smooth, and is not."""
    model, box = rooted_bars(depth, place)
    y = np.linspace(box.lower[0], box.upper[0], 401)[:, None]
    exact = model.frequencies([], y, 2)
    said: list[str] = []
    for asked in ({"solves": 12}, {"solves": 16}, {"accuracy": 1e-6}):
        for mode in (1, 2):
            try:
                fit = ea.fit(model, [], box, (mode,), **asked)
            except AccuracyError as refused:
                said.append(str(refused))
                continue
            error = np.abs(fit.frequencies([], y)[:, 0] / exact[:, mode - 1] - 1.0).max()
            assert error <= max(WORST * fit.error_estimate, 1e-12)
    assert all("modes 1 and 2 come close" in each for each in said)


def test_a_mode_that_meets_no_other_is_fitted_as_before():
    model, box = rooted_bars(1.0, 3.0)  # they would meet far outside
    fit = ea.fit(model, [], box, (1,), accuracy=1e-8)
    assert fit.solves <= 12
    assert fit.error_estimate < 1e-8


@pytest.mark.parametrize("make", [ea.reduce, ea.expand])
def test_fits_of_reduced_models_and_expansions_see_it_too(make):
    model, box = rooted_bars(0.1, 0.996)
    y = np.linspace(box.lower[0], box.upper[0], 1001)[:, None]
    exact = model.frequencies([], y, 1)
    try:
        fit = ea.fit(make(model, [], box.lower), [], box, (1,), solves=12)
    except AccuracyError:
        return
    assert np.abs(fit.frequencies([], y) / exact - 1.0).max() <= WORST * fit.error_estimate


def test_few_random_fits_across_crossings():
    found, _ = outcomes(range(12))
    assert len(found) >= 6
    assert max(each.overshoot for each in found) <= WORST


@pytest.mark.slow
def test_five_hundred_random_fits_across_crossings_of_every_depth():
    found, refused = outcomes(range(1000, 1640))
    assert len(found) >= 500
    over = np.array([each.overshoot for each in found])
    assert (over <= 1.0).mean() >= 0.99
    assert over.max() <= WORST
    assert refused < 0.25 * (len(found) + refused)
