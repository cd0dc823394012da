"""What lies next to a lower set, and how large its coefficients will be.

Along axis j coefficients fall by a factor r_j a degree, so that of a missing γ

    |c_γ| ≲ min_j max(|c_{γ−e_j}| r_j, |c_{γ−2e_j}| r_j²),

the second term being for functions that are even or odd.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
BITS = 6  # of a degree, in the key of a member
SLOWEST, FASTEST = 0.9, 0.02  # rates that are believed
UNKNOWN = 0.3  # a rate that two coefficients show is at least this
IDLE = 1e-13  # relative size of coefficients on an axis that nothing depends on


def keys(members: Ints) -> Ints:
    """One number for each multi-index of at most ten variables."""
    return np.asarray(members @ (1 << (BITS * np.arange(members.shape[1]))))


@dataclass(frozen=True, eq=False)
class Margin:
    """Missing members (n, d) all of whose predecessors are there, and where these are."""

    rows: Ints
    one: Ints  # (n, d): place of γ − e_j; N where γ_j = 0
    two: Ints  # (n, d): place of γ − 2e_j; N + 1 where γ_j < 2

    def predicted(self, sizes: Floats, rates: Floats) -> Floats:
        """|c_γ| (n,) from those of the members (N,)."""
        known = np.concatenate([sizes, [np.inf, 0.0]])
        return np.asarray(
            np.maximum(known[self.one] * np.maximum(rates, 1e-300), known[self.two] * rates**2)
            .min(axis=1, initial=np.inf)
        )  # fmt: skip


def margin(members: Ints, tops: Ints) -> Margin:
    """The margin of a lower set (N, d) with γ_j ≤ tops_j."""
    n, d = members.shape
    if d == 1:
        rows = np.array([[n]])[: int(n <= tops[0])]
        return Margin(rows, rows - 1, np.where(rows > 1, rows - 2, n + 1))
    base = 1 << (BITS * np.arange(d))
    mine = keys(members)
    order = np.argsort(mine)
    known = mine[order]
    at, axis = np.nonzero(members < tops)
    wanted, first = np.unique(mine[at] + base[axis], return_index=True)
    place = np.minimum(np.searchsorted(known, wanted), n - 1)
    new = known[place] != wanted
    wanted, first = wanted[new], first[new]
    rows = members[at[first]]
    rows[np.arange(len(rows)), axis[first]] += 1
    back = wanted[:, None] - np.concatenate([base, 2 * base])
    place = np.minimum(np.searchsorted(known, back), n - 1)
    found = np.where(known[place] == back, order[place], -1)
    one = np.where(rows > 0, found[:, :d], n)
    two = np.where(rows > 1, found[:, d:], n + 1)
    keep = (one >= 0).all(axis=1)
    return Margin(rows[keep], one[keep], two[keep])


def rate(degrees: Ints, sizes: Floats) -> float:
    """By how much coefficients fall from one degree to the next along an axis; 0 if all vanish."""
    layers = np.zeros(int(degrees.max()) + 1)
    np.maximum.at(layers, degrees, sizes)
    return decay(layers.tolist())


def decay(layers: Sequence[float]) -> float:
    """The same of the largest coefficient of each degree."""
    first, others = layers[0], layers[1:]
    if not others or max(others) <= IDLE * first:
        return 0.0
    pairs = [max(pair) for pair in itertools.pairwise(others)] or others
    if len(pairs) == 1:
        found = max(UNKNOWN, (pairs[0] / min(first, 1.0)) ** 0.5)
    else:
        found = (pairs[-1] / pairs[0]) ** (1.0 / (len(pairs) - 1))
    return float(min(max(found, FASTEST), SLOWEST))
