"""Round-off of an exact eigenvalue: how many digits the stiffness matrix itself still holds.

A relative perturbation ε of the entries of K changes zᵀKz by at most ε |z|ᵀ|K||z|. In a fine mesh
the strain energy is a small difference of large terms, and this, not the eigensolver, is the limit:

    |δλ|/λ ≲ ε ( |z|ᵀ|K||z| / zᵀKz + |z|ᵀ|M||z| / zᵀMz ) .
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.modal.exact.solver import modes

Floats = NDArray[np.float64]


def rounding_error(pencil: Pencil, x: Floats, count: int) -> float:
    """Relative round-off in frequency of the lowest ``count`` modes at x (n_x,), the largest."""
    found = modes(pencil, x[None], count)
    theta = pencil.theta(x[None])[:, 0]
    z, lam = np.abs(found.phi[0]), found.lam[0]
    K = np.abs(pencil.stiffness @ theta)
    M = np.abs(pencil.mass @ theta)
    pairs = z[pencil.rows] * z[pencil.columns]
    amplification = (K @ pairs) / lam + M @ pairs
    return float(0.5 * np.finfo(float).eps * amplification.max())


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
