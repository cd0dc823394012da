"""Exact eigenvalues with their analytic derivatives over the design parameters.

    ∂λ/∂y = φᵀ (∂K/∂y − λ ∂M/∂y) φ,   φᵀ M φ = 1,

with ∂K = Σ_j K_j ∂θ_j: no further eigensolve. The coefficient functions θ are differentiated by
central differences of θ alone, which is cheap and accurate to about 1e-10; of parameters without
room the derivatives are left at 0.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from eigassign.mechanism.pencil import Pencil
from eigassign.modal.exact import modes_at

Floats = NDArray[np.float64]
STEP = 1e-5  # of a central difference, relative to a parameter's range


def theta_slopes(pencil: Pencil, x: Floats, ranges: Floats) -> Floats:
    """∂θ/∂y (n_y, n_theta, n) at samples x (n, n_x); ``ranges`` (n_y,) set the steps."""
    slopes = []
    for j, size in enumerate(ranges):
        if size == 0.0:  # a parameter that is kept
            slopes.append(np.zeros((pencil.n_theta, len(x))))
            continue
        step = np.zeros(x.shape[1])
        step[pencil.n_q + j] = STEP * size
        slopes.append((pencil.theta(x + step) - pencil.theta(x - step)) / (2.0 * STEP * size))
    return np.array(slopes)


def eigenvalue_slopes(
    pencil: Pencil, x: Floats, count: int, ranges: Floats
) -> tuple[Floats, Floats]:
    """λ (n, count) and ∂λ/∂y (n, count, n_y) of the lowest elastic modes at x (n, n_x)."""
    theta = pencil.theta(x)
    found = modes_at(pencil, theta, count)
    slopes = theta_slopes(pencil, x, ranges)
    moving = np.flatnonzero(np.abs(slopes).max(axis=(0, 2)) > 0.0)
    stiffness, mass = pencil.stiffness[:, moving], pencil.mass[:, moving]
    result = np.empty((len(x), count, len(ranges)))
    for mode in range(count):
        phi = found.phi[:, :, mode]
        products = phi[:, pencil.rows] * phi[:, pencil.columns]
        forms = products @ stiffness - found.lam[:, [mode]] * (products @ mass)
        result[:, mode] = np.einsum("nt,jtn->nj", forms, slopes[:, moving])
    return found.lam, result
