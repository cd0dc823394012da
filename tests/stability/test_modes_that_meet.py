"""Modes that cross, veer, or come several at a time: right, or said to be wrong."""

import numpy as np
import pytest
from meetings import E_ONE, two_bars
from stress import case, judged, stated

from eigassign.modal import expand, reduce

# --- Two frequencies that veer with gaps from 1e-1 down to 1e-8: a branch point ever nearer


# Length of the stub in m and factor on its modulus that leave these relative gaps in frequency.
GAPS = {1e-1: (0.3, 0.05), 1e-2: (0.5, 1.0), 1e-3: (0.1, 1.0), 1e-5: (0.1, 1e2), 1e-8: (0.1, 1e5)}


@pytest.mark.parametrize("gap", GAPS)
def test_a_single_mode_admits_how_wrong_it_is_across_the_veering(gap):
    model = two_bars(*GAPS[gap])
    E = np.linspace(6.6e10, 7.4e10, 41)[:, None]
    expansion = expand(model.pencil, [], [6.7e10], (1,), order=8, cluster_gap=0.0)
    judged(model, expansion, [], E)


@pytest.mark.parametrize("gap", GAPS)
def test_both_modes_as_a_cluster_are_right_across_it(gap):
    model = two_bars(*GAPS[gap])
    E = np.linspace(6.6e10, 7.4e10, 41)[:, None]
    together = max(0.02, 3.0 * gap)
    expansion = expand(model.pencil, [], [E_ONE], (1, 2), order=8, cluster_gap=together)
    assert [c.modes for c in expansion.clusters] == [(1, 2)]
    assert judged(model, expansion, [], E).max() < 1e-8


@pytest.mark.parametrize("gap", GAPS)
def test_the_reduced_model_is_right_across_it(gap):
    model = two_bars(*GAPS[gap])
    E = np.linspace(6e10, 8e10, 41)[:, None]
    reduced = reduce(model.pencil, [], [6.7e10], (1, 2), 3)
    assert judged(model, reduced, [], E).max() < 1e-8


# --- Mode 1 has a kink where two independent frequencies cross


MODULUS = np.linspace(60e9, 80e9, 41)[:, None]
CROSSING = np.array([70e9])


@pytest.mark.parametrize("gap", [{}, {"cluster_gap": 0.0}], ids=["as it is", "none wanted"])
def test_modes_that_coincide_are_a_cluster_that_is_right_on_both_sides(gap):
    """Each by itself would be some mixture of the two: 2.4 % wrong at 5 % more E."""
    model = case("exact_crossing").model()
    expansion = expand(model.pencil, [], CROSSING, (1, 2), order=8, **gap)
    assert [c.modes for c in expansion.clusters] == [(1, 2)]
    assert "expanded as one cluster" in expansion.notes[0]
    assert judged(model, expansion, [], MODULUS).max() < 1e-11


def test_a_single_mode_goes_straight_on_and_says_that_it_is_no_longer_mode_1():
    """λ of the second bar is linear in E: beyond 70 GPa that line is mode 2."""
    model = case("exact_crossing").model()
    expansion = expand(model.pencil, [], [62e9], (1,), order=4)
    error = judged(model, expansion, [], MODULUS)[:, 0]
    beyond = MODULUS[:, 0] > 70.1e9
    assert error[~beyond].max() < 1e-11
    assert error[beyond].max() > 0.05
    assert stated(model, expansion, [], MODULUS)[0] >= error.max()


def test_the_reduced_model_knows_which_is_the_lower_one():
    model = case("exact_crossing").model()
    reduced = reduce(model.pencil, [], [62e9], (1, 2), 2)
    assert judged(model, reduced, [], MODULUS).max() < 1e-10


# --- Every mode of a cross of four equal bars comes four times


D = np.linspace(0.008, 0.012, 9)[:, None]


def test_the_four_are_found_together_and_stay_together():
    model = case("repeated_modes").model()
    expansion = expand(model.pencil, [], [0.01], (1,), order=8)
    assert [c.modes for c in expansion.clusters] == [(1, 2, 3, 4)]
    assert judged(model, expansion, [], D).max() < 1e-9


def test_the_reduced_model_has_all_four():
    model = case("repeated_modes").model()
    reduced = reduce(model.pencil, [], [0.01], (1, 2, 3, 4, 5), 1)
    assert judged(model, reduced, [], D).max() < 1e-9
    f = reduced.frequencies([], D)
    np.testing.assert_allclose(f[:, 1:4], f[:, :1] * np.ones(3), rtol=1e-10)


# --- Along the motion the folding arm's frequency passes that of a fixed antenna


Q = np.deg2rad(np.linspace(10.0, 165.0, 40))[:, None]


def test_approximations_of_mode_1_are_of_the_lower_one_or_refused():
    model = case("mode_swaps").model()
    q0 = np.deg2rad([80.0])
    judged(model, expand(model.pencil, q0, [], (1,), order=8), Q, [])
    reduced = reduce(model.pencil, q0, [], (1, 2), 3)
    assert judged(model, reduced, Q, []).max() < 1e-5
