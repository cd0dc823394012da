"""What is drawn of a mechanism is where kinematics and modes put it."""

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scenes import SHIPPED, scene_of

import eigassign as ea
from eigassign.mechanism import Trajectories
from eigassign.study import (
    AMPLITUDE,
    ModePictures,
    draw_modes,
    draw_poses,
    rest_pose,
    with_middle_loads,
)

CASES = Path(__file__).parents[2] / "cases"
ALL = sorted(path.stem for path in CASES.glob("*.yaml"))


def test_poses_are_the_rigid_links_where_kinematics_puts_them(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, SHIPPED)
    poses = draw_poses(scene.file, scene.model, scene.path, scene.initial)
    k = int(np.flatnonzero(scene.path.time_s == poses.time_s[3])[0])
    q1, q2 = scene.path.q[k]
    elbow = 0.6 * np.array([np.cos(q1), np.sin(q1)])
    tip = elbow + 0.45 * np.array([np.cos(q2), np.sin(q2)])
    np.testing.assert_allclose(poses.lines[3][0], [[0, 0], elbow], atol=1e-12)
    np.testing.assert_allclose(poses.lines[3][1], [elbow, tip], atol=1e-12)
    bodies = {body.name: body.places for body in poses.bodies}
    np.testing.assert_allclose(bodies["elbow_mass"][3], elbow, atol=1e-12)
    np.testing.assert_allclose(bodies["tool_mass"][3], tip, atol=1e-12)
    np.testing.assert_allclose(poses.tip_path[k], tip, atol=1e-9)


def test_poses_say_which_of_several_trajectories_they_belong_to() -> None:
    case = ea.load_case(CASES / "pick_and_place.yaml")
    several, alone = case.trajectory, case.trajectory.parts[:1]
    assert len(several.parts) > 1
    poses = draw_poses(case.file, case.model(), several, case.initial_design)
    for time_s, whose in zip(poses.time_s, poses.of, strict=True):
        (part,) = [part for part in several.parts if part.name == whose]
        assert time_s in part.trajectory.time_s
    assert {*poses.of} == {part.name for part in several.parts}
    one = draw_poses(case.file, case.model(), Trajectories(tuple(alone)), case.initial_design)
    assert one.of == ()


@cache
def pictures(name: str, count: int = 2) -> tuple[ea.Case, ModePictures]:
    case = ea.load_case(CASES / f"{name}.yaml")
    q = with_middle_loads(case.file, case.file.expansion.q)
    return case, draw_modes(case.file, case.model(), q, case.initial_design, count)


@pytest.mark.parametrize("name", ALL)
def test_modes_are_drawn_with_the_stated_amplitude_over_the_links_at_rest(name: str) -> None:
    case, found = pictures(name)
    q = with_middle_loads(case.file, case.file.expansion.q)
    rest = rest_pose(case.file, case.model(), np.array(q), case.initial_design)
    for line, straight in zip(found.rest.lines[0], rest.lines[0], strict=True):
        np.testing.assert_allclose(line[[0, -1]], straight, atol=1e-12)
    extent = np.linalg.norm(np.ptp(np.concatenate(found.rest.lines[0]), axis=0))
    for lines in found.deformed.lines:
        moved = [
            np.linalg.norm(line - at, axis=1).max()
            for line, at in zip(lines, found.rest.lines[0], strict=True)
        ]
        assert max(moved) == pytest.approx(AMPLITUDE * extent)


@pytest.mark.parametrize("name", ALL)
def test_joints_bodies_and_springs_are_drawn_on_the_lines(name: str) -> None:
    case, found = pictures(name)
    for poses in (found.rest, found.deformed):
        assert {j.name for j in poses.joints} == set(case.file.mechanism.joints)
        assert {b.name for b in poses.bodies} >= set(case.file.mechanism.bodies)
        for pose, lines in enumerate(poses.lines):
            ends = np.concatenate([line[[0, -1]] for line in lines])
            every = np.concatenate(lines)
            marks = [joint.places[pose] for joint in poses.joints if joint.kind == "turning"]
            marks += [spring.starts[pose] for spring in poses.springs]
            for place in marks:
                assert np.linalg.norm(ends - place, axis=1).min() < 1e-9
            for body in poses.bodies:  # a carriage may stand between the ends
                assert np.linalg.norm(every - body.places[pose], axis=1).min() < 1e-2


def test_a_joint_is_marked_by_what_it_lets_move() -> None:
    for name, expected in {
        "slider_crank": {"bearing": ("turning", True, True), "guide": ("sliding", True, False)},
        "gantry": {"left_foot": ("fixed", True, False), "rail": ("sliding", False, True)},
        "ball_screw": {"nut": ("sliding", False, True), "fixed_bearing": ("turning", True, False)},
    }.items():
        _, found = pictures(name)
        marks = {j.name: (j.kind, j.grounded, j.driven) for j in found.rest.joints}
        assert expected.items() <= marks.items()


def test_masses_and_thicknesses_are_those_of_the_design() -> None:
    case = ea.load_case(CASES / "gantry.yaml")
    q, y = np.array([0.8]), case.initial_design.copy()
    y[1] = 4.5
    found = draw_modes(case.file, case.model(), q, y, 1)
    (carriage,) = found.rest.bodies
    assert (carriage.name, carriage.mass) == ("carriage", 4.5)
    _, arm = pictures("arm_6r")
    depths = dict(zip(arm.rest.line_links, arm.rest.depths, strict=True))
    assert depths["forearm"] == pytest.approx([0.09, 0.07])  # a taper
    assert depths["hand"] == (0.0, 0.0)
    assert found.rest.depths[0] == (0.05, 0.05)
    y[0] = 0.06
    thicker = draw_modes(case.file, case.model(), q, y, 1).rest
    assert (0.06, 0.06) in thicker.depths


def test_without_a_tip_the_path_is_that_of_the_point_that_travels_farthest() -> None:
    case = ea.load_case(CASES / "luffing_boom.yaml")
    path = case.trajectory
    poses = draw_poses(case.file, case.model(), path, case.initial_design)
    x = case.model().x(path.q, case.initial_design)
    head = case.model().poses.position(x, "boom", "head")
    np.testing.assert_allclose(poses.tip_path, head[:, :2], atol=1e-12)
