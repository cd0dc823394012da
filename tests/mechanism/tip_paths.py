"""Tip paths on built mechanisms: the chain of a node, and a course to follow."""

from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation
from spatial_cases import Built
from spatial_oracle import Pose, Tree, solve_pose

from eigassign.mechanism import (
    Course,
    TipChain,
    planar_attitude,
    spatial_attitude,
    tip_chain,
    tip_path,
)


def chain_of(model: Built, tip: str, oriented: bool = False) -> TipChain:
    return tip_chain(model.case, model.numbers, model.motion, tip, model.y, oriented)


def states(chain: TipChain, q: Any) -> np.ndarray:
    """The states (q, p) that the model itself takes at q (n, n_q)."""
    q = np.atleast_2d(np.asarray(q, float))
    return q if chain.assembly is None else np.hstack([q, chain.assembly.passive(q)])


def course(
    points: Any, n: int, kind: str = "straight", angle: Any = None, orientation: Any = None
) -> Course:
    path = tip_path(points, kind)
    attitude = None
    if angle is not None:
        attitude = planar_attitude(path, angle, kind)
    if orientation is not None:
        attitude = spatial_attitude(path, orientation, kind)
    s = np.linspace(0.0, 1.0, n)
    return Course(path, s, s, attitude)


def place(tree: Tree, pose: Pose, tip: str) -> tuple[np.ndarray, np.ndarray]:
    """World place and rotation of a node by the independent oracle."""
    return pose.node(tree, tip), pose.R[tip.split(".")[0]]


def tips(tree: Tree, q: np.ndarray, tip: str) -> tuple[np.ndarray, np.ndarray]:
    """The same at many q, loops closed on the branch of the guess."""
    found = [place(tree, solve_pose(tree, row), tip) for row in q]
    return np.array([p for p, _ in found]), np.array([R for _, R in found])


def between(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Angle (n,) in rad between rotations."""
    return Rotation.from_matrix(a.swapaxes(1, 2) @ b).magnitude()
