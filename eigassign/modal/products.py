"""Dense products that add to what is there, without a temporary of the size of the result."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import blas

Floats = NDArray[np.float64]


def add_product(out: Floats, A: Floats, B: Floats) -> None:
    """out += A B for C-ordered out (m, n), A (m, k), B (k, n)."""
    result = blas.dgemm(1.0, B.T, A.T, 1.0, out.T, overwrite_c=1)
    if not np.may_share_memory(result, out):  # out was not contiguous
        out[...] = result.T
