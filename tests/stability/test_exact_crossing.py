"""Mode 1 has a kink where two independent frequencies cross."""

from __future__ import annotations

import numpy as np
from stress import case, judged, stated

from eigassign.modal import expand, reduce

E = np.linspace(60e9, 80e9, 41)[:, None]
CROSSING = np.array([70e9])


def test_a_cluster_is_right_on_both_sides_of_the_crossing():
    model = case("exact_crossing").model()
    expansion = expand(model.pencil, [], CROSSING, (1, 2), order=8)
    assert [c.modes for c in expansion.clusters] == [(1, 2)]
    assert "expanded as one cluster" in expansion.notes[0]
    assert judged(model, expansion, [], E).max() < 1e-11


def test_modes_that_coincide_are_a_cluster_even_where_none_is_wanted():
    """Each by itself would be some mixture of the two: 2.4 % wrong at 5 % more E."""
    model = case("exact_crossing").model()
    expansion = expand(model.pencil, [], CROSSING, (1, 2), order=8, cluster_gap=0.0)
    assert [c.modes for c in expansion.clusters] == [(1, 2)]
    assert judged(model, expansion, [], E).max() < 1e-11


def test_a_single_mode_goes_straight_on_and_says_that_it_is_no_longer_mode_1():
    """λ of the second bar is linear in E: beyond 70 GPa that line is mode 2."""
    model = case("exact_crossing").model()
    expansion = expand(model.pencil, [], [62e9], (1,), order=4)
    error = judged(model, expansion, [], E)[:, 0]
    beyond = E[:, 0] > 70.1e9
    assert error[~beyond].max() < 1e-11
    assert error[beyond].max() > 0.05
    assert stated(model, expansion, [], E)[0] >= error.max()


def test_the_reduced_model_knows_which_is_the_lower_one():
    model = case("exact_crossing").model()
    reduced = reduce(model.pencil, [], [62e9], (1, 2), 2)
    assert judged(model, reduced, [], E).max() < 1e-10


def test_tracked_modes_go_straight_through():
    model = case("exact_crossing").model()
    tracked = model.tracked([], E, (1, 2))
    np.testing.assert_allclose(tracked.lam[:, 0] / E[:, 0], tracked.lam[0, 0] / E[0, 0], rtol=1e-9)
    assert [e.gap < 1e-9 for e in tracked.encounters] == [True]
