"""The reduced model: Ritz on the Taylor vectors, with the exact affine pencil.

The pencil is projected on span{φ_γ : |γ| ≤ m} ⊕ [0; I]: K̂(x) = Σ θ_j(x) VᵀK_jV and likewise M̂.
Its eigenvalues share every derivative the Taylor vectors give, but stay accurate far beyond the
radius of convergence. Rigid-body motion is projected out exactly, as in the exact solve.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.errors import UsageError
from eigassign.mechanism.pencil import Pencil
from eigassign.modal.basis import orthonormal
from eigassign.modal.estimate import frequency_error
from eigassign.modal.exact import condense
from eigassign.modal.expansion import expand
from eigassign.modal.project import project
from eigassign.modal.residual import Residual, residual_factors
from eigassign.modal.roundoff import rounding_error
from eigassign.modal.samples import samples
from eigassign.series.program import Program, Samples

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
CHUNK = 2048  # samples evaluated at once


@dataclass(frozen=True, eq=False)
class ReducedModel:
    """Frequencies of ``modes`` from k + f unknowns; needs neither mesh nor mechanism. Immutable."""

    modes: tuple[int, ...]
    n_q: int
    n_y: int
    half_order: int
    points: Floats  # (n_points, n_x): the expansion points
    program: Program
    to_program: Floats
    shift: Floats
    stiffness_terms: Ints  # indices of θ with a stiffness term
    stiffness: Floats  # (n_terms, k, k)
    mass_terms: Ints
    mass: Floats  # (n_terms, k + f, k + f)
    residual: Residual
    material_terms: Ints  # indices of θ with a stiffness term that no joint coordinate enters
    material: Floats  # their values at the first expansion point
    rounding: float  # relative round-off of an exact solve of this pencil

    @property
    def size(self) -> int:
        """Number k of basis vectors."""
        return int(self.stiffness.shape[1])

    def frequencies(self, q: ArrayLike, y: ArrayLike) -> Floats:
        """(n_samples, n_modes) in Hz; ``error_estimate`` says how far to trust them."""
        wanted = np.array(self.modes) - 1
        parts = [self._ritz(theta, False)[0] for theta in self._theta(q, y)]
        mu = np.concatenate(parts)[:, wanted]
        return np.asarray(1.0 / (2.0 * np.pi * np.sqrt(mu)))

    def error_estimate(self, q: ArrayLike, y: ArrayLike) -> Floats:
        """Estimate of the relative error in frequency, (n_samples, n_modes); no exact solve.

        Infinite where it is refused: a neighbouring mode is not represented, so that not even the
        identity of the mode is certain.
        """
        return np.concatenate([self._estimate(theta) for theta in self._theta(q, y)])

    def _theta(self, q: ArrayLike, y: ArrayLike) -> list[Floats]:
        x = samples(q, y, self.n_q, self.n_y)
        chunks = [x[i : i + CHUNK] for i in range(0, len(x), CHUNK)]
        return [self._theta_at(chunk) for chunk in chunks]

    def _theta_at(self, x: Floats) -> Floats:
        z = self.to_program @ x.T + self.shift[:, None]
        theta = np.vstack([np.ones((1, len(x))), self.program.run(Samples(), z)])
        if not np.isfinite(theta).all():
            raise UsageError("q or y is outside the domain of a section or length")
        return theta

    def _matrices(self, theta: Floats) -> tuple[Floats, Floats, Floats]:
        """K̂, M̂_c (n, k, k) and the coupling M̂_FF⁻¹ M̂_FE (n, f, k)."""
        k = self.size
        K = np.tensordot(theta[self.stiffness_terms].T, self.stiffness, axes=1)
        M = np.tensordot(theta[self.mass_terms].T, self.mass, axes=1)
        elastic, rigid = np.arange(k), np.arange(k, M.shape[1])
        coupling, M_c = condense(M, elastic, rigid)
        return K, M_c, coupling

    def _ritz(self, theta: Floats, vectors: bool) -> tuple[Floats, Floats, Floats]:
        """Ritz values μ̂ descending (n, k), vectors z (n, k, k) with zᵀK̂z = 1, and coupling."""
        K, M_c, coupling = self._matrices(theta)
        L = np.linalg.cholesky(K)
        half = np.linalg.solve(L, M_c)
        A = np.linalg.solve(L, np.swapaxes(half, 1, 2))
        if not vectors:
            return np.linalg.eigvalsh(A)[:, ::-1], A[:, :0], coupling
        mu, v = np.linalg.eigh(A)
        z = np.linalg.solve(np.swapaxes(L, 1, 2), v)
        return mu[:, ::-1], z[:, :, ::-1], coupling

    def _estimate(self, theta: Floats) -> Floats:
        mu, z, coupling = self._ritz(theta, True)
        count = min(max(self.modes) + 1, mu.shape[1])
        norms = self._residual_norms(theta, mu[:, :count], z[:, :, :count], coupling)
        error = frequency_error(mu[:, :count], norms / np.sqrt(self._softest(theta))[:, None])
        return np.asarray(error[:, np.array(self.modes) - 1] + self.rounding)

    def _softest(self, theta: Floats) -> Floats:
        """How much softer than at x0 the softest part of the links is, (n,), at most 1.

        ‖ρ‖ is measured in K(x0)⁻¹; K(x) ≥ α K(x0) makes ‖ρ‖²/α a bound in K(x)⁻¹. Joint angles
        only turn the links against each other; material and section scale them.
        """
        if not len(self.material_terms):
            return np.ones(theta.shape[1])
        ratio = theta[self.material_terms] / self.material[:, None]
        return np.asarray(np.clip(ratio.min(axis=0), 1e-300, 1.0))

    def _residual_norms(self, theta: Floats, mu: Floats, z: Floats, coupling: Floats) -> Floats:
        """‖M_c z − μ̂ K z‖ in K_E(x0)⁻¹ for every Ritz pair, (n, count)."""
        wide = np.concatenate([z, -coupling @ z], axis=1)
        r = self.residual
        K = np.tensordot(theta[r.stiffness_terms].T, r.stiffness, axes=1)
        M = np.tensordot(theta[r.mass_terms].T, r.mass, axes=1)
        return np.asarray(np.linalg.norm(M @ wide - (K @ z) * mu[:, None, :], axis=1))


def reduce(
    pencil: Pencil,
    q0: ArrayLike,
    y0: ArrayLike,
    modes: Sequence[int] = (1,),
    half_order: int = 2,
    guard: bool = True,
) -> ReducedModel:
    """Reduced model from the Taylor vectors of ``modes`` to order m at one or several points.

    q0 (n_q,) or (n_points, n_q), y0 likewise. With ``guard`` the modes below and the next one above
    join to order m − 1: they cost little, sharpen the result, and let the error estimate see them.
    Raises UsageError for impossible arguments, AccuracyError where no basis can be made.
    """
    n_y = pencil.to_program.shape[1] - pencil.n_q
    points = samples(q0, y0, pencil.n_q, n_y)
    if not 0 <= half_order <= 10:
        raise UsageError(f"half_order {half_order} is not within 0 to 10")
    elastic = pencil.elastic
    vectors = [_taylor_vectors(pencil, x, modes, half_order, guard)[elastic] for x in points]
    K0 = pencil.sparse(pencil.stiffness @ pencil.theta(points[:1])[:, 0])[elastic][:, elastic]
    V = orthonormal(K0, np.hstack(vectors))
    wide = np.zeros((pencil.n_dof, V.shape[1] + len(pencil.rigid)))
    wide[elastic, : V.shape[1]] = V
    wide[pencil.rigid, V.shape[1] :] = np.eye(len(pencil.rigid))
    stiffness, mass = project(pencil, wide)
    k_terms, m_terms = (
        np.flatnonzero(np.diff(w.tocsc().indptr)) for w in (pencil.stiffness, pencil.mass)
    )
    theta0 = pencil.theta(points[:1])[:, 0]
    joints = pencil.program.dependence[:, : pencil.n_q]
    jointless = ~np.asarray(joints.any(axis=1))
    scaled = [t for t in k_terms.tolist() if t and jointless[t - 1] and theta0[t]]
    material = np.array(scaled, dtype=np.intp)
    return ReducedModel(
        modes=tuple(sorted({int(m) for m in modes})),
        n_q=pencil.n_q,
        n_y=n_y,
        half_order=half_order,
        points=points,
        program=pencil.program,
        to_program=pencil.to_program,
        shift=pencil.shift,
        stiffness_terms=k_terms,
        stiffness=stiffness[k_terms][:, : V.shape[1], : V.shape[1]],
        mass_terms=m_terms,
        mass=mass[m_terms],
        residual=residual_factors(pencil, K0.tocsc(), V, elastic),
        material_terms=material,
        material=theta0[material],
        rounding=3.0 * rounding_error(pencil, points[0], max(modes)),
    )


def _taylor_vectors(
    pencil: Pencil, x0: Floats, modes: Sequence[int], half_order: int, guard: bool
) -> Floats:
    """Columns φ_γ (n_dof, N) of the modes and, to one order less, of their guards."""
    wanted = sorted({int(m) for m in modes})
    elastic = pencil.n_dof - len(pencil.rigid)
    others = [m for m in range(1, min(wanted[-1] + 1, elastic) + 1) if m not in wanted]
    columns = [_columns(pencil, x0, wanted, half_order)]
    if guard and others:
        columns.append(_columns(pencil, x0, others, max(half_order - 1, 0)))
    return np.hstack(columns)


def _columns(pencil: Pencil, x0: Floats, modes: Sequence[int], order: int) -> Floats:
    q0, y0 = x0[: pencil.n_q], x0[pencil.n_q :]
    found = expand(pencil, q0, y0, modes, order=max(order, 1), vector_order=order)
    blocks = [X.transpose(1, 0, 2).reshape(pencil.n_dof, -1) for X in found.vectors]
    return np.hstack(blocks)
