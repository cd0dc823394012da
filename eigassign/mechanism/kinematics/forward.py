"""Kinematics of the equivalent rigid-link system (ERLS), written on numbers and expressions alike.

A follower joined to a base at lever r (base axes), with R from follower to base axes and motion
subspace A of the joint in the follower's axes, has at its joint node the twist

    ω_f = Rᵀ ω_b + A_ω ċ,    v_f = Rᵀ (v_b + ω_b × r) + A_v ċ .

The passive freedoms p of closed loops follow from the coordinates: closure F(p; q, y) = 0 defines
p(q, y), and the loops' twists J_p ṗ + J_q q̇ = 0 give ṗ = P q̇.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from eigassign.case import CaseFile
from eigassign.errors import MechanismError
from eigassign.mechanism.elements.mesh import node_position
from eigassign.mechanism.kinematics.coordinates import Coordinates, Parameters, coordinates
from eigassign.mechanism.kinematics.joints import RIDING, JointMotion, joint_motion, turned
from eigassign.mechanism.kinematics.rotations import (
    Floats,
    Objects,
    cross,
    euler,
    multiply,
    present,
    rotation,
    vector,
)
from eigassign.mechanism.kinematics.topology import Edge, Loop, Node, Placement, Tree, build_tree
from eigassign.series.expression import Scalar


@dataclass(frozen=True)
class Kinematics:
    """Placements base before follower, loops, and the maps between coordinates and freedoms.

    Columns of every twist are q̇ of the coordinates that are not locked.
    """

    placements: tuple[Placement, ...]
    loops: tuple[Loop, ...]
    tree: Tree
    coordinates: Coordinates
    passive: tuple[Scalar, ...] = ()  # the loops' passive freedoms as functions of (q, y)
    rigid: tuple[int, ...] = ()  # columns that nothing resists

    @property
    def columns(self) -> tuple[int, ...]:
        """Indices of the coordinates that are not locked: the q̇ of eq. (1)."""
        return self.coordinates.columns

    @property
    def relative(self) -> Floats:
        """A of s = A q + b."""
        return self.coordinates.relative

    @property
    def offset(self) -> Floats:
        """b of s = A q + b."""
        return self.coordinates.offset

    def placement(self, link: str) -> Placement:
        """The placement of one link."""
        return self._by_link[link]

    @cached_property
    def _by_link(self) -> dict[str, Placement]:
        return {p.link: p for p in self.placements}


def kinematics(case: CaseFile, parameters: Parameters) -> Kinematics:
    """ERLS motion of a case; raises MechanismError for what cannot be placed, moved or closed."""
    tree = build_tree(case)
    motion = replayed(case, parameters, tree, coordinates(case, tree))
    drives = [c.drive for c in case.coordinates.values()]
    free = tuple(k for k, i in enumerate(motion.columns) if drives[i] == "free")
    if free and getattr(case.mechanism, "springs", None):
        from eigassign.mechanism.assembly.rigid_body_modes import separated

        return separated(case, parameters, motion, free)
    return replace(motion, rigid=free)


def replayed(case: CaseFile, parameters: Parameters, tree: Tree, coords: Coordinates) -> Kinematics:
    """The motion for any choice of columns."""
    if tree.loops:
        from eigassign.mechanism.kinematics.loop_closure import close_loops

        return close_loops(case, parameters, tree, coords)
    if tree.passive:
        name = tree.passive[0].joint
        message = "moves without a coordinate in an open chain: give it one, or make it fixed"
        raise MechanismError(f"mechanism.joints.{name}", message)
    values = [parameters.freedom(k) for k in range(len(tree.freedoms))]
    return walk(case, parameters, tree, coords, values, coords.rates.astype(object))


def all_moving(case: CaseFile, parameters: Parameters, motion: Kinematics) -> Kinematics:
    """The same motion with every coordinate among the columns, locked ones too."""
    c = motion.coordinates
    n = len(c.relative)
    rates = np.zeros((len(motion.tree.freedoms), n))
    rates[:n] = c.relative
    coords = replace(c, columns=tuple(range(n)), rates=rates)
    return replayed(case, parameters, motion.tree, coords)


def walk(
    case: CaseFile,
    parameters: Parameters,
    tree: Tree,
    coords: Coordinates,
    values: Sequence[Scalar],
    rates: Objects,
) -> Kinematics:
    """Place every link for the freedoms' ``values``, moving at ċ = ``rates`` (n_freedoms, n)."""
    way = _Walk(case, parameters, tree, values, rates)
    for edge in tree.edges:
        way.placed[edge.follower[0]] = way.place(edge)
    loops = tuple(way.loop(edge) for edge in tree.loops)
    return Kinematics(tuple(way.placed.values()), loops, tree, coords)


