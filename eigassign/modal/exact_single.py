"""Exact elastic modes of one small dense sample, through LAPACK without detours.

The reduction of ``exact``: K_E = C Cᵀ, A = C⁻¹ M_c C⁻ᵀ, A v = μ v, z = C⁻ᵀ v.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from eigassign.errors import LIMP, AccuracyError, MechanismError
from eigassign.mechanism.pencil import Pencil
from eigassign.modal.massive import doubtful, mass_sizes, solve_massive

Floats = NDArray[np.float64]
ALL_AT_ONCE = 64  # unknowns up to which all eigenpairs cost no more than the wanted ones


def solve_single(pencil: Pencil, theta: Floats, count: int) -> tuple[Floats, Floats]:
    """λ (count,), ascending, and modes (n_dof, count) with φᵀMφ = 1 for θ (n_theta, 1).

    The entry of largest magnitude of every mode is positive.
    """
    order, n = pencil.elastic_first, len(pencil.elastic)
    A, C, coupling = _standard(pencil, theta)
    mu, v = _largest(A, count)
    z, _ = lapack.dtrtrs(C, v, lower=1, trans=1)
    noise = mass_sizes(pencil, theta, coupling[None])[0] @ (z * z)
    if doubtful(mu, noise, n).any():
        lam, phi = solve_massive(pencil, theta, count)
    else:
        z = z / np.sqrt(mu)
        lam, phi = 1.0 / mu, np.concatenate([z, -coupling @ z])
        if order is not None:
            phi[order] = phi.copy()
    top = phi[np.abs(phi).argmax(axis=0), np.arange(count)]
    return lam, phi * np.copysign(1.0, top)


def single_values(pencil: Pencil, theta: Floats, count: int) -> Floats:
    """λ (count,) alone."""
    A, C, coupling = _standard(pencil, theta)
    mu, _, info = lapack.dsyevd(A, compute_v=0, lower=1, overwrite_a=1)
    if info:
        raise AccuracyError("the exact modes did not converge")
    mu = mu[::-1][:count]
    flexibility = (lapack.dtrtri(C, lower=1)[0] ** 2).sum(axis=0)
    noise = flexibility @ mass_sizes(pencil, theta, coupling[None])[0]
    if doubtful(mu, noise, len(A))[-1]:
        return solve_massive(pencil, theta, count)[0]
    return np.asarray(1.0 / mu)


def _standard(pencil: Pencil, theta: Floats) -> tuple[Floats, Floats, Floats]:
    """A's lower triangle, C and M_FF⁻¹ M_FE."""
    (K,), (M,) = pencil.matrices(theta)
    order, n = pencil.elastic_first, len(pencil.elastic)
    if order is not None:
        K, M = K[order[:, None], order], M[order[:, None], order]
    E, F = slice(n), slice(n, pencil.n_dof)
    C, info = lapack.dpotrf(K[E, E].T, lower=1, overwrite_a=1)
    if info:
        raise MechanismError("mechanism", LIMP)
    coupling = _coupling(M[F, F], M[F, E])
    M_c = M[E, E] - M[E, F] @ coupling
    A, _ = lapack.dsygst(M_c.T, C, lower=1, overwrite_a=1)
    return A, C, coupling


def _coupling(M_FF: Floats, M_FE: Floats) -> Floats:
    if not len(M_FF):
        return M_FE
    L, info = lapack.dpotrf(M_FF, lower=1)
    if info:
        raise MechanismError(
            "mechanism", "a free coordinate moves no mass: give the mechanism mass or lock it"
        )
    return np.asarray(lapack.dpotrs(L, M_FE, lower=1)[0])


def _largest(A: Floats, count: int) -> tuple[Floats, Floats]:
    """The largest eigenvalues of A, descending, and their vectors."""
    n = len(A)
    if n <= ALL_AT_ONCE:
        mu, v, info = lapack.dsyevd(A, lower=1, overwrite_a=1)
    else:
        mu, v, found, _, info = lapack.dsyevr(A, range="I", il=n - count + 1, iu=n, lower=1)
        mu, v = mu[:found], v[:, :found]
    if info or len(mu) < count:
        raise AccuracyError("the exact modes did not converge")
    return np.asarray(mu[::-1][:count]), np.asarray(v[:, ::-1][:, :count])
