"""The size of an eigen-residual of the reduced model, without a vector of full length online.

In the inverse form a Ritz pair (μ̂, z) leaves ρ = M_c z − μ̂ K_E z. Over all (q, y) it lies in the
span of the terms M_j [V, I_F] and K_j V on the elastic rows; with A a basis of that span and
AᵀK_E(x0)⁻¹A = RᵀR, its norm ‖ρ‖ in K_E(x0)⁻¹ is the length of Σ_j θ_j (R B_j) c: small arrays only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.errors import AccuracyError
from eigassign.mechanism.pencil import Pencil
from eigassign.modal.basis import INDEFINITE
from eigassign.modal.symmetric import factorise

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
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


def residual_factors(pencil: Pencil, K0: sparse.csc_array, V: Floats, elastic: Ints) -> Residual:
    """Offline part for the basis V (n_elastic, k) and K_E(x0)."""
    wide = _with_rigid(pencil, V, elastic)
    stiff = _blocks(pencil, pencil.stiffness, wide[:, : V.shape[1]], elastic)
    heavy = _blocks(pencil, pencil.mass, wide, elastic)
    if len(elastic) <= UNIT_LIMIT:
        L = _root_of(K0.toarray())
        return Residual(*_dense(stiff, L, len(elastic)), *_dense(heavy, L, len(elastic)))
    A, coordinates = _span(stiff + heavy, len(elastic))
    R = _root(A, factorise(K0).solve(A))
    parts = [np.array([R @ c for c in coordinates[: len(stiff)]])]
    parts.append(np.array([R @ c for c in coordinates[len(stiff) :]]))
    return Residual(_terms(stiff), parts[0], _terms(heavy), parts[1])


def _with_rigid(pencil: Pencil, V: Floats, elastic: Ints) -> Floats:
    """[V 0; 0 I_F] on all dofs."""
    f = len(pencil.rigid)
    wide = np.zeros((pencil.n_dof, V.shape[1] + f))
    wide[elastic, : V.shape[1]] = V
    wide[pencil.rigid, V.shape[1] :] = np.eye(f)
    return wide


def _blocks(
    pencil: Pencil, weights: sparse.csr_array, basis: Floats, elastic: Ints
) -> list[_Block]:
    """Every term of one matrix applied to ``basis``, elastic rows only."""
    position = np.full(pencil.n_dof, -1, dtype=np.intp)
    position[elastic] = np.arange(len(elastic))
    columns = weights.tocsc()
    blocks = []
    for theta in range(weights.shape[1]):
        at = slice(columns.indptr[theta], columns.indptr[theta + 1])
        entries, data = columns.indices[at], columns.data[at]
        keep = position[pencil.rows[entries]] >= 0
        rows, slot = np.unique(position[pencil.rows[entries[keep]]], return_inverse=True)
        if len(rows):
            shape = (len(rows), pencil.n_dof)
            term = sparse.csr_array(
                (data[keep], (slot, pencil.columns[entries[keep]])), shape=shape
            )
            blocks.append(_Block(theta, rows.astype(np.intp), np.asarray(term @ basis)))
    return blocks


def _terms(blocks: list[_Block]) -> Ints:
    return np.array([b.theta for b in blocks], dtype=np.intp)


def _dense(blocks: list[_Block], L: Floats, n: int) -> tuple[Ints, Floats]:
    """L⁻¹ times every block, A being the identity."""
    full = np.zeros((len(blocks), n, blocks[0].values.shape[1]))
    for k, block in enumerate(blocks):
        full[k, block.rows] = block.values
    flat = full.transpose(1, 0, 2).reshape(n, -1)
    solved = np.linalg.solve(L, flat).reshape(n, len(blocks), -1)
    return _terms(blocks), np.ascontiguousarray(solved.transpose(1, 0, 2))


def _span(blocks: list[_Block], n: int) -> tuple[Floats, list[Floats]]:
    """A (n, a) spanning all blocks, and each block's coordinates in it.

    Terms with few rows (joints) share unit vectors; the others bring their own column space.
    """
    narrow = [len(b.rows) <= b.values.shape[1] for b in blocks]
    units = np.unique(
        np.concatenate(
            [b.rows for b, s in zip(blocks, narrow, strict=True) if s]
            or [np.zeros(0, dtype=np.intp)]
        )
    )
    wide: list[Floats] = []
    where: dict[bytes, int] = {}
    raw: list[list[tuple[int, Floats]]] = []
    for block, is_narrow in zip(blocks, narrow, strict=True):
        if is_narrow:
            at = np.searchsorted(units, block.rows)
            raw.append([(int(i), row) for i, row in zip(at, block.values, strict=True)])
        else:
            raw.append(_columns(block, n, wide, where, len(units)))
    A = np.zeros((n, len(units) + len(wide)))
    A[units, np.arange(len(units))] = 1.0
    if wide:
        A[:, len(units) :] = np.array(wide).T
    return A, [
        _coordinates(r, A.shape[1], b.values.shape[1]) for r, b in zip(raw, blocks, strict=True)
    ]


def _columns(
    block: _Block, n: int, wide: list[Floats], where: dict[bytes, int], offset: int
) -> list[tuple[int, Floats]]:
    """Orthonormal columns of a block, equal ones of other blocks used again."""
    U, s, Vt = np.linalg.svd(block.values, full_matrices=False)
    rank = int((s > 1e-13 * s[0]).sum()) if s[0] > 0.0 else 0
    found = []
    for u, size, row in zip(U.T[:rank], s, Vt, strict=False):
        sign = -1.0 if u[np.abs(u).argmax()] < 0.0 else 1.0
        key = np.round(sign * u, 9).tobytes() + block.rows.tobytes()
        if key not in where:
            where[key] = len(wide)
            column = np.zeros(n)
            column[block.rows] = sign * u
            wide.append(column)
        found.append((offset + where[key], sign * size * row))
    return found


def _coordinates(parts: list[tuple[int, Floats]], a: int, k: int) -> Floats:
    out = np.zeros((a, k))
    for at, row in parts:
        out[at] += row
    return out


def _root_of(K: Floats) -> Floats:
    try:
        return np.asarray(np.linalg.cholesky(K))
    except np.linalg.LinAlgError as error:
        raise AccuracyError(INDEFINITE) from error


def _root(A: Floats, solved: Floats) -> Floats:
    """R with RᵀR = AᵀK⁻¹A, directions lost in round-off left out."""
    gram = A.T @ solved
    scale = 1.0 / np.sqrt(np.maximum(np.diag(gram), 1e-300))
    values, vectors = np.linalg.eigh(0.5 * (gram + gram.T) * scale[:, None] * scale)
    keep = values > 1e-15 * values[-1]
    return np.asarray((np.sqrt(values[keep])[:, None] * vectors[:, keep].T) / scale)
