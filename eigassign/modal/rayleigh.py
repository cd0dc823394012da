"""2m + 1: eigenvalues to order p from eigenvectors to order ⌊p/2⌋.

The block Rayleigh quotient of X = Σ_{γ ∈ H} X_γ w^γ,

    N(w) = Xᵀ K X,   D(w) = Xᵀ M X,   Λ(w) = D^{−1/2} N D^{−1/2},

has the eigenvalues of the exact invariant subspace up to products of two missing vectors: exact on
Λ when no γ ∈ Λ is a sum of two members of Λ \\ H.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from eigassign.mechanism.pencil import Pencil
from eigassign.modal.project import project_rows
from eigassign.series.lower_set import LowerSet, first_of_each
from eigassign.series.power_series import multiply, power_taylor, reciprocal

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]


def vector_members(space: LowerSet, linear: NDArray[np.bool_]) -> NDArray[np.bool_]:
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
    r = vectors.shape[2]
    rows = vectors.transpose(0, 2, 1).reshape(-1, vectors.shape[1])
    numerator, denominator = _quadratic(space, half, theta, project_rows(pencil, rows), r)
    if r == 1:
        return multiply(space, numerator[0], reciprocal(space, denominator[0]))[:, None]
    root = inverse_root(space, denominator)
    return matrix_product(space, root, matrix_product(space, numerator, root))


@dataclass(frozen=True)
class _Pairs:
    """Index tables of the quotient: which products of two vectors meet in which coefficient."""

    a: Ints  # slots of the two vectors, sorted by the coefficient of their product
    b: Ints
    begin: Ints
    left: Ints  # slots of the coefficient of θ and of the product, sorted by the result
    right: Ints
    end: Ints
    into: Ints | slice  # which coefficients of the result these are; short of vectors, not all


@lru_cache(maxsize=64)
def _pairs(space: LowerSet, half: LowerSet, stored: bytes) -> _Pairs:
    """``stored``: positions where θ has a coefficient."""
    slot = _slots(space, space.find(half.indices))
    table = space.table
    inside = (slot[table.left] >= 0) & (slot[table.right] >= 0)
    begin = first_of_each(table.target[inside])
    left = _slots(space, np.frombuffer(stored, dtype=np.intp))[table.left]
    right = _slots(space, table.target[inside][begin])[table.right]
    keep = (left >= 0) & (right >= 0)
    end = first_of_each(table.target[keep])
    into = slice(None) if len(end) == len(space) else table.target[keep][end]
    a, b = slot[table.left[inside]], slot[table.right[inside]]
    return _Pairs(a, b, begin, left[keep], right[keep], end, into)


def _slots(space: LowerSet, positions: Ints) -> Ints:
    """For every member its place among ``positions``, -1 where it is not one of them."""
    slots = np.full(len(space), -1, dtype=np.intp)
    slots[positions] = np.arange(len(positions))
    return slots


def _quadratic(
    space: LowerSet, half: LowerSet, theta: Floats, projected: Floats, r: int
) -> tuple[Floats, Floats]:
    """Series (r, r, N) of Σ_j θ_j(w) Σ_{a,b} (X_aᵀ A_j X_b) w^{a+b} for A = K and A = M."""
    stored = np.flatnonzero(theta.any(axis=0))
    p = _pairs(space, half, stored.tobytes())
    factors = theta.T[stored]
    count = len(half)
    blocks = projected.reshape(2, len(theta), count, r, count, r)
    out = np.zeros((2, r, r, len(space)))
    for i in range(r):
        for j in range(i + 1):
            products = blocks[:, :, :, i, :, j][:, :, p.a, p.b]
            sums = np.add.reduceat(products, p.begin, axis=2)
            pairs = (factors @ sums)[:, p.left, p.right]
            out[:, i, j, p.into] = out[:, j, i, p.into] = np.add.reduceat(pairs, p.end, axis=1)
    return out[0], out[1]


def matrix_product(space: LowerSet, a: Floats, b: Floats) -> Floats:
    """Product of two series of matrices, (r, s, N) × (s, t, N) → (r, t, N)."""
    r, s, size = a.shape
    t = b.shape[1]
    left = np.broadcast_to(a[:, :, None], (r, s, t, size)).reshape(-1, size)
    right = np.broadcast_to(b[None], (r, s, t, size)).reshape(-1, size)
    products = multiply(space, left, right).reshape(r, s, t, size)
    return np.asarray(products.sum(axis=1))


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
