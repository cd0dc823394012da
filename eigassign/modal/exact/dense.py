"""Exact elastic modes of small pencils: one sample through LAPACK, or many at once.

M_c z = μ K_E z with K_E = C Cᵀ becomes A v = μ v, A = C⁻¹ M_c C⁻ᵀ and z = C⁻ᵀ v. Where a μ may be
round-off, the sample is solved anew by `massless`.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from eigassign.errors import LIMP, AccuracyError, MechanismError
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.modal.arguments import chunks
from eigassign.modal.exact.condensation import (
    Modes,
    block,
    condense_blocks,
    mass_sizes,
    may_be_roundoff,
    modes_with_mass,
    positive_at_top,
    rigid_coupling,
)

Floats = NDArray[np.float64]
UPPER: Literal["U"] = "U"  # half of (L⁻¹ M_c) L⁻ᵀ that is read: the other has more round-off


def solve_dense(pencil: Pencil, theta: Floats, count: int, vectors: bool) -> Modes:
    """Modes at θ (n_theta, n_samples); one sample goes to LAPACK alone, many in chunks."""
    if theta.shape[1] == 1 and not vectors:
        return Modes(single_values(pencil, theta, count)[None], np.zeros((1, 0, count)))
    if theta.shape[1] == 1:
        lam, phi = solve_single(pencil, theta, count)
        return Modes(lam[None], phi[None])
    samples = chunks(np.arange(theta.shape[1]), pencil.n_dof**2)
    parts = [_batch(pencil, theta[:, at], count, vectors) for at in samples]
    if len(parts) == 1:
        return parts[0]
    return Modes(np.concatenate([p.lam for p in parts]), np.concatenate([p.phi for p in parts]))


def _batch(pencil: Pencil, theta: Floats, count: int, vectors: bool) -> Modes:
    """Modes at θ (n_theta, n_samples): as many samples as stay in the processor's cache."""
    K, M = _elastic_first(pencil, theta)
    n = len(pencil.elastic)
    coupling, M_c = condense_blocks(M[:, :n, :n], M[:, n:, :n], M[:, n:, n:])
    L_inverse = inverse_factor(K[:, :n, :n])
    A = (L_inverse @ M_c) @ np.swapaxes(L_inverse, 1, 2)
    # Σ_i (K_E⁻¹)_ii t_i²: zᵀ T² z of no K_E-unit z is more
    sizes = mass_sizes(pencil, theta, coupling)
    noise = np.asarray(np.einsum("kij,kij,kj->k", L_inverse, L_inverse, sizes)[:, None])
    if not vectors:
        mu = np.asarray(np.linalg.eigvalsh(A, UPPER)[:, ::-1][:, :count], dtype=np.float64)
        return _with_mass(pencil, theta, mu, noise, np.zeros((len(mu), 0, count)))
    mu, v = (a[..., ::-1][..., :count] for a in np.linalg.eigh(A, UPPER))
    z = np.swapaxes(L_inverse, 1, 2) @ v / np.sqrt(np.maximum(mu, 1e-300))[:, None, :]
    phi = np.empty((len(mu), pencil.n_dof, count))
    phi[:, pencil.elastic] = z
    phi[:, pencil.rigid] = -coupling @ z
    return _with_mass(pencil, theta, mu, noise, phi)


def _elastic_first(pencil: Pencil, theta: Floats) -> tuple[Floats, Floats]:
    """K and M with the rigid unknowns last; K once where it is the same at all samples."""
    order, stiff = pencil.elastic_first, theta[pencil.has_term[0]]
    if (stiff == stiff[:, :1]).all():  # as where one pose meets many added masses
        K, M = pencil.stiffness_matrices(theta[:, :1]), pencil.mass_matrices(theta)
    else:
        K, M = pencil.matrices(theta)
    if order is None:
        return K, M
    return block(K, order, order), block(M, order, order)


def _with_mass(pencil: Pencil, theta: Floats, mu: Floats, noise: Floats, phi: Floats) -> Modes:
    """Modes of μ (n_samples, count); those samples anew whose μ may be round-off."""
    count = mu.shape[1]
    lam = 1.0 / np.where(mu > 0.0, mu, np.inf)
    least_is_doubtful = may_be_roundoff(mu, noise, len(pencil.elastic))[:, -1]
    for k in np.flatnonzero(least_is_doubtful):
        lam[k], modes = modes_with_mass(pencil, theta[:, [k]], count)
        if phi.size:
            phi[k] = modes
    return Modes(lam, positive_at_top(phi) if phi.size else phi)


# --- One sample, through LAPACK without detours

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
    if may_be_roundoff(mu, noise, n).any():
        lam, phi = modes_with_mass(pencil, theta, count)
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
    if may_be_roundoff(mu, noise, len(A))[-1]:
        return modes_with_mass(pencil, theta, count)[0]
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
    coupling = rigid_coupling(M[F, F], M[F, E])
    M_c = M[E, E] - M[E, F] @ coupling
    A, _ = lapack.dsygst(M_c.T, C, lower=1, overwrite_a=1)
    return A, C, coupling


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


# --- Many small matrices factored at once

LEAF = 16  # order up to which LAPACK's general inverse is quicker than halving
FEW, LEAF_OF_FEW = 8, 32  # so many matrices, for which calls cost more than arithmetic


def inverse_factor(K: Floats) -> Floats:
    """L⁻¹ for K = L Lᵀ (n, k, k), of which the lower triangle is read.

    Raises MechanismError where K is not positive definite.
    """
    try:
        return triangular_inverse(np.asarray(np.linalg.cholesky(K), dtype=np.float64))
    except np.linalg.LinAlgError as error:
        raise MechanismError("mechanism", LIMP) from error


def triangular_inverse(L: Floats) -> Floats:
    """L⁻¹ for lower triangular L (n, k, k), by halves: most of the work is products.

    Of LAPACK's general inverse it takes 0.7 of the time at k = 23 and 0.4 at k = 60, where that
    would be a third of the whole solve.

    ⎡ A 0 ⎤⁻¹   ⎡ A⁻¹          0  ⎤
    ⎣ B C ⎦   = ⎣ −C⁻¹ B A⁻¹  C⁻¹ ⎦
    """
    k = L.shape[1]
    if k <= (LEAF_OF_FEW if len(L) <= FEW else LEAF):
        return np.asarray(np.linalg.inv(L), dtype=np.float64)
    half = k // 2
    inverse = np.zeros_like(L)
    A, C = triangular_inverse(L[:, :half, :half]), triangular_inverse(L[:, half:, half:])
    inverse[:, :half, :half], inverse[:, half:, half:] = A, C
    inverse[:, half:, :half] = -C @ (L[:, half:, :half] @ A)
    return inverse
