"""Projection of every term of the affine pencil on a basis: Vᵀ K_j V, Vᵀ M_j V."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.mechanism.pencil import Pencil

Floats = NDArray[np.float64]


def project(pencil: Pencil, basis: Floats) -> tuple[Floats, Floats]:
    """(n_theta, k, k) projections of the stiffness and the mass terms on ``basis`` (n_dof, k)."""
    stacks = pencil.term_stacks
    if stacks is not None:
        return basis.T @ (stacks[0] @ basis), basis.T @ (stacks[1] @ basis)
    return (
        _project(pencil, pencil.stiffness, basis),
        _project(pencil, pencil.mass, basis),
    )


def _project(pencil: Pencil, weights: sparse.csr_array, basis: Floats) -> Floats:
    """Σ over the non-zeros of each term of value × basis[row]ᵀ basis[column].

    The terms are stacked by their non-zero rows only, so that memory follows the non-zeros.
    """
    entries = weights.tocoo()
    at, theta = entries.coords
    key = theta.astype(np.int64) * pencil.n_dof + pencil.rows[at]
    stacked, row = np.unique(key, return_inverse=True)
    shape = (len(stacked), pencil.n_dof)
    tall = sparse.csr_array((entries.data, (row, pencil.columns[at])), shape=shape)
    right = tall @ basis
    left = basis[stacked % pencil.n_dof]
    bounds = np.searchsorted(stacked // pencil.n_dof, np.arange(weights.shape[1] + 1))
    pieces = itertools.pairwise(bounds)
    return np.array([left[i:j].T @ right[i:j] for i, j in pieces])
