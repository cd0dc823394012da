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
from eigassign.modal.project import project
from eigassign.series.lower_set import LowerSet, first_of_each
from eigassign.series.power_series import compose, multiply, power_taylor

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
    n_h, n, r = vectors.shape
    basis = vectors.transpose(1, 0, 2).reshape(n, n_h * r)
    stiffness, mass = project(pencil, basis)
    numerator = _quadratic(space, half, theta, stiffness)
    denominator = _quadratic(space, half, theta, mass)
    if r == 1:
        inverse = compose(
            space, power_taylor(denominator[0, :, 0], -1.0, space.order), denominator[0]
        )
        return multiply(space, numerator[0], inverse)[:, None]
    root = inverse_root(space, denominator)
    return matrix_product(space, root, matrix_product(space, numerator, root))


@dataclass(frozen=True)
class _Pairs:
    """Index tables of the quotient: which products of two vectors meet in which coefficient."""

    a: Ints  # slots of the two vectors, sorted by the coefficient of their product
    b: Ints
    begin: Ints
    left: Ints  # coefficient of θ, slot of the product, sorted by the coefficient of the result
    right: Ints
    end: Ints


@lru_cache(maxsize=64)
def _pairs(space: LowerSet, half: LowerSet) -> _Pairs:
    members = space.find(half.indices)
    slot = np.full(len(space), -1, dtype=np.intp)
    slot[members] = np.arange(len(members))
    table = space.table
    inside = (slot[table.left] >= 0) & (slot[table.right] >= 0)
    begin = first_of_each(table.target[inside])
    hit = table.target[inside][begin]
    where = np.full(len(space), -1, dtype=np.intp)
    where[hit] = np.arange(len(hit))
    right = where[table.right]
    keep = right >= 0
    end = first_of_each(table.target[keep])  # every coefficient: (k, 0) is always kept
    a, b = slot[table.left[inside]], slot[table.right[inside]]
    return _Pairs(a, b, begin, table.left[keep], right[keep], end)


def _quadratic(space: LowerSet, half: LowerSet, theta: Floats, projected: Floats) -> Floats:
    """Series (r, r, N) of Σ_j θ_j(w) Σ_{a,b} (X_aᵀ A_j X_b) w^{a+b}."""
    p, count = _pairs(space, half), len(half)
    r = projected.shape[1] // count
    blocks = projected.reshape(len(theta), count, r, count, r)
    products = blocks[:, p.a, :, p.b, :]  # (pairs, n_theta, r, r)
    sums = np.add.reduceat(products, p.begin, axis=0)
    hits = len(p.begin)
    flat = sums.transpose(1, 0, 2, 3).reshape(len(theta), -1)
    outer = (theta.T @ flat).reshape(len(space), hits, r, r)
    values = outer[p.left, p.right]
    return np.asarray(np.add.reduceat(values, p.end, axis=0).transpose(1, 2, 0))


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
