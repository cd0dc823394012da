"""Exact elastic modes and statics of large pencils, one sample after the other.

The inverse form M z = μ K z, μ = 1/λ, by Lanczos' method with K factored; many samples of a large
mechanism are for links that are reduced (`reduce_to`).
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import linalg

from eigassign.arrays import Floats
from eigassign.errors import LIMP, AccuracyError, MechanismError, MissingMassError
from eigassign.mechanism.assembly.pencil import Pencil, block, principal
from eigassign.mechanism.elements.craig_bampton import (
    definite_factor,
    factorise,
    has_positive_pivots,
    largest_modes,
)
from eigassign.modal.exact.dense import (
    Modes,
    mass_sizes,
    may_be_roundoff,
    modes_with_mass,
    positive_at_top,
    rigid_coupling,
)

FINE = (
    "the exact modes were not found: so fine a mesh, or stiffnesses so far apart, leave only "
    "round-off. Give the links fewer elements"
)
DENSE_MOST = 4000  # elastic unknowns up to which dense algebra settles what may be round-off


def solve_large(pencil: Pencil, theta: Floats, count: int, vectors: bool) -> Modes:
    """Modes at θ (n_theta, n_samples), one sample after the other."""
    solved = [_one(pencil, theta[:, k], count) for k in range(theta.shape[1])]
    lam = np.array([s[0] for s in solved])
    phi = np.array([s[1] for s in solved]) if vectors else np.zeros((len(lam), 0, count))
    return Modes(lam, phi)


def _one(pencil: Pencil, theta: Floats, count: int) -> tuple[Floats, Floats]:
    E, F = pencil.elastic, pencil.rigid
    K_E = principal(pencil, pencil.stiffness @ theta, E)
    mass = pencil.mass @ theta
    M_EE, M_F = principal(pencil, mass, E), block(pencil, mass, F)
    M_FE = M_F[:, E]
    coupling = rigid_coupling(M_F[:, F], M_FE)
    try:
        factor = factorise(K_E)
    except RuntimeError as error:
        raise MechanismError("mechanism", LIMP) from error
    if pencil.weight is not None and not has_positive_pivots(factor):
        raise MechanismError("mechanism", LIMP)
    M_rows = M_EE.T  # symmetric: products run faster row by row

    def mass_product(v: Floats) -> Floats:
        return np.asarray(M_rows @ v - (coupling @ v) @ M_FE)

    try:
        mu, z = largest_modes(factor, K_E.T, mass_product, count)
    except linalg.ArpackError as error:
        if len(E) > DENSE_MOST:
            raise AccuracyError(FINE) from error
        # Few directions have mass: ARPACK before SciPy 1.16 cannot build a larger Krylov space.
        mu, z = np.zeros(count), np.zeros((len(E), count))  # none is sure: dense algebra decides
    noise = mass_sizes(pencil, theta[:, None], coupling[None])[0] @ (z * z)
    sure = ~may_be_roundoff(mu, noise, len(E), margin=1.0)  # dense algebra is dear here
    if sure.all():
        lam, phi = 1.0 / mu, np.empty((pencil.n_dof, count))
        phi[E] = z / np.sqrt(mu)
        phi[F] = -coupling @ phi[E]
    elif len(E) <= DENSE_MOST:
        lam, phi = modes_with_mass(pencil, theta[:, None], count)
    else:
        raise MissingMassError(int(sure.argmin()))
    return lam, positive_at_top(phi)


def solve_large_statics(pencil: Pencil, theta: Floats, f: Floats) -> Floats:
    """u (n, n_dof, r) with K_E u_E = f_E at θ (n_theta, n) for f (n, n_dof, r), 0 where free.

    Raises MechanismError where K_E is not definite.
    """
    u, E = np.zeros(f.shape), pencil.elastic
    for k, data in enumerate((pencil.stiffness @ theta).T):
        factor = definite_factor(principal(pencil, data, E))
        if factor is None:
            raise MechanismError("mechanism", LIMP)
        u[k, E] = factor.solve(np.ascontiguousarray(f[k, E]))
    return u
