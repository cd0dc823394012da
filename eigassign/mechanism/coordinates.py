"""The case's coordinates q against the freedoms of its joints: s = A q + b, and ċ per q̇."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.case import CaseFile
from eigassign.errors import MechanismError
from eigassign.mechanism.tree import Tree

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Coordinates:
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


def coordinates(case: CaseFile, tree: Tree) -> Coordinates:
    """The maps of a case."""
    relative, offset = _relative(case, tree)
    drives = [c.drive for c in case.coordinates.values()]
    columns = tuple(i for i, drive in enumerate(drives) if drive != "locked")
    free = tuple(i for i in columns if drives[i] == "free")
    rates = np.zeros((len(tree.freedoms), len(columns)))
    rates[: len(drives)] = _joint_rates(relative, columns, free)
    return Coordinates(relative, offset, columns, rates)


def _relative(case: CaseFile, tree: Tree) -> tuple[Floats, Floats]:
    """An absolute angle minus the absolute angle of the base and the mounting angle."""
    n = len(case.coordinates)
    relative, offset = np.eye(n), np.zeros(n)
    wanted = [c.angle == "absolute" for c in case.coordinates.values()]
    if not any(wanted):
        return relative, offset
    absolute: dict[str, tuple[Floats, float] | None] = {"ground": (np.zeros(n), 0.0)}
    for edge in (*tree.edges, *tree.loops):
        below = absolute[edge.base[0]]
        i = next((f.coordinate for f in tree.freedoms if f.joint == edge.joint), None)
        passive = any(f.joint == edge.joint for f in tree.passive)
        if i is not None and wanted[i]:
            if below is None:
                name = tuple(case.coordinates)[i]
                message = "an absolute angle needs a base that no passive joint carries"
                raise MechanismError(f"coordinates.{name}.angle", message)
            mount = float(case.mechanism.joints[edge.joint].angle)
            relative[i], offset[i] = relative[i] - below[0], -below[1] - mount
        if edge in tree.loops:
            continue
        absolute[edge.follower[0]] = (
            None
            if passive or below is None
            else _carried_angle(case, edge.joint, i, below, relative, offset)
        )
    return relative, offset


def _carried_angle(
    case: CaseFile,
    joint: str,
    i: int | None,
    below: tuple[Floats, float],
    relative: Floats,
    offset: Floats,
) -> tuple[Floats, float]:
    """Absolute angle (row over q, constant) of a follower."""
    row, constant = below[0], below[1] + float(getattr(case.mechanism.joints[joint], "angle", 0.0))
    if i is not None and case.mechanism.joints[joint].type == "revolute":
        row, constant = row + relative[i], constant + offset[i]
    return row, constant


def _joint_rates(relative: Floats, columns: tuple[int, ...], free: tuple[int, ...]) -> Floats:
    """ṡ per q̇: a held joint's own deflection, and free coordinates while all others stand still.

    q̇ = A⁻¹ ṡ; restricted to the free ones, ṡ_F = [(A⁻¹)_FF]⁻¹ q̇_F.
    """
    rates = np.eye(len(relative))
    if not np.array_equal(relative, rates):
        rates[np.ix_(free, free)] = np.linalg.inv(np.linalg.inv(relative)[np.ix_(free, free)])
        rates[np.abs(rates) < 1e-12] = 0.0  # round-off of two inverses of a matrix of 0, ±1
    return np.asarray(rates[:, list(columns)])
