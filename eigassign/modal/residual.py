"""The size of an eigen-residual of the reduced model, without a vector of full length online.

In the inverse form a Ritz pair (μ̂, z) leaves ρ = M_c z − μ̂ K_E z. Over all (q, y) it lies in the
span of the terms M_j [V, I_F] and K_j V on the elastic rows; with A a basis of that span, K0 = L Lᵀ
and L⁻¹A = Q R by orthogonal triangularisation, its norm ‖ρ‖ in K0⁻¹ is the length of
Σ_j θ_j (R B_j) c: small arrays only. Terms of the residual are large where one link is carried by
another and cancel in the sum; a Gram matrix AᵀK0⁻¹A would keep half the digits of that only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import solve_triangular
from scipy.sparse import linalg

from eigassign.errors import AccuracyError
from eigassign.mechanism.pencil import Pencil
from eigassign.modal.basis import INDEFINITE

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
Coordinates = tuple[Ints, Floats]  # which columns of A (c,), and how much of them (c, k)
UNIT_LIMIT = 300  # elastic dofs up to which A is the identity


@dataclass(frozen=True, eq=False)
class Residual:
    """R B_j for the terms that are not zero: stiffness on V, mass on [V, I_F]."""

    stiffness_terms: Ints  # indices of θ
    stiffness: Floats  # (n_terms, a, k)
    mass_terms: Ints
    mass: Floats  # (n_terms, a, k + f)


@dataclass(frozen=True)
class _Block:
    """One term times the basis: nothing but its non-zero rows (elastic numbering)."""

    theta: int
    rows: Ints
    values: Floats


def residual_factors(
    pencil: Pencil, K0: sparse.csc_array, factor: linalg.SuperLU, wide: Floats
) -> Residual:
    """Offline part for [V 0; 0 I_F] ``wide`` (n_dof, k + f); ``factor`` is that of K0.

    Raises AccuracyError where K0 is not positive definite.
    """
    n, k = len(pencil.elastic), wide.shape[1] - len(pencil.rigid)
    stiff = _blocks(pencil, pencil.by_term[0], np.ascontiguousarray(wide[:, :k]))
    heavy = _blocks(pencil, pencil.by_term[1], wide)
    if n <= UNIT_LIMIT:
        L = _root_of(K0.toarray())
        return Residual(_terms(stiff), _dense(stiff, L), _terms(heavy), _dense(heavy, L))
    A, coordinates = _span(stiff + heavy, n)
    R = np.asarray(np.linalg.qr(half_solve(factor, A), mode="r"), dtype=np.float64)
    parts = [R[:, at] @ values for at, values in coordinates]
    split = len(stiff)
    return Residual(_terms(stiff), np.array(parts[:split]), _terms(heavy), np.array(parts[split:]))


def half_solve(factor: linalg.SuperLU, A: Floats) -> Floats:
    """L⁻¹ P A with P K0 Pᵀ = L Lᵀ; raises AccuracyError where K0 is not positive definite."""
    pivots = factor.U.diagonal()
    if (factor.perm_r != factor.perm_c).any() or not (pivots > 0.0).all():
        raise AccuracyError(INDEFINITE)
    permuted = np.empty_like(A)
    permuted[factor.perm_r] = A
    lower = factor.L.tocsr()
    solved = linalg.spsolve_triangular(lower, permuted, lower=True, unit_diagonal=True)
    return np.asarray(solved / np.sqrt(pivots)[:, None])


def _blocks(pencil: Pencil, columns: sparse.csc_array, basis: Floats) -> list[_Block]:
    """Every term of one matrix applied to ``basis``, elastic rows only."""
    position = np.full(pencil.n_dof, -1, dtype=np.intp)
    position[pencil.elastic] = np.arange(len(pencil.elastic))
    blocks = []
    for theta in range(columns.shape[1]):
        at = slice(columns.indptr[theta], columns.indptr[theta + 1])
        entries, data = columns.indices[at], columns.data[at]
        place = position[pencil.rows[entries]]
        keep = place >= 0
        rows, slot = np.unique(place[keep], return_inverse=True)
        if len(rows):
            shape = (len(rows), pencil.n_dof)
            term = sparse.csr_array(
                (data[keep], (slot, pencil.columns[entries[keep]])), shape=shape
            )
            blocks.append(_Block(theta, rows.astype(np.intp), np.asarray(term @ basis)))
    return blocks


def _terms(blocks: list[_Block]) -> Ints:
    return np.array([b.theta for b in blocks], dtype=np.intp)


def _dense(blocks: list[_Block], L: Floats) -> Floats:
    """L⁻¹ times every block, A being the identity."""
    n = len(L)
    full = np.zeros((n, len(blocks), blocks[0].values.shape[1]))
    for k, block in enumerate(blocks):
        full[block.rows, k] = block.values
    solved = solve_triangular(L, full.reshape(n, -1), lower=True, check_finite=False)
    return np.ascontiguousarray(solved.reshape(full.shape).transpose(1, 0, 2))


def _span(blocks: list[_Block], n: int) -> tuple[Floats, list[Coordinates]]:
    """A (n, a) spanning all blocks, and each block's coordinates in it.

    Terms with few rows (joints) share unit vectors; the others bring their own column space.
    """
    narrow = [len(b.rows) <= b.values.shape[1] for b in blocks]
    shared = np.zeros(n, dtype=bool)
    for block, is_narrow in zip(blocks, narrow, strict=True):
        if is_narrow:
            shared[block.rows] = True
    units = np.flatnonzero(shared)
    wide: list[tuple[Ints, Floats]] = []
    where: dict[bytes, int] = {}
    coordinates: list[Coordinates] = [
        (np.searchsorted(units, block.rows), block.values)
        if is_narrow
        else _columns(block, wide, where, len(units))
        for block, is_narrow in zip(blocks, narrow, strict=True)
    ]
    A = np.zeros((n, len(units) + len(wide)))
    A[units, np.arange(len(units))] = 1.0
    for k, (rows, column) in enumerate(wide):
        A[rows, len(units) + k] = column
    return A, coordinates


def _columns(
    block: _Block, wide: list[tuple[Ints, Floats]], where: dict[bytes, int], offset: int
) -> Coordinates:
    """Orthonormal columns of a block, equal ones of other blocks used again."""
    U, s, Vt = np.linalg.svd(block.values, full_matrices=False)
    rank = int((s > 1e-13 * s[0]).sum()) if s[0] > 0.0 else 0
    U, values = U[:, :rank], s[:rank, None] * Vt[:rank]
    signs = np.where(U[np.abs(U).argmax(axis=0), np.arange(rank)] < 0.0, -1.0, 1.0)
    columns, place = np.ascontiguousarray((signs * U).T), block.rows.tobytes()
    at = []
    for column, rounded in zip(columns, np.round(columns, 9), strict=True):
        key = rounded.tobytes() + place
        if key not in where:
            where[key] = len(wide)
            wide.append((block.rows, column))
        at.append(offset + where[key])
    return np.array(at, dtype=np.intp), signs[:, None] * values


def _root_of(K: Floats) -> Floats:
    try:
        return np.asarray(np.linalg.cholesky(K), dtype=np.float64)
    except np.linalg.LinAlgError as error:
        raise AccuracyError(INDEFINITE) from error
