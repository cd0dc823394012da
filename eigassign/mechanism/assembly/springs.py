"""Springs between two nodes, or from a node to the ground, along axes fixed in the first link.

The spring is stress-free in every pose; it resists the relative motion of its ends at the place of
the second, k_t |v_2 − v_1 − ω_1 × d|² + k_r |ω_2 − ω_1|²: the first node reaches there by a rigid
arm d, so that the spring's forces balance and turning everything strains nothing. Each end moves
with the elastic *and* the rigid motion of its link.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from eigassign.case.case_file import CaseFile
from eigassign.mechanism.assembly.affine_entries import AffineEntries
from eigassign.mechanism.assembly.node_motion import (
    MotionRow,
    MotionRows,
    NodeMotions,
    apply,
    combined,
)
from eigassign.mechanism.kinematics.forward import Kinematics, shifted
from eigassign.mechanism.kinematics.joints import mounting
from eigassign.mechanism.kinematics.parameters import ModelParameters, node_position
from eigassign.mechanism.kinematics.rotations import DOFS, carried, multiply, present
from eigassign.mechanism.kinematics.topology import GROUND, NodeName, split
from eigassign.series.expression import Scalar, is_constant


def add_springs(
    target: AffineEntries,
    case: CaseFile,
    parameters: ModelParameters,
    motion: Kinematics,
    nodes: NodeMotions,
) -> None:
    """Add every spring of the case to K; rigid motions are those that no spring resists."""
    rigid = {nodes.count + k for k in motion.rigid}
    for k, here, there in spring_ends(case, parameters, motion, nodes.rows, nodes.count):
        full = combined(there, here, -1.0)
        row = {i: value for i, value in full.items() if i not in rigid and resists(k)}
        for i, left in row.items():
            for j, right in row.items():
                target.add(i, j, k * left * right)


def resists(stiffness: Scalar) -> bool:
    """True where it is more than a plain zero."""
    return not is_constant(stiffness) or stiffness != 0.0


def spring_ends(
    case: CaseFile,
    parameters: ModelParameters,
    motion: Kinematics,
    elastic: Callable[[NodeName], MotionRows],
    first: int,
) -> Iterator[tuple[Scalar, MotionRow, MotionRow]]:
    """Stiffness and motions of both ends, six rows for every spring, as `_ends` has them.

    ``elastic`` gives a node's rows over u; the q̇ are numbered from ``first`` on.
    """
    springs: Any = case.mechanism.springs
    for name, spring in springs.items():
        ends = [GROUND if end == "ground" else split(end) for end in spring.between]
        here, there = _ends(case, parameters, motion, elastic, first, spring, ends)
        values = _stiffness(parameters, f"springs.{name}", spring, case.mechanism.space)
        yield from zip(values, here, there, strict=True)


def _stiffness(parameters: ModelParameters, path: str, spring: Any, space: str) -> list[Scalar]:
    """Six values k_t, k_r per axis; a number stands for every axis of the space."""
    out: list[Scalar] = []
    for key, first in (("translational", 0), ("rotational", 3)):
        given = getattr(spring, key, None) or 0.0
        axes = [d - first for d in DOFS[space] if first <= d < first + 3]
        values: list[Scalar] = [0.0, 0.0, 0.0]
        for position, axis in enumerate(axes):
            if isinstance(given, (tuple, list)):
                values[axis] = float(given[position])
            else:
                values[axis] = parameters.number(f"{path}.{key}", given)
        out += values
    return out


def _ends(
    case: CaseFile,
    parameters: ModelParameters,
    motion: Kinematics,
    elastic: Callable[[NodeName], MotionRows],
    first_rate: int,
    spring: Any,
    ends: list[NodeName],
) -> tuple[MotionRows, MotionRows]:
    """Motion of both ends in the spring's axes over [u; q̇], the first carried to the second."""
    link = ends[0][0]
    R = multiply(motion.placement(link).world_rotation, mounting(spring))
    first, second = (
        _world_rows(case, parameters, motion, elastic, first_rate, end) for end in ends
    )
    none = np.zeros(3, dtype=object)
    if ends[1] != GROUND:
        here, there = (
            motion.placement(end[0]).at(node_position(case, parameters, motion.tree, end))[1]
            for end in ends
        )
        first = apply(carried(np.eye(3).astype(object), there - here), first)
    seen = carried(R, none)
    return apply(seen, first), apply(seen, second)


def _world_rows(
    case: CaseFile,
    parameters: ModelParameters,
    motion: Kinematics,
    elastic: Callable[[NodeName], MotionRows],
    first_rate: int,
    end: NodeName,
) -> MotionRows:
    """Full motion of a node in world axes: elastic rows and N T columns."""
    if end == GROUND:
        return [{} for _ in range(6)]
    placement = motion.placement(end[0])
    rigid = shifted(placement.twist, node_position(case, parameters, motion.tree, end))
    rows = [dict(row) for row in elastic(end)]
    for a, k in zip(*np.nonzero(present(rigid)), strict=True):
        rows[a][first_rate + int(k)] = rigid[a, k]
    to_world = carried(placement.world_rotation.T, np.zeros(3, dtype=object))
    return apply(to_world, rows)
