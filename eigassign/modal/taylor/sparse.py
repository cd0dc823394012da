"""Power-series coefficients of a large pencil: of each, only the unknowns that it touches.

The rows and columns of the coordinates q̇ are dense, all others have a handful of entries. So a
coefficient is A = C + E B + Bᵀ Eᵀ: C sparse on the touched elastic unknowns, B (f, n) its rows of q̇
(those among q̇ halved), E the unit vectors of q̇.

The bordered system of a large pencil: one sparse factorisation, everything dense kept out of it.

With u the elastic unknowns, A_uu = K_uu − λ M_uu is sparse, but the rows of the coordinates q̇ and
the border −M0 Φ0 are dense, and A_uu may be singular. So it is pinned, A' = A_uu + Σ τ_k e_k e_kᵀ,
at r unknowns where the modes have most energy, which is undone by r more unknowns t_k = e_kᵀ u:

    ⎡ A'   W ⎤ ⎡ u ⎤   ⎡ g_u ⎤          W = [A_uF, −b_u, −τ e_k],   s = (q̇, Λ_γ, t)
    ⎣ Wᵀ   D ⎦ ⎣ s ⎦ = ⎣ g_s ⎦ ,

solved by the small dense S = D − Wᵀ A'⁻¹ W. Fill-in is that of K alone.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import lapack
from scipy.sparse import linalg

from eigassign.errors import AccuracyError
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.modal.exact.sparse import block, factorise, principal
from eigassign.modal.taylor.bordered import Solve, add_product
from eigassign.modal.taylor.coefficients import Pairs, pairs
from eigassign.series.multi_index import LowerSet, first_of_each

# --- Power-series coefficients of a large pencil: of each, only the unknowns that it touches

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
        """See :class:`eigassign.modal.taylor.coefficients.PencilSeries`."""
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


# --- The bordered system of a large pencil: one sparse factorisation, everything dense kept out

RESIDUAL = 1e-9  # of a trial solve, relative to |A| |x|, above which the pivots are not trusted


def factor_sparse(pencil: Pencil, data: Floats, border: Floats, phi: Floats) -> Solve:
    """Solver for [[A, −Bᵀ], [−B, 0]], A from its non-zeros ``data``, B = ``border`` (r, n).

    ``phi`` (r, n) are the modes. Rows (k, n) → x (k, n), l (k, r). Raises AccuracyError where the
    system is singular: the border misses a mode with the same λ.
    """
    A = pencil.sparse(data)
    solve = _solver(pencil, data, border, _pins(pencil, data, phi), factorise)
    if _trial(A, border, solve) > RESIDUAL:
        solve = _solver(pencil, data, border, _pins(pencil, data, phi), _pivoted)
        if not _trial(A, border, solve) < RESIDUAL:
            raise AccuracyError("the bordered system is singular: a mode of the cluster is missing")
    return solve


def _pivoted(matrix: sparse.csc_array) -> linalg.SuperLU:
    return linalg.splu(matrix, permc_spec="COLAMD")


def _pins(pencil: Pencil, data: Floats, phi: Floats) -> Ints:
    """One unknown a mode, where it has most energy, by elimination so that they are independent."""
    diagonal = np.zeros(pencil.n_dof)
    on = pencil.rows == pencil.columns
    diagonal[pencil.rows[on]] = np.abs(data[on])
    left = (phi * np.sqrt(diagonal))[:, : pencil.n_u]
    pins = []
    for _ in phi:
        mode, k = np.unravel_index(np.abs(left).argmax(), left.shape)
        pins.append(int(k))
        left = left - np.outer(left[:, k] / left[mode, k], left[mode])
    return np.array(pins, dtype=np.intp)


@dataclass(frozen=True, eq=False)
class _Bordered:
    """A' factored, W's rows, A'⁻¹ W's rows, and S factored."""

    factor: linalg.SuperLU
    W: Floats  # (m, n_u)
    Z: Floats  # (m, n_u)
    S: tuple[Floats, Ints]
    n_rigid: int
    border_scale: float
    r: int

    def __call__(self, rows: Floats) -> tuple[Floats, Floats]:
        """x (k, n) and l (k, r) for rows (k, n)."""
        n_u = self.W.shape[1]
        v = self.factor.solve(rows[:, :n_u].T).T
        small = -(v @ self.W.T)
        small[:, : self.n_rigid] += rows[:, n_u:]
        s = lapack.dgetrs(*self.S, small.T)[0].T
        x = np.empty_like(rows)
        np.subtract(v, s @ self.Z, out=x[:, :n_u])
        x[:, n_u:] = s[:, : self.n_rigid]
        l = s[:, self.n_rigid : self.n_rigid + self.r]  # noqa: E741
        return x, self.border_scale * l


def _trial(A: sparse.csc_array, border: Floats, solve: Solve) -> float:
    """Residual of one solve with a right-hand side of no special direction."""
    row = np.random.default_rng(0).standard_normal(border.shape[1]) * np.sqrt(A.diagonal().max())
    x, values = solve(row[None])
    rest = A @ x[0] - values[0] @ border - row
    size = abs(A) @ np.abs(x[0]) + np.abs(values[0]) @ np.abs(border) + np.abs(row)
    return float(np.abs(rest).max() / np.abs(size).max())


def _solver(
    pencil: Pencil,
    data: Floats,
    border: Floats,
    pins: Ints,
    factorise: Callable[[sparse.csc_array], linalg.SuperLU],
) -> _Bordered:
    n_u, n = pencil.n_u, pencil.n_dof
    f, r = n - n_u, len(border)
    A = principal(pencil, data, np.arange(n_u))
    tau = np.abs(A.diagonal()[pins])
    scale = float(np.abs(data).max() / np.abs(border).max())
    W = np.zeros((f + 2 * r, n_u))
    edge = block(pencil, data, np.arange(n_u, n))
    W[:f] = edge[:, :n_u]
    W[f : f + r] = -scale * border[:, :n_u]
    W[np.arange(f + r, f + 2 * r), pins] = -tau
    D = np.zeros((f + 2 * r, f + 2 * r))
    D[:f, :f] = edge[:, n_u:]
    D[f : f + r, :f] = -scale * border[:, n_u:]
    D[:f, f : f + r] = D[f : f + r, :f].T
    D[np.arange(f + r, f + 2 * r), np.arange(f + r, f + 2 * r)] = tau
    pinned = A + sparse.csc_array((tau, (pins, pins)), shape=A.shape)
    factor = factorise(pinned)
    Z = factor.solve(W.T).T
    lu, pivots, info = lapack.dgetrf(D - W @ Z.T)
    if info:
        raise AccuracyError("the bordered system is singular: a mode of the cluster is missing")
    return _Bordered(factor, W, Z, (lu, pivots), f, scale, r)
