"""Exact elastic modes of small pencils, and how many modes have mass.

An eigenvalue μ = 1/λ of M_c z = μ K_E z that ought to be zero comes out as round-off: of the
eigensolver, ε n μ_1, and of the condensed mass, in which M_EE and M_EF M_FF⁻¹ M_FE cancel. With
m_i = Σ_j |θ_j (M_j)_ii| and W = M_FF⁻¹ M_FE the latter is, entry by entry,

    |δM_c|_ij ≤ c n ε t_i t_j,   t_i = √m_i + Σ_f |W_fi| √m_f .

Where every μ asked for is well above both, all of them have mass. Where one is not, the mass
decides and not the size of μ: with T = diag(t), T⁻¹ M_c T⁻¹ = G Gᵀ by Cholesky with diagonal
pivots, down to pivots of c n ε. G has as many columns as modes have mass, and the singular values
of C⁻¹ T G, K_E = C Cᵀ, are √μ: stiff modes keep digits there that they have lost in μ.

M_c z = μ K_E z with K_E = C Cᵀ becomes A v = μ v, A = C⁻¹ M_c C⁻ᵀ and z = C⁻ᵀ v. Where a μ may be
round-off, the sample is solved anew by `modes_with_mass`.
"""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np
from scipy.linalg import lapack, svd

from eigassign.arrays import Bools, Floats, Ints
from eigassign.errors import LIMP, AccuracyError, MechanismError, MissingMassError
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.modal.arguments import chunks

NO_MASS = (
    "a free coordinate moves no mass: give the mechanism mass or lock it. Or two coordinates move "
    "alike, as in a spherical joint at ±90 deg about y (gimbal lock): turn it by its orientation"
)


class Modes(NamedTuple):
    """Eigenvalues λ (n_samples, count) in rad²/s² and modes φ (n_samples, n_dof, count).

    φᵀMφ = I at every sample; the entry of largest magnitude of every mode is positive.
    """

    lam: Floats
    phi: Floats


def positive_at_top(phi: Floats) -> Floats:
    """Modes (…, n_dof, count) whose entries of largest magnitude are positive."""
    at = np.abs(phi).argmax(axis=-2, keepdims=True)
    return np.asarray(phi * np.where(np.take_along_axis(phi, at, axis=-2) < 0.0, -1.0, 1.0))


def condense(M: Floats, elastic: Ints, rigid: Ints) -> tuple[Floats, Floats]:
    """M_FF⁻¹ M_FE and M_c = M_EE − M_EF M_FF⁻¹ M_FE for a batch of M (n_samples, n, n)."""
    M_FE, M_FF = block(M, rigid, elastic), block(M, rigid, rigid)
    return condense_blocks(block(M, elastic, elastic), M_FE, M_FF)


def condense_blocks(M_EE: Floats, M_FE: Floats, M_FF: Floats) -> tuple[Floats, Floats]:
    """M_FF⁻¹ M_FE and M_c from the blocks of M."""
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


def block(A: Floats, rows: Ints, columns: Ints) -> Floats:
    """A[:, rows, columns] of a batch in C order, which fancy indexing would transpose in memory."""
    flat = (rows[:, None] * A.shape[2] + columns).ravel()
    taken = A.reshape(len(A), A.shape[1] * A.shape[2]).take(flat, axis=1)
    return np.asarray(taken.reshape(len(A), len(rows), len(columns)))


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


def may_be_roundoff(mu: Floats, noise: Floats, n: int, margin: float = MARGIN) -> Bools:
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
    """λ (count,) ascending and φ (n_dof, count) for θ; φᵀMφ = 1, the largest entry positive."""
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
