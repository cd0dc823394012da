"""Exact elastic modes of the affine pencil, the rigid-body modes projected out exactly.

With E the elastic unknowns (u and held coordinates) and F the free coordinates, K = diag(K_E, 0):

    K_E φ_E = λ M_c φ_E,   M_c = M_EE − M_EF M_FF⁻¹ M_FE,   φ_F = −M_FF⁻¹ M_FE φ_E

solved in the inverse form M_c z = μ K_E z, μ = 1/λ, so that massless unknowns (μ = 0) are harmless.
What may be round-off instead of a mode with mass is settled by ``massive``, for all solvers alike.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import LIMP, MechanismError, UsageError
from eigassign.mechanism.pencil import Pencil
from eigassign.modal.arguments import whole
from eigassign.modal.chunks import NUMBERS, chunks
from eigassign.modal.exact_single import single_values, solve_single
from eigassign.modal.massive import doubtful, mass_sizes, solve_massive
from eigassign.modal.sizes import DENSE_LIMIT
from eigassign.modal.triangular import triangular_inverse

__all__ = ["DENSE_LIMIT", "Modes", "condense_blocks", "eigenvalues", "modes", "modes_at"]

Floats = NDArray[np.float64]
UPPER: Literal["U"] = "U"  # half of (L⁻¹ M_c) L⁻ᵀ that is read: the other has more round-off


@dataclass(frozen=True)
class Modes:
    """Eigenvalues λ (n_samples, count) in rad²/s² and modes φ (n_samples, n_dof, count).

    φᵀMφ = I at every sample; the entry of largest magnitude of every mode is positive.
    """

    lam: Floats
    phi: Floats


def eigenvalues(pencil: Pencil, x: Floats, count: int) -> Floats:
    """λ (n_samples, count) of the lowest elastic modes at x (n_samples, n_x), in rad²/s².

    Raises UsageError for more modes than there are, MissingMassError for more than have mass,
    MechanismError where K_E or M_FF is singular.
    """
    return _solve(pencil, pencil.theta(x), count, vectors=False).lam


def modes(pencil: Pencil, x: Floats, count: int) -> Modes:
    """Eigenvalues and mass-normalised modes of the lowest elastic modes."""
    return _solve(pencil, pencil.theta(x), count, vectors=True)


def modes_at(pencil: Pencil, theta: Floats, count: int) -> Modes:
    """The same where θ (n_theta, n_samples) is known already."""
    return _solve(pencil, theta, count, vectors=True)


def _solve(pencil: Pencil, theta: Floats, count: int, vectors: bool) -> Modes:
    elastic, count = len(pencil.elastic), whole(count, "count")
    if not 1 <= count <= elastic:
        raise UsageError(f"{count} modes asked for; the model has 1 to {elastic} elastic ones")
    if not np.isfinite(theta).all():
        raise UsageError("q or y is not finite, or outside the domain of a section or length")
    if pencil.n_dof <= DENSE_LIMIT or 2 * count > elastic:  # Lanczos is for few modes of many
        found = _dense(pencil, theta, count, vectors)
    else:
        from eigassign.modal.exact_sparse import solve_sparse

        found = Modes(*solve_sparse(pencil, theta, count, vectors))
    return found


def _dense(pencil: Pencil, theta: Floats, count: int, vectors: bool) -> Modes:
    if theta.shape[1] == 1:
        return _single(pencil, theta, count, vectors)
    columns = np.arange(theta.shape[1])
    if pencil.n_dof**2 * len(columns) <= NUMBERS:
        return _batch(pencil, theta, count, vectors)
    parts = [
        _batch(pencil, theta[:, at], count, vectors) for at in chunks(columns, pencil.n_dof**2)
    ]
    return Modes(np.concatenate([p.lam for p in parts]), np.concatenate([p.phi for p in parts]))


def _single(pencil: Pencil, theta: Floats, count: int, vectors: bool) -> Modes:
    if not vectors:
        return Modes(single_values(pencil, theta, count)[None], np.zeros((1, 0, count)))
    lam, phi = solve_single(pencil, theta, count)
    return Modes(lam[None], phi[None])


def _batch(pencil: Pencil, theta: Floats, count: int, vectors: bool) -> Modes:
    """Modes at θ (n_theta, n_samples): as many samples as stay in the processor's cache."""
    K, M = _elastic_first(pencil, theta)
    n = len(pencil.elastic)
    coupling, M_c = condense_blocks(M[:, :n, :n], M[:, n:, :n], M[:, n:, n:])
    L_inverse = triangular_inverse(_cholesky(K[:, :n, :n]))
    A = (L_inverse @ M_c) @ np.swapaxes(L_inverse, 1, 2)
    noise = _noise(L_inverse, mass_sizes(pencil, theta, coupling))
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
    order, stiff = pencil.elastic_first, theta[pencil.stiffness_terms]
    if (stiff == stiff[:, :1]).all():  # as where one pose meets many added masses
        K, M = pencil.stiffness_matrices(theta[:, :1]), pencil.mass_matrices(theta)
    else:
        K, M = pencil.matrices(theta)
    if order is None:
        return K, M
    return _block(K, order, order), _block(M, order, order)


