"""Batches of small triangular matrices."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
LEAF = 16  # order up to which LAPACK's general inverse is quicker than halving
FEW, LEAF_OF_FEW = 8, 32  # so many matrices, for which calls cost more than arithmetic


def triangular_inverse(L: Floats) -> Floats:
    """L⁻¹ for lower triangular L (n, k, k), by halves: most of the work is products.

    ⎡ A 0 ⎤⁻¹   ⎡ A⁻¹          0  ⎤
    ⎣ B C ⎦   = ⎣ −C⁻¹ B A⁻¹  C⁻¹ ⎦
    """
    k = L.shape[1]
    if k <= (LEAF_OF_FEW if len(L) <= FEW else LEAF):
        return np.asarray(np.linalg.inv(L), dtype=np.float64)
    half = k // 2
    inverse = np.zeros_like(L)
    A, C = triangular_inverse(L[:, :half, :half]), triangular_inverse(L[:, half:, half:])
    inverse[:, :half, :half], inverse[:, half:, half:] = A, C
    inverse[:, half:, :half] = -C @ (L[:, half:, :half] @ A)
    return inverse
