"""The reduced model: Ritz on the Taylor vectors, with the exact affine pencil.

The pencil is projected on span{φ_γ : |γ| ≤ m} ⊕ [0; I]: K̂(x) = Σ θ_j(x) VᵀK_jV and likewise M̂.
Its eigenvalues share every derivative the Taylor vectors give, but stay accurate far beyond the
radius of convergence. Rigid-body motion is projected out exactly, as in the exact solve.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.errors import SingularityError, UsageError
from eigassign.modal.estimate import frequency_error, gone
from eigassign.modal.exact import condense
from eigassign.modal.pose import Pose, corrected
from eigassign.modal.residual import Residual
from eigassign.modal.samples import samples
from eigassign.series.algebra import Samples
from eigassign.series.program import Program

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
CHUNK = 2048  # samples evaluated at once
SOLVER = 40.0  # round-off of the dense eigensolver, relative to the largest μ, over ε
ROUNDING = 5.0  # on the round-off of one entry, ε/2 in frequency, through the whole solve


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
    pose: Pose
    material_terms: Ints  # indices of θ with a stiffness term that no joint coordinate enters
    material: Floats  # their values at the first expansion point
    anchors: Floats  # (n_points, c + 1): the largest μ at each point, one more than are represented
    shapes: Floats  # (n_points, k, c): those c modes in the basis
    stiffness_rounding: Floats  # Vᵀ d_K V (k, k), round-off weights of `roundoff` at x0
    mass_rounding: Floats  # (k + f, k + f)

    @property
    def size(self) -> int:
        """Number k of basis vectors."""
        return int(self.stiffness.shape[1])

    def frequencies(self, q: ArrayLike, y: ArrayLike) -> Floats:
        """(n_samples, n_modes) in Hz; ``error_estimate`` says how far to trust them."""
        wanted = np.array(self.modes) - 1
        parts = [self._ritz(self._theta(x), False)[0] for x in self._chunks(q, y)]
        mu = np.concatenate(parts)[:, wanted]
        return np.asarray(1.0 / (2.0 * np.pi * np.sqrt(mu)))

    def error_estimate(self, q: ArrayLike, y: ArrayLike) -> Floats:
        """Estimate of the relative error in frequency, (n_samples, n_modes); no exact solve.

        Infinite where it is refused: a neighbouring mode is not represented, so that not even the
        identity of the mode is certain.
        """
        return np.concatenate([self._estimate(x) for x in self._chunks(q, y)])

    def _chunks(self, q: ArrayLike, y: ArrayLike) -> list[Floats]:
        x = samples(q, y, self.n_q, self.n_y)
        return [x[i : i + CHUNK] for i in range(0, max(len(x), 1), CHUNK)]

    def _theta(self, x: Floats) -> Floats:
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

    def _estimate(self, x: Floats) -> Floats:
        theta = self._theta(x)
        all_mu, all_z, coupling = self._ritz(theta, True)
        count = min(self.anchors.shape[1] - 1, all_mu.shape[1])
        mu, z = all_mu[:, :count], all_z[:, :, :count]
        wide = np.concatenate([z, -coupling @ z], axis=1)
        softest, hardest = self._scaling(theta)
        turned, closes = self._at_first_design(x)
        gram = self._residual_gram(turned, theta, mu, wide) / softest[:, None, None]
        error = frequency_error(mu, gram, self._outside(mu, softest), self.anchors)
        error[~closes] = np.inf
        error[self._gone(theta, all_mu, all_z, gram)] = np.inf
        error += self._rounding(theta, mu, wide, hardest)
        return np.asarray(error[:, np.array(self.modes) - 1])

    def _outside(self, mu: Floats, softest: Floats) -> Floats:
        """How large μ of the modes without a vector in the basis may have become, (n,).

        Their largest μ at an expansion point, grown as the represented modes did or as the links
        softened, whichever is more; the expansion point that says least counts.
        """
        known = self.anchors[:, : mu.shape[1]]
        growth = np.max(mu[:, None, :] / known, axis=2)
        grown = self.anchors[:, -1] * np.maximum(growth, 1.0 / softest[:, None])
        return np.asarray(grown.min(axis=1))

    def _gone(self, theta: Floats, mu: Floats, z: Floats, gram: Floats) -> NDArray[np.bool_]:
        """Where a mode may be missing because the basis no longer holds it, (n, c): see `estimate`.

        A shape a of an expansion point keeps its mass in any pose: the shares of the Ritz pairs in
        it, (aᵀM̂_c z_i)² / (μ̂_i aᵀM̂_c a), say whether it is still among them.
        """
        M_c = self._matrices(theta)[1]
        shares = []
        for a in self.shapes:
            moved = M_c @ a
            weight = (np.swapaxes(moved, 1, 2) @ z) ** 2 / np.maximum(mu, 1e-300)[:, None, :]
            shares.append(weight / np.einsum("kc,nkc->nc", a, moved)[:, :, None])
        return gone(mu, gram, np.array(shares), self.anchors)

    def _scaling(self, theta: Floats) -> tuple[Floats, Floats]:
        """Least and largest stiffness of a link relative to x0, (n,): α ≤ 1 ≤ β.

        α K(q, y0) ≤ K(q, y) ≤ β K(q, y0), so that ‖ρ‖²/α is a bound in K(q, y)⁻¹.
        """
        if not len(self.material_terms):
            return np.ones(theta.shape[1]), np.ones(theta.shape[1])
        ratio = theta[self.material_terms] / self.material[:, None]
        return np.clip(ratio.min(axis=0), 1e-300, 1.0), np.maximum(ratio.max(axis=0), 1.0)

    def _rounding(self, theta: Floats, mu: Floats, wide: Floats, hardest: Floats) -> Floats:
        """Relative round-off in frequency of each pair, (n, c).

        That of an exact solve (`roundoff`), that of K̂ and M̂ themselves (a basis made for one pose
        strains far more than a mode in another: |z|ᵀ|K̂||z| ≫ zᵀK̂z), and the eigensolver's.
        """
        k = self.size
        z, size = wide[:, :k], np.abs(wide)
        K = np.abs(np.tensordot(theta[self.stiffness_terms].T, self.stiffness, axes=1))
        M = np.abs(np.tensordot(theta[self.mass_terms].T, self.mass, axes=1))
        strain = hardest[:, None] * _forms(self.stiffness_rounding, z) + _forms(K, size[:, :k])
        inertia = _forms(self.mass_rounding, wide) + _forms(M, size)
        amplification = strain + (inertia + SOLVER * mu[:, :1]) / mu
        return np.asarray(ROUNDING * np.finfo(float).eps * amplification)

    def _at_first_design(self, x: Floats) -> tuple[Floats, NDArray[np.bool_]]:
        """θ(q, y0) (n_theta, n), and where there is one: a loop may not close with other lengths.

        θ(x0) stands where there is none.
        """
        turned = x.copy()
        turned[:, self.n_q :] = self.points[0, self.n_q :]
        try:
            return self._theta(turned), np.ones(len(x), dtype=bool)
        except SingularityError:
            closes = np.array([self._has_pose(row) for row in turned])
            turned[~closes] = self.points[0]
            return self._theta(turned), closes

    def _has_pose(self, x: Floats) -> bool:
        try:
            self._theta(x[None])
        except SingularityError:
            return False
        return True

    def _residual_gram(self, turned: Floats, theta: Floats, mu: Floats, wide: Floats) -> Floats:
        """ρ_iᵀ K_E(q, y0)⁻¹ ρ_j, ρ = M_c z − μ̂ K z, between the leading Ritz pairs, (n, c, c).

        ``theta`` at (q, y), ``turned`` at (q, y0).
        """
        r, p, z = self.residual, self.pose, wide[:, : self.size]

        def apply(K_at: Ints, K_terms: Floats, M_at: Ints, M_terms: Floats) -> Floats:
            K = np.tensordot(theta[K_at].T, K_terms, axes=1)
            M = np.tensordot(theta[M_at].T, M_terms, axes=1)
            return np.asarray(M @ wide - (K @ z) * mu[:, None, :])

        rho = apply(r.stiffness_terms, r.stiffness, r.mass_terms, r.mass)
        gram = np.asarray(np.swapaxes(rho, 1, 2) @ rho)
        if not len(p.terms):
            return gram
        g = apply(self.stiffness_terms, p.stiffness_rows, self.mass_terms, p.mass_rows)
        return corrected(gram, p, turned, g)


def _forms(A: Floats, z: Floats) -> Floats:
    """z_cᵀ A z_c for every column, (n, c)."""
    return np.asarray(np.einsum("nic,nic->nc", z, A @ z))
