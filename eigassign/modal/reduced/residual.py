"""The residual of a Ritz pair measured in K_E(q, y0)⁻¹, without a vector of full length online.

In the inverse form a Ritz pair (μ̂, z) leaves ρ = M_c z − μ̂ K_E z. Over all (q, y) it lies in the
span of the terms M_j [V, I_F] and K_j V on the elastic rows. With A a basis of that span, B_j the
terms' coordinates in it, K0 = L Lᵀ and L⁻¹A = Q R by orthogonal triangularisation,

    ‖ρ‖ in K0⁻¹  =  | Σ_j θ_j (R B_j) c | :

small arrays only. Terms of the residual are large where one link is carried by another and cancel
in the sum; a Gram matrix AᵀK0⁻¹A would keep half the digits of that only.

Turning the joints changes rows and columns J of the stiffness, K_E(q, y0) = K0 + E_J Δ(q) E_Jᵀ.
With G = E_JᵀK0⁻¹E_J and g = E_JᵀK0⁻¹ρ the Sherman-Morrison-Woodbury identity gives

    ρᵀ K_E(q, y0)⁻¹ ρ = ρᵀ K0⁻¹ ρ − gᵀ (I + Δ G)⁻¹ Δ g .
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import lapack, solve_triangular
from scipy.sparse import linalg

from eigassign.errors import AccuracyError
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.mechanism.elements.sparse_factor import has_positive_pivots
from eigassign.modal.projection import entries, project
from eigassign.modal.reduced.basis import INDEFINITE

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
Coordinates = tuple[Ints, Floats]  # which columns of A (c,), and how much of them (c, k)
MOST_JOINT_ROWS = 200  # rows J up to which the correction for turned joints is made
FLOOR = 1e-6  # part of ρᵀK0⁻¹ρ that is kept whatever the correction says: its own round-off


@dataclass(frozen=True, eq=False)
class ResidualTerms:
    """X M_j [V 0; 0 I_F] and X K_j V of all terms that are not zero, for one linear map X."""

    stiffness_terms: Ints  # indices of θ
    stiffness: Floats  # (n_terms, a, k)
    mass_terms: Ints
    mass: Floats  # (n_terms, a, k + f)

    def at(self, theta: Floats, mu: Floats, wide: Floats) -> Floats:
        """X ρ (n, a, c) of the pairs μ̂ (n, c), ``wide`` = [z; −W z] (n, k + f, c)."""
        K = np.tensordot(theta[self.stiffness_terms].T, self.stiffness, axes=1)
        M = np.tensordot(theta[self.mass_terms].T, self.mass, axes=1)
        z = wide[:, : self.stiffness.shape[2]]
        return np.asarray(M @ wide - (K @ z) * mu[:, None, :])


@dataclass(frozen=True, eq=False)
class JointCorrection:
    """Δ(q) = Σ_t (θ_t(q, y0) − θ⁰_t) K_t on J, K0 = Σ_t θ⁰_t K_t, and K0⁻¹ on J."""

    terms: Ints  # indices of θ with a stiffness term that a joint coordinate enters
    theta0: Floats  # their values θ⁰ in K0
    stiffness: Floats  # (n_terms, j, j)
    flexibility: Floats  # G (j, j)
    rows: ResidualTerms  # of the map E_Jᵀ K0⁻¹

    def turned(self, theta: Floats) -> Floats:
        """Δ (n, j, j)."""
        return np.tensordot((theta[self.terms] - self.theta0[:, None]).T, self.stiffness, axes=1)

    def stands(self, theta: Floats) -> NDArray[np.bool_]:
        """Where K_E(q, y0) is definite as K0 is, (n,): where I + Cᵀ Δ C is, G = C Cᵀ."""
        values, turns = np.linalg.eigh(self.flexibility)
        C = turns * np.sqrt(np.maximum(values, 0.0))
        inner = np.eye(len(C)) + C.T @ self.turned(theta) @ C
        return np.array([not lapack.dpotrf(each, lower=1)[1] for each in inner])

    def subtract(self, gram: Floats, theta: Floats, g: Floats) -> Floats:
        """ρ_iᵀ K_E(q, y0)⁻¹ ρ_j (n, c, c) from ρ_iᵀ K0⁻¹ ρ_j, θ at (q, y0) and g (n, j, c)."""
        delta, eye = self.turned(theta), np.eye(len(self.flexibility))
        less = np.swapaxes(g, 1, 2) @ np.linalg.solve(eye + delta @ self.flexibility, delta @ g)
        kept = gram - 0.5 * (less + np.swapaxes(less, 1, 2))
        diagonal = np.arange(gram.shape[1])
        least = FLOOR * gram[:, diagonal, diagonal]
        kept[:, diagonal, diagonal] = np.maximum(kept[:, diagonal, diagonal], least)
        return np.asarray(kept)


def residual_gram(
    residual: ResidualTerms,
    joints: JointCorrection,
    theta: Floats,
    turned: Floats,
    mu: Floats,
    wide: Floats,
) -> Floats:
    """ρ_iᵀ K_E(q, y0)⁻¹ ρ_j between Ritz pairs, (n, c, c): θ at (q, y), ``turned`` at (q, y0)."""
    rho = residual.at(theta, mu, wide)
    gram = np.asarray(np.swapaxes(rho, 1, 2) @ rho)
    if not len(joints.terms):
        return gram
    return joints.subtract(gram, turned, joints.rows.at(theta, mu, wide))


# --- Offline: R B_j, term by term


@dataclass(frozen=True)
class _Block:
    """One term times the basis: nothing but its non-zero rows (elastic numbering)."""

    theta: int
    rows: Ints
    values: Floats


def residual_terms(
    pencil: Pencil, K0: sparse.csc_array, factor: linalg.SuperLU, wide: Floats
) -> ResidualTerms:
    """R B_j on the basis [V 0; 0 I_F] ``wide`` (n_dof, k + f); ``factor`` is that of K0.

    Raises AccuracyError where K0 is not positive definite.
    """
    n, k = len(pencil.elastic), wide.shape[1] - len(pencil.rigid)
    stiff = _blocks(pencil, pencil.by_term[0], np.ascontiguousarray(wide[:, :k]))
    heavy = _blocks(pencil, pencil.by_term[1], wide)
    k_terms, m_terms = (np.array([b.theta for b in some], np.intp) for some in (stiff, heavy))
    if pencil.is_dense:  # A is the identity
        try:
            L = np.asarray(np.linalg.cholesky(K0.toarray()), dtype=np.float64)
        except np.linalg.LinAlgError as error:
            raise AccuracyError(INDEFINITE) from error
        return ResidualTerms(k_terms, _dense(stiff, L), m_terms, _dense(heavy, L))
    A, coordinates = _span(stiff + heavy, n)
    R = np.asarray(np.linalg.qr(half_solve(factor, A), mode="r"), dtype=np.float64)
    parts = [R[:, at] @ values for at, values in coordinates]
    split = len(stiff)
    return ResidualTerms(k_terms, np.array(parts[:split]), m_terms, np.array(parts[split:]))


def half_solve(factor: linalg.SuperLU, A: Floats) -> Floats:
    """L⁻¹ P A with P K0 Pᵀ = L Lᵀ; raises AccuracyError where K0 is not positive definite."""
    if not has_positive_pivots(factor):
        raise AccuracyError(INDEFINITE)
    permuted = np.empty_like(A)
    permuted[factor.perm_r] = A
    lower = factor.L.tocsr()
    solved = linalg.spsolve_triangular(lower, permuted, lower=True, unit_diagonal=True)
    return np.asarray(solved / np.sqrt(factor.U.diagonal())[:, None])


def _blocks(pencil: Pencil, terms: sparse.csc_array, basis: Floats) -> list[_Block]:
    """Elastic rows of every term of one matrix applied to ``basis``."""
    position = np.full(pencil.n_dof, -1, dtype=np.intp)
    position[pencil.elastic] = np.arange(len(pencil.elastic))
    blocks = []
    for theta in range(terms.shape[1]):
        i, j, data = entries(pencil, terms, theta)
        keep = position[i] >= 0
        rows, slot = np.unique(position[i[keep]], return_inverse=True)
        if len(rows):
            shape = (len(rows), pencil.n_dof)
            term = sparse.csr_array((data[keep], (slot, j[keep])), shape=shape)
            blocks.append(_Block(theta, rows, np.asarray(term @ basis)))
    return blocks


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

    Terms with few rows (joints) share unit vectors; others on the same rows orthonormal columns.
    """
    alike: dict[bytes, list[int]] = {}
    for k, block in enumerate(blocks):
        if len(block.rows) > block.values.shape[1]:
            alike.setdefault(block.rows.tobytes(), []).append(k)
    narrow = sorted(set(range(len(blocks))) - {k for members in alike.values() for k in members})
    units = np.unique(np.concatenate([np.zeros(0, np.intp), *(blocks[k].rows for k in narrow)]))
    coordinates = {k: (np.searchsorted(units, blocks[k].rows), blocks[k].values) for k in narrow}
    first = np.zeros((n, len(units)))
    first[units, np.arange(len(units))] = 1.0
    columns, count = [first], len(units)
    for members in alike.values():
        values = [blocks[k].values for k in members]
        size = [np.abs(each).max(initial=0.0) or 1.0 for each in values]
        every = np.hstack([each / own for each, own in zip(values, size, strict=True)])
        U, s, _ = np.linalg.svd(every, full_matrices=False)
        U = U[:, s > 1e-13 * s[0]]
        column = np.zeros((n, U.shape[1]))
        column[blocks[members[0]].rows] = U
        columns.append(column)
        at = np.arange(count, count + U.shape[1])
        coordinates |= {k: (at, U.T @ blocks[k].values) for k in members}
        count += len(at)
    return np.hstack(columns), [coordinates[k] for k in range(len(blocks))]


