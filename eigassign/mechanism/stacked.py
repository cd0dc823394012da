"""All links of a mechanism one below the other, as few sparse matrices of varying numbers.

With the local motion w = B x of all links at once,

    B = Ψ (U + N T),   m,   ω̃

hold joined nodes U, twists T spread over the nodes by N, what reduced links stand for Ψ, the masses
and the spins of the frames. Each is a fixed pattern: only its numbers change along a motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.mechanism.assembly import LocalLink
from eigassign.mechanism.convection import Riding
from eigassign.mechanism.mesh import DOFS, Term

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
Matrix = Any  # sparse, or dense where that is quicker
SMALL = 128  # rows and columns up to which it is
CROSS = ((0, 1, 2, -1.0), (0, 2, 1, 1.0), (1, 0, 2, 1.0), (1, 2, 0, -1.0), (2, 0, 1, -1.0),
         (2, 1, 0, 1.0))  # fmt: skip
"""Entries (i, j) of ω̃: which component of ω, and its sign."""


@dataclass(frozen=True, eq=False)
class Pattern:
    """A sparse matrix whose entries are sums of constants times scalars."""

    values: Floats  # (n,) constants
    scalars: Ints  # (n,) which scalar each is multiplied by; the last one for none
    slots: Ints  # (n,) which entry each adds to
    places: Ints  # row and column of each entry as one number, ascending
    shape: tuple[int, int]

    def at(self, z: Floats) -> Matrix:
        """The matrix for scalars z."""
        data = np.bincount(self.slots, self.values * z[self.scalars], len(self.places))
        if max(self.shape) <= SMALL:
            out = np.zeros(self.shape)
            out.flat[self.places] = data
            return out
        return sparse.csr_array((data, *self._compressed), shape=self.shape)

    @cached_property
    def _compressed(self) -> tuple[Ints, Ints]:
        """Columns of the entries, and where each row starts."""
        rows, width = self.shape
        return self.places % width, np.searchsorted(self.places, np.arange(rows + 1) * width)


@dataclass
class _Gathered:
    """Parts of entries on their way to a `Pattern`."""

    parts: list[tuple[Ints, Ints, Floats, Ints]] = field(default_factory=list)

    def add(self, rows: Any, columns: Any, values: Any, scalars: Any) -> None:
        """Entries values × scalars at (rows, columns), broadcast."""
        r, c, v, s = np.broadcast_arrays(rows, columns, values, scalars)
        self.parts.append((_whole(r), _whole(c), np.asarray(v, dtype=np.float64), _whole(s)))

    def add_terms(self, terms: Sequence[Term], first: int, row: int, column: int) -> None:
        """Σ scalar × matrix with its corner at (row, column), scalars counted from ``first``."""
        for k, term in enumerate(terms):
            entries = term.matrix.tocoo()
            self.add(entries.row + row, entries.col + column, entries.data, first + k)

    def pattern(self, shape: tuple[int, int]) -> Pattern:
        empty = (np.zeros(0, np.intp),) * 2 + (np.zeros(0), np.zeros(0, np.intp))
        rows, columns, values, scalars = (
            np.concatenate(each) for each in zip(*(self.parts or [empty]), strict=True)
        )
        places, slots = np.unique(rows * shape[1] + columns, return_inverse=True)
        return Pattern(values, scalars, slots, places, shape)


@dataclass(frozen=True)
class Rows:
    """Which rows of a table of scalars are a link's: see `velocity.velocity_terms`."""

    spin: slice
    carries: slice
    twist: slice
    rigid: slice
    mass: slice
    mesh: slice


@dataclass(frozen=True, eq=False)
class Rider:
    """A beam that something rides on: its first row among all, and its scalars."""

    riding: Riding
    first: int
    rows: slice


