"""From the trajectory of a case to q(t): timing laws, point to point, along a path, several."""

from functools import partial
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from planar_arms import serial_arm

from eigassign.assignment import time_weights
from eigassign.case import FileTrajectory, PointTrajectory, SampledTrajectory, TipTrajectory
from eigassign.errors import TrajectoryError, UsageError
from eigassign.mechanism import (
    NamedTrajectory,
    TipChain,
    Trajectories,
    Trajectory,
    build_trajectory,
    timing_law,
)

# --- Timing laws s(τ)


NAMES = ["linear", "cubic", "quintic", "trapezoidal"]
LAWS = [*map(timing_law, NAMES)]
EVERY_LAW = pytest.mark.parametrize("law", LAWS, ids=NAMES)
TAU = np.linspace(0.0, 1.0, 41)


def position(law, tau, order=0):
    return law.value(tau, order)[:, 0]


velocity, acceleration = partial(position, order=1), partial(position, order=2)


@pytest.mark.parametrize(
    ("name", "formula"),
    [
        ("linear", lambda t: t),
        ("cubic", lambda t: 3 * t**2 - 2 * t**3),
        ("quintic", lambda t: 10 * t**3 - 15 * t**4 + 6 * t**5),
    ],
)
def test_laws_are_the_polynomials_of_their_names(name, formula):
    # terms up to 15, hence some 1e-15 of round-off
    np.testing.assert_allclose(position(timing_law(name), TAU), formula(TAU), rtol=0, atol=1e-14)


@EVERY_LAW
def test_laws_run_from_0_to_1_without_turning_back(law):
    s = position(law, TAU)
    assert s[0] == 0.0
    assert s[-1] == 1.0
    assert (np.diff(s) > 0.0).all()


@EVERY_LAW
def test_derivatives_agree_with_central_differences(law):
    h, tau, ends = 1e-4, TAU[1:-1], law.knots[1:-1]
    tau = tau[[all(abs(t - end) > h for end in ends) for t in tau]]  # no acceleration there
    first = (position(law, tau + h) - position(law, tau - h)) / (2 * h)
    second = (velocity(law, tau + h) - velocity(law, tau - h)) / (2 * h)
    # h²/6 times the third derivative, at most 60 (s''') and 360 (s'''' of the quintic)
    np.testing.assert_allclose(velocity(law, tau), first, atol=h**2 * 11, rtol=0)
    np.testing.assert_allclose(acceleration(law, tau), second, atol=h**2 * 65, rtol=0)


def test_a_trapezoid_accelerates_travels_and_brakes_for_a_third_each():
    law, peak, share = timing_law("trapezoidal"), 3 / 2, 1 / 3
    assert velocity(law, [0.0, 1.0]) == pytest.approx(0.0, abs=1e-13)
    inside = np.array([0.5 * share, 1 - 0.5 * share])
    assert velocity(law, inside) == pytest.approx(0.5 * peak)
    assert velocity(law, np.linspace(share, 1 - share, 7)) == pytest.approx(peak)
    assert acceleration(law, inside) == pytest.approx(np.array([1, -1]) * peak / share)
    assert position(law, 0.5) == pytest.approx(0.5)
    # no jump where the pieces meet: the velocity between two sides moves by the acceleration only
    for end in law.knots[1:-1]:
        for quantity, slope in ((position, peak), (velocity, peak / share)):
            assert abs(quantity(law, end) - quantity(law, end - 1e-9)) <= 1.1e-9 * slope


@pytest.mark.parametrize("tau", [-1e-9, 1.0 + 1e-9, np.nan, np.inf])
def test_laws_are_not_extrapolated(tau):
    with pytest.raises(UsageError, match="0 <= s <= 1"):
        position(timing_law("quintic"), [0.5, tau])


# --- Point to point in the joints: from the case file to q(t)


TURN_AND_SLIDE = ("q1", "q2")
POINTS = ((0.0, 0.2), (1.0, 0.2), (0.5, 0.6), (0.5, 0.7))


def no_arm(node: str, oriented: bool) -> TipChain:
    raise AssertionError("points and samples in the joints need no kinematics")


