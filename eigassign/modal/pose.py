"""From a norm in K0⁻¹ to the norm in K_E(q, y0)⁻¹: what turning the joints does to it.

Only rows and columns J at the joints depend on q: K_E(q, y0) = K0 + E_J Δ(q) E_Jᵀ. With
G = E_JᵀK0⁻¹E_J and g = E_JᵀK0⁻¹ρ, small arrays all, the Sherman-Morrison-Woodbury identity gives

    ρᵀ K_E(q, y0)⁻¹ ρ = ρᵀ K0⁻¹ ρ − gᵀ (I + Δ G)⁻¹ Δ g .
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import linalg

from eigassign.mechanism.pencil import Pencil
from eigassign.modal.project import project

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
MOST = 200  # rows at joints up to which the correction is made
FLOOR = 1e-6  # part of ρᵀK0⁻¹ρ that is kept whatever the correction says: its own round-off


@dataclass(frozen=True, eq=False)
class Pose:
    """Δ(q) = Σ_t (θ_t(q, y0) − θ⁰_t) K_t on J, K0 = Σ_t θ⁰_t K_t, and K0⁻¹ on J.

    ``…_rows`` are the rows J of K0⁻¹ times every term of the residual.
    """

    terms: Ints  # indices of θ with a stiffness term that a joint coordinate enters
    theta0: Floats  # their values θ⁰ in K0
    stiffness: Floats  # (n_terms, j, j)
    flexibility: Floats  # G (j, j)
    stiffness_rows: Floats  # E_Jᵀ K0⁻¹ K_t V, (n_stiffness_terms, j, k)
    mass_rows: Floats  # E_Jᵀ K0⁻¹ M_t [V, I_F], (n_mass_terms, j, k + f)


@dataclass(frozen=True, eq=False)
class JointRows:
    """J among the elastic dofs, and K0⁻¹ E_J (n_dof, j)."""

    dofs: Ints
    terms: Ints
    responses: Floats


def joint_rows(pencil: Pencil, factor: linalg.SuperLU) -> JointRows:
    """The rows where K_E depends on q; none where they are too many to be worth it.

    ``factor`` is that of K0.
    """
    of_joints = np.flatnonzero(pencil.program.dependence[:, : pencil.n_q].any(axis=1)) + 1
    columns = pencil.by_term[0]
    terms = np.array([t for t in of_joints if columns.indptr[t + 1] > columns.indptr[t]], np.intp)
    entries = np.unique(columns[:, terms].tocoo().coords[0]) if len(terms) else terms
    touched = np.union1d(pencil.rows[entries], pencil.columns[entries])
    dofs = np.searchsorted(pencil.elastic, touched).astype(np.intp)
    if len(dofs) > MOST:
        dofs, terms = dofs[:0], terms[:0]
    units = np.zeros((len(pencil.elastic), len(dofs)))
    units[dofs, np.arange(len(dofs))] = 1.0
    responses = np.zeros((pencil.n_dof, len(dofs)))
    if len(dofs):
        responses[pencil.elastic] = factor.solve(units)
    return JointRows(dofs, terms, responses)


def pose(pencil: Pencil, at: JointRows, theta0: Floats, wide: Floats) -> Pose:
    """Everything the correction needs online.

    ``theta0`` (n_theta,) are those of K0, ``wide`` is [V 0; 0 I_F] (n_dof, k + f).
    """
    dofs, k = pencil.elastic[at.dofs], wide.shape[1] - len(pencil.rigid)
    stiffness, mass = project(pencil, wide, at.responses)
    k_terms, m_terms = (np.flatnonzero(np.diff(w.indptr)) for w in pencil.by_term)
    return Pose(
        terms=at.terms,
        theta0=theta0[at.terms],
        stiffness=_joint_blocks(pencil, at.terms, dofs),
        flexibility=at.responses[dofs],
        stiffness_rows=stiffness[k_terms, :, :k],
        mass_rows=mass[m_terms],
    )


def _joint_blocks(pencil: Pencil, terms: Ints, dofs: Ints) -> Floats:
    """The stiffness terms on rows and columns ``dofs``, (n_terms, j, j)."""
    blocks = np.zeros((len(terms), len(dofs), len(dofs)))
    position = np.full(pencil.n_dof, -1, dtype=np.intp)
    position[dofs] = np.arange(len(dofs))
    columns = pencil.by_term[0]
    for block, term in zip(blocks, terms, strict=True):
        part = slice(columns.indptr[term], columns.indptr[term + 1])
        entries = columns.indices[part]
        rows, cols = position[pencil.rows[entries]], position[pencil.columns[entries]]
        block[rows, cols] = columns.data[part]
    return blocks


def corrected(gram: Floats, here: Pose, theta: Floats, g: Floats) -> Floats:
    """ρ_iᵀ K_E(q, y0)⁻¹ ρ_j (n, c, c) from the same in K0⁻¹, θ at (q, y0) and g (n, j, c)."""
    if not len(here.terms):
        return gram
    change = theta[here.terms] - here.theta0[:, None]
    delta = np.tensordot(change.T, here.stiffness, axes=1)
    eye = np.eye(delta.shape[1])
    less = np.swapaxes(g, 1, 2) @ np.linalg.solve(eye + delta @ here.flexibility, delta @ g)
    kept = gram - 0.5 * (less + np.swapaxes(less, 1, 2))
    diagonal = np.arange(gram.shape[1])
    least = FLOOR * gram[:, diagonal, diagonal]
    kept[:, diagonal, diagonal] = np.maximum(kept[:, diagonal, diagonal], least)
    return np.asarray(kept)
