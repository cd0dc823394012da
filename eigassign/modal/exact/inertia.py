"""Counts and signs by pivots alone: modes below a frequency; poses that fall or buckle.

The number of negative pivots of a symmetric A = L D Lᵀ is that of its negative eigenvalues. With E
the elastic unknowns and F the free coordinates, K = diag(K_E, 0) exactly, so that for σ > 0 the
Schur complement of −σ M_FF in A = K − σ M is K_E − σ M_c, and inertias add:

    n₋(K − σ M) = n₋(−σ M_FF) + n₋(K_E − σ M_c) = n_rigid + number of elastic modes with λ < σ .

Neither M_c nor an eigenvalue is needed. Where Mz = 0 for some z, A is K there and positive, so that
unknowns without mass are never counted.

A is scaled to S A S with s_i = (K_ii + σ Σ_j |θ_j (M_j)_ii|)^{−1/2}: units do not mix, and no entry
exceeds one. A factor computed in floating point is that of S A S + δ, |δ| ≲ c ε |L| |D| |L|ᵀ. Its
count is right where δ cannot carry the eigenvalue nearest to zero (vector v, |v| = 1) across,

    |v|ᵀ |δ| |v| ‖(S A S)⁻¹‖ < 1 ,

which is looked at every time; small models take c n ε for the left factor. A count that is not
certain is not given. That is where a frequency is as near to σ as the round-off that the matrices
themselves hold (see `solver`).

Of coordinates S that nothing but the weight holds, K_g,SS tells whether they hang or stand. With H
all other elastic unknowns and

    G = K_g,HH − K_g,HS K_g,SS⁻¹ K_g,SH ,    −G z = μ K_0,HH z ,

K_0 + κ K_g is singular first at κ = 1/μ of the largest μ: where κ < 1, so much of the weight
buckles the mechanism.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike
from scipy import sparse
from scipy.linalg import eigh, lapack
from scipy.sparse import linalg

from eigassign.arrays import Floats, Ints
from eigassign.case.units import shown_point
from eigassign.errors import LIMP, MechanismError, UsageError
from eigassign.mechanism.assembly.pencil import Pencil, principal
from eigassign.mechanism.elements.craig_bampton import (
    definite_factor,
    factorise,
    has_positive_pivots,
)
from eigassign.modal.arguments import chunks
from eigassign.modal.exact.dense import NO_MASS

UNCERTAIN = -1  # in place of a count that round-off might change
BAND = 1e-7  # relative in hz: where the pivots grow, the count is taken this far to either side
ROUND_OFF = 10.0 * float(np.finfo(np.float64).eps)  # c ε; see tests/modal/exact/test_inertia.py
INVERSE_STEPS = 6  # of the power method for v: the nearest eigenvalue matters where it is alone


def count_below(pencil: Pencil, x: Floats, hz: ArrayLike) -> Ints:
    """Number of elastic modes strictly below ``hz`` at x (n_samples, n_x), without their modes.

    ``hz`` > 0 is one frequency, one for each sample (n_samples,), or several for each (n_samples
    or 1, k); the answer is (n_samples,) or (n_samples, k). It is UNCERTAIN (−1) where a frequency
    of the model is so near that round-off decides. A mode of no stiffness counts as below.
    Raises UsageError for frequencies that are not positive, MechanismError where M_FF is singular.
    """
    x = np.atleast_2d(x)
    edges = np.asarray(hz, dtype=np.float64)
    if edges.ndim > 2 or not (np.isfinite(edges) & (edges > 0.0)).all():
        raise UsageError("frequencies to count below must be positive numbers, (n_samples, k)")
    table = np.broadcast_to(
        edges if edges.ndim == 2 else edges.reshape(-1, 1),
        (len(x), edges.shape[1] if edges.ndim == 2 else 1),
    )
    theta = pencil.theta(x)
    if not np.isfinite(theta).all():
        raise UsageError("q or y is not finite, or outside the domain of a section or length")
    counts = _counted(pencil, theta, table)
    for k, j in np.argwhere(counts == UNCERTAIN):
        near = table[k, j] * np.array([[1.0 - BAND, 1.0 + BAND]])
        low, high = _counted(pencil, theta[:, [k]], near)[0]
        counts[k, j] = low if low == high else UNCERTAIN
    return counts if edges.ndim == 2 else counts[:, 0]


def _counted(pencil: Pencil, theta: Floats, hz: Floats) -> Ints:
    """The counts (n_samples, k) below hz (n_samples, k) at θ (n_theta, n_samples)."""
    sigma = (2.0 * np.pi * hz) ** 2
    if not pencil.is_dense:
        return np.array(
            [[_sparse(pencil, t, s) for s in row] for t, row in zip(theta.T, sigma, strict=True)],
            dtype=np.intp,
        ).reshape(hz.shape)
    counts = np.empty(hz.shape, dtype=np.intp)
    for part in chunks(np.arange(len(hz)), pencil.n_dof**2):
        counts[part] = _dense(pencil, theta[:, part], sigma[part])
    return counts


def _dense(pencil: Pencil, theta: Floats, sigma: Floats) -> Ints:
    """Counts (n, k) by Bunch-Kaufman factors, of K − σM with all unknowns in it."""
    K, M = pencil.matrices(theta)
    heavy = pencil.mass_magnitude @ np.abs(theta)
    counts = np.empty(sigma.shape, dtype=np.intp)
    for k, row in enumerate(sigma):
        _require_mass(M[k][np.ix_(pencil.rigid, pencil.rigid)])
        for j, s in enumerate(row):
            scale = _scale(np.diagonal(K[k]), s * heavy[:, k])
            A = scale[:, None] * (K[k] - s * M[k]) * scale
            factor, pivots, _ = lapack.dsytrf(A.T, lower=1, overwrite_a=1)
            # info > 0 says that a pivot is zero: then the inverse is not bounded
            closeness = lapack.dsycon(factor, pivots, 1.0, lower=1)[0]
            negative = (np.diagonal(factor)[pivots > 0] < 0.0).sum() + (pivots < 0).sum() // 2
            certain = closeness > ROUND_OFF * len(A)
            counts[k, j] = negative - len(pencil.rigid) if certain else UNCERTAIN
    return counts


def _sparse(pencil: Pencil, theta: Floats, sigma: float) -> int:
    """The count of one sample by a sparse factor whose pivots stay on the diagonal."""
    K, M = pencil.stiffness @ theta, pencil.mass @ theta
    on = pencil.rows == pencil.columns
    stiff = np.zeros(pencil.n_dof)
    stiff[pencil.rows[on]] = K[on]
    scale = _scale(stiff, sigma * (pencil.mass_magnitude @ np.abs(theta)))
    F = principal(pencil, M, pencil.rigid).toarray()
    _require_mass(F)
    data = (K - sigma * M) * scale[pencil.rows] * scale[pencil.columns]
    negative = negative_pivots(principal(pencil, data, np.arange(pencil.n_dof)))
    return negative if negative == UNCERTAIN else negative - len(pencil.rigid)


def negative_pivots(A: sparse.csc_array) -> int:
    """Number of negative eigenvalues of a symmetric A with entries of order one, or UNCERTAIN."""
    try:
        factor = factorise(A)
    except RuntimeError:  # a pivot is exactly zero
        return UNCERTAIN
    pivots = np.asarray(factor.U.diagonal())
    if (factor.perm_r != factor.perm_c).any():
        return UNCERTAIN  # pivots off the diagonal say nothing of inertia
    v = np.random.default_rng(0).standard_normal(len(pivots))
    for _ in range(INVERSE_STEPS):
        v = factor.solve(v / np.linalg.norm(v))
    inverse = np.linalg.norm(v)
    permuted = np.empty_like(v)
    permuted[factor.perm_r] = np.abs(v) / inverse
    size = float(np.square(abs(factor.L).T @ permuted) @ np.abs(pivots))
    if not ROUND_OFF * size * inverse < 1.0:
        return UNCERTAIN
    return int((pivots < 0.0).sum())


def _scale(stiff: Floats, heavy: Floats) -> Floats:
    """S's diagonal (n_dof,); an unknown of neither stiffness nor mass leaves A singular."""
    size = np.abs(stiff) + heavy
    return np.asarray(1.0 / np.sqrt(np.where(size > 0.0, size, 1.0)))


