"""Kinematics of the equivalent rigid-link system (ERLS), on numbers and expressions alike.

A follower joined to a base at lever r (base axes), with R from follower to base axes and motion
subspace A of the joint in the follower's axes, has at its joint node the twist

    ω_f = Rᵀ ω_b + A_ω ċ,    v_f = Rᵀ (v_b + ω_b × r) + A_v ċ .

World rotation and origin of every link come from the same kinematics as the pencil.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eigassign.arrays import Floats
from eigassign.case.case_file import CaseFile
from eigassign.case.schema.mechanism import RIDING
from eigassign.mechanism.kinematics.joints import (
    JointMotion,
    Objects,
    cross,
    joint_motion,
    mounting,
    multiply,
    present,
    turned,
)
from eigassign.mechanism.kinematics.parameters import (
    STILL,
    ModelParameters,
    link_type,
    node_position,
)
from eigassign.mechanism.kinematics.topology import (
    CoordinateMap,
    JointEdge,
    NodeName,
    Topology,
    split,
)
from eigassign.series.expression import Scalar


@dataclass(frozen=True)
class Placement:
    """How one link hangs on its base, and its motion.

    ``rotation`` turns the link's components into base components; ``lever`` runs from the base node
    to the joint node of the link (base axes); ``freedoms`` is A (6, k). ``twist`` (6, n_columns) is
    that of the link's own origin per column, in its own axes. ``foot`` and ``root`` are the base
    node and the joint node, each in its own link's frame.
    """

    link: str
    edge: JointEdge
    rotation: Objects
    lever: Objects
    freedoms: Objects
    twist: Objects
    base: Placement | None = field(repr=False)  # of the base link; None for the ground
    foot: Objects
    root: Objects

    @property
    def world_rotation(self) -> Objects:
        """The rotation from the link's axes to those of the world, (3, 3)."""
        return self._world[0]

    @property
    def world_origin(self) -> Objects:
        """The link's origin in the world, m (3,)."""
        return self._world[1]

    @cached_property
    def _world(self) -> tuple[Objects, Objects]:
        """Rotation and place in the world; asked for where something is drawn or reached."""
        waiting = [self]
        while waiting[-1].base is not None and "_world" not in waiting[-1].base.__dict__:
            waiting.append(waiting[-1].base)
        for base in reversed(waiting[1:]):
            base._world  # noqa: B018
        R, foot = (
            (np.eye(3).astype(object), self.foot) if self.base is None else self.base.at(self.foot)
        )
        rotation = multiply(R, self.rotation)
        return rotation, foot + multiply(R, self.lever) - multiply(rotation, self.root)

    def at(self, X: Objects) -> tuple[Objects, Objects]:
        """World rotation, and world position of the point X of the link."""
        return self.world_rotation, self.world_origin + multiply(self.world_rotation, X)


class Loop(NamedTuple):
    """One loop-closing joint: pose and twist of its follower node, reached along both sides."""

    edge: JointEdge
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
    tree: Topology
    coordinates: CoordinateMap
    passive: tuple[Scalar, ...] = ()  # the loops' passive freedoms as functions of (q, y)
    rigid: tuple[int, ...] = ()  # columns that nothing resists
    passive_rates: Objects | None = None  # P (n_passive, n_columns) of loops

    @property
    def rates(self) -> Objects:
        """The rates of all freedoms per column, (n_freedoms, n_columns)."""
        rates = self.coordinates.rates.astype(object)
        if self.passive_rates is not None:
            rates[len(rates) - len(self.passive_rates) :] = self.passive_rates
        return rates

    @property
    def columns(self) -> tuple[int, ...]:
        """Indices of the coordinates that are not locked: the q̇ of eq. (1)."""
        return self.coordinates.columns

    def placement(self, link: str) -> Placement:
        """The placement of one link."""
        return self.by_link[link]

    @cached_property
    def by_link(self) -> dict[str, Placement]:
        """The placements by their links."""
        return {p.link: p for p in self.placements}


