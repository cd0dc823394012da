"""Rates of sampled motions: within smooth parts only."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from eigassign import load_case
from eigassign.case import PointTrajectory
from eigassign.mechanism import TipChain, Trajectory, build_trajectory, rates

CASE = Path(__file__).parents[3] / "cases" / "two_link.yaml"
WAYPOINTS = [[0.30, 0.19], [0.108, 0.2104], [0.02, 0.1845]]


def no_arm(node: str, oriented: bool) -> TipChain:
    raise AssertionError("points need no kinematics")


def test_a_smooth_motion_is_differentiated_as_a_whole() -> None:
    t = np.linspace(0.0, 1.0, 21)
    found = rates(Trajectory(t, np.stack([t**2, 3.0 - t], axis=1), None))
    np.testing.assert_array_equal(found.samples, np.arange(21))
    np.testing.assert_allclose(found.rate, np.stack([2 * t, -np.ones(21)], axis=1), atol=1e-12)
    np.testing.assert_allclose(found.acceleration, [[2.0, 0.0]] * 21, atol=1e-10)


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
    t = np.linspace(0.0, 1.0, 5)
    found = rates(Trajectory(t, np.abs(t - 0.5)[:, None], None, (), (0.5,)))
    np.testing.assert_array_equal(found.samples, [0, 1, 2, 2, 3, 4])
    np.testing.assert_allclose(found.rate[:, 0], [-1, -1, -1, 1, 1, 1], atol=1e-12)


def test_a_lone_sample_between_two_corners_tells_no_rate() -> None:
    t = np.linspace(0.0, 1.0, 5)
    found = rates(Trajectory(t, t[:, None], None, (), (0.4, 0.6)))
    np.testing.assert_array_equal(found.samples, [0, 1, 3, 4])


def test_a_straight_tip_path_says_when_it_turns_its_corners(tmp_path: Path) -> None:
    """Passed at speed: accelerations stay those of the straight parts, however fine the samples."""
    text = CASE.read_text(encoding="utf-8").replace("path: spline", "path: straight")
    largest = []
    for samples in (152, 608):
        path = tmp_path / f"{samples}.yaml"
        path.write_text(text.replace("samples: 152", f"samples: {samples}"), encoding="utf-8")
        trajectory = load_case(path).trajectories[0].trajectory
        corners = np.array(trajectory.corners_s)
        assert len(corners) == 3
        tips = [np.interp(corners, trajectory.time_s, x) for x in trajectory.tip.T]
        # two samples at most 4 mm apart cut the corner
        np.testing.assert_allclose(np.transpose(tips), WAYPOINTS, atol=2e-3)
        largest.append(np.abs(rates(trajectory).acceleration).max())
    assert largest[1] == pytest.approx(largest[0], rel=0.1)
