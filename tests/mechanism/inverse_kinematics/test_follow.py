"""Inverse kinematics along paths, against closed forms: arms that turn, and that slide as well."""

import re
from functools import partial
from typing import Any

import numpy as np
import pytest
from planar_arms import open_chain_tip, serial_arm, two_link_angles
from spatial_cases import built, linkage
from tip_paths import chain_of, course

from eigassign.errors import MechanismError, TrajectoryError
from eigassign.mechanism import Course, TipChain, follow, tip_path

straight, spline = (partial(tip_path, kind=kind) for kind in ("straight", "spline"))
TAU = 2.0 * np.pi
UP, DOWN = {"elbow": (0.0, np.pi)}, {"elbow": (np.pi, TAU)}


def timed_course(path: Any, n: int = 50) -> Course:
    s = np.linspace(0.0, 1.0, n)
    return Course(path, s, 2.0 * s)


def away(a: np.ndarray, b: np.ndarray) -> float:
    """Largest difference of two sets of angles, modulo 2π."""
    return float(np.abs((a - b + np.pi) % TAU - np.pi).max())


def reachable_path(seed: int, l1: float, l2: float) -> Any:
    """A random spline or polyline that stays off both ends of a two-link arm's reach."""
    rng = np.random.default_rng(seed)
    inner, outer = abs(l1 - l2), l1 + l2
    while True:
        r = rng.uniform(inner, outer, 5)
        theta = np.cumsum(rng.uniform(-1.2, 1.2, 5))
        points = np.stack([r * np.cos(theta), r * np.sin(theta)], axis=1)
        path = (spline, straight)[seed % 2](points)
        radius = np.linalg.norm(path.value(np.linspace(0.0, 1.0, 2000)), axis=1)
        if radius.min() > inner + 0.02 * outer and radius.max() < 0.98 * outer:
            return path


@pytest.mark.parametrize(("branch", "sign"), [(UP, 1.0), (DOWN, -1.0)], ids=["up", "down"])
@pytest.mark.parametrize("absolute", [True, False])
@pytest.mark.parametrize("seed", range(8))
def test_two_links_follow_random_paths_as_the_law_of_cosines_says(seed, absolute, branch, sign):
    l1, l2 = np.random.default_rng(seed).uniform(0.3, 1.0, 2)
    arm, path = serial_arm(l1, l2, absolute=absolute), reachable_path(seed, l1, l2)
    samples = timed_course(path, n=3 + 40 * (seed % 4))
    q = follow(arm, samples, branch).q
    relative = q @ arm.relative_map[0].T
    # 1e-10 of the tip over a singular value of at least 0.02: 1e-8 rad
    assert away(relative, two_link_angles(path.value(samples.s), l1, l2, sign)) < 1e-8


@pytest.mark.parametrize("absolute", [True, False])
def test_angles_do_not_jump_at_half_turns_however_often_the_tip_goes_round(absolute):
    theta = np.linspace(0.3, 0.3 + 3 * TAU, 80)
    path = spline(0.8 * np.stack([np.cos(theta), np.sin(theta)], axis=1))
    q = follow(serial_arm(0.6, 0.45, absolute=absolute), timed_course(path, 400), UP).q
    turns = [3 * TAU, 3 * TAU] if absolute else [3 * TAU, 0.0]
    np.testing.assert_allclose(q[-1] - q[0], turns, atol=1e-8)
    assert np.abs(np.diff(q, axis=0)).max() < 0.1


def test_two_samples_are_joined_along_the_path_and_not_across_it():
    theta = np.linspace(0.0, 1.4 * np.pi, 40)
    path = spline(0.8 * np.stack([np.cos(theta), np.sin(theta)], axis=1))
    q = follow(serial_arm(0.6, 0.45), timed_course(path, 2), UP).q
    np.testing.assert_allclose(q[1] - q[0], 1.4 * np.pi, atol=1e-8)


