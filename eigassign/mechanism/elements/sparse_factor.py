"""Factors of symmetric definite sparse matrices, whether a matrix is one, and its largest modes."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse import linalg

from eigassign.errors import AccuracyError

Floats = NDArray[np.float64]
Product = Callable[[Floats], Floats]


def factorise(matrix: sparse.csc_array) -> linalg.SuperLU:
    """LU without pivoting off the diagonal: cheap in fill-in, right for definite matrices.

    For others the caller checks what comes out.
    """
    options = {"SymmetricMode": True}
    return lu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)


def lu(matrix: sparse.csc_array, **options: Any) -> linalg.SuperLU:
    """SuperLU's factors; RuntimeError where a pivot is exactly zero, MemoryError without memory."""
    try:
        return linalg.splu(matrix, **options)
    except RuntimeError as error:
        if "singular" in str(error):
            raise
        raise MemoryError(str(error)) from error  # of a malloc that failed


def has_positive_pivots(factor: linalg.SuperLU) -> bool:
    """True where all pivots are on the diagonal and positive: the matrix is definite."""
    return bool((factor.perm_r == factor.perm_c).all() and (factor.U.diagonal() > 0.0).all())


def definite_factor(matrix: sparse.csc_array) -> linalg.SuperLU | None:
    """The factor of a symmetric positive definite matrix; None where it is not definite."""
    try:
        factor = factorise(matrix)
    except RuntimeError:  # a pivot is exactly zero
        return None
    diagonal = np.asarray(matrix.diagonal())[np.argsort(factor.perm_c)]
    pivots = np.asarray(factor.U.diagonal())
    # a pivot of a definite matrix is more than the round-off of its diagonal entry
    return factor if (pivots > 1e-15 * np.abs(diagonal)).all() else None


@dataclass(frozen=True)
class _Matrix:
    """A sparse matrix, the same where all its numbers are."""

    digest: bytes
    matrix: sparse.csc_array = field(compare=False)


def kept_factor(matrix: sparse.csc_array) -> linalg.SuperLU | None:
    """`definite_factor`, once for a matrix that is asked for again and again.

    A part that a design leaves alone has the same stiffness at every design and in every model.
    """
    indices = (np.asarray(a, dtype=np.int64) for a in (matrix.indptr, matrix.indices))
    parts = (*indices, np.asarray(matrix.data, dtype=np.float64))  # the first tells the order n
    digest = hashlib.sha256(b"".join(hashlib.sha256(a.tobytes()).digest() for a in parts)).digest()
    return _kept(_Matrix(digest, matrix))


@lru_cache(maxsize=4)  # few, for factors of large parts are large
def _kept(asked: _Matrix) -> linalg.SuperLU | None:
    return definite_factor(asked.matrix)


def is_semidefinite(matrix: sparse.csr_array, tolerance: float) -> bool:
    """Whether A + tolerance × diag(A) is positive definite on the rows that are not zero.

    Negative eigenvalues within the tolerance, relative to the diagonal, pass for round-off.
    """
    diagonal = np.asarray(matrix.diagonal())
    present = np.flatnonzero(np.asarray(abs(matrix).sum(axis=1)).ravel())
    if (diagonal[present] <= 0.0).any():
        return False
    if not len(present):
        return True
    scale = sparse.diags_array(1.0 / np.sqrt(diagonal[present]))
    scaled = scale @ matrix[present][:, present] @ scale
    eye = sparse.eye_array(len(present))
    return definite_factor(sparse.csc_array(scaled + tolerance * eye)) is not None


# --- The largest modes of M z = μ K z, K factored

LOOSE = 1e-3  # relative accuracy up to which the largest μ beside others is found at first
SAME = 1e-10  # relative: a μ that is larger by more was missed


def largest_modes(
    factor: linalg.SuperLU, K: sparse.csr_array, mass: Product, count: int
) -> tuple[Floats, Floats]:
    """The ``count`` largest μ of M z = μ K z, descending, and z (n, count) with zᵀKz = I.

    ``factor`` is that of K, ``mass`` the product with M, semidefinite. A Krylov space holds one
    vector of equal μ; round-off brings the others, or does not. So the largest μ beside those found
    is looked for until it is no larger than the last of them. Raises AccuracyError without
    convergence, ArpackError where so few unknowns have mass that there is no such space.
    """
    # Lanczos vectors before a restart: few modes converge in fewer than ARPACK's own 20
    krylov = min(max(20, 2 * count + 1), 10 + 2 * count)
    mu, z = _lanczos(factor, K, mass, count, krylov)
    for _ in range(count):
        try:
            more, v = largest_beside(factor, K, mass, z, LOOSE)
            if more > mu[-1] * (1.0 - 2.0 * LOOSE):
                more, v = largest_beside(factor, K, mass, z, 0.0)
        except linalg.ArpackError:  # nothing beside them has mass
            break
        if more <= mu[-1] * (1.0 + SAME):
            break
        mu, z = np.append(mu, more), np.column_stack([z, v])
        order = np.argsort(-mu)[:count]
        mu, z = mu[order], z[:, order]
    return mu, z


def largest_beside(
    factor: linalg.SuperLU, K: sparse.csr_array, mass: Product, W: Floats, tolerance: float
) -> tuple[float, Floats]:
    """The largest μ = wᵀMw / wᵀKw over all w with WᵀK w = 0, within a tolerance, and that w.

    By deflation: M' = Pᵀ M P with P = I − W (WᵀKW)⁻¹ WᵀK has μ = 0 on the span of W. It starts
    from another vector than what found W, which had nothing of the modes that this missed.
    """
    KW = np.asarray(K @ W)
    kept = np.linalg.solve(W.T @ KW, KW.T) if W.shape[1] else np.zeros((0, len(W)))

    def deflated(v: Floats) -> Floats:
        heavy = mass(v - W @ (kept @ v))
        return np.asarray(heavy - kept.T @ (W.T @ heavy))

    # of 6, 8, 10 and 20 Lanczos vectors 8 were the fastest for pencils of 500 to 3 000 unknowns
    mu, w = _lanczos(factor, K, deflated, 1, krylov=8, tolerance=tolerance, seed=1)
    return float(mu[0]), w[:, 0]


def _lanczos(
    factor: linalg.SuperLU,
    K: sparse.csr_array,
    mass: Product,
    count: int,
    krylov: int,
    tolerance: float = 0.0,
    seed: int = 0,
) -> tuple[Floats, Floats]:
    n = K.shape[0]
    M = linalg.LinearOperator((n, n), matvec=mass, dtype=np.float64)
    inverse = linalg.LinearOperator((n, n), matvec=factor.solve, dtype=np.float64)
    start = np.random.default_rng(seed).standard_normal(n)
    how: Any = {"which": "LA", "v0": start, "ncv": krylov, "tol": tolerance}
    try:
        mu, z = linalg.eigsh(M, count, M=K, Minv=inverse, **how)
    except linalg.ArpackNoConvergence as error:
        raise AccuracyError(f"the modes of a large matrix did not converge: {error}") from error
    order = np.argsort(-mu)
    return np.asarray(mu[order]), np.asarray(z[:, order])
