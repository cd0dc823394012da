"""A mode followed by its shape: through crossings and veerings, lost where its shape is shared."""

import numpy as np
import pytest
from meetings import E_ONE, line, two_bars

from eigassign.errors import LostModeError
from eigassign.modal import FollowedShape, Model, ModesAtPoint, MoreModesError, follow, places


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
