"""Corners of sampled paths: found where they are, and nowhere else."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from eigassign.modal import smooth_parts


def polyline(corners, n, rest):
    """Samples of a path through ``corners`` in equal times, at rest at each or not."""
    time = np.linspace(0.0, len(corners) - 1, n)
    i = np.minimum(time.astype(int), len(corners) - 2)
    tau = time - i
    share = 10 * tau**3 - 15 * tau**4 + 6 * tau**5 if rest else tau
    return corners[i] + share[:, None] * (corners[i + 1] - corners[i])


def off_line(s):
    reach = s - s[0]
    far = reach[np.argmax(np.linalg.norm(reach, axis=1))]
    return np.abs(reach - np.outer(reach @ far / (far @ far), far)).max()


@pytest.mark.parametrize("rest", [False, True])
@pytest.mark.parametrize(("sides", "n", "d"), [(2, 40, 2), (3, 100, 3), (7, 101, 5), (20, 400, 2)])
def test_the_sides_of_a_polyline_are_its_parts(sides, n, d, rest):
    corners = np.random.default_rng(sides).normal(size=(sides + 1, d))
    s = polyline(corners, n, rest)
    parts = smooth_parts(s)
    assert len(parts) == sides
    assert [part.start for part in parts[1:]] == [part.stop for part in parts[:-1]]
    assert (parts[0].start, parts[-1].stop) == (0, n)
    assert max(off_line(s[part]) for part in parts) < 1e-12


def test_rounding_on_a_straight_side_is_no_corner():
    s = polyline(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]), 201, rest=False)
    s = s + 1e-11 * np.random.default_rng(4).normal(size=s.shape)
    assert len(smooth_parts(s)) == 2


def test_arcs_that_meet_at_an_angle_are_parted_where_they_meet():
    a = np.linspace(0.0, 1.0, 60)
    first = np.column_stack([np.sin(a), 1 - np.cos(a)])
    second = first[-1] + np.column_stack([1 - np.cos(a), -np.sin(a)])[1:]
    parts = smooth_parts(np.vstack([first, second]))
    assert len(parts) == 2
    assert parts[1].start in (59, 60)  # the corner itself may belong to either


@pytest.mark.parametrize("n", [12, 60, 999])
@pytest.mark.parametrize("rest", [False, True])
def test_smooth_paths_are_left_whole(n, rest):
    u = np.linspace(0.0, 1.0, n)
    u = 10 * u**3 - 15 * u**4 + 6 * u**5 if rest else u
    circle = np.column_stack([np.cos(5 * u), np.sin(5 * u)])
    spline = CubicSpline([0.0, 0.3, 0.6, 1.0], [[0.0, 0.0], [1.0, 0.4], [1.8, 1.2], [3.0, 1.4]])(u)
    for s in (circle, spline, circle + 1e-12 * np.sin(1e4 * u)[:, None]):
        assert smooth_parts(s) == (slice(0, n),)


def test_there_and_back_on_a_line_with_a_pause_is_one_part():
    u = np.concatenate([np.linspace(0, 1, 20), np.ones(5), np.linspace(1, -1, 30)])
    assert smooth_parts(u[:, None] * [[0.3, -0.2]]) == (slice(0, 55),)


def test_a_pause_at_a_corner_belongs_to_one_part():
    s = polyline(np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]]), 41, False)
    s = np.vstack([s[:21], np.repeat(s[20:21], 6, axis=0), s[21:]])
    parts = smooth_parts(s)
    assert len(parts) == 2
    assert max(off_line(s[part]) for part in parts) < 1e-12


def test_noise_is_no_reason_to_cut():
    noise = np.random.default_rng(3).normal(size=(200, 2))
    assert smooth_parts(noise) == (slice(0, 200),)


def test_few_samples_are_one_part():
    for n in (1, 2, 3):
        assert smooth_parts(np.eye(3)[:n]) == (slice(0, n),)
