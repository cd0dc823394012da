"""An estimate of the reduced model's error in frequency, from its residuals: no exact solve.

In the inverse form (μ = 1/λ, ‖z‖_K = 1) let ρ_i be the residuals of the first c Ritz pairs, in the
norm of K_E(q, y)⁻¹, and ν the largest μ among modes that the basis does not represent. Eliminating
those modes moves the pairs by the symmetric matrix C_ij = ρ_iᵀρ_j / (μ̂_i − ν) (Kato-Temple, for all
pairs together), so that

    0 ≤ μ_i − μ̂_i ≲ ε_i = C_ii + Σ_{j≠i} min(|C_ij|, C_ij² / |μ̂_i − μ̂_j|).

Pairs that cross or veer inside the basis do not disturb each other: only the gap to ν counts. The
i-th largest of all μ̂_j + ε_j bounds μ_i, so that a pair that might overtake counts as well. As
f ∝ μ^{−1/2}, the relative error in frequency is √((μ̂ + ε)/μ̂) − 1, and the round-off on top.

The residual is known in K_E(q, y0)⁻¹ (see `residual`). Where design parameters soften links to α of
their stiffness at y0, α K_E(q, y0) ≤ K_E(q, y) (see `design_stiffness`), and ‖ρ‖²/α is a bound.
Under gravity K_g softens as well: α is no more than the least eigenvalue of K̂(q, y) in K̂(q, y0),
and where that buckles there is no answer. Where they add mass, ν grows by what that mass adds to
the modes beside the basis (see `added_mass`), and where riders travel along beams, by what their
longer spans do (see `spans`).

The estimate is infinite, that is, the answer is refused, where a pair stands for no mode any more,
or where a mode that the basis does not hold may lie below it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack

from eigassign.errors import SingularityError
from eigassign.mechanism.elements.sparse_factor import factorise
from eigassign.modal.exact.roundoff import rounding_weights
from eigassign.modal.reduced.added_mass import AddedMass, added_mass
from eigassign.modal.reduced.basis import RitzBasis
from eigassign.modal.reduced.design_stiffness import LEAST, DesignStiffness, design_stiffness
from eigassign.modal.reduced.pencil import ReducedPencil, ritz_pairs
from eigassign.modal.reduced.residual import (
    JointCorrection,
    ResidualTerms,
    joint_correction,
    residual_gram,
    residual_terms,
)
from eigassign.modal.reduced.spans import Spans, spans

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
# Beside each factor: what becomes of 8 386 answers of the families of `tests/stability` (planar,
# decoupled, softened, in space, in loops, bending alike) with another value in its place.
# On ‖ρ‖²: its norm is taken at an expansion point, not at x. 1: 40 are below their errors, by up to
# 1.07; 2: none.
SAFETY = 4.0
# Residual relative to μ̂ above which a pair stands for no mode. Any: 7 are below, by up to 22; 0.5:
# none.
LOST = 0.2
# How far μ of a mode may have moved since the expansion point, as a factor. 1 refuses 2.7 % more of
# those softened, none is below; nor is any of 1 855 in space, loops and alike with 4 or 16.
MARGIN = 2.0
# How far μ of a mode that is no longer represented may have moved, as a factor. 1, 2 or 8: a mode
# is missed in `test_links_that_know_nothing_of_each_other_hide_no_mode`.
RANGE = 4.0
# Share of a shape's mass in the Ritz pairs below which its mode has left the basis. 0: modes are
# missed in the same test; 0.1: none.
HELD = 0.5
REFUSED = 0.5  # relative error in frequency beyond which an answer is none; without: none is below
# Round-off of the dense eigensolver, relative to the largest μ, over ε. 0: an arm with a link
# without mass is 1.02 times as far off (`tests/stability/decoupled.py`, seed 244); 10: none.
SOLVER = 40.0
# On the round-off of one entry, ε/2 in frequency, through the whole solve. Of 1 128 answers beside
# the expansion point 0.2: 2 are below, by up to 1.6; 0.5: none, nor of 584 of planar loops.
ROUNDING = 5.0


@dataclass(frozen=True, eq=False)
class ErrorTerms:
    """Small arrays that the estimate needs beside the reduced pencil. Immutable."""

    residual: ResidualTerms
    joints: JointCorrection
    stiffness: DesignStiffness
    spans: Spans | None
    added: AddedMass
    anchors: Floats  # (n_points, c + 1): the largest μ at each point, one more than are represented
    first_design: Flags  # (n_points,): those of the first point's y, which growth is relative to
    shapes: Floats  # (n_points, k, c): those c modes in the basis
    stiffness_rounding: Floats  # Vᵀ d_K V (k, k), round-off weights of `roundoff` at x0
    mass_rounding: Floats  # (k + f, k + f)


def relative_error(reduced: ReducedPencil, terms: ErrorTerms, x: Floats) -> Floats:
    """Estimate (n, c) of the relative error in frequency at x (n, n_x); infinite: refused."""
    theta = reduced.theta(x)
    K, M_c, coupling = reduced.at(theta)
    all_mu, all_z = ritz_pairs(K, M_c)
    count = min(terms.anchors.shape[1] - 1, all_mu.shape[1])
    mu, z = all_mu[:, :count], all_z[:, :, :count]
    wide = np.concatenate([z, -coupling @ z], axis=1)
    n = reduced.n_q - reduced.n_loads  # loads belong to the design
    y0 = reduced.points[0, n:]
    turned, closes = _with_design(reduced, x, np.broadcast_to(y0, (len(x), len(y0))))
    scaled, stays = _with_design(reduced, x, terms.stiffness.scaling(x[:, n:], y0), theta)
    ratio = terms.stiffness.ratio(theta, scaled, turned)
    softest = ratio.min(axis=0, initial=1.0)
    if terms.stiffness.weighs:
        softest = np.minimum(softest, _softened(K, reduced.at(turned)[0]))
        stays &= (softest > 0.0) & terms.joints.stands(turned)
    softest = np.maximum(softest, LEAST)
    gram = residual_gram(terms.residual, terms.joints, theta, turned, mu, wide)
    gram = gram / softest[:, None, None]
    heavy, posed = _with_design(reduced, x, terms.added.heaviest(x[:, n:], y0), theta)
    # Beside the basis the pose moves modes as well; as a design reorders them, that counts with it
    beside = np.maximum(softest / RANGE, softest**2)
    travel = np.ones((len(terms.anchors), len(x)))
    if terms.spans is not None:
        travel = terms.spans.growth(reduced, x)
    outside = largest_outside(terms, mu, beside / terms.added.factor(theta), travel)
    outside += terms.added.lifted(heavy, turned) / beside
    error = frequency_error(mu, gram, outside, terms.anchors)
    if terms.stiffness.weighs:  # the basis is stiffer than K_E by as much as its modes may err
        softer = (1.0 + np.minimum(error.max(axis=1), REFUSED)) ** 2
        gram, outside = gram * softer[:, None, None], outside * softer
        error = frequency_error(mu, gram, outside, terms.anchors)
    error[~(closes & posed & stays)] = np.inf
    shares = _mass_shares(terms, M_c, all_mu, all_z)
    heavier = terms.added.heavier_shapes(theta, turned)
    most, own = (heavier / each for each in terms.stiffness.softer_shapes(ratio))
    most = most * travel[:, :, None]
    error[mode_missing(all_mu, gram, shares, terms.anchors, most, own)] = np.inf
    hardest = ratio.max(axis=0, initial=1.0)
    return np.asarray(error + _rounding(reduced, terms, theta, mu, wide, hardest))


def error_beside(f: Floats, better: Floats, estimate: Floats) -> Floats:
    """Relative error of frequencies f (n, n_modes) beside ``better`` ones with their ``estimate``.

    Infinite where f is not a number or the better one is refused.
    """
    apart = np.abs(f / better - 1.0)
    with np.errstate(invalid="ignore"):  # 0 · ∞, where the better one is refused
        bound = apart * (1.0 + estimate) + estimate
    return np.where(np.isfinite(bound), bound, np.inf)


# --- From residuals to a relative error in frequency


def frequency_error(mu: Floats, gram: Floats, outside: Floats, anchors: Floats) -> Floats:
    """Relative error in frequency (n, c) of Ritz values μ̂ (n, c), descending; f ∝ μ^{−1/2}.

    ``gram`` (n, c, c) holds ρ_iᵀρ_j, ``outside`` (n,) how large μ of a mode without any vector in
    the basis may be, ``anchors`` (n_points, ≥ c) μ at the expansion points. Infinite where it is
    refused: the pair is lost, or a mode that is not represented may lie below it.
    """
    best = np.full(mu.shape, np.inf)
    for kept in range(1, mu.shape[1] + 1):
        shift = _shifts(mu, SAFETY * gram, outside, kept)
        best[:, :kept] = np.minimum(best[:, :kept], shift)
    norms = np.sqrt(SAFETY * np.einsum("nii->ni", gram))
    top = -np.sort(-(mu + np.minimum(best, norms)), axis=1)
    error = np.sqrt(np.maximum(top / mu, 1.0)) - 1.0
    hidden = (mu <= outside[:, None]) | _fewer_than_before(mu, norms, anchors)
    return np.where(hidden | ~(error < REFUSED), np.inf, error)


def _fewer_than_before(mu: Floats, norms: Floats, anchors: Floats) -> Flags:
    """Where a mode that was there at an expansion point has left the basis, (n, c).

    Pairs with a large residual stand for no mode. Where there are any, every mode that lay below
    the pair in question at an expansion point, by a margin or less, must be among the others.
    """
    sure = norms < LOST * mu
    found = (sure[:, None, :] & (mu[:, None, :] * MARGIN >= mu[:, :, None])).sum(axis=2)
    there = (anchors[:, None, None, :] * MARGIN >= mu[:, :, None]).sum(axis=3).max(axis=0)
    some_lost = np.any(~sure, axis=1, keepdims=True)
    return np.asarray(some_lost & (there > found))


def _shifts(mu: Floats, gram: Floats, outside: Floats, kept: int) -> Floats:
    """ε_i (n, kept) with the pairs from ``kept`` on counted among the unrepresented modes."""
    norms = np.sqrt(np.einsum("nii->ni", gram[:, kept:, kept:]))
    beyond = np.max(mu[:, kept:] + norms, axis=1, initial=0.0)
    gap = mu[:, :kept] - np.maximum(beyond, outside)[:, None]
    mu, gram = mu[:, :kept], gram[:, :kept, :kept]
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        C = np.where(gap[:, :, None] > 0.0, np.abs(gram) / gap[:, :, None], np.inf)
        mixed = np.fmin(C, C**2 / np.abs(mu[:, :, None] - mu[:, None, :]))
    diagonal = np.einsum("nii->ni", C)
    mixed[:, np.arange(kept), np.arange(kept)] = 0.0
    return np.asarray(diagonal + mixed.sum(axis=2))


# --- Modes that the basis does not hold, or no longer


def largest_outside(
    terms: ErrorTerms, mu: Floats, softest: Floats, travel: Floats | None = None
) -> Floats:
    """How large μ of the modes without a vector in the basis may have become, (n,).

    Their largest μ at an expansion point, grown as the represented modes did or as the links
    softened, whichever is more, and as the spans beside riders did by their ``travel`` (n_points,
    n); of those points of whose design that is known the one that says least counts.
    """
    anchors = terms.anchors[terms.first_design]
    growth = np.max(mu[:, None, :] / anchors[:, : mu.shape[1]], axis=2)
    grown = anchors[:, -1] * np.maximum(growth, 1.0 / softest[:, None])
    if travel is not None:
        grown = grown * travel[terms.first_design].T
    return np.asarray(grown.min(axis=1))


def mode_missing(
    mu: Floats,
    gram: Floats,
    shares: Floats,
    anchors: Floats,
    most: Floats | float = 1.0,
    own: Floats | float = 1.0,
) -> Flags:
    """Pairs (n, c) beside or below which a mode of every expansion point is missing.

    μ̂ (n, k) and ``shares`` (n_points, n, c, k) of all Ritz pairs in the mass of each shape of a
    point. A shape with less than half of it in pairs that may stand for a mode has changed or left:
    it has left where there are also fewer pairs within RANGE than there were modes. Beyond the
    first c the residuals are not known: such a pair may stand for a shape only within RANGE.
    Designs raised μ of each shape by a factor of at ``most`` (n_points, n, c), and of the shape as
    it was by a factor of its ``own``.
    """
    c = gram.shape[1]
    sure = np.ones(mu.shape, dtype=bool)
    sure[:, :c] = np.sqrt(SAFETY * np.einsum("nii->ni", gram)) < LOST * mu[:, :c]
    was = anchors[:, None, :-1, None]
    reach = np.where(np.arange(mu.shape[1]) < c, RANGE**2, RANGE)
    now = was * np.atleast_1d(own)[..., None]
    like = sure[None, :, None, :] & ((mu * reach)[None, :, None, :] >= now)
    weak = (shares * like).sum(axis=3) < HELD
    pair = mu[:, :c]
    grown = np.maximum(np.atleast_1d(most) / MARGIN, 1.0)  # RANGE allows for the rest
    within = was * RANGE * grown[..., None] >= pair[None, :, None, :]
    found = (sure[:, None, :] & (mu[:, None, :] * RANGE >= pair[:, :, None])).sum(axis=2)
    fewer = within.sum(axis=2) > found
    return np.asarray((fewer & (weak[..., None] & within).any(axis=2)).all(axis=0))


def _mass_shares(terms: ErrorTerms, M_c: Floats, mu: Floats, z: Floats) -> Floats:
    """Share of each pair in the mass of each shape of a point, (n_points, n, c, k).

    A shape a of an expansion point keeps its mass in any pose: (aᵀM̂_c z_i)² / (μ̂_i aᵀM̂_c a) say
    whether it is still among the pairs.
    """
    shares = []
    for a in terms.shapes:
        moved = M_c @ a
        weight = (np.swapaxes(moved, 1, 2) @ z) ** 2 / np.maximum(mu, 1e-300)[:, None, :]
        shares.append(weight / np.einsum("kc,nkc->nc", a, moved)[:, :, None])
    return np.array(shares)


# --- Designs, and round-off


def _softened(K: Floats, before: Floats) -> Floats:
    """The least eigenvalue (n,) of K (n, k, k) in K ``before``; 0 where that is not definite."""
    least = np.zeros(len(K))
    for k, (one, other) in enumerate(zip(K, before, strict=True)):
        L, info = lapack.dpotrf(other, lower=1)
        if not info:
            least[k] = np.linalg.eigvalsh(lapack.dsygst(one, L, lower=1)[0])[0]
    return least


def _with_design(
    reduced: ReducedPencil, x: Floats, y: Floats, theta: Floats | None = None
) -> tuple[Floats, Flags]:
    """θ (n_theta, n) at (q, y), and where there is one: a loop may not close with other lengths.

    Loads in q are of the design. θ(x0) stands where there is none. ``theta`` are those at x, where
    that is the same.
    """
    turned = x.copy()
    turned[:, reduced.n_q - reduced.n_loads :] = y
    if theta is not None and (turned == x).all():
        return theta, np.ones(len(x), dtype=bool)
    try:
        return reduced.theta(turned), np.ones(len(x), dtype=bool)
    except SingularityError:
        closes = np.ones(len(x), dtype=bool)
        for k, row in enumerate(turned):
            try:
                reduced.theta(row[None])
            except SingularityError:
                closes[k] = False
        turned[~closes] = reduced.points[0]
        return reduced.theta(turned), closes


def _rounding(
    reduced: ReducedPencil,
    terms: ErrorTerms,
    theta: Floats,
    mu: Floats,
    wide: Floats,
    hardest: Floats,
) -> Floats:
    """Relative round-off in frequency of each pair, (n, c).

    That of an exact solve (`roundoff`), that of K̂ and M̂ themselves (a basis made for one pose
    strains far more than a mode in another: |z|ᵀ|K̂||z| ≫ zᵀK̂z), and the eigensolver's.
    """
    k, size = reduced.size, np.abs(wide)
    K, M = reduced.magnitudes(theta)
    strain = hardest[:, None] * _forms(terms.stiffness_rounding, wide[:, :k]) + _forms(
        K, size[:, :k]
    )
    inertia = _forms(terms.mass_rounding, wide) + _forms(M, size)
    amplification = strain + (inertia + SOLVER * mu[:, :1]) / mu
    return np.asarray(ROUNDING * np.finfo(float).eps * amplification)


def _forms(A: Floats, z: Floats) -> Floats:
    """z_cᵀ A z_c for every column, (n, c)."""
    return np.asarray(np.einsum("nic,nic->nc", z, A @ z))


# --- Offline


def error_terms(basis: RitzBasis) -> ErrorTerms:
    """The arrays of the estimate, from one factorisation of K0."""
    pencil, wide, k = basis.pencil, basis.wide, basis.V.shape[1]
    factor = factorise(basis.K0)
    theta0 = basis.theta0[:, 0]
    d_K, d_M = rounding_weights(pencil, theta0)
    count = basis.represented.shape[2]
    following = 1.0 / basis.lam[:, count : count + 1]
    if not following.size:
        following = np.zeros((len(basis.lam), 1))
    return ErrorTerms(
        residual=residual_terms(pencil, basis.K0, factor, wide),
        joints=joint_correction(pencil, factor, basis.theta_mean, wide),
        stiffness=design_stiffness(pencil, basis.points, basis.represented),
        spans=spans(pencil, basis.points),
        added=added_mass(pencil, factor, basis.points[0], basis.V, basis.represented),
        anchors=np.hstack([1.0 / basis.lam[:, :count], following]),
        first_design=(basis.points == basis.points[0])[:, pencil.n_joints :].all(axis=1),
        shapes=basis.shapes,
        stiffness_rounding=(wide[:, :k].T * d_K) @ wide[:, :k],
        mass_rounding=(wide.T * d_M) @ wide,
    )
