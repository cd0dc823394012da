"""Kinematics of the equivalent rigid-link system (ERLS), written on numbers and expressions alike.

A follower joined to a base at lever r (base axes), with R from follower to base axes and motion
subspace A of the joint in the follower's axes, has at its joint node the twist

    ω_f = Rᵀ ω_b + A_ω ċ,    v_f = Rᵀ (v_b + ω_b × r) + A_v ċ .

The passive freedoms p of closed loops follow from the coordinates: closure F(p; q, y) = 0 defines
p(q, y), and the loops' twists J_p ṗ + J_q q̇ = 0 give ṗ = P q̇.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from eigassign.case import CaseFile
from eigassign.errors import MechanismError
from eigassign.mechanism.coordinates import Coordinates, coordinates
from eigassign.mechanism.geometry import node_position
from eigassign.mechanism.joints import RIDING, JointMotion, joint_motion, turned
from eigassign.mechanism.parameters import Parameters
from eigassign.mechanism.rotations import (
    Floats,
    Objects,
    carried,
    cross,
    euler,
    multiply,
    rotation,
    vector,
)
from eigassign.mechanism.spanning import build_tree
from eigassign.mechanism.tree import Edge, Node, Tree
from eigassign.series.expression import Scalar

PLANAR_TWIST = (0, 1, 5)  # v_x, v_y, ω_z among (v, ω)
SPATIAL_TWIST = (0, 1, 2, 3, 4, 5)


@dataclass(frozen=True)
class Placement:
    """How one link hangs on its base, and its motion.

    ``rotation`` turns the link's components into base components; ``lever`` runs from the base node
    to the joint node of the link (base axes); ``freedoms`` is A (6, k). ``twist`` (6, n_columns) is
    that of the link's own origin per column, in its own axes.
    """

    link: str
    edge: Edge
    rotation: Objects
    lever: Objects
    freedoms: Objects
    world_rotation: Objects
    world_origin: Objects
    twist: Objects


@dataclass(frozen=True)
class Loop:
    """One loop-closing joint: pose and twist of its follower node, reached along both sides."""

    edge: Edge
    rotation: Objects  # from the follower's axes to the base link's axes
    lever: Objects  # from base node to follower node, base axes
    freedoms: Objects
    position_gap: Objects  # (3,) world: along the base side minus along the follower side
    misalignment: Objects  # (3, 3): R_baseᵀ R_follower, the identity when closed
    twist_gap: Objects  # (6, n_columns): follower's own twist minus the carried and joint twist


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
        from eigassign.mechanism.rigid_motions import separated

        return separated(case, parameters, motion, free)
    return replace(motion, rigid=free)


def replayed(case: CaseFile, parameters: Parameters, tree: Tree, coords: Coordinates) -> Kinematics:
    """The motion for any choice of columns."""
    if tree.loops:
        from eigassign.mechanism.closure import close_loops

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
    placed: dict[str, Placement] = {}
    for edge in tree.edges:
        placed[edge.follower[0]] = _place(case, parameters, tree, edge, values, rates, placed)
    loops = tuple(_loop(case, parameters, tree, e, values, rates, placed) for e in tree.loops)
    return Kinematics(tuple(placed.values()), loops, tree, coords)


def _own_motion(
    case: CaseFile, tree: Tree, edge: Edge, values: Sequence[Scalar], rates: Objects
) -> tuple[JointMotion, Objects]:
    """R, lever and A of a joint as it is walked, mounting and position included; A ċ per column."""
    joint = case.mechanism.joints[edge.joint]
    own = tree.of_joint(edge.joint)
    motion = _mounted(joint, mounting(joint), joint_motion(joint, [values[k] for k in own]))
    position = vector(getattr(joint, "position", None) or (0.0, 0.0))
    motion = motion._replace(translation=position + motion.translation)
    motion = turned(motion) if edge.turned else motion
    if not own:
        return motion, np.zeros((6, rates.shape[1]), dtype=object)
    return motion, multiply(motion.freedoms, rates[own])


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


def _place(
    case: CaseFile,
    parameters: Parameters,
    tree: Tree,
    edge: Edge,
    values: Sequence[Scalar],
    rates: Objects,
    placed: Mapping[str, Placement],
) -> Placement:
    link = edge.follower[0]
    motion, own = _own_motion(case, tree, edge, values, rates)
    lever = motion.translation
    R_base, o_base, twist_base = _base_motion(case, parameters, tree, edge.base, placed, rates)
    node = node_position(case, parameters, tree, edge.follower)
    R_world = multiply(R_base, motion.rotation)
    at_node = multiply(carried(motion.rotation, lever), twist_base) + own
    return Placement(
        link=link,
        edge=edge,
        rotation=motion.rotation,
        lever=lever,
        freedoms=motion.freedoms,
        world_rotation=R_world,
        world_origin=o_base + multiply(R_base, lever) - multiply(R_world, node),
        twist=_shifted(at_node, node * -1.0),
    )


def _base_motion(
    case: CaseFile,
    parameters: Parameters,
    tree: Tree,
    base: Node,
    placed: Mapping[str, Placement],
    rates: Objects,
) -> tuple[Objects, Objects, Objects]:
    """World rotation, world position and twist (own axes) of a base node."""
    if base[0] == "ground":
        zero = np.zeros((6, rates.shape[1]), dtype=object)
        return np.eye(3).astype(object), np.zeros(3, dtype=object), zero
    p = placed[base[0]]
    X = node_position(case, parameters, tree, base)
    position = p.world_origin + multiply(p.world_rotation, X)
    return p.world_rotation, position, _shifted(p.twist, X)


def _shifted(twist: Objects, lever: Objects) -> Objects:
    """The twist at another point of the same body: v + ω × lever."""
    return np.concatenate([twist[:3] + cross(twist[3:], lever), twist[3:]])


def _loop(
    case: CaseFile,
    parameters: Parameters,
    tree: Tree,
    edge: Edge,
    values: Sequence[Scalar],
    rates: Objects,
    placed: Mapping[str, Placement],
) -> Loop:
    motion, own = _own_motion(case, tree, edge, values, rates)
    lever = motion.translation
    R_base, x_base, twist_base = _base_motion(case, parameters, tree, edge.base, placed, rates)
    R_end, x_end, twist_end = _base_motion(case, parameters, tree, edge.follower, placed, rates)
    R_joint = multiply(R_base, motion.rotation)
    reached = multiply(carried(motion.rotation, lever), twist_base) + own
    return Loop(
        edge=edge,
        rotation=motion.rotation,
        lever=lever,
        freedoms=motion.freedoms,
        position_gap=x_base + multiply(R_base, lever) - x_end,
        misalignment=multiply(R_joint.T, R_end),
        twist_gap=twist_end - reached,
    )
