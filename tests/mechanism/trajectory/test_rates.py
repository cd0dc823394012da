"""q, q̇ and q̈ at any time, against differences of eighth order of q, and at corners."""

import numpy as np
import pytest
from planar_arms import serial_arm

from eigassign.case import PointTrajectory, TipTrajectory
from eigassign.mechanism import TipChain, Trajectory, build_trajectory, rates

LAWS = ("linear", "cubic", "quintic", "trapezoidal")


def no_arm(node: str, oriented: bool) -> TipChain:
    raise AssertionError("points need no kinematics")


def agree(trajectory: Trajectory, away_from_s: np.ndarray, accuracy: float = 1e-6) -> None:
    """Rates at 100 times, none of whose differences reaches over a time to stay away from."""
    duration, motion = float(np.ptp(trajectory.time_s)), trajectory.motion
    h = 2e-3 * duration
    t = trajectory.time_s[0] + duration * np.linspace(0.013, 0.987, 100)
    t = t[np.abs(t[:, None] - away_from_s).min(axis=1, initial=np.inf) > 4.1 * h]
    assert len(t) > 20
    q = {k: motion.poses(t + k * h) for k in range(-4, 5)}
    first = sum(c * (q[k] - q[-k]) for k, c in enumerate((4 / 5, -1 / 5, 4 / 105, -1 / 280), 1))
    second = sum(c * (q[k] + q[-k]) for k, c in enumerate((8 / 5, -1 / 5, 8 / 315, -1 / 560), 1))
    found = motion.moving(t)
    np.testing.assert_array_equal(found.q, q[0])
    pairs = (found.rate, first / h), (found.acceleration, (second - 205 / 72 * q[0]) / h**2)
    for exact, wanted in pairs:  # of a constant velocity round-off is left
        np.testing.assert_allclose(exact, wanted, atol=accuracy * np.abs(wanted).max() + 1e-9)


@pytest.mark.parametrize("timing", LAWS)
def test_points_move_by_the_law(timing: str) -> None:
    spec = PointTrajectory(
        points=((0.0, 1.0), (1.0, 0.5), (0.2, 0.9)), times=(0.0, 0.7, 2.0), timing=timing, samples=7
    )
    found = build_trajectory(spec, ["q1", "q2"], no_arm)
    agree(found, found.motion.breaks_s)


def along_a_tip(seed: int, path: str, timing: str, *lengths: float) -> Trajectory:
    random = np.random.default_rng(seed)
    turns = random.uniform(0.0, 2.0 * np.pi) + np.linspace(0.0, 1.2, 4)
    points = random.uniform(0.55, 0.85, 4)[:, None] * np.stack([np.cos(turns), np.sin(turns)], 1)
    waypoints = tuple(map(tuple, points.tolist()))
    spec = TipTrajectory(
        tip="x.end", waypoints=waypoints, path=path, timing=timing, samples=9, duration=1.4
    )
    names = ["q1", "q2", "q3"][: len(lengths)]
    return build_trajectory(spec, names, lambda *_: serial_arm(*lengths))


@pytest.mark.parametrize("timing", LAWS)
@pytest.mark.parametrize("path", ["straight", "spline"])
@pytest.mark.parametrize("seed", range(10))
def test_tips_move_by_path_and_law(seed: int, path: str, timing: str) -> None:
    found = along_a_tip(seed, path, timing, 0.6, 0.45)
    motion = found.motion
    knots = [motion.when(s) * 1.4 for s in motion.course.path.knots[1:-1]]
    agree(found, np.union1d(motion.breaks_s, knots))


def test_samples_move_by_the_spline_through_them() -> None:
    """A polynomial of third degree is its own spline."""
    t = np.sort(np.random.default_rng(1).uniform(0.0, 2.0, 9))
    cubic = np.polynomial.Polynomial([0.3, -1.0, 2.0, 0.7])
    found = Trajectory(t, np.stack([cubic(t), 3.0 - t], axis=1))
    at = np.linspace(t[0], t[-1], 50)
    q, rate, push = found.motion.moving(at)
    np.testing.assert_allclose(q, np.stack([cubic(at), 3.0 - at], axis=1), atol=1e-12)
    np.testing.assert_allclose(rate, np.stack([cubic.deriv()(at), -1.0 + 0 * at], 1), atol=1e-11)
    np.testing.assert_allclose(push, np.stack([cubic.deriv(2)(at), 0 * at], 1), atol=1e-9)


@pytest.mark.parametrize("samples", [21, 22, 4])  # a corner on a sample, between two, few samples
def test_points_joined_at_constant_velocity_have_no_acceleration(samples: int) -> None:
    """Differences across the corner at 0.5 s would give 4 rad/s over a step."""
    spec = PointTrajectory(
        points=((0.0,), (1.0,), (0.0,)), times=(0.0, 0.5, 1.0), timing="linear", samples=samples
    )
    found = rates(build_trajectory(spec, ["q1"], no_arm))
    assert set(found.samples) == set(range(samples))
    np.testing.assert_allclose(found.acceleration, 0.0, atol=1e-9)
    np.testing.assert_allclose(np.abs(found.rate), 2.0, rtol=1e-12)
    assert found.rate[0, 0] > 0.0 > found.rate[-1, 0]


def test_a_corner_on_a_sample_is_seen_from_both_sides() -> None:
    keys = {"points": ((0.5,), (0.0,), (0.5,)), "times": (0.0, 0.5, 1.0), "timing": "linear"}
    found = rates(build_trajectory(PointTrajectory(**keys, samples=5), ["q1"], no_arm))
    np.testing.assert_array_equal(found.samples, [0, 1, 2, 2, 3, 4])
    np.testing.assert_allclose(found.rate[:, 0], [-1, -1, -1, 1, 1, 1], atol=1e-12)


def test_both_sides_of_where_a_trapezoidal_law_stops_accelerating_count() -> None:
    spec = PointTrajectory(points=((0.0,), (1.0,)), duration=1.0, timing="trapezoidal", samples=4)
    found = rates(build_trajectory(spec, ["q1"], no_arm))
    np.testing.assert_array_equal(found.samples, [0, 1, 1, 2, 2, 3])
    np.testing.assert_allclose(found.acceleration[:, 0], [4.5, 4.5, 0, 0, -4.5, -4.5], atol=1e-9)
