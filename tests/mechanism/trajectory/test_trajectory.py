"""From the trajectory of a case to q(t)."""

from __future__ import annotations

import numpy as np
import pytest
from planar_arms import serial_arm

from eigassign.case import FileTrajectory, SampledTrajectory, TipTrajectory
from eigassign.errors import TrajectoryError
from eigassign.mechanism import TipChain, build_trajectory

Q = ("q1", "q2")
PAPER = ((0.33, 0.12), (0.30, 0.19), (0.108, 0.2104), (0.02, 0.1845), (-0.01, 0.19))


def arm(node: str, oriented: bool) -> TipChain:
    assert node == "forearm.end"
    return serial_arm(0.6, 0.45, oriented=oriented)


def no_arm(node: str, oriented: bool) -> TipChain:
    raise AssertionError("joint samples need no kinematics")


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


@pytest.mark.parametrize(
    ("timing", "s"), [("linear", 0.25), ("cubic", 5 / 32), ("quintic", 53 / 512)]
)
def test_the_timing_law_says_how_far_the_tip_is(timing, s):
    line = ((0.5, 0.2), (0.2, 0.5))
    spec = tip_path(waypoints=line, path="straight", timing=timing, samples=5, branch={})
    expected = (1 - s) * np.array(line[0]) + s * np.array(line[1])
    np.testing.assert_allclose(build_trajectory(spec, Q, arm).tip[1], expected, atol=1e-12)


def test_straight_and_spline_paths_differ_between_the_same_waypoints():
    spline = build_trajectory(tip_path(branch={}), Q, arm)
    straight = build_trajectory(tip_path(branch={}, path="straight"), Q, arm)
    assert np.abs(spline.tip - straight.tip).max() > 1e-3


def test_choices_that_were_made_are_noted():
    assert build_trajectory(tip_path(), Q, arm).notes == ()
    assert "2 ways" in build_trajectory(tip_path(branch={}), Q, arm).notes[0]


def test_an_unreachable_waypoint_is_an_error_naming_sample_time_and_point():
    spec = tip_path(waypoints=((0.33, 0.12), (0.9, 0.9)), branch={}, path="straight")
    with pytest.raises(TrajectoryError, match=r"sample \d+ \(t = 1\.\d+ s, point \(.*out of reach"):
        build_trajectory(spec, Q, arm)


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


def test_listed_samples_far_apart_are_noted_and_near_ones_are_not():
    far = samples(q=((0.5, 0.0), (0.5, 1.0), (0.5, 0.9)), duration=1.0)
    (note,) = build_trajectory(far, Q, no_arm).notes
    assert note.startswith("q2 moves by 57.3 deg from sample 0 to 1")
    assert build_trajectory(far, Q, no_arm, q_units=("rad", "m")).notes == ()
    near = samples(q=((0.5, 0.0), (0.5, 0.3)), duration=1.0)
    assert build_trajectory(near, Q, no_arm).notes == ()


OK = ((0.1, 0.2), (0.3, 0.4), (0.5, 0.6))


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


@pytest.mark.parametrize("spec", [tip_path(), samples(q=OK, duration=1.0)], ids=["tip", "samples"])
def test_arrays_are_frozen(spec):
    trajectory = build_trajectory(spec, Q, arm)
    for array in (trajectory.time_s, trajectory.q, trajectory.tip):
        assert array is None or not array.flags.writeable
