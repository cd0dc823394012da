"""The reduced model: Ritz on the Taylor vectors, with the exact affine pencil.

With [u; q̇] ≈ [V c; I_F] on the elastic unknowns E and the free coordinates F,

    K̂(x) = Σ_j θ_j(x) VᵀK_jV,   M̂(x) = Σ_j θ_j(x) [V 0; 0 I]ᵀ M_j [V 0; 0 I] ,

rigid-body motion is projected out exactly, M̂_c = M̂_EE − M̂_EF M̂_FF⁻¹ M̂_FE, and the Ritz pairs are
those of the inverse form M̂_c z = μ K̂ z: with K̂ = L Lᵀ those of L⁻¹ M̂_c L⁻ᵀ. Its eigenvalues share
every derivative that the Taylor vectors give, but stay accurate far beyond the radius of
convergence. How far off they are only exact solves say: a mode that V does not hold is missed.

V holds the Taylor vectors of the wanted modes to order m; those of the modes below them and of the
next one above to order m − 1; and a few modes above those as they are, so that one that comes down
is seen. The inner product is K0 = K_E(θ̄) with θ averaged over turned poses. A vector smooth in one
pose kinks the joints of another, with a strain energy many times that of a mode. In K_E(x0) numbers
of that size would have to cancel; in the mean stiffness they do not.

The modes of the first point come first, made orthogonal from the stiffest on, so that no soft mode
is mixed into a stiff one, and stand in V from the softest on. VᵀM_cV is graded by that and stiff
modes keep their digits: of an arm with one link without mass, μ = 7e-10 μ_1, the frequency is right
to 1e-15, where vectors in the order of their modes left 3e-5.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse

from eigassign.arrays import Floats, Ints
from eigassign.brief import counted, of_modes
from eigassign.errors import AccuracyError, UsageError
from eigassign.mechanism.assembly.pencil import Pencil, theta_at
from eigassign.modal.arguments import chunks, mode_numbers, samples, whole_within
from eigassign.modal.exact.dense import condense_blocks, inverse_factor
from eigassign.modal.exact.solver import lowest_modes
from eigassign.modal.taylor.rayleigh import project
from eigassign.modal.taylor.recursion import vectors_to_order
from eigassign.process import one_thread
from eigassign.series.compiler import Program

PROBES = 6  # modes above the guard that may join as they are at the expansion point
DISTANT = 10.0  # λ beyond this multiple of the highest wanted one needs no probe
DEPENDENT = 1e-9  # remainder, relative to the vector, below which it is taken as dependent
ORTHONORMAL = 1e-8  # post-condition on |VᵀKV − I|, beyond round-off of K itself


@dataclass(frozen=True, eq=False)
class ReducedModel:
    """Frequencies of ``modes`` from k + f unknowns; needs neither mesh nor mechanism. Immutable.

        K̂(q, y) = Vᵀ K(q, y) V = Σ_j θ_j(q, y) Vᵀ K_j V,  M̂ likewise, V of Taylor vectors

    ``frequencies(q, y)`` (n, n_modes) in Hz; k is ``size``, ``points`` (n_points, n_q + n_y) are
    what V was expanded about.
    """

    modes: tuple[int, ...]
    half_order: int
    n_q: int
    n_y: int
    points: Floats
    program: Program
    to_program: Floats
    shift: Floats
    stiffness: Terms  # of (k, k)
    mass: Terms  # of (k + f, k + f)

    def __repr__(self) -> str:
        return (
            f"<ReducedModel of {of_modes(self.modes)}: {self.size} elastic unknowns, Taylor "
            f"vectors to order {self.half_order} at {counted(len(self.points), 'point')}; "
            f"{self.n_q} q, {self.n_y} y>"
        )

    @property
    def size(self) -> int:
        """Number k of basis vectors."""
        return int(self.stiffness.matrices.shape[1])

    @one_thread
    def frequencies(self, q: ArrayLike, y: ArrayLike) -> Floats:
        """(n_samples, n_modes) in Hz.

        Raises UsageError outside the domain of a section or length, MechanismError where K̂ is not
        positive definite.
        """
        wanted = np.array(self.modes) - 1
        x = samples(q, y, self.n_q, self.n_y)
        parts = [
            np.linalg.eigvalsh(self._standard(theta[:, part]))[:, ::-1]
            for theta in map(self._theta, chunks(x, 1))
            for part in chunks(np.arange(theta.shape[1]), self.mass.matrices[0].size)
        ]
        mu = np.concatenate(parts)[:, wanted]
        return np.asarray(1.0 / (2.0 * np.pi * np.sqrt(mu)))

    def _theta(self, x: Floats) -> Floats:
        """θ (n_theta, n) at samples x (n, n_x)."""
        theta = theta_at(self.program, self.to_program @ x.T + self.shift[:, None])
        if not np.isfinite(theta).all():
            raise UsageError("q or y is outside the domain of a section or length")
        return theta

    def _standard(self, theta: Floats) -> Floats:
        """L⁻¹ M̂_c L⁻ᵀ (n, k, k) at θ (n_theta, n), its lower triangle."""
        E, F = slice(0, self.size), slice(self.size, None)
        M = self.mass(theta)
        M_c = condense_blocks(M[:, E, E], M[:, F, E], M[:, F, F])[1]
        inverse = inverse_factor(self.stiffness(theta))
        return np.asarray(inverse @ M_c @ np.swapaxes(inverse, 1, 2))


class Terms(NamedTuple):
    """Sums Σ θ_j A_j of small ``matrices`` A_j (n_terms, k, k)."""

    terms: Ints  # indices j of θ
    matrices: Floats

    def __call__(self, theta: Floats) -> Floats:
        """The sums (n, k, k) at θ (n_theta, n)."""
        sums = theta[self.terms].T @ self.matrices.reshape(len(self.terms), -1)
        return np.asarray(sums.reshape(-1, *self.matrices.shape[1:]))


# --- The basis, and the pencil on it


def reduce(
    pencil: Pencil,
    q0: ArrayLike,
    y0: ArrayLike,
    modes: Sequence[int] = (1,),
    half_order: int = 2,
) -> ReducedModel:
    """Reduced model from the Taylor vectors of ``modes`` to order m at one or several points.

    q0 (n_q,) or (n_points, n_q), y0 likewise. Raises UsageError for impossible arguments,
    AccuracyError where no basis can be made.
    """
    wanted = mode_numbers(modes)
    half_order = whole_within(half_order, "half_order", 0, 10)
    n_y = pencil.to_program.shape[1] - pencil.n_q
    points = samples(q0, y0, pencil.n_q, n_y)
    V = ritz_basis(pencil, points, wanted, half_order)
    k, f = V.shape[1], len(pencil.rigid)
    wide = np.zeros((pencil.n_dof, k + f))  # [V 0; 0 I_F]
    wide[pencil.elastic, :k], wide[pencil.rigid, k:] = V, np.eye(f)
    # Terms are large and cancel, so their round-off counts: the mean with their transposes.
    stiffness, mass = (0.5 * (A + A.transpose(0, 2, 1)) for A in project(pencil, wide))
    k_terms, m_terms = (np.flatnonzero(np.diff(w.indptr)) for w in pencil.by_term)
    return ReducedModel(
        modes=wanted,
        half_order=half_order,
        n_q=pencil.n_q,
        n_y=n_y,
        points=points,
        program=pencil.program,
        to_program=pencil.to_program,
        shift=pencil.shift,
        stiffness=Terms(k_terms, np.ascontiguousarray(stiffness[k_terms, :k, :k])),
        mass=Terms(m_terms, mass[m_terms]),
    )


def ritz_basis(pencil: Pencil, points: Floats, wanted: tuple[int, ...], half_order: int) -> Floats:
    """V (n_elastic, k) at ``points`` (n_points, n_x), orthonormal in the mean stiffness."""
    found = lowest_modes(pencil, pencil.theta(points), wanted[-1], 2 + PROBES)
    last, most = wanted[-1], found.lam.shape[1]  # one above, and probes up to DISTANT
    near = int((found.lam < DISTANT * found.lam[:, [last - 1]]).any(axis=0).sum())
    count = min(max(near, last + 1), last + 1 + PROBES, most)
    guards = [mode for mode in range(1, last + 2) if mode not in wanted and mode <= most]
    plan = [(wanted, half_order)]
    if guards and half_order >= 2:
        plan.append((tuple(guards), half_order - 1))
    vectors = [vectors_to_order(pencil, x, some, order) for x in points for some, order in plan]
    elastic = pencil.elastic
    K0 = pencil.sparse(pencil.stiffness @ mean_theta(pencil, points))[elastic][:, elastic].tocsc()
    phi = found.phi[:, elastic, :count]
    V = orthonormal(K0, np.hstack([*phi[:, :, ::-1], *(columns[elastic] for columns in vectors)]))
    return np.hstack([V[:, :count][:, ::-1], V[:, count:]])


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
            raise AccuracyError("the stiffness is not positive definite at an expansion point")
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
