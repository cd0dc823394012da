import numpy as np
import pytest

from eigassign.mechanism import NamedTrajectory, Trajectories, Trajectory
from eigassign.study import crossing_warnings

TIME = np.linspace(0.0, 1.0, 11)


def warned(hz: np.ndarray, modes: tuple[int, ...]) -> list[str]:
    path = Trajectories((NamedTrajectory("1", Trajectory(TIME, TIME[:, None], None)),))
    return list(crossing_warnings(hz, modes, path.where, "initial"))


def crossing(gap: float) -> np.ndarray:
    """Modes 1 and 2 nearest to each other at sample 6, mode 3 far above."""
    distance = np.abs(TIME - 0.6)
    return np.column_stack([100.0 - 20 * distance, 100.0 * (1 + gap) + distance, 300 + TIME])


def test_modes_that_nearly_meet_are_named_with_sample_and_time() -> None:
    (warning,) = warned(crossing(0.005), (1,))
    assert "modes 1 and 2 come within 0.5 %" in warning
    assert "sample 6 (t = 0.6 s), near 100 Hz, with the initial design" in warning


@pytest.mark.parametrize("gap", [0.011, 0.5])
def test_modes_that_keep_apart_are_not(gap: float) -> None:
    assert warned(crossing(gap), (1, 2)) == []


def test_only_neighbours_of_assigned_modes_count() -> None:
    assert warned(crossing(0.005), (3,)) == []
    assert len(warned(crossing(0.005), (2,))) == 1
    assert len(warned(crossing(0.005), (1, 2))) == 1  # one pair, said once


def test_the_highest_mode_computed_has_no_neighbour_above() -> None:
    assert warned(crossing(0.5)[:, :1], (1,)) == []
