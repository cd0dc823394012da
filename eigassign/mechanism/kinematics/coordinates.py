"""The case's coordinates q against the freedoms of its joints: s = A q + b, and ċ per q̇.

The numbers of a mechanism: plain floats, or expressions where they are design parameters.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.case import CaseFile
from eigassign.errors import MechanismError
from eigassign.mechanism.kinematics.topology import Edge, Tree
from eigassign.series.expression import Expression, Recorder, Scalar

# --- The case's coordinates q against the freedoms of its joints: s = A q + b, and ċ per q̇

Floats = NDArray[np.float64]
Angles = dict[str, tuple[Floats, float] | None]  # per link: row over q and constant, or unknown


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
    absolute: Angles = {"ground": (np.zeros(n), 0.0)}
    for edge in (*tree.edges, *tree.loops):
        i = next((f.coordinate for f in tree.freedoms if f.joint == edge.joint), None)
        if i is not None and wanted[i]:
            under = _absolute_base(case, tree, edge, i, absolute)
            relative[i], offset[i] = relative[i] - under[0], -under[1] - _mount(case, edge)
        if edge in tree.edges:
            absolute[edge.follower[0]] = _carried_angle(
                case, tree, edge, absolute, relative, offset
            )
    return relative, offset


def _mount(case: CaseFile, edge: Edge) -> float:
    return float(getattr(case.mechanism.joints[edge.joint], "angle", 0.0))


def _absolute_base(
    case: CaseFile, tree: Tree, edge: Edge, i: int, absolute: Angles
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
    tree: Tree,
    edge: Edge,
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


# --- The numbers of a mechanism: plain floats, or expressions where they are design parameters


@dataclass(frozen=True)
class Parameters:
    """Variables z = (s, y): joint coordinates s in the order of the case's q, then design y."""

    recorder: Recorder
    coordinates: tuple[str, ...]
    design: tuple[str, ...]
    relative: Floats  # A of s = A q + b
    offset: Floats
    by_path: dict[str, Expression] = field(default_factory=dict)
    passive: tuple[Scalar, ...] = ()

    def number(self, path: str, value: float) -> Scalar:
        """The value at a key path of the case: the variable if it is a design parameter."""
        return self.by_path.get(path, value)

    def joint_coordinate(self, index: int) -> Expression:
        """The relative joint coordinate s belonging to coordinate number ``index``."""
        return self.recorder.variable(index)

    def freedom(self, k: int) -> Scalar:
        """Joint freedom k: a coordinate, or a passive one behind them."""
        n_q = len(self.coordinates)
        return self.joint_coordinate(k) if k < n_q else self.passive[k - n_q]

    def with_passive(self, values: Sequence[Scalar]) -> Parameters:
        """The same with the passive freedoms known."""
        return replace(self, passive=tuple(values))

    def rerecorded(self, recorder: Recorder, n_passive: int) -> Parameters:
        """The same on another recorder, the passive freedoms being its last variables."""
        n = len(self.coordinates) + len(self.design)
        moved = {
            path: recorder.variable(len(self.coordinates) + k)
            for k, path in enumerate(self.by_path)
        }
        passive = tuple(recorder.variable(n + k) for k in range(n_passive))
        return replace(self, recorder=recorder, by_path=moved, passive=passive)


def parameters(case: CaseFile) -> Parameters:
    """The variables of a case."""
    from eigassign.mechanism.kinematics.topology import build_tree

    recorder = Recorder()
    names, design = tuple(case.coordinates), tuple(case.design.parameters)
    by_path = {
        parameter.parameter: recorder.variable(len(names) + k)
        for k, parameter in enumerate(case.design.parameters.values())
    }
    maps = coordinates(case, build_tree(case))
    return Parameters(recorder, names, design, maps.relative, maps.offset, by_path)


def initial_design(case: CaseFile) -> Floats:
    """y as the mechanism is written in the file, (n_y,) in SI units."""
    paths = [p.parameter for p in case.design.parameters.values()]
    return np.array([_value(case, path) for path in paths], dtype=np.float64)


def _value(case: CaseFile, path: str) -> float:
    head, name, *fields = path.split(".")
    group = case.coordinates if head == "coordinates" else getattr(case.mechanism, head)
    value: Any = group[name]
    for field_name in fields:
        value = getattr(value, field_name)
    return float(value)
