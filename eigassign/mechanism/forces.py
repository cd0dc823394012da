"""Forces on a mechanism at rest: what they do on each of its unknowns [u; q̇].

A unit force along n at a node does the work b = n·v on the motion v = B [u; q̇] of the node, in the
axes of the ground; the weight does Qᵀ m N Rᵀ g on u, the links' origins not moving.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.case.case_file import CaseFile
from eigassign.mechanism.assembly.build import gravity, local_links
from eigassign.mechanism.assembly.congruence import pulled, scattered
from eigassign.mechanism.assembly.node_motion import MotionRow, SpringEnds, combined
from eigassign.mechanism.kinematics.forward import Kinematics
from eigassign.mechanism.kinematics.parameters import ModelParameters
from eigassign.mechanism.kinematics.rotations import DOFS, multiply
from eigassign.mechanism.kinematics.topology import split
from eigassign.series.algebra import Tangents
from eigassign.series.compiler import CompiledArrays
from eigassign.series.expression import Scalar

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Forces:
    """Forces as functions of x = (q, y): the non-zeros at ``unknowns`` of each, by one program."""

    unknowns: Sequence[Ints]
    table: CompiledArrays
    parameters: ModelParameters

    def is_fixed(self, variables: NDArray[np.bool_]) -> bool:
        """True where they depend on none of the ``variables`` (n_x,)."""
        moved = (self.parameters.to_z[:, variables] != 0.0).any(axis=1)
        return not self.table.table.program.dependence[:, moved].any()

    def at(self, x: Floats, along: Ints) -> list[tuple[Floats, Floats]]:
        """Of each force the non-zeros (n, k) at samples x (n, n_x), and their slopes (d, n, k).

        The slopes are those in the d variables ``along`` of x.
        """
        n, d, to_z = len(x), len(along), self.parameters.to_z
        z = np.hstack([self.parameters.z(x), np.repeat(to_z[:, along], n, axis=1)])
        found = self.table(z, Tangents(n, d))
        parts = [each.reshape(1 + d, n, each.shape[1]) for each in found]
        return [(part[0], part[1:]) for part in parts]


def forces(
    case: CaseFile,
    parameters: ModelParameters,
    motion: Kinematics,
    nodes: Mapping[str, Sequence[Sequence[float]]],
    weight: bool = False,
) -> Forces:
    """Unit forces at ``nodes``, each along its directions, one after the other; last the weight."""
    links, motions = local_links(case, parameters, motion)
    ends = SpringEnds(case, parameters, motion, motions.rows, motions.count)
    rows: list[MotionRow] = []
    for node, directions in nodes.items():
        moved = ends.in_world(split(node))
        rows += [_along(moved, direction) for direction in directions]
    g = gravity(case)
    if weight and g is not None:
        total: dict[int, Scalar] = {}
        for placement, link in zip(motion.placements, links, strict=True):
            pull = np.zeros(6, dtype=object)
            pull[:3] = multiply(placement.world_rotation.T, g[:, None].astype(object))[:, 0]
            kept = list(DOFS[case.mechanism.space])
            total = combined(total, scattered(link, pulled(link, pull[kept])), 1.0)
        rows.append(total)
    arrays = [np.array(list(row.values()), dtype=object) for row in rows]
    unknowns = [np.array(list(row), dtype=np.intp) for row in rows]
    return Forces(unknowns, parameters.compiled(*arrays), parameters)


def _along(moved: Sequence[MotionRow], direction: Sequence[float]) -> MotionRow:
    """n·v for n of unit length."""
    n = np.array(direction) / np.linalg.norm(direction)
    row: MotionRow = {}
    for own, share in zip(moved, n.tolist(), strict=False):
        row = combined(row, own, share) if share else row
    return row