@pytest.mark.parametrize("absolute", [True, False])
def test_a_path_is_on_the_turn_nearest_to_its_branch_to_zero_or_near_the_start(absolute):
    arm = serial_arm(0.6, 0.45, absolute=absolute)
    samples = timed_course(straight([(0.5, -0.4), (0.3, -0.5)]))
    free = follow(arm, samples).q
    joints = free @ arm.relative_map[0].T
    assert (np.abs(joints.max(axis=0) + joints.min(axis=0)) <= TAU).all()
    for branch in UP, {"elbow": (TAU, 1.5 * TAU)}, {"elbow": (-2.0 * TAU, -1.5 * TAU)}:
        q = follow(arm, samples, branch).q
        low, high = branch["elbow"]
        elbow = (q @ arm.relative_map[0].T)[:, 1]
        assert ((elbow >= low) & (elbow <= high)).all()
        assert away(q, free) < 1e-9
        assert np.abs(np.diff(q, axis=0)).max() < 0.1
    near = follow(arm, samples, UP, start=free[0] - [2 * TAU, TAU] + 0.3).q
    np.testing.assert_allclose(near - free, np.tile([-2 * TAU, -TAU], (50, 1)), atol=1e-9)


def test_the_first_sample_is_the_solution_nearest_to_any_start():
    arm, path = serial_arm(0.6, 0.45, absolute=False), straight([(0.5, 0.2), (0.45, 0.3)])
    both = [two_link_angles(path.value(0.0), 0.6, 0.45, sign)[0] for sign in (1.0, -1.0)]
    for start in np.random.default_rng(3).uniform(-8.0, 8.0, (25, 2)):
        near = [start + (q - start + np.pi) % TAU - np.pi for q in both]
        nearest = min(near, key=lambda q: np.linalg.norm(q - start))
        q = follow(arm, timed_course(path, 2), start=start).q
        np.testing.assert_allclose(q[0], nearest, atol=1e-9)


def test_without_branch_or_start_the_elbow_bends_anticlockwise_and_a_note_says_so():
    arm, path = serial_arm(0.6, 0.45, absolute=False), straight([(0.5, 0.2), (0.2, 0.5)])
    followed = follow(arm, timed_course(path))
    assert ((followed.q[:, 1] > 0.0) & (followed.q[:, 1] < np.pi)).all()
    (note,) = followed.notes
    assert note.startswith("the first sample can be reached in 2 ways; taken is start: [")
    first, second = ([float(v.split()[0]) for v in re.findall(r"-?[\d.]+ deg", part)]
                     for part in note.split("others are"))  # fmt: skip
    taken, other = (follow(arm, timed_course(path), start=np.radians(v)).q for v in (first, second))
    np.testing.assert_allclose(taken, followed.q, atol=1e-9)  # as the note says
    assert -np.pi < other[0, 1] < 0.0


def test_another_first_solution_is_tried_if_the_preferred_one_leaves_the_branch():
    # elbows from 60 to 300 deg allow both solutions; narrowed on one side only the other one stays
    path = straight([(0.5, 0.2), (0.9, 0.3)])
    elbow = np.degrees(two_link_angles(path.value([0.0, 1.0]), 0.6, 0.45, 1.0)[:, 1])
    branch = {"elbow": (np.radians(elbow[1] + 5.0), np.radians(360.0 - elbow[1] + 5.0))}
    q = follow(serial_arm(0.6, 0.45, absolute=False), timed_course(path), branch).q
    assert (q[:, 1] > np.pi).all()


# --- what cannot be followed ---


def failure(arm: TipChain, path: Any, n: int = 50, **wishes: object) -> TrajectoryError:
    with pytest.raises(TrajectoryError) as error:
        follow(arm, timed_course(path, n), **wishes)
    return error.value


@pytest.mark.parametrize(("last", "reach"), [(1.3, 1.05), (0.05, 0.15)], ids=["far", "near"])
def test_a_point_out_of_reach_is_named_with_its_distance(last, reach):
    path = straight([(0.5, 0.0), (last, 0.0)])
    beyond = (path.value(np.linspace(0, 1, 50))[:, 0] - reach) * np.sign(last - reach)
    sample = int(np.argmax(beyond > 0.0))
    error = failure(serial_arm(0.6, 0.45), path)
    assert error.sample == sample
    assert error.path == "trajectory.waypoints[1]"
    assert error.message.startswith(f"waypoint 2 ({last:.6g}, 0) m is ")
    distance = float(error.message.split(" is ")[1].split(" m out of reach")[0])
    assert distance == pytest.approx(beyond[-1], rel=6e-3)  # printed with 3 digits
    assert error.message.endswith(f", {reach:.3g} m from joint shoulder")


