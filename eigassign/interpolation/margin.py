"""What lies next to a lower set, and how large its coefficients will be.

Along axis j coefficients fall by a factor r_j a degree, so that of a missing γ

    |c_γ| ≲ min_j max(|c_{γ−e_j}| r_j, |c_{γ−2e_j}| r_j²),

the second term being for functions that are even or odd.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
BITS = 6  # of a degree, in the key of a member
DEGREE = (1 << BITS) - 1
ANYTHING, NOTHING = -2, -1  # places of what bounds nothing, and of what is zero
SLOWEST, FASTEST = 0.9, 0.02  # rates that are believed
UNKNOWN = 0.3  # a rate that two coefficients show is at least this
IDLE = 1e-13  # relative size of coefficients on an axis that nothing depends on


def keys(members: Ints) -> Ints:
    """One number for each multi-index of at most ten variables."""
    return np.asarray(members @ (1 << (BITS * np.arange(members.shape[1]))))


def rows_of(keys: Ints, d: int) -> Ints:
    """The multi-indices (n, d) of keys."""
    return np.asarray(keys[:, None] >> (BITS * np.arange(d)) & DEGREE)


@dataclass(frozen=True, eq=False)
class Margin:
    """Where the predecessors of missing members are, all of them being there."""

    one: Ints  # (n, d): place of γ − e_j; `ANYTHING` where γ_j = 0
    two: Ints  # (n, d): place of γ − 2e_j; `NOTHING` where γ_j < 2

    def predicted(self, sizes: Floats, rates: Floats) -> Floats:
        """|c_γ| (k, n) from k times those of the members (k, N) and rates (k, d)."""
        known = np.empty((len(sizes), sizes.shape[1] + 2))
        known[:, :-2], known[:, ANYTHING], known[:, NOTHING] = sizes, np.inf, 0.0
        falling = rates[:, None]
        both = known[:, self.one] * np.maximum(falling, 1e-300), known[:, self.two] * falling**2
        return np.asarray(np.maximum(*both).min(axis=2, initial=np.inf))


class Border:
    """A lower set that grows, by the keys of its members, and what is next to them."""

    def __init__(self, tops: Sequence[int], whole: Sequence[bool]) -> None:
        """Members have γ_j ≤ tops_j; on a ``whole`` axis nothing is missing beyond."""
        d = len(tops)
        self.tops = tuple(tops)
        self.limits = tuple(top + (not all_) for top, all_ in zip(tops, whole, strict=True))
        self.places: dict[int, int] = {}  # of members
        # `Margin.one` and `.two` of keys, and of those some of whose predecessors are missing
        self.next = {0: ([ANYTHING] * d, [NOTHING] * d)}
        self.later: dict[int, tuple[list[int], list[int]]] = {}
        self.outside: set[int] = set()  # of what is next, that over a top

    def grow(self, members: Sequence[int]) -> list[int]:
        """With further members, predecessors first; returns what is new next to them."""
        fresh = []
        for key in members:
            one, _ = self.next.pop(key)
            place = self.places[key] = len(self.places)
            idle = one.count(ANYTHING)
            for j, limit in enumerate(self.limits):
                degree, after = key >> BITS * j & DEGREE, key + (1 << BITS * j)
                if degree >= limit:
                    continue
                befores = self.later.get(after)
                if befores is None:
                    d = len(self.tops)
                    befores = self.later[after] = ([ANYTHING] * d, [NOTHING] * d)
                befores[0][j], befores[1][j] = place, one[j] if degree else NOTHING
                if befores[0].count(ANYTHING) == idle - (not degree):  # none is missing
                    fresh.append(after)
                    self.next[after] = self.later.pop(after)
                    if degree == self.tops[j]:
                        self.outside.add(after)
        return fresh

    @property
    def complete(self) -> bool:
        """Whether nothing is missing: all of whole axes is there."""
        return not self.next

    def margin(self, keys: Sequence[int] | None = None) -> Margin:
        """What is next to the members, or those of ``keys`` of it."""
        chosen = self.next.values() if keys is None else [self.next[key] for key in keys]
        both = np.array(list(chosen), dtype=np.intp).reshape(-1, 2, len(self.tops))
        return Margin(both[:, 0], both[:, 1])


def rates_of(members: Ints, sizes: Floats) -> Floats:
    """`decay` of several sizes (n, N) of members (N, d) along each axis, (n, d)."""
    out = []
    for degrees in members.T:
        order = np.argsort(degrees, kind="stable")
        starts = np.searchsorted(degrees[order], np.arange(int(degrees[order[-1]]) + 1))
        layers = np.maximum.reduceat(sizes[:, order], starts, axis=1)
        out.append([decay(each) for each in layers.tolist()])
    return np.array(out).T


def decay(layers: Sequence[float]) -> float:
    """By how much the largest coefficient falls from one degree to the next; 0 if all vanish."""
    first, others = layers[0], layers[1:]
    if not others or max(others) <= IDLE * first:
        return 0.0
    if len(others) < 3:
        found = max(UNKNOWN, (max(others) / min(first, 1.0)) ** 0.5)
    else:  # of pairs, for every other one may vanish
        found = (max(others[-2:]) / max(*others[:2], 1e-300)) ** (1.0 / (len(others) - 2))
    return float(min(max(found, FASTEST), SLOWEST))
