"""The reduced model's own error at samples, from its residual in the whole pencil: no exact solve.

Batches of small arrays only; the formulas are those of `residual`, `pose` and `estimate`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import SingularityError
from eigassign.modal.error_terms import ErrorTerms
from eigassign.modal.estimate import frequency_error, gone
from eigassign.modal.pose import corrected
from eigassign.modal.ritz_pairs import ritz_pairs

if TYPE_CHECKING:
    from eigassign.modal.reduced_model import ReducedModel

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
SOLVER = 40.0  # round-off of the dense eigensolver, relative to the largest μ, over ε
ROUNDING = 5.0  # on the round-off of one entry, ε/2 in frequency, through the whole solve
CLOSURE = 2.0  # on that, where loops close: θ carries the round-off of passive freedoms, J_p⁻¹F


def relative_error(reduced: ReducedModel, x: Floats) -> Floats:
    """Estimate (n, n_modes) of the relative error in frequency at x (n, n_x); infinite: refused."""
    terms, theta = reduced.error_terms, reduced.theta(x)
    K, M_c, coupling = reduced.at(theta)
    all_mu, all_z = ritz_pairs(K, M_c)
    count = min(terms.anchors.shape[1] - 1, all_mu.shape[1])
    mu, z = all_mu[:, :count], all_z[:, :, :count]
    wide = np.concatenate([z, -coupling @ z], axis=1)
    softest, hardest = _scaling(terms, theta)
    turned, closes = _at_first_design(reduced, x)
    gram = _residual_gram(reduced, turned, theta, mu, wide) / softest[:, None, None]
    error = frequency_error(mu, gram, _outside(terms, mu, softest), terms.anchors)
    error[~closes] = np.inf
    error[_gone(terms, M_c, all_mu, all_z, gram)] = np.inf
    error += _rounding(reduced, theta, mu, wide, hardest)
    return np.asarray(error[:, np.array(reduced.modes) - 1])


def _outside(terms: ErrorTerms, mu: Floats, softest: Floats) -> Floats:
    """How large μ of the modes without a vector in the basis may have become, (n,).

    Their largest μ at an expansion point, grown as the represented modes did or as the links
    softened, whichever is more; the expansion point that says least counts.
    """
    known = terms.anchors[:, : mu.shape[1]]
    growth = np.max(mu[:, None, :] / known, axis=2)
    grown = terms.anchors[:, -1] * np.maximum(growth, 1.0 / softest[:, None])
    return np.asarray(grown.min(axis=1))


def _gone(terms: ErrorTerms, M_c: Floats, mu: Floats, z: Floats, gram: Floats) -> NDArray[np.bool_]:
    """Where a mode may be missing because the basis no longer holds it, (n, c): see `estimate`.

    A shape a of an expansion point keeps its mass in any pose: the shares of the Ritz pairs in
    it, (aᵀM̂_c z_i)² / (μ̂_i aᵀM̂_c a), say whether it is still among them.
    """
    shares = []
    for a in terms.shapes:
        moved = M_c @ a
        weight = (np.swapaxes(moved, 1, 2) @ z) ** 2 / np.maximum(mu, 1e-300)[:, None, :]
        shares.append(weight / np.einsum("kc,nkc->nc", a, moved)[:, :, None])
    return gone(mu, gram, np.array(shares), terms.anchors)


def _scaling(terms: ErrorTerms, theta: Floats) -> tuple[Floats, Floats]:
    """Least and largest stiffness of a link relative to x0, (n,): α ≤ 1 ≤ β.

    α K(q, y0) ≤ K(q, y) ≤ β K(q, y0), so that ‖ρ‖²/α is a bound in K(q, y)⁻¹.
    """
    if not len(terms.material_terms):
        return np.ones(theta.shape[1]), np.ones(theta.shape[1])
    ratio = theta[terms.material_terms] / terms.material[:, None]
    return np.clip(ratio.min(axis=0), 1e-300, 1.0), np.maximum(ratio.max(axis=0), 1.0)


def _rounding(
    reduced: ReducedModel, theta: Floats, mu: Floats, wide: Floats, hardest: Floats
) -> Floats:
    """Relative round-off in frequency of each pair, (n, c).

    That of an exact solve (`roundoff`), that of K̂ and M̂ themselves (a basis made for one pose
    strains far more than a mode in another: |z|ᵀ|K̂||z| ≫ zᵀK̂z), and the eigensolver's.
    """
    k, terms = reduced.size, reduced.error_terms
    z, size = wide[:, :k], np.abs(wide)
    K, M = (np.abs(matrix) for matrix in reduced.uncondensed(theta))
    strain = hardest[:, None] * _forms(terms.stiffness_rounding, z) + _forms(K, size[:, :k])
    inertia = _forms(terms.mass_rounding, wide) + _forms(M, size)
    amplification = strain + (inertia + SOLVER * mu[:, :1]) / mu
    rounding = ROUNDING * (CLOSURE if reduced.program.is_implicit else 1.0) * np.finfo(float).eps
    return np.asarray(rounding * amplification)


def _at_first_design(reduced: ReducedModel, x: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    """θ(q, y0) (n_theta, n), and where there is one: a loop may not close with other lengths.

    θ(x0) stands where there is none.
    """
    turned = x.copy()
    turned[:, reduced.n_q :] = reduced.points[0, reduced.n_q :]
    try:
        return reduced.theta(turned), np.ones(len(x), dtype=bool)
    except SingularityError:
        closes = np.array([_has_pose(reduced, row) for row in turned])
        turned[~closes] = reduced.points[0]
        return reduced.theta(turned), closes


def _has_pose(reduced: ReducedModel, x: Floats) -> bool:
    try:
        reduced.theta(x[None])
    except SingularityError:
        return False
    return True


def _residual_gram(
    reduced: ReducedModel, turned: Floats, theta: Floats, mu: Floats, wide: Floats
) -> Floats:
    """ρ_iᵀ K_E(q, y0)⁻¹ ρ_j, ρ = M_c z − μ̂ K z, between the leading Ritz pairs, (n, c, c).

    ``theta`` at (q, y), ``turned`` at (q, y0).
    """
    r, p, z = reduced.error_terms.residual, reduced.error_terms.pose, wide[:, : reduced.size]

    def apply(K_at: Ints, K_terms: Floats, M_at: Ints, M_terms: Floats) -> Floats:
        K = np.tensordot(theta[K_at].T, K_terms, axes=1)
        M = np.tensordot(theta[M_at].T, M_terms, axes=1)
        return np.asarray(M @ wide - (K @ z) * mu[:, None, :])

    rho = apply(r.stiffness_terms, r.stiffness, r.mass_terms, r.mass)
    gram = np.asarray(np.swapaxes(rho, 1, 2) @ rho)
    if not len(p.terms):
        return gram
    g = apply(reduced.stiffness_terms, p.stiffness_rows, reduced.mass_terms, p.mass_rows)
    return corrected(gram, p, turned, g)


def _forms(A: Floats, z: Floats) -> Floats:
    """z_cᵀ A z_c for every column, (n, c)."""
    return np.asarray(np.einsum("nic,nic->nc", z, A @ z))
