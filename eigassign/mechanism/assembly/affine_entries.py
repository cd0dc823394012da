"""Entries of K and M on their way to the pencil, by the function of (q, y) that varies them.

An affine matrix is Σ θ_j A_j with constant sparse A_j. Its entries come as (scalar) × (number) at
(row, column); a scalar is a sum c + Σ c_k a_k over atoms a_k of its recorder, and each atom that
occurs becomes one θ_j.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.series.expression import Expression, Scalar

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]


@dataclass
class AffineEntries:
    """Collects entries (row, column, atom) → value; atom -1 stands for the constant 1."""

    rows: list[Ints] = field(default_factory=list)
    columns: list[Ints] = field(default_factory=list)
    atoms: list[Ints] = field(default_factory=list)
    values: list[Floats] = field(default_factory=list)
    small: dict[tuple[int, int], Scalar] = field(default_factory=dict)

    def add(
        self, coefficients: Sequence[Scalar], rows: Ints, columns: Ints, values: Floats
    ) -> None:
        """coefficients[k] × values (m,) at row k of places (k, m), for copies of one block."""
        parts = [
            (k, atom, factor)
            for k, coefficient in enumerate(coefficients)
            for atom, factor in _parts(coefficient)
            if factor != 0.0
        ]
        if len(parts) == 1:
            ((k, atom, factor),) = parts
            self.rows.append(rows[k])
            self.columns.append(columns[k])
            self.atoms.append(np.full(len(values), atom, dtype=np.intp))
            self.values.append(values if factor == 1.0 else factor * values)
        elif parts and len(values):
            which, atoms, factors = (np.array(part) for part in zip(*parts, strict=True))
            self.rows.append(rows[which].ravel())
            self.columns.append(columns[which].ravel())
            self.atoms.append(np.repeat(atoms, len(values)))
            self.values.append(np.multiply.outer(factors, values).ravel())

    def add_symmetric(
        self, coefficients: Sequence[Scalar], rows: Ints, column: Ints, values: Floats
    ) -> None:
        """One column (k,) of each copy and its transpose, off the diagonal blocks."""
        columns = np.broadcast_to(column[:, None], rows.shape)
        self.add(coefficients, rows, columns, values)
        self.add(coefficients, columns, rows, values)

    def add_small(self, row: int, column: int, value: Scalar) -> None:
        """An entry among joint nodes and q̇, where many functions meet: summed before use."""
        if not isinstance(value, Expression) and value == 0.0:
            return
        self.small[row, column] = self.small.get((row, column), 0.0) + value

    def finish(self, n_u: int) -> tuple[Ints, Ints, Ints, Floats]:
        """All entries as arrays; q̇-q̇ entries become one atom each."""
        small = [
            (row, column, atom, factor)
            for (row, column), value in self.small.items()
            for atom, factor in _parts(_whole(value) if min(row, column) >= n_u else value)
            if factor != 0.0
        ]
        rows, columns, atoms, values = zip(*small, strict=True) if small else ((), (), (), ())
        return (
            np.concatenate([*self.rows, np.array(rows, dtype=np.intp)]),
            np.concatenate([*self.columns, np.array(columns, dtype=np.intp)]),
            np.concatenate([*self.atoms, np.array(atoms, dtype=np.intp)]),
            np.concatenate([*self.values, np.array(values, dtype=np.float64)]),
        )


def _whole(value: Scalar) -> Scalar:
    """A sum as one atom."""
    if not isinstance(value, Expression):
        return value
    factor, atom = value.single()
    return Expression(value.recorder, 0.0, {atom: factor})


def _parts(coefficient: Scalar) -> list[tuple[int, float]]:
    if not isinstance(coefficient, Expression):
        return [(-1, float(coefficient))]
    return [(-1, coefficient.constant), *coefficient.terms.items()]


def pattern(
    entries: Sequence[tuple[Ints, Ints, Ints, Floats]], n_dof: int, n_theta: int
) -> tuple[Ints, Ints, list[sparse.csr_array]]:
    """Common pattern of several matrices and their weights (n_nonzeros, n_theta) on it."""
    keys = np.concatenate([rows * n_dof + columns for rows, columns, _, _ in entries])
    unique, place = _ranked(keys)
    shape = (len(unique), n_theta)
    ends = np.cumsum([len(rows) for rows, _, _, _ in entries])[:-1]
    weights = [
        sparse.csr_array((values, (at, theta)), shape=shape)
        for at, (_, _, theta, values) in zip(np.split(place, ends), entries, strict=True)
    ]
    return (unique // n_dof).astype(np.intp), (unique % n_dof).astype(np.intp), weights


def _ranked(keys: Ints) -> tuple[Ints, Ints]:
    """The distinct keys, ascending, and the place of each key among them: one sort for both."""
    order = np.argsort(keys, kind="stable")  # a few ascending runs: merged
    ascending = keys[order]
    new = np.ones(len(keys), dtype=bool)
    new[1:] = ascending[1:] != ascending[:-1]
    place = np.empty(len(keys), dtype=np.intp)
    place[order] = np.cumsum(new) - 1
    return ascending[new], place
