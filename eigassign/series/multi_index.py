"""Lower sets of multi-indices and the index tables of the product of two series over them.

A set Λ is *lower* when γ ∈ Λ and δ ≤ γ (entrywise) imply δ ∈ Λ: exactly the sets over which
truncated products are well defined. Members are sorted by total degree, then lexicographically
with the first variable leading, so that all members of one degree are contiguous.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eigassign.arrays import Ints
from eigassign.brief import Brief
from eigassign.errors import UsageError
from eigassign.files import how_to_raise, raised

MAX_SIZE = 200_000  # members: 1.6 MB for each variable and each series over them
MOST_PAIRS = 10_000_000  # of coefficients that meet in a product
PAIR_BYTES = 90  # measured for 5 to 9 variables


class ProductTable(NamedTuple):
    """Pairs (left, right) with γ_left + γ_right = γ_target, sorted by target.

    ``starts[k]`` is the first pair of target k; every target has at least the pair (0, k).
    """

    left: Ints
    right: Ints
    target: Ints
    starts: Ints


class DegreePairs(NamedTuple):
    """Pairs with left ≠ 0 of all targets of one degree, ``target`` counted from its first."""

    left: Ints
    right: Ints
    target: Ints


@dataclass(frozen=True, eq=False, repr=False)
class LowerSet(Brief):
    """A lower set Λ of N multi-indices over n variables."""

    indices: NDArray[np.int64]  # (N, n)

    def __len__(self) -> int:
        return len(self.indices)

    @property
    def n_variables(self) -> int:
        """Number of variables n."""
        return int(self.indices.shape[1])

    @cached_property
    def degrees(self) -> Ints:
        """Total degree |γ| of every member, ascending."""
        return np.asarray(self.indices.sum(axis=1), dtype=np.intp)

    @cached_property
    def order(self) -> int:
        """The largest total degree in the set."""
        return int(self.degrees[-1])

    @cached_property
    def degree_starts(self) -> Ints:
        """Members of degree d are ``degree_starts[d]:degree_starts[d + 1]``."""
        return np.searchsorted(self.degrees, np.arange(self.order + 2)).astype(np.intp)

    @cached_property
    def table(self) -> ProductTable:
        """The product table, made once per set. Raises UsageError as `require_affordable` does."""
        return _product_table(self)

    def require_affordable(self) -> None:
        """Raise UsageError where so many members meet in products that memory would not suffice."""
        starts, order = self.degree_starts, self.order
        members = np.diff(starts)
        count = int(members @ starts[order + 1 : 0 : -1])
        if count > raised(MOST_PAIRS):
            size = f"about {count * PAIR_BYTES / 1e9:.2g} GB"
            raise UsageError(
                f"order {order} in {self.n_variables} variables: {len(self)} coefficients have "
                f"{count:.3g} products of two, which takes {size}: lower the order, or "
                f"{how_to_raise(count, MOST_PAIRS)}"
            )

    @cached_property
    def units(self) -> Ints:
        """Position of each variable's own index e_i, -1 for one the set leaves out."""
        return self.find(np.eye(self.n_variables, dtype=np.int64))

    @cached_property
    def by_degree(self) -> tuple[DegreePairs, ...]:
        """Pairs with left ≠ 0, degree by degree of their target."""
        table, starts = self.table, self.degree_starts
        cuts = np.searchsorted(table.target, starts)
        pairs = []
        for degree, (first, last) in enumerate(itertools.pairwise(cuts)):
            keep = np.flatnonzero(table.left[first:last] > 0) + first
            target = table.target[keep] - starts[degree]
            pairs.append(DegreePairs(table.left[keep], table.right[keep], target))
        return tuple(pairs)

    @cached_property
    def _keys(self) -> tuple[NDArray[np.uint64], NDArray[np.uint64], Ints]:
        keys = _hash(self.indices)
        order = np.argsort(keys, kind="stable")
        return keys, keys[order], order.astype(np.intp)

    def find(self, indices: NDArray[np.int64]) -> Ints:
        """Position of every row of ``indices`` (k, n) in the set, -1 where it is not a member."""
        rows = np.atleast_2d(np.asarray(indices, dtype=np.int64))
        found = self._lookup(_hash(rows))
        wrong = (self.indices[found] != rows).any(axis=1)
        return np.where(wrong, -1, found)

    def pairs(self, left: Ints, right: Ints) -> tuple[Ints, Ints, Ints]:
        """Members i of ``left`` and j of ``right`` with γ_i + γ_j = γ_k in the set, by ascending k.

        Both ascending; pairs of one k come by ascending i.
        """
        i, j = np.repeat(left, len(right)), np.tile(right, len(left))
        keys = self._keys[0]
        k = self._lookup(keys[i] + keys[j])
        member = np.flatnonzero((self.indices[k] == self.indices[i] + self.indices[j]).all(axis=1))
        member = member[np.argsort(k[member], kind="stable")]
        return i[member], j[member], k[member]

    def _lookup(self, keys: NDArray[np.uint64]) -> Ints:
        _, ordered, order = self._keys
        at = np.minimum(np.searchsorted(ordered, keys), len(self) - 1)
        return np.where(ordered[at] == keys, order[at], 0)


