"""Ritz pairs of batches of small matrices: M_c z = μ K z, with K = L Lᵀ as L⁻¹ M_c L⁻ᵀ v = μ v."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import LIMP, MechanismError
from eigassign.modal.triangular import triangular_inverse

Floats = NDArray[np.float64]


def ritz_values(K: Floats, M_c: Floats) -> Floats:
    """μ descending (n, k); of K (n, k, k) only the lower triangle is read."""
    return np.asarray(np.linalg.eigvalsh(_standard(K, M_c)[0])[:, ::-1])


def ritz_pairs(K: Floats, M_c: Floats) -> tuple[Floats, Floats]:
    """μ descending (n, k) and z (n, k, k) with zᵀKz = 1."""
    A, inverse = _standard(K, M_c)
    mu, v = np.linalg.eigh(A)
    return mu[:, ::-1], (np.swapaxes(inverse, 1, 2) @ v)[:, :, ::-1]


def _standard(K: Floats, M_c: Floats) -> tuple[Floats, Floats]:
    """L⁻¹ M_c L⁻ᵀ and L⁻¹; MechanismError where K is not positive definite."""
    try:
        inverse = triangular_inverse(np.asarray(np.linalg.cholesky(K), dtype=np.float64))
    except np.linalg.LinAlgError as error:
        raise MechanismError("mechanism", LIMP) from error
    return inverse @ M_c @ np.swapaxes(inverse, 1, 2), inverse
