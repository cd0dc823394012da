"""Statics of a pose, drives holding it: the wrenches through every joint, for whatever loads act.

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
from typing import Any

import numpy as np

from eigassign.mechanism.assembly.loads.loaded import Loaded
from eigassign.mechanism.assembly.node_motion import pivots
from eigassign.mechanism.assembly.springs import SpringMotion
from eigassign.mechanism.kinematics.forward import Kinematics, walk
from eigassign.mechanism.kinematics.loop_closure import passive_motion, reference
from eigassign.mechanism.kinematics.rotations import (
    DOFS,
    Floats,
    Objects,
    cross,
    multiply,
    scaled,
)
from eigassign.mechanism.kinematics.topology import GROUND, JointEdge, NodeName


@dataclass(frozen=True)
class Loads:
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
        return [array for own in vars(self).values() for array in own.values()]


@dataclass(frozen=True)
class Statics:
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
        case, known, moved = self.scene.case, self.scene.known, self._passive_rates
        kept = list(DOFS[self.scene.nodes.space])
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

    @property
    def _passive_rates(self) -> Kinematics:
        """The motion with the passive freedoms as its columns, each by itself."""
        motion, known = self.scene.motion, self.scene.known
        tree, coords = motion.tree, motion.coordinates
        values = [known.freedom(k) for k in range(len(tree.freedoms))]
        unit = np.eye(len(values), dtype=object)[:, len(coords.relative) :]
        return walk(self.scene.case, known, tree, coords, values, unit)

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
