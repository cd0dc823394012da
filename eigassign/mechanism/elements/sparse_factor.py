"""Factors of symmetric definite sparse matrices, and whether a matrix is one."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse import linalg

Floats = NDArray[np.float64]


def factorise(matrix: sparse.csc_array) -> linalg.SuperLU:
    """LU without pivoting off the diagonal: cheap in fill-in, right for definite matrices.

    For others the caller checks what comes out.
    """
    options = {"SymmetricMode": True}
    return lu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options=options)


def lu(matrix: sparse.csc_array, **options: Any) -> linalg.SuperLU:
    """SuperLU's factors; RuntimeError where a pivot is exactly zero, MemoryError without memory."""
    try:
        return linalg.splu(matrix, **options)
    except RuntimeError as error:
        if "singular" in str(error):
            raise
        raise MemoryError(str(error)) from error  # of a malloc that failed


def has_positive_pivots(factor: linalg.SuperLU) -> bool:
    """True where all pivots are on the diagonal and positive: the matrix is definite."""
    return bool((factor.perm_r == factor.perm_c).all() and (factor.U.diagonal() > 0.0).all())


def definite_factor(matrix: sparse.csc_array) -> linalg.SuperLU | None:
    """The factor of a symmetric positive definite matrix; None where it is not definite."""
    try:
        factor = factorise(matrix)
    except RuntimeError:  # a pivot is exactly zero
        return None
    diagonal = np.asarray(matrix.diagonal())[np.argsort(factor.perm_c)]
    pivots = np.asarray(factor.U.diagonal())
    # a pivot of a definite matrix is more than the round-off of its diagonal entry
    return factor if (pivots > 1e-15 * np.abs(diagonal)).all() else None


@dataclass(frozen=True)
class _Matrix:
    """A sparse matrix, the same where all its numbers are."""

    digest: bytes
    matrix: sparse.csc_array = field(compare=False)


def kept_factor(matrix: sparse.csc_array) -> linalg.SuperLU | None:
    """`definite_factor`, once for a matrix that is asked for again and again.

    A part that a design leaves alone has the same stiffness at every design and in every model.
    """
    indices = (np.asarray(a, dtype=np.int64) for a in (matrix.indptr, matrix.indices))
    parts = (*indices, np.asarray(matrix.data, dtype=np.float64))  # the first tells the order n
    digest = hashlib.sha256(b"".join(hashlib.sha256(a.tobytes()).digest() for a in parts)).digest()
    return _kept(_Matrix(digest, matrix))


@lru_cache(maxsize=4)  # few, for factors of large parts are large
def _kept(asked: _Matrix) -> linalg.SuperLU | None:
    return definite_factor(asked.matrix)


def is_semidefinite(matrix: sparse.csr_array, tolerance: float) -> bool:
    """Whether A + tolerance × diag(A) is positive definite on the rows that are not zero.

    Negative eigenvalues within the tolerance, relative to the diagonal, pass for round-off.
    """
    diagonal = np.asarray(matrix.diagonal())
    present = np.flatnonzero(np.asarray(abs(matrix).sum(axis=1)).ravel())
    if (diagonal[present] <= 0.0).any():
        return False
    if not len(present):
        return True
    scale = sparse.diags_array(1.0 / np.sqrt(diagonal[present]))
    scaled = scale @ matrix[present][:, present] @ scale
    eye = sparse.eye_array(len(present))
    return definite_factor(sparse.csc_array(scaled + tolerance * eye)) is not None
