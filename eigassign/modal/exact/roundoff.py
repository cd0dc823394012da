"""Round-off of an exact eigenvalue: how many digits the matrices and the solver leave.

In a fine mesh the strain energy is a small difference of large terms, and a stiff spring beside a
soft beam drowns it. How much of that an eigenvalue feels is measured: θ → c θ scales K and M alike,
and would change no eigenvalue if numbers were exact. But every product, sum and pivot is rounded
anew, unless c is a power of two; what eigenvalues then differ by is their round-off.

A bound without a solve, for small arrays beside a reduced model: a relative perturbation ε of the
entries of K changes zᵀKz by at most ε |z|ᵀ|K||z|. It is far too large for fine meshes.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import AccuracyError, MechanismError
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.modal.exact.solver import lowest_modes

Floats = NDArray[np.float64]
# No powers of two, beside 1; so many, for some models spread widely at one in ten of them only.
SCALES = np.array([1.0837, 0.8391, 1.2943, 0.7213, 1.613, 0.9127, 1.4711, 0.6173])
# Times the spread in frequency: in some 300 chains of fine beams and stiff springs
# (`tests/stability/roundoff_draws.py`) the true round-off was at most 8.2 times that.
SAFETY = 10.0


def rounding_error(pencil: Pencil, x: Floats, count: int) -> float:
    """Relative round-off in frequency of the lowest ``count`` modes at x (n_x,), the largest.

    Infinite where other roundings of the same matrices have no such modes.
    """
    theta = pencil.theta(x[None])
    plain = lowest_modes(pencil, theta, count, 0).lam
    try:
        lam = lowest_modes(pencil, theta * SCALES, count, 0).lam
    except (AccuracyError, MechanismError):
        return np.inf
    spread = float(np.abs(lam / plain - 1.0).max())
    return 0.5 * SAFETY * max(spread, float(np.finfo(float).eps))


def rounding_weights(pencil: Pencil, theta: Floats) -> tuple[Floats, Floats]:
    """d_K, d_M (n_dof,) with |z|ᵀ|K||z| ≤ Σ d_K z² and |z|ᵀ|M||z| ≤ Σ d_M z², θ (n_theta,).

    From 2 |z_i z_j| ≤ s z_i² + z_j²/s with s = √(K_ii/K_jj), so that units do not mix.
    """
    return (
        _weights(pencil, np.abs(pencil.stiffness @ theta)),
        _weights(pencil, np.abs(pencil.mass @ theta)),
    )


def _weights(pencil: Pencil, data: Floats) -> Floats:
    on = pencil.rows == pencil.columns
    diagonal = np.zeros(pencil.n_dof)
    diagonal[pencil.rows[on]] = data[on]
    size = np.sqrt(np.where(diagonal > 0.0, diagonal, np.inf))
    parts = np.where(np.isfinite(size[pencil.rows]), data / size[pencil.columns], 0.0)
    sums = np.zeros(pencil.n_dof)
    np.add.at(sums, pencil.rows, parts)
    return np.where(np.isfinite(size), size, 0.0) * sums
