"""Assembly of the affine pencil: M = Bᵀ m B, K = Bᵀ k B of eq. (1), factored link by link.

Local motion of a link is v = [u_own; C u_master; N T q̇]: its own nodes directly, a joint node
carried over from the base link by the matrix C(q), and the nodes' rigid motion by the twist T(q).
With m = Σ μ_i(y) m_i and N = Σ ν_b(y) N_b each product separates into (function of q and y) ×
(constant sparse matrix). k N = 0 exactly, so no rigid column enters K except a drive's stiffness.

Entries of an affine matrix, gathered by what they are multiplied with, and their pattern.

The motion of a link's nodes in its own axes, v = B(q, y) [u; q̇] of eq. (1), as matrices.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.mechanism.elements.craig_bampton import total
from eigassign.mechanism.elements.mesh import Reduction, Term
from eigassign.mechanism.kinematics.parameters import Parameters
from eigassign.mechanism.kinematics.rotations import multiply
from eigassign.series.algebra import Samples
from eigassign.series.compiler import Table, compile_table
from eigassign.series.expression import Expression, Scalar

# --- Assembly of the affine pencil: M = Bᵀ m B, K = Bᵀ k B of eq. (1), factored link by link

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
    matrix = term.matrix
    i = np.repeat(np.arange(matrix.shape[0]), np.diff(matrix.indptr))
    return term.coefficient, i, matrix.indices.astype(np.intp), matrix.data


def add_links(
    stiffness: Accumulator, mass: Accumulator, links: Sequence[LocalLink], n_u: int
) -> None:
    """Add links to K and M; those that share their matrices are taken apart once."""
    known: dict[tuple[int, ...], _Own] = {}
    copies: dict[object, list[LocalLink]] = {}
    for link in links:
        copies.setdefault(_kind(link), []).append(link)
    for alike in copies.values():
        first = alike[0]
        own = known.setdefault(_shared(first), _Own(first))
        _add_copies(stiffness, mass, _Copies(tuple(alike)), own, n_u)


def _shared(link: LocalLink) -> tuple[int, ...]:
    """Which matrices a link has; all of them live as long as the links do."""
    return id(link.stiffness), id(link.mass), id(link.rigid)


def _kind(link: LocalLink) -> object:
    """Equal for links with the same matrices and the same dofs carried, by as many unknowns."""
    carried = tuple((slave, len(masters)) for slave, masters in link.carried.items())
    return _shared(link), (link.own >= 0).tobytes(), carried


@dataclass(frozen=True, eq=False)
class _Copies:
    """k links that differ only in their unknowns and in what carries and moves them."""

    links: tuple[LocalLink, ...]

    @cached_property
    def own(self) -> Ints:
        """Unknown of every local dof, or −1, (k, n_local)."""
        return np.array([link.own for link in self.links])

    @cached_property
    def slaves(self) -> Ints:
        """The local dof of each of p carries, (p,): one for every unknown that carries it."""
        carried = self.links[0].carried.items()
        return np.array([slave for slave, masters in carried for _ in masters], dtype=np.intp)

    @cached_property
    def _pairs(self) -> list[list[tuple[int, Scalar]]]:
        return [
            [pair for masters in link.carried.values() for pair in masters] for link in self.links
        ]

    @cached_property
    def masters(self) -> Ints:
        """The unknown that carries, (k, p)."""
        return np.array([[column for column, _ in pairs] for pairs in self._pairs], dtype=np.intp)

    @cached_property
    def carries(self) -> list[list[Scalar]]:
        """How it carries, p lists of k."""
        return [
            list(of) for of in zip(*([c for _, c in pairs] for pairs in self._pairs), strict=True)
        ]


def _add_copies(
    stiffness: Accumulator, mass: Accumulator, copies: _Copies, own: _Own, n_u: int
) -> None:
    moving = copies.links[0].twist.shape[1] > 0
    for part in own.stiffness:
        _add_elastic(stiffness, part, copies)
    for k, part in enumerate(own.mass):
        _add_elastic(mass, part, copies)
        if moving:
            for (factor, _), momentum in zip(own.spreads, own.momenta[k], strict=True):
                _add_rigid_elastic(mass, part[0] * factor, momentum, copies, n_u)
    if moving:
        for link in copies.links:
            _add_rigid(mass, link, own, n_u)


def _add_elastic(target: Accumulator, part: Part, copies: _Copies) -> None:
    """The u-u part of Bᵀ a B: own-own constant, own-carried linear in C, carried-carried CᵀaC."""
    coefficient, i, j, values = part
    mine, its = copies.own[0][i] >= 0, copies.own[0][j] >= 0
    rows, columns = (copies.own[:, at[mine & its]] for at in (i, j))
    target.add([coefficient] * len(rows), rows, columns, values[mine & its])
    (beside,) = np.nonzero(mine & ~its)
    for slave, masters, carries in zip(
        copies.slaves, copies.masters.T, copies.carries, strict=True
    ):
        at = beside[j[beside] == slave]
        if len(at):
            factors = [coefficient * carry for carry in carries]
            target.add_symmetric(factors, copies.own[:, i[at]], masters, values[at])
    (between,) = np.nonzero(~(mine | its))
    if len(between):
        _add_between(target, (coefficient, i[between], j[between], values[between]), copies)


def _add_between(target: Accumulator, part: Part, copies: _Copies) -> None:
    coefficient, i, j, values = part
    entries = list(zip(i.tolist(), j.tolist(), values.tolist(), strict=True))
    for link in copies.links:
        for a, b, value in entries:
            for row, left in link.carried.get(a, ()):
                for column, right in link.carried.get(b, ()):
                    target.add_small(row, column, coefficient * left * right * value)


def _add_rigid_elastic(
    target: Accumulator, coefficient: Scalar, momentum: Floats, copies: _Copies, n_u: int
) -> None:
    """The u-q̇ part: Qᵀ m N T, one term of it with m_i N_b = ``momentum``."""
    for component, column in enumerate(momentum.T):
        rows = np.flatnonzero((column != 0.0) & (copies.own[0] >= 0))
        moved = copies.own[:, rows]
        for k in range(copies.links[0].twist.shape[1]):
            rates = [coefficient * link.twist[component, k] for link in copies.links]
            at = np.full(len(rates), n_u + k, dtype=np.intp)
            target.add_symmetric(rates, moved, at, column[rows])
            for link, rate in zip(copies.links, rates, strict=True):
                _add_carried_twist(target, rate, link, column, n_u + k)


def _add_carried_twist(
    target: Accumulator, rate: Scalar, link: LocalLink, column: Floats, at: int
) -> None:
    for slave, masters in link.carried.items():
        if column[slave] != 0.0:
            for row, carry in masters:
                value = rate * carry * float(column[slave])
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


# --- Entries of an affine matrix, gathered by what they are multiplied with, and their pattern


@dataclass
class Accumulator:
    """Gathers entries (row, column, atom) → value; atom -1 stands for the constant 1."""

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


# --- The motion of a link's nodes in its own axes, v = B(q, y) [u; q̇] of eq. (1), as matrices


def motion_scalars(link: LocalLink) -> list[list[Scalar]]:
    """What varies in a link's B: carried nodes, twist, rigid motion of the nodes."""
    return [
        [carry for masters in link.carried.values() for _, carry in masters],
        list(link.twist.ravel()),
        [t.coefficient for t in link.rigid],
    ]


