"""Statics of a pose: the wrenches that the weight sends through every joint, drives holding it.

Wrenches are (F, M) in N and N m about a point, in the axes of a link. A link's own is J (g, 0) with
J = Nᵀ m N about its origin. In a tree, a joint carries the sum of all that hangs on it. Loops add
the wrenches λ of their closing joints, which make the passive freedoms p feel no force:

    J_pᵀ λ = −Σ_links T_pᵀ W,

J_p the rates of the loops' gaps, T_p the twists per ṗ: as many equations as unknowns, or the
internal forces would hang on stiffnesses, which is refused.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from eigassign.case.case_file import CaseFile
from eigassign.errors import MechanismError
from eigassign.mechanism.assembly.congruence import LocalLink, inertia
from eigassign.mechanism.kinematics.forward import Kinematics, walk
from eigassign.mechanism.kinematics.parameters import ModelParameters, node_position
from eigassign.mechanism.kinematics.rotations import DOFS, Floats, Objects, cross, multiply
from eigassign.mechanism.kinematics.topology import JointEdge, NodeName


@dataclass(frozen=True)
class Statics:
    """``on_nodes``: what acts on the nodes of each link but its own weight, about each node;
    ``through``: what the follower of each joint, as it is walked, puts on its base node; both in
    the axes of the link that it acts on. ``g`` are the links' own axes' gravity, m/s².
    """

    g: Mapping[str, Objects]
    on_nodes: Mapping[str, Sequence[tuple[str, Objects]]]
    through: Mapping[str, Objects]


def statics(
    case: CaseFile,
    parameters: ModelParameters,
    motion: Kinematics,
    links: Mapping[str, LocalLink],
    gravity: Floats,
) -> Statics:
    """Wrenches through the joints of a mechanism under its weight, as functions of (q, y).

    Raises MechanismError for loops whose internal forces statics alone do not give.
    """
    kept = list(DOFS[case.mechanism.space])
    g = {p.link: multiply(p.world_rotation.T, gravity) for p in motion.placements}
    own = {name: np.zeros(6, dtype=object) for name in g}
    for name, link in links.items():
        pull = np.concatenate([g[name], np.zeros(3, dtype=object)])[kept]
        own[name][kept] = multiply(inertia(link), pull)
    found = _Wrenches(case, parameters.with_passive(motion.passive), motion, dict(own))
    for edge, wrench in _closing(case, parameters, motion, own):
        found.close(edge, wrench)
    for placement in reversed(motion.placements):
        found.hang(placement.edge)
    return Statics(g, found.on_nodes, found.through)


@dataclass
class _Wrenches:
    """The wrenches as they are gathered, from the tips to the ground."""

    case: CaseFile
    parameters: ModelParameters
    motion: Kinematics
    total: dict[str, Objects]  # of each link and all that hangs on it, about its origin
    on_nodes: dict[str, list[tuple[str, Objects]]] = field(init=False)
    through: dict[str, Objects] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.on_nodes = {name: [] for name in self.total}

    def close(self, edge: JointEdge, wrench: Objects) -> None:
        """A wrench on the follower of a closing joint, and its opposite on the base."""
        loop = next(one for one in self.motion.loops if one.edge == edge)
        self._act(edge.follower, wrench)
        back = handed(wrench * -1.0, loop.rotation, loop.lever)
        self.through[edge.joint] = back
        self._act(edge.base, back)

    def hang(self, edge: JointEdge) -> None:
        """The follower with all that hangs on it, on its base."""
        placement = self.motion.placement(edge.follower[0])
        at_root = shifted_wrench(self.total[placement.link], placement.root)
        self.on_nodes[placement.link].append((edge.follower[1], at_root * -1.0))
        on_base = handed(at_root, placement.rotation, placement.lever)
        self.through[edge.joint] = on_base
        self._act(edge.base, on_base)

    def _act(self, node: NodeName, wrench: Objects) -> None:
        link, name = node
        if link == "ground":
            return
        place = node_position(self.case, self.parameters, self.motion.tree, node)
        self.on_nodes[link].append((name, wrench))
        self.total[link] = self.total[link] + shifted_wrench(wrench, place * -1.0)


def handed(wrench: Objects, rotation: Objects, lever: Objects) -> Objects:
    """A wrench on a follower's node about the base node, in the base's axes."""
    F, M = multiply(rotation, wrench[:3]), multiply(rotation, wrench[3:])
    return np.concatenate([F, M + cross(lever, F)])


def shifted_wrench(wrench: Objects, to: Objects) -> Objects:
    """The wrench about another point of the same link: M − to × F."""
    return np.concatenate([wrench[:3], wrench[3:] - cross(to, wrench[:3])])


def _closing(
    case: CaseFile, parameters: ModelParameters, motion: Kinematics, own: Mapping[str, Objects]
) -> list[tuple[JointEdge, Objects]]:
    """λ (6,) on the follower of every closing joint, in the follower's axes."""
    if not motion.loops:
        return []
    tree, coords = motion.tree, motion.coordinates
    known = parameters.with_passive(motion.passive)
    values = [known.freedom(k) for k in range(len(tree.freedoms))]
    unit = np.eye(len(tree.freedoms), dtype=object)[:, len(coords.relative) :]
    moved = walk(case, known, tree, coords, values, unit)
    kept = list(DOFS[case.mechanism.space])
    J = np.concatenate([loop.twist_gap[kept] for loop in moved.loops])
    if J.shape[0] != J.shape[1]:
        raise MechanismError(
            f"mechanism.joints.{tree.loops[0].joint}",
            "closes a loop in which the forces under gravity hang on the stiffness of its links "
            f"({J.shape[0]} conditions, {J.shape[1]} passive freedoms): give its joints the "
            "freedoms that are missing, or write gravity: none",
        )
    G = sum(multiply(p.twist.T, own[p.link]) for p in moved.placements)
    solved = known.recorder.solve(J.T.tolist(), [[-value] for value in G])
    out = []
    for k, edge in enumerate(tree.loops):
        wrench = np.zeros(6, dtype=object)
        wrench[kept] = [row[0] for row in solved[len(kept) * k : len(kept) * (k + 1)]]
        out.append((edge, wrench))
    return out
