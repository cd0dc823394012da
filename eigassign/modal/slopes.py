"""Slopes of exact eigenvalues in coordinates and design, without a further eigensolve.

With a mode φ of K φ = λ M φ, φᵀMφ = 1, and the affine pencil K = Σ_j θ_j K_j, M = Σ_j θ_j M_j,

    ∂λ/∂x_i = φᵀ (∂K/∂x_i − λ ∂M/∂x_i) φ = Σ_j (φᵀK_jφ − λ φᵀM_jφ) ∂θ_j/∂x_i

(Fox, Kapoor, AIAA J. 6 (1968) 2426). Where modes of different slope meet, λ by size has a kink
there, and the slope is that of the mode which the solver returns.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.modal.arguments import chunks
from eigassign.modal.exact.solver import modes_at

Floats = NDArray[np.float64]


def eigenvalue_slopes(
    pencil: Pencil, x: Floats, count: int, wanted: ArrayLike
) -> tuple[Floats, Floats]:
    """λ (n, count) and ∂λ/∂x (n, count, n_x) of the lowest elastic modes at x (n, n_x).

    Slopes are taken in those variables where ``wanted`` (n_x,) is not 0; else 0 is returned.

    Raises UsageError for more modes than there are or x outside the domain of a section or length,
    MissingMassError for more modes than have mass, MechanismError where K_E or M_FF is singular.
    """
    theta, along = pencil.theta(x), np.flatnonzero(wanted)
    found = modes_at(pencil, theta, count)
    slopes = pencil.theta_slopes(x, along)
    moving = np.flatnonzero(np.abs(slopes).max(axis=(0, 2), initial=0.0) > 0.0)
    stiffness, mass = pencil.stiffness[:, moving], pencil.mass[:, moving]
    entries = np.flatnonzero(np.diff(stiffness.indptr) + np.diff(mass.indptr))
    stiffness, mass = stiffness[entries], mass[entries]
    rows, columns = pencil.rows[entries], pencil.columns[entries]
    result = np.zeros((len(x), count, x.shape[1]))
    for part in chunks(np.arange(len(x)), max(len(entries), 1)):
        rates = slopes[:, moving][:, :, part]
        for mode in range(count):
            phi = found.phi[part, :, mode]
            products = phi[:, rows] * phi[:, columns]
            forms = products @ stiffness - found.lam[part, mode, None] * (products @ mass)
            result[part[:, None], mode, along] = np.einsum("nt,jtn->nj", forms, rates)
    return found.lam, result
