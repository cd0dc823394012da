"""Elastic motion of every node from the independent unknowns u: how links hang on one another.

A node is its link's own (its dofs are unknowns), or is carried: the joint node of a follower moves
with its base node, u_f = X u_b + A δ, where δ are the elastic motions of passive joints (unknowns
too), and a loop-closing joint carries one node of the loop likewise. A motion is written as rows
{unknown: coefficient} of six components in the link's axes.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from eigassign.mechanism.elements.mesh import LinkMesh
from eigassign.mechanism.kinematics.forward import Kinematics
from eigassign.mechanism.kinematics.rotations import Objects, carried, present, some
from eigassign.mechanism.kinematics.topology import GROUND, Freedom, JointEdge, NodeName
from eigassign.series.expression import Scalar

Ints = NDArray[np.intp]
MotionRow = dict[int, Scalar]
MotionRows = list[MotionRow]  # six components (v, ω)


@dataclass
class NodeMotions:
    """Numbers the unknowns and derives the motion of any node from them, on demand."""

    motion: Kinematics
    meshes: dict[str, LinkMesh]
    space: str
    own: dict[str, Ints] = field(default_factory=dict)  # per link: unknown of each local dof or −1
    slaves: dict[NodeName, JointEdge] = field(default_factory=dict)
    passive: dict[tuple[str, int], MotionRow] = field(default_factory=dict)  # δ over the unknowns
    count: int = 0
    known: dict[NodeName, MotionRows] = field(default_factory=dict)

    def number(self) -> None:
        """Number what no other node carries, link by link."""
        tree = self.motion.tree
        self.slaves = {edge.follower: edge for edge in tree.loops[: tree.n_elastic]}
        for placement in self.motion.placements:
            link, mesh = placement.link, self.meshes[placement.link]
            taken = np.zeros(mesh.n_local, dtype=bool)
            for name, slots in mesh.nodes.items():
                if (link, name) == placement.edge.follower or (link, name) in self.slaves:
                    taken[slots[slots >= 0]] = True
            if "@origin" in mesh.nodes:
                taken[:] = True
            free = np.flatnonzero(~taken)
            self.own[link] = np.full(mesh.n_local, -1, dtype=np.intp)
            self.own[link][free] = self.count + np.arange(len(free))
            self.count += len(free)

    def number_passive(self, freedoms: Iterable[Freedom]) -> None:
        """Unknowns for the elastic motions of these passive joints."""
        for freedom in freedoms:
            self.passive[freedom.joint, freedom.component] = {self.count: 1.0}
            self.count += 1

    def forget(self) -> None:
        """Derive every motion anew: what passive joints do has changed."""
        self.known.clear()

    def rows(self, node: NodeName) -> MotionRows:
        """Six rows of a node's elastic motion in its link's axes; missing components stay empty."""
        if node == GROUND:
            return [{} for _ in range(6)]
        if node not in self.known:
            self.known[node] = self._derive(node)
        return self.known[node]

    def _derive(self, node: NodeName) -> MotionRows:
        if node in self.slaves:
            return self.closed(self.slaves[node])
        placement = self.motion.placement(node[0])
        mesh = self.meshes[node[0]]
        if node == placement.edge.follower:
            X = carried(placement.rotation, placement.lever)
            return self.joined(placement.edge, X, placement.freedoms)
        if "@origin" in mesh.nodes:
            return self._on_rigid(node, placement.edge.follower, mesh)
        slots = mesh.nodes[node[1]]
        own = self.own[node[0]]
        return [{int(own[s]): 1.0} if s >= 0 else {} for s in slots]

    def joined(self, edge: JointEdge, X: Objects, freedoms: Objects) -> MotionRows:
        """X u_b + A δ."""
        rows = apply(X, self.rows(edge.base))
        for component, column in enumerate(freedoms.T):
            moving = self.passive.get((edge.joint, component), {})
            for i in np.flatnonzero(present(column)):
                rows[i] = combined(rows[i], moving, column[i])
        return rows

    def closed(self, edge: JointEdge) -> MotionRows:
        """The motion that a loop's joint demands of its follower node."""
        loop = next(one for one in self.motion.loops if one.edge == edge)
        return self.joined(edge, carried(loop.rotation, loop.lever), loop.freedoms)

    def _on_rigid(self, node: NodeName, root: NodeName, mesh: LinkMesh) -> MotionRows:
        """Another point of the same rigid body: v + ω × (X − X_root)."""
        here = np.zeros(3, dtype=object) if node[1] == "@origin" else mesh.positions[node[1]]
        lever = here - mesh.positions[root[1]]
        eye = np.eye(3).astype(object)
        return apply(carried(eye, lever), self.rows(root))


def combined(row: MotionRow, other: MotionRow, factor: Scalar) -> MotionRow:
    """row + factor × other."""
    out = dict(row)
    for unknown, value in other.items():
        out[unknown] = out.get(unknown, 0.0) + value * factor
    return out


def apply(X: Objects, rows: MotionRows) -> MotionRows:
    """A (6, 6) map of rows: Σ_b X_ab row_b."""
    out: MotionRows = []
    for factors in X.tolist():
        total: MotionRow = {}
        for factor, row in zip(factors, rows, strict=True):
            if row and some(factor):
                for unknown, carry in row.items():
                    total[unknown] = total.get(unknown, 0.0) + carry * factor
        out.append({unknown: value for unknown, value in total.items() if some(value)})
    return out
