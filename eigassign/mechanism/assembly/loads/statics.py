"""A mechanism that loads act on, and the wrenches through every joint in a pose that drives hold.

Wrenches are (F, M) in N and N m about a point, in the axes of a link. In a tree, a joint carries
the sum of all that hangs on it. Loops add the wrenches λ of their closing joints, which make the
passive freedoms p feel no force:

    J_pᵀ λ = −Σ_links T_pᵀ W,

J_p the rates of the loops' gaps, T_p the twists per ṗ. Where that leaves λ open, loops that close
at nodes that deform have the forces that their links tell: all that acts on such a node adds up to
what the link receives there. Among rigid links the least λ is as good as any, for no motion feels
the difference.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from eigassign.arrays import Floats
from eigassign.case.case_file import CaseFile
from eigassign.errors import MechanismError
from eigassign.mechanism.assembly.congruence import LocalLink, inertia
from eigassign.mechanism.assembly.node_motion import (
    MotionRow,
    MotionRows,
    NodeMotions,
    SpringEnds,
    SpringMotion,
    pivots,
    whole_rows,
)
from eigassign.mechanism.elements.links import Entries, LinkMesh, add_bodies, summed
from eigassign.mechanism.kinematics.forward import Kinematics, walk
from eigassign.mechanism.kinematics.joints import DOFS, Objects, cross, multiply, scaled, some
from eigassign.mechanism.kinematics.loop_closure import passive_motion, reference
from eigassign.mechanism.kinematics.parameters import ModelParameters, link_type, node_position
from eigassign.mechanism.kinematics.topology import GROUND, JointEdge, NodeName, Topology, split
from eigassign.series.expression import Scalar

ABSENT = np.full(6, -1)


@dataclass(frozen=True, eq=False)
class Loaded:
    """A mechanism that loads act on; the passive freedoms of ``known`` are known.

    ``bent``: parts known by their matrices bend between their nodes as beams do: `second_order`.
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
        """The masses (6, 6) of bodies at nodes that have any; a rigid link's all at its origin."""
        found: dict[NodeName, Objects] = {}
        for name, link in self.links.items():
            J, kept = np.zeros((6, 6), dtype=object), list(DOFS[self.nodes.space])
            if self.is_rigid(name):
                J[np.ix_(kept, kept)] = inertia(link)
                found[name, "@origin"] = J
        for owner, node in (split(body.at) for body in self.case.mechanism.bodies.values()):
            if not self.is_rigid(owner) and (owner, node) not in found:
                own, others = Entries((6, 6)), dict.fromkeys(self.nodes.meshes[owner].nodes, ABSENT)
                add_bodies(self.case, self.known, owner, own, others | {node: np.arange(6)})
                found[owner, node] = summed(own.terms(), 6)
        return found

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
        return self.nodes.meshes[name].whole

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
        twist = self.motion.placement(node[0]).twist
        return whole_rows(self.nodes.rows(node), twist, self.place(node), self.nodes.count)

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


class Loads(NamedTuple):
    """What acts in a pose: functions of (q, y), variables, or numbers of many loads, axis behind.

    All in the axes of the link that it acts on, of a spring in its own.
    """

    on_links: Mapping[str, Any]  # wrench (6,) of all that a link and its bodies bear, at its origin
    on_sites: Mapping[NodeName, Any]  # wrench (6,) of what a site carries, about it
    arms: Mapping[NodeName, Any]  # D = ∫ dF rᵀ (3, 3) of what a site carries, r from there
    in_solids: Mapping[str, Any]  # ρ ω̃ ω̃ (6,): xx, yy, zz, xy, xz, yz
    in_springs: Mapping[int, Any]  # wrench (6,) on the first end
    received: Mapping[NodeName, Any]  # (6,) by nodes of `LoopsAtNodes` from joints and springs

    @property
    def each(self) -> list[Any]:
        """All arrays, in one order."""
        return [array for own in self for array in own.values()]


class Statics(NamedTuple):
    """``on_nodes``: what joints and springs put on the nodes of each link, about each node;
    ``through``: what the follower of each joint, as it is walked, puts on its base node.
    """

    on_nodes: Mapping[str, Sequence[tuple[str, Objects]]]
    through: Mapping[str, Objects]


def statics(scene: Loaded, loads: Loads) -> Statics:
    """Wrenches through the joints of a mechanism."""
    found = _Wrenches(scene, dict(loads.on_links), {name: [] for name in loads.on_links})
    for k, spring in enumerate(scene.springs):
        found.stretch(spring, loads.in_springs[k])
    found.close_at_nodes(loads)
    found.close_rigid(scene.motion.tree.loops[len(scene.settled.loops) :])
    for edge in reversed(scene.motion.tree.edges):
        found.hang(edge)
    return Statics(found.on_nodes, found.through)


