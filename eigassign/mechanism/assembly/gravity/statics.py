"""Statics of a pose: the wrenches that the weight sends through every joint, drives holding it.

Wrenches are (F, M) in N and N m about a point, in the axes of a link. A link's own is J (g, 0) with
J = Nᵀ m N about its origin. In a tree, a joint carries the sum of all that hangs on it. Loops add
the wrenches λ of their closing joints, which make the passive freedoms p feel no force:

    J_pᵀ λ = −Σ_links T_pᵀ W,

J_p the rates of the loops' gaps, T_p the twists per ṗ. Where that leaves λ open, loops that close
at nodes that deform have the forces that these put on them (`elastic`), as springs have, and among
rigid links the least λ is as good as any, for no motion feels the difference.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from eigassign.case.case_file import CaseFile
from eigassign.errors import MechanismError
from eigassign.mechanism.assembly.congruence import LocalLink, inertia
from eigassign.mechanism.assembly.gravity.elastic import Sagging, sagging
from eigassign.mechanism.assembly.node_motion import NodeMotions
from eigassign.mechanism.assembly.springs import SpringEnds, SpringMotion
from eigassign.mechanism.kinematics.forward import Kinematics, walk
from eigassign.mechanism.kinematics.loop_closure import passive_motion
from eigassign.mechanism.kinematics.parameters import ModelParameters, node_position
from eigassign.mechanism.kinematics.rotations import DOFS, Floats, Objects, cross, multiply
from eigassign.mechanism.kinematics.topology import GROUND, JointEdge, NodeName

Coarse = tuple[Mapping[str, LocalLink], NodeMotions]


@dataclass(frozen=True)
class Statics:
    """``on_nodes``: what acts on the nodes of each link but its own weight, about each node;
    ``through``: what the follower of each joint, as it is walked, puts on its base node; both in
    the axes of the link that it acts on. ``g`` is gravity in those of each link, m/s². ``springs``
    with their forces (F, M) in their own axes.
    """

    g: Mapping[str, Objects]
    on_nodes: Mapping[str, Sequence[tuple[str, Objects]]]
    through: Mapping[str, Objects]
    springs: Sequence[tuple[SpringMotion, Objects]]


def hangs_on_stiffness(case: CaseFile, motion: Kinematics) -> bool:
    """True where statics alone do not tell the forces."""
    tree, width = motion.tree, len(DOFS[case.mechanism.space])
    redundant = tree.n_elastic > 0 and width * len(tree.loops) != len(tree.passive)
    return redundant or bool(case.mechanism.springs)


def statics(
    case: CaseFile,
    parameters: ModelParameters,
    motion: Kinematics,
    links: Mapping[str, LocalLink],
    gravity: Floats,
    coarse: Coarse | None,
) -> Statics:
    """Wrenches through the joints of a mechanism under its weight, as functions of (q, y).

    ``coarse`` is the mechanism in as few elements as may be, where `hangs_on_stiffness`.
    """
    known, kept = parameters.with_passive(motion.passive), list(DOFS[case.mechanism.space])
    g = {p.link: multiply(p.world_rotation.T, gravity) for p in motion.placements}
    own = {name: np.zeros(6, dtype=object) for name in g}
    for name, link in links.items():
        pull = np.concatenate([g[name], np.zeros(3, dtype=object)])[kept]
        own[name][kept] = multiply(inertia(link), pull)
    hanging = tuple(p.edge for p in reversed(motion.placements))
    found = _Wrenches(case, known, motion, own, dict(own), {name: [] for name in own}, hanging)
    springs: list[tuple[SpringMotion, Objects]] = []
    loops = motion.tree.loops
    if coarse is not None:
        named, nodes = coarse
        ends = list(SpringEnds(case, known, motion, nodes.rows, nodes.count).each())
        sag = sagging(named, nodes, ends, g, known.recorder)
        springs = [(spring, sag.stretched(spring)) for spring in ends]
        for spring, force in springs:
            found.stretch(spring, force)
        found.close_elastic(sag, loops[: motion.tree.n_elastic], loops[motion.tree.n_elastic :])
        loops = loops[motion.tree.n_elastic :]
    for edge, wrench in _closing(known, motion, loops, found):
        found.close(edge, wrench)
    for edge in found.hanging:
        found.hang(edge)
    return Statics(g, found.on_nodes, found.through, springs)


@dataclass
class _Wrenches:
    """The wrenches as they are gathered, from the tips to the ground."""

    case: CaseFile
    parameters: ModelParameters
    motion: Kinematics
    own: dict[str, Objects]  # of each link, its springs and closing joints, about its origin
    total: dict[str, Objects]  # of all that hangs on it as well
    on_nodes: dict[str, list[tuple[str, Objects]]]
    hanging: tuple[JointEdge, ...]  # what is to be hung yet, the tips first
    through: dict[str, Objects] = field(default_factory=dict)

    def acting_on(self, node: NodeName) -> Objects:
        """The sum of what acts on a node so far."""
        found = [wrench for name, wrench in self.on_nodes[node[0]] if name == node[1]]
        return np.asarray(sum(found, np.zeros(6, dtype=object)))

    def close_elastic(
        self, sag: Sagging, loops: Sequence[JointEdge], later: Sequence[JointEdge]
    ) -> None:
        """Close ``loops`` one by one where one of the two nodes receives nothing unknown else.

        What has no loop to wait for, those that close ``later`` among them, is hung meanwhile.
        Raises MechanismError where no node tells.
        """
        waiting = list(loops)
        while waiting:
            known = [e for e in self.hanging if self._is_complete(e.follower[0], *waiting, *later)]
            for edge in known:
                self.hang(edge)
            ends = [(e, n) for e in waiting for n in (e.follower, e.base) if n in sag]
            others = [*self.hanging, *waiting, *later]
            free = [(e, n) for e, n in ends if not _touched(n, [o for o in others if o is not e])]
            if free:
                edge, node = free[0]
                wrench = sag.on_node(node) - self.acting_on(node)
                self.close(edge, wrench if node == edge.follower else self._back(edge, wrench))
                waiting.remove(edge)
            elif not known:
                raise MechanismError(
                    f"mechanism.joints.{waiting[0].joint}",
                    "closes a loop at nodes where other loops close, which leaves forces of the "
                    "weight unknown: give each loop nodes of its own, or write gravity: none",
                )

    def _is_complete(self, link: str, *waiting: JointEdge) -> bool:
        """True where nothing that is to come acts on a link but the joint that it hangs on."""
        hung = any(edge.base[0] == link for edge in self.hanging)
        return not hung and all(link not in (e.base[0], e.follower[0]) for e in waiting)

    def _back(self, edge: JointEdge, wrench: Objects) -> Objects:
        """The wrench on the follower of a closing joint from that on its base node."""
        loop = next(one for one in self.motion.loops if one.edge == edge)
        F, M = wrench[:3], wrench[3:] - cross(loop.lever, wrench[:3])
        return np.concatenate([multiply(loop.rotation.T, each) * -1.0 for each in (F, M)])

    def stretch(self, spring: SpringMotion, force: Objects) -> None:
        """A spring's force on the second of its nodes, and its opposite on the first."""
        R, zero = spring.rotation, np.zeros(3, dtype=object)
        in_world = np.concatenate([multiply(R, force[:3]), multiply(R, force[3:])])
        self._act_in_world(spring.end, np.negative(in_world))
        lever = np.concatenate([zero, cross(spring.arm, in_world[:3])])
        self._act_in_world(spring.start, in_world + lever)

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
        at_root = _about(self.total[placement.link], placement.root)
        self.on_nodes[placement.link].append((edge.follower[1], at_root * -1.0))
        on_base = handed(at_root, placement.rotation, placement.lever)
        self.through[edge.joint] = on_base
        self.hanging = tuple(each for each in self.hanging if each is not edge)
        if edge.base != GROUND:
            self.on_nodes[edge.base[0]].append((edge.base[1], on_base))
            self.total[edge.base[0]] = self.total[edge.base[0]] + self._at_origin(
                edge.base, on_base
            )

    def _act_in_world(self, node: NodeName, wrench: Objects) -> None:
        if node != GROUND:
            back = self.motion.placement(node[0]).world_rotation.T
            self._act(node, np.concatenate([multiply(back, w) for w in np.split(wrench, 2)]))

    def _act(self, node: NodeName, wrench: Objects) -> None:
        if node == GROUND:
            return
        self.on_nodes[node[0]].append((node[1], wrench))
        for of_link in (self.own, self.total):
            of_link[node[0]] = of_link[node[0]] + self._at_origin(node, wrench)

    def _at_origin(self, node: NodeName, wrench: Objects) -> Objects:
        place = node_position(self.case, self.parameters, self.motion.tree, node)
        return _about(wrench, place * -1.0)


