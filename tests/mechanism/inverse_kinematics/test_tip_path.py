"""Tip paths: polyline and not-a-knot cubic spline, and orientations along them."""

from functools import partial

import numpy as np
import pytest
from planar_arms import serial_arm, two_link_angles
from scipy.spatial.transform import Rotation
from spatial_oracle import X, Y, Z, turn
from tip_paths import course

from eigassign.errors import MechanismError, TrajectoryError, UsageError
from eigassign.mechanism import follow, tip_path

straight, spline = (partial(tip_path, kind=kind) for kind in ("straight", "spline"))
S = np.linspace(0.0, 1.0, 301)
BOTH = pytest.mark.parametrize("path", [straight, spline])


def waypoints(m: int, d: int) -> np.ndarray:
    return np.random.default_rng(100 * m + d).normal(size=(m, d))


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("m", [2, 3, 4, 5, 12, 100])
def test_spline_equals_that_of_scipy(m, d):
    from scipy.interpolate import CubicSpline

    points = waypoints(m, d)
    chord = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))])
    reference, path = CubicSpline(chord / chord[-1], points), spline(points)
    # round-off of two different tridiagonal solves, growing with 1/h
    np.testing.assert_allclose(path.value(S), reference(S), rtol=0, atol=1e-14 * m)
    np.testing.assert_allclose(path.value(S, 1), reference(S, 1), rtol=0, atol=1e-13 * m**2)


@pytest.mark.parametrize("seed", range(5))
def test_spline_stands_very_uneven_chords(seed):
    from scipy.interpolate import CubicSpline

    steps = 10.0 ** np.random.default_rng(seed).uniform(-5.0, 0.0, 30)
    turns = np.random.default_rng(seed + 100).uniform(0.0, 2.0 * np.pi, 30)
    points = np.cumsum(steps[:, None] * np.stack([np.cos(turns), np.sin(turns)], axis=1), axis=0)
    path = spline(points)
    reference = CubicSpline(path.knots, points)(S)
    np.testing.assert_allclose(
        path.value(S), reference, rtol=0, atol=1e-13 * np.abs(reference).max()
    )


def test_polyline_moves_by_equal_arc_lengths():
    path = straight([[0.0, 0.0], [3.0, 0.0], [3.0, 1.0]])
    np.testing.assert_allclose(path.value([0.5, 0.75, 0.875]), [[2, 0], [3, 0], [3, 0.5]])
    speed = np.linalg.norm(path.value(S, 1), axis=1)
    np.testing.assert_allclose(speed, 4.0, rtol=1e-14)


def test_polyline_has_corners_where_it_turns_and_a_spline_has_none():
    points = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 2.0]]  # the second lies on a line
    np.testing.assert_allclose(straight(points).corners(), [0.5])
    assert spline(points).corners().size == 0
    assert straight(points[:2]).corners().size == 0


@BOTH
@pytest.mark.parametrize("s", [-1e-6, 1.0 + 1e-6, np.nan])
def test_paths_are_not_extrapolated(path, s):
    through = path(waypoints(4, 2))
    for order in (0, 1):
        with pytest.raises(UsageError, match="0 <= s <= 1"):
            through.value([0.5, s], order)


@BOTH
def test_round_off_beyond_the_ends_is_the_end(path):
    points = waypoints(4, 2)
    ends = path(points).value([-1e-16, 1.0 + 2.3e-16])
    np.testing.assert_allclose(ends, points[[0, -1]], rtol=0, atol=1e-14)


@BOTH
@pytest.mark.parametrize(
    ("points", "key", "message"),
    [
        ([[0, 0], [1, 0], [1, 0], [2, 0]], "trajectory.waypoints[2]", "same point as the one befo"),
        ([[0, 0], [1, 0], [1, 1e-15]], "trajectory.waypoints[2]", "same point as the one before"),
        ([[0, 0], [0, 0]], "trajectory.waypoints[1]", "same point as the one before it"),
    ],
)
def test_wrong_waypoints_are_named(path, points, key, message):
    with pytest.raises(MechanismError, match=message) as error:
        path(points)
    assert error.value.path == key


def test_a_closed_path_is_allowed():
    path = spline([[0, 0], [1, 0], [1, 1], [0, 0]])
    np.testing.assert_allclose(path.value([0.0, 1.0]), [[0, 0], [0, 0]], atol=1e-15)


def test_waypoints_of_the_caller_are_not_frozen_with_the_path():
    points = waypoints(4, 2)
    path = straight(points)
    points[0] = 9.0
    assert (path.value([0.0]) != 9.0).all()
    with pytest.raises(ValueError, match="read-only"):
        path.coefficients[0, 0, 0] = 1.0


# --- Tip paths with an orientation: how it runs along the path, and that arms keep to it


POINTS = [(0.6, 0.2), (0.5, 0.5), (0.2, 0.6), (-0.1, 0.5)]
SPACE = [(*p, 0.1 * k**2) for k, p in enumerate(POINTS)]
TRIPLES = [(0.1, -0.2, 0.3), (0.6, 0.1, 0.9), (1.4, -0.3, 0.2), (1.0, 0.4, -0.5)]
KINDS = pytest.mark.parametrize("kind", ["spline", "straight"])


