"""Projections of the pencil on a basis, term by term: Wᵀ K_j V and Wᵀ M_j V, or at one θ."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.mechanism.assembly.pencil import Pencil

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
CHUNK = 4_000  # rows multiplied at once, so that the products stay in the cache
PIECE = 16_000_000  # numbers projected at once: 128 MB, not 320 at order 10 in seven variables


@dataclass(frozen=True)
class ProjectedTerms:
    """L A_j Rᵀ (n_matrices, n_terms, l, r) of ``terms`` j of the ``matrices``: 0 is K, 1 is M."""

    matrices: slice
    terms: Ints | slice
    values: Floats


def project(pencil: Pencil, basis: Floats) -> tuple[Floats, Floats]:
    """(n_theta, k, k) projections of the stiffness and the mass terms on ``basis`` (n_dof, k)."""
    out = np.zeros((2, pencil.n_theta, basis.shape[1], basis.shape[1]))
    for part in project_terms(pencil, basis.T, basis.T, np.arange(pencil.n_theta)):
        out[part.matrices, part.terms] = part.values
    return out[0], out[1]


def project_terms(
    pencil: Pencil, left: Floats, right: Floats, wanted: Ints
) -> Iterator[ProjectedTerms]:
    """The ``wanted`` terms of K and M projected on rows L, R (·, n_dof); small pencils' all."""
    n, stacks = pencil.n_dof, pencil.term_stacks
    step = max(PIECE // max(2 * len(left) * len(right), 1), 1)
    if stacks is None:
        W, V = np.ascontiguousarray(left.T), np.ascontiguousarray(right.T)
        for which, terms in enumerate(pencil.by_term):
            for first in range(0, len(wanted), 2 * step):
                some = wanted[first : first + 2 * step]
                yield _project(pencil, which, terms, W, V, some)
        return
    for first in range(0, pencil.n_theta, step):
        those = slice(first, first + step)
        part = stacks[:, :, those]
        full = (left @ part.reshape(n, -1)).reshape(-1, n) @ right.T
        values = full.reshape(len(left), 2, part.shape[2], len(right)).transpose(1, 2, 0, 3)
        yield ProjectedTerms(slice(0, 2), those, values)


def project_at(pencil: Pencil, theta: Floats, rows: Floats) -> Floats:
    """R K Rᵀ and R M Rᵀ at θ (n_theta, 1), (2, k, k), for rows R (k, n_dof)."""
    if pencil.is_dense:
        return np.asarray(rows @ pencil.matrices(theta)[:, 0] @ rows.T)
    V = np.ascontiguousarray(rows.T)
    out = np.zeros((2, len(rows), len(rows)))
    for square, weights in zip(out, (pencil.stiffness, pencil.mass), strict=True):
        matrix = pencil.sparse(weights @ theta[:, 0]).T
        for i in range(0, len(V), CHUNK):
            square += V[i : i + CHUNK].T @ (matrix[i : i + CHUNK] @ V)
    return out


def _project(
    pencil: Pencil, which: int, terms: sparse.csc_array, W: Floats, V: Floats, wanted: Ints
) -> ProjectedTerms:
    """Wᵀ A_j V of every wanted term that there is, over its non-zero rows only."""
    there = wanted[np.diff(terms.indptr)[wanted] > 0]
    tall, rows, bounds = _stacked(pencil, terms, there)
    out = np.zeros((1, len(there), W.shape[1], V.shape[1]))
    for i in range(0, len(rows), CHUNK):
        part = tall if len(rows) <= CHUNK else tall[i : i + CHUNK]  # slicing costs as much
        products, others = part @ W, V[rows[i : i + CHUNK]]
        first, last = np.searchsorted(bounds, [i + 1, i + len(others)], side="left") - 1
        for k in range(first, last + 1):
            a, b = max(bounds[k] - i, 0), bounds[k + 1] - i
            out[0, k] += products[a:b].T @ others[a:b]
    return ProjectedTerms(slice(which, which + 1), there, out)


def _stacked(
    pencil: Pencil, terms: sparse.csc_array, there: Ints
) -> tuple[sparse.csr_array, Ints, Ints]:
    """The non-zero rows of the terms below each other, their numbers, and where terms begin."""
    starts = np.concatenate([[0], np.cumsum(np.diff(terms.indptr)[there])])
    shift = terms.indptr[there] - starts[:-1]
    entries = np.arange(starts[-1]) + np.repeat(shift, np.diff(starts))
    row, column = pencil.rows[terms.indices[entries]], pencil.columns[terms.indices[entries]]
    new = np.ones(len(row), dtype=bool)  # entries of one term run row by row
    new[1:] = row[1:] != row[:-1]
    new[starts[:-1]] = True
    first = np.flatnonzero(new)
    shape = (len(first), pencil.n_dof)
    limits = np.append(first, len(row))
    tall = sparse.csr_array((terms.data[entries], column, limits), shape=shape)
    return tall, row[first], np.searchsorted(first, starts).astype(np.intp)
