"""Springs between two nodes, or a node and the ground, along axes fixed in what is written first.

The spring is stress-free in every pose; it resists the relative motion of its ends at the place of
the second, k_t |v_2 − v_1 − ω_1 × d|² + k_r |ω_2 − ω_1|²: the first node reaches there by a rigid
arm d, so that the spring's forces balance and turning everything strains nothing. Each end moves
with the elastic *and* the rigid motion of its link.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from eigassign.case.case_file import CaseFile
from eigassign.mechanism.assembly.node_motion import (
    MotionRow,
    MotionRows,
    NodeMotions,
    apply,
    combined,
)
from eigassign.mechanism.assembly.pencil import AffineEntries
from eigassign.mechanism.kinematics.forward import Kinematics, shifted
from eigassign.mechanism.kinematics.parameters import STILL, ModelParameters, node_position
from eigassign.mechanism.kinematics.rotations import (
    DOFS,
    Objects,
    carried,
    mounting,
    multiply,
    present,
)
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
    for k, here, there in SpringEnds(case, parameters, motion, nodes.rows, nodes.count).all():
        full = combined(there, here, -1.0)
        row = [(i, value) for i, value in full.items() if i not in rigid and resists(k)]
        target.add_square(k, row)


def resists(stiffness: Scalar) -> bool:
    """True where it is more than a plain zero."""
    return not is_constant(stiffness) or stiffness != 0.0


class SpringMotion(NamedTuple):
    """A spring, the motions of its two nodes at the place of the second, in its axes.

    ``rotation`` turns its axes into those of the world, where ``arm`` runs from node to node.
    """

    start: NodeName
    end: NodeName
    stiffness: Sequence[Scalar]
    here: MotionRows
    there: MotionRows
    rotation: Objects
    arm: Objects


@dataclass(frozen=True, eq=False)
class SpringEnds:
    """The motions of both ends of every spring over [u; q̇], the q̇ numbered from ``first`` on."""

    case: CaseFile
    parameters: ModelParameters
    motion: Kinematics
    elastic: Callable[[NodeName], MotionRows]  # a node's rows over u
    first: int

    def all(self) -> Iterator[tuple[Scalar, MotionRow, MotionRow]]:
        """Stiffness and motions of both ends, six rows for every spring, in the spring's axes."""
        for spring in self.each():
            yield from zip(spring.stiffness, spring.here, spring.there, strict=True)

    def each(self) -> Iterator[SpringMotion]:
        """The springs one by one."""
        springs: Any = self.case.mechanism.springs
        for name, spring in springs.items():
            start, end = (GROUND if e == "ground" else split(e) for e in spring.between)
            stiffness = self._stiffness(f"springs.{name}", spring)
            mount = mounting(self.parameters.angles(f"springs.{name}", spring))
            yield self._motions(start, end, mount, stiffness)

    def _stiffness(self, path: str, spring: Any) -> list[Scalar]:
        """Six values k_t, k_r per axis; a number stands for every axis of the space."""
        out: list[Scalar] = []
        for key, first in (("translational", 0), ("rotational", 3)):
            given = getattr(spring, key, None) or 0.0
            axes = [d - first for d in DOFS[self.case.mechanism.space] if first <= d < first + 3]
            values: list[Scalar] = [0.0, 0.0, 0.0]
            for position, axis in enumerate(axes):
                if isinstance(given, (tuple, list)):
                    values[axis] = float(given[position])
                else:
                    values[axis] = self.parameters.number(f"{path}.{key}", given)
            out += values
        return out

    def _motions(
        self, start: NodeName, end: NodeName, mount: Objects, stiffness: Sequence[Scalar]
    ) -> SpringMotion:
        """Motion of both ends in the spring's axes, the first carried to the second."""
        here, there, arm = self.in_world(start), self.in_world(end), np.zeros(3, dtype=object)
        if GROUND not in (start, end):
            arm = self._place(end) - self._place(start)
            here = apply(carried(np.eye(3).astype(object), arm), here)
        R = mount  # in the ground, where that is first
        if start != GROUND:
            mount = multiply(self.parameters.moved.get(start, STILL).turn, mount)
            R = multiply(self.motion.placement(start[0]).world_rotation, mount)
        seen = carried(R, np.zeros(3, dtype=object))
        return SpringMotion(start, end, stiffness, apply(seen, here), apply(seen, there), R, arm)

    def _local(self, node: NodeName) -> Objects:
        return node_position(self.case, self.parameters, self.motion.tree, node)

    def _place(self, node: NodeName) -> Objects:
        return self.motion.placement(node[0]).at(self._local(node))[1]

    def in_world(self, node: NodeName) -> MotionRows:
        """Full motion of a node in world axes: elastic rows and N T columns."""
        if node == GROUND:
            return [{} for _ in range(6)]
        placement = self.motion.placement(node[0])
        rigid = shifted(placement.twist, self._local(node))
        rows = [dict(row) for row in self.elastic(node)]
        for a, k in zip(*np.nonzero(present(rigid)), strict=True):
            rows[a][self.first + int(k)] = rigid[a, k]
        return apply(carried(placement.world_rotation.T, np.zeros(3, dtype=object)), rows)