# --- Offline: what turned joints need


def joint_correction(
    pencil: Pencil, factor: linalg.SuperLU, theta0: Floats, wide: Floats
) -> JointCorrection:
    """Δ's terms and K0⁻¹ on the rows where K_E depends on q; none where these are too many.

    ``factor`` is that of K0, ``theta0`` (n_theta,) are its θ, ``wide`` is [V 0; 0 I_F]. K_g, which
    turns on all rows, is left out of Δ where only that is too many.
    """
    columns, k = pencil.by_term[0], wide.shape[1] - len(pencil.rigid)
    terms, dofs = _turned(pencil, columns)
    if len(dofs) > MOST_JOINT_ROWS and pencil.weight is not None:
        columns = pencil.weight.without.tocsc()
        terms, dofs = _turned(pencil, columns)
    if len(dofs) > MOST_JOINT_ROWS:
        dofs, terms = dofs[:0], terms[:0]
    responses = np.zeros((pencil.n_dof, len(dofs)))  # K0⁻¹ E_J
    if len(dofs):
        units = np.zeros((len(pencil.elastic), len(dofs)))
        units[np.searchsorted(pencil.elastic, dofs), np.arange(len(dofs))] = 1.0
        responses[pencil.elastic] = factor.solve(units)
    stiffness, mass = project(pencil, wide, responses)
    k_terms, m_terms = (np.flatnonzero(np.diff(w.indptr)) for w in pencil.by_term)
    return JointCorrection(
        terms=terms,
        theta0=theta0[terms],
        stiffness=_joint_blocks(pencil, columns, terms, dofs),
        flexibility=responses[dofs],
        rows=ResidualTerms(k_terms, stiffness[k_terms, :, :k], m_terms, mass[m_terms]),
    )


def _turned(pencil: Pencil, columns: sparse.csc_array) -> tuple[Ints, Ints]:
    """The terms of a matrix that joint coordinates enter, and the rows that these are on."""
    of_joints = np.flatnonzero(pencil.program.dependence[:, : pencil.n_joints].any(axis=1)) + 1
    terms = np.array([t for t in of_joints if columns.indptr[t + 1] > columns.indptr[t]], np.intp)
    entries = np.unique(columns[:, terms].tocoo().coords[0]) if len(terms) else terms
    return terms, np.union1d(pencil.rows[entries], pencil.columns[entries]).astype(np.intp)


def _joint_blocks(pencil: Pencil, columns: sparse.csc_array, terms: Ints, dofs: Ints) -> Floats:
    """The stiffness terms on rows and columns ``dofs``, (n_terms, j, j)."""
    blocks = np.zeros((len(terms), len(dofs), len(dofs)))
    position = np.full(pencil.n_dof, -1, dtype=np.intp)
    position[dofs] = np.arange(len(dofs))
    for block, term in zip(blocks, terms.tolist(), strict=True):
        i, j, data = entries(pencil, columns, term)
        block[position[i], position[j]] = data
    return blocks
