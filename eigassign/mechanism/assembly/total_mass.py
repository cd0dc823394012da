"""The total mass of a mechanism as a function of its design, with its slope.

Every link with its bodies moves as one in a translation e of its nodes, so that its mass is eᵀ m e
with the link's own mass matrix m = Σ μ_i(y) m_i. Links held by the ground count as well; what a
drive reflects through its gear is no mass.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.case.case_file import CaseFile
from eigassign.mechanism.elements.mesh import LinkMesh
from eigassign.mechanism.kinematics.loop_closure import reference
from eigassign.mechanism.kinematics.parameters import ModelParameters, written_loads
from eigassign.series.algebra import Tangents
from eigassign.series.compiler import CompiledTable, compile_table
from eigassign.series.expression import Scalar

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class TotalMass:
    """Σ_links Σ_i μ_i(y) eᵀ m_i e; it does not depend on the pose."""

    table: CompiledTable  # one row
    at: Floats  # z = (s, y) (n_z,) where the mechanism can be put together
    n_y: int
    loads: Floats  # (n_loads,) that it is with: as written

    @property
    def is_affine(self) -> bool:
        """True where it is of degree 1 in y at most, by its form."""
        return self.table.program.is_affine(np.arange(len(self.at)) >= len(self.at) - self.n_y)

    def __call__(self, y: Floats) -> tuple[float, Floats]:
        """The mass in kg of a design y (n_y,), and its slope (n_y,) in kg per SI unit of y."""
        first = len(self.at) - self.n_y
        z = np.zeros((len(self.at), 1 + self.n_y))
        z[:, 0] = self.at
        z[first:, 0] = y
        z[first:, 1:] = np.eye(self.n_y)
        row = self.table.evaluate(Tangents(1, self.n_y), z)[0]
        return float(row[0]), row[1:]


def total_mass(
    case: CaseFile, parameters: ModelParameters, meshes: Iterable[LinkMesh]
) -> TotalMass:
    """The mass of the links of a mechanism, each with all its dofs and its bodies."""
    mass: Scalar = 0.0
    for mesh in meshes:
        # Translation does not depend on y: the first column of all terms of N is one of numbers.
        e = np.sum([term.matrix[:, [0]].toarray()[:, 0] for term in mesh.rigid], axis=0)
        for term in mesh.mass:
            mass = mass + term.coefficient * float(e @ (term.matrix @ e))
    at = reference(case, parameters)
    table = compile_table(parameters.recorder, [mass], len(at))
    return TotalMass(table, at, len(parameters.design), written_loads(case))
