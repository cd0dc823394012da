"""The modes as data, the condensed mass M_c, and the modes that have mass.

An eigenvalue μ = 1/λ of M_c z = μ K_E z that ought to be zero comes out as round-off: of the
eigensolver, ε n μ_1, and of the condensed mass, in which M_EE and M_EF M_FF⁻¹ M_FE cancel. With
m_i = Σ_j |θ_j (M_j)_ii| and W = M_FF⁻¹ M_FE the latter is, entry by entry,

    |δM_c|_ij ≤ c n ε t_i t_j,   t_i = √m_i + Σ_f |W_fi| √m_f .

Where every μ asked for is well above both, all of them have mass. Where one is not, the mass
decides and not the size of μ: with T = diag(t), T⁻¹ M_c T⁻¹ = G Gᵀ by Cholesky with diagonal
pivots, down to pivots of c n ε. G has as many columns as modes have mass, and the singular values
of C⁻¹ T G, K_E = C Cᵀ, are √μ: stiff modes keep digits there that they have lost in μ.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack, svd

from eigassign.errors import LIMP, AccuracyError, MechanismError, MissingMassError
from eigassign.mechanism.assembly.pencil import Pencil

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


Flags = NDArray[np.bool_]
ROUND_OFF = 10.0 * float(np.finfo(np.float64).eps)  # c ε, times n
STIFFEST = 1e-10  # √μ/√μ_1 down to which a singular value keeps five digits
MARGIN = 1e3  # a μ above the eigensolver's round-off by this much keeps its digits
INDEFINITE = 1e-9  # of the scaled mass left over by its Cholesky factor that is no round-off


def mass_sizes(pencil: Pencil, theta: Floats, coupling: Floats) -> Floats:
    """t² (n_samples, n_elastic); θ (n_theta, n_samples), W (n_samples, n_rigid, n_elastic)."""
    root = np.sqrt(pencil.mass_magnitude @ np.abs(theta)).T
    size = root[:, pencil.elastic]
    if coupling.size:
        size += (root[:, None, pencil.rigid] @ np.abs(coupling))[:, 0]
    return np.asarray(size * size)


def may_be_roundoff(mu: Floats, noise: Floats, n: int, margin: float = MARGIN) -> Flags:
    """Which μ (…, count), descending, may be round-off; ``noise`` ≥ zᵀ T² z of K_E-unit z.

    The eigensolver's counts ``margin`` times, since singular values have less of it; that of M_c
    stays whatever is done.
    """
    return np.asarray(mu <= ROUND_OFF * n * (noise + margin * mu[..., :1]))


def modes_with_mass(pencil: Pencil, theta: Floats, count: int) -> tuple[Floats, Floats]:
    """λ (count,) and mass-normalised modes (n_dof, count), signs as they come, θ (n_theta, 1).

    Raises MissingMassError where fewer have mass, AccuracyError for an indefinite mass.
    """
    K, M = pencil.matrices(theta)
    E = pencil.elastic
    coupling, M_c = condense(M, E, pencil.rigid)
    G = _factor(M_c[0], np.sqrt(mass_sizes(pencil, theta, coupling)[0]))
    C, info = lapack.dpotrf(K[0][np.ix_(E, E)], lower=1)
    if info:
        raise MechanismError("mechanism", LIMP)
    U, root, _ = svd(lapack.dtrtrs(C, G, lower=1)[0], full_matrices=False)
    most = int((root > STIFFEST * root.max(initial=0.0)).sum())
    if most < count:
        raise MissingMassError(most)
    z = lapack.dtrtrs(C, U[:, :count], lower=1, trans=1)[0] / root[:count]
    phi = np.empty((pencil.n_dof, count))
    phi[E], phi[pencil.rigid] = z, -coupling[0] @ z
    return root[:count] ** -2.0, phi


def _factor(M_c: Floats, t: Floats) -> Floats:
    """T G (n, rank) with T G Gᵀ T = M_c up to round-off."""
    scale = np.divide(1.0, t, out=np.zeros_like(t), where=t > 0.0)
    scaled = scale[:, None] * M_c * scale
    L, pivots, rank, _ = lapack.dpstrf(scaled, tol=ROUND_OFF * len(t), lower=1)
    G = np.zeros((len(t), rank))
    G[pivots - 1] = np.tril(L)[:, :rank]
    if np.abs(scaled - G @ G.T).max(initial=0.0) > INDEFINITE:
        raise AccuracyError("the mass matrix is not positive semidefinite")
    return np.asarray(t[:, None] * G)
