"""Projection of every term of the affine pencil on a basis: Vᵀ K_j V, Vᵀ M_j V."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.mechanism.pencil import Pencil

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]


CHUNK = 4_000  # rows of the stacked terms multiplied at once, so that the products stay in cache


def project(pencil: Pencil, basis: Floats) -> tuple[Floats, Floats]:
    """(n_theta, k, k) projections of the stiffness and the mass terms on ``basis`` (n_dof, k)."""
    stiffness, mass = project_rows(pencil, basis.T)
    return stiffness, mass


def project_rows(pencil: Pencil, rows: Floats) -> Floats:
    """The same for a basis in rows (k, n_dof), as one array (2, n_theta, k, k)."""
    stacks = pencil.term_stacks
    if stacks is None:
        basis = np.ascontiguousarray(rows.T)
        return np.array([_project(pencil, terms, basis) for terms in pencil.by_term])
    k, n = rows.shape
    half = rows @ stacks.reshape(n, -1)  # every term at once
    full = half.reshape(-1, n) @ rows.T
    return np.asarray(full.reshape(k, 2, -1, k).transpose(1, 2, 0, 3))


def _project(pencil: Pencil, terms: sparse.csc_array, basis: Floats) -> Floats:
    """Σ over the non-zeros of each term of value × basis[row]ᵀ basis[column].

    The terms are stacked by their non-zero rows only, so that memory follows the non-zeros.
    """
    tall, rows, bounds = _stacked(pencil, terms)
    k = basis.shape[1]
    out = np.zeros((terms.shape[1], k, k))
    for term, (first, last) in enumerate(itertools.pairwise(bounds.tolist())):
        for i in range(first, last, CHUNK):
            j = min(i + CHUNK, last)
            first_row, last_row = rows[i], rows[j - 1] + 1
            whole = last_row - first_row == j - i  # no row is missing: a view will do
            left = basis[first_row:last_row] if whole else basis[rows[i:j]]
            out[term] += left.T @ (tall[i:j] @ basis)
    return out


def _stacked(pencil: Pencil, terms: sparse.csc_array) -> tuple[sparse.csr_array, Ints, Ints]:
    """The non-zero rows of all terms below each other, which rows they are, where terms begin."""
    theta = np.repeat(np.arange(terms.shape[1]), np.diff(terms.indptr))
    row, column = pencil.rows[terms.indices], pencil.columns[terms.indices]
    new = np.empty(len(row), dtype=bool)  # entries of one term run row by row
    new[:1] = True
    new[1:] = (row[1:] != row[:-1]) | (theta[1:] != theta[:-1])
    first = new.nonzero()[0]
    starts = np.append(first, len(row))
    shape = (len(first), pencil.n_dof)
    tall = sparse.csr_array((terms.data, column, starts), shape=shape)
    bounds = np.searchsorted(theta[first], np.arange(terms.shape[1] + 1))
    return tall, row[first], bounds.astype(np.intp)
