"""A basis from the Taylor vectors of one or several expansion points, made K-orthonormal.

The rank is decided while orthogonalising: a vector whose remainder is lost in round-off adds
nothing and is left out.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.errors import AccuracyError

Floats = NDArray[np.float64]
DEPENDENT = 1e-9  # remainder, relative to the vector, below which it is taken as dependent
ORTHONORMAL = 1e-8  # post-condition on |VᵀKV − I|, beyond round-off of K itself

INDEFINITE = "the stiffness matrix is not positive definite at an expansion point"


def orthonormal(K: sparse.csc_array | Floats, vectors: Floats) -> Floats:
    """V (n, k) with VᵀKV = I spanning the columns of ``vectors`` (n, N), by Gram-Schmidt twice.

    Raises AccuracyError if K is not positive on a vector or the result is not orthonormal.
    """
    Q = np.zeros((len(vectors), vectors.shape[1]))
    KQ = np.zeros_like(Q)
    rank = 0
    for v in vectors.T:
        size = np.sqrt(_square(K, v))
        if size == 0.0:
            continue
        v = v / size
        for _ in range(2):
            v = v - Q[:, :rank] @ (KQ[:, :rank].T @ v)
        Kv = K @ v
        rest = np.sqrt(max(float(v @ Kv), 0.0))
        if rest > DEPENDENT:
            Q[:, rank], KQ[:, rank] = v / rest, Kv / rest
            rank += 1
    Q, KQ = Q[:, :rank], KQ[:, :rank]
    lost = float(np.abs(Q.T @ KQ - np.eye(rank)).max(initial=0.0))
    if lost > ORTHONORMAL + _rounding(K, Q):
        raise AccuracyError(f"the basis is orthonormal only to {lost:.1e}")
    return Q


def _rounding(K: sparse.csc_array | Floats, Q: Floats) -> float:
    """Round-off of QᵀKQ itself: in a fine mesh it is a small difference of large terms."""
    size = np.abs(Q)
    terms = np.einsum("ij,ij->j", size, abs(K) @ size)
    return 10.0 * float(np.finfo(np.float64).eps * terms.max(initial=0.0))


def _square(K: sparse.csc_array | Floats, v: Floats) -> float:
    square = float(v @ (K @ v))
    if square < 0.0 or not np.isfinite(square):
        raise AccuracyError(INDEFINITE)
    return square
