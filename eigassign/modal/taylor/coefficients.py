"""Power-series coefficients K_γ, M_γ of the pencil, and what the recursion asks of them.

Vectors stand in rows: X (N, r, n) holds r vectors of length n for every multi-index, contiguous, so
that products and solves run over memory in order. Small pencils keep one dense stack of all
coefficients (:class:`DenseSeries`), large ones of each only the unknowns that it touches
(:class:`SparseSeries`). There the rows and columns of the coordinates q̇ are dense and all others
have a handful of entries, so that a coefficient is

    A = C + E B + Bᵀ Eᵀ ,

C sparse on the touched elastic unknowns, B (f, n) its rows of q̇ (those among q̇ halved), and E the
unit vectors of q̇.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.modal.taylor.bordered import Solve, add_product, factor_dense, factor_sparse
from eigassign.series.multi_index import LowerSet, first_of_each

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
Body = tuple[Ints, sparse.csr_array]  # touched elastic unknowns, C on them


def pencil_series(pencil: Pencil, theta: Floats, space: LowerSet) -> PencilSeries:
    """The pencil's coefficients over ``space`` from θ's own (n_theta, N)."""
    if not pencil.is_dense:
        return _sparse_series(pencil, theta, space)
    stored = np.flatnonzero(theta.any(axis=0))  # θ_0 = 1: position 0 is always there
    both = zip(pencil.matrices(theta[:, stored]), pencil.by_term, strict=True)
    return DenseSeries(*(_dense(space, theta[:, stored], stored, *each) for each in both))


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
    target: Ints


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
        target[first],
    )


# --- Small pencils: one dense stack a matrix


@dataclass(frozen=True, eq=False)
class DenseTerms:
    """The coefficients of one matrix that are not zero in one stack; the first is that of w = 0."""

    pairs: tuple[tuple[ProductPairs, ...], ...]
    stack: Floats  # (n_stored, n, n)

    def sums(self, degree: int, X: Floats) -> Iterator[tuple[Ints, Floats]]:
        """Parts of Σ_{0<δ≤γ} A_δ X_{γ−δ}, |γ| = degree: which γ, and (n_γ, r, n) of them.

        The coefficients are symmetric, so rows multiply from the left.
        """
        for p in self.pairs[degree]:
            count, r, n = X[p.below].shape
            products = X[p.below].reshape(-1, n) @ self.stack[p.slots]
            chosen = products.reshape(-1, count, r, n)[p.left, p.right]
            yield p.target, np.add.reduceat(chosen, p.first, axis=0)


@dataclass(frozen=True, eq=False)
class DenseSeries:
    """K(w) = Σ_γ K_γ w^γ and M(w) over one set as stacks, each with the coefficients it has."""

    stiffness: DenseTerms
    mass: DenseTerms

    def convolve(self, degree: int, X: Floats, Y: Floats, out: Floats) -> None:
        """out_γ = Σ_{0<δ≤γ} M_δ Y_{γ−δ} − K_δ X_{γ−δ} for |γ| = degree; out (N_degree, r, n)."""
        out[...] = 0.0
        for target, sums in self.mass.sums(degree, Y):
            out[target] += sums
        for target, sums in self.stiffness.sums(degree, X):
            out[target] -= sums

    def mass_times(self, X: Floats) -> Floats:
        """M_0 X for rows X (k, n)."""
        return np.asarray(X @ self.mass.stack[0])

    def factor(self, lam: float, border: Floats, phi: Floats) -> Solve:
        """The bordered system of K_0 − λ M_0, ``border`` M_0 Φ_0 and Φ_0 as rows (r, n)."""
        return factor_dense(self.stiffness.stack[0] - lam * self.mass.stack[0], border)


def _dense(
    space: LowerSet, theta: Floats, stored: Ints, stack: Floats, terms: sparse.csc_array
) -> DenseTerms:
    """One matrix without the coefficients that it has not: stiffness hardly varies with q."""
    varying = np.asarray(theta[np.diff(terms.indptr) > 0].any(axis=0))
    varying[0] = True
    if not varying.all():
        stack, stored = stack[varying], stored[varying]
    return DenseTerms(pairs(space, stored.tobytes()), stack)


# --- Large pencils: of each coefficient what it touches


@dataclass(frozen=True, eq=False)
class SparseTerms:
    """The coefficients A_δ, δ ≠ 0, of one matrix, by their slot among the stored ones."""

    bodies: dict[int, Body]
    edge_slots: Ints  # ascending, of each row of B
    edge_dofs: Ints
    B: Floats  # (n_edges, n)

    def add_products(self, p: ProductPairs, X: Floats, sign: float, out: Floats) -> None:
        """out_γ += sign Σ A_δ X_β over the pairs; X (N_below, r, n), out (N_degree, r, n)."""
        for slot in range(p.slots.start, p.slots.stop):
            if slot in self.bodies:
                rows, C = self.bodies[slot]
                hit, columns = p.left == slot - p.slots.start, np.arange(X.shape[1])
                block = X[np.ix_(p.right[hit], columns, rows)]
                product = (C @ block.reshape(-1, len(rows)).T).T.reshape(block.shape)
                out[np.ix_(p.into[hit], columns, rows)] += sign * product
        begin, end = np.searchsorted(self.edge_slots, [p.slots.start, p.slots.stop])
        if begin < end:
            self._add_edges(p, slice(begin, end), X, sign, out)

    def _add_edges(
        self, p: ProductPairs, edges: slice, X: Floats, sign: float, out: Floats
    ) -> None:
        """Bᵀ (Eᵀ X) for all pairs in one product, and E (B X) likewise."""
        n, B, dofs = X.shape[2], self.B[edges], self.edge_dofs[edges]
        pair, edge = np.nonzero(p.left[:, None] == self.edge_slots[edges] - p.slots.start)
        into, right, at = p.into[pair], p.right[pair], dofs[edge]
        mixing = np.zeros((out.shape[0], out.shape[1], len(B)))
        mixing[into, :, edge] = sign * X[right, :, at]
        inner = (X.reshape(-1, n) @ B.T).reshape(X.shape[0], X.shape[1], -1)
        add_product(out.reshape(-1, n), mixing.reshape(-1, len(B)), B)
        columns = np.arange(out.shape[1])
        where = (into[:, None], columns, at[:, None])
        np.add.at(out, where, sign * inner[right[:, None], columns, edge[:, None]])


@dataclass(frozen=True, eq=False)
class SparseSeries:
    """K and M over ``space``; those of w = 0 as they are, all others by what they touch."""

    pencil: Pencil
    pairs: tuple[tuple[ProductPairs, ...], ...]
    stiffness: SparseTerms
    mass: SparseTerms
    K0: Floats  # non-zeros on the pencil's pattern
    M0: Floats
    M0_matrix: sparse.csc_array

    def convolve(self, degree: int, X: Floats, Y: Floats, out: Floats) -> None:
        """See `DenseSeries.convolve`."""
        out[...] = 0.0
        for p in self.pairs[degree]:
            self.mass.add_products(p, Y[p.below], 1.0, out)
            self.stiffness.add_products(p, X[p.below], -1.0, out)

    def mass_times(self, X: Floats) -> Floats:
        """M_0 X for rows X (k, n)."""
        return np.array([self.M0_matrix @ x for x in X])

    def factor(self, lam: float, border: Floats, phi: Floats) -> Solve:
        """The bordered system of K_0 − λ M_0."""
        return factor_sparse(self.pencil, self.K0 - lam * self.M0, border, phi)


PencilSeries = DenseSeries | SparseSeries


def _sparse_series(pencil: Pencil, theta: Floats, space: LowerSet) -> SparseSeries:
    """The coefficients over ``space`` from θ's own (n_theta, N)."""
    stored = np.flatnonzero(theta.any(axis=0))
    M0 = pencil.mass @ theta[:, 0]
    K_terms, M_terms = pencil.by_term
    return SparseSeries(
        pencil,
        pairs(space, stored.tobytes()),
        _sparse_terms(pencil, K_terms, theta[:, stored]),
        _sparse_terms(pencil, M_terms, theta[:, stored]),
        pencil.stiffness @ theta[:, 0],
        M0,
        pencil.sparse(M0),
    )


