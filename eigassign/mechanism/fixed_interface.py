"""Modes of a part whose interface is held: K_ii φ = λ M_ii φ, solved as M_ii φ = μ K_ii φ.

In this inverse form massless dofs (μ = 0, as of rotations without inertia) do no harm.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import eigh
from scipy.sparse import linalg

from eigassign.errors import AccuracyError

Floats = NDArray[np.float64]
DENSE = 400  # interior dofs up to which all eigenvalues are computed
FIRST = 16  # modes that Lanczos is asked for first
LOOSE = 1e-3  # relative accuracy of the largest μ left out


def fixed_modes(
    K: sparse.csc_array, M: sparse.csc_array, factor: linalg.SuperLU, lam: float
) -> Floats:
    """All modes (n, k) with λ ≤ ``lam``, φᵀ K φ = I; ``factor`` is that of K."""
    n, least = K.shape[0], 1.0 / lam
    count = FIRST
    while n > DENSE and count < n // 2:
        mu, phi = _lanczos(K, _mass(M), factor, count, 0.0)
        if mu[-1] < least:
            return np.asarray(phi[:, mu >= least])
        count *= 2
    mu, phi = eigh(M.toarray(), K.toarray())
    return np.asarray(phi[:, ::-1][:, mu[::-1] >= least])


def largest_left_out(
    K: sparse.csc_array, M: sparse.csc_array, factor: linalg.SuperLU, W: Floats
) -> float:
    """The largest μ = wᵀMw / wᵀKw over all w with WᵀK w = 0; an upper bound within `LOOSE`.

    By deflation: M' = Pᵀ M P with P = I − W (WᵀKW)⁻¹ WᵀK has μ = 0 on the span of W.
    """
    n = K.shape[0]
    if W.shape[1] >= n:
        return 0.0
    KW = np.asarray(K @ W)
    kept = np.linalg.solve(W.T @ KW, KW.T) if W.shape[1] else np.zeros((0, n))

    def deflated(v: Floats) -> Floats:
        heavy = M @ (v - W @ (kept @ v))
        return np.asarray(heavy - kept.T @ (W.T @ heavy))

    if n <= DENSE:
        mu = eigh(deflated(np.eye(n)), K.toarray(), eigvals_only=True)
        return float(mu[-1])
    mass = linalg.LinearOperator((n, n), matvec=deflated, dtype=np.float64)
    mu, _ = _lanczos(K, mass, factor, 1, LOOSE)
    return float(mu[0]) * (1.0 + LOOSE)


def _mass(M: sparse.csc_array) -> linalg.LinearOperator:
    rows = M.T  # symmetric: products run faster row by row
    return linalg.LinearOperator(M.shape, matvec=lambda v: rows @ v, dtype=np.float64)


def _lanczos(
    K: sparse.csc_array,
    mass: linalg.LinearOperator,
    factor: linalg.SuperLU,
    count: int,
    tolerance: float,
) -> tuple[Floats, Floats]:
    """The largest μ, descending, and their vectors of unit K-norm."""
    n = K.shape[0]
    inverse = linalg.LinearOperator((n, n), matvec=factor.solve, dtype=np.float64)
    start = np.random.default_rng(0).standard_normal(n)
    try:
        mu, phi = linalg.eigsh(
            mass, count, M=K.T, Minv=inverse, which="LA", v0=start, tol=tolerance
        )
    except linalg.ArpackNoConvergence as error:
        raise AccuracyError(f"the fixed-interface modes did not converge: {error}") from error
    order = np.argsort(-mu)
    return np.asarray(mu[order]), np.asarray(phi[:, order])