def test_waypoints_within_reach_between_which_the_path_is_not_are_named():
    error = failure(serial_arm(0.6, 0.3), straight([(0.5, 0.5), (0.8, 0.0), (-0.8, 0.05)]))
    assert error.path == "trajectory.waypoints"
    assert error.message.startswith(f"between waypoints 2 and 3, sample {error.sample} (t = ")


def test_an_excursion_out_of_reach_between_two_samples_is_found():
    path = straight([(0.6, 0.0), (1.06, 0.0), (0.6, 0.3)])
    error = failure(serial_arm(0.6, 0.45), path, n=2)
    assert error.sample == 1
    assert error.message.startswith("waypoint 2 (1.06, 0) m is 0.01 m out of reach")


def test_a_sample_outside_the_branch_is_named_with_its_angle():
    path = straight([(0.5, 0.2), (0.9, 0.4)])
    elbow = np.degrees(two_link_angles(path.value(np.linspace(0, 1, 50)), 0.6, 0.45, 1.0)[:, 1])
    branch = {"elbow": (np.radians(elbow[20] - 0.01), np.pi)}
    error = failure(serial_arm(0.6, 0.45), path, branch=branch)
    assert error.sample == 21
    assert error.path == "trajectory.branch.elbow"
    assert f"needs joint elbow at {elbow[21]:.6g} deg" in error.message


def test_a_first_sample_with_no_solution_in_the_branch_is_named():
    error = failure(
        serial_arm(0.6, 0.45), straight([(0.5, 0.2), (0.2, 0.5)]), branch={"elbow": (1.0, 1.1)}
    )
    assert error.sample == 0
    assert "[57.2958, 63.0254] deg" in error.message


@pytest.mark.parametrize("branch", [UP, DOWN, {}], ids=["up", "down", "free"])
@pytest.mark.parametrize("angle", [0.0, 0.7, 2.5])
def test_a_path_through_full_stretch_is_refused_even_between_samples(angle, branch):
    touch = 1.05 * np.array([np.cos(angle), np.sin(angle)])
    path = straight([0.7 * touch, touch, 0.5 * touch[::-1]])
    n = 30
    assert path.corners()[0] * (n - 1) % 1 > 0.01  # no sample is stretched itself
    error = failure(serial_arm(0.6, 0.45), path, n, branch=branch)
    assert error.sample == int(path.corners()[0] * (n - 1)) + 1
    assert "stretched or folded" in error.message


def test_a_path_just_short_of_full_stretch_is_followed_on_its_branch():
    touch = 1.05 - 1e-5
    path = straight([(0.7, 0.0), (touch, 0.0), (0.6, 0.3)])
    q = follow(serial_arm(0.6, 0.45, absolute=False), timed_course(path, 200), DOWN).q
    expected = two_link_angles(path.value(np.linspace(0, 1, 200)), 0.6, 0.45, -1.0)
    assert away(q, expected) < 1e-7


# --- more and fewer coordinates than the tip has components ---


def test_one_link_follows_a_polyline_if_all_samples_lie_on_its_circle():
    theta = np.linspace(0.2, 1.4, 9)
    path = straight(0.5 * np.stack([np.cos(theta), np.sin(theta)], axis=1))
    q = follow(serial_arm(0.5), timed_course(path, 9)).q
    np.testing.assert_allclose(q[:, 0], theta, atol=1e-9)


def test_a_tip_that_leaves_coordinates_a_choice_is_refused_by_name():
    path = timed_course(straight([(0.5, 0.3), (0.45, 0.35)]))
    with pytest.raises(MechanismError, match="fixes 2 of 3 coordinates: ask for its angle"):
        follow(serial_arm(0.5, 0.4, 0.3), path)
    with pytest.raises(
        MechanismError, match=r"fixes 1 of 2.*, and what drives elbow not at all"
    ) as error:
        follow(serial_arm(0.6, 0.0), path, start=[0.0, 2.5])
    assert error.value.path == "trajectory.tip"


