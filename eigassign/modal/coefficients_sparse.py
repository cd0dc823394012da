"""Power-series coefficients of a large pencil: of each, only the unknowns that it touches.

The rows and columns of the coordinates q̇ are dense, all others have a handful of entries. So a
coefficient is A = C + E B + Bᵀ Eᵀ: C sparse on the touched elastic unknowns, B (f, n) its rows of q̇
(those among q̇ halved), E the unit vectors of q̇.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.mechanism.pencil import Pencil
from eigassign.modal.bordered import Solve
from eigassign.modal.bordered_sparse import factor_sparse
from eigassign.modal.coefficients import Pairs, pairs
from eigassign.modal.products import add_product
from eigassign.series.lower_set import LowerSet, first_of_each

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
Body = tuple[Ints, sparse.csr_array]  # touched elastic unknowns, C on them


@dataclass(frozen=True, eq=False)
class Terms:
    """The coefficients A_δ, δ ≠ 0, of one matrix, by their slot among the stored ones."""

    bodies: dict[int, Body]
    edge_slots: Ints  # ascending, of each row of B
    edge_dofs: Ints
    B: Floats  # (n_edges, n)

    def add_products(self, p: Pairs, X: Floats, sign: float, out: Floats) -> None:
        """out_γ += sign Σ A_δ X_β over the pairs; X (N_below, r, n), out (N_degree, r, n)."""
        for slot in range(p.slots.start, p.slots.stop):
            if slot in self.bodies:
                hit = p.left == slot - p.slots.start
                _add_body(self.bodies[slot], X, p.right[hit], sign, out, p.into[hit])
        begin, end = np.searchsorted(self.edge_slots, [p.slots.start, p.slots.stop])
        if begin < end:
            self._add_edges(p, slice(begin, end), X, sign, out)

    def _add_edges(self, p: Pairs, edges: slice, X: Floats, sign: float, out: Floats) -> None:
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


def _add_body(body: Body, X: Floats, right: Ints, sign: float, out: Floats, into: Ints) -> None:
    rows, C = body
    columns = np.arange(X.shape[1])
    block = X[np.ix_(right, columns, rows)]
    product = (C @ block.reshape(-1, len(rows)).T).T.reshape(block.shape)
    out[np.ix_(into, columns, rows)] += sign * product


@dataclass(frozen=True, eq=False)
class SparseSeries:
    """K and M over ``space``; those of w = 0 as they are, all others by what they touch."""

    pencil: Pencil
    pairs: tuple[tuple[Pairs, ...], ...]
    stiffness: Terms
    mass: Terms
    K0: Floats  # non-zeros on the pencil's pattern
    M0: Floats
    M0_matrix: sparse.csc_array

    def convolve(self, degree: int, X: Floats, Y: Floats, out: Floats) -> None:
        """See :class:`eigassign.modal.coefficients.PencilSeries`."""
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


def sparse_series(pencil: Pencil, theta: Floats, space: LowerSet) -> SparseSeries:
    """The coefficients over ``space`` from θ's own (n_theta, N)."""
    stored = np.flatnonzero(theta.any(axis=0))
    M0 = pencil.mass @ theta[:, 0]
    K_terms, M_terms = pencil.by_term
    return SparseSeries(
        pencil,
        pairs(space, stored.tobytes()),
        _terms(pencil, K_terms, theta[:, stored]),
        _terms(pencil, M_terms, theta[:, stored]),
        pencil.stiffness @ theta[:, 0],
        M0,
        pencil.sparse(M0),
    )


def _terms(pencil: Pencil, columns: sparse.csc_array, theta: Floats) -> Terms:
    """All but the first of the stored coefficients, θ (n_theta, n_stored)."""
    slot, entries, values = _entries(columns, theta)
    rows, cols = pencil.rows[entries], pencil.columns[entries]
    inside = (rows < pencil.n_u) & (cols < pencil.n_u)
    bodies = _bodies(pencil.n_u, slot[inside], rows[inside], cols[inside], values[inside])
    edge = rows >= pencil.n_u
    n_q = pencil.n_dof - pencil.n_u
    keys, at = _ranked(slot[edge] * n_q + rows[edge] - pencil.n_u, theta.shape[1] * n_q)
    halved = np.where(cols[edge] < pencil.n_u, 1.0, 0.5) * values[edge]
    size = len(keys) * pencil.n_dof
    B = np.bincount(at * pencil.n_dof + cols[edge], halved, size).astype(np.float64, copy=False)
    dofs = pencil.n_u + keys % n_q
    return Terms(bodies, keys // n_q, dofs, B.reshape(-1, pencil.n_dof))


def _ranked(keys: Ints, stop: int) -> tuple[Ints, Ints]:
    """The distinct keys below ``stop``, ascending, and the place of each key among them."""
    there = np.zeros(stop, dtype=bool)
    there[keys] = True
    return np.flatnonzero(there), (np.cumsum(there) - 1)[keys]


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
