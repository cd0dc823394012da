"""Point to point in the joints: from the case file to q(t)."""

from __future__ import annotations

import numpy as np
import pytest

from eigassign.case import PointTrajectory
from eigassign.mechanism import build_trajectory, timing_law

Q = ("q1", "q2")
POINTS = ((0.0, 0.2), (1.0, 0.2), (0.5, 0.6), (0.5, 0.7))


def motion(**changes: object) -> object:
    def no_chain(node: str, oriented: bool) -> object:
        raise AssertionError("points in the joints need no kinematics")

    keys = {"points": POINTS, "duration": 4.0, "samples": 401}
    spec = PointTrajectory.model_construct(**(keys | changes))
    return build_trajectory(spec, Q, no_chain, q_units=("rad", "m"))  # type: ignore[arg-type]


def test_every_point_is_reached_at_its_time():
    path = motion(duration=None, times=(1.0, 1.5, 3.0, 5.0))
    assert (path.time_s[0], path.time_s[-1]) == (1.0, 5.0)
    for time, point in zip((1.0, 1.5, 3.0, 5.0), POINTS, strict=True):
        k = int(np.flatnonzero(np.isclose(path.time_s, time))[0])
        np.testing.assert_allclose(path.q[k], point, atol=1e-12)
    assert path.tip is None
    assert path.notes == ()


@pytest.mark.parametrize("timing", ["linear", "cubic", "quintic", "trapezoidal"])
def test_each_segment_runs_by_the_timing_law(timing):
    path = motion(timing=timing, duration=None, times=(0.0, 1.0, 3.0, 4.0))
    for k, (start, end) in enumerate([(0.0, 1.0), (1.0, 3.0), (3.0, 4.0)]):
        inside = (path.time_s >= start) & (path.time_s < end)
        s = timing_law(timing).position((path.time_s[inside] - start) / (end - start))
        a, b = np.array(POINTS[k]), np.array(POINTS[k + 1])
        np.testing.assert_allclose(path.q[inside], a + s[:, None] * (b - a), atol=1e-12)


@pytest.mark.parametrize(
    ("timing", "fastest"), [("cubic", 1.5), ("quintic", 1.875), ("trapezoidal", 1 / (1 - 0.2))]
)
def test_it_rests_at_each_point_and_its_peak_velocity_is_the_laws(timing, fastest):
    h = 1e-3
    path = motion(
        timing=timing, acceleration_share=0.2, duration=None, times=(0, 1, 2, 3), samples=3001
    )
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


def test_two_points_leave_nothing_to_tell():
    assert motion(points=POINTS[:2]).notes == ()


def test_it_waits_where_two_points_are_the_same_and_times_are_given():
    path = motion(points=(POINTS[0], POINTS[0], POINTS[1]), duration=None, times=(0, 1, 2))
    np.testing.assert_allclose(path.q[:201], np.tile(POINTS[0], (201, 1)), atol=1e-15)
