"""The pencil's power series, and the bordered system of eqs. (4)–(6) for every eigenvector.

    ⎡ K0 − λ0 M0   −M0 Φ0 ⎤ ⎡ φ_γ ⎤   ⎡ rhs_γ ⎤
    ⎣ −Φ0ᵀ M0        0    ⎦ ⎣ λ_γ ⎦ = ⎣   0   ⎦

Symmetric and regular although K0 − λ0 M0 is singular; it replaces the paper's pseudo-inverse. The
border is scaled to the size of the stiffness so that pivoting does not mix units.

A large pencil has one sparse factorisation, and everything dense is kept out of it. With u the
elastic unknowns, A_uu = K_uu − λ M_uu is sparse, but the rows of the coordinates q̇ and the border
−M0 Φ0 are dense, and A_uu may be singular. So it is pinned, A' = A_uu + Σ τ_k e_k e_kᵀ, at r
unknowns where the modes have most energy, which is undone by r more unknowns t_k = e_kᵀ u:

    ⎡ A'   W ⎤ ⎡ u ⎤   ⎡ g_u ⎤          W = [A_uF, −b_u, −τ e_k],   s = (q̇, Λ_γ, t)
    ⎣ Wᵀ   D ⎦ ⎣ s ⎦ = ⎣ g_s ⎦ ,

solved by the small dense S = D − Wᵀ A'⁻¹ W. Fill-in is that of K alone.

Vectors stand in rows: X (N, r, n) holds r vectors of length n for every multi-index, contiguous, so
that products and solves run over memory in order. Small pencils keep one dense stack of all
coefficients, large ones a sparse matrix of each.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.linalg import blas, lapack
from scipy.sparse import linalg

from eigassign.arrays import Bools, Floats, Ints
from eigassign.errors import AccuracyError
from eigassign.mechanism.assembly.pencil import Pencil, block, principal
from eigassign.mechanism.elements.craig_bampton import factorise, lu
from eigassign.series.multi_index import LowerSet, first_of_each

Solve = Callable[[Floats], tuple[Floats, Floats]]
Factorise = Callable[[sparse.csc_array], linalg.SuperLU]
SINGULAR = "the bordered system is singular: a mode of the cluster is missing"
RESIDUAL = 1e-9  # of a trial solve, relative to |A| |x|, above which the pivots are not trusted


def factor_dense(A: Floats, border: Floats) -> Solve:
    """Solver for [[A, −Bᵀ], [−B, 0]], B = ``border`` (r, n): rows (k, n) → x (k, n), l (k, r).

    Raises AccuracyError where the system is singular: the border misses a mode with the same λ.
    """
    r, n = border.shape
    scale = float((np.abs(A).max() or 1.0) / np.abs(border).max())  # A = 0 of a model of one mode
    full = np.zeros((n + r, n + r))
    full[:n, :n] = A
    full[n:, :n] = border
    full[n:] *= -scale
    full[:n, n:] = full[n:, :n].T
    lu, pivots, info = lapack.dgetrf(full.T, overwrite_a=1)
    if info:
        raise AccuracyError(SINGULAR)

    def solve(rows: Floats) -> tuple[Floats, Floats]:
        padded = np.zeros((len(rows), n + r))
        padded[:, :n] = rows
        solution = lapack.dgetrs(lu, pivots, padded.T, overwrite_b=1)[0].T
        return solution[:, :n], scale * solution[:, n:]

    return solve


def factor_sparse(
    pencil: Pencil,
    data: Floats,
    border: Floats,
    phi: Floats,
    factorisations: Sequence[Factorise] = (factorise, partial(lu, permc_spec="COLAMD")),
) -> Solve:
    """Solver for [[A, −Bᵀ], [−B, 0]], A from its non-zeros ``data``, B = ``border`` (r, n).

    ``phi`` (r, n) are the modes; the first of ``factorisations`` whose pivots can be trusted is
    taken, the last without regard to symmetry: more fill-in, and safe. Rows (k, n) → x (k, n),
    l (k, r). Raises AccuracyError where the system is singular: the border misses a mode with the
    same λ.
    """
    A, pins = pencil.sparse(data), _pins(pencil, data, phi)
    for factorisation in factorisations:
        solve = _solver(pencil, data, border, pins, factorisation)
        if _trial(A, border, solve) <= RESIDUAL:
            return solve
    raise AccuracyError(SINGULAR)


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


def _trial(A: sparse.csc_array, border: Floats, solve: Solve) -> float:
    """Residual of one solve with a right-hand side of no special direction."""
    row = np.random.default_rng(0).standard_normal(border.shape[1]) * np.sqrt(A.diagonal().max())
    x, values = solve(row[None])
    rest = A @ x[0] - values[0] @ border - row
    size = abs(A) @ np.abs(x[0]) + np.abs(values[0]) @ np.abs(border) + np.abs(row)
    return float(np.abs(rest).max() / np.abs(size).max())


def _solver(
    pencil: Pencil, data: Floats, border: Floats, pins: Ints, factorise: Factorise
) -> Solve:
    """A' factored by ``factorise``, with W's rows, Z = A'⁻¹ W's rows, and S factored."""
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
    factor = factorise(A + sparse.csc_array((tau, (pins, pins)), shape=A.shape))
    Z = factor.solve(W.T).T
    lu, pivots, info = lapack.dgetrf(D - W @ Z.T)
    if info:
        raise AccuracyError(SINGULAR)

    def solve(rows: Floats) -> tuple[Floats, Floats]:
        v = factor.solve(rows[:, :n_u].T).T
        small = -(v @ W.T)
        small[:, :f] += rows[:, n_u:]
        s = lapack.dgetrs(lu, pivots, small.T)[0].T
        x = np.empty_like(rows)
        np.subtract(v, s @ Z, out=x[:, :n_u])
        x[:, n_u:] = s[:, :f]
        return x, scale * s[:, f : f + r]

    return solve


def add_product(out: Floats, A: Floats, B: Floats) -> None:
    """out += A B for C-ordered out (m, n), A (m, k), B (k, n)."""
    result = blas.dgemm(1.0, B.T, A.T, 1.0, out.T, overwrite_c=1)
    if not np.may_share_memory(result, out):  # out was not contiguous
        out[...] = result.T


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


class ProductPairs(NamedTuple):
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


def _dense(space: LowerSet, stored: Ints, stack: Floats, varying: Bools) -> DenseTerms:
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