def walk(
    case: CaseFile,
    parameters: ModelParameters,
    tree: Topology,
    coords: CoordinateMap,
    rates: Objects | None = None,
) -> Kinematics:
    """Place every link, moving at ċ = ``rates`` (n_freedoms, n); standing still without."""
    still = np.zeros((len(tree.freedoms), 0), dtype=object)
    way = _Placing(case, parameters, tree, still if rates is None else rates)
    for edge in tree.edges:
        way.placed[edge.follower[0]] = way.place(edge)
    loops = tuple(way.loop(edge) for edge in tree.loops)
    return Kinematics(tuple(way.placed.values()), loops, tree, coords)


@dataclass(frozen=True, eq=False)
class _Placing:
    """The links placed on the way from the ground to the tips; each joint and each node once."""

    case: CaseFile
    parameters: ModelParameters
    tree: Topology
    rates: Objects
    placed: dict[str, Placement] = field(default_factory=dict)
    _twists: dict[NodeName, Objects] = field(default_factory=dict)
    _joints: dict[object, JointMotion] = field(default_factory=dict)

    def place(self, edge: JointEdge) -> Placement:
        """The link that this joint carries."""
        motion = self._motion(edge)
        root = self._position(edge.follower)
        return Placement(
            link=edge.follower[0],
            edge=edge,
            rotation=motion.rotation,
            lever=motion.translation,
            freedoms=motion.freedoms,
            twist=shifted(self._reached(edge, motion), root * -1.0),
            base=self.placed.get(edge.base[0]),
            foot=self._position(edge.base),
            root=root,
        )

    def loop(self, edge: JointEdge) -> Loop:
        """The loop of a joint that closes one: both ways to its follower."""
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

    def _position(self, node: NodeName) -> Objects:
        if node[0] == "ground":
            return np.zeros(3, dtype=object)
        return node_position(self.case, self.parameters, self.tree, node)

    def _stands(self, node: NodeName) -> tuple[Objects, Objects]:
        """World rotation and world position of a node."""
        if node[0] == "ground":
            return np.eye(3).astype(object), np.zeros(3, dtype=object)
        return self.placed[node[0]].at(self._position(node))

    def _twist(self, node: NodeName) -> Objects:
        """Twist (6, n) of a node in its link's axes."""
        if node not in self._twists:
            ground = node[0] == "ground"
            self._twists[node] = (
                np.zeros((6, self.rates.shape[1]), dtype=object)
                if ground
                else shifted(self.placed[node[0]].twist, self._position(node))
            )
        return self._twists[node]

    def _reached(self, edge: JointEdge, motion: JointMotion) -> Objects:
        """Twist of the follower's joint node: carried from the base, and the joint's own."""
        base = shifted(self._twist(edge.base), motion.translation)
        rotated = multiply(motion.rotation.T, np.concatenate([base[:3], base[3:]], axis=1))
        moved = np.concatenate(np.split(rotated, 2, axis=1))
        own = self.tree.of_joint(edge.joint)
        return moved + multiply(motion.freedoms, self.rates[own]) if own else moved

    def _motion(self, edge: JointEdge) -> JointMotion:
        """R, lever and A of a joint as it is walked, mounting and position included."""
        name, joint = edge.joint, self.case.mechanism.joints[edge.joint]
        varies = any(path.startswith(f"joints.{name}.") for path in self.parameters.by_path)
        own = varies or self.parameters.moved or self.tree.of_joint(name)
        keys = ("type", "angle", "orientation", "position")
        alike = (name * bool(own), *(str(getattr(joint, key, None)) for key in keys), edge.turned)
        if alike not in self._joints:
            known = self.parameters
            self._joints[alike] = walked(self.case, known, self.tree, name, edge.turned)
        return self._joints[alike]


