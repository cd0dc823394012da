"""Elastic motion of every node from the independent unknowns u: how links hang on one another.

A node is its link's own (its dofs are unknowns), or is carried: the joint node of a follower moves
with its base node, u_f = X u_b + A δ, where δ are the elastic motions of passive joints (unknowns
too), and a loop-closing joint carries one node of the loop likewise. A motion is written as rows
{unknown: coefficient} of six components in the link's axes.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import MechanismError
from eigassign.mechanism.kinematics import Kinematics
from eigassign.mechanism.mesh import DOFS, LinkMesh
from eigassign.mechanism.rotations import Objects, carried, present
from eigassign.mechanism.tree import GROUND, Edge, Node
from eigassign.series.expression import Expression, Scalar

Ints = NDArray[np.intp]
Row = dict[int, Scalar]
Rows = list[Row]  # six components (v, ω)


@dataclass
class NodeMotions:
    """Numbers the unknowns and derives the motion of any node from them, on demand."""

    motion: Kinematics
    meshes: dict[str, LinkMesh]
    space: str
    own: dict[str, Ints] = field(default_factory=dict)  # per link: unknown of each local dof or −1
    slaves: dict[Node, tuple[Edge, bool]] = field(default_factory=dict)
    passive: dict[tuple[str, int], int] = field(default_factory=dict)
    count: int = 0
    known: dict[Node, Rows] = field(default_factory=dict)
    pending: set[Node] = field(default_factory=set)

    def number(self) -> None:
        """Choose the carried nodes of the loops, then number what is left link by link."""
        for edge in self.motion.tree.loops:
            self._choose_slave(edge)
        for placement in self.motion.placements:
            self._number_link(placement.link, placement.edge)
        for freedom in self.motion.tree.passive:
            self.passive[freedom.joint, freedom.component] = self.count
            self.count += 1

    def _is_own(self, node: Node) -> bool:
        """Whether a node's dofs are unknowns of its link."""
        if node == GROUND or node in self.slaves:
            return False
        root = self.motion.placement(node[0]).edge.follower
        return node != root and node[1] in self.meshes[node[0]].nodes

    def _choose_slave(self, edge: Edge) -> None:
        if self._is_own(edge.follower):
            self.slaves[edge.follower] = (edge, True)
        elif self._is_own(edge.base):
            self.slaves[edge.base] = (edge, False)
        else:
            message = (
                "closes a loop between nodes that cannot deform: give the link on one side "
                "elements, or hang the loop on another joint"
            )
            raise MechanismError(f"mechanism.joints.{edge.joint}", message)

    def _number_link(self, link: str, edge: Edge) -> None:
        mesh = self.meshes[link]
        taken = np.zeros(mesh.n_local, dtype=bool)
        for name, slots in mesh.nodes.items():
            if (link, name) == edge.follower or (link, name) in self.slaves:
                taken[slots[slots >= 0]] = True
        if "@origin" in mesh.nodes:
            taken[:] = True
        own = np.full(mesh.n_local, -1, dtype=np.intp)
        own[~taken] = self.count + np.arange(int((~taken).sum()))
        self.count += int((~taken).sum())
        self.own[link] = own

    def rows(self, node: Node) -> Rows:
        """Six rows of a node's elastic motion in its link's axes; missing components stay empty."""
        if node == GROUND:
            return [{} for _ in range(6)]
        if node not in self.known:
            if node in self.pending:
                raise MechanismError(
                    f"mechanism.links.{node[0]}", "lies in a loop that only rigid links close"
                )
            self.pending.add(node)
            self.known[node] = self._derive(node)
            self.pending.discard(node)
        return self.known[node]

    def _derive(self, node: Node) -> Rows:
        if node in self.slaves:
            return self._closed(*self.slaves[node])
        placement = self.motion.placement(node[0])
        mesh = self.meshes[node[0]]
        if node == placement.edge.follower:
            X = carried(placement.rotation, placement.lever)
            return self._joined(placement.edge, X, placement.freedoms)
        if "@origin" in mesh.nodes:
            return self._on_rigid(node, placement.edge.follower, mesh)
        slots = mesh.nodes[node[1]]
        own = self.own[node[0]]
        return [{int(own[s]): 1.0} if s >= 0 else {} for s in slots]

    def _joined(self, edge: Edge, X: Objects, freedoms: Objects) -> Rows:
        """X u_b + A δ."""
        rows = apply(X, self.rows(edge.base))
        return self._with_passive(rows, edge, freedoms)

    def _with_passive(self, rows: Rows, edge: Edge, freedoms: Objects) -> Rows:
        for component in range(freedoms.shape[1]):
            unknown = self.passive.get((edge.joint, component))
            if unknown is not None:
                for i in np.flatnonzero(present(freedoms[:, component])):
                    rows[i] = {**rows[i], unknown: freedoms[i, component]}
        return rows

    def _closed(self, edge: Edge, follower: bool) -> Rows:
        """A loop's carried node: u_f = X u_b + A δ, or u_b = X⁻¹ (u_f − A δ)."""
        loop = next(one for one in self.motion.loops if one.edge == edge)
        if follower:
            return self._joined(edge, carried(loop.rotation, loop.lever), loop.freedoms)
        moved = self._with_passive(
            [dict(row) for row in self.rows(edge.follower)], edge, loop.freedoms * -1.0
        )
        back = np.zeros((6, 6), dtype=object)
        forward = carried(loop.rotation, loop.lever)
        back[:3, :3] = forward[:3, :3].T
        back[3:, 3:] = forward[3:, 3:].T
        back[:3, 3:] = _reverse(loop.rotation, loop.lever)
        return apply(back, moved)

    def _on_rigid(self, node: Node, root: Node, mesh: LinkMesh) -> Rows:
        """Another point of the same rigid body: v + ω × (X − X_root)."""
        here = np.zeros(3, dtype=object) if node[1] == "@origin" else mesh.positions[node[1]]
        lever = here - mesh.positions[root[1]]
        eye = np.eye(3).astype(object)
        return apply(carried(eye, lever), self.rows(root))


def _reverse(R: Objects, lever: Objects) -> Objects:
    """The (v, ω) block of X⁻¹: v_b = R v_f − (R ω_f) × lever = R v_f + [lever]× R ω_f."""
    from eigassign.mechanism.rotations import multiply, skew

    return multiply(skew(lever), R)


def apply(X: Objects, rows: Rows) -> Rows:
    """A (6, 6) map of rows: Σ_b X_ab row_b."""
    out: Rows = []
    some = present(X)
    for a in range(6):
        total: Row = {}
        for b in np.flatnonzero(some[a]):
            for unknown, carry in rows[b].items():
                total[unknown] = total.get(unknown, 0.0) + carry * X[a, b]
        out.append({k: v for k, v in total.items() if isinstance(v, Expression) or v != 0.0})
    return out


def planar_rows(rows: Rows, space: str) -> Rows:
    """The components a mechanism of this space has."""
    return [rows[a] for a in DOFS[space]]
