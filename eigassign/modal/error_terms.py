"""What a reduced model's error estimate needs besides it: built when first asked for."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from eigassign.mechanism.pencil import Pencil
from eigassign.modal.pose import Pose, joint_rows, pose
from eigassign.modal.residual import Residual, residual_factors
from eigassign.modal.roundoff import rounding_weights
from eigassign.modal.symmetric import factorise

if TYPE_CHECKING:
    from eigassign.modal.ritz_basis import RitzBasis

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]


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
