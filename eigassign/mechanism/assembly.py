"""Assembly of the affine pencil: M = Bᵀ m B, K = Bᵀ k B of eq. (1), factored link by link.

Local motion of a link is v = [u_own; C u_master; N T q̇]: its own nodes directly, a joint node
carried over from the base link by the matrix C(q), and the nodes' rigid motion by the twist T(q).
With m = Σ μ_i(y) m_i and N = Σ ν_b(y) N_b each product separates into (function of q and y) ×
(constant sparse matrix). k N = 0 exactly, so no rigid column enters K except a drive's stiffness.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.mechanism.mesh import Reduction, Term
from eigassign.mechanism.rotations import multiply
from eigassign.series.expression import Expression, Scalar

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
Objects = NDArray[np.object_]
Part = tuple[Scalar, Ints, Ints, Floats]  # coefficient × values at (rows, columns)


@dataclass(frozen=True)
class LocalLink:
    """One link in its own frame, with its place among the global unknowns.

    ``own`` (n_local,) is the global index of each local dof, or -1 where it is slaved;
    ``carried`` maps a slaved local dof to its (global index, C) pairs: none for a clamped one.
    """

    stiffness: Sequence[Term]
    mass: Sequence[Term]
    rigid: Sequence[Term]  # ν_b N_b, each (n_local, n_twist)
    twist: Objects  # (n_twist, n_columns)
    own: Ints
    carried: dict[int, list[tuple[int, Scalar]]]
    reduction: Reduction | None = None


@dataclass
class Accumulator:
    """Gathers entries (row, column, atom) → value; atom -1 stands for the constant 1."""

    rows: list[Ints] = field(default_factory=list)
    columns: list[Ints] = field(default_factory=list)
    atoms: list[int] = field(default_factory=list)
    values: list[Floats] = field(default_factory=list)
    small: dict[tuple[int, int], Scalar] = field(default_factory=dict)

    def add(self, coefficient: Scalar, rows: Ints, columns: Ints, values: Floats) -> None:
        """coefficient × values at (rows, columns)."""
        for atom, factor in _parts(coefficient):
            if factor != 0.0 and len(rows):
                self._append(rows, columns, atom, values * factor if factor != 1.0 else values)

    def add_symmetric(self, coefficient: Scalar, rows: Ints, column: int, values: Floats) -> None:
        """One column and its transpose, off the diagonal blocks."""
        columns = np.full(len(rows), column, dtype=np.intp)
        for atom, factor in _parts(coefficient):
            if factor != 0.0 and len(rows):
                product = values * factor if factor != 1.0 else values
                self._append(rows, columns, atom, product)
                self._append(columns, rows, atom, product)

    def _append(self, rows: Ints, columns: Ints, atom: int, values: Floats) -> None:
        self.rows.append(rows)
        self.columns.append(columns)
        self.atoms.append(atom)
        self.values.append(values)

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
        lengths = [len(part) for part in self.rows]
        return (
            np.concatenate([*self.rows, np.array(rows, dtype=np.intp)]),
            np.concatenate([*self.columns, np.array(columns, dtype=np.intp)]),
            np.concatenate(
                [np.repeat(np.array(self.atoms, np.intp), lengths), np.array(atoms, np.intp)]
            ),
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


@dataclass(frozen=True, eq=False)
class _Own:
    """What a link brings wherever it hangs: entries of k and m, Qᵀ m N, and Nᵀ m N."""

    link: LocalLink  # any of those that share these

    @cached_property
    def stiffness(self) -> list[Part]:
        return [_part(term) for term in self.link.stiffness]

    @cached_property
    def mass(self) -> list[Part]:
        return [_part(term) for term in self.link.mass]

    @cached_property
    def spreads(self) -> list[tuple[Scalar, Floats]]:
        """ν_b and N_b, dense: three columns, or six, however many nodes."""
        return [(spread.coefficient, spread.matrix.toarray()) for spread in self.link.rigid]

    @cached_property
    def momenta(self) -> list[list[Floats]]:
        """m_i N_b by term i and spread b."""
        return [
            [np.asarray(term.matrix @ spread) for _, spread in self.spreads]
            for term in self.link.mass
        ]

    @cached_property
    def inertia(self) -> Objects:
        """Nᵀ m N: the rigid inertia about the origin of the link's frame, (n_twist, n_twist)."""
        size = self.link.twist.shape[0]
        total = np.zeros((size, size), dtype=object)
        for term, momenta in zip(self.link.mass, self.momenta, strict=True):
            for (right_factor, _), momentum in zip(self.spreads, momenta, strict=True):
                for left_factor, left in self.spreads:
                    constant = left.T @ momentum
                    coefficient = term.coefficient * left_factor * right_factor
                    for a, b in zip(*np.nonzero(constant), strict=True):
                        total[a, b] = total[a, b] + coefficient * float(constant[a, b])
        return total


