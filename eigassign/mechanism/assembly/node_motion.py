"""Q: the elastic motion of every node, loops between rigid links included, and springs.

A node is its link's own (its dofs are unknowns), or is carried: the joint node of a follower moves
with its base node, u_f = X u_b + A δ, where δ are the elastic motions of passive joints (unknowns
too), and a loop-closing joint carries one node of the loop likewise. A motion is written as rows
{unknown: coefficient} of six components in the link's axes.

Where no node of its own deforms, a loop leaves its passive joints no elastic motion δ to choose:
the two ways round it move its closing joint alike,

    G u + J δ = 0,    δ = −J⁻¹ G u,

with u the unknowns of whatever the loop hangs on (nothing, if that is the ground), J the Jacobian
that also gives ṗ = P q̇. Of more passive freedoms than rows some stay unknowns; redundant rows are
met in least squares if they are consistent, and refused if they would clamp what deforms.

The spring is stress-free in every pose; it resists the relative motion of its ends at the place of
the second, k_t |v_2 − v_1 − ω_1 × d|² + k_r |ω_2 − ω_1|²: the first node reaches there by a rigid
arm d, so that the spring's forces balance and turning everything strains nothing. Each end moves
with the elastic *and* the rigid motion of its link.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from scipy import linalg

from eigassign.arrays import Floats, Ints
from eigassign.case.case_file import CaseFile
from eigassign.errors import MechanismError
from eigassign.mechanism.assembly.pencil import AffineEntries
from eigassign.mechanism.elements.links import LinkMesh
from eigassign.mechanism.kinematics.forward import Kinematics, shifted
from eigassign.mechanism.kinematics.joints import (
    DOFS,
    Objects,
    carried,
    mounting,
    multiply,
    present,
    some,
)
from eigassign.mechanism.kinematics.loop_closure import RANK, passive_motion
from eigassign.mechanism.kinematics.parameters import STILL, ModelParameters, node_position
from eigassign.mechanism.kinematics.topology import GROUND, Freedom, JointEdge, NodeName, split
from eigassign.series.expression import Scalar

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
            # another point of the same body: v + ω × (X − X_root)
            here = np.zeros(3, dtype=object) if node[1] == "@origin" else mesh.positions[node[1]]
            root = placement.edge.follower
            lever = here - mesh.positions[root[1]]
            return apply(carried(np.eye(3).astype(object), lever), self.rows(root))
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


def combined(row: MotionRow, other: MotionRow, factor: Scalar) -> MotionRow:
    """row + factor × other."""
    out = dict(row)
    for unknown, value in other.items():
        out[unknown] = out.get(unknown, 0.0) + value * factor
    return out


def along(moved: Sequence[MotionRow], direction: Sequence[float] | Floats) -> MotionRow:
    """n·v for n of unit length."""
    n = np.array(direction) / np.linalg.norm(direction)
    row: MotionRow = {}
    for own, share in zip(moved, n.tolist(), strict=False):
        row = combined(row, own, share) if share else row
    return row


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
    nodes.known.clear()  # what passive joints do has changed


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


def add_springs(
    target: AffineEntries,
    case: CaseFile,
    parameters: ModelParameters,
    motion: Kinematics,
    nodes: NodeMotions,
) -> None:
    """Add every spring of the case to K; rigid motions are those that no spring resists."""
    rigid = {nodes.count + k for k in motion.rigid}
    for k, here, there in SpringEnds(case, parameters, motion, nodes.rows, nodes.count).all():
        full = combined(there, here, -1.0)
        target.add_square(k, [(i, value) for i, value in full.items() if i not in rigid])


class SpringMotion(NamedTuple):
    """A spring, the motions of its two nodes at the place of the second, in its axes.

    ``rotation`` turns its axes into those of the world, where ``arm`` runs from node to node.
    """

    start: NodeName
    end: NodeName
    stiffness: Sequence[Scalar]
    here: MotionRows
    there: MotionRows
    rotation: Objects
    arm: Objects


@dataclass(frozen=True, eq=False)
class SpringEnds:
    """The motions of both ends of every spring over [u; q̇], the q̇ numbered from ``first`` on."""

    case: CaseFile
    parameters: ModelParameters
    motion: Kinematics
    elastic: Callable[[NodeName], MotionRows]  # a node's rows over u
    first: int

    def all(self) -> Iterator[tuple[Scalar, MotionRow, MotionRow]]:
        """Stiffness and motions of both ends, six rows for every spring, in the spring's axes."""
        for spring in self.each():
            yield from zip(spring.stiffness, spring.here, spring.there, strict=True)

    def each(self) -> Iterator[SpringMotion]:
        """The springs one by one."""
        springs: Any = self.case.mechanism.springs
        for name, spring in springs.items():
            start, end = (GROUND if e == "ground" else split(e) for e in spring.between)
            stiffness = self._stiffness(f"springs.{name}", spring)
            mount = mounting(self.parameters.angles(f"springs.{name}", spring))
            yield self._motions(start, end, mount, stiffness)

    def _stiffness(self, path: str, spring: Any) -> list[Scalar]:
        """Six values k_t, k_r per axis; a number stands for every axis of the space."""
        out: list[Scalar] = []
        for key, first in (("translational", 0), ("rotational", 3)):
            given = getattr(spring, key, None) or 0.0
            axes = [d - first for d in DOFS[self.case.mechanism.space] if first <= d < first + 3]
            values: list[Scalar] = [0.0, 0.0, 0.0]
            for position, axis in enumerate(axes):
                if isinstance(given, (tuple, list)):
                    values[axis] = float(given[position])
                else:
                    values[axis] = self.parameters.number(f"{path}.{key}", given)
            out += values
        return out

    def _motions(
        self, start: NodeName, end: NodeName, mount: Objects, stiffness: Sequence[Scalar]
    ) -> SpringMotion:
        """Motion of both ends in the spring's axes, the first carried to the second."""
        here, there, arm = self.in_world(start), self.in_world(end), np.zeros(3, dtype=object)
        if GROUND not in (start, end):
            first, second = (self.motion.placement(n[0]).at(self._local(n)) for n in (start, end))
            arm = second[1] - first[1]
            here = apply(carried(np.eye(3).astype(object), arm), here)
        R = mount  # in the ground, where that is first
        if start != GROUND:
            mount = multiply(self.parameters.moved.get(start, STILL).turn, mount)
            R = multiply(self.motion.placement(start[0]).world_rotation, mount)
        seen = carried(R, np.zeros(3, dtype=object))
        return SpringMotion(start, end, stiffness, apply(seen, here), apply(seen, there), R, arm)

    def _local(self, node: NodeName) -> Objects:
        known = self.parameters.with_passive(self.motion.passive)
        return node_position(self.case, known, self.motion.tree, node)

    def in_world(self, node: NodeName) -> MotionRows:
        """Full motion of a node in world axes: elastic rows and N T columns."""
        if node == GROUND:
            return [{} for _ in range(6)]
        placement = self.motion.placement(node[0])
        rows = whole_rows(self.elastic(node), placement.twist, self._local(node), self.first)
        return apply(carried(placement.world_rotation.T, np.zeros(3, dtype=object)), rows)


def whole_rows(elastic: MotionRows, twist: Objects, place: Objects, first: int) -> MotionRows:
    """Rows over [u; q̇] of a node at ``place`` in its link, the q̇ numbered from ``first`` on."""
    rows, rigid = [dict(row) for row in elastic], shifted(twist, place)
    for a, k in zip(*np.nonzero(present(rigid)), strict=True):
        rows[a][first + int(k)] = rigid[a, k]
    return rows
