"""What inverse kinematics sees of a mechanism, against differences and an independent oracle."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from spatial_cases import built
from spatial_oracle import Tree
from spatial_random import EVERY_LOOP, EVERY_TREE, last_node, random_closed, random_open
from tip_paths import chain_of, states, tips

from eigassign.mechanism import TipChain

H = 1e-6  # central differences: error about h² and 1e-16 / h
SPACES = ["planar", "spatial"]


def mechanisms(space: str) -> list[tuple[Tree, np.ndarray]]:
    trees = [random_open(*drawn) for drawn in EVERY_TREE if drawn[1] == space]
    return trees + [random_closed(*drawn)[::2] for drawn in EVERY_LOOP if drawn[1] == space]


@pytest.mark.parametrize("space", SPACES)
def test_derivatives_by_every_freedom_are_those_of_differences(space: str) -> None:
    for k, (tree, q) in enumerate(mechanisms(space)):
        chain = chain_of(built(tree), last_node(tree), oriented=True)
        z = states(chain, q)
        z = z + 0.01 * np.sin(np.arange(z.size) + k)  # the loops need not be closed
        seen = chain.evaluate(z)
        for i, e in enumerate(H * np.eye(z.shape[1])):
            ahead, behind = chain.evaluate(z + e), chain.evaluate(z - e)
            by_differences = [(ahead.point - behind.point)[0] / (2 * H)]
            turn = ahead.rotation[0] @ behind.rotation[0].T
            spin = Rotation.from_matrix(turn).as_rotvec() / (2 * H)
            by_differences.append(spin[list(chain.turned_by)])
            J = seen.jacobian[0, :, i]
            np.testing.assert_allclose(J, np.concatenate(by_differences), rtol=1e-6, atol=3e-8)
            closing = (ahead.gap - behind.gap)[0] / (2 * H)
            np.testing.assert_allclose(seen.closure[0, :, i], closing, rtol=1e-6, atol=3e-8)


@pytest.mark.parametrize("space", SPACES)
def test_the_tip_is_where_the_oracle_has_it_and_the_loops_are_closed(space: str) -> None:
    for tree, q in mechanisms(space):
        tip = last_node(tree)
        chain = chain_of(built(tree), tip, oriented=True)
        seen = chain.evaluate(states(chain, q))
        point, R = tips(tree, q[None], tip)
        np.testing.assert_allclose(seen.point, point[:, : seen.point.shape[1]], atol=1e-8)
        np.testing.assert_allclose(seen.rotation, R, atol=1e-8)
        assert np.abs(seen.gap).max(initial=0.0) < 1e-9


def kinds(tree: Tree) -> tuple[str, ...]:
    chain: TipChain = chain_of(built(tree), last_node(tree))
    return chain.kinds


def test_freedoms_turn_slide_or_advance() -> None:
    found: dict[str, set[str]] = {}
    for seed in range(40):
        tree, _ = random_open(seed, "spatial")
        joints = tree["mechanism"]["joints"]
        for (_, data), kind in zip(tree["coordinates"].items(), kinds(tree), strict=True):
            key = joints[data["joint"]]["type"]
            if key == "cylindrical":
                key = data["component"]
            found.setdefault(key, set()).add(kind)
    assert found == {
        "revolute": {"turn"}, "universal": {"turn"}, "spherical": {"turn"}, "rotation": {"turn"},
        "translation": {"slide"}, "prismatic": {"slide"}, "carriage": {"slide"},
        "nut": {"slide"}, "screw": {"screw"},
    }  # fmt: skip