def _sparse_terms(pencil: Pencil, columns: sparse.csc_array, theta: Floats) -> SparseTerms:
    """The stored coefficients but the first, θ (n_theta, n_stored)."""
    slot, entries, values = _entries(columns, theta)
    rows, cols = pencil.rows[entries], pencil.columns[entries]
    inside = (rows < pencil.n_u) & (cols < pencil.n_u)
    bodies = _bodies(pencil.n_u, slot[inside], rows[inside], cols[inside], values[inside])
    edge = rows >= pencil.n_u
    n_q = pencil.n_dof - pencil.n_u
    key, there = slot[edge] * n_q + rows[edge] - pencil.n_u, np.zeros(theta.shape[1] * n_q, bool)
    there[key] = True
    keys, at = np.flatnonzero(there), (np.cumsum(there) - 1)[key]
    halved = np.where(cols[edge] < pencil.n_u, 1.0, 0.5) * values[edge]
    size = len(keys) * pencil.n_dof
    B = np.bincount(at * pencil.n_dof + cols[edge], halved, size).astype(np.float64, copy=False)
    dofs = pencil.n_u + keys % n_q
    return SparseTerms(bodies, keys // n_q, dofs, B.reshape(-1, pencil.n_dof))


def _entries(columns: sparse.csc_array, theta: Floats) -> tuple[Ints, Ints, Floats]:
    """Which non-zeros of the pattern each coefficient but the first has, and their values.

    Slot by slot, term by term: (n,) slots, places in the pattern, values.
    """
    slots, terms = np.nonzero(theta.T[1:])
    counts = np.diff(columns.indptr)[terms]
    ends = np.cumsum(counts)
    shift = columns.indptr[terms] - (ends - counts)
    at = np.arange(ends[-1] if len(ends) else 0) + np.repeat(shift, counts)
    values = columns.data[at] * np.repeat(theta[terms, slots + 1], counts)
    return np.repeat(slots + 1, counts), columns.indices[at].astype(np.intp), values


def _bodies(n_u: int, slot: Ints, rows: Ints, columns: Ints, values: Floats) -> dict[int, Body]:
    """The coefficients on the unknowns that they touch, by their slots (ascending)."""
    place, touched = np.empty(n_u, dtype=np.intp), np.zeros(n_u, dtype=bool)
    starts = first_of_each(slot)
    bodies: dict[int, Body] = {}
    for start, stop in itertools.pairwise([*starts.tolist(), len(slot)]):
        i, j = rows[start:stop], columns[start:stop]
        touched[i] = touched[j] = True
        at = np.flatnonzero(touched)
        place[at], touched[at] = np.arange(len(at)), False
        shape = (len(at), len(at))
        C = sparse.csr_array((values[start:stop], (place[i], place[j])), shape=shape)
        bodies[int(slot[start])] = (at, C)
    return bodies
