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
