"""Power-series coefficients K_γ, M_γ of the pencil, and what the recursion asks of them.

Vectors stand in rows: X (N, r, n) holds r vectors of length n for every multi-index, contiguous, so
that products and solves run over memory in order. Small pencils keep one dense stack of all
coefficients, large ones a sparse matrix of each.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.modal.taylor.bordered import Solve, factor_dense, factor_sparse
from eigassign.series.multi_index import LowerSet, first_of_each

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class PencilSeries:
    """K(w) = Σ_γ K_γ w^γ and M(w) over one set, each with the coefficients it has."""

    pencil: Pencil
    stiffness: DenseTerms | SparseTerms
    mass: DenseTerms | SparseTerms

    def convolve(self, degree: int, X: Floats, Y: Floats, out: Floats) -> None:
        """out_γ = Σ_{0<δ≤γ} M_δ Y_{γ−δ} − K_δ X_{γ−δ} for |γ| = degree; out (N_degree, r, n)."""
        out[...] = 0.0
        for target, sums in self.mass.sums(degree, Y):
            out[target] += sums
        for target, sums in self.stiffness.sums(degree, X):
            out[target] -= sums

    def mass_times(self, X: Floats) -> Floats:
        """M_0 X for rows X (k, n)."""
        if isinstance(self.mass, SparseTerms):
            return np.array([self.mass.matrices[0] @ x for x in X])
        return np.asarray(X @ self.mass.stack[0])

    def factor(self, lam: float, border: Floats, phi: Floats) -> Solve:
        """The bordered system of K_0 − λ M_0, ``border`` M_0 Φ_0 and Φ_0 as rows (r, n)."""
        A = self.stiffness.first - lam * self.mass.first
        if self.pencil.is_dense:
            return factor_dense(A, border)
        return factor_sparse(self.pencil, A, border, phi)


def pencil_series(pencil: Pencil, theta: Floats, space: LowerSet) -> PencilSeries:
    """The pencil's coefficients over ``space`` from θ's own (n_theta, N)."""
    stored = np.flatnonzero(theta.any(axis=0))  # θ_0 = 1: position 0 is always there
    theta = theta[:, stored]
    if not pencil.is_dense:
        return PencilSeries(
            pencil, *(_sparse(pencil, space, theta, stored, terms) for terms in pencil.by_term)
        )
    there = pencil.has_term @ (theta != 0.0)
    there[:, 0] = True
    both = zip(pencil.matrices(theta), there, strict=True)
    return PencilSeries(pencil, *(_dense(space, stored, *each) for each in both))


@dataclass(frozen=True)
class ProductPairs:
    """Products A_δ X_β of all β + δ = γ with |γ| and |δ| fixed, sorted by γ.

    The δ are among the ``slots`` of what is stored and the β among ``below``; ``left``, ``right``
    count from the first of these, ``into`` from the first γ of that degree. ``first`` is the first
    pair of each γ that there is, and ``target`` that γ.
    """

    slots: slice
    below: slice
    left: Ints
    right: Ints
    into: Ints
    first: Ints
    target: Ints | slice  # a slice where these are all


@lru_cache(maxsize=64)
def pairs(space: LowerSet, stored: bytes) -> tuple[tuple[ProductPairs, ...], ...]:
    """Pairs of every degree with δ among the ``stored`` positions, by ascending |δ|."""
    present = np.frombuffer(stored, dtype=np.intp)
    slot = np.full(len(space), -1, dtype=np.intp)
    slot[present] = np.arange(len(present))
    degrees = range(space.order + 1)
    return tuple(
        tuple(p for e in range(1, d + 1) if len((p := _pairs(space, slot, d, e)).left))
        for d in degrees
    )


def _pairs(space: LowerSet, slot: Ints, degree: int, of_delta: int) -> ProductPairs:
    table, starts = space.by_degree[degree], space.degree_starts
    keep = (slot[table.left] >= 0) & (space.degrees[table.left] == of_delta)
    stored = slot[table.left[keep]]
    target = table.target[keep]
    first = first_of_each(target)
    low = int(stored.min(initial=len(space)))
    below = slice(int(starts[degree - of_delta]), int(starts[degree - of_delta + 1]))
    return ProductPairs(
        slice(low, int(stored.max(initial=-1)) + 1),
        below,
        stored - low,
        table.right[keep] - below.start,
        target,
        first,
        slice(None) if len(first) == starts[degree + 1] - starts[degree] else target[first],
    )


# --- Small pencils: one dense stack a matrix


@dataclass(frozen=True, eq=False)
class DenseTerms:
    """The coefficients of one matrix that are not zero in one stack; the first is that of w = 0."""

    pairs: tuple[tuple[ProductPairs, ...], ...]
    stack: Floats  # (n_stored, n, n)

    @property
    def first(self) -> Floats:
        """That of w = 0, (n, n)."""
        return np.asarray(self.stack[0])

    def sums(self, degree: int, X: Floats) -> Iterator[tuple[Ints | slice, Floats]]:
        """Parts of Σ_{0<δ≤γ} A_δ X_{γ−δ}, |γ| = degree: which γ, and (n_γ, r, n) of them.

        The coefficients are symmetric, so rows multiply from the left.
        """
        for p in self.pairs[degree]:
            count, r, n = X[p.below].shape
            products = X[p.below].reshape(-1, n) @ self.stack[p.slots]
            chosen = products.reshape(-1, count, r, n)[p.left, p.right]
            yield p.target, np.add.reduceat(chosen, p.first, axis=0)


def _dense(space: LowerSet, stored: Ints, stack: Floats, varying: NDArray[np.bool_]) -> DenseTerms:
    """One matrix without the coefficients that it has not: stiffness hardly varies with q."""
    if not varying.all():
        stack, stored = stack[varying], stored[varying]
    return DenseTerms(pairs(space, stored.tobytes()), stack)


# --- Large pencils: a sparse matrix for each coefficient


@dataclass(frozen=True, eq=False)
class SparseTerms:
    """The coefficients of one matrix as sparse ones; the first is that of w = 0."""

    pairs: tuple[tuple[ProductPairs, ...], ...]
    matrices: tuple[sparse.csr_array, ...]  # (n, n) of each that is stored
    first: Floats  # the non-zeros of the first on the pencil's pattern

    def sums(self, degree: int, X: Floats) -> Iterator[tuple[Ints, Floats]]:
        """See `DenseTerms.sums`."""
        for p in self.pairs[degree]:
            below = X[p.below]
            for k, A in enumerate(self.matrices[p.slots]):
                hit = p.left == k
                rows = below[p.right[hit]]
                yield p.into[hit], (A @ rows.reshape(-1, A.shape[0]).T).T.reshape(rows.shape)


def _sparse(
    pencil: Pencil, space: LowerSet, theta: Floats, stored: Ints, terms: sparse.csc_array
) -> SparseTerms:
    """One matrix from its ``terms`` (n_entries, n_theta) and θ (n_theta, n_stored)."""
    there = np.flatnonzero(np.diff(terms.indptr))
    varying = np.asarray(theta[there].any(axis=0))
    varying[0] = True
    matrices = []
    for each in theta[:, varying].T:
        own = np.flatnonzero(each)
        data = terms[:, own] @ each[own]
        entries = np.flatnonzero(data)
        places = pencil.rows[entries], pencil.columns[entries]
        matrices.append(sparse.csr_array((data[entries], places), shape=(pencil.n_dof,) * 2))
    first = np.asarray(terms @ theta[:, 0])
    return SparseTerms(pairs(space, stored[varying].tobytes()), tuple(matrices), first)
