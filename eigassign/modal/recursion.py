"""The eigenvector recursion and the eigenvalue series of a cluster of r modes.

The invariant subspace X(w) (n × r) with K X = M X Λ and Φ0ᵀ M0 X = I is analytic through crossings
inside the cluster. Order γ of K X = M X Λ reads, column j with λ_j = (Λ0)_jj,

    (K0 − λ_j M0) X_γ,j − M0 Φ0 Λ_γ,j = −Σ_{δ>0} K_δ X_{γ−δ,j} + Σ_{δ>0} M_δ Y_{γ−δ,j} + M0 Ỹ_γ,j

with Y = X Λ and Ỹ_γ = Σ_{0<δ<γ} X_{γ−δ} Λ_δ. All γ of one degree are solved together.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.mechanism.pencil import Pencil
from eigassign.modal.bordered import Solve, factor_dense, factor_sparse
from eigassign.modal.coefficients import DENSE_LIMIT, MatrixSeries, matrix_series
from eigassign.series.lower_set import LowerSet, first_of_each

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class SubspaceSeries:
    """X (N, n, r) and Λ (N, r, r) over ``space``."""

    space: LowerSet
    vectors: Floats
    values: Floats


def expand_subspace(
    pencil: Pencil, theta: Floats, space: LowerSet, lam0: Floats, phi0: Floats
) -> SubspaceSeries:
    """Coefficients over ``space`` from θ's own (n_theta, N), λ0 (r,) and Φ0 (n, r)."""
    K = matrix_series(pencil, pencil.stiffness, theta, space)
    M = matrix_series(pencil, pencil.mass, theta, space)
    n, r = phi0.shape
    X, L, Y = np.zeros((len(space), n, r)), np.zeros((len(space), r, r)), None
    X[0], L[0] = phi0, np.diag(lam0)
    Y = np.zeros_like(X)
    Y[0] = phi0 * lam0
    solvers, M0 = _factor(pencil, theta[:, 0], lam0, phi0)
    for degree in range(1, space.order + 1):
        _step(space, degree, K, M, M0, solvers, X, L, Y)
    return SubspaceSeries(space, X, L)


def _factor(
    pencil: Pencil, theta0: Floats, lam0: Floats, phi0: Floats
) -> tuple[list[Solve], object]:
    """One bordered factorisation a column, and M0."""
    dense = pencil.n_dof <= DENSE_LIMIT
    k, m = pencil.stiffness @ theta0, pencil.mass @ theta0
    if dense:
        shape = (pencil.n_dof, pencil.n_dof)
        K0, M0 = np.zeros(shape), np.zeros(shape)
        K0[pencil.rows, pencil.columns], M0[pencil.rows, pencil.columns] = k, m
        border = M0 @ phi0
        return [factor_dense(K0 - lam * M0, border) for lam in lam0], M0
    M0s = pencil.sparse(m)
    border = M0s @ phi0
    return [factor_sparse(pencil.sparse(k - lam * m), border) for lam in lam0], M0s


def _step(
    space: LowerSet,
    degree: int,
    K: MatrixSeries,
    M: MatrixSeries,
    M0: object,
    solvers: list[Solve],
    X: Floats,
    L: Floats,
    Y: Floats,
) -> None:
    """Fill in every coefficient of one total degree, in place."""
    here = slice(*space.degree_starts[degree : degree + 2])
    partial = _products_below(space, degree, X, L)
    rhs = M.convolve(degree, Y) - K.convolve(degree, X)
    if degree > 1:
        rhs += _apply(M0, partial)
    for j, solve in enumerate(solvers):
        x, values = solve(rhs[:, :, j].T)
        X[here, :, j], L[here, :, j] = x.T, values.T
    Y[here] = partial + X[here] @ L[0] + X[0] @ L[here]


def _apply(M0: object, block: Floats) -> Floats:
    """M0 times every (n, r) of a stack (N, n, r)."""
    count, n, r = block.shape
    flat = block.transpose(1, 0, 2).reshape(n, -1)
    return np.asarray((M0 @ flat).reshape(n, count, r).transpose(1, 0, 2))  # type: ignore[operator]


def _products_below(space: LowerSet, degree: int, X: Floats, L: Floats) -> Floats:
    """Σ_{0<δ<γ} X_{γ−δ} Λ_δ for every |γ| = degree."""
    starts, pairs = space.degree_starts, space.by_degree[degree]
    out = np.zeros((starts[degree + 1] - starts[degree], *X.shape[1:]))
    if degree > 1:
        proper = pairs.right > 0
        left, right, target = pairs.left[proper], pairs.right[proper], pairs.target[proper]
        first = first_of_each(target)
        out[target[first]] = np.add.reduceat(X[right] @ L[left], first, axis=0)
    return out