def _part(term: Term) -> Part:
    entries = term.matrix.tocoo()
    i, j = (np.asarray(at, dtype=np.intp) for at in entries.coords)
    return term.coefficient, i, j, np.asarray(entries.data, dtype=np.float64)


def add_links(
    stiffness: Accumulator, mass: Accumulator, links: Sequence[LocalLink], n_u: int
) -> None:
    """Add links to K and M; those that share their matrices are taken apart once."""
    known: dict[tuple[int, ...], _Own] = {}
    for link in links:
        key = (id(link.stiffness), id(link.mass), id(link.rigid))  # all held by ``links``
        _add_link(stiffness, mass, link, known.setdefault(key, _Own(link)), n_u)


def _add_link(
    stiffness: Accumulator, mass: Accumulator, link: LocalLink, own: _Own, n_u: int
) -> None:
    for part in own.stiffness:
        _add_elastic(stiffness, part, link)
    for k, part in enumerate(own.mass):
        _add_elastic(mass, part, link)
        if link.twist.shape[1]:
            for (factor, _), momentum in zip(own.spreads, own.momenta[k], strict=True):
                _add_rigid_elastic(mass, part[0] * factor, momentum, link, n_u)
    if link.twist.shape[1]:
        _add_rigid(mass, link, own, n_u)


def _add_elastic(target: Accumulator, part: Part, link: LocalLink) -> None:
    """The u-u part of Bᵀ a B: own-own constant, own-carried linear in C, carried-carried CᵀaC."""
    coefficient, i, j, values = part
    rows, columns = link.own[i], link.own[j]
    mine, its = rows >= 0, columns >= 0
    inside = mine & its
    target.add(coefficient, rows[inside], columns[inside], values[inside])
    (beside,) = np.nonzero(mine & ~its)
    for slave, masters in link.carried.items():
        at = beside[j[beside] == slave]
        for column, carry in masters:
            target.add_symmetric(coefficient * carry, rows[at], column, values[at])
    between = ~(mine | its)
    for a, b, value in zip(
        i[between].tolist(), j[between].tolist(), values[between].tolist(), strict=True
    ):
        for row, left in link.carried.get(a, ()):
            for column, right in link.carried.get(b, ()):
                target.add_small(row, column, coefficient * left * right * value)


def _add_rigid_elastic(
    target: Accumulator, coefficient: Scalar, momentum: Floats, link: LocalLink, n_u: int
) -> None:
    """The u-q̇ part: Qᵀ m N T, one term of it with m_i N_b = ``momentum``."""
    for component, row in enumerate(link.twist):
        column = momentum[:, component]
        rows = np.flatnonzero((column != 0.0) & (link.own >= 0))
        for k, rate in enumerate(row):
            if isinstance(rate, Expression) or rate != 0.0:
                _add_twist_column(target, coefficient * rate, link, column, rows, n_u + k)


def _add_twist_column(
    target: Accumulator, coefficient: Scalar, link: LocalLink, column: Floats, rows: Ints, at: int
) -> None:
    target.add_symmetric(coefficient, link.own[rows], at, column[rows])
    for slave, masters in link.carried.items():
        if column[slave] != 0.0:
            for row, carry in masters:
                value = coefficient * carry * float(column[slave])
                target.add_small(row, at, value)
                target.add_small(at, row, value)


def _add_rigid(target: Accumulator, link: LocalLink, own: _Own, n_u: int) -> None:
    """The q̇-q̇ part: Tᵀ (Nᵀ m N) T."""
    momentum = multiply(own.inertia, link.twist)
    block = multiply(link.twist.T, momentum)
    n = block.shape[0]
    for k in range(n):
        for l in range(k, n):  # noqa: E741
            target.add_small(n_u + k, n_u + l, block[k, l])
            if k != l:
                target.add_small(n_u + l, n_u + k, block[k, l])


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
    order = np.argsort(keys)
    ascending = keys[order]
    new = np.ones(len(keys), dtype=bool)
    new[1:] = ascending[1:] != ascending[:-1]
    place = np.empty(len(keys), dtype=np.intp)
    place[order] = np.cumsum(new) - 1
    return ascending[new], place