def motion_matrix(
    link: LocalLink, carries: Floats, twist: Floats, rigid: Floats, n_u: int, n_dof: int
) -> sparse.csr_array:
    """B (n_local, n_dof) from the values of `motion_scalars`: own unknowns, carried ones, N T."""
    own = np.flatnonzero(link.own >= 0)
    rows, columns, data = [own], [link.own[own]], [np.ones(len(own))]
    pairs = [(slot, unknown) for slot, masters in link.carried.items() for unknown, _ in masters]
    if pairs:
        slots, unknowns = (np.array(p) for p in zip(*pairs, strict=True))
        rows, columns = [*rows, slots], [*columns, unknowns]
        data.append(carries)
    shape = (len(link.own), n_dof)
    entries = (np.concatenate(data), (np.concatenate(rows), np.concatenate(columns)))
    B = sparse.csr_array(entries, shape=shape)
    if link.twist.shape[1]:
        N, T = total(link.rigid, rigid), twist.reshape(link.twist.shape)
        wide = sparse.csr_array((shape[0], n_u))
        B = B + sparse.hstack([wide, sparse.csr_array(N @ T)], format="csr")
    return B


@dataclass(frozen=True, eq=False)
class ReducedLinks:
    """The reduced links of a mechanism, each with its motion and its whole matrices."""

    links: tuple[LocalLink, ...]
    table: Table
    cuts: tuple[int, ...]  # of the table's rows: three groups for the motion, two for k and m
    pencil: Pencil

    def values(self, x: Floats) -> Floats:
        """All scalars at x = (q, y) (n_x,)."""
        z = self.pencil.to_program @ x + self.pencil.shift
        return self.table.evaluate(Samples(), z[:, None])[:, 0]

    def motion(self, k: int, values: Floats) -> sparse.csr_array:
        """B of link k in its reduced local dofs, (n_reduced, n_dof)."""
        carries, twist, rigid = (self._group(values, 5 * k + j) for j in range(3))
        n_u, n_dof = self.pencil.n_u, self.pencil.n_dof
        return motion_matrix(self.links[k], carries, twist, rigid, n_u, n_dof)

    def matrices(self, k: int, values: Floats) -> tuple[sparse.csr_array, sparse.csr_array]:
        """Stiffness and mass of the whole link k, with all its dofs."""
        reduction = self.links[k].reduction
        assert reduction is not None
        stiffness, mass = (self._group(values, 5 * k + j) for j in (3, 4))
        return total(reduction.mesh.stiffness, stiffness), total(reduction.mesh.mass, mass)

    def _group(self, values: Floats, j: int) -> Floats:
        return np.asarray(values[self.cuts[j] : self.cuts[j + 1]])


def reduced_links(
    parameters: Parameters, links: Sequence[LocalLink], pencil: Pencil
) -> ReducedLinks | None:
    """Those links of a mechanism that are reduced; None where none is."""
    reduced = tuple(link for link in links if link.reduction is not None)
    if not reduced:
        return None
    groups: list[list[Scalar]] = []
    for link in reduced:
        mesh = link.reduction.mesh  # type: ignore[union-attr]
        groups += motion_scalars(link)
        groups += [[t.coefficient for t in terms] for terms in (mesh.stiffness, mesh.mass)]
    scalars = list(itertools.chain.from_iterable(groups))
    return ReducedLinks(
        links=reduced,
        table=compile_table(parameters.recorder, scalars, len(pencil.shift)),
        cuts=tuple(np.cumsum([0, *(len(g) for g in groups)]).tolist()),
        pencil=pencil,
    )
