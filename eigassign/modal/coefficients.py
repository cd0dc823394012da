"""Power-series coefficients K_γ, M_γ of the pencil and their products with vector coefficients.

Small pencils keep one dense stack and form every product in one call; large ones keep a sparse
matrix for each γ that is not zero (few are: each θ depends on few variables).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.mechanism.pencil import Pencil
from eigassign.series.lower_set import LowerSet, first_of_each

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
DENSE_LIMIT = 250  # n_dof up to which the coefficients are kept dense


@dataclass(frozen=True, eq=False)
class MatrixSeries:
    """A(w) = Σ_γ A_γ w^γ over ``space``; only the ``present`` A_γ are stored."""

    space: LowerSet
    present: Ints  # positions γ with A_γ ≠ 0, ascending
    dense: Floats | None  # (n_present, n, n)
    matrices: tuple[sparse.csr_array, ...]

    def convolve(self, degree: int, phi: Floats) -> Floats:
        """Σ_{0 < δ ≤ γ} A_δ φ_{γ−δ} for every |γ| = degree: (N_degree, n, r) from (N, n, r)."""
        if self.dense is not None:
            return self._convolve_dense(self.dense, degree, phi)
        return self._convolve_sparse(degree, phi)

    def _pairs(self, degree: int) -> tuple[Ints, Ints, Ints]:
        """Pairs (slot of δ, position of γ − δ, target) of one degree, sorted by target."""
        pairs = self.space.by_degree[degree]
        slot = self._slots[pairs.left]
        keep = slot >= 0
        return slot[keep], pairs.right[keep], pairs.target[keep]

    @cached_property
    def _slots(self) -> Ints:
        """Where each γ is stored, -1 for an absent one."""
        slots = np.full(len(self.space), -1, dtype=np.intp)
        slots[self.present] = np.arange(len(self.present))
        return slots

    def _convolve_dense(self, stack: Floats, degree: int, phi: Floats) -> Floats:
        slot, right, target = self._pairs(degree)
        starts = self.space.degree_starts
        out = np.zeros((starts[degree + 1] - starts[degree], *phi.shape[1:]))
        if not len(slot):
            return out
        n, below = phi.shape[1], phi[: starts[degree]]
        columns = below.transpose(1, 0, 2).reshape(n, -1)
        products = (stack.reshape(-1, n) @ columns).reshape(len(stack), n, len(below), -1)
        first = first_of_each(target)
        out[target[first]] = np.add.reduceat(products[slot, :, right], first, axis=0)
        return out

    def _convolve_sparse(self, degree: int, phi: Floats) -> Floats:
        slot, right, target = self._pairs(degree)
        starts = self.space.degree_starts
        _, n, r = phi.shape
        out = np.zeros((starts[degree + 1] - starts[degree], n, r))
        for k in np.unique(slot):
            chosen = slot == k
            block = phi[right[chosen]].transpose(1, 0, 2).reshape(n, -1)
            product = (self.matrices[k] @ block).reshape(n, -1, r)
            out[target[chosen]] += product.transpose(1, 0, 2)
        return out


def matrix_series(
    pencil: Pencil, weights: sparse.csr_array, theta: Floats, space: LowerSet
) -> MatrixSeries:
    """Σ_γ (weights θ_γ) w^γ for θ (n_theta, N) over ``space``."""
    used = np.flatnonzero(theta.any(axis=0))
    n = pencil.n_dof
    if n <= DENSE_LIMIT:
        stack = np.zeros((len(used), n * n))
        stack[:, pencil.rows * n + pencil.columns] = (weights @ theta[:, used]).T
        return MatrixSeries(space, used, stack.reshape(-1, n, n), ())
    built = [_sparse_term(pencil, weights, theta[:, k]) for k in used]
    keep = [k for k, matrix in enumerate(built) if matrix.nnz]
    return MatrixSeries(space, used[keep], None, tuple(built[k] for k in keep))


def _sparse_term(pencil: Pencil, weights: sparse.csr_array, theta: Floats) -> sparse.csr_array:
    """One coefficient, with only the entries that its θ touch."""
    atoms = np.flatnonzero(theta)
    data = weights[:, atoms] @ theta[atoms]
    hit = np.flatnonzero(data)
    shape = (pencil.n_dof, pencil.n_dof)
    return sparse.csr_array((data[hit], (pencil.rows[hit], pencil.columns[hit])), shape=shape)
