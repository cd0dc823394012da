"""The affine pencil, K = Σ θ_j(q, y) K_j and M likewise, and how its entries are collected.

An affine matrix is Σ θ_j A_j with constant sparse A_j. Its entries come as (scalar) × (number) at
(row, column); a scalar is a sum c + Σ c_k a_k over atoms a_k of its recorder, and each atom that
occurs becomes one θ_j. K and M are symmetric: what is off the diagonal comes with its transpose.

The non-zeros of K and M on one common pattern are linear in θ: ``data = weights @ θ`` with θ_0 = 1.
θ is a compiled program, evaluated on samples or on truncated power series; nothing else differs
between exact, Taylor and reduced evaluation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.arrays import Bools, Floats, Ints
from eigassign.brief import Brief
from eigassign.mechanism.kinematics.joints import Objects, some
from eigassign.series.algebra import Samples, Tangents, Truncated
from eigassign.series.compiler import Program
from eigassign.series.expression import Scalar, one_atom, parts
from eigassign.series.multi_index import LowerSet, on_faces

if TYPE_CHECKING:  # a stored reduced model is evaluated without kinematics and case
    from eigassign.mechanism.kinematics.parameters import PropertyLimits, Rails


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


DENSE_LIMIT = 220  # n_dof up to which matrices are kept dense (benchmarks/dense_or_sparse.py)
STACK_LIMIT = 500_000  # numbers: 4 MB
KEPT = 1_000_000  # numbers that are kept of a program: 8 MB
# Numbers up to which matrices at few poses come quicker from dense terms: 7 µs instead of 18 for
# two_link (7·10³), 16 instead of 20 for 3·10⁴ (four_bar), 39 instead of 25 for 8·10⁴ (gantry).
TINY_STACK = 20_000


def theta_at(program: Program, z: Floats) -> Floats:
    """θ = (1, program(z)) (n_theta, n) at the program's variables z (n_z, n)."""
    return np.vstack([np.ones((1, z.shape[1])), program.run(Samples(), z)])


@lru_cache(maxsize=2)  # frequencies and statics of a design want the same, one after the other
def _run(program: Program, samples: int, directions: int, z: bytes) -> Floats:
    variables = np.frombuffer(z).reshape(-1, (1 + directions) * samples)
    return program.run(Tangents(samples, directions), variables)


@dataclass(frozen=True, eq=False)
class Weight:
    """K_g by itself, which is in K as well, and what to say of coordinates that it moves."""

    stiffness: sparse.csr_array  # (n_nonzeros, n_theta) on the pencil's pattern
    without: sparse.csr_array  # K without it, likewise
    joints: Ints  # the dofs of joint coordinates that are not rigid (n_joints,)
    among_joints: sparse.csr_array  # their own K_g, (n_joints², n_theta)
    swinging: Ints  # places in ``joints`` of those that nothing but the weight holds
    names: tuple[str, ...]  # of ``joints``
    variables: tuple[str, ...]  # the names of x
    units: tuple[str, ...]  # SI, of x
    gravity: float  # |g| in m/s²


