"""The reduced model's own error at samples, from its residual in the whole pencil: no exact solve.

Batches of small arrays only; the formulas are those of `residual`, `pose` and `estimate`.

What a reduced model's error estimate needs besides it: built when first asked for.

From residuals of Ritz pairs to an estimate of the relative error in frequency.

In the inverse form (μ = 1/λ, ‖z‖_K = 1) let ρ_i be the residuals of the first c Ritz pairs and ν
the largest μ among modes that the basis does not represent. Eliminating those modes moves the pairs
by the symmetric matrix C_ij = ρ_iᵀρ_j / (μ̂_i − ν) (Kato-Temple, for all pairs together), so that

    0 ≤ μ_i − μ̂_i ≲ ε_i = C_ii + Σ_{j≠i} min(|C_ij|, C_ij² / |μ̂_i − μ̂_j|).

Pairs that cross or veer inside the basis do not disturb each other: only the gap to ν counts. The
i-th largest of all μ̂_j + ε_j bounds μ_i, so a pair that might overtake is counted in.

The size of an eigen-residual of the reduced model, without a vector of full length online.

In the inverse form a Ritz pair (μ̂, z) leaves ρ = M_c z − μ̂ K_E z. Over all (q, y) it lies in the
span of the terms M_j [V, I_F] and K_j V on the elastic rows; with A a basis of that span, K0 = L Lᵀ
and L⁻¹A = Q R by orthogonal triangularisation, its norm ‖ρ‖ in K0⁻¹ is the length of
Σ_j θ_j (R B_j) c: small arrays only. Terms of the residual are large where one link is carried by
another and cancel in the sum; a Gram matrix AᵀK0⁻¹A would keep half the digits of that only.

From a norm in K0⁻¹ to the norm in K_E(q, y0)⁻¹: what turning the joints does to it.

Only rows and columns J at the joints depend on q: K_E(q, y0) = K0 + E_J Δ(q) E_Jᵀ. With
G = E_JᵀK0⁻¹E_J and g = E_JᵀK0⁻¹ρ, small arrays all, the Sherman-Morrison-Woodbury identity gives

    ρᵀ K_E(q, y0)⁻¹ ρ = ρᵀ K0⁻¹ ρ − gᵀ (I + Δ G)⁻¹ Δ g .
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import solve_triangular
from scipy.sparse import linalg

from eigassign.errors import AccuracyError, SingularityError
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.modal.exact.roundoff import rounding_weights
from eigassign.modal.exact.sparse import factorise
from eigassign.modal.reduced.ritz import INDEFINITE, ritz_pairs
from eigassign.modal.taylor.rayleigh import project

if TYPE_CHECKING:
    from eigassign.modal.reduced.basis import RitzBasis
    from eigassign.modal.reduced.model import ReducedModel


# --- The reduced model's own error at samples, from its residual in the whole pencil: no exact

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


# --- What a reduced model's error estimate needs besides it: built when first asked for


@dataclass(frozen=True, eq=False)
class ErrorTerms:
    """Small arrays only: neither mesh nor mechanism is needed online. Immutable."""

    residual: Residual
    pose: Pose
    material_terms: Ints  # indices of θ with a stiffness term that no joint coordinate enters
    material: Floats  # their values at the first expansion point
    anchors: Floats  # (n_points, c + 1): the largest μ at each point, one more than are represented
    shapes: Floats  # (n_points, k, c): those c modes in the basis
    stiffness_rounding: Floats  # Vᵀ d_K V (k, k), round-off weights of `roundoff` at x0
    mass_rounding: Floats  # (k + f, k + f)


def error_terms(basis: RitzBasis) -> ErrorTerms:
    """All of it, from one factorisation of K0."""
    pencil, wide, k = basis.pencil, basis.wide, basis.V.shape[1]
    factor = factorise(basis.K0)
    theta0 = basis.theta0[:, 0]
    d_K, d_M = rounding_weights(pencil, theta0)
    material = _material_terms(pencil, theta0)
    return ErrorTerms(
        residual=residual_factors(pencil, basis.K0, factor, wide),
        pose=pose(pencil, joint_rows(pencil, factor), basis.theta_mean, wide),
        material_terms=material,
        material=theta0[material],
        anchors=_anchors(basis.lam, basis.represented.shape[2]),
        shapes=basis.shapes,
        stiffness_rounding=(wide[:, :k].T * d_K) @ wide[:, :k],
        mass_rounding=(wide.T * d_M) @ wide,
    )


def _anchors(lam: Floats, count: int) -> Floats:
    """μ of the represented modes and of the next one; 0 where there is none."""
    following = 1.0 / lam[:, count : count + 1] if lam.shape[1] > count else np.zeros((len(lam), 1))
    return np.hstack([1.0 / lam[:, :count], following])


def _material_terms(pencil: Pencil, theta0: Floats) -> Ints:
    """Indices of θ with a stiffness term that design parameters scale and no joint enters."""
    jointless = ~np.asarray(pencil.program.dependence[:, : pencil.n_q].any(axis=1))
    stiff = np.flatnonzero(np.diff(pencil.by_term[0].indptr))
    scaled = [t for t in stiff.tolist() if t and jointless[t - 1] and theta0[t]]
    return np.array(scaled, dtype=np.intp)


# --- From residuals of Ritz pairs to an estimate of the relative error in frequency

SAFETY = 4.0  # on ‖ρ‖²: its norm is taken at an expansion point, not at x
LOST = 0.2  # residual relative to μ̂ above which a pair stands for no mode
MARGIN = 2.0  # how far μ of a mode may have moved since the expansion point, as a factor
RANGE = 4.0  # how far μ of a mode that is no longer represented may have moved, as a factor
HELD = 0.5  # share of a shape's mass in the Ritz pairs below which its mode has left the basis
REFUSED = 0.5  # relative error in frequency above which an answer is refused


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
    hidden = (mu <= outside[:, None]) | _missing(mu, norms, anchors)
    return np.where(hidden | ~(error < REFUSED), np.inf, error)


def _missing(mu: Floats, norms: Floats, anchors: Floats) -> NDArray[np.bool_]:
    """Where a mode that was there at an expansion point has left the basis, (n, c).

    Pairs with a large residual stand for no mode. Where there are any, every mode that lay below
    the pair in question at an expansion point, by a margin or less, must be among the others.
    """
    sure = norms < LOST * mu
    found = (sure[:, None, :] & (mu[:, None, :] * MARGIN >= mu[:, :, None])).sum(axis=2)
    there = (anchors[:, None, None, :] * MARGIN >= mu[:, :, None]).sum(axis=3).max(axis=0)
    some_lost = np.any(~sure, axis=1, keepdims=True)
    return np.asarray(some_lost & (there > found))


def gone(mu: Floats, gram: Floats, shares: Floats, anchors: Floats) -> NDArray[np.bool_]:
    """Pairs (n, c) beside or below which a mode of every expansion point is missing.

    μ̂ (n, k) and ``shares`` (n_points, n, c, k) of all Ritz pairs in the mass of each shape of a
    point. A shape with less than half of it in pairs that may stand for a mode has changed or left:
    it has left where there are also fewer pairs within RANGE than there were modes. Beyond the
    first c the residuals are not known: such a pair may stand for a shape only within RANGE.
    """
    c = gram.shape[1]
    sure = np.ones(mu.shape, dtype=bool)
    sure[:, :c] = np.sqrt(SAFETY * np.einsum("nii->ni", gram)) < LOST * mu[:, :c]
    was = anchors[:, None, :-1, None]
    reach = np.where(np.arange(mu.shape[1]) < c, RANGE**2, RANGE)
    like = sure[None, :, None, :] & ((mu * reach)[None, :, None, :] >= was)
    weak = (shares * like).sum(axis=3) < HELD
    pair = mu[:, :c]
    within = was * RANGE >= pair[None, :, None, :]
    found = (sure[:, None, :] & (mu[:, None, :] * RANGE >= pair[:, :, None])).sum(axis=2)
    fewer = within.sum(axis=2) > found
    return np.asarray((fewer & (weak[..., None] & within).any(axis=2)).all(axis=0))


def _shifts(mu: Floats, gram: Floats, outside: Floats, kept: int) -> Floats:
    """ε_i (n, kept) with the pairs from ``kept`` on counted among the unrepresented modes."""
    norms = np.sqrt(np.einsum("nii->ni", gram[:, kept:, kept:]))
    beyond = np.max(mu[:, kept:] + norms, axis=1, initial=0.0)
    gap = mu[:, :kept] - np.maximum(beyond, outside)[:, None]
    mu, gram = mu[:, :kept], gram[:, :kept, :kept]
    with np.errstate(divide="ignore", invalid="ignore"):
        C = np.where(gap[:, :, None] > 0.0, np.abs(gram) / gap[:, :, None], np.inf)
        mixed = np.fmin(C, C**2 / np.abs(mu[:, :, None] - mu[:, None, :]))
    diagonal = np.einsum("nii->ni", C)
    mixed[:, np.arange(kept), np.arange(kept)] = 0.0
    return np.asarray(diagonal + mixed.sum(axis=2))


# --- The size of an eigen-residual of the reduced model, without a vector of full length online

Coordinates = tuple[Ints, Floats]  # which columns of A (c,), and how much of them (c, k)
UNIT_LIMIT = 300  # elastic dofs up to which A is the identity


@dataclass(frozen=True, eq=False)
class Residual:
    """R B_j for the terms that are not zero: stiffness on V, mass on [V, I_F]."""

    stiffness_terms: Ints  # indices of θ
    stiffness: Floats  # (n_terms, a, k)
    mass_terms: Ints
    mass: Floats  # (n_terms, a, k + f)


@dataclass(frozen=True)
class _Block:
    """One term times the basis: nothing but its non-zero rows (elastic numbering)."""

    theta: int
    rows: Ints
    values: Floats


def residual_factors(
    pencil: Pencil, K0: sparse.csc_array, factor: linalg.SuperLU, wide: Floats
) -> Residual:
    """Offline part for [V 0; 0 I_F] ``wide`` (n_dof, k + f); ``factor`` is that of K0.

    Raises AccuracyError where K0 is not positive definite.
    """
    n, k = len(pencil.elastic), wide.shape[1] - len(pencil.rigid)
    stiff = _blocks(pencil, pencil.by_term[0], np.ascontiguousarray(wide[:, :k]))
    heavy = _blocks(pencil, pencil.by_term[1], wide)
    if n <= UNIT_LIMIT:
        L = _root_of(K0.toarray())
        return Residual(_terms(stiff), _dense(stiff, L), _terms(heavy), _dense(heavy, L))
    A, coordinates = _span(stiff + heavy, n)
    R = np.asarray(np.linalg.qr(half_solve(factor, A), mode="r"), dtype=np.float64)
    parts = [R[:, at] @ values for at, values in coordinates]
    split = len(stiff)
    return Residual(_terms(stiff), np.array(parts[:split]), _terms(heavy), np.array(parts[split:]))


def half_solve(factor: linalg.SuperLU, A: Floats) -> Floats:
    """L⁻¹ P A with P K0 Pᵀ = L Lᵀ; raises AccuracyError where K0 is not positive definite."""
    pivots = factor.U.diagonal()
    if (factor.perm_r != factor.perm_c).any() or not (pivots > 0.0).all():
        raise AccuracyError(INDEFINITE)
    permuted = np.empty_like(A)
    permuted[factor.perm_r] = A
    lower = factor.L.tocsr()
    solved = linalg.spsolve_triangular(lower, permuted, lower=True, unit_diagonal=True)
    return np.asarray(solved / np.sqrt(pivots)[:, None])


def _blocks(pencil: Pencil, columns: sparse.csc_array, basis: Floats) -> list[_Block]:
    """Every term of one matrix applied to ``basis``, elastic rows only."""
    position = np.full(pencil.n_dof, -1, dtype=np.intp)
    position[pencil.elastic] = np.arange(len(pencil.elastic))
    blocks = []
    for theta in range(columns.shape[1]):
        at = slice(columns.indptr[theta], columns.indptr[theta + 1])
        entries, data = columns.indices[at], columns.data[at]
        place = position[pencil.rows[entries]]
        keep = place >= 0
        rows, slot = np.unique(place[keep], return_inverse=True)
        if len(rows):
            shape = (len(rows), pencil.n_dof)
            term = sparse.csr_array(
                (data[keep], (slot, pencil.columns[entries[keep]])), shape=shape
            )
            blocks.append(_Block(theta, rows.astype(np.intp), np.asarray(term @ basis)))
    return blocks


def _terms(blocks: list[_Block]) -> Ints:
    return np.array([b.theta for b in blocks], dtype=np.intp)


def _dense(blocks: list[_Block], L: Floats) -> Floats:
    """L⁻¹ times every block, A being the identity."""
    n = len(L)
    full = np.zeros((n, len(blocks), blocks[0].values.shape[1]))
    for k, block in enumerate(blocks):
        full[block.rows, k] = block.values
    solved = solve_triangular(L, full.reshape(n, -1), lower=True, check_finite=False)
    return np.ascontiguousarray(solved.reshape(full.shape).transpose(1, 0, 2))


def _span(blocks: list[_Block], n: int) -> tuple[Floats, list[Coordinates]]:
    """A (n, a) spanning all blocks, and each block's coordinates in it.

    Terms with few rows (joints) share unit vectors; the others bring their own column space.
    """
    narrow = [len(b.rows) <= b.values.shape[1] for b in blocks]
    shared = np.zeros(n, dtype=bool)
    for block, is_narrow in zip(blocks, narrow, strict=True):
        if is_narrow:
            shared[block.rows] = True
    units = np.flatnonzero(shared)
    wide: list[tuple[Ints, Floats]] = []
    where: dict[bytes, int] = {}
    coordinates: list[Coordinates] = [
        (np.searchsorted(units, block.rows), block.values)
        if is_narrow
        else _columns(block, wide, where, len(units))
        for block, is_narrow in zip(blocks, narrow, strict=True)
    ]
    A = np.zeros((n, len(units) + len(wide)))
    A[units, np.arange(len(units))] = 1.0
    for k, (rows, column) in enumerate(wide):
        A[rows, len(units) + k] = column
    return A, coordinates


def _columns(
    block: _Block, wide: list[tuple[Ints, Floats]], where: dict[bytes, int], offset: int
) -> Coordinates:
    """Orthonormal columns of a block, equal ones of other blocks used again."""
    U, s, Vt = np.linalg.svd(block.values, full_matrices=False)
    rank = int((s > 1e-13 * s[0]).sum()) if s[0] > 0.0 else 0
    U, values = U[:, :rank], s[:rank, None] * Vt[:rank]
    signs = np.where(U[np.abs(U).argmax(axis=0), np.arange(rank)] < 0.0, -1.0, 1.0)
    columns, place = np.ascontiguousarray((signs * U).T), block.rows.tobytes()
    at = []
    for column, rounded in zip(columns, np.round(columns, 9), strict=True):
        key = rounded.tobytes() + place
        if key not in where:
            where[key] = len(wide)
            wide.append((block.rows, column))
        at.append(offset + where[key])
    return np.array(at, dtype=np.intp), signs[:, None] * values


def _root_of(K: Floats) -> Floats:
    try:
        return np.asarray(np.linalg.cholesky(K), dtype=np.float64)
    except np.linalg.LinAlgError as error:
        raise AccuracyError(INDEFINITE) from error


# --- From a norm in K0⁻¹ to the norm in K_E(q, y0)⁻¹: what turning the joints does to it

MOST = 200  # rows at joints up to which the correction is made
FLOOR = 1e-6  # part of ρᵀK0⁻¹ρ that is kept whatever the correction says: its own round-off


@dataclass(frozen=True, eq=False)
class Pose:
    """Δ(q) = Σ_t (θ_t(q, y0) − θ⁰_t) K_t on J, K0 = Σ_t θ⁰_t K_t, and K0⁻¹ on J.

    ``…_rows`` are the rows J of K0⁻¹ times every term of the residual.
    """

    terms: Ints  # indices of θ with a stiffness term that a joint coordinate enters
    theta0: Floats  # their values θ⁰ in K0
    stiffness: Floats  # (n_terms, j, j)
    flexibility: Floats  # G (j, j)
    stiffness_rows: Floats  # E_Jᵀ K0⁻¹ K_t V, (n_stiffness_terms, j, k)
    mass_rows: Floats  # E_Jᵀ K0⁻¹ M_t [V, I_F], (n_mass_terms, j, k + f)


@dataclass(frozen=True, eq=False)
class JointRows:
    """J among the elastic dofs, and K0⁻¹ E_J (n_dof, j)."""

    dofs: Ints
    terms: Ints
    responses: Floats


def joint_rows(pencil: Pencil, factor: linalg.SuperLU) -> JointRows:
    """The rows where K_E depends on q; none where they are too many to be worth it.

    ``factor`` is that of K0.
    """
    of_joints = np.flatnonzero(pencil.program.dependence[:, : pencil.n_q].any(axis=1)) + 1
    columns = pencil.by_term[0]
    terms = np.array([t for t in of_joints if columns.indptr[t + 1] > columns.indptr[t]], np.intp)
    entries = np.unique(columns[:, terms].tocoo().coords[0]) if len(terms) else terms
    touched = np.union1d(pencil.rows[entries], pencil.columns[entries])
    dofs = np.searchsorted(pencil.elastic, touched).astype(np.intp)
    if len(dofs) > MOST:
        dofs, terms = dofs[:0], terms[:0]
    units = np.zeros((len(pencil.elastic), len(dofs)))
    units[dofs, np.arange(len(dofs))] = 1.0
    responses = np.zeros((pencil.n_dof, len(dofs)))
    if len(dofs):
        responses[pencil.elastic] = factor.solve(units)
    return JointRows(dofs, terms, responses)


def pose(pencil: Pencil, at: JointRows, theta0: Floats, wide: Floats) -> Pose:
    """Everything the correction needs online.

    ``theta0`` (n_theta,) are those of K0, ``wide`` is [V 0; 0 I_F] (n_dof, k + f).
    """
    dofs, k = pencil.elastic[at.dofs], wide.shape[1] - len(pencil.rigid)
    stiffness, mass = project(pencil, wide, at.responses)
    k_terms, m_terms = (np.flatnonzero(np.diff(w.indptr)) for w in pencil.by_term)
    return Pose(
        terms=at.terms,
        theta0=theta0[at.terms],
        stiffness=_joint_blocks(pencil, at.terms, dofs),
        flexibility=at.responses[dofs],
        stiffness_rows=stiffness[k_terms, :, :k],
        mass_rows=mass[m_terms],
    )


def _joint_blocks(pencil: Pencil, terms: Ints, dofs: Ints) -> Floats:
    """The stiffness terms on rows and columns ``dofs``, (n_terms, j, j)."""
    blocks = np.zeros((len(terms), len(dofs), len(dofs)))
    position = np.full(pencil.n_dof, -1, dtype=np.intp)
    position[dofs] = np.arange(len(dofs))
    columns = pencil.by_term[0]
    for block, term in zip(blocks, terms, strict=True):
        part = slice(columns.indptr[term], columns.indptr[term + 1])
        entries = columns.indices[part]
        rows, cols = position[pencil.rows[entries]], position[pencil.columns[entries]]
        block[rows, cols] = columns.data[part]
    return blocks


def corrected(gram: Floats, here: Pose, theta: Floats, g: Floats) -> Floats:
    """ρ_iᵀ K_E(q, y0)⁻¹ ρ_j (n, c, c) from the same in K0⁻¹, θ at (q, y0) and g (n, j, c)."""
    if not len(here.terms):
        return gram
    change = theta[here.terms] - here.theta0[:, None]
    delta = np.tensordot(change.T, here.stiffness, axes=1)
    eye = np.eye(delta.shape[1])
    less = np.swapaxes(g, 1, 2) @ np.linalg.solve(eye + delta @ here.flexibility, delta @ g)
    kept = gram - 0.5 * (less + np.swapaxes(less, 1, 2))
    diagonal = np.arange(gram.shape[1])
    least = FLOOR * gram[:, diagonal, diagonal]
    kept[:, diagonal, diagonal] = np.maximum(kept[:, diagonal, diagonal], least)
    return np.asarray(kept)
