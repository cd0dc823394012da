"""The eigenvector recursion and the eigenvalue series of a cluster of r modes, about one x0.

The invariant subspace X(w) (n × r) with K X = M X Λ and Φ0ᵀ M0 X = I is analytic through crossings
inside the cluster. Order γ of K X = M X Λ reads (eqs. (4)-(6)), column j with λ_j = (Λ0)_jj,

    (K0 − λ_j M0) X_γ,j − M0 Φ0 Λ_γ,j = −Σ_{δ>0} K_δ X_{γ−δ,j} + Σ_{δ>0} M_δ Y_{γ−δ,j} + M0 Ỹ_γ,j

with Y = X Λ and Ỹ_γ = Σ_{0<δ<γ} X_{γ−δ} Λ_δ. All γ of one degree are solved together; the
right-hand side is formed in the memory of the result.

Taylor vectors are those of all clusters, φ(x0 + x) ≈ Σ_γ φ_γ w^γ with w = V (x − x0): the relative
joint coordinates and design parameters on which anything depends, or, for a set that was given over
x, those of x. A series over w becomes one over x by substituting V (x − x0). Eigenvalues follow by
the Rayleigh quotient; a reduced model has the vectors as its basis.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eigassign.arrays import Floats, Ints
from eigassign.errors import UsageError
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.modal.exact.solver import CLUSTER_GAP, whole_clusters
from eigassign.modal.taylor.bordered import PencilSeries, Solve, add_product, pencil_series
from eigassign.modal.taylor.rayleigh import vector_members
from eigassign.series.algebra import monomials_of, multiply
from eigassign.series.multi_index import LowerSet, lower_set, partially_linear, total_degree

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


class LocalSpace(NamedTuple):
    """The set over w, dz/dw and dw/dx."""

    space: LowerSet
    to_z: Floats
    directions: Floats
    n_linear: int  # the last variables, which enter at most linearly


def local_space(
    pencil: Pencil, order: int, linear_in_y: bool, space: LowerSet | None
) -> LocalSpace:
    """The set over w that was asked for; raises UsageError for one of the wrong width."""
    if space is not None:
        if not isinstance(space, LowerSet):
            raise UsageError(f"space must be a lower set, not {type(space).__name__}")
        n_x = pencil.to_program.shape[1]
        if space.n_variables != n_x:
            raise UsageError(f"the set has {space.n_variables} variables, the model {n_x}")
        kept = (pencil.to_program[pencil.active] != 0.0).any(axis=0)
        selection, over = np.eye(n_x)[kept], _over(space, kept.tobytes())
        return LocalSpace(over, pencil.to_program[:, kept], selection, 0)
    # w are the active ones of z
    to_z, directions = np.eye(len(pencil.shift))[:, pencil.active], pencil.to_program[pencil.active]
    n_a = int(np.count_nonzero(pencil.active[: pencil.n_q]))
    n_b = to_z.shape[1] - n_a
    chosen = partially_linear(n_a, n_b, order) if linear_in_y else total_degree(n_a + n_b, order)
    return LocalSpace(chosen, to_z, directions, n_b if linear_in_y else 0)


@lru_cache(maxsize=64)
def _over(space: LowerSet, kept: bytes) -> LowerSet:
    """The members without the variables that are not kept, over those that are."""
    columns = np.frombuffer(kept, dtype=bool)
    inside = (space.indices[:, ~columns] == 0).all(axis=1)
    return lower_set(space.indices[inside][:, columns])


@lru_cache(maxsize=64)
def vector_set(space: LowerSet, n_linear: int, vector_order: int | None) -> tuple[LowerSet, Ints]:
    """The set of eigenvector coefficients and its positions in the set of eigenvalues."""
    linear = np.arange(space.n_variables) >= space.n_variables - n_linear
    if vector_order is None:
        members = vector_members(space, linear)
    else:
        members = np.asarray(space.degrees <= vector_order)
    half = lower_set(space.indices[members])
    return half, space.find(half.indices)


# --- From a series over w to one over x


def substitute(
    space: LowerSet, coefficients: Floats, directions: Floats, n_q: int, n_linear: int
) -> tuple[LowerSet, Floats]:
    """The set over x and coefficients (k, N_x) of Σ c_γ (V (x − x0))^γ, c (k, N)."""
    selection = (np.count_nonzero(directions, axis=1) == 1).all()
    if selection and (directions.max(axis=1, initial=0.0) == 1.0).all():  # each w is one of x
        return _sorted(space.indices @ (directions != 0.0).astype(np.int64), coefficients)
    used = np.flatnonzero((directions != 0.0).any(axis=0))
    n_y = int((used >= n_q).sum())
    n_a = len(used) - n_y
    inner = (
        partially_linear(n_a, n_y, space.order)
        if n_linear
        else total_degree(len(used), space.order)
    )
    values = coefficients @ _monomial_series(space, inner, directions[:, used])
    wide = np.zeros((len(inner), directions.shape[1]), dtype=np.int64)
    wide[:, used] = inner.indices
    return _sorted(wide, values)


def _sorted(wide: NDArray[np.int64], values: Floats) -> tuple[LowerSet, Floats]:
    target = lower_set(wide)
    ordered = np.empty_like(values)
    ordered[:, target.find(wide)] = values
    return target, ordered


def _monomial_series(space: LowerSet, inner: LowerSet, directions: Floats) -> Floats:
    """Rows: the series in x of w^γ for every γ, each a parent's times one linear form."""
    linear, units = np.zeros((space.n_variables, len(inner))), inner.units
    linear[:, units[units >= 0]] = directions[:, units >= 0]
    rows = np.zeros((len(space), len(inner)))
    rows[0, 0] = 1.0
    for first, last, parents, variables in monomials_of(space).steps:
        rows[first:last] = multiply(inner, rows[parents], linear[variables])
    return rows


