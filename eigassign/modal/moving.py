"""Modes along a motion: Φ(t) and Λ(t) with their first and second derivatives in time.

The recursion's invariant subspace X(t), K X = M X Λ_X with Φ0ᵀ M0 X = I, becomes mass-normalised as

    Φ = X N^(−1/2),   Λ = N^(1/2) Λ_X N^(−1/2),   N = XᵀMX,

in which Λ is symmetric and ΦᵀMΦ̇ at t = 0 too: the modes of a cluster do not turn into each other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.mechanism.pencil import Pencil
from eigassign.modal.recursion import expand_subspace
from eigassign.series.lower_set import lower_set, total_degree

Floats = NDArray[np.float64]
Series = tuple[Floats, Floats, Floats]  # coefficients of 1, t and t², or derivatives
IN_TIME = total_degree(1, 2)
IN_TWO = lower_set([[0, 0], [1, 0], [0, 1], [2, 0]])  # t and t² as variables of their own


@dataclass(frozen=True, eq=False)
class MovingModes:
    """Modes (n_dof, r) that are followed together: value, rate and acceleration at one instant."""

    phi: Series  # Φ, Φ̇, Φ̈
    lam: Series  # Λ, Λ̇, Λ̈ (r, r)


def theta_in_time(
    pencil: Pencil, q: Floats, rate: Floats, acceleration: Floats, y: Floats
) -> Floats:
    """θ, θ̇ and θ̈/2 (n_theta, 3) along q + q̇ t + q̈ t²/2."""
    directions = pencil.to_program[:, : len(q)] @ np.stack([rate, 0.5 * acceleration], axis=1)
    theta = pencil.theta_series(IN_TWO, np.concatenate([q, y]), directions)
    one, t, apart, squared = IN_TWO.find(np.array([[0, 0], [1, 0], [0, 1], [2, 0]]))
    return np.stack([theta[:, one], theta[:, t], theta[:, apart] + theta[:, squared]], axis=1)


def moving_modes(pencil: Pencil, theta: Floats, lam: Floats, phi: Floats) -> MovingModes:
    """Those of λ (r,) and Φ (n_dof, r), mass-normalised, for θ of `theta_in_time`."""
    found = expand_subspace(pencil, theta, IN_TIME, lam, phi)
    X, L = (found.vectors[0], found.vectors[1], found.vectors[2]), found.values
    N1, N2 = _normality(pencil, theta, X)
    one = np.eye(len(lam))
    up = (one, 0.5 * N1, 0.5 * N2 - 0.125 * N1 @ N1)
    down = (one, -0.5 * N1, 0.375 * N1 @ N1 - 0.5 * N2)
    Lambda = _product(_product(up, (L[0], L[1], L[2])), down)
    return MovingModes(_derivatives(_product(X, down)), _derivatives(Lambda))


def _normality(pencil: Pencil, theta: Floats, X: Series) -> tuple[Floats, Floats]:
    """N_1 and N_2 (r, r) of N = XᵀMX = I + N_1 t + N_2 t²."""
    M0, M1, M2 = (pencil.sparse(pencil.mass @ column) for column in theta.T)
    cross = X[1].T @ (M1 @ X[0])
    N1 = X[0].T @ (M1 @ X[0])
    N2 = X[0].T @ (M2 @ X[0]) + cross + cross.T + X[1].T @ (M0 @ X[1])
    return N1, N2


def _product(A: Series, B: Series) -> Series:
    return A[0] @ B[0], A[0] @ B[1] + A[1] @ B[0], A[0] @ B[2] + A[1] @ B[1] + A[2] @ B[0]


def _derivatives(A: Series) -> Series:
    return A[0], A[1], 2.0 * A[2]
