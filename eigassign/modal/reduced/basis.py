"""The basis of a reduced model: Taylor vectors, guards and probes, made K-orthonormal.

It holds the Taylor vectors of the wanted modes to order m; those of the modes below them and of the
next one above to order m − 1; and a few modes above those as they are, so that one that comes down
is seen. Where answers are refused, more of these come beside it (`widened`).

The inner product is K0 = K_E(θ̄) with θ averaged over turned poses. A vector smooth in one pose
kinks the joints of another, with a strain energy many times that of a mode. In K_E(x0) numbers of
that size would have to cancel; in the mean stiffness they do not.

The represented modes of the first point come first, made orthogonal from the stiffest on, so that
no soft mode is mixed into a stiff one, and stand in V from the softest on. VᵀM_cV is graded by that
and stiff modes keep their digits: of an arm with one link without mass, μ = 7e-10 μ_1, the
frequency is right to 1e-15, where vectors in the order of their modes left 3e-5.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.errors import AccuracyError
from eigassign.mechanism.assembly.pencil import Pencil, theta_at
from eigassign.modal.exact.solver import lowest_modes
from eigassign.modal.taylor.vectors import vectors_to_order

Floats = NDArray[np.float64]
PROBES = 6  # modes above the guard that may join as they are at the expansion point
DISTANT = 10.0  # λ beyond this multiple of the highest wanted one needs no probe
# Modes that join where answers are refused: with 0, 12, 20 and 30 of them 47, 20, 15 and 12 % are,
# of designs up to a thousand times softer (1216 answers of `tests/stability/softened.py`).
WIDER = 20
Plan = Sequence[tuple[Sequence[int], int]]  # modes, and the order of their Taylor vectors
DEPENDENT = 1e-9  # remainder, relative to the vector, below which it is taken as dependent
ORTHONORMAL = 1e-8  # post-condition on |VᵀKV − I|, beyond round-off of K itself
INDEFINITE = "the stiffness matrix is not positive definite at an expansion point"


@dataclass(frozen=True, eq=False)
class RitzBasis:
    """V, and what it was made from."""

    pencil: Pencil
    modes: tuple[int, ...]
    points: Floats  # (n_points, n_x): the expansion points
    theta0: Floats  # (n_theta, n_points)
    theta_mean: Floats  # (n_theta,): those of K0
    K0: sparse.csc_array  # elastic rows and columns: the inner product
    V: Floats  # (n_elastic, k) with VᵀK0V = I
    lam: Floats  # (n_points, …): the lowest eigenvalues at each point, more than are represented
    represented: Floats  # (n_points, n_dof, c): the modes that are in V as they are

    @property
    def wide(self) -> Floats:
        """[V 0; 0 I_F] (n_dof, k + f) on all dofs."""
        k, f = self.V.shape[1], len(self.pencil.rigid)
        wide = np.zeros((self.pencil.n_dof, k + f))
        wide[self.pencil.elastic, :k] = self.V
        wide[self.pencil.rigid, k:] = np.eye(f)
        return wide

    @property
    def shapes(self) -> Floats:
        """The represented modes in coordinates of V, (n_points, k, c)."""
        elastic = self.pencil.elastic
        return np.array([self.V.T @ (self.K0 @ phi[elastic]) for phi in self.represented])


def ritz_basis(
    pencil: Pencil,
    points: Floats,
    wanted: tuple[int, ...],
    half_order: int,
    guard: bool,
    given: Floats | None,
) -> RitzBasis:
    """The basis at ``points`` for :func:`eigassign.modal.reduced.reduce.reduce`.

    ``given`` are the Taylor vectors (n_dof, N) of the wanted modes at the one point, where they
    are known.
    """
    theta0 = pencil.theta(points)
    found = lowest_modes(pencil, theta0, wanted[-1], 2 + PROBES if guard else 1)
    count = wanted[-1]
    if guard:  # one above, and probes up to DISTANT
        near = (found.lam < DISTANT * found.lam[:, [count - 1]]).any(axis=0).sum()
        count = int(min(max(near, count + 1), count + 1 + PROBES, found.lam.shape[1]))
    plan = _plan(found.lam.shape[1], wanted, half_order, guard)
    if given is None:
        vectors = [_taylor_vectors(pencil, x, plan) for x in points]
    else:
        vectors = [given, _taylor_vectors(pencil, points[0], plan[1:])]
    theta_mean = mean_theta(pencil, points)
    K0 = pencil.sparse(pencil.stiffness @ theta_mean)[pencil.elastic][:, pencil.elastic].tocsc()
    V = _with_modes(K0, found.phi[:, pencil.elastic, :count], np.hstack(vectors)[pencil.elastic])
    represented = found.phi[:, :, :count]
    return RitzBasis(pencil, wanted, points, theta0, theta_mean, K0, V, found.lam, represented)


def widened(basis: RitzBasis) -> RitzBasis | None:
    """``basis`` with up to ``WIDER`` modes more as they are; None where it has all with mass."""
    count, elastic = basis.represented.shape[2], basis.pencil.elastic
    found = lowest_modes(basis.pencil, basis.theta0, count, WIDER + 1)
    phi = found.phi[:, :, : count + WIDER]
    if phi.shape[2] == count:
        return None
    V = _with_modes(basis.K0, phi[:, elastic], basis.V[:, count:])
    return replace(basis, V=V, lam=found.lam, represented=phi)


def _with_modes(K0: sparse.csc_array, phi: Floats, vectors: Floats) -> Floats:
    """V of modes φ (n_points, n_elastic, c) and of ``vectors`` (n_elastic, N), in this order."""
    count = phi.shape[2]
    V = orthonormal(K0, np.hstack([*phi[:, :, ::-1], vectors]))
    return np.hstack([V[:, :count][:, ::-1], V[:, count:]])


def _plan(most: int, wanted: tuple[int, ...], half_order: int, guard: bool) -> Plan:
    """The wanted modes and, to one order less, guards: of the ``most`` that have mass."""
    guards = [m for m in range(1, wanted[-1] + 2) if m not in wanted and m <= most]
    if not guard or not guards or half_order < 2:
        return [(wanted, half_order)]
    return [(wanted, half_order), (tuple(guards), half_order - 1)]


def _taylor_vectors(pencil: Pencil, x0: Floats, plan: Plan) -> Floats:
    """Columns φ_γ (n_dof, N)."""
    columns = [vectors_to_order(pencil, x0, modes, order) for modes, order in plan]
    return np.hstack([np.zeros((pencil.n_dof, 0)), *columns])


# --- K0-orthonormal vectors of the same span


def orthonormal(K: sparse.csc_array | Floats, vectors: Floats) -> Floats:
    """V (n, k) with VᵀKV = I spanning the columns of ``vectors`` (n, N), by Gram-Schmidt twice.

    Raises AccuracyError if K is not positive on a vector or the result is not orthonormal.
    """
    Q = np.zeros((len(vectors), vectors.shape[1]))
    KQ = np.zeros_like(Q)
    rank = 0
    for v in vectors.T:
        square = float(v @ (K @ v))
        if square < 0.0 or not np.isfinite(square):
            raise AccuracyError(INDEFINITE)
        if square == 0.0:
            continue
        v = v / np.sqrt(square)
        for _ in range(2):
            v = v - Q[:, :rank] @ (KQ[:, :rank].T @ v)
        Kv = K @ v
        rest = np.sqrt(max(float(v @ Kv), 0.0))
        if rest > DEPENDENT:
            Q[:, rank], KQ[:, rank] = v / rest, Kv / rest
            rank += 1
    Q, KQ = Q[:, :rank], KQ[:, :rank]
    lost = float(np.abs(Q.T @ KQ - np.eye(rank)).max(initial=0.0))
    size = np.abs(Q)  # QᵀKQ of a fine mesh is a small difference of large terms, which round off
    terms = np.einsum("ij,ij->j", size, abs(K) @ size).max(initial=0.0)
    if lost > ORTHONORMAL + 10.0 * float(np.finfo(np.float64).eps * terms):
        raise AccuracyError(f"the basis is orthonormal only to {lost:.1e}")
    return Q


# --- θ averaged over turned poses


def mean_theta(pencil: Pencil, points: Floats) -> Floats:
    """Mean θ (n_theta,) over quarter turns of all angles from ``points`` (n_points, n_x).

    The design is that of the first point. Loops are not turned: where they close at all, a passive
    carriage may have left its beam, whose stiffness is then not one; nor are mechanisms under their
    weight, which might fall.
    """
    z = points @ pencil.to_program.T + pencil.shift
    n = pencil.n_joints
    if pencil.program.is_implicit or pencil.weight is not None:
        return np.asarray(pencil.theta(points[(z[:, n:] == z[0, n:]).all(axis=1)]).mean(axis=1))
    z[:, n:] = z[0, n:]
    turns = np.zeros(len(pencil.shift))
    turns[:n] = [_is_angle(pencil, z[0], k) for k in range(n)]
    turned = np.concatenate([z + k * turns * (np.pi / 2.0) for k in range(4)])
    theta = theta_at(pencil.program, turned.T)
    return np.asarray(theta[:, np.isfinite(theta).all(axis=0)].mean(axis=1))


def _is_angle(pencil: Pencil, z: Floats, k: int) -> bool:
    """True where joint coordinate k is an angle: a full turn changes nothing but round-off."""
    turned = np.array([z, z])
    turned[1, k] += 2.0 * np.pi
    here, there = theta_at(pencil.program, turned.T).T
    scale = np.maximum(np.abs(here), np.abs(there))
    return bool((np.abs(there - here) <= 1e-9 * scale).all())