def _require_mass(M_FF: Floats) -> None:
    if len(M_FF) and lapack.dpotrf(M_FF, lower=1)[1]:
        raise MechanismError("mechanism", NO_MASS)


Label = Callable[[int], str]
# Of the largest K_g of a coordinate, and of g M_ii per metre: less is round-off, a thousand times
ZERO = 1e-12
FALLS = "give it a drive stiffness, lock it, or write `gravity: none`"


def require_standing(
    pencil: Pencil, theta: Floats, x: Floats | None = None, label: Label = "sample {}".format
) -> None:
    """Raise MechanismError for the first sample that falls or buckles: θ (n_theta, n).

    ``x`` (n, n_x) names the pose, ``label`` sample k. Without gravity nothing does.
    """
    if pencil.weight is None:
        return
    require_hanging(pencil, theta, x, label)
    for k in range(theta.shape[1]):
        if not _is_definite(pencil, theta[:, k]):
            share, message = buckling_share(pencil, theta[:, k]), LIMP
            if share > 1.0:
                message = (
                    f"buckles under {1.0 / share:.3g} times its weight "
                    f"{_pose(pencil, x, k, label)}: make what carries the load stiffer or the load "
                    "lighter, or write `gravity: none`"
                )
            raise MechanismError("mechanism", message)


