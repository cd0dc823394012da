"""What all exact solvers share: the modes they find, and the condensed mass M_c (eq. (1))."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from eigassign.errors import MechanismError

Floats = NDArray[np.float64]
NO_MASS = (
    "a free coordinate moves no mass: give the mechanism mass or lock it. Or two coordinates move "
    "alike, as in a spherical joint at ±90 deg about y (gimbal lock): turn it by its orientation"
)


@dataclass(frozen=True)
class Modes:
    """Eigenvalues λ (n_samples, count) in rad²/s² and modes φ (n_samples, n_dof, count).

    φᵀMφ = I at every sample; the entry of largest magnitude of every mode is positive.
    """

    lam: Floats
    phi: Floats


def positive_at_top(phi: Floats) -> Floats:
    """Modes (…, n_dof, count) whose entries of largest magnitude are positive."""
    at = np.abs(phi).argmax(axis=-2, keepdims=True)
    return np.asarray(phi * np.where(np.take_along_axis(phi, at, axis=-2) < 0.0, -1.0, 1.0))


def condense(
    M: Floats, elastic: NDArray[np.intp], rigid: NDArray[np.intp]
) -> tuple[Floats, Floats]:
    """M_FF⁻¹ M_FE and M_c = M_EE − M_EF M_FF⁻¹ M_FE for a batch of M (n_samples, n, n)."""
    M_FE, M_FF = block(M, rigid, elastic), block(M, rigid, rigid)
    return condense_blocks(block(M, elastic, elastic), M_FE, M_FF)


def condense_blocks(M_EE: Floats, M_FE: Floats, M_FF: Floats) -> tuple[Floats, Floats]:
    """The same from its blocks."""
    if not M_FF.size:
        return M_FE, M_EE
    try:
        np.linalg.cholesky(M_FF)
        coupling = np.linalg.solve(M_FF, M_FE)
    except np.linalg.LinAlgError as error:
        raise MechanismError("mechanism", NO_MASS) from error
    return np.asarray(coupling, dtype=np.float64), M_EE - np.swapaxes(M_FE, 1, 2) @ coupling


def rigid_coupling(M_FF: Floats, M_FE: Floats) -> Floats:
    """M_FF⁻¹ M_FE of one sample, through LAPACK without detours."""
    if not len(M_FF):
        return M_FE
    L, info = lapack.dpotrf(M_FF, lower=1)
    if info:
        raise MechanismError("mechanism", NO_MASS)
    return np.asarray(lapack.dpotrs(L, M_FE, lower=1)[0])


def block(A: Floats, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> Floats:
    """A[:, rows, columns] of a batch in C order, which fancy indexing would transpose in memory."""
    flat = (rows[:, None] * A.shape[2] + columns).ravel()
    taken = A.reshape(len(A), A.shape[1] * A.shape[2]).take(flat, axis=1)
    return np.asarray(taken.reshape(len(A), len(rows), len(columns)))
