"""Tracked modes keep their shape through crossings, and what a veering does to them is said."""

from __future__ import annotations

import numpy as np
import pytest
from chains import model_of, two_link
from meetings import E_ONE, line, two_bars

from eigassign import load_case
from eigassign.errors import UsageError
from eigassign.modal import overlaps, track


@pytest.mark.parametrize("count", [10, 11, 41])
def test_curves_go_straight_through_an_exact_crossing(count):
    """Bar one does not depend on E, bar two goes with √E; of 11 samples one is at the crossing."""
    model, x = two_bars(), line(count)
    tracked = track(model.pencil, x, (1, 2))
    f_one = model.frequencies([], [E_ONE], 1)[0, 0]
    expected = np.column_stack([f_one * np.sqrt(x[:, 0] / E_ONE), np.full(count, f_one)])
    np.testing.assert_allclose(tracked.frequencies, expected, rtol=1e-9)
    assert tracked.certain.all()
    assert len(tracked.swaps) == 1
    assert len(tracked.notes) == 1
    assert "cross" in tracked.notes[0]


def test_a_wide_veering_keeps_each_curve_on_its_branch_and_says_what_it_gave_away():
    model, x = two_bars(stub=0.4), line(41)
    tracked = track(model.pencil, x, (1, 2))
    np.testing.assert_allclose(tracked.frequencies, model.frequencies([], x, 2), rtol=1e-12)
    assert tracked.swaps == ()
    (met,) = tracked.encounters
    assert met.exchanged > 0.8
    assert met.gap == pytest.approx(6.8e-3, rel=0.02)
    assert "stays on its branch" in met.line


@pytest.mark.parametrize(("stub", "gap"), [(1e-3, 8.0e-6), (1e-2, 8.2e-5)])
def test_a_veering_between_two_samples_is_followed_as_a_crossing_and_its_gap_is_found(stub, gap):
    tracked = track(two_bars(stub).pencil, line(10), (1, 2))
    (met,) = tracked.encounters
    assert met.swapped
    assert met.gap == pytest.approx(gap, rel=0.05)
    assert "closer than the samples resolve" in met.line
    assert tracked.certain.all()


def test_modes_that_always_coincide_are_followed_together():
    """Nothing distinguishes two equal bars: the frequencies agree, and no swap is made up."""
    model = two_bars()
    x = np.full((5, 1), E_ONE)
    tracked = track(model.pencil, x, (1, 2))
    np.testing.assert_allclose(tracked.lam[:, 0], tracked.lam[:, 1], rtol=1e-12)
    assert tracked.swaps == ()
    assert tracked.overlap.min() > 1.0 - 1e-9
    assert tracked.certain.all()


def test_along_the_papers_trajectory_nothing_meets():
    case = load_case("cases/two_link.yaml")
    model, q = case.model(), case.trajectory.q
    tracked = model.tracked(q, [0.0, 0.0], (1, 2, 3))
    exact = model.frequencies(q, [0.0, 0.0], 3)
    np.testing.assert_allclose(tracked.frequencies, exact, rtol=1e-12)
    assert tracked.notes == ()


def test_coarse_samples_are_refined_until_the_shapes_are_clear():
    """Half a turn of the elbow in one step: shapes at both ends have little in common."""
    model = model_of(two_link())
    coarse = model.tracked([[0.0, 0.3], [0.0, 3.0]], [0.1, 0.1], (1, 2, 3))
    fine = model.tracked(
        np.column_stack([np.zeros(200), np.linspace(0.3, 3.0, 200)]), [0.1, 0.1], (1, 2, 3)
    )
    np.testing.assert_allclose(coarse.frequencies[-1], fine.frequencies[-1], rtol=1e-12)
    assert coarse.certain.all()


def test_overlaps_of_the_modes_with_themselves_are_one_and_ignore_rigid_motion():
    model = model_of(two_link())
    x = model.x([0.2, 1.0], [0.1, 0.0])[0]
    phi = model.modes([0.2, 1.0], [0.1, 0.0], 4)[1][0]
    np.testing.assert_allclose(overlaps(model.pencil, phi, x, phi), np.eye(4), atol=1e-10)
    moved = phi.copy()
    moved[model.pencil.rigid] += 3.0
    np.testing.assert_allclose(overlaps(model.pencil, moved, x, phi), np.eye(4), atol=1e-8)


@pytest.mark.parametrize("wanted", [(), (0,), (400,)])
def test_modes_that_are_not_there_are_refused(wanted):
    with pytest.raises(UsageError, match="modes"):
        track(two_bars().pencil, line(3), wanted)