@dataclass(frozen=True, eq=False)
class _Wrenches:
    """The wrenches as they are gathered: springs, loops, then the tree from its tips."""

    scene: Loaded
    total: dict[str, Objects]  # of each link and what acts on its nodes so far, about its origin
    on_nodes: dict[str, list[tuple[str, Objects]]]
    through: dict[str, Objects] = field(default_factory=dict)

    def stretch(self, spring: SpringMotion, force: Objects) -> None:
        """A spring's force on the first of its nodes, and its opposite on the second."""
        F, M = (multiply(spring.rotation, each) for each in np.split(force, 2))
        self._act(spring.start, self._seen(spring.start, F, M + cross(spring.arm, F)))
        self._act(spring.end, self._seen(spring.end, F * -1.0, M * -1.0))

    def close(self, edge: JointEdge, wrench: Objects) -> None:
        """A wrench on the follower of a closing joint, and its opposite on the base."""
        loop = next(one for one in self.scene.motion.loops if one.edge == edge)
        self._act(edge.follower, wrench)
        self.through[edge.joint] = handed(wrench * -1.0, loop.rotation, loop.lever)
        self._act(edge.base, self.through[edge.joint])

    def hang(self, edge: JointEdge) -> None:
        """The follower with all that hangs on it, on its base."""
        placement = self.scene.motion.placement(edge.follower[0])
        at_root = _about(self.total[placement.link], placement.root)
        self.on_nodes[placement.link].append((edge.follower[1], at_root * -1.0))
        self.through[edge.joint] = handed(at_root, placement.rotation, placement.lever)
        self._act(edge.base, self.through[edge.joint])

    def close_at_nodes(self, loads: Loads) -> None:
        """Close the loops whose forces nodes tell."""
        loops, nodes, inverse = self.scene.settled
        b = [self._missing(node, loads.received[node]) for node in nodes]
        for edge, row in zip(loops, inverse.tolist(), strict=True):
            shares = [scaled(each, s) for each, s in zip(b, row, strict=True) if abs(s) > 1e-9]
            self.close(edge, self._at(edge.follower, sum(shares[1:], shares[0])))

    def close_rigid(self, loops: Sequence[JointEdge]) -> None:
        """Close the other loops: λ = −J (JᵀJ)⁻¹ G, J the independent columns.

        Freedoms that depend on them, or that nodes have settled, are in balance, too.
        """
        if not loops:
            return
        case, known, motion = self.scene.case, self.scene.known, self.scene.motion
        tree, coords, kept = motion.tree, motion.coordinates, list(DOFS[self.scene.nodes.space])
        each = np.eye(len(tree.freedoms), dtype=object)[:, len(coords.relative) :]
        moved = walk(case, known, tree, coords, each)  # the passive freedoms, each by itself
        J = np.concatenate([loop.twist_gap[kept] for loop in moved.loops if loop.edge in loops])
        G = np.zeros((J.shape[1], 1), dtype=object)
        for p in moved.placements:
            G[:, 0] = G[:, 0] + multiply(p.twist.T, self.total[p.link])
        own = pivots(known.compiled(J)(reference(case, known)[:, None])[0][0])
        J, G = J[:, own], G[own]
        if len(J) == len(own):
            found = passive_motion(known.recorder, J.T, G)
        else:
            found = multiply(J, passive_motion(known.recorder, multiply(J.T, J), G))
        wrenches = np.zeros((len(loops), 6), dtype=object)
        wrenches[:, kept] = found.reshape(len(loops), -1)
        for edge, wrench in zip(loops, wrenches, strict=True):
            self.close(edge, wrench)

    def _missing(self, node: NodeName, received: Objects) -> Objects:
        """What must act on a node beside all that is known, in the world about its origin."""
        acting = [wrench for name, wrench in self.on_nodes[node[0]] if name == node[1]]
        out = self._in_world(node, received - sum(acting, np.zeros(6, dtype=object)))
        tree = self.scene.motion.tree
        for edge, sign in tree.hanging(node):
            for link in tree.beyond[edge.follower[0]]:
                out = out - self._in_world((link, "@origin"), self.total[link]) * sign
        return np.asarray(out)

    # --- the same wrench elsewhere

    def _act(self, node: NodeName, wrench: Objects) -> None:
        if node != GROUND:
            self.on_nodes[node[0]].append((node[1], wrench))
            at_origin = _about(wrench, self.scene.place(node) * -1.0)
            self.total[node[0]] = self.total[node[0]] + at_origin

    def _seen(self, node: NodeName, F: Objects, M: Objects) -> Objects:
        """A wrench at a node from the axes of the world in those of its link."""
        if node == GROUND:
            return np.concatenate([F, M])
        back = self.scene.motion.placement(node[0]).world_rotation.T
        return np.concatenate([multiply(back, F), multiply(back, M)])

    def _in_world(self, node: NodeName, wrench: Objects) -> Objects:
        """A wrench at a node of a link, in the world about its origin."""
        R, X = self.scene.motion.placement(node[0]).at(self.scene.place(node))
        return handed(wrench, R, X)

    def _at(self, node: NodeName, wrench: Objects) -> Objects:
        """The opposite."""
        X = self.scene.motion.placement(node[0]).at(self.scene.place(node))[1]
        there = _about(wrench, X)
        return self._seen(node, there[:3], there[3:])


def handed(wrench: Objects, rotation: Objects | Floats, lever: Objects) -> Objects:
    """A wrench on a follower's node about the base node, in the base's axes."""
    F, M = multiply(rotation, wrench[:3]), multiply(rotation, wrench[3:])
    return np.concatenate([F, M + cross(lever, F)])


def _about(wrench: Objects, point: Objects) -> Objects:
    """The wrench about another point of the same link: M − X × F."""
    return np.concatenate([wrench[:3], wrench[3:] - cross(point, wrench[:3])])
