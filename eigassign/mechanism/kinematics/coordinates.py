"""The case's coordinates q against the freedoms of its joints: s = A q + b, and ċ per q̇."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.case.case_file import CaseFile
from eigassign.errors import MechanismError
from eigassign.mechanism.kinematics.topology import JointEdge, Topology

Floats = NDArray[np.float64]
Angles = dict[str, tuple[Floats, float] | None]  # per link: row over q and constant, or unknown


@dataclass(frozen=True)
class CoordinateMap:
    """s = ``relative`` q + ``offset`` are the joint coordinates in the order of q.

    ``columns`` are the coordinates that are not locked: the q̇ of eq. (1); ``rates``
    (n_freedoms, n_columns) are the driven freedoms' rates per q̇, locked and passive rows zero. The
    unknown of a held coordinate is the deflection of its drive, so that K = diag(K_E, 0) whatever
    it rides on.
    """

    relative: Floats
    offset: Floats
    columns: tuple[int, ...]
    rates: Floats


def coordinates(case: CaseFile, tree: Topology) -> CoordinateMap:
    """The maps of a case."""
    relative, offset = _relative(case, tree)
    moves = [c.moves for c in case.coordinates.values()]
    columns = tuple(i for i, how in enumerate(moves) if how != "locked")
    free = tuple(i for i in columns if moves[i] == "free")
    rates = np.zeros((len(tree.freedoms), len(columns)))
    rates[: len(moves)] = _joint_rates(relative, columns, free)
    return CoordinateMap(relative, offset, columns, rates)


def _relative(case: CaseFile, tree: Topology) -> tuple[Floats, Floats]:
    """An absolute angle minus the absolute angle of the base and the mounting angle."""
    n = len(case.coordinates)
    relative, offset = np.eye(n), np.zeros(n)
    wanted = [c.angle == "absolute" for c in case.coordinates.values()]
    if not any(wanted):
        return relative, offset
    absolute: Angles = {"ground": (np.zeros(n), 0.0)}
    for edge in (*tree.edges, *tree.loops):
        i = next((f.coordinate for f in tree.freedoms if f.joint == edge.joint), None)
        if i is not None and wanted[i]:
            under = _absolute_base(case, tree, edge, i, absolute)
            relative[i], offset[i] = relative[i] - under[0], -under[1] - _mount(case, edge)
            if np.isnan(offset[i]):
                message = (
                    "is absolute, while the angle of its joint, or of one below, is a design "
                    "parameter or set along a trajectory: write relative"
                )
                raise MechanismError(f"coordinates.{tuple(case.coordinates)[i]}.angle", message)
        if edge in tree.edges:
            absolute[edge.follower[0]] = _carried_angle(
                case, tree, edge, absolute, relative, offset
            )
    return relative, offset


def _mount(case: CaseFile, edge: JointEdge) -> float:
    """The angle that a joint is turned by; NaN where it varies."""
    varies = f"joints.{edge.joint}.angle" in case.varied
    return np.nan if varies else float(case.mechanism.joints[edge.joint].angle)


def _absolute_base(
    case: CaseFile, tree: Topology, edge: JointEdge, i: int, absolute: Angles
) -> tuple[Floats, float]:
    """Absolute angle of the base of a joint whose coordinate i is the follower's."""
    path, (base, _) = f"coordinates.{tuple(case.coordinates)[i]}.angle", edge.written.base
    if edge.turned and edge in tree.edges:
        message = (
            f"joint {edge.joint!r} hangs its base on its follower, whose absolute angle is thus "
            "that of other joints: write relative, or exchange base and follower"
        )
        raise MechanismError(path, message)
    under = absolute[base]
    if under is None:
        raise MechanismError(path, "an absolute angle needs a base that no passive joint carries")
    return under


def _carried_angle(
    case: CaseFile,
    tree: Topology,
    edge: JointEdge,
    absolute: Angles,
    relative: Floats,
    offset: Floats,
) -> tuple[Floats, float] | None:
    """Absolute angle of the link that a tree joint hangs; None where a passive joint is below."""
    below, own = absolute[edge.base[0]], tree.of_joint(edge.joint)
    if below is None or any(tree.freedoms[k].coordinate is None for k in own):
        return None
    turn, constant = np.zeros(len(relative)), _mount(case, edge)
    if own and case.mechanism.joints[edge.joint].type == "revolute":
        turn, constant = relative[own[0]], constant + offset[own[0]]
    sign = -1.0 if edge.turned else 1.0
    return below[0] + sign * turn, below[1] + sign * constant


def _joint_rates(relative: Floats, columns: tuple[int, ...], free: tuple[int, ...]) -> Floats:
    """ṡ per q̇: a held joint's own deflection, and free coordinates while all others stand still.

    q̇ = A⁻¹ ṡ; restricted to the free ones, ṡ_F = [(A⁻¹)_FF]⁻¹ q̇_F.
    """
    rates = np.eye(len(relative))
    if not np.array_equal(relative, rates):
        rates[np.ix_(free, free)] = np.linalg.inv(np.linalg.inv(relative)[np.ix_(free, free)])
        rates[np.abs(rates) < 1e-12] = 0.0  # round-off of two inverses of a matrix of 0, ±1
    return np.asarray(rates[:, list(columns)])
