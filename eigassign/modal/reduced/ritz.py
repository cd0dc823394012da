"""Ritz pairs of batches of small matrices: M_c z = μ K z, with K = L Lᵀ as L⁻¹ M_c L⁻ᵀ v = μ v.

Sums Σ θ_j A_j of small symmetric matrices, formed from their lower triangles: half the work.

A basis from the Taylor vectors of one or several expansion points, made K-orthonormal.

The rank is decided while orthogonalising: a vector whose remainder is lost in round-off adds
nothing and is left out.

θ averaged over turned poses: its K_E is the inner product of a reduced model's basis.

A vector smooth in one pose kinks the joints of another, with a strain energy many times that of a
mode. In K_E(x0) numbers of that size would have to cancel; in the mean stiffness they do not.
Loops are not turned: where they close at all, a passive carriage may have left its beam, whose
stiffness is then not one.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.errors import LIMP, AccuracyError, MechanismError
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.modal.exact.dense import triangular_inverse
from eigassign.series.algebra import Samples

# --- Ritz pairs of batches of small matrices: M_c z = μ K z, with K = L Lᵀ as L⁻¹ M_c L⁻ᵀ v = μ

Floats = NDArray[np.float64]


def ritz_values(K: Floats, M_c: Floats) -> Floats:
    """μ descending (n, k); of K (n, k, k) only the lower triangle is read."""
    return np.asarray(np.linalg.eigvalsh(_standard(K, M_c)[0])[:, ::-1])


def ritz_pairs(K: Floats, M_c: Floats) -> tuple[Floats, Floats]:
    """μ descending (n, k) and z (n, k, k) with zᵀKz = 1."""
    A, inverse = _standard(K, M_c)
    mu, v = np.linalg.eigh(A)
    return mu[:, ::-1], (np.swapaxes(inverse, 1, 2) @ v)[:, :, ::-1]


def _standard(K: Floats, M_c: Floats) -> tuple[Floats, Floats]:
    """L⁻¹ M_c L⁻ᵀ and L⁻¹; MechanismError where K is not positive definite."""
    try:
        inverse = triangular_inverse(np.asarray(np.linalg.cholesky(K), dtype=np.float64))
    except np.linalg.LinAlgError as error:
        raise MechanismError("mechanism", LIMP) from error
    return inverse @ M_c @ np.swapaxes(inverse, 1, 2), inverse


# --- Sums Σ θ_j A_j of small symmetric matrices, formed from their lower triangles: half the wo

Ints = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class SymmetricTerms:
    """The lower triangles (n_terms, k(k + 1)/2) of A_j, and where in them each entry (k, k) is."""

    terms: Ints  # indices j of θ
    triangles: Floats
    place: Ints

    def __call__(self, theta: Floats) -> Floats:
        """Triangles (n, k(k + 1)/2) of the sums at θ (n_theta, n)."""
        return np.asarray(theta[self.terms].T @ self.triangles)

    def block(self, triangles: Floats, rows: slice, columns: slice) -> Floats:
        """Rows and columns of whole matrices, (n, …, …), from their triangles."""
        place = self.place[rows, columns]
        return triangles.take(place.ravel(), axis=1).reshape(len(triangles), *place.shape)


def symmetric_terms(terms: Ints, matrices: Floats) -> SymmetricTerms:
    """From whole matrices (n_terms, k, k), of which the lower triangle is read."""
    k = matrices.shape[1]
    i, j = np.tril_indices(k)
    place = np.empty((k, k), dtype=np.intp)
    place[i, j] = place[j, i] = np.arange(len(i))
    return SymmetricTerms(terms, np.ascontiguousarray(matrices[:, i, j]), place)


# --- A basis from the Taylor vectors of one or several expansion points, made K-orthonormal

DEPENDENT = 1e-9  # remainder, relative to the vector, below which it is taken as dependent
ORTHONORMAL = 1e-8  # post-condition on |VᵀKV − I|, beyond round-off of K itself

INDEFINITE = "the stiffness matrix is not positive definite at an expansion point"


def orthonormal(K: sparse.csc_array | Floats, vectors: Floats) -> Floats:
    """V (n, k) with VᵀKV = I spanning the columns of ``vectors`` (n, N), by Gram-Schmidt twice.

    Raises AccuracyError if K is not positive on a vector or the result is not orthonormal.
    """
    Q = np.zeros((len(vectors), vectors.shape[1]))
    KQ = np.zeros_like(Q)
    rank = 0
    for v in vectors.T:
        size = np.sqrt(_square(K, v))
        if size == 0.0:
            continue
        v = v / size
        for _ in range(2):
            v = v - Q[:, :rank] @ (KQ[:, :rank].T @ v)
        Kv = K @ v
        rest = np.sqrt(max(float(v @ Kv), 0.0))
        if rest > DEPENDENT:
            Q[:, rank], KQ[:, rank] = v / rest, Kv / rest
            rank += 1
    Q, KQ = Q[:, :rank], KQ[:, :rank]
    lost = float(np.abs(Q.T @ KQ - np.eye(rank)).max(initial=0.0))
    if lost > ORTHONORMAL + _rounding(K, Q):
        raise AccuracyError(f"the basis is orthonormal only to {lost:.1e}")
    return Q


def _rounding(K: sparse.csc_array | Floats, Q: Floats) -> float:
    """Round-off of QᵀKQ itself: in a fine mesh it is a small difference of large terms."""
    size = np.abs(Q)
    terms = np.einsum("ij,ij->j", size, abs(K) @ size)
    return 10.0 * float(np.finfo(np.float64).eps * terms.max(initial=0.0))


def _square(K: sparse.csc_array | Floats, v: Floats) -> float:
    square = float(v @ (K @ v))
    if square < 0.0 or not np.isfinite(square):
        raise AccuracyError(INDEFINITE)
    return square


# --- θ averaged over turned poses: its K_E is the inner product of a reduced model's basis


def mean_theta(pencil: Pencil, points: Floats) -> Floats:
    """Mean θ (n_theta,) over quarter turns of all angles from ``points`` (n_points, n_x)."""
    if pencil.program.is_implicit:
        return np.asarray(pencil.theta(points).mean(axis=1))
    z = points @ pencil.to_program.T + pencil.shift
    z[:, pencil.n_q :] = z[0, pencil.n_q :]
    turns = np.zeros(len(pencil.shift))
    turns[: pencil.n_q] = _periodic(pencil, z[0])
    turned = np.concatenate([z + k * turns * (np.pi / 2.0) for k in range(4)])
    theta = _theta_at(pencil, turned)
    return np.asarray(theta[:, np.isfinite(theta).all(axis=0)].mean(axis=1))


def _theta_at(pencil: Pencil, z: Floats) -> Floats:
    """θ (n_theta, n) at program variables z (n, n_z)."""
    return np.vstack([np.ones((1, len(z))), pencil.program.run(Samples(), z.T)])


def _periodic(pencil: Pencil, z: Floats) -> NDArray[np.bool_]:
    """Which joint coordinates are angles (n_q,): a full turn changes nothing but round-off."""
    return np.array([_turns(pencil, z, k) for k in range(pencil.n_q)], dtype=bool)


def _turns(pencil: Pencil, z: Floats, k: int) -> bool:
    turned = np.array([z, z])
    turned[1, k] += 2.0 * np.pi
    here, there = _theta_at(pencil, turned).T
    scale = np.maximum(np.abs(here), np.abs(there))
    return bool((np.abs(there - here) <= 1e-9 * scale).all())
