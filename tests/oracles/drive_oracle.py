"""What drives exert, by d'Alembert's principle with differences of poses in time: an oracle.

Every link is a rigid body; its mass, centre and tensor are those of its finite elements moved
rigidly. Poses come from `spatial_oracle`, their velocities, accelerations and partial derivatives
from differences of fourth order.
"""

from typing import Any

import numpy as np
from spatial_oracle import (
    Array,
    Builder,
    Pose,
    Tree,
    null_space,
    rotation_vector,
    solve_pose,
    split_coordinates,
)

# rad or m; near dead points loops need it so short, and round-off is then 1e-9
STEP = 5e-4
FIRST = np.array([1.0, -8.0, 0.0, 8.0, -1.0]) / 12.0
SECOND = np.array([-1.0, 16.0, -30.0, 16.0, -1.0]) / 12.0


class Rigid:
    """Mass, centre (3,) and tensor (3, 3) about it of a link with its bodies, in its own axes."""

    def __init__(self, tree: Tree, pose: Pose, name: str) -> None:
        b, R, planar = Builder(tree, pose), pose.R[name], tree["mechanism"]["space"] == "planar"
        b.add_link(name)
        for data in tree["mechanism"].get("bodies", {}).values():
            if data["at"].split(".")[0] == name:
                b.add_body(data)
        (K, M), rows = b.dense(), b.dense_rows()
        axes = [0, 1, 5] if planar else list(range(6))
        kept = np.array([6 * k + d for k in range(b.n // 6) for d in axes])
        T = null_space(rows[np.abs(rows[:, kept]).max(axis=1, initial=0.0) > 0.0][:, kept])
        K, M = (T.T @ A[np.ix_(kept, kept)] @ T for A in (K, M))
        node, first = next(iter(b.where.items()))
        S = T[np.searchsorted(kept, first + np.array(axes))]
        n, size = len(axes), np.abs(K).max(initial=0.0) or 1.0
        both = np.block([[K / size, S.T], [S, np.zeros((n, n))]])
        x = np.linalg.solve(both, np.vstack([np.zeros((len(K), n)), np.eye(n)]))[: len(K)]
        J = np.zeros((6, 6))
        J[np.ix_(axes, axes)] = x.T @ M @ x
        self.mass = J[0, 0]
        lever = np.array([J[1, 5], -J[0, 5], J[0, 4]]) / (self.mass or 1.0)
        about = J[3:, 3:] - self.mass * ((lever @ lever) * np.eye(3) - np.outer(lever, lever))
        if planar:
            about = np.diag([0.0, 0.0, about[2, 2]])
        self.center = R.T @ (pose.node(tree, node) + lever - pose.o[name])
        self.tensor = R.T @ about @ R


def exerted(tree: Tree, q: Any, rate: Any, push: Any, g: Array) -> Array:
    """The generalised forces (n,) in the declared coordinates, drive inertias included."""
    q, rate, push = (np.asarray(each, float) for each in (q, rate, push))
    here = solve_pose(tree, q)
    size = STEP / max(np.abs(rate).max(initial=1e-9), np.sqrt(np.abs(push).max(initial=0.0)))
    times = size * np.arange(-2, 3)
    motion = [solve_pose(tree, q + rate * t + push * t * t / 2.0) for t in times]
    moved = [[solve_pose(tree, q + STEP * k * e) for k in range(-2, 3)] for e in np.eye(len(q))]
    out = np.zeros(len(q))
    for name in tree["mechanism"]["links"]:
        one = Rigid(tree, here, name)
        R = here.R[name]
        places = np.array([p.o[name] + p.R[name] @ one.center for p in motion])
        turns = np.array([rotation_vector(p.R[name] @ R.T) for p in motion])
        acceleration, w = SECOND @ places / size**2, FIRST @ turns / size
        # the rotation vector's second derivative is ω̇ where it vanishes
        w_rate, tensor = SECOND @ turns / size**2, R @ one.tensor @ R.T
        F = one.mass * (acceleration - g)
        N = tensor @ w_rate + np.cross(w, tensor @ w)
        for i, poses in enumerate(moved):
            v = FIRST @ np.array([p.o[name] + p.R[name] @ one.center for p in poses]) / STEP
            turn = FIRST @ np.array([rotation_vector(p.R[name] @ R.T) for p in poses]) / STEP
            out[i] += F @ v + N @ turn
    for (joint, k), name in split_coordinates(tree)[0].items():
        drive = tree["coordinates"][name].get("drive")
        inertia = drive.get("inertia", 0.0) if isinstance(drive, dict) else 0.0
        push_of_joint = SECOND @ [p.values[joint][k] for p in motion] / size**2
        for i, poses in enumerate(moved):
            out[i] += inertia * push_of_joint * (FIRST @ [p.values[joint][k] for p in poses]) / STEP
    return out
