"""Entries of K and M on their way to the pencil, by the function of (q, y) that varies them.

An affine matrix is Σ θ_j A_j with constant sparse A_j. Its entries come as (scalar) × (number) at
(row, column); a scalar is a sum c + Σ c_k a_k over atoms a_k of its recorder, and each atom that
occurs becomes one θ_j. K and M are symmetric: what is off the diagonal comes with its transpose.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.mechanism.kinematics.rotations import Objects, some
from eigassign.series.expression import Scalar, one_atom, parts

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
Row = Sequence[tuple[int, Scalar]]  # one row of a matrix: unknown and coefficient
Entries = tuple[Ints, Ints, Ints, Floats]  # row, column, atom (−1: the number 1) and value of each
# Rows, columns or the column of all, values; atom and factor of all.
Block = tuple[Ints, Ints | int, Floats, int, float]


@dataclass
class AffineEntries:
    """Collects the entries of one symmetric matrix.

    ``places`` of local dofs are their unknowns, −1 for those that are none; a row r is one over all
    unknowns, v a vector of the local dofs. What joins few unknowns, where many functions meet, is
    summed before it is split into atoms; where ``summed``, all that couples is, and not split.
    """

    summed: bool = False
    blocks: list[Block] = field(default_factory=list)
    couplings: list[Block] = field(default_factory=list)  # to one unknown, without transposes
    sums: dict[tuple[int, int], Scalar] = field(default_factory=dict)

    def add_block(self, coefficient: Scalar, matrix: sparse.csr_array, places: Ints) -> None:
        """coefficient × Pᵀ matrix P."""
        i = places[np.repeat(np.arange(len(places)), np.diff(matrix.indptr))]
        j = places[matrix.indices]
        inner = (i >= 0) & (j >= 0)
        entries = i[inner], j[inner], matrix.data[inner]
        self.blocks += [(*entries, *part) for part in parts(coefficient)]

    def add_coupling(self, coefficient: Scalar, v: Floats, places: Ints, r: Row) -> None:
        """coefficient × (Pᵀ v r + rᵀ vᵀ P)."""
        present = (places >= 0) & (v != 0.0)
        rows, values = places[present], v[present]
        if self.summed:
            self.add_product(coefficient, list(zip(rows.tolist(), values.tolist(), strict=True)), r)
            return
        for unknown, factor in r if len(rows) else ():
            self.couplings += [
                (rows, unknown, values, *part) for part in parts(coefficient * factor)
            ]

    def add_square(self, coefficient: Scalar, r: Row) -> None:
        """coefficient × rᵀ r."""
        for i, a in r if some(coefficient) else ():
            for j, b in r:
                self.add(i, j, coefficient * (a * b))

    def add_product(self, coefficient: Scalar, left: Row, right: Row) -> None:
        """coefficient × (leftᵀ right + rightᵀ left)."""
        for i, a in left if some(coefficient) else ():
            for j, b in right:
                value = coefficient * (a * b)
                self.add(i, j, value)
                self.add(j, i, value)

    def add_corner(self, first: int, block: Objects) -> None:
        """A symmetric block of scalars over the unknowns from ``first`` on."""
        for i, j in np.ndindex(block.shape):
            self.add(first + i, first + j, block[min(i, j), max(i, j)])

    def add(self, row: int, column: int, value: Scalar) -> None:
        """A single entry."""
        if some(value):
            self.sums[row, column] = self.sums.get((row, column), 0.0) + value

    def finish(self, n_u: int) -> Entries:
        """The entries; sums among the q̇ become one atom each."""
        sums = [
            (row, column, atom, factor)
            for (row, column), value in self.sums.items()
            for atom, factor in parts(
                one_atom(value) if self.summed or min(row, column) >= n_u else value
            )
        ]
        rows, columns, *what = _spread(self.couplings)
        groups = [
            list(zip(*sums, strict=True)) or [()] * 4,
            _spread(self.blocks),
            (rows, columns, *what),
            (columns, rows, *what),
        ]
        i, j, atom, value = (np.concatenate(own) for own in zip(*groups, strict=True))
        return i.astype(np.intp), j.astype(np.intp), atom.astype(np.intp), value


def _spread(blocks: Sequence[Block]) -> tuple[Any, ...]:
    """Row, column, atom and value of each entry of all blocks."""
    if not blocks:
        return ((),) * 4
    rows, columns, values, atoms, factors = zip(*blocks, strict=True)
    sizes = [len(each) for each in rows]
    column = np.concatenate(columns) if np.ndim(columns[0]) else np.repeat(columns, sizes)
    value = np.concatenate(values) * np.repeat(factors, sizes)
    return np.concatenate(rows), column, np.repeat(atoms, sizes), value


def joined(first: Entries, second: Entries) -> Entries:
    """The entries of the sum of two matrices."""
    i, j, atom, value = (np.concatenate(own) for own in zip(first, second, strict=True))
    return i, j, atom, value


def pattern(
    entries: Sequence[Entries], n_dof: int, n_theta: int
) -> tuple[Ints, Ints, list[sparse.csr_array]]:
    """Common pattern of several matrices and their weights (n_nonzeros, n_theta) on it."""
    keys = np.concatenate([rows * n_dof + columns for rows, columns, _, _ in entries])
    order = np.argsort(keys, kind="stable")  # a few ascending runs: merged
    ascending = keys[order]
    new = np.append(True, ascending[1:] != ascending[:-1])
    place = np.empty(len(keys), dtype=np.intp)
    place[order] = np.cumsum(new) - 1
    unique = ascending[new]
    ends = np.cumsum([len(rows) for rows, _, _, _ in entries])[:-1]
    weights = [
        sparse.csr_array((values, (at, theta)), shape=(len(unique), n_theta))
        for at, (_, _, theta, values) in zip(np.split(place, ends), entries, strict=True)
    ]
    return unique // n_dof, unique % n_dof, weights
