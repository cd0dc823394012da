"""Where K_0 + K_g is not positive definite: poses that fall under the weight, and buckling.

Of coordinates S that nothing but the weight holds, K_g,SS tells whether they hang or stand. With H
all other elastic unknowns and

    G = K_g,HH − K_g,HS K_g,SS⁻¹ K_g,SH ,    −G z = μ K_0,HH z ,

K_0 + κ K_g is singular first at κ = 1/μ of the largest μ: where κ < 1, so much of the weight
buckles the mechanism.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh, lapack
from scipy.sparse import linalg

from eigassign.errors import LIMP, MechanismError
from eigassign.mechanism.assembly.pencil import Pencil, principal
from eigassign.mechanism.elements.craig_bampton import (
    definite_factor,
    factorise,
    has_positive_pivots,
)

Floats = NDArray[np.float64]
Label = Callable[[int], str]
# Of the largest K_g of a coordinate, and of g M_ii per metre: less is round-off, a thousand times
ZERO = 1e-12
SHOWN = 8  # values of a pose or design that a message names
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
            raise MechanismError(
                "mechanism", _buckled(pencil, theta[:, k], _pose(pencil, x, k, label))
            )


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
    n, named = pencil.n_joints, zip(pencil.weight.variables, x[k], strict=True)
    each = [f"{name} = {value:.6g}" for name, value in named]
    pose, more = (", ".join(own[:SHOWN]) for own in (each[:n], each[n:]))
    return f"in the pose {pose}{f' with {more}' if more else ''} ({label(k)})"


def _is_definite(pencil: Pencil, theta: Floats) -> bool:
    E = pencil.elastic
    if pencil.is_dense:
        K = pencil.stiffness_matrices(theta[:, None])[0]
        return not lapack.dpotrf(K[np.ix_(E, E)], lower=1)[1]
    try:
        return has_positive_pivots(factorise(principal(pencil, pencil.stiffness @ theta, E)))
    except RuntimeError:  # a pivot is exactly zero
        return False


def _buckled(pencil: Pencil, theta: Floats, where: str) -> str:
    """What a design and pose says whose K is not definite though nothing falls."""
    share = buckling_share(pencil, theta)
    if not share > 1.0:
        return LIMP
    return (
        f"buckles under {1.0 / share:.3g} times its weight {where}: make what carries the load "
        "stiffer or the load lighter, or write `gravity: none`"
    )


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