# --- Tip paths of arms that slide as well as turn: metres and radians side by side


FAR = [(0.5, 3.0), (2.0, 7.5), (6.0, 5.0)]  # m: far more than 2π, all of it


def polar_arm() -> TipChain:
    """A boom that turns by q1 and slides by q2: the tip is at q2 (cos q1, sin q1)."""

    def evaluate(q):
        c, s, r = np.cos(q[:, 0]), np.sin(q[:, 0]), q[:, 1]
        J = np.stack([np.stack([-r * s, c], axis=1), np.stack([r * c, s], axis=1)], axis=1)
        return open_chain_tip(np.stack([r * c, r * s], axis=1), J)

    return TipChain(evaluate, ("turn", "boom"), (np.eye(2), np.zeros(2)), ("turn", "slide"))


def expected(points: np.ndarray, sign: float) -> np.ndarray:
    x, y = points.T
    return np.stack([np.arctan2(sign * y, sign * x) % (2 * np.pi), sign * np.hypot(x, y)], axis=1)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_slide_is_no_angle(sign: float) -> None:
    """A range of 1 to 10 m, and places beyond 2π in it, were once taken modulo 2π."""
    due = course(FAR, 40, "spline")
    branch = {"boom": (1.0, 10.0) if sign > 0 else (-10.0, -1.0)}
    off = follow(polar_arm(), due, branch).q - expected(due.path.value(due.s), sign)
    np.testing.assert_allclose(off, [TAU * np.round(off[0, 0] / TAU), 0.0] + 0.0 * off, atol=1e-8)


def test_a_place_outside_its_range_is_named_in_metres() -> None:
    due = course([(2.0, 0.0), (9.0, 0.0)], 71)
    with pytest.raises(TrajectoryError) as error:
        follow(polar_arm(), due, {"boom": (1.0, 7.0)})  # 9 - 2π would be inside
    assert (error.value.path, error.value.sample) == ("trajectory.branch.boom", 51)
    assert "needs joint boom at 7.1 m, outside its range [1, 7] m" in error.value.message


def test_a_start_in_metres_is_kept() -> None:
    due = course([(2.0, 0.0), (9.0, 0.5)], 9)
    q = follow(polar_arm(), due, start=[2 * np.pi, 9.0]).q
    np.testing.assert_allclose(q[0], [2 * np.pi, 2.0], atol=1e-9)
    q = follow(polar_arm(), due, start=[np.pi, -9.0]).q
    np.testing.assert_allclose(q[0], [np.pi, -2.0], atol=1e-9)


RIGID = {"type": "rigid", "mass": 1.0}


def spatial(joints: dict, links: dict, coordinates: dict) -> dict:
    return linkage(links, joints, coordinates, sections={}, materials={}, space="spatial")


def link(*end: float) -> dict:
    return RIGID | {"inertia": [0.1, 0.1, 0.1], "nodes": {"end": list(end)}}


def test_a_screw_turns_as_often_as_its_path_is_long() -> None:
    tree = spatial(
        {"s": {"type": "screw", "base": "ground", "follower": "table.start", "lead": 0.02}},
        {"table": link(0, 0, 0.1)},
        {"q": {"joint": "s"}},
    )
    due = course([(0, 0, 0.2), (0, 0, 0.9)], 21)
    q = follow(chain_of(built(tree), "table.end"), due).q[:, 0]
    np.testing.assert_allclose(q, (due.path.value(due.s)[:, 2] - 0.1) * 2 * np.pi / 0.02, atol=1e-7)


def test_a_mechanism_without_coordinates_follows_nothing() -> None:
    tree = spatial(
        {"f": {"type": "fixed", "base": "ground", "follower": "l.start"}}, {"l": link(1, 0, 0)}, {}
    )
    with pytest.raises(MechanismError, match="no coordinate moves"):
        follow(chain_of(built(tree), "l.end"), course([(1, 0, 0), (2, 0, 0)], 3))
