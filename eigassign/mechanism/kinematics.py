"""Kinematics of the equivalent rigid-link system (ERLS): a tree of links joined at nodes.

Everything is written on scalars that may be numbers or expressions, in three dimensions; a planar
mechanism uses the components (v_x, v_y, ω_z) of a twist.

For a follower link joined to a base at the point X_b (in the base's frame), with R the rotation
from follower to base axes, Rᵀ of both twists and a the joint axis in the follower's frame:

    ω_f = Rᵀ ω_b + a ṡ,    v_f = Rᵀ (v_b + ω_b × X_b)
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.case import CaseFile
from eigassign.errors import MechanismError
from eigassign.mechanism.parameters import Parameters
from eigassign.series.expression import Scalar, cos, sin

Objects = NDArray[np.object_]  # arrays of floats and expressions
Floats = NDArray[np.float64]
PLANAR_TWIST = (0, 1, 5)  # v_x, v_y, ω_z among (v, ω)


@dataclass(frozen=True)
class Placement:
    """How one link hangs on its base.

    ``base`` is (link, node name) or None for the ground; ``rotation`` turns follower components
    into base components; ``twist`` (6, n_columns) is the link's twist per q̇ in its own frame.
    """

    link: str
    joint: str
    base: tuple[str, str] | None
    rotation: Objects
    origin: Objects  # of the follower, in the base's frame
    axis: Objects  # of the joint, in the follower's frame
    coordinate: int | None  # index of the joint's coordinate in q
    twist: Objects


@dataclass(frozen=True)
class Kinematics:
    """Placements in an order where every base precedes its followers, and the coordinate maps.

    s = ``relative`` q + ``offset`` gives the relative joint coordinates; ``columns`` are the
    indices of the coordinates that are not locked: the q̇ of eq. (1); and per those q̇ the joint
    rates are ṡ = ``rates`` q̇ (locked joints have zero rows). The unknown of a held coordinate is
    the deflection of its drive, so that K = diag(K_E, 0) exactly whatever it rides on.
    """

    placements: tuple[Placement, ...]
    relative: Floats  # (n_q, n_q)
    offset: Floats  # (n_q,)
    columns: tuple[int, ...]
    rates: Floats  # (n_q, n_columns)


def kinematics(case: CaseFile, parameters: Parameters) -> Kinematics:
    """Walk the tree of joints from the ground; raises MechanismError for a link out of reach."""
    order = _tree_order(case)
    relative, offset = _relative_coordinates(case, order)
    drives = [c.drive for c in case.coordinates.values()]
    columns = tuple(i for i, drive in enumerate(drives) if drive != "locked")
    rates = _joint_rates(relative, columns, tuple(i for i in columns if drives[i] == "free"))
    placed: dict[str, Placement] = {}
    for joint in order:
        placement = _place(case, parameters, joint, rates, placed)
        placed[placement.link] = placement
    return Kinematics(tuple(placed.values()), relative, offset, columns, rates)


def follower_link(case: CaseFile, joint: str) -> str:
    """Name of the link that a joint carries."""
    return str(case.mechanism.joints[joint].follower).partition(".")[0]


def base_node(case: CaseFile, joint: str) -> tuple[str, str] | None:
    """(link, node) that a joint is mounted on, None for the ground."""
    base = str(case.mechanism.joints[joint].base)
    if base == "ground":
        return None
    link, _, node = base.partition(".")
    return link, node


def _tree_order(case: CaseFile) -> list[str]:
    """Joints sorted so that each base link is carried by an earlier joint."""
    waiting, order, placed = list(case.mechanism.joints), [], {"ground"}
    while waiting:
        ready = [j for j in waiting if (base_node(case, j) or ("ground", ""))[0] in placed]
        if not ready:
            raise MechanismError(f"mechanism.joints.{waiting[0]}", "is not connected to the ground")
        placed.update(follower_link(case, j) for j in ready)
        order += ready
        waiting = [j for j in waiting if j not in ready]
    loose = [link for link in case.mechanism.links if link not in placed]
    if loose:
        raise MechanismError(f"mechanism.links.{loose[0]}", "no joint carries this link")
    return order


def _coordinate_of(case: CaseFile, joint: str) -> int | None:
    for i, coordinate in enumerate(case.coordinates.values()):
        if coordinate.joint == joint:
            return i
    return None


def _relative_coordinates(case: CaseFile, order: list[str]) -> tuple[Floats, Floats]:
    """s = A q + b: absolute angle minus the base's absolute angle and the mounting angle."""
    n = len(case.coordinates)
    relative, offset = np.zeros((n, n)), np.zeros(n)
    absolute: dict[str, tuple[Floats, float]] = {"ground": (np.zeros(n), 0.0)}
    for joint in order:
        row, constant = absolute[(base_node(case, joint) or ("ground", ""))[0]]
        constant = constant + case.mechanism.joints[joint].angle
        i = _coordinate_of(case, joint)
        if i is not None:
            unit = np.eye(n)[i]
            own = tuple(case.coordinates.values())[i].angle == "absolute"
            relative[i], offset[i] = (unit - row, -constant) if own else (unit, 0.0)
            row, constant = row + relative[i], constant + offset[i]
        absolute[follower_link(case, joint)] = (row, constant)
    return relative, offset


