"""Slopes of exact eigenvalues in coordinates and design, without a further eigensolve.

With a mode φ of K φ = λ M φ, φᵀMφ = 1, and the affine pencil K = Σ_j θ_j K_j, M = Σ_j θ_j M_j,

    ∂λ/∂x_i = φᵀ (∂K/∂x_i − λ ∂M/∂x_i) φ = Σ_j (φᵀK_jφ − λ φᵀM_jφ) ∂θ_j/∂x_i

(Fox, Kapoor, AIAA J. 6 (1968) 2426). Where modes of different slope meet, λ by size has a kink
there, and the slope is that of the mode which the solver returns.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.modal.arguments import chunks
from eigassign.modal.exact.solver import modes_at

Floats = NDArray[np.float64]
# Of five-point differences of θ, relative to the scale given: θ' is right to about 1e-12. Slopes in
# lengths need it, where the terms of ∂K/∂x nearly cancel: ∂λ/∂x is then right to 2e-8 along tip
# paths of arms and loops, where central differences of 1e-5 left 4e-7, and steps of 2e-3 3e-7.
STEP = 5e-4


def eigenvalue_slopes(
    pencil: Pencil, x: Floats, count: int, scales: Floats
) -> tuple[Floats, Floats]:
    """λ (n, count) and ∂λ/∂x (n, count, n_x) of the lowest elastic modes at x (n, n_x).

    ``scales`` (n_x,) are changes of x over which θ bends noticeably, such as ranges; along a
    variable whose scale is 0 no slope is taken, and 0 is returned.

    Raises UsageError for more modes than there are or x outside the domain of a section or length,
    MissingMassError for more modes than have mass, MechanismError where K_E or M_FF is singular.
    """
    theta = pencil.theta(x)
    found = modes_at(pencil, theta, count)
    slopes = theta_slopes(pencil.theta_anywhere, x, scales)
    moving = np.flatnonzero(np.abs(slopes).max(axis=(0, 2), initial=0.0) > 0.0)
    stiffness, mass = pencil.stiffness[:, moving], pencil.mass[:, moving]
    entries = np.flatnonzero(np.diff(stiffness.indptr) + np.diff(mass.indptr))
    stiffness, mass = stiffness[entries], mass[entries]
    rows, columns = pencil.rows[entries], pencil.columns[entries]
    result = np.empty((len(x), count, x.shape[1]))
    for part in chunks(np.arange(len(x)), max(len(entries), 1)):
        for mode in range(count):
            phi = found.phi[part, :, mode]
            products = phi[:, rows] * phi[:, columns]
            forms = products @ stiffness - found.lam[part, mode, None] * (products @ mass)
            result[part, mode] = np.einsum("nt,jtn->nj", forms, slopes[:, moving][:, :, part])
    return found.lam, result


def theta_slopes(theta: Callable[[Floats], Floats], x: Floats, scales: Floats) -> Floats:
    """∂θ/∂x (n_x, n_theta, n) at x (n, n_x), with steps h of 5e-4 of ``scales`` (n_x,):

        θ' ≈ (8 (θ(x + h) − θ(x − h)) − (θ(x + 2h) − θ(x − 2h))) / 12h

    Of a variable x_j of one sign at all samples the step is at most 5e-4 of its magnitude, so that
    what must be positive stays so. A variable with scale 0 is kept: its slopes are 0.
    """
    count = len(theta(x[:1]))
    slopes = np.zeros((x.shape[1], count, len(x)))
    least = np.abs(x).min(axis=0, initial=np.inf)
    for j in np.flatnonzero(scales):
        h = STEP * (min(scales[j], least[j]) if least[j] > 1e-3 * scales[j] else scales[j])
        step = np.zeros(x.shape[1])
        step[j] = h
        near = theta(x + step) - theta(x - step)
        far = theta(x + 2.0 * step) - theta(x - 2.0 * step)
        slopes[j] = (8.0 * near - far) / (12.0 * h)
    return slopes
