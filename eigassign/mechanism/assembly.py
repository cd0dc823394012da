"""Assembly of the affine pencil: M = Bᵀ m B, K = Bᵀ k B of eq. (1), factored link by link.

Local motion of a link is v = [u_own; C u_master; N T q̇]: its own nodes directly, a joint node
carried over from the base link by the matrix C(q), and the nodes' rigid motion by the twist T(q).
With m = Σ μ_i(y) m_i and N = Σ ν_b(y) N_b each product separates into (function of q and y) ×
(constant sparse matrix). k N = 0 exactly, so no rigid column enters K except a drive's stiffness.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from eigassign.mechanism.accumulator import Accumulator
from eigassign.mechanism.mesh import Reduction, Term
from eigassign.mechanism.rotations import multiply
from eigassign.series.expression import Scalar

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
