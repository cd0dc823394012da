r"""2m + 1: eigenvalues to order p from eigenvectors to order ⌊p/2⌋; the pencil projected.

The block Rayleigh quotient of X = Σ_{γ ∈ H} X_γ w^γ,

    N(w) = Xᵀ K X,   D(w) = Xᵀ M X,   Λ(w) = D^{−1/2} N D^{−1/2},

has the eigenvalues of the exact invariant subspace up to products of two missing vectors: exact on
Λ when no γ ∈ Λ is a sum of two members of Λ \ H.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy import sparse

from eigassign.arrays import Bools, Floats, Ints
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.series.algebra import Truncated, matrix_product, multiply, power_taylor
from eigassign.series.multi_index import LowerSet, first_of_each


def vector_members(space: LowerSet, linear: Bools) -> Bools:
    """Which γ ∈ Λ need an eigenvector coefficient; the smaller of two sufficient choices.

    Half the order always suffices. Where the set is at most linear in the ``linear`` variables, all
    members without them suffice as well: two missing ones would be quadratic in them.
    """
    half = space.degrees <= space.order // 2
    mixed = space.indices[:, linear].sum(axis=1)
    if linear.any() and mixed.max() <= 1 and (mixed == 0).sum() < half.sum():
        return np.asarray(mixed == 0)
    return np.asarray(half)


def eigenvalue_series(
    pencil: Pencil, theta: Floats, space: LowerSet, half: LowerSet, vectors: Floats
) -> Floats:
    """Λ's coefficients (r, r, N), symmetric, from X (N_H, n, r) over the set ``half``."""
    numerator, denominator = quadratics(pencil, theta, space, half, vectors)
    if len(numerator) == 1:
        inverse = Truncated(space).power(denominator[0], np.array([-1.0]))
        return multiply(space, numerator[0], inverse)[:, None]
    root = inverse_root(space, denominator)
    return matrix_product(space, root, matrix_product(space, numerator, root))


class _Products(NamedTuple):
    """Products of two vectors a ≤ b by the coefficient that they meet in."""

    a: Ints
    b: Ints
    weight: Floats  # 2 where a and b also stand for b and a
    begin: Ints
    into: Ints | slice  # positions of the results; a slice where these are all


class _Plan(NamedTuple):
    """Tables of the quotient for one pair of sets and one pattern of θ."""

    constant: _Products  # up to the order p: for K and M at w = 0
    low: int  # vectors of degree ≤ (p − 1)/2: of two that meet below p, one is among them
    varying: _Products  # below p: for the terms that vary
    left: Ints  # slots of the coefficient of θ and of the product, sorted by the result
    right: Ints
    end: Ints
    into: Ints