# --- the course ---


@KINDS
def test_each_waypoint_has_its_own_orientation(kind: str) -> None:
    due = course(SPACE, 5, kind, orientation=TRIPLES)
    R = due.target(due.path.knots).rotation
    about = [turn(Z, rz) @ turn(Y, ry) @ turn(X, rx) for rx, ry, rz in TRIPLES]
    np.testing.assert_allclose(R, about, atol=1e-12)
    angles = [0.3, 2.0, 7.5, -1.0]  # full turns count
    due = course(POINTS, 5, kind, angle=angles)
    R = due.target(due.path.knots).rotation
    np.testing.assert_allclose(R[:, 0, 0], np.cos(angles), atol=1e-12)
    assert (due.rates(0.5 * (due.path.knots[1] + due.path.knots[2]))[1][0, 2]) > 10.0  # 5.5 rad up


@KINDS
@pytest.mark.parametrize("wish", [{"orientation": TRIPLES}, {"angle": [0.3, 2.0, 7.5, -1.0]}])
def test_the_rate_of_turning_is_the_derivative_of_the_orientation(kind: str, wish: dict) -> None:
    due, h = course(SPACE if "orientation" in wish else POINTS, 5, kind, **wish), 1e-5
    for s in (0.1, 0.33, 0.5, 0.77, 0.95):
        a, b = due.target(np.array([s + h, s - h])).rotation
        expected = Rotation.from_matrix(a @ b.T).as_rotvec() / (2 * h)
        np.testing.assert_allclose(due.rates(s)[1][0], expected, rtol=1e-6, atol=1e-6)


def test_a_spline_turns_smoothly_and_a_straight_path_has_corners() -> None:
    smooth = course(SPACE, 5, "spline", orientation=TRIPLES)
    assert len(smooth.corners()) == 0
    knots = smooth.path.knots
    for s in knots[1:-1]:
        before, after = smooth.rates(s - 1e-7)[1], smooth.rates(s + 1e-7)[1]
        np.testing.assert_allclose(before, after, atol=1e-4)
    cornered = course([(0, 0, 0), (1, 0, 0), (2, 0, 0)], 5, "straight", orientation=TRIPLES[:3])
    np.testing.assert_allclose(cornered.corners(), [0.5])  # though the line itself has none


def test_a_kept_orientation_does_not_turn() -> None:
    for due in (
        course(SPACE, 5, "spline", orientation=TRIPLES[1]),
        course(POINTS, 5, "spline", angle=0.7),
    ):
        assert np.abs(due.rates(0.4)[1]).max() < 1e-12
        R = due.target(np.linspace(0, 1, 9)).rotation
        np.testing.assert_allclose(R, np.tile(R[0], (9, 1, 1)), atol=1e-15)


def test_half_a_turn_between_waypoints_is_ambiguous() -> None:
    with pytest.raises(MechanismError, match="half a turn") as error:
        course(SPACE[:2], 5, orientation=[(0, 0, 0), (np.pi, 0, 0)])
    assert error.value.path == "trajectory.orientation[1]"


# --- arms ---


@KINDS
@pytest.mark.parametrize("angle", [0.4, [0.4, 0.9, 2.4, 2.0]])
def test_three_links_place_and_turn_the_tip_as_the_law_of_cosines_says(kind, angle) -> None:
    arm = serial_arm(0.5, 0.4, 0.15, absolute=False, oriented=True)
    due = course(POINTS, 60, kind, angle=angle)
    q = follow(arm, due, start=[0.0, 1.2, 0.0]).q
    target = due.target(due.s)
    last = np.unwrap(np.arctan2(target.rotation[:, 1, 0], target.rotation[:, 0, 0]))
    wrist = target.point - 0.15 * np.stack([np.cos(last), np.sin(last)], axis=1)
    expected = np.unwrap(two_link_angles(wrist, 0.5, 0.4, 1.0), axis=0)
    np.testing.assert_allclose(q[:, :2], expected, atol=1e-8)
    np.testing.assert_allclose(q.sum(axis=1), last, atol=1e-8)


def test_an_orientation_that_cannot_be_had_is_named_with_what_is_missed() -> None:
    arm = serial_arm(0.5, 0.4, oriented=True)
    due = course([(0.5, 0.2), (0.4, 0.4)], 20, angle=0.3)
    with pytest.raises(TrajectoryError) as error:
        follow(arm, due)
    assert (error.value.path, error.value.sample) == ("trajectory.angle", 0)
    assert "cannot be reached with the angle asked for" in error.value.message
    assert "move 2 of the 3 components" in error.value.message


def test_a_reachable_point_out_of_reach_for_its_orientation_says_both_misses() -> None:
    arm = serial_arm(0.5, 0.4, 0.3, oriented=True)
    due = course([(0.6, 0.2), (1.1, 0.2)], 101, angle=[0.0, np.pi / 2])
    with pytest.raises(TrajectoryError, match=r"misses the point by .* m and the angle by .* deg"):
        follow(arm, due)
