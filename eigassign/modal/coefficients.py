"""Power-series coefficients K_γ, M_γ of the pencil, and what the recursion asks of them.

Vectors stand in rows: X (N, r, n) holds r vectors of length n for every multi-index, contiguous, so
that products and solves run over memory in order. Small pencils keep one dense stack of all
coefficients; large ones only what each coefficient touches (``coefficients_sparse``).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from eigassign.mechanism.pencil import Pencil
from eigassign.modal.bordered import Solve, factor_dense
from eigassign.modal.sizes import DENSE_LIMIT
from eigassign.series.lower_set import LowerSet, first_of_each

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]


class PencilSeries(Protocol):
    """K(w) = Σ_γ K_γ w^γ and M(w) likewise, over one lower set."""

    def convolve(self, degree: int, X: Floats, Y: Floats, out: Floats) -> None:
        """out_γ = Σ_{0<δ≤γ} M_δ Y_{γ−δ} − K_δ X_{γ−δ} for |γ| = degree; out (N_degree, r, n)."""

    def mass_times(self, X: Floats) -> Floats:
        """M_0 X for rows X (k, n)."""

    def factor(self, lam: float, border: Floats, phi: Floats) -> Solve:
        """The bordered system of K_0 − λ M_0, ``border`` M_0 Φ_0 and Φ_0 as rows (r, n)."""


@dataclass(frozen=True)
class Pairs:
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
def pairs(space: LowerSet, stored: bytes) -> tuple[tuple[Pairs, ...], ...]:
    """For every degree the pairs with δ among the ``stored`` positions, by ascending |δ|."""
    present = np.frombuffer(stored, dtype=np.intp)
    slot = np.full(len(space), -1, dtype=np.intp)
    slot[present] = np.arange(len(present))
    degrees = range(space.order + 1)
    return tuple(
        tuple(p for e in range(1, d + 1) if len((p := _pairs(space, slot, d, e)).left))
        for d in degrees
    )


def _pairs(space: LowerSet, slot: Ints, degree: int, of_delta: int) -> Pairs:
    table, starts = space.by_degree[degree], space.degree_starts
    keep = (slot[table.left] >= 0) & (space.degrees[table.left] == of_delta)
    stored = slot[table.left[keep]]
    target = table.target[keep]
    first = first_of_each(target)
    low = int(stored.min(initial=len(space)))
    below = slice(int(starts[degree - of_delta]), int(starts[degree - of_delta + 1]))
    return Pairs(
        slice(low, int(stored.max(initial=-1)) + 1),
        below,
        stored - low,
        table.right[keep] - below.start,
        target,
        first,
        target[first],
    )


@dataclass(frozen=True, eq=False)
class DenseSeries:
    """All coefficients that are not zero in two dense stacks; the first is that of w = 0."""

    pairs: tuple[tuple[Pairs, ...], ...]
    stiffness: Floats  # (n_stored, n, n)
    mass: Floats

    def convolve(self, degree: int, X: Floats, Y: Floats, out: Floats) -> None:
        """See :class:`PencilSeries`; the coefficients are symmetric, so rows multiply from left."""
        out[...] = 0.0
        for p in self.pairs[degree]:
            count, r, n = Y[p.below].shape
            x, y = X[p.below].reshape(-1, n), Y[p.below].reshape(-1, n)
            products = y @ self.mass[p.slots]
            products -= x @ self.stiffness[p.slots]
            chosen = products.reshape(-1, count, r, n)[p.left, p.right]
            out[p.target] += np.add.reduceat(chosen, p.first, axis=0)

    def mass_times(self, X: Floats) -> Floats:
        """M_0 X for rows X (k, n)."""
        return np.asarray(X @ self.mass[0])

    def factor(self, lam: float, border: Floats, phi: Floats) -> Solve:
        """The bordered system of K_0 − λ M_0."""
        return factor_dense(self.stiffness[0] - lam * self.mass[0], border)


def pencil_series(pencil: Pencil, theta: Floats, space: LowerSet) -> PencilSeries:
    """The pencil's coefficients over ``space`` from θ's own (n_theta, N)."""
    if pencil.n_dof > DENSE_LIMIT:
        from eigassign.modal.coefficients_sparse import sparse_series

        return sparse_series(pencil, theta, space)
    stored = np.flatnonzero(theta.any(axis=0))  # θ_0 = 1: position 0 is always there
    K, M = pencil.matrices(theta[:, stored])
    return DenseSeries(pairs(space, stored.tobytes()), K, M)
