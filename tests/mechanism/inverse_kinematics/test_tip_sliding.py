"""Tip paths of arms that slide as well as turn: metres and radians side by side."""

from __future__ import annotations

import numpy as np
import pytest
from planar_arms import open_chain_tip
from spatial_cases import built
from tip_paths import chain_of, course

from eigassign.errors import MechanismError, TrajectoryError
from eigassign.mechanism import TipChain, follow

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
    q = follow(polar_arm(), due, branch).q
    np.testing.assert_allclose(q, expected(due.path.point(due.s), sign), atol=1e-8)


def test_a_place_outside_its_range_is_named_in_metres() -> None:
    due = course([(2.0, 0.0), (9.0, 0.0)], 71)
    with pytest.raises(TrajectoryError) as error:
        follow(polar_arm(), due, {"boom": (1.0, 7.0)})  # 9 - 2π would be inside
    assert (error.value.path, error.value.sample) == ("trajectory.branch.boom", 51)
    assert "needs joint boom at 7.1 m, outside its range [1, 7] m" in error.value.message


def test_a_place_is_not_inside_its_range_for_being_a_full_turn_further() -> None:
    with pytest.raises(TrajectoryError, match=r"boom at -?8 m, outside its range \[1, 3\] m"):
        follow(polar_arm(), course([(8.0, 0.0), (8.5, 0.0)], 9), {"boom": (1.0, 3.0)})


def test_a_start_in_metres_is_kept() -> None:
    due = course([(2.0, 0.0), (9.0, 0.5)], 9)
    q = follow(polar_arm(), due, start=[2 * np.pi, 9.0]).q
    np.testing.assert_allclose(q[0], [2 * np.pi, 2.0], atol=1e-9)
    q = follow(polar_arm(), due, start=[np.pi, -9.0]).q
    np.testing.assert_allclose(q[0], [np.pi, -2.0], atol=1e-9)


RIGID = {"type": "rigid", "mass": 1.0}


def spatial(joints: dict, links: dict, coordinates: dict) -> dict:
    return {
        "mechanism": {
            "space": "spatial", "materials": {}, "sections": {}, "joints": joints, "links": links,
        },
        "coordinates": coordinates,
    }  # fmt: skip


def link(*end: float) -> dict:
    return RIGID | {"inertia": [0.1, 0.1, 0.1], "nodes": {"end": list(end)}}


def test_three_slides_make_a_cartesian_robot() -> None:
    axes = np.eye(3).tolist()
    names = ("x", "y", "z")
    bases = ("ground", "x.end", "y.end")
    tree = spatial(
        {n: {"type": "prismatic", "base": b, "follower": f"{n}.start", "axis": a}
         for n, b, a in zip(names, bases, axes, strict=True)},
        {n: link(0.1, 0.2, 0.3) for n in names},
        {n: {"joint": n} for n in names},
    )  # fmt: skip
    points = np.array([(1.0, -2.0, 12.0), (3.0, 8.0, -4.0)])
    due = course(points, 11)
    q = follow(chain_of(built(tree), "z.end"), due).q
    np.testing.assert_allclose(q, due.path.point(due.s) - [0.3, 0.6, 0.9], atol=1e-12)


def test_a_scara_places_and_turns_its_tool() -> None:
    """Two turns, a cylindrical quill: closed form by the law of cosines."""
    up = {"orientation": [0, 0, 0]}
    tree = spatial(
        {
            "shoulder": {"type": "revolute", "base": "ground", "follower": "upper.start"} | up,
            "elbow": {"type": "revolute", "base": "upper.end", "follower": "fore.start"} | up,
            "quill": {"type": "cylindrical", "base": "fore.end", "follower": "tool.start"} | up,
        },
        {"upper": link(0.5, 0, 0), "fore": link(0.4, 0, 0), "tool": link(0, 0, -0.3)},
        {
            "q1": {"joint": "shoulder"},
            "q2": {"joint": "elbow"},
            "z": {"joint": "quill", "component": "translation"},
            "turn": {"joint": "quill", "component": "rotation"},
        },
    )
    points = [(0.6, 0.2, 0.1), (0.4, 0.5, -0.2), (0.1, 0.7, 0.0)]
    turns = [(0, 0, 0.2), (0, 0, 1.0), (0, 0, 0.5)]
    due = course(points, 50, "straight", orientation=turns)
    chain = chain_of(built(tree), "tool.end", oriented=True)
    q = follow(chain, due, start=[0.0, 1.0, 0.0, 0.0]).q
    x, y, z = due.path.point(due.s).T
    elbow = np.arccos((x**2 + y**2 - 0.41) / 0.4)
    shoulder = np.arctan2(y, x) - np.arctan2(0.4 * np.sin(elbow), 0.5 + 0.4 * np.cos(elbow))
    R = due.target(due.s).rotation
    turn = np.arctan2(R[:, 1, 0], R[:, 0, 0]) - shoulder - elbow
    np.testing.assert_allclose(q, np.stack([shoulder, elbow, z + 0.3, turn], axis=1), atol=1e-8)


def test_a_screw_turns_as_often_as_its_path_is_long() -> None:
    tree = spatial(
        {"s": {"type": "screw", "base": "ground", "follower": "table.start", "lead": 0.02}},
        {"table": link(0, 0, 0.1)},
        {"q": {"joint": "s"}},
    )
    due = course([(0, 0, 0.2), (0, 0, 0.9)], 21)
    q = follow(chain_of(built(tree), "table.end"), due).q[:, 0]
    np.testing.assert_allclose(q, (due.path.point(due.s)[:, 2] - 0.1) * 2 * np.pi / 0.02, atol=1e-7)


def test_a_spherical_joint_and_a_slide_point_anywhere() -> None:
    tree = spatial(
        {
            "ball": {"type": "spherical", "base": "ground", "follower": "boom.start"},
            "slide": {"type": "prismatic", "base": "boom.end", "follower": "tip.start",
                      "axis": [1, 0, 0]},
        },
        {"boom": link(0.5, 0, 0), "tip": link(0.1, 0, 0)},
        {f"b{k}": {"joint": "ball", "component": k} for k in (1, 2, 3)} | {"d": {"joint": "slide"}},
    )  # fmt: skip
    model = built(tree)
    due = course([(0.7, 0.3, 0.2), (0.5, -0.4, 0.5)], 30)
    followed = follow(chain_of(model, "tip.end"), due, start=[0.0, 0.0, 0.0, 0.1])
    d = np.linalg.norm(due.path.point(due.s), axis=1) - 0.6
    np.testing.assert_allclose(followed.q[:, 3], d, atol=1e-9)
    assert "fixes 3 of 4 coordinates" in followed.notes[0]
    assert f"a slide of {due.size:.3g} m counting as 1 rad" in followed.notes[0]
    assert due.size == np.sqrt(0.66)  # m: the second waypoint is the one far away


def test_a_mechanism_without_coordinates_follows_nothing() -> None:
    tree = spatial(
        {"f": {"type": "fixed", "base": "ground", "follower": "l.start"}}, {"l": link(1, 0, 0)}, {}
    )
    with pytest.raises(MechanismError, match="no coordinate moves"):
        follow(chain_of(built(tree), "l.end"), course([(1, 0, 0), (2, 0, 0)], 3))