@lru_cache(maxsize=64)
def _plan(space: LowerSet, half: LowerSet, stored: bytes) -> _Plan:
    """``stored``: positions but the first where θ has a coefficient."""
    slot = _slots(space, space.find(half.indices))
    table, below = space.table, int(space.degree_starts[space.order])
    varying, hit = _products(space, slot, below)
    left = _slots(space, np.frombuffer(stored, dtype=np.intp))[table.left]
    right = _slots(space, hit)[table.right]
    keep = (left >= 0) & (right >= 0)
    end = first_of_each(table.target[keep])
    low = int(np.count_nonzero(half.degrees <= (space.order - 1) // 2))
    constant, _ = _products(space, slot, len(space))
    into = table.target[keep][end]
    return _Plan(constant, low, varying, left[keep], right[keep], end, into)


def _products(space: LowerSet, slot: Ints, stop: int) -> tuple[_Products, Ints]:
    """Pairs of vectors that meet in the first ``stop`` members, and in which of these."""
    table = space.table
    a, b = slot[table.left], slot[table.right]
    keep = (a >= 0) & (b >= a) & (table.target < stop)
    begin = first_of_each(table.target[keep])
    hit = table.target[keep][begin]
    weight = np.where(a[keep] == b[keep], 1.0, 2.0)
    into = slice(None) if len(hit) == len(space) else hit
    return _Products(a[keep], b[keep], weight, begin, into), hit


def _slots(space: LowerSet, positions: Ints) -> Ints:
    """Place of every member among ``positions``, -1 where it is not one of them."""
    slots = np.full(len(space), -1, dtype=np.intp)
    slots[positions] = np.arange(len(positions))
    return slots


def quadratics(
    pencil: Pencil, theta: Floats, space: LowerSet, half: LowerSet, vectors: Floats
) -> tuple[Floats, Floats]:
    """Series (r, r, N) of Xᵀ K X and Xᵀ M X: at w = 0, and Σ_j θ_j(w) Xᵀ A_j X for the rest."""
    n, r = vectors.shape[1:]
    columns = np.ascontiguousarray(vectors.transpose(1, 0, 2).reshape(n, -1))
    rows = columns.T  # products with sparse matrices run along the rows of the other
    present = theta != 0.0
    present[:, 0] = False
    stored = np.flatnonzero(present.any(axis=0))
    plan = _plan(space, half, stored.tobytes())
    constant = project_at(pencil, theta[:, :1], rows)
    out = np.zeros((2, r, r, len(space)))
    lower = [(i, j) for i in range(r) for j in range(i + 1)]
    for i, j in lower:
        out[:, i, j, plan.constant.into] = _meet(constant, plan.constant, i, j, r)
    if len(stored):
        factors, varying = theta.T[stored], np.flatnonzero(present.any(axis=1))
        for part in project_terms(pencil, rows[: plan.low * r], rows, varying):
            for i, j in lower:
                met = _weighted(factors[:, part.terms], part.values, plan.varying, i, j, r)
                sums = met[:, plan.left, plan.right]
                out[part.matrices, i, j, plan.into] += np.add.reduceat(sums, plan.end, axis=1)
    for i, j in lower:
        out[:, j, i] = out[:, i, j]
    return out[0], out[1]


def _weighted(factors: Floats, projected: Floats, p: _Products, i: int, j: int, r: int) -> Floats:
    """Σ_t factors (k, t) of what meets in the projections (…, t, l r, k r), fewer of them first."""
    if len(factors) > projected.shape[1]:
        return np.asarray(factors @ _meet(projected, p, i, j, r))
    flat = projected.reshape(*projected.shape[:2], -1)
    return _meet((factors @ flat).reshape(len(flat), -1, *projected.shape[2:]), p, i, j, r)


def _meet(projected: Floats, p: _Products, i: int, j: int, r: int) -> Floats:
    """Σ over pairs of X_a,iᵀ A X_b,j + X_b,iᵀ A X_a,j, for a stack (…, l r, k r) of projections."""
    pairs = projected[..., p.a * r + i, p.b * r + j] if r > 1 else projected[..., p.a, p.b]
    if i != j:
        pairs = 0.5 * (pairs + projected[..., p.a * r + j, p.b * r + i])
    return np.add.reduceat(pairs * p.weight, p.begin, axis=-1)


def inverse_root(space: LowerSet, D: Floats) -> Floats:
    """D^{−1/2} of a symmetric series (r, r, N) with D_0 = I, by its binomial series."""
    r = len(D)
    small = D.copy()
    small[:, :, 0] -= np.eye(r)
    taylor = power_taylor(np.ones(1), -0.5, space.order)[:, 0]
    result = np.zeros_like(D)
    result[:, :, 0] = taylor[-1] * np.eye(r)
    for coefficient in taylor[-2::-1]:
        result = matrix_product(space, result, small)
        result[:, :, 0] += coefficient * np.eye(r)
    return result


CHUNK = 4_000  # rows multiplied at once, so that the products stay in the cache
PIECE = 16_000_000  # numbers projected at once: 128 MB, not 320 at order 10 in seven variables


class ProjectedTerms(NamedTuple):
    """L A_j Rᵀ (n_matrices, n_terms, l, r) of ``terms`` j of the ``matrices``: 0 is K, 1 is M."""

    matrices: slice
    terms: Ints | slice
    values: Floats


def project(pencil: Pencil, basis: Floats) -> tuple[Floats, Floats]:
    """(n_theta, k, k) projections of the stiffness and the mass terms on ``basis`` (n_dof, k)."""
    out = np.zeros((2, pencil.n_theta, basis.shape[1], basis.shape[1]))
    for part in project_terms(pencil, basis.T, basis.T, np.arange(pencil.n_theta)):
        out[part.matrices, part.terms] = part.values
    return out[0], out[1]


def project_terms(
    pencil: Pencil, left: Floats, right: Floats, wanted: Ints
) -> Iterator[ProjectedTerms]:
    """The ``wanted`` terms of K and M projected on rows L, R (·, n_dof); small pencils' all."""
    n, stacks = pencil.n_dof, pencil.term_stacks
    step = max(PIECE // max(2 * len(left) * len(right), 1), 1)
    if stacks is None:
        W, V = np.ascontiguousarray(left.T), np.ascontiguousarray(right.T)
        for which, terms in enumerate(pencil.by_term):
            for first in range(0, len(wanted), 2 * step):
                some = wanted[first : first + 2 * step]
                yield _project(pencil, which, terms, W, V, some)
        return
    for first in range(0, pencil.n_theta, step):
        those = slice(first, first + step)
        part = stacks[:, :, those]
        full = (left @ part.reshape(n, -1)).reshape(-1, n) @ right.T
        values = full.reshape(len(left), 2, part.shape[2], len(right)).transpose(1, 2, 0, 3)
        yield ProjectedTerms(slice(0, 2), those, values)


def project_at(pencil: Pencil, theta: Floats, rows: Floats) -> Floats:
    """R K Rᵀ and R M Rᵀ at θ (n_theta, 1), (2, k, k), for rows R (k, n_dof)."""
    if pencil.is_dense:
        return np.asarray(rows @ pencil.matrices(theta)[:, 0] @ rows.T)
    V = np.ascontiguousarray(rows.T)
    out = np.zeros((2, len(rows), len(rows)))
    for square, weights in zip(out, (pencil.stiffness, pencil.mass), strict=True):
        matrix = pencil.sparse(weights @ theta[:, 0]).T
        for i in range(0, len(V), CHUNK):
            square += V[i : i + CHUNK].T @ (matrix[i : i + CHUNK] @ V)
    return out


def _project(
    pencil: Pencil, which: int, terms: sparse.csc_array, W: Floats, V: Floats, wanted: Ints
) -> ProjectedTerms:
    """Wᵀ A_j V of every wanted term that there is, over its non-zero rows only."""
    there = wanted[np.diff(terms.indptr)[wanted] > 0]
    tall, rows, bounds = _stacked(pencil, terms, there)
    out = np.zeros((1, len(there), W.shape[1], V.shape[1]))
    for i in range(0, len(rows), CHUNK):
        part = tall if len(rows) <= CHUNK else tall[i : i + CHUNK]  # slicing costs as much
        products, others = part @ W, V[rows[i : i + CHUNK]]
        first, last = np.searchsorted(bounds, [i + 1, i + len(others)], side="left") - 1
        for k in range(first, last + 1):
            a, b = max(bounds[k] - i, 0), bounds[k + 1] - i
            out[0, k] += products[a:b].T @ others[a:b]
    return ProjectedTerms(slice(which, which + 1), there, out)


def _stacked(
    pencil: Pencil, terms: sparse.csc_array, there: Ints
) -> tuple[sparse.csr_array, Ints, Ints]:
    """The non-zero rows of the terms below each other, their numbers, and where terms begin."""
    starts = np.concatenate([[0], np.cumsum(np.diff(terms.indptr)[there])])
    shift = terms.indptr[there] - starts[:-1]
    entries = np.arange(starts[-1]) + np.repeat(shift, np.diff(starts))
    row, column = pencil.rows[terms.indices[entries]], pencil.columns[terms.indices[entries]]
    new = np.ones(len(row), dtype=bool)  # entries of one term run row by row
    new[1:] = row[1:] != row[:-1]
    new[starts[:-1]] = True
    first = np.flatnonzero(new)
    shape = (len(first), pencil.n_dof)
    limits = np.append(first, len(row))
    tall = sparse.csr_array((terms.data[entries], column, limits), shape=shape)
    return tall, row[first], np.searchsorted(first, starts).astype(np.intp)
