"""The bordered system that yields every eigenvector coefficient, factored once.

    ⎡ K0 − λ0 M0   −M0 Φ0 ⎤ ⎡ φ_γ ⎤   ⎡ rhs_γ ⎤
    ⎣ −Φ0ᵀ M0        0    ⎦ ⎣ λ_γ ⎦ = ⎣   0   ⎦

Symmetric and regular although K0 − λ0 M0 is singular; it replaces the paper's pseudo-inverse. The
border is scaled to the size of the stiffness so that pivoting does not mix units.

Dense products that add to what is there, without a temporary of the size of the result.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import blas, lapack

from eigassign.errors import AccuracyError

# --- The bordered system that yields every eigenvector coefficient, factored once

Floats = NDArray[np.float64]
Solve = Callable[[Floats], tuple[Floats, Floats]]


def factor_dense(A: Floats, border: Floats) -> Solve:
    """Solver for [[A, −Bᵀ], [−B, 0]], B = ``border`` (r, n): rows (k, n) → x (k, n), l (k, r).

    Raises AccuracyError where the system is singular: the border misses a mode with the same λ.
    """
    r, n = border.shape
    scale = float(np.abs(A).max() / np.abs(border).max())
    full = np.zeros((n + r, n + r))
    full[:n, :n] = A
    full[n:, :n] = border
    full[n:] *= -scale
    full[:n, n:] = full[n:, :n].T
    lu, pivots, info = lapack.dgetrf(full.T, overwrite_a=1)
    if info:
        raise AccuracyError("the bordered system is singular: a mode of the cluster is missing")

    def solve(rows: Floats) -> tuple[Floats, Floats]:
        padded = np.zeros((len(rows), n + r))
        padded[:, :n] = rows
        solution = lapack.dgetrs(lu, pivots, padded.T, overwrite_b=1)[0].T
        return solution[:, :n], scale * solution[:, n:]

    return solve


# --- Dense products that add to what is there, without a temporary of the size of the result


def add_product(out: Floats, A: Floats, B: Floats) -> None:
    """out += A B for C-ordered out (m, n), A (m, k), B (k, n)."""
    result = blas.dgemm(1.0, B.T, A.T, 1.0, out.T, overwrite_c=1)
    if not np.may_share_memory(result, out):  # out was not contiguous
        out[...] = result.T
