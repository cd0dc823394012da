"""The affine pencil: K = Σ θ_j(q, y) K_j and M = Σ θ_j(q, y) M_j with constant sparse K_j, M_j.

The non-zeros of K and M on one common pattern are linear in θ: ``data = weights @ θ`` with θ_0 = 1.
θ is a compiled program, evaluated on samples or on truncated power series; nothing else differs
between exact, Taylor and reduced evaluation.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.series.lower_set import LowerSet
from eigassign.series.program import Program, Samples, Truncated

Floats = NDArray[np.float64]
STACK_LIMIT = 500_000  # numbers: 4 MB
Ints = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Pencil:
    """K and M of eq. (1) in the unknowns [u; q̇], order n_dof = n_u + n_columns.

    x = (q, y) are the case's variables, z = ``to_program`` x + ``shift`` those of the program
    (relative joint coordinates and design parameters).
    """

    n_dof: int
    n_u: int
    rigid: Ints  # dofs of the free coordinates: the rigid-body modes
    rows: Ints
    columns: Ints
    stiffness: sparse.csr_array  # (n_nonzeros, 1 + n_theta)
    mass: sparse.csr_array
    program: Program
    to_program: Floats  # (n_z, n_x)
    shift: Floats  # (n_z,)
    n_q: int

    @property
    def n_theta(self) -> int:
        """Number of coefficient functions, θ_0 = 1 included."""
        return int(self.stiffness.shape[1])

    @cached_property
    def active(self) -> NDArray[np.bool_]:
        """Which variables z anything depends on: the others are dropped from every expansion."""
        return np.asarray(self.program.dependence.any(axis=0))

    @cached_property
    def elastic(self) -> Ints:
        """The dofs that are not rigid-body coordinates: u and held coordinates."""
        return np.setdiff1d(np.arange(self.n_dof), self.rigid)

    @cached_property
    def term_stacks(self) -> tuple[Floats, Floats] | None:
        """All K_j and M_j dense, (n_theta, n_dof, n_dof) each, where that is small."""
        if self.n_theta * self.n_dof**2 > STACK_LIMIT:
            return None
        return self._dense(self.stiffness.toarray()), self._dense(self.mass.toarray())

    def theta(self, x: Floats) -> Floats:
        """θ at samples x (n_samples, n_x): shape (n_theta, n_samples)."""
        z = self.to_program @ np.atleast_2d(x).T + self.shift[:, None]
        return np.vstack([np.ones((1, z.shape[1])), self.program.run(Samples(), z)])

    def theta_series(self, space: LowerSet, x0: Floats, directions: Floats) -> Floats:
        """Coefficients of θ (n_theta, N) about x0 in w, where z = z0 + ``directions`` w."""
        z = np.zeros((len(self.shift), len(space)))
        z[:, 0] = self.to_program @ x0 + self.shift
        present = space.units >= 0
        z[:, space.units[present]] = directions[:, present]
        one = np.zeros((1, len(space)))
        one[0, 0] = 1.0
        return np.vstack([one, self.program.run(Truncated(space), z)])

    def matrices(self, theta: Floats) -> tuple[Floats, Floats]:
        """Dense K, M (n_samples, n_dof, n_dof) for θ (n_theta, n_samples)."""
        return self._dense(self.stiffness @ theta), self._dense(self.mass @ theta)

    def _dense(self, data: Floats) -> Floats:
        full = np.zeros((data.shape[1], self.n_dof * self.n_dof))
        full[:, self.rows * self.n_dof + self.columns] = data.T
        return full.reshape(-1, self.n_dof, self.n_dof)

    def sparse(self, data: Floats) -> sparse.csc_array:
        """One sparse matrix from its non-zeros (n_nonzeros,) on the common pattern."""
        shape = (self.n_dof, self.n_dof)
        return sparse.csc_array((data, (self.rows, self.columns)), shape=shape)
