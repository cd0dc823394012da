"""Loops that close between rigid links: the elastic motions of their passive joints follow.

Where no node of its own deforms, a loop leaves its passive joints no elastic motion δ to choose:
the two ways round it move its closing joint alike,

    G u + J δ = 0,    δ = −J⁻¹ G u,

with u the unknowns of whatever the loop hangs on (nothing, if that is the ground), J the Jacobian
that also gives ṗ = P q̇. Of more passive freedoms than rows some stay unknowns; redundant rows are
met in least squares if they are consistent, and refused if they would clamp what deforms.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import linalg

from eigassign.errors import MechanismError
from eigassign.mechanism.assembly.node_motion import MotionRow, NodeMotions, combined
from eigassign.mechanism.kinematics.loop_closure import RANK, passive_motion
from eigassign.mechanism.kinematics.parameters import ModelParameters
from eigassign.mechanism.kinematics.rotations import DOFS, Objects
from eigassign.mechanism.kinematics.topology import JointEdge

Floats = NDArray[np.float64]


def close_rigid_loops(nodes: NodeMotions, parameters: ModelParameters, reference: Floats) -> None:
    """Number the passive joints that stay free, and derive the others from all unknowns.

    ``reference`` z = (s, y) is the pose at which the dependent ones are chosen. Raises
    MechanismError for a loop that would hold deforming nodes against each other.
    """
    tree = nodes.motion.tree
    passive = tree.passive
    keys = [(freedom.joint, freedom.component) for freedom in passive]
    for k, key in enumerate(keys):  # told apart from the unknowns by their sign
        nodes.passive[key] = {-1 - k: 1.0}
    loops = tree.loops[tree.n_elastic :]
    gaps = []  # motion of each closing joint's follower: its own minus what the joint demands
    for edge in loops:
        pairs = zip(nodes.rows(edge.follower), nodes.closed(edge), strict=True)
        rows = [combined(own, demanded, -1.0) for own, demanded in pairs]
        gaps += [rows[a] for a in DOFS[nodes.space]]
    labels = [-1 - k for k in range(len(passive))]
    unknowns = sorted({u for row in gaps for u in row if u >= 0})
    J, G = _matrix(gaps, labels), _matrix(gaps, unknowns)
    at = parameters.compiled(np.hstack([J, G]))(reference[:, None])[0][0]
    dependent = pivots(at[:, : len(labels)])
    require_consistent(at[:, dependent], at[:, len(labels) :], loops, nodes.space)
    free = [k for k in range(len(passive)) if k not in dependent]
    nodes.number_passive([passive[k] for k in free])
    masters = [*(next(iter(nodes.passive[keys[k]])) for k in free), *unknowns]
    solved = passive_motion(parameters.recorder, J[:, dependent], np.hstack([J[:, free], G]))
    for k, row in zip(dependent, solved, strict=True):
        nodes.passive[keys[k]] = dict(zip(masters, row, strict=True))
    nodes.forget()


def _matrix(rows: Sequence[MotionRow], unknowns: Sequence[int]) -> Objects:
    entries = [[row.get(u, 0.0) for u in unknowns] for row in rows]
    return np.array(entries, dtype=object).reshape(len(rows), len(unknowns))


def pivots(J: Floats) -> list[int]:
    """Columns of full rank, in order, the most independent ones."""
    if not J.size:
        return []
    _, R, order = linalg.qr(J, mode="economic", pivoting=True)
    sizes = np.abs(np.diag(R))
    return sorted(order[: int((sizes > RANK * sizes[0]).sum())].tolist())


def require_consistent(J: Floats, G: Floats, loops: Sequence[JointEdge], space: str) -> None:
    """Whatever u is, some δ closes the loops."""
    if not G.size:
        return
    left = G - (J @ np.linalg.lstsq(J, G, rcond=None)[0] if J.shape[1] else 0.0)
    worst = np.abs(left).max(axis=1)
    # 1e-8 of the largest entry is round-off of the closure, of its solution and of a turn
    if worst.max() > 1e-8 * np.abs(G).max():
        edge = loops[int(worst.argmax()) // len(DOFS[space])]
        raise MechanismError(
            f"mechanism.joints.{edge.joint}",
            "closes a loop of rigid links that leaves the flexible nodes it hangs on no room to "
            "move: make one of its links a beam, or give its joints the freedoms that are missing",
        )
