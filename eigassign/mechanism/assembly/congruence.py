"""K = Bᵀ k B and M = Bᵀ m B of eq. (1) with B = [Q, N T], link by link.

The local motion v = B [u; q̇] of a link's dofs consists of

    v = P u_own + Σ_s e_s c_s + Σ_b ν_b N_b τ,    c = C(q, y) u,    τ = T(q, y) q̇:

dofs that are unknowns themselves (P, constant), dofs s that move with other links (c_s), and the
rigid motion N τ with N = Σ_b ν_b(y) N_b. With the constant E = [P, e_s, N_b] and z = [u; c; ν_b τ],

    v = E z,    z = R [u; q̇],    Bᵀ a B = Rᵀ (Eᵀ a E) R .

Eᵀ a E is made of numbers for every constant matrix a of k = Σ κ_i(y) k_i and m = Σ μ_i(y) m_i; all
that varies with q stands in the few rows of R for c and τ. Because k N = 0 exactly, Bᵀ k B is
Qᵀ k Q: no rigid column enters K.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.mechanism.assembly.affine_entries import AffineEntries
from eigassign.mechanism.elements.mesh import Reduction, Term
from eigassign.mechanism.kinematics.rotations import multiply
from eigassign.series.expression import Scalar

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


def add_links(K: AffineEntries, M: AffineEntries, links: Sequence[LocalLink], n_u: int) -> None:
    """K += Bᵀ k B and M += Bᵀ m B; links that differ only in where they hang are added together."""
    for copies in _copies(links):
        own = np.array([link.own for link in copies])
        Q, NT = _carried(copies), _spread(copies, n_u)
        for term in copies[0].stiffness:
            _add_product(K, term, own, Q)
        for term in copies[0].mass:
            _add_product(M, term, own, [*NT, *Q])
        if NT:
            _add_rigid_inertia(M, copies, n_u)


def _copies(links: Sequence[LocalLink]) -> list[list[LocalLink]]:
    """Links with the same matrices and the same dofs carried, by as many unknowns."""
    alike: dict[object, list[LocalLink]] = {}
    for link in links:
        shared = id(link.stiffness), id(link.mass), id(link.rigid)
        carried = tuple((slot, len(masters)) for slot, masters in link.carried.items())
        alike.setdefault((shared, (link.own >= 0).tobytes(), carried), []).append(link)
    return list(alike.values())


@dataclass(frozen=True, eq=False)
class _Column:
    """One column e_s or ν_b N_b of E beside P, and the rows of R for it, of each of k copies."""

    values: Floats  # (n_local,)
    factor: Scalar  # ν_b, or 1
    rows: Sequence[Sequence[tuple[int, Scalar]]]  # of each copy: unknown and coefficient
    slot: int | None  # s; None for a rigid motion


def _carried(copies: Sequence[LocalLink]) -> list[_Column]:
    """Dofs that move with other links: c = C u."""
    columns = []
    for slot, masters in copies[0].carried.items():
        if masters:
            unit = np.zeros(len(copies[0].own))
            unit[slot] = 1.0
            rows = [link.carried[slot] for link in copies]
            columns.append(_Column(unit, 1.0, rows, slot))
    return columns


def _spread(copies: Sequence[LocalLink], n_u: int) -> list[_Column]:
    """The rigid motion: τ = T q̇; none where nothing moves rigidly."""
    if not copies[0].twist.shape[1]:
        return []
    rows = [
        [[(n_u + k, rate) for k, rate in enumerate(twist)] for twist in of_all]
        for of_all in zip(*(link.twist.tolist() for link in copies), strict=True)
    ]
    return [
        _Column(values, spread.coefficient, rows[component], None)
        for spread in copies[0].rigid
        for component, values in enumerate(spread.matrix.toarray().T)
    ]


def _add_product(target: AffineEntries, term: Term, own: Ints, columns: Sequence[_Column]) -> None:
    """Rᵀ (Eᵀ a E) R of one term a, but for its q̇-q̇ part; ``own`` (k, n_local) of the copies."""
    free = own[0] >= 0
    i = np.repeat(np.arange(len(free)), np.diff(term.matrix.indptr))
    j, values = term.matrix.indices, term.matrix.data
    inner = free[i] & free[j]
    scale = term.coefficient
    target.add([scale] * len(own), own[:, i[inner]], own[:, j[inner]], values[inner])
    if not columns:
        return
    E = np.stack([column.values for column in columns], axis=1)
    image = np.asarray(term.matrix @ E)
    for column, moved in zip(columns, image.T, strict=True):
        rows = np.flatnonzero(free & (moved != 0.0))
        if len(rows):
            factor = scale * column.factor
            for of_all in zip(*column.rows, strict=True):  # one unknown of each copy
                factors = [factor * coefficient for _, coefficient in of_all]
                unknowns = np.array([unknown for unknown, _ in of_all], dtype=np.intp)
                target.add_symmetric(factors, own[:, rows], unknowns, moved[rows])
    for right in columns:
        if right.slot is not None:  # e_sᵀ a E is row s of a E, for a is symmetric
            for k in np.flatnonzero(image[right.slot]):
                _add_pair(target, scale, columns[int(k)], right, float(image[right.slot, k]))


def _add_pair(
    target: AffineEntries, scale: Scalar, left: _Column, right: _Column, value: float
) -> None:
    """What a column c_s on the right gives with any other, and its transpose for a rigid one."""
    factor = scale * left.factor * right.factor
    for of_left, of_right in zip(left.rows, right.rows, strict=True):
        for i, a in of_left:
            scaled = factor * a
            for j, b in of_right:
                entry = scaled * b * value
                target.add_small(i, j, entry)
                if left.slot is None:
                    target.add_small(j, i, entry)


def _add_rigid_inertia(M: AffineEntries, copies: Sequence[LocalLink], n_u: int) -> None:
    """The q̇-q̇ part Tᵀ (Nᵀ m N) T; Nᵀ m N is the rigid inertia about the link's origin."""
    first = copies[0]
    size = first.twist.shape[0]
    inertia = np.zeros((size, size), dtype=object)
    spreads = [(spread.coefficient, spread.matrix.toarray()) for spread in first.rigid]
    for term, (right_factor, right) in itertools.product(first.mass, spreads):
        momentum = np.asarray(term.matrix @ right)
        for left_factor, left in spreads:
            constant = left.T @ momentum
            factor = term.coefficient * left_factor * right_factor
            for a, b in zip(*np.nonzero(constant), strict=True):
                inertia[a, b] = inertia[a, b] + factor * float(constant[a, b])
    for link in copies:
        block = multiply(link.twist.T, multiply(inertia, link.twist))
        for i, j in itertools.combinations_with_replacement(range(len(block)), 2):
            M.add_small(n_u + i, n_u + j, block[i, j])
            if i != j:
                M.add_small(n_u + j, n_u + i, block[i, j])