def handed(wrench: Objects, rotation: Objects, lever: Objects) -> Objects:
    """A wrench on a follower's node about the base node, in the base's axes."""
    F, M = multiply(rotation, wrench[:3]), multiply(rotation, wrench[3:])
    return np.concatenate([F, M + cross(lever, F)])


def _about(wrench: Objects, point: Objects) -> Objects:
    """The wrench about another point of the same link: M − X × F."""
    return np.concatenate([wrench[:3], wrench[3:] - cross(point, wrench[:3])])


def _touched(node: NodeName, edges: Sequence[JointEdge]) -> bool:
    """True where one of the joints is at a node."""
    return any(node in (edge.base, edge.follower) for edge in edges)


def passive_rates(case: CaseFile, known: ModelParameters, motion: Kinematics) -> Kinematics:
    """The motion with the passive freedoms as its columns, each by itself."""
    tree, coords = motion.tree, motion.coordinates
    values = [known.freedom(k) for k in range(len(tree.freedoms))]
    unit = np.eye(len(tree.freedoms), dtype=object)[:, len(coords.relative) :]
    return walk(case, known, tree, coords, values, unit)


def _closing(
    known: ModelParameters, motion: Kinematics, loops: Sequence[JointEdge], found: _Wrenches
) -> list[tuple[JointEdge, Objects]]:
    """λ (6,) on the follower of the closing joints that are left, in the follower's axes.

    Of more rows than passive freedoms λ = −J (JᵀJ)⁻¹ G.
    """
    if not loops:
        return []
    moved, kept = passive_rates(found.case, known, motion), list(DOFS[found.case.mechanism.space])
    J = np.concatenate([loop.twist_gap[kept] for loop in moved.loops if loop.edge in loops])
    right = np.zeros((J.shape[1], 1), dtype=object)  # G
    for p in moved.placements:
        right[:, 0] = right[:, 0] + multiply(p.twist.T, found.own[p.link])
    rows, columns = J.shape
    if rows < columns:
        raise MechanismError(
            f"mechanism.joints.{loops[0].joint}",
            "closes a loop whose passive joints can move by themselves under the weight: hold "
            "that motion, or write gravity: none",
        )
    if rows == columns:
        forces = passive_motion(known.recorder, J.T, right)[:, 0]
    else:
        forces = multiply(J, passive_motion(known.recorder, multiply(J.T, J), right)[:, 0])
    out = []
    for edge, force in zip(loops, np.split(forces, len(loops)), strict=True):
        wrench = np.zeros(6, dtype=object)
        wrench[kept] = force
        out.append((edge, wrench))
    return out