def motion(**changes: object) -> object:
    keys = {"points": POINTS, "duration": 4.0, "samples": 401}
    spec = PointTrajectory.model_construct(**(keys | changes))
    return build_trajectory(spec, TURN_AND_SLIDE, no_arm, q_units=("rad", "m"))  # type: ignore[arg-type]


@pytest.mark.parametrize("timing", ["linear", "cubic", "quintic", "trapezoidal"])
def test_each_segment_runs_by_the_timing_law(timing):
    times = (1.0, 1.5, 3.0, 5.0)
    path = motion(timing=timing, duration=None, times=times)
    assert (path.time_s[0], path.time_s[-1]) == (1.0, 5.0)
    assert (path.tip, path.notes) == (None, ())
    for k, (start, end) in enumerate(pairwise(times)):
        inside = (path.time_s >= start) & (path.time_s <= end)
        s = position(timing_law(timing), (path.time_s[inside] - start) / (end - start))
        a, b = np.array(POINTS[k]), np.array(POINTS[k + 1])
        np.testing.assert_allclose(path.q[inside], a + s[:, None] * (b - a), atol=1e-12)


@pytest.mark.parametrize(
    ("timing", "fastest"), [("cubic", 1.5), ("quintic", 1.875), ("trapezoidal", 1.5)]
)
def test_it_rests_at_each_point_and_its_peak_velocity_is_the_laws(timing, fastest):
    h = 1e-3
    path = motion(timing=timing, duration=None, times=(0, 1, 2, 3), samples=3001)
    rate = np.diff(path.q, axis=0) / h
    for k in (0, 999, 1000, 1999, 2000, 2999):  # from rest, at most |q''| = 7 times h / 2
        assert np.abs(rate[k]).max() < 7 * h
    assert np.abs(rate[:1000, 0]).max() == pytest.approx(fastest, rel=1e-5)


def test_time_is_shared_by_the_largest_move_relative_to_its_range():
    # ranges 1 rad and 0.5 m: shares 1, max(0.5, 0.8), 0.2
    path = motion(timing="linear", duration=4.0)
    assert path.notes == (
        "the points are reached at 0, 2, 3.6, 4 s: time shared in proportion to the largest move "
        "of a coordinate relative to its range",
    )
    np.testing.assert_allclose(path.q[[0, 200, 360, 400]], POINTS, atol=1e-12)
    metres = [(a, 1000 * b) for a, b in POINTS]  # the measure of a coordinate changes nothing
    assert motion(points=metres, timing="linear").notes == path.notes
    assert motion(points=POINTS[:2]).notes == ()  # two points leave nothing to tell


def test_it_waits_where_two_points_are_the_same_and_times_are_given():
    path = motion(points=(POINTS[0], POINTS[0], POINTS[1]), duration=None, times=(0, 1, 2))
    np.testing.assert_allclose(path.q[:201], np.tile(POINTS[0], (201, 1)), atol=1e-15)


# --- From the trajectory of a case to q(t)


Q = ("q1", "q2")
PAPER = ((0.33, 0.12), (0.30, 0.19), (0.108, 0.2104), (0.02, 0.1845), (-0.01, 0.19))


def arm(node: str, oriented: bool) -> TipChain:
    assert node == "forearm.end"
    return serial_arm(0.6, 0.45, oriented=oriented)


def tip_path(**changes: object) -> TipTrajectory:
    """The paper's path with changes; not validated, as by a caller who bypasses the case file."""
    keys = {
        "tip": "forearm.end",
        "waypoints": PAPER,
        "path": "spline",
        "timing": "quintic",
        "duration": 2.0,
        "samples": 152,
        "branch": {"elbow": (np.pi, np.radians(217.0))},
        "start": None,
    }
    return TipTrajectory.model_construct(**(keys | changes))


def samples(**keys: object) -> SampledTrajectory:
    return SampledTrajectory.model_construct(**({"time": None, "duration": None} | keys))


def test_a_tip_path_is_followed_in_equal_steps_of_time():
    trajectory = build_trajectory(tip_path(), Q, arm)
    np.testing.assert_allclose(trajectory.time_s, np.linspace(0.0, 2.0, 152), atol=1e-15)
    assert trajectory.q.shape == (152, 2)
    tip = 0.6 * np.exp(1j * trajectory.q[:, 0]) + 0.45 * np.exp(1j * trajectory.q[:, 1])
    np.testing.assert_allclose(trajectory.tip, np.stack([tip.real, tip.imag], 1), atol=1e-13)
    np.testing.assert_allclose(trajectory.tip[[0, -1]], np.array(PAPER)[[0, -1]], atol=1e-12)
    assert np.abs(trajectory.q - [1.817, 5.312]).max(axis=1).min() < 1.2e-3