def walked(
    case: CaseFile, parameters: ModelParameters, tree: Topology, name: str, backwards: bool = False
) -> JointMotion:
    """Motion of a joint with its mounting and position, from base to follower or backwards.

    Between nodes that are turned by R_b and R_f: R_b R R_fᵀ, R_b d, R_f A.
    """
    joint, path = case.mechanism.joints[name], f"joints.{name}"
    mount = mounting(parameters.angles(path, joint))
    values = [parameters.freedom(k) for k in tree.of_joint(name)]
    # what rides on a beam keeps the beam's axis; others are turned as a whole
    ends = (np.eye(3), mount.T) if joint.type in RIDING else (mount, np.eye(3))
    motion = _between(joint_motion(joint, values), *ends)
    position = parameters.vector(f"{path}.position", joint.position)
    motion = motion._replace(translation=position + motion.translation)
    if parameters.moved:
        base = (joint.base, f"@{name}") if joint.type in RIDING else split(joint.base)
        nodes = base, split(joint.follower)
        motion = _between(motion, *(parameters.moved.get(node, STILL).turn for node in nodes))
    return turned(motion) if backwards else motion


def _between(
    motion: JointMotion, base: Objects | Floats, follower: Objects | Floats
) -> JointMotion:
    """The motion of a joint between nodes that are turned."""
    A = np.concatenate([multiply(follower, motion.freedoms[k : k + 3]) for k in (0, 3)])
    R = multiply(multiply(base, motion.rotation), follower.T)
    return JointMotion(R, multiply(base, motion.translation), A)


def shifted(twist: Objects, lever: Objects) -> Objects:
    """The twist at another point of the same body: v + ω × lever."""
    if not present(lever).any():
        return twist
    return np.concatenate([twist[:3] + cross(twist[3:], lever), twist[3:]])


@dataclass(frozen=True, eq=False)
class LinkFrames:
    """World frames of all links as functions of x = (q, y)."""

    case: CaseFile
    parameters: ModelParameters
    motion: Kinematics
    links: tuple[str, ...]
    drawn: tuple[tuple[tuple[str, str], ...], ...]  # per link: the node pairs of its lines

    def values(self, x: Floats, arrays: Sequence[NDArray[np.object_]]) -> list[Floats]:
        """Numbers (n_samples, *shape) of arrays of this mechanism's scalars, evaluated together."""
        return self.parameters.compiled(*arrays)(self.parameters.z(np.atleast_2d(x)))

    def world(self, link: str, node: str) -> NDArray[np.object_]:
        """World position of a named node, as scalars (3,)."""
        X = node_position(self.case, self.parameters, self.motion.tree, (link, node))
        return self.motion.placement(link).at(X)[1]

    def position(self, x: Floats, link: str, node: str) -> Floats:
        """World position (n, 3) of a named node, in m."""
        return self.values(x, [self.world(link, node)])[0]


def build_link_frames(
    case: CaseFile, parameters: ModelParameters, motion: Kinematics
) -> LinkFrames:
    """The world frames of a case's links."""
    drawn = tuple(_lines(case, motion, link) for link in motion.by_link)
    return LinkFrames(case, parameters, motion, tuple(motion.by_link), drawn)


def _lines(case: CaseFile, motion: Kinematics, link: str) -> tuple[tuple[str, str], ...]:
    """The lines drawn of a link: its axis, its beams, or spokes from its joint node."""
    data: Any = case.mechanism.links[link]
    kind = link_type(case, link)
    if kind == "beam":
        return (("start", "end"),)
    if kind == "frame":
        return tuple((b.from_node, b.to_node) for b in data.beams.values())
    root = motion.placement(link).edge.follower[1]
    names = list(getattr(data, "nodes", None) or {})
    if getattr(data, "length", None) is not None:
        names.append("end")
    others = [name for name in names if name != root]
    return tuple((root, name) for name in others) or ((root, root),)


def design_dependence(poses: LinkFrames, tip: str, oriented: bool = False) -> NDArray[np.bool_]:
    """Masks (n_y,) of the design parameters that a node's place, and its turning, depend on."""
    link, node = split(tip)
    arrays = [poses.world(link, node)]
    if oriented:
        arrays.append(poses.motion.placement(link).world_rotation)
    program = poses.parameters.compiled(*arrays).table.program
    depends = np.asarray(program.dependence.any(axis=0))
    return depends[len(depends) - len(poses.parameters.design) :]
