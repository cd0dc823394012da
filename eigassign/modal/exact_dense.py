"""Exact elastic modes of small pencils, many samples at once."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import LIMP, MechanismError
from eigassign.mechanism.pencil import Pencil
from eigassign.modal.chunks import NUMBERS, chunks
from eigassign.modal.condensation import Modes, block, condense_blocks
from eigassign.modal.exact_single import single_values, solve_single
from eigassign.modal.massive import doubtful, mass_sizes, solve_massive
from eigassign.modal.triangular import triangular_inverse

Floats = NDArray[np.float64]
UPPER: Literal["U"] = "U"  # half of (L⁻¹ M_c) L⁻ᵀ that is read: the other has more round-off


def solve_dense(pencil: Pencil, theta: Floats, count: int, vectors: bool) -> Modes:
    """Modes at θ (n_theta, n_samples); one sample goes to LAPACK alone, many in chunks."""
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
    return block(K, order, order), block(M, order, order)


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