@dataclass(frozen=True, eq=False)
class _Walk:
    """What is known on the way from the ground to the tips; each joint and each node once."""

    case: CaseFile
    parameters: Parameters
    tree: Tree
    values: Sequence[Scalar]
    rates: Objects
    placed: dict[str, Placement] = field(default_factory=dict)
    _twists: dict[Node, Objects] = field(default_factory=dict)
    _rigid: dict[object, JointMotion] = field(default_factory=dict)

    def place(self, edge: Edge) -> Placement:
        """The link that this joint carries."""
        motion = self._motion(edge)
        root = self._position(edge.follower)
        return Placement(
            link=edge.follower[0],
            edge=edge,
            rotation=motion.rotation,
            lever=motion.translation,
            freedoms=motion.freedoms,
            twist=_shifted(self._reached(edge, motion), root * -1.0),
            base=self.placed.get(edge.base[0]),
            foot=self._position(edge.base),
            root=root,
        )

    def loop(self, edge: Edge) -> Loop:
        """Both ways to the follower of a joint that closes a loop."""
        motion = self._motion(edge)
        R_base, x_base = self._stands(edge.base)
        R_end, x_end = self._stands(edge.follower)
        return Loop(
            edge=edge,
            rotation=motion.rotation,
            lever=motion.translation,
            freedoms=motion.freedoms,
            position_gap=x_base + multiply(R_base, motion.translation) - x_end,
            misalignment=multiply(multiply(R_base, motion.rotation).T, R_end),
            twist_gap=self._twist(edge.follower) - self._reached(edge, motion),
        )

    def _position(self, node: Node) -> Objects:
        if node[0] == "ground":
            return np.zeros(3, dtype=object)
        return node_position(self.case, self.parameters, self.tree, node)

    def _stands(self, node: Node) -> tuple[Objects, Objects]:
        """World rotation and world position of a node."""
        if node[0] == "ground":
            return np.eye(3).astype(object), np.zeros(3, dtype=object)
        return self.placed[node[0]].at(self._position(node))

    def _twist(self, node: Node) -> Objects:
        """Twist (6, n) of a node in its link's axes."""
        if node not in self._twists:
            ground = node[0] == "ground"
            self._twists[node] = (
                np.zeros((6, self.rates.shape[1]), dtype=object)
                if ground
                else _shifted(self.placed[node[0]].twist, self._position(node))
            )
        return self._twists[node]

    def _reached(self, edge: Edge, motion: JointMotion) -> Objects:
        """Twist of the follower's joint node: carried from the base, and the joint's own."""
        base = _shifted(self._twist(edge.base), motion.translation)
        rotated = multiply(motion.rotation.T, np.concatenate([base[:3], base[3:]], axis=1))
        moved = np.concatenate(np.split(rotated, 2, axis=1))
        own = self.tree.of_joint(edge.joint)
        return moved + multiply(motion.freedoms, self.rates[own]) if own else moved

    def _motion(self, edge: Edge) -> JointMotion:
        """R, lever and A of a joint as it is walked, mounting and position included."""
        own = self.tree.of_joint(edge.joint)
        joint = self.case.mechanism.joints[edge.joint]
        if own:
            return _walked(joint, edge.turned, [self.values[k] for k in own])
        keys = ("type", "angle", "orientation", "position")
        alike = (*(str(getattr(joint, key, None)) for key in keys), edge.turned)
        if alike not in self._rigid:
            self._rigid[alike] = _walked(joint, edge.turned, [])
        return self._rigid[alike]


def _walked(joint: Any, backwards: bool, values: Sequence[Scalar]) -> JointMotion:
    motion = _mounted(joint, mounting(joint), joint_motion(joint, values))
    position = vector(getattr(joint, "position", None) or (0.0, 0.0))
    motion = motion._replace(translation=position + motion.translation)
    return turned(motion) if backwards else motion


def _mounted(joint: object, mount: Objects, motion: JointMotion) -> JointMotion:
    """The joint turned as a whole; what rides on a beam keeps the beam's axis instead."""
    if getattr(joint, "type", "") not in RIDING:
        R, d = multiply(mount, motion.rotation), multiply(mount, motion.translation)
        return JointMotion(R, d, motion.freedoms)
    R = multiply(motion.rotation, mount)
    A = np.concatenate([multiply(mount.T, motion.freedoms[k : k + 3]) for k in (0, 3)])
    return JointMotion(R, motion.translation, A)


def mounting(joint: object) -> Objects:
    """Rotation of the joint's zero position in its base: planar ``angle`` or spatial angles."""
    orientation = getattr(joint, "orientation", None)
    if orientation is not None:
        return euler(orientation).astype(object)
    return rotation(np.array([0.0, 0.0, 1.0]), float(getattr(joint, "angle", 0.0) or 0.0))


def _shifted(twist: Objects, lever: Objects) -> Objects:
    """The twist at another point of the same body: v + ω × lever."""
    if not present(lever).any():
        return twist
    return np.concatenate([twist[:3] + cross(twist[3:], lever), twist[3:]])
