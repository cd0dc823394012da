"""The eigenvector recursion and the eigenvalue series of a cluster of r modes.

The invariant subspace X(w) (n × r) with K X = M X Λ and Φ0ᵀ M0 X = I is analytic through crossings
inside the cluster. Order γ of K X = M X Λ reads (eqs. (4)-(6)), column j with λ_j = (Λ0)_jj,

    (K0 − λ_j M0) X_γ,j − M0 Φ0 Λ_γ,j = −Σ_{δ>0} K_δ X_{γ−δ,j} + Σ_{δ>0} M_δ Y_{γ−δ,j} + M0 Ỹ_γ,j

with Y = X Λ and Ỹ_γ = Σ_{0<δ<γ} X_{γ−δ} Λ_δ. All γ of one degree are solved together; the
right-hand side is formed in the memory of the result.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.modal.taylor.bordered import PencilSeries, Solve, add_product, pencil_series
from eigassign.series.multi_index import LowerSet

Floats = NDArray[np.float64]
BLOCK = 16  # right-hand sides solved at once: more fall out of the cache (dense_or_sparse.py)


@dataclass(frozen=True, eq=False)
class SubspaceSeries:
    """X (N, n, r) and Λ (N, r, r) over ``space``; of each column the bordered system, factored."""

    space: LowerSet
    vectors: Floats
    values: Floats
    solvers: Sequence[Solve] = ()


def expand_subspace(
    pencil: Pencil, theta: Floats, space: LowerSet, lam0: Floats, phi0: Floats
) -> SubspaceSeries:
    """Coefficients over ``space`` from θ's own (n_theta, N), λ0 (r,) and Φ0 (n, r)."""
    series = pencil_series(pencil, theta, space)
    n, r = phi0.shape
    X, L = np.empty((len(space), r, n)), np.zeros((len(space), r, r))
    X[0], L[0] = phi0.T, np.diag(lam0)
    solvers: list[Solve] = []
    if space.order:
        border = series.mass_times(X[0])
        solvers = [series.factor(lam, border, X[0]) for lam in lam0.tolist()]
        _fill(series, space, solvers, X, L)
    return SubspaceSeries(space, X.transpose(0, 2, 1), L, solvers)


def _fill(
    series: PencilSeries, space: LowerSet, solvers: list[Solve], X: Floats, L: Floats
) -> None:
    """Fill in degree by degree, in place; Y and M0 X are only kept as far as they are used."""
    starts = space.degree_starts.tolist()
    lower = starts[space.order]
    Y, MX = np.empty_like(X[:lower]), np.empty_like(X[:lower])
    Y[0] = L[0] @ X[0]
    for degree in range(1, space.order + 1):
        here = slice(starts[degree], starts[degree + 1])
        series.convolve(degree, X, Y, X[here])
        mixing = _mixing(space, degree, L) if degree > 1 else None
        if mixing is not None:
            add_product(_flat(X[here]), mixing, _flat(MX[1 : here.start]))
        for j, solve in enumerate(solvers):  # right-hand sides become solutions, in blocks
            for start in range(here.start, here.stop, BLOCK):
                block = slice(start, min(start + BLOCK, here.stop))
                X[block, j], L[block, :, j] = solve(X[block, j])
        if degree < space.order:
            MX[here] = series.mass_times(_flat(X[here])).reshape(X[here].shape)
            Y[here] = L[0] @ X[here] + L[here].transpose(0, 2, 1) @ X[0]
            if mixing is not None:
                add_product(_flat(Y[here]), mixing, _flat(X[1 : here.start]))


def _flat(X: Floats) -> Floats:
    """(N, r, n) as (N r, n)."""
    return X.reshape(-1, X.shape[2])


def _mixing(space: LowerSet, degree: int, L: Floats) -> Floats:
    """C ((N_degree, r), (N_below − 1, r)) of Ỹ_γ,j = Σ_{0<δ<γ} Σ_i X_{γ−δ,i} (Λ_δ)_ij."""
    starts, pairs = space.degree_starts, space.by_degree[degree]
    count, below, r = int(starts[degree + 1] - starts[degree]), int(starts[degree]), L.shape[1]
    C = np.zeros((count, below - 1, r, r))
    proper = pairs.right > 0
    C[pairs.target[proper], pairs.right[proper] - 1] = L[pairs.left[proper]]
    return C.transpose(0, 3, 1, 2).reshape(count * r, (below - 1) * r)
