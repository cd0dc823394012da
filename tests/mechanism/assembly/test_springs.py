"""Springs: like drives where they act alike, in balance, in local axes, against the plain frame."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import pytest
from spatial_cases import ALLOY, built, changed
from spatial_examples import gantry
from spatial_oracle import Tree, world

from eigassign.modal import eigenvalues


def arm(
    springs: Tree, drives: tuple[Any, Any] = ("locked", "locked"), space: str = "planar"
) -> Tree:
    return {
        "mechanism": {
            "space": space,
            "materials": {"m": ALLOY},
            "sections": {"s": {"shape": "tube", "outer_diameter": 0.03, "thickness": 0.003}},
            "links": {
                "a": {"length": 0.5, "elements": 2, "material": "m", "section": "s"},
                "b": {"length": 0.4, "elements": 2, "material": "m", "section": "s"},
            },
            "joints": {
                "s": {"type": "revolute", "base": "ground", "follower": "a.start"},
                "e": {"type": "revolute", "base": "a.end", "follower": "b.start"},
            },
            "springs": springs,
        },
        "coordinates": {
            "q1": {"joint": "s", "drive": drives[0]}, "q2": {"joint": "e", "drive": drives[1]}
        },
    }  # fmt: skip


Q = [0.3, 0.9]


def between(a: str, b: str, **stiffness: Any) -> Tree:
    return {"x": {"between": [a, b], **stiffness}}


@pytest.mark.parametrize("space", ["planar", "spatial"])
def test_a_rotational_spring_at_a_free_joint_is_a_drive(space: str) -> None:
    k = 500.0
    turning = k if space == "planar" else [0.0, 0.0, k]
    sprung = arm(between("b.start", "a.end", rotational=turning), ("free", "free"), space)
    held = arm({}, ("free", {"stiffness": k}), space)
    assert len(built(sprung).pencil.rigid) == len(built(held).pencil.rigid) == 1
    np.testing.assert_allclose(built(sprung).lam(Q, 5), built(held).lam(Q, 5), rtol=1e-8)


def test_a_spring_to_the_ground_takes_the_rigid_modes_it_holds() -> None:
    tree = arm(between("b.end", "ground", translational=3e4), ("free", "free"))
    model, frame = built(tree), world(tree, Q)
    frame.n_free = 0
    assert len(model.pencil.rigid) == 0
    np.testing.assert_allclose(model.lam(Q, 5), frame.spectrum(5), rtol=1e-8)


@pytest.mark.parametrize("space", ["planar", "spatial"])
def test_a_spring_within_one_rigid_link_does_nothing(space: str) -> None:
    tree = arm({}, space=space)
    tree["mechanism"]["links"]["b"] = {"type": "rigid", "length": 0.4, "mass": 1.0}
    sprung = copy.deepcopy(tree)
    sprung["mechanism"]["springs"] = between("b.start", "b.end", translational=1e6, rotational=1e6)
    np.testing.assert_allclose(built(sprung).lam(Q, 6), built(tree).lam(Q, 6), rtol=1e-8)


@pytest.mark.parametrize("space", ["planar", "spatial"])
def test_a_spring_between_links_does_not_resist_turning_everything(space: str) -> None:
    """All of the arm on a very soft drive: the spring inside must leave that lowest mode alone."""
    k = 1e-3
    for inside in ({}, between("a.start", "b.end", translational=1e7)):
        tree = arm(inside, ({"stiffness": k}, "locked"), space)
        lowest = float(built(tree).lam(Q, 1)[0])
        straight = built(arm({}, ({"stiffness": k}, "locked"), space)).lam(Q, 1)[0]
        assert lowest == pytest.approx(float(straight), rel=1e-5)


@pytest.mark.parametrize("angle", [0.0, 0.6, np.pi / 2])
def test_a_springs_axes_turn_with_the_first_nodes_link(angle: float) -> None:
    """Along world y however the arm stands: the axes' angle undone by the link's."""
    across = []
    for q1 in (0.2, 1.1):
        spring = between("a.end", "ground", translational=[0.0, 2e5])
        spring["x"]["angle"] = angle - q1
        tree = arm(spring)
        tree["mechanism"]["joints"]["s"]["angle"] = -q1 + 0.4  # the arm always stands at 0.4
        spring["x"]["angle"] = angle - 0.4
        across.append(built(tree).lam([q1, 0.9], 4))
    np.testing.assert_allclose(across[0], across[1], rtol=1e-9)
    np.testing.assert_allclose(across[0], world(tree, [1.1, 0.9]).spectrum(4), rtol=1e-9)


def test_the_two_axes_of_an_isotropic_spring_are_one_number() -> None:
    one = built(arm(between("b.end", "ground", translational=2e4))).lam(Q, 5)
    two = built(arm(between("b.end", "ground", translational=[2e4, 2e4]))).lam(Q, 5)
    turned = between("b.end", "ground", translational=2e4)
    turned["x"]["angle"] = 0.7
    np.testing.assert_allclose(one, two, rtol=1e-12)
    np.testing.assert_allclose(built(arm(turned)).lam(Q, 5), one, rtol=1e-9)


def test_coincident_nodes_may_be_named_in_either_order() -> None:
    forth = built(arm(between("b.start", "a.end", rotational=300.0), ("locked", "free"))).lam(Q, 5)
    back = built(arm(between("a.end", "b.start", rotational=300.0), ("locked", "free"))).lam(Q, 5)
    np.testing.assert_allclose(forth, back, rtol=1e-9)


def test_springs_add_up() -> None:
    two = between("b.end", "ground", translational=1e4)
    two["y"] = {"between": ["b.end", "ground"], "translational": 2e4}
    one = built(arm(between("b.end", "ground", translational=3e4))).lam(Q, 5)
    np.testing.assert_allclose(built(arm(two)).lam(Q, 5), one, rtol=1e-11)


def test_a_stiff_spring_is_a_support() -> None:
    """A roller under the tip by a spring, against the elimination of that displacement."""
    stiff = between("b.end", "ground", translational=[0.0, 1e12])
    stiff["x"]["angle"] = -sum(Q)
    frame = world(arm({}), Q)
    row = np.zeros(len(frame.K))
    row[frame.where["b.end"] + 1] = 1.0
    frame.rows.append(row)
    np.testing.assert_allclose(built(arm(stiff)).lam(Q, 4), frame.spectrum(4), rtol=1e-5)


def test_a_designed_stiffness_is_the_number_it_stands_for() -> None:
    tree = gantry("locked")
    tree["mechanism"]["springs"] = {
        "stop": {"between": ["girder.end", "ground"], "translational": 1e5, "rotational": 2e3}
    }
    tree["design"] = {
        "k": {"parameter": "springs.stop.translational", "min": 0.0, "max": 1e9},
        "r": {"parameter": "springs.stop.rotational", "min": 0.0, "max": 1e9},
    }
    model = built(tree)
    lam = eigenvalues(model.pencil, np.array([[0.5, 7e6, 4e4]]), 5)[0]
    other = changed(
        changed(tree, "springs.stop.translational", 7e6), "springs.stop.rotational", 4e4
    )
    np.testing.assert_allclose(lam, world(other, [0.5]).spectrum(5), rtol=1e-8)
