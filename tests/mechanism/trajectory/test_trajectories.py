"""Several trajectories are stacked, and nothing that is asked of them crosses a seam."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from eigassign.assignment import trapezoidal_weights
from eigassign.errors import UsageError
from eigassign.mechanism import NamedTrajectory, Trajectories, Trajectory


def one(n: int, start: float = 0.0, notes: tuple[str, ...] = ()) -> Trajectory:
    time = start + np.cumsum(np.linspace(0.1, 0.2, n))
    return Trajectory(time, np.column_stack([np.sin(time), 10 + time]), None, notes)


def pair(weights: tuple[float, float] = (1.0, 1.0)) -> Trajectories:
    return Trajectories(
        (
            NamedTrajectory("pick", one(4, 5.0), weights[0]),
            NamedTrajectory("return", one(3), weights[1]),
        )
    )


def test_samples_stand_one_after_the_other_and_time_starts_anew() -> None:
    path = pair()
    np.testing.assert_array_equal(path.q, np.vstack([p.trajectory.q for p in path.parts]))
    assert path.rows == (slice(0, 4), slice(4, 7))
    assert path.time_s[4] == path.parts[1].trajectory.time_s[0] < path.time_s[3]
    assert [path.rows_of(name) for name in ("return", None)] == [slice(4, 7), slice(0, 7)]
    with pytest.raises(UsageError, match="none called 'place'"):
        path.rows_of("place")


def test_a_single_trajectory_is_itself() -> None:
    alone = one(5, notes=("q1 jumps",))
    path = Trajectories((NamedTrajectory("1", alone),))
    assert path.q is alone.q
    assert path.time_s is alone.time_s
    assert path.notes == ("q1 jumps",)
    assert path.where(2) == f"sample 2 (t = {alone.time_s[2]:.4g} s)"


def test_a_sample_is_named_by_its_trajectory_and_counted_there() -> None:
    path = pair()
    assert path.sample(3) == "sample 3 of trajectory 'pick'"
    assert path.where(4) == "sample 0 of trajectory 'return' (t = 0.1 s)"
    assert (path.name_of(3), path.name_of(4)) == ("pick", "return")


def test_notes_say_whose_they_are() -> None:
    parts = (NamedTrajectory("a", one(2, notes=("x",))), NamedTrajectory("b", one(2, notes=("y",))))
    assert Trajectories(parts).notes == ("trajectory 'a': x", "trajectory 'b': y")


@given(st.tuples(st.floats(0.1, 9), st.floats(0.1, 9)), st.floats(-3, 3), st.floats(-3, 3))
def test_weights_integrate_each_trajectory_by_itself_and_by_its_weight(
    weights: tuple[float, float], offset: float, slope: float
) -> None:
    path = pair(weights)
    g = offset + slope * path.time_s
    expected = 0.0
    for part, weight in zip(path.parts, weights, strict=True):
        a, b = part.trajectory.time_s[[0, -1]]
        expected += weight * (offset * (b - a) + slope * (b**2 - a**2) / 2)
    assert path.weights(trapezoidal_weights) @ g == pytest.approx(expected, abs=1e-11)


def test_the_tip_is_stacked_only_if_all_have_one() -> None:
    tips = [Trajectory(np.arange(2.0), np.zeros((2, 1)), np.full((2, 2), float(k))) for k in (0, 1)]
    both = Trajectories(tuple(NamedTrajectory(str(k), t) for k, t in enumerate(tips)))
    assert both.tip is not None
    np.testing.assert_array_equal(both.tip[:, 0], [0, 0, 1, 1])
    bare = Trajectory(np.arange(2.0), np.zeros((2, 1)), None)
    assert Trajectories((NamedTrajectory("a", tips[0]), NamedTrajectory("b", bare))).tip is None


@given(st.lists(st.integers(1, 60), min_size=1, max_size=6), st.integers(1, 80))
def test_some_samples_are_chosen_with_both_ends_of_every_trajectory(
    lengths: list[int], count: int
) -> None:
    path = Trajectories(tuple(NamedTrajectory(f"t{k}", one(n)) for k, n in enumerate(lengths)))
    chosen = path.spread(count)
    assert {e for rows in path.rows for e in (rows.start, rows.stop - 1)} <= set(chosen.tolist())
    assert len(chosen) <= count + 2 * len(lengths)
    assert np.all(np.diff(chosen) > 0)
    few = path.chosen(chosen)
    np.testing.assert_array_equal(few.q, path.q[chosen])
    assert [part.name for part in few.parts] == [part.name for part in path.parts]


def test_a_single_trajectory_is_thinned_evenly() -> None:
    path = Trajectories((NamedTrajectory("1", one(152)),))
    even = np.unique(np.linspace(0, 151, 40).round().astype(int))
    np.testing.assert_array_equal(path.spread(40), even)


def test_no_trajectory_at_all_is_refused() -> None:
    with pytest.raises(UsageError, match="none given"):
        Trajectories(())
