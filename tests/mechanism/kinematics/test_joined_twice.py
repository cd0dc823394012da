"""Joints that hold what others hold already are told of, and change nothing."""

from pathlib import Path

import numpy as np
import pytest
from spatial_cases import built, case_of, changed
from spatial_examples import four_bar, gantry
from spatial_oracle import Tree

from eigassign.case import load

CASES = Path(__file__).parents[3] / "cases"
PIN = {"type": "revolute", "base": "crank.end", "follower": "coupler.start"}


def warnings_of(tree: Tree) -> list[str]:
    return [str(w) for w in case_of(tree).warnings if "redundant" in w.message]


def with_joints(tree: Tree, **joints: Tree) -> Tree:
    tree["mechanism"]["joints"] |= joints
    return tree


def test_a_second_joint_on_the_same_pin_is_named_with_the_first_and_changes_nothing() -> None:
    tree = with_joints(four_bar("free"), again=PIN)
    (warning,) = warnings_of(tree)
    assert "mechanism.joints.again" in warning
    assert "'B' joins crank.end and coupler.start already" in warning
    q = [0.6]
    expected = built(four_bar("free")).lam(q, 3)
    np.testing.assert_allclose(built(tree).lam(q, 3), expected, rtol=1e-8)


def test_three_links_on_one_pin_need_two_joints() -> None:
    tree = with_joints(
        four_bar("free"),
        C1={"type": "revolute", "base": "crank.end", "follower": "tail.start"},
        C2={"type": "revolute", "base": "coupler.start", "follower": "tail.start"},
    )
    tree["mechanism"]["links"]["tail"] = {"type": "rigid", "mass": 1.0, "inertia": 0.1}
    (warning,) = warnings_of(tree)
    assert "joints.C2" in warning
    assert "'B' and 'C1' join coupler.start and tail.start already" in warning


@pytest.mark.parametrize("position", [[0.0, 0.0], [0.5, 0.1]])
def test_joints_on_ground_are_told_apart_by_their_place(position: list[float]) -> None:
    tree = changed(four_bar("free"), "joints.D.position", position)
    tree = with_joints(tree, D2={"type": "revolute", "base": "ground", "follower": "rocker.start"})
    assert len(warnings_of(tree)) == (position == [0.0, 0.0])


@pytest.mark.parametrize("make", [four_bar, gantry])
def test_loops_with_links_in_them_are_left_alone(make: object) -> None:
    assert not warnings_of(make("free"))  # type: ignore[operator]


@pytest.mark.parametrize("path", sorted(CASES.glob("*.yaml")), ids=lambda p: p.stem)
def test_no_shipped_case_is_warned_of(path: Path) -> None:
    assert not [w for w in load(path).warnings if "redundant" in w.message]