@dataclass(frozen=True, eq=False, repr=False)
class Pencil(Brief):
    """K and M of eq. (1) in the unknowns [u; q̇], order n_dof = n_u + n_columns.

    x = (q, y) are the case's variables, z = ``to_program`` x + ``shift`` those of the program
    (relative joint coordinates, loads and design parameters). The last ``n_loads`` entries of q are
    properties that change from one trajectory to the next.
    """

    n_dof: int
    n_u: int
    rigid: Ints  # dofs of the free coordinates: the rigid-body modes
    rows: Ints
    columns: Ints
    stiffness: sparse.csr_array  # (n_nonzeros, 1 + n_theta)
    mass: sparse.csr_array
    program: Program
    to_program: Floats  # (n_z, n_x)
    shift: Floats  # (n_z,)
    n_q: int
    n_loads: int = 0
    rails: Rails | None = None  # where carriages and nuts may stand
    limits: PropertyLimits | None = None  # of the loads and design parameters
    weight: Weight | None = None  # under gravity
    dense_limit: int = DENSE_LIMIT

    @property
    def is_dense(self) -> bool:
        """True where matrices are kept dense, which q̇ alone fill; else algebra is sparse."""
        return self.n_dof <= self.dense_limit or not self.n_u

    @property
    def n_joints(self) -> int:
        """Number of joint coordinates: the first entries of q and of z."""
        return self.n_q - self.n_loads

    @property
    def n_theta(self) -> int:
        """Number of coefficient functions, θ_0 = 1 included."""
        return int(self.stiffness.shape[1])

    @cached_property
    def active(self) -> Bools:
        """Mask of the variables z that anything depends on: expansions drop the others."""
        return np.asarray(self.program.dependence.any(axis=0))

    @property
    def is_affine(self) -> bool:
        """True where K and M are of degree 1 in y at most, by their form."""
        return self.program.is_affine((self.to_program[:, self.n_q :] != 0.0).any(axis=1))

    @cached_property
    def elastic(self) -> Ints:
        """The dofs that are not rigid-body coordinates: u and held coordinates."""
        return np.delete(np.arange(self.n_dof), self.rigid)

    @cached_property
    def term_stacks(self) -> Floats | None:
        """Dense K_j and M_j, as (row, 2, n_theta, column), where that is small."""
        if not self.is_dense or self.n_theta * self.n_dof**2 > STACK_LIMIT:
            return None
        dense = self._pair(np.stack([self.stiffness.toarray(), self.mass.toarray()]))
        return np.ascontiguousarray(dense.transpose(2, 0, 1, 3))

    @cached_property
    def elastic_first(self) -> Ints | None:
        """The order of dofs with the rigid ones last; None where they are in this order anyway."""
        order = np.concatenate([self.elastic, self.rigid])
        return None if (order == np.arange(self.n_dof)).all() else order

    @cached_property
    def by_term(self) -> tuple[sparse.csc_array, sparse.csc_array]:
        """The weights of K and of M term by term."""
        return self.stiffness.tocsc(), self.mass.tocsc()

    @cached_property
    def mass_magnitude(self) -> sparse.csr_array | Floats:
        """|(M_j)_ii| (n_dof, n_theta): with |θ| the size of what adds up to each M_ii."""
        on = np.flatnonzero(self.rows == self.columns)
        place = (np.ones(len(on)), (self.rows[on], np.arange(len(on))))
        spread = sparse.csr_array(place, shape=(self.n_dof, len(on)))
        sizes = sparse.csr_array(spread @ abs(self.mass[on]))
        return sizes if self._stack is None else sizes.toarray()

    def theta(self, x: Floats) -> Floats:
        """θ at samples x (n_samples, n_x): shape (n_theta, n_samples).

        Raises TravelError where a carriage or nut leaves its beam, UsageError for properties that
        no mechanism can have.
        """
        x = np.atleast_2d(x)
        if self.limits is not None:
            self.limits.require(x)
        z = self.to_program @ x.T + self.shift[:, None]
        if self.rails is not None:
            self.rails.require(z, x)
        return theta_at(self.program, z)

    def theta_slopes(self, x: Floats, along: Ints) -> Floats:
        """∂θ/∂x_i (len(along), n_theta, n_samples) in the variables ``along`` of x (n, n_x)."""
        z = Tangents(len(x), len(along)).constant(self.shift)
        z[:, : len(x)] += self.to_program @ x.T
        z[:, len(x) :] = np.repeat(self.to_program[:, along], len(x), axis=1)
        size = len(x), len(along)
        kept = len(self.program.outputs) * z.shape[1] <= KEPT
        rows = (_run if kept else _run.__wrapped__)(self.program, *size, z.tobytes())[:, len(x) :]
        slopes = np.zeros((len(along), 1 + len(rows), len(x)))
        slopes[:, 1:] = rows.reshape(len(rows), len(along), len(x)).swapaxes(0, 1)
        return slopes

    def theta_series(self, space: LowerSet, x0: Floats, directions: Floats) -> Floats:
        """Coefficients of θ (n_theta, N) about x0 in w, where z = z0 + ``directions`` w."""
        # the members that θ may have coefficients of, and their places
        inner, where = on_faces(space, (self.program.faces @ (directions != 0.0)).tobytes())
        z = np.zeros((len(self.shift), len(inner)))
        z[:, 0] = self.to_program @ x0 + self.shift
        if self.limits is not None:
            self.limits.require(x0[None])
        if self.rails is not None:
            self.rails.require(z[:, :1], x0[None])
        present = (inner.units >= 0).nonzero()[0]
        z[:, inner.units[present]] = directions[:, present]
        theta = np.zeros((self.n_theta, len(space)))
        theta[0, 0] = 1.0
        theta[1:, where] = self.program.run(Truncated(inner), z)
        return theta

    def matrices(self, theta: Floats) -> Floats:
        """Dense K and M, (2, n_samples, n_dof, n_dof), for θ (n_theta, n_samples)."""
        if self._stack is not None:
            return np.asarray((theta.T @ self._stack).reshape(2, -1, self.n_dof, self.n_dof))
        return self._pair((self._both @ theta).reshape(2, -1, theta.shape[1]))

    @cached_property
    def has_term(self) -> Bools:
        """(2, n_theta): which θ_j have a stiffness term, and which a mass term."""
        return np.array([np.diff(terms.indptr) > 0 for terms in self.by_term])

    def stiffness_matrices(self, theta: Floats) -> Floats:
        """Dense K (n_samples, n_dof, n_dof) alone."""
        return self._one(0, self.stiffness, theta)

    def mass_matrices(self, theta: Floats) -> Floats:
        """Dense M (n_samples, n_dof, n_dof) alone."""
        return self._one(1, self.mass, theta)

    def _one(self, which: int, weights: sparse.csr_array, theta: Floats) -> Floats:
        if self._stack is not None:
            return np.asarray((theta.T @ self._stack[which]).reshape(-1, self.n_dof, self.n_dof))
        return np.asarray(self._pair((weights @ theta)[None])[0])

    @cached_property
    def _stack(self) -> Floats | None:
        """Dense K_j and M_j, (2, n_theta, n_dof²), where products with zeros cost nothing."""
        if not self.is_dense or self.n_theta * self.n_dof**2 > TINY_STACK:
            return None
        dense = self._pair(np.stack([self.stiffness.toarray(), self.mass.toarray()]))
        return dense.reshape(2, self.n_theta, -1)

    @cached_property
    def _both(self) -> sparse.csr_array:
        """Weights of K above those of M: one product for both."""
        return sparse.csr_array(sparse.vstack([self.stiffness, self.mass]))

    @cached_property
    def _flat(self) -> Ints:
        """Place of each non-zero in a dense matrix read row by row."""
        return self.rows * self.n_dof + self.columns

    def _pair(self, data: Floats) -> Floats:
        """Dense (…, k, n_dof, n_dof) from the non-zeros of k matrices each, (…, n_nonzeros, k)."""
        full = np.zeros((len(data), data.shape[2], self.n_dof * self.n_dof))
        full[:, :, self._flat] = data.transpose(0, 2, 1)
        return full.reshape(len(data), -1, self.n_dof, self.n_dof)

    def sparse(self, data: Floats) -> sparse.csc_array:
        """One sparse matrix from its non-zeros (n_nonzeros,) on the common pattern."""
        columns, starts = self._row_pointers
        shape = (self.n_dof, self.n_dof)
        return sparse.csr_array((data, columns, starts), shape=shape).tocsc()

    @cached_property
    def _row_pointers(self) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """Column of each non-zero, and where rows begin: the pattern runs row by row."""
        starts = np.searchsorted(self.rows, np.arange(self.n_dof + 1))
        return self.columns.astype(np.int32), starts.astype(np.int32)