def test_samples_with_times_are_taken_as_they_are():
    spec = samples(q=((0.1, 0.2), (0.3, 0.4), (0.5, 0.6)), time=(1.0, 1.5, 4.0))
    trajectory = build_trajectory(spec, Q, no_arm)
    np.testing.assert_array_equal(trajectory.time_s, [1.0, 1.5, 4.0])
    np.testing.assert_array_equal(trajectory.q, [[0.1, 0.2], [0.3, 0.4], [0.5, 0.6]])
    assert trajectory.tip is None


def test_samples_with_a_duration_are_equally_spaced_from_0():
    spec = samples(q=((0.1,), (0.3,), (0.5,)), duration=3.0)
    np.testing.assert_array_equal(build_trajectory(spec, ("q1",), no_arm).time_s, [0.0, 1.5, 3.0])


def test_samples_that_jump_by_a_turn_are_noted():
    spec = samples(q=((0.0, 3.1), (0.0, -3.1), (0.0, -3.0)), duration=1.0)
    notes = build_trajectory(spec, Q, no_arm).notes
    assert len(notes) == 1
    assert notes[0].startswith("q2 jumps by 6.2 rad from sample 0 to 1")


def test_a_file_gives_its_samples(tmp_path):
    (tmp_path / "arm.csv").write_text("time,q2,q1\n0,10,1\n2,11,2\n")
    trajectory = build_trajectory(FileTrajectory(file=str(tmp_path / "arm.csv")), Q, no_arm)
    np.testing.assert_array_equal(trajectory.time_s, [0.0, 2.0])
    np.testing.assert_array_equal(trajectory.q, [[1.0, 10.0], [2.0, 11.0]])
    assert trajectory.tip is None


def test_time_that_stands_still_in_a_file_is_named_by_line(tmp_path):
    (tmp_path / "arm.csv").write_text("time,q1,q2\n0,0,0\n\n2,0,0\n2,0,0\n")
    with pytest.raises(TrajectoryError, match=r"arm\.csv:5: .* from 2 s to 2 s") as error:
        build_trajectory(FileTrajectory(file=str(tmp_path / "arm.csv")), Q, no_arm)
    assert (error.value.sample, error.value.path) == (2, "trajectory.file")


def test_notes_of_a_file_are_those_of_its_columns_and_its_jumps(tmp_path):
    (tmp_path / "arm.csv").write_text("time,q1 [deg],q2,force\n0,179,0,7\n2,-179,0,7\n")
    notes = build_trajectory(FileTrajectory(file=str(tmp_path / "arm.csv")), Q, no_arm).notes
    assert "force" in notes[0]
    assert "q1 jumps by 6.25 rad" in notes[1]


@pytest.mark.parametrize(
    "spec", [tip_path(), samples(q=POINTS, duration=1.0)], ids=["tip", "samples"]
)
def test_arrays_are_frozen(spec):
    trajectory = build_trajectory(spec, Q, arm)
    for array in (trajectory.time_s, trajectory.q, trajectory.tip):
        assert array is None or not array.flags.writeable


# --- Several trajectories are stacked, and nothing that is asked of them crosses a seam


def one(n: int, start: float = 0.0, notes: tuple[str, ...] = ()) -> Trajectory:
    time = start + np.cumsum(np.linspace(0.1, 0.2, n))
    return Trajectory(time, np.column_stack([np.sin(time), 10 + time]), notes)


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
    assert time_weights(path) @ g == pytest.approx(expected, abs=1e-11)


def test_the_tip_is_stacked_only_if_all_have_one() -> None:
    along, bare = build_trajectory(tip_path(), Q, arm), one(3)
    both = Trajectories((NamedTrajectory("a", along), NamedTrajectory("b", along)))
    np.testing.assert_array_equal(both.tip, np.vstack([along.tip, along.tip]))
    assert Trajectories((NamedTrajectory("a", along), NamedTrajectory("b", bare))).tip is None


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
