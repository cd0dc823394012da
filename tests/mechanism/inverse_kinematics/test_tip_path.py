"""Tip paths: polyline and not-a-knot cubic spline."""

from __future__ import annotations

import numpy as np
import pytest

from eigassign.errors import MechanismError, UsageError
from eigassign.mechanism import spline, straight

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
    np.testing.assert_allclose(path.point(S), reference(S), rtol=0, atol=1e-14 * m)
    np.testing.assert_allclose(path.derivative(S), reference(S, 1), rtol=0, atol=1e-13 * m**2)
    assert path.chord_length == pytest.approx(chord[-1], rel=1e-14)


@pytest.mark.parametrize("seed", range(5))
def test_spline_stands_very_uneven_chords(seed):
    from scipy.interpolate import CubicSpline

    steps = 10.0 ** np.random.default_rng(seed).uniform(-5.0, 0.0, 30)
    turns = np.random.default_rng(seed + 100).uniform(0.0, 2.0 * np.pi, 30)
    points = np.cumsum(steps[:, None] * np.stack([np.cos(turns), np.sin(turns)], axis=1), axis=0)
    path = spline(points)
    reference = CubicSpline(path.knots, points)(S)
    np.testing.assert_allclose(
        path.point(S), reference, rtol=0, atol=1e-13 * np.abs(reference).max()
    )


@BOTH
def test_paths_go_through_their_waypoints(path):
    points = waypoints(7, 3)
    through = path(points)
    np.testing.assert_allclose(through.point(through.knots), points, rtol=0, atol=1e-14)


def test_polyline_moves_by_equal_arc_lengths():
    path = straight([[0.0, 0.0], [3.0, 0.0], [3.0, 1.0]])
    assert path.chord_length == 4.0
    np.testing.assert_allclose(path.point([0.5, 0.75, 0.875]), [[2, 0], [3, 0], [3, 0.5]])
    speed = np.linalg.norm(path.derivative(S), axis=1)
    np.testing.assert_allclose(speed, 4.0, rtol=1e-14)


def test_polyline_has_corners_where_it_turns_and_a_spline_has_none():
    points = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 2.0]]  # the second lies on a line
    np.testing.assert_allclose(straight(points).corners(), [0.5])
    assert spline(points).corners().size == 0
    assert straight(points[:2]).corners().size == 0


def test_two_waypoints_make_a_line_and_three_a_parabola():
    line = spline([[0.0, 1.0], [2.0, 5.0]])
    np.testing.assert_allclose(line.point([0.25]), [[0.5, 2.0]])
    t = np.array([0.0, 1.0, 2.0])  # equal chords, so that s is t / 2
    parabola = spline(np.stack([t, (t - 1.0) ** 2], axis=1))
    np.testing.assert_allclose(parabola.point([0.25, 0.75]), [[0.5, 0.25], [1.5, 0.25]])


@BOTH
@pytest.mark.parametrize("s", [-1e-6, 1.0 + 1e-6, np.nan])
def test_paths_are_not_extrapolated(path, s):
    through = path(waypoints(4, 2))
    for evaluate in (through.point, through.derivative):
        with pytest.raises(UsageError, match="0 <= s <= 1"):
            evaluate([0.5, s])


@BOTH
def test_round_off_beyond_the_ends_is_the_end(path):
    points = waypoints(4, 2)
    ends = path(points).point([-1e-16, 1.0 + 2.3e-16])
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
    np.testing.assert_allclose(path.point([0.0, 1.0]), [[0, 0], [0, 0]], atol=1e-15)


def test_waypoints_of_the_caller_are_not_frozen_with_the_path():
    points = waypoints(4, 2)
    path = straight(points)
    points[0] = 9.0
    assert (path.point([0.0]) != 9.0).all()
    with pytest.raises(ValueError, match="read-only"):
        path.coefficients[0, 0, 0] = 1.0