def _noise(L_inverse: Floats, sizes: Floats) -> Floats:
    """Σ_i (K_E⁻¹)_ii t_i² (n_samples, 1): zᵀ T² z of no K_E-unit z is more."""
    return np.asarray(np.einsum("kij,kij,kj->k", L_inverse, L_inverse, sizes)[:, None])


def _with_mass(pencil: Pencil, theta: Floats, mu: Floats, noise: Floats, phi: Floats) -> Modes:
    """Modes of μ (n_samples, count); those samples anew whose μ may be round-off."""
    count = mu.shape[1]
    lam = 1.0 / np.where(mu > 0.0, mu, np.inf)
    for k in np.flatnonzero(doubtful(mu, noise, len(pencil.elastic))[:, -1]):  # the least of them
        lam[k], modes = solve_massive(pencil, theta[:, [k]], count)
        if phi.size:
            phi[k] = modes
    return Modes(lam, _signed(phi) if phi.size else phi)


def condense(
    M: Floats, elastic: NDArray[np.intp], rigid: NDArray[np.intp]
) -> tuple[Floats, Floats]:
    """M_FF⁻¹ M_FE and M_c = M_EE − M_EF M_FF⁻¹ M_FE for a batch of M (n_samples, n, n)."""
    M_FE, M_FF = _block(M, rigid, elastic), _block(M, rigid, rigid)
    return condense_blocks(_block(M, elastic, elastic), M_FE, M_FF)


def condense_blocks(M_EE: Floats, M_FE: Floats, M_FF: Floats) -> tuple[Floats, Floats]:
    """The same from its blocks."""
    if not M_FF.size:
        return M_FE, M_EE
    try:
        np.linalg.cholesky(M_FF)
        coupling = np.linalg.solve(M_FF, M_FE)
    except np.linalg.LinAlgError as error:
        raise MechanismError(
            "mechanism", "a free coordinate moves no mass: give the mechanism mass or lock it"
        ) from error
    return np.asarray(coupling, dtype=np.float64), M_EE - np.swapaxes(M_FE, 1, 2) @ coupling


def _block(A: Floats, rows: NDArray[np.intp], columns: NDArray[np.intp]) -> Floats:
    """A[:, rows, columns] of a batch in C order, which fancy indexing would transpose in memory."""
    flat = (rows[:, None] * A.shape[2] + columns).ravel()
    taken = A.reshape(len(A), A.shape[1] * A.shape[2]).take(flat, axis=1)
    return np.asarray(taken.reshape(len(A), len(rows), len(columns)))


def _cholesky(K: Floats) -> Floats:
    try:
        return np.asarray(np.linalg.cholesky(K), dtype=np.float64)
    except np.linalg.LinAlgError as error:
        raise MechanismError("mechanism", LIMP) from error


def _signed(phi: Floats) -> Floats:
    """Each mode with its entry of largest magnitude positive."""
    at = np.abs(phi).argmax(axis=1)
    largest = np.take_along_axis(phi, at[:, None, :], axis=1)
    return np.asarray(phi * np.where(largest < 0.0, -1.0, 1.0))