def _joint_rates(relative: Floats, columns: tuple[int, ...], free: tuple[int, ...]) -> Floats:
    """ṡ per q̇: a held joint's own deflection, and free coordinates while all others stand still.

    q̇ = A⁻¹ ṡ; restricted to the free ones, ṡ_F = [(A⁻¹)_FF]⁻¹ q̇_F.
    """
    rates = np.eye(len(relative))
    rates[np.ix_(free, free)] = np.linalg.inv(np.linalg.inv(relative)[np.ix_(free, free)])
    rates[np.abs(rates) < 1e-12] = 0.0  # round-off of the two inverses of a matrix of 0, ±1
    return np.asarray(rates[:, list(columns)])


def _place(
    case: CaseFile,
    parameters: Parameters,
    joint: str,
    rates: Floats,
    placed: Mapping[str, Placement],
) -> Placement:
    data = case.mechanism.joints[joint]
    index = _coordinate_of(case, joint)
    angle: Scalar = data.angle
    if index is not None:
        angle = parameters.joint_coordinate(index) + data.angle
    rotation, axis = rotation_z(angle), np.array([0.0, 0.0, 1.0], dtype=object)
    base = base_node(case, joint)
    if base is None:
        origin = np.array([*data.position, 0.0], dtype=object)
        twist = np.zeros((6, rates.shape[1]), dtype=object)
    else:
        origin = node_position(case, parameters, *base)
        twist = carried_twist(rotation, origin, placed[base[0]].twist)
    if index is not None:
        twist = _add_joint_rate(twist, axis, rates[index])
    return Placement(follower_link(case, joint), joint, base, rotation, origin, axis, index, twist)


def node_position(case: CaseFile, parameters: Parameters, link: str, node: str) -> Objects:
    """Position of a named node in its link's frame, m."""
    length = parameters.number(f"links.{link}.length", case.mechanism.links[link].length)
    return np.array([length if node == "end" else 0.0, 0.0, 0.0], dtype=object)


def rotation_z(angle: Scalar) -> Objects:
    """Rotation by ``angle`` rad about z, (3, 3)."""
    c, s = cos(angle), sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]], dtype=object)


def carried_twist(rotation: Objects, origin: Objects, twist: Objects) -> Objects:
    """Twist (6, n) of the base as seen at the joint, in the follower's frame."""
    velocity = twist[:3] + _cross_columns(twist[3:], origin)
    return np.concatenate([rotation.T @ velocity, rotation.T @ twist[3:]])


def _cross_columns(a: Objects, b: Objects) -> Objects:
    """a_k × b for every column a_k of a (3, n)."""
    b = b[:, None]  # an expression alone would not spread over a row
    return np.array(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]],
        dtype=object,
    )


def _add_joint_rate(twist: Objects, axis: Objects, rate: Floats) -> Objects:
    spin = np.outer(axis, rate.astype(object))
    return np.concatenate([twist[:3], twist[3:] + spin])