# --- Symmetric sparse matrices from the non-zeros of the pencil, without sorting or duplicates


def principal(pencil: Pencil, data: Floats, dofs: Ints) -> sparse.csc_array:
    """The rows and columns ``dofs`` (ascending) of a symmetric matrix from its non-zeros.

    The pencil's pattern runs row by row; read column by column it is the same symmetric matrix.
    Entries that happen to be zero are left out: they would only cause fill-in.
    """
    position = np.full(pencil.n_dof, -1, dtype=np.int32)
    position[dofs] = np.arange(len(dofs), dtype=np.int32)
    rows, columns = position[pencil.rows], position[pencil.columns]
    keep = (rows >= 0) & (columns >= 0) & (data != 0.0)
    counts = np.bincount(rows[keep], minlength=len(dofs))
    starts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int32)
    shape = (len(dofs), len(dofs))
    return sparse.csc_array((data[keep], columns[keep], starts), shape=shape)


def block(pencil: Pencil, data: Floats, rows: Ints) -> Floats:
    """The rows ``rows`` of a matrix, dense: (len(rows), n_dof)."""
    position = np.full(pencil.n_dof, -1, dtype=np.intp)
    position[rows] = np.arange(len(rows))
    slot = position[pencil.rows]
    keep = slot >= 0
    out = np.zeros((len(rows), pencil.n_dof))
    out[slot[keep], pencil.columns[keep]] = data[keep]
    return out
