"""Projections of the pencil on a basis, term by term: Vᵀ K_j W, Vᵀ M_j W, or at one θ."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.mechanism.pencil import Pencil
from eigassign.modal.sizes import DENSE_LIMIT

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
CHUNK = 4_000  # rows multiplied at once, so that the products stay in the cache


def project(pencil: Pencil, basis: Floats) -> tuple[Floats, Floats]:
    """(n_theta, k, k) projections of the stiffness and the mass terms on ``basis`` (n_dof, k)."""
    every = np.ones(pencil.n_theta, dtype=bool)
    stiffness, mass = project_terms(pencil, basis.T, basis.T, every)
    return stiffness, mass


def project_terms(pencil: Pencil, left: Floats, right: Floats, wanted: NDArray[np.bool_]) -> Floats:
    """L K_j Rᵀ and L M_j Rᵀ of the ``wanted`` terms, (2, n_theta, l, r), for rows L, R (·, n_dof).

    The others are zero, or as they are where that is no extra work.
    """
    stacks = pencil.term_stacks
    if stacks is None:
        W, V = np.ascontiguousarray(left.T), np.ascontiguousarray(right.T)
        return np.array([_project(pencil, terms, W, V, wanted) for terms in pencil.by_term])
    n = pencil.n_dof
    half = left @ stacks.reshape(n, -1)  # every term at once
    full = half.reshape(-1, n) @ right.T
    return np.asarray(full.reshape(len(left), 2, -1, len(right)).transpose(1, 2, 0, 3))


def project_at(pencil: Pencil, theta: Floats, rows: Floats) -> Floats:
    """R K Rᵀ and R M Rᵀ at θ (n_theta, 1), (2, k, k), for rows R (k, n_dof)."""
    if pencil.n_dof <= DENSE_LIMIT:
        K, M = pencil.matrices(theta)
        return np.array([rows @ K[0] @ rows.T, rows @ M[0] @ rows.T])
    V = np.ascontiguousarray(rows.T)
    weights = (pencil.stiffness, pencil.mass)
    return np.array([_square(pencil.sparse(w @ theta[:, 0]).T, V) for w in weights])


def _square(matrix: sparse.csr_array, V: Floats) -> Floats:
    """Vᵀ A V."""
    out = np.zeros((V.shape[1], V.shape[1]))
    for i in range(0, len(V), CHUNK):
        out += V[i : i + CHUNK].T @ (matrix[i : i + CHUNK] @ V)
    return out


def _project(
    pencil: Pencil, terms: sparse.csc_array, W: Floats, V: Floats, wanted: NDArray[np.bool_]
) -> Floats:
    """Wᵀ A_j V of every wanted term, over its non-zero rows only."""
    tall, rows, term = _stacked(pencil, terms, wanted)
    out = np.zeros((terms.shape[1], W.shape[1], V.shape[1]))
    for i in range(0, len(rows), CHUNK):
        here = term[i : i + CHUNK]
        products, others = tall[i : i + CHUNK] @ W, V[rows[i : i + CHUNK]]
        cuts = np.flatnonzero(np.diff(here)) + 1
        for a, b in zip([0, *cuts.tolist()], [*cuts.tolist(), len(here)], strict=True):
            out[here[a]] += products[a:b].T @ others[a:b]
    return out


def _stacked(
    pencil: Pencil, terms: sparse.csc_array, wanted: NDArray[np.bool_]
) -> tuple[sparse.csr_array, Ints, Ints]:
    """The non-zero rows of all wanted terms below each other; of each, its number and its term."""
    theta = np.repeat(np.arange(terms.shape[1]), np.diff(terms.indptr))
    keep = np.flatnonzero(wanted[theta])
    theta, entries = theta[keep], terms.indices[keep]
    row, column = pencil.rows[entries], pencil.columns[entries]
    new = np.ones(len(row), dtype=bool)  # entries of one term run row by row
    new[1:] = (row[1:] != row[:-1]) | (theta[1:] != theta[:-1])
    first = np.flatnonzero(new)
    shape = (len(first), pencil.n_dof)
    starts = np.append(first, len(row))
    tall = sparse.csr_array((terms.data[keep], column, starts), shape=shape)
    return tall, row[first], theta[first]