def first_of_each(sorted_values: Ints) -> Ints:
    """Positions where a sorted array takes a new value."""
    if not len(sorted_values):
        return sorted_values
    changes = np.empty(len(sorted_values), dtype=bool)
    changes[0] = True
    np.not_equal(sorted_values[1:], sorted_values[:-1], out=changes[1:])
    return np.flatnonzero(changes)


def _hash(indices: NDArray[np.int64]) -> NDArray[np.uint64]:
    """Additive hash: key(γ + δ) = key(γ) + key(δ) modulo 2⁶⁴, whatever the number of variables."""
    return indices.astype(np.uint64) @ _weights(indices.shape[1])


@lru_cache(maxsize=64)
def _weights(n: int) -> NDArray[np.uint64]:
    weights = np.random.default_rng(20211204).integers(1, 2**63, n, dtype=np.uint64)
    weights.setflags(write=False)
    return weights


def _product_table(space: LowerSet) -> ProductTable:
    space.require_affordable()
    starts = space.degree_starts
    parts = [
        space.pairs(
            np.arange(starts[degree], starts[degree + 1]),
            np.arange(starts[space.order - degree + 1]),
        )
        for degree in range(space.order + 1)
    ]
    left, right, target = (np.concatenate(a) for a in zip(*parts, strict=True))
    by_target = np.argsort(target, kind="stable")
    left, right, target = left[by_target], right[by_target], target[by_target]
    first = np.searchsorted(target, np.arange(len(space))).astype(np.intp)
    return ProductTable(left, right, target, first)


def lower_set(indices: NDArray[np.int64] | Sequence[Sequence[int]]) -> LowerSet:
    """A lower set from its members in any order; raises UsageError if it is not one."""
    rows = np.unique(_whole(indices), axis=0)
    if not len(rows):
        raise UsageError("a lower set holds the constant at least: one row of zeros")
    if rows.size and rows.min() < 0:
        raise UsageError("multi-indices must not be negative")
    if len(rows) > MAX_SIZE:
        raise UsageError(f"{len(rows)} multi-indices; at most {MAX_SIZE}: lower the order")
    rows = rows[np.lexsort((*(-rows.T[::-1]), rows.sum(axis=1)))]
    space = LowerSet(frozen(rows))
    for variable in range(space.n_variables):
        below = rows[rows[:, variable] > 0].copy()
        below[:, variable] -= 1
        if len(below) and (space.find(below) < 0).any():
            raise UsageError("not a lower set: an index is present whose predecessor is not")
    return space


def _whole(indices: object) -> NDArray[np.int64]:
    """(N, n) whole numbers."""
    try:
        given = np.asarray(indices, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise UsageError("multi-indices must be rows of whole numbers, all as long") from error
    rows = given if given.ndim != 1 else given.reshape(-1, max(len(given), 1))
    if rows.ndim != 2 or not (np.isfinite(rows) & (rows == np.floor(rows))).all():
        raise UsageError("multi-indices must be rows of whole numbers, all as long")
    return rows.astype(np.int64)


def frozen(a: NDArray[Any]) -> NDArray[Any]:
    """The array in C order, which cannot be written to."""
    a = np.ascontiguousarray(a)
    a.setflags(write=False)
    return a


@lru_cache(maxsize=64)
def total_degree(n: int, order: int) -> LowerSet:
    """{γ : |γ| ≤ p} over n variables: C(n + p, p) members."""
    return lower_set(_simplex(n, order))


@lru_cache(maxsize=64)
def partially_linear(n_q: int, n_y: int, order: int) -> LowerSet:
    """{(α, β) : |α| + |β| ≤ p, |β| ≤ 1}, the terms kept by eqs. (7)-(9)."""
    alpha = _simplex(n_q, order)
    constant = np.hstack([alpha, np.zeros((len(alpha), n_y), dtype=np.int64)])
    alpha = alpha[alpha.sum(axis=1) < order] if order else alpha[:0]
    unit = np.eye(n_y, dtype=np.int64)
    linear = np.hstack([np.repeat(alpha, n_y, axis=0), np.tile(unit, (len(alpha), 1))])
    return lower_set(np.vstack([constant, linear]))


@lru_cache(maxsize=64)
def on_faces(space: LowerSet, faces: bytes) -> tuple[LowerSet, Ints]:
    """The members in the variables of one face (n_faces, n) alone, and their places in the set.

    Series of functions that depend on the variables of one face each have no other coefficients.
    """
    if not space.n_variables:
        return space, np.arange(len(space))
    allowed = np.frombuffer(faces, dtype=bool).reshape(-1, space.n_variables)
    inside = ((space.indices > 0).astype(np.int64) @ ~allowed.T == 0).any(axis=1)
    where = np.flatnonzero(inside | (space.degrees == 0))
    if len(where) == len(space):
        return space, where
    return LowerSet(frozen(space.indices[where])), where


def _simplex(n: int, order: int) -> NDArray[np.int64]:
    """Multi-indices of n variables with total degree at most ``order``."""
    rows = np.zeros((1, 0), dtype=np.int64)
    for _ in range(n):
        room = order - rows.sum(axis=1)
        repeated = np.repeat(rows, room + 1, axis=0)
        last = np.concatenate([np.arange(r + 1) for r in room])
        rows = np.hstack([repeated, last[:, None]])
        if len(rows) > MAX_SIZE:
            raise UsageError(f"over {MAX_SIZE} multi-indices: lower the order or the set")
    return rows
