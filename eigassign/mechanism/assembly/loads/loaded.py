"""A mechanism that loads act on: links and springs, where bodies are, how nodes and joints move."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from eigassign.case.case_file import CaseFile
from eigassign.errors import MechanismError
from eigassign.mechanism.assembly.congruence import LocalLink, inertia
from eigassign.mechanism.assembly.node_motion import MotionRow, MotionRows, NodeMotions
from eigassign.mechanism.assembly.springs import SpringEnds, SpringMotion
from eigassign.mechanism.elements.bodies import add_bodies
from eigassign.mechanism.elements.mesh import Entries, LinkMesh, summed
from eigassign.mechanism.kinematics.forward import Kinematics, shifted
from eigassign.mechanism.kinematics.parameters import (
    ModelParameters,
    link_type,
    node_position,
)
from eigassign.mechanism.kinematics.rotations import DOFS, Floats, Objects, present, some
from eigassign.mechanism.kinematics.topology import (
    GROUND,
    JointEdge,
    NodeName,
    Topology,
    split,
)
from eigassign.series.expression import Scalar


@dataclass(frozen=True, eq=False)
class Loaded:
    """A mechanism that loads act on; the passive freedoms of ``known`` are known.

    ``bent``: parts known by their matrices bend between their nodes as beams do, see `imported`.
    """

    case: CaseFile
    known: ModelParameters
    motion: Kinematics
    links: Mapping[str, LocalLink]
    nodes: NodeMotions
    bent: bool = False

    @cached_property
    def springs(self) -> Sequence[SpringMotion]:
        """The springs with the motions of their ends."""
        rows, count = self.nodes.rows, self.nodes.count
        return list(SpringEnds(self.case, self.known, self.motion, rows, count).each())

    @cached_property
    def settled(self) -> LoopsAtNodes:
        """The loops whose forces nodes that deform tell."""
        return loops_at_nodes(self.case, self.motion)

    @cached_property
    def sites(self) -> Mapping[NodeName, Objects]:
        """The mass matrix (6, 6) of the bodies at each node that carries any.

        A rigid link has one site, at its origin, with all of its own mass.
        """
        found: dict[NodeName, Objects] = {}
        for name, link in self.links.items():
            J, kept = np.zeros((6, 6), dtype=object), list(DOFS[self.nodes.space])
            if self.is_rigid(name):
                J[np.ix_(kept, kept)] = inertia(link)
                found[name, "@origin"] = J
        for at in (split(body.at) for body in self.case.mechanism.bodies.values()):
            if not self.is_rigid(at[0]) and at not in found:
                found[at] = self._bodies(at)
        return found

    def _bodies(self, at: NodeName) -> Objects:
        own, elsewhere = Entries((6, 6)), np.full(6, -1)
        slots = dict.fromkeys(self.nodes.meshes[at[0]].nodes, elsewhere) | {at[1]: np.arange(6)}
        add_bodies(self.case, self.known, at[0], own, slots)
        return summed(own.terms(), 6)

    @property
    def solids(self) -> dict[str, Scalar]:
        """The densities of the links that are known by their meshes."""
        lost = {name: self.whole(name).lost for name in self.links}
        return {name: each.density for name, each in lost.items() if each is not None}

    def sites_of(self, name: str) -> list[NodeName]:
        """The nodes of a link that carry bodies."""
        return [node for node in self.sites if node[0] == name]

    def whole(self, name: str) -> LinkMesh:
        """The mesh of a link before it was reduced."""
        mesh = self.nodes.meshes[name]
        return mesh if mesh.reduction is None else mesh.reduction.mesh

    def is_rigid(self, name: str) -> bool:
        """True of links whose nodes hang rigidly on their origin."""
        return "@origin" in self.nodes.meshes[name].nodes

    def place(self, node: NodeName) -> Objects:
        """Where a node is in its link, m."""
        if node[1] == "@origin":
            return np.zeros(3, dtype=object)
        return node_position(self.case, self.known, self.motion.tree, node)

    def rows(self, node: NodeName) -> MotionRows:
        """The whole motion of a node in its link's axes: elastic rows and columns of N T."""
        if node == GROUND:
            return [{} for _ in range(6)]
        rigid = shifted(self.motion.placement(node[0]).twist, self.place(node))
        rows = [dict(row) for row in self.nodes.rows(node)]
        for a, k in zip(*np.nonzero(present(rigid)), strict=True):
            rows[a][self.nodes.count + int(k)] = rigid[a, k]
        return rows

    def freedom(self, freedom: int) -> MotionRow:
        """The motion of one freedom of a joint, elastic and with the coordinates."""
        named = self.motion.tree.freedoms[freedom]
        row = dict(self.nodes.passive.get((named.joint, named.component), {}))
        for k, rate in enumerate(self.motion.rates[freedom]):
            if some(rate):
                row[self.nodes.count + k] = rate
        return row

    def local(self, name: str, slot: int) -> MotionRow:
        """The elastic motion of one dof of a link."""
        link = self.links[name]
        own = int(link.own[slot])
        return {own: 1.0} if own >= 0 else dict(link.carried[slot])


def first_moment(m: Any) -> Any:
    """m c (3,) of a mass matrix (6, 6)."""
    return np.array([m[1, 5], m[0, 5] * -1.0, m[0, 4]])


# --- loops at nodes that deform


class LoopsAtNodes(NamedTuple):
    """Loops whose closing wrenches λ follow from what nodes receive, λ = ``inverse`` b.

    b is what must act on each of the ``nodes`` beside all that is known, λ that on each follower,
    both in the world about its origin.
    """

    loops: Sequence[JointEdge]
    nodes: Sequence[NodeName]
    inverse: Floats


def hangs_on_stiffness(case: CaseFile, motion: Kinematics) -> bool:
    """True where statics alone do not tell the forces."""
    tree, width = motion.tree, len(DOFS[case.mechanism.space])
    redundant = tree.n_elastic > 0 and width * len(tree.loops) != len(tree.passive)
    return redundant or bool(case.mechanism.springs)


def loops_at_nodes(case: CaseFile, motion: Kinematics) -> LoopsAtNodes:
    """The loops that close at nodes which deform, where forces hang on stiffness.

    Raises MechanismError where no choice of nodes tells all.
    """
    tree = motion.tree
    loops = tree.loops[: tree.n_elastic if hangs_on_stiffness(case, motion) else 0]
    ends = [e.follower for e in loops] + [e.base for e in loops]
    A, nodes = np.zeros((0, len(loops))), list[NodeName]()
    for node in dict.fromkeys(ends):
        if node != GROUND and link_type(case, node[0]) != "rigid":
            more = np.vstack([A, [_times(tree, node, edge) for edge in loops]])
            if np.linalg.matrix_rank(more) == len(more):
                A, nodes = more, [*nodes, node]
    if len(nodes) < len(loops):
        raise MechanismError(
            f"mechanism.joints.{loops[-1].joint}",
            "closes a loop at nodes where other loops close, which leaves forces under loads "
            "unknown: give each loop nodes of its own, or write gravity: none",
        )
    return LoopsAtNodes(loops, nodes, np.asarray(np.linalg.inv(A), dtype=np.float64))


def _times(tree: Topology, node: NodeName, loop: JointEdge) -> int:
    """How many times λ of a loop acts on a node: itself, and through what hangs there."""
    ends = ((loop.follower, 1), (loop.base, -1))
    total = sum(sign for end, sign in ends if end == node)
    for edge, sign in tree.hanging(node):
        total += sign * sum(s for end, s in ends if end[0] in tree.beyond[edge.follower[0]])
    return total
