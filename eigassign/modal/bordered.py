"""The bordered system that yields every eigenvector coefficient, factored once.

    ⎡ K0 − λ0 M0   −M0 Φ0 ⎤ ⎡ φ_γ ⎤   ⎡ rhs_γ ⎤
    ⎣ −Φ0ᵀ M0        0    ⎦ ⎣ λ_γ ⎦ = ⎣   0   ⎦

Symmetric and regular although K0 − λ0 M0 is singular; it replaces the paper's pseudo-inverse. The
border is scaled to the size of the stiffness so that pivoting does not mix units.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

Floats = NDArray[np.float64]
Solve = Callable[[Floats], tuple[Floats, Floats]]


def factor_dense(A: Floats, border: Floats) -> Solve:
    """Solver for [[A, −B], [−Bᵀ, 0]], B = ``border`` (n, r): rhs (n, k) → x (n, k), l (r, k)."""
    from scipy.linalg import lu_factor, lu_solve

    n, r = border.shape
    scale = _scale(float(np.abs(A).max()), border)
    full = np.zeros((n + r, n + r))
    full[:n, :n] = A
    full[:n, n:] = -scale * border
    full[n:, :n] = -scale * border.T
    factors = lu_factor(full, check_finite=False)

    def solve(rhs: Floats) -> tuple[Floats, Floats]:
        padded = np.zeros((n + r, rhs.shape[1]))
        padded[:n] = rhs
        solution = lu_solve(factors, padded, check_finite=False)
        return solution[:n], scale * solution[n:]

    return solve


def factor_sparse(A: sparse.csc_array, border: Floats) -> Solve:
    """The same with a sparse A; the border goes last, where its dense rows cost no fill-in."""
    from scipy.sparse.linalg import splu

    n, r = border.shape
    scale = _scale(float(np.abs(A.data).max()), border)
    edge = sparse.csc_array(-scale * border)
    full = sparse.block_array([[A, edge], [edge.T, None]], format="csc")
    factors = splu(full, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True})

    def solve(rhs: Floats) -> tuple[Floats, Floats]:
        padded = np.zeros((n + r, rhs.shape[1]))
        padded[:n] = rhs
        solution = factors.solve(padded)
        return solution[:n], scale * solution[n:]

    return solve


def _scale(size: float, border: Floats) -> float:
    return size / float(np.abs(border).max())