@dataclass(frozen=True, eq=False)
class StackedLinks:
    """All links with mass; z are the values of a table of scalars, followed by a 1."""

    joined: Pattern  # U (n_local, n_dof)
    spread: Pattern  # N (n_local, Σ n_twist)
    twist: Pattern  # T (Σ n_twist, n_dof)
    basis: sparse.csr_array | None  # Ψ (n_whole, n_local); None where no link is reduced
    masses: Pattern  # m (n_whole, n_whole)
    spins: Pattern  # ω per rate of every coordinate, (3 n_links, n_coordinates)
    turns: Pattern  # ω̃ (n_whole, n_whole) of ω
    riders: tuple[Rider, ...]

    def motion(self, z: Floats) -> Matrix:
        """B (n_whole, n_dof)."""
        B = self.joined.at(z) + self.spread.at(z) @ self.twist.at(z)
        return B if self.basis is None else self.basis @ B

    def mass(self, z: Floats) -> Matrix:
        """m (n_whole, n_whole)."""
        return self.masses.at(z)

    def spin(self, z: Floats, rate: Floats) -> Matrix:
        """ω̃ on the translations and rotations of every node, in its link's axes."""
        return self.turns.at(self.spins.at(z) @ rate)

    def convection(self, values: Floats, step: float) -> tuple[sparse.csr_array, sparse.csr_array]:
        """G and H (n_whole, n_whole) at the middle of three instants."""
        shape = self.masses.shape
        G, H = sparse.csr_array(shape), sparse.csr_array(shape)
        for rider in self.riders:
            found = rider.riding.at([z[rider.rows] for z in values], step)
            g, h = (_placed(each, rider.first, shape) for each in found)
            G, H = G + g, H + h
        return G, H


def _whole(numbers: Any) -> Ints:
    return np.asarray(numbers, dtype=np.intp)


def _placed(block: sparse.csr_array, first: int, shape: tuple[int, int]) -> sparse.csr_array:
    entries = block.tocoo()
    where = (entries.row + first, entries.col + first)
    return sparse.csr_array((entries.data, where), shape=shape)


def whole_mass(link: LocalLink) -> Sequence[Term]:
    """The mass terms of a link with all its dofs."""
    return link.mass if link.reduction is None else link.reduction.mesh.mass


def stack(
    links: Sequence[LocalLink],
    rows: Sequence[Rows],
    ridings: Sequence[Riding | None],
    space: str,
    n_u: int,
    n_dof: int,
) -> StackedLinks:
    """Those of the links that have mass; ``rows`` are where each has its scalars."""
    joined, spread, twist, masses, spins, turns = (_Gathered() for _ in range(6))
    riders, bases = [], []
    local = whole = turned = spun = 0
    for link, own, riding in zip(links, rows, ridings, strict=True):
        mass = whole_mass(link)
        if not mass:  # a rigid link without mass
            continue
        _add_joined(joined, link, own, local)
        spread.add_terms(link.rigid, own.rigid.start, local, turned)
        _add_dense(twist, own.twist, link.twist.shape, turned, n_u)
        masses.add_terms(mass, own.mass.start, whole, whole)
        n = mass[0].matrix.shape[0]
        _add_dense(spins, own.spin, (3, (own.spin.stop - own.spin.start) // 3), spun, 0)
        _add_turns(turns, space, n, whole, spun)
        if riding is not None:
            riders.append(Rider(riding, whole, own.mesh))
        bases.append(sparse.eye_array(n) if link.reduction is None else link.reduction.basis)
        local, whole = local + len(link.own), whole + n
        turned, spun = turned + link.twist.shape[0], spun + 3
    return StackedLinks(
        joined.pattern((local, n_dof)),
        spread.pattern((local, turned)),
        twist.pattern((turned, n_dof)),
        sparse.csr_array(sparse.block_diag(bases)) if local != whole else None,
        masses.pattern((whole, whole)),
        spins.pattern((spun, (rows[0].spin.stop - rows[0].spin.start) // 3)),
        turns.pattern((whole, whole)),
        tuple(riders),
    )


def _add_joined(out: _Gathered, link: LocalLink, rows: Rows, first: int) -> None:
    own = np.flatnonzero(link.own >= 0)
    out.add(first + own, link.own[own], 1.0, -1)
    carried = ((slot, unknown) for slot, pairs in link.carried.items() for unknown, _ in pairs)
    for k, (slot, unknown) in enumerate(carried):
        out.add(np.array([first + slot]), unknown, 1.0, rows.carries.start + k)


def _add_dense(
    out: _Gathered, scalars: slice, shape: tuple[int, ...], row: int, column: int
) -> None:
    """A full block whose entries are scalars, row by row."""
    i, j = np.indices(shape)
    out.add((row + i).ravel(), (column + j).ravel(), 1.0, np.arange(scalars.start, scalars.stop))


def _add_turns(out: _Gathered, space: str, n: int, first: int, spin: int) -> None:
    """ω̃ at every node of a link with n dofs, for translations and rotations alike."""
    kept = DOFS[space]
    nodes = first + len(kept) * np.arange(n // len(kept))
    for half in (0, 3):
        for i, j, component, sign in CROSS:
            if half + i in kept and half + j in kept:
                r, c = kept.index(half + i), kept.index(half + j)
                out.add(nodes + r, nodes + c, sign, spin + component)
