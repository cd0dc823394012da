"""The residual's factors R B_j with R from half a solve instead of a Gram matrix.

‖a‖² in K0⁻¹ is |L⁻¹a|² with K0 = L Lᵀ. Terms of the residual are large where one link is carried by
another and cancel in the sum; a Gram matrix AᵀK0⁻¹A would keep half the digits of that only. So
L⁻¹A = Q R by orthogonal triangularisation, and R serves as in `residual`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.errors import AccuracyError
from eigassign.mechanism.pencil import Pencil
from eigassign.modal.basis import INDEFINITE
from eigassign.modal.residual import (
    UNIT_LIMIT,
    Residual,
    _blocks,
    _span,
    _terms,
    _with_rigid,
    residual_factors,
)
from eigassign.modal.symmetric import factorise

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]


def accurate_factors(pencil: Pencil, K0: sparse.csc_array, V: Floats, elastic: Ints) -> Residual:
    """As `residual.residual_factors`, to the accuracy of L⁻¹ whatever the size."""
    if len(elastic) <= UNIT_LIMIT:
        return residual_factors(pencil, K0, V, elastic)
    wide = _with_rigid(pencil, V, elastic)
    stiff = _blocks(pencil, pencil.stiffness, wide[:, : V.shape[1]], elastic)
    heavy = _blocks(pencil, pencil.mass, wide, elastic)
    A, coordinates = _span(stiff + heavy, len(elastic))
    R = np.linalg.qr(half_solve(K0, A), mode="r")
    split = len(stiff)
    return Residual(
        _terms(stiff),
        np.array([R @ c for c in coordinates[:split]]),
        _terms(heavy),
        np.array([R @ c for c in coordinates[split:]]),
    )


def half_solve(K0: sparse.csc_array, A: Floats) -> Floats:
    """L⁻¹ P A with P K0 Pᵀ = L Lᵀ; raises AccuracyError where K0 is not positive definite."""
    from scipy.sparse.linalg import spsolve_triangular

    factors = factorise(K0)
    pivots = factors.U.diagonal()
    if (factors.perm_r != factors.perm_c).any() or not (pivots > 0.0).all():
        raise AccuracyError(INDEFINITE)
    permuted = np.empty_like(A)
    permuted[factors.perm_r] = A
    lower = factors.L.tocsr()
    solved = spsolve_triangular(lower, permuted, lower=True, unit_diagonal=True)
    return np.asarray(solved / np.sqrt(pivots)[:, None])
