"""Modes tracked along samples, and one followed by its shape: through crossings and veerings."""

import numpy as np
import pytest
from chains import model_of, two_link
from meetings import E_ONE, line, two_bars

from eigassign import load_case
from eigassign.errors import LostModeError
from eigassign.modal import (
    FollowedShape,
    Model,
    ModesAtPoint,
    MoreModesError,
    follow,
    overlaps,
    places,
    track,
)

# --- Tracked modes keep their shape through crossings, and what a veering does to them is said


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


# --- A mode followed by its shape goes through crossings, and is lost where its shape is shared


def start(at: ModesAtPoint, number: int) -> FollowedShape:
    return FollowedShape(at, np.eye(len(at.lam))[number - 1])


def followed(model: Model, x: np.ndarray, number: int = 1, extra: int = 3) -> list[FollowedShape]:
    """Mode ``number`` of the first sample along all of them."""
    along = places(model.pencil, x, 2, extra)
    return follow(model.pencil, start(along[0], number), along)


@pytest.mark.parametrize("count", [2, 10, 11, 41])
def test_the_frequency_goes_straight_through_an_exact_crossing(count: int) -> None:
    """Bar two goes with √E and is the lower one first; of 11 samples one is at the crossing."""
    model, x = two_bars(), line(count)
    f_one = model.frequencies([], [E_ONE], 1)[0, 0]
    shapes = followed(model, x)
    hz = np.sqrt([shape.lam for shape in shapes]) / (2 * np.pi)
    np.testing.assert_allclose(hz, f_one * np.sqrt(x[:, 0] / E_ONE), rtol=1e-9)
    assert (shapes[0].number, shapes[-1].number) == (1, 2)
    assert not any(shape.is_shared for shape in shapes)


def test_where_modes_coincide_the_shape_is_that_of_before() -> None:
    """At the crossing the solver returns any two mixtures; the second bar moves, and it alone."""
    model, x = two_bars(), line(11)
    before, at = (followed(model, x)[k].phi for k in (4, 5))
    moving = np.abs(before) > 1e-6 * np.abs(before).max()
    assert np.abs(at[~moving]).max() < 1e-6 * np.abs(at).max()


@pytest.mark.parametrize("stub", [1e-3, 1e-2, 0.1])
def test_a_close_veering_is_followed_as_a_crossing_and_either_mode_stands_for_it(
    stub: float,
) -> None:
    """Even at the sample in its middle, where frequencies differ by less than 0.1 %."""
    shapes = followed(two_bars(stub), line(41))
    assert shapes[-1].number == 2
    assert not any(shape.is_shared for shape in shapes)


@pytest.mark.parametrize("count", [2, 10, 41, 200])
def test_how_closely_the_way_is_sampled_does_not_change_where_a_veering_leads(count: int) -> None:
    """Gaps of 0.7 % (the shape goes over) and 25 % (the branch keeps it)."""
    assert followed(two_bars(stub=0.4), line(count))[-1].number == 2
    assert followed(two_bars(stub=1.0), line(count))[-1].number == 1


def test_in_the_middle_of_a_veering_the_shape_is_shared_by_two_modes() -> None:
    shapes = followed(two_bars(stub=0.4), line(41))
    shared = [shape for shape in shapes if shape.is_shared]
    assert len(shared) == 2
    first, second = shared[0].candidates
    assert {first.number, second.number} == {1, 2}
    assert first.mac + second.mac == pytest.approx(1.0, abs=1e-6)
    assert first.mac < 0.75


def test_a_shape_that_comes_out_of_a_veering_as_neither_mode_is_lost() -> None:
    model = two_bars(stub=0.9)
    x = np.linspace(50e9, 110e9, 21)[:, None]
    with pytest.raises(LostModeError, match="MAC 0") as caught:
        followed(model, x)
    assert 0 < caught.value.step < 21
    assert {one.number for one in caught.value.candidates} == {1, 2}


def test_too_few_modes_are_said_so() -> None:
    model, x = two_bars(), line(10)
    along = places(model.pencil, x, 1, 0)
    with pytest.raises(MoreModesError):
        follow(model.pencil, start(along[0], 1), along)


@pytest.mark.parametrize("count", [2, 3, 5, 50])
def test_one_long_step_does_not_jump_over_what_many_short_ones_meet(count: int) -> None:
    """At both ends of the step the shape is clear; in between no mode has it."""
    x = np.linspace(30e9, 160e9, count)[:, None]
    with pytest.raises(LostModeError):
        followed(two_bars(stub=0.95), x)