def require_hanging(
    pencil: Pencil, theta: Floats, x: Floats | None = None, label: Label = "sample {}".format
) -> None:
    """Raise MechanismError for the first sample where a coordinate falls that the weight holds."""
    weight = pencil.weight
    if weight is None or not len(weight.swinging):
        return
    n, s = len(weight.joints), weight.swinging
    K = (weight.among_joints @ theta).T.reshape(-1, n, n)
    M = (pencil.mass_magnitude[weight.joints[s]] @ np.abs(theta)).T
    scale = 1.0 / np.sqrt(np.where(M > 0.0, M, 1.0))
    lam, modes = np.linalg.eigh(K[:, s][:, :, s] * scale[:, :, None] * scale[:, None, :])
    least = ZERO * (np.abs(K).max(axis=(1, 2))[:, None] + weight.gravity * M) * scale**2
    noise = (modes[:, :, 0] ** 2 * least).sum(axis=1)
    fallen = lam[:, 0] <= noise
    if fallen.any():
        k = int(fallen.argmax())
        name = weight.names[s[int(np.abs(modes[k, :, 0]).argmax())]]
        what = "would fall" if lam[k, 0] < -noise[k] else "is held by nothing, the weight included,"
        message = f"{what} {_pose(pencil, x, k, label)}: {FALLS}"
        raise MechanismError(f"coordinates.{name}", message)


def _pose(pencil: Pencil, x: Floats | None, k: int, label: Label) -> str:
    """Where a sample is, in words."""
    if x is None or pencil.weight is None:
        return f"({label(k)})"
    n, names, units = pencil.n_joints, pencil.weight.variables, pencil.weight.units
    pose, more = (
        shown_point(names[own], x[k, own], units[own]) for own in (slice(n), slice(n, None))
    )
    return f"in the pose {pose}{f' with {more}' * (x.shape[1] > n)} ({label(k)})"


def _is_definite(pencil: Pencil, theta: Floats) -> bool:
    E = pencil.elastic
    if pencil.is_dense:
        K = pencil.stiffness_matrices(theta[:, None])[0]
        return not lapack.dpotrf(K[np.ix_(E, E)], lower=1)[1]
    try:
        return has_positive_pivots(factorise(principal(pencil, pencil.stiffness @ theta, E)))
    except RuntimeError:  # a pivot is exactly zero
        return False


def buckling_share(pencil: Pencil, theta: Floats) -> float:
    """μ = 1/κ at θ (n_theta,): the weight over that which buckles; 0 where none does.

    NaN where K_0,HH is not positive definite.
    """
    weight = pencil.weight
    if weight is None:
        return 0.0
    S = weight.joints[weight.swinging]
    H = np.setdiff1d(pencil.elastic, S)
    data = weight.stiffness @ theta
    K_0 = principal(pencil, pencil.stiffness @ theta - data, H)
    K_g = principal(pencil, data, np.union1d(H, S)).tocsr()
    inner, outer = (np.isin(np.union1d(H, S), each) for each in (H, S))
    G, across = K_g[inner][:, inner], K_g[inner][:, outer].toarray()
    drawn = np.linalg.solve(K_g[outer][:, outer].toarray(), across.T)
    if len(H) <= pencil.dense_limit:
        try:
            mu = eigh(across @ drawn - G.toarray(), K_0.toarray(), eigvals_only=True)
        except np.linalg.LinAlgError:
            return np.nan
        return max(float(mu[-1]), 0.0) if len(mu) else 0.0
    factor = definite_factor(K_0)
    if factor is None:
        return np.nan
    n = len(H)
    operator = linalg.LinearOperator((n, n), matvec=lambda v: across @ (drawn @ v) - G @ v)
    inverse = linalg.LinearOperator((n, n), matvec=factor.solve)
    start = np.random.default_rng(0).standard_normal(n)
    mu = linalg.eigsh(operator, 1, M=K_0, Minv=inverse, which="LA", v0=start)[0]
    return max(float(mu[0]), 0.0)
