"""Assembly of the affine pencil: M = Bᵀ m B, K = Bᵀ k B of eq. (1), factored link by link.

Local motion of a link is v = [u_own; C u_master; N T q̇]: its own nodes directly, a joint node
carried over from the base link by the matrix C(q), and the nodes' rigid motion by the twist T(q).
With m = Σ μ_i(y) m_i and N = Σ ν_b(y) N_b each product separates into (function of q and y) ×
(constant sparse matrix). k N = 0 exactly, so no rigid column enters K except a drive's stiffness.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.mechanism.mesh import Reduction, Term
from eigassign.mechanism.rotations import multiply
from eigassign.series.expression import Expression, Scalar

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
Objects = NDArray[np.object_]


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
    atoms: list[Ints] = field(default_factory=list)
    values: list[Floats] = field(default_factory=list)
    small: dict[tuple[int, int], Scalar] = field(default_factory=dict)

    def add(self, coefficient: Scalar, rows: Ints, columns: Ints, values: Floats) -> None:
        """coefficient × values at (rows, columns)."""
        for atom, factor in _parts(coefficient):
            if factor != 0.0 and len(rows):
                self.rows.append(rows)
                self.columns.append(columns)
                self.atoms.append(np.full(len(rows), atom, dtype=np.intp))
                self.values.append(values * factor)

    def add_symmetric(self, coefficient: Scalar, rows: Ints, column: int, values: Floats) -> None:
        """One column and its transpose, off the diagonal blocks."""
        columns = np.full(len(rows), column, dtype=np.intp)
        self.add(coefficient, rows, columns, values)
        self.add(coefficient, columns, rows, values)

    def add_small(self, row: int, column: int, value: Scalar) -> None:
        """An entry among joint nodes and q̇, where many functions meet: summed before use."""
        if not isinstance(value, Expression) and value == 0.0:
            return
        self.small[row, column] = self.small.get((row, column), 0.0) + value

    def finish(self, n_u: int) -> tuple[Ints, Ints, Ints, Floats]:
        """All entries as arrays; q̇-q̇ entries become one atom each."""
        for (row, column), value in self.small.items():
            if min(row, column) >= n_u and isinstance(value, Expression):
                factor, atom = value.single()
                value = Expression(value.recorder, 0.0, {atom: factor})
            at = np.array([row], dtype=np.intp), np.array([column], dtype=np.intp)
            self.add(value, *at, np.ones(1))
        if not self.rows:
            none = np.zeros(0, dtype=np.intp)
            return none, none, none, np.zeros(0)
        rows, columns, atoms = (np.concatenate(a) for a in (self.rows, self.columns, self.atoms))
        return rows, columns, atoms, np.concatenate(self.values)


def _parts(coefficient: Scalar) -> list[tuple[int, float]]:
    if not isinstance(coefficient, Expression):
        return [(-1, float(coefficient))]
    return [(-1, coefficient.constant), *coefficient.terms.items()]


def add_link(stiffness: Accumulator, mass: Accumulator, link: LocalLink, n_u: int) -> None:
    """Add one link to K and M."""
    for term in link.stiffness:
        _add_elastic(stiffness, term, link)
    for term in link.mass:
        _add_elastic(mass, term, link)
        if link.twist.shape[1]:
            _add_rigid_elastic(mass, term, link, n_u)
    if link.twist.shape[1]:
        _add_rigid(mass, link, n_u)


def _add_elastic(target: Accumulator, term: Term, link: LocalLink) -> None:
    """The u-u part of Bᵀ a B: own-own constant, own-carried linear in C, carried-carried CᵀaC."""
    entries = term.matrix.tocoo()
    i, j, values = entries.coords[0], entries.coords[1], entries.data
    own = link.own
    inside = (own[i] >= 0) & (own[j] >= 0)
    target.add(term.coefficient, own[i[inside]], own[j[inside]], values[inside])
    for slave, masters in link.carried.items():
        beside = (j == slave) & (own[i] >= 0)
        for column, carry in masters:
            target.add_symmetric(term.coefficient * carry, own[i[beside]], column, values[beside])
    between = (own[i] < 0) & (own[j] < 0)
    for a, b, value in zip(i[between], j[between], values[between], strict=True):
        for row, left in link.carried.get(int(a), ()):
            for column, right in link.carried.get(int(b), ()):
                target.add_small(row, column, term.coefficient * left * right * float(value))


def _add_rigid_elastic(target: Accumulator, term: Term, link: LocalLink, n_u: int) -> None:
    """The u-q̇ part: Qᵀ m N T."""
    for spread in link.rigid:
        coupling = np.asarray(term.matrix @ spread.matrix.toarray())
        coefficient = term.coefficient * spread.coefficient
        for component, row in enumerate(link.twist):
            column = coupling[:, component]
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


def _add_rigid(target: Accumulator, link: LocalLink, n_u: int) -> None:
    """The q̇-q̇ part: Tᵀ (Nᵀ m N) T."""
    inertia = rigid_inertia(link)
    momentum = multiply(inertia, link.twist)
    block = multiply(link.twist.T, momentum)
    n = block.shape[0]
    for k in range(n):
        for l in range(k, n):  # noqa: E741
            target.add_small(n_u + k, n_u + l, block[k, l])
            if k != l:
                target.add_small(n_u + l, n_u + k, block[k, l])


def rigid_inertia(link: LocalLink) -> Objects:
    """Nᵀ m N: the link's rigid inertia about the origin of its frame, (n_twist, n_twist)."""
    size = link.twist.shape[0]
    total = np.zeros((size, size), dtype=object)
    spreads = [(spread.coefficient, spread.matrix.toarray()) for spread in link.rigid]
    for term in link.mass:
        for right_factor, right in spreads:
            momentum = term.matrix @ right  # dense from here on: three columns, however many nodes
            for left_factor, left in spreads:
                constant = left.T @ momentum
                coefficient = term.coefficient * left_factor * right_factor
                for a, b in zip(*np.nonzero(constant), strict=True):
                    total[a, b] = total[a, b] + coefficient * float(constant[a, b])
    return total


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
