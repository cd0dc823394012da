"""Symmetric sparse matrices from the non-zeros of the pencil, without sorting or duplicates."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.mechanism.definite import factorise
from eigassign.mechanism.pencil import Pencil

__all__ = ["block", "factorise", "principal"]

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]


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