@dataclass(frozen=True, eq=False)
class TaylorVectors:
    """X (N_H, n_dof, r) over ``space`` of each cluster of ``groups``; θ (n_theta, N) of the set."""

    groups: tuple[tuple[int, ...], ...]  # modes that are expanded together, counted from 1
    vectors: tuple[Floats, ...]
    space: LowerSet
    theta: Floats


def taylor_vectors(
    pencil: Pencil,
    x0: Floats,
    modes: Sequence[int],
    local: LocalSpace,
    order: int | None = None,
    cluster_gap: float = CLUSTER_GAP,
) -> TaylorVectors:
    """Those of ``modes`` to ``order``, or to what the eigenvalues over the set of ``local`` need.

    Modes closer than ``cluster_gap`` (relative in λ) are expanded together.
    """
    theta = pencil.theta_series(local.space, x0, local.to_z)
    found, groups = whole_clusters(pencil, theta[:, :1], modes, cluster_gap)
    half, kept = vector_set(local.space, local.n_linear, order)
    vectors = []
    for group in groups:
        pick = np.array(group) - 1
        lam0, phi0 = found.lam[0, pick], found.phi[0][:, pick]
        X = np.ascontiguousarray(expand_subspace(pencil, theta[:, kept], half, lam0, phi0).vectors)
        X.setflags(write=False)
        vectors.append(X)
    return TaylorVectors(groups, tuple(vectors), half, theta)


def vectors_to_order(pencil: Pencil, x0: Floats, modes: Sequence[int], order: int) -> Floats:
    """φ_γ of ``modes`` and of what lies close to them, |γ| ≤ ``order``, as columns (n_dof, N)."""
    local = local_space(pencil, order, linear_in_y=False, space=None)
    vectors = taylor_vectors(pencil, x0, modes, local, order).vectors
    return np.hstack([X.transpose(1, 0, 2).reshape(X.shape[1], -1) for X in vectors])
