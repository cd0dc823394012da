"""Exact elastic modes of the affine pencil, the rigid-body modes projected out exactly.

With E the elastic unknowns (u and held coordinates) and F the free coordinates, K = diag(K_E, 0):

    K_E φ_E = λ M_c φ_E,   M_c = M_EE − M_EF M_FF⁻¹ M_FE,   φ_F = −M_FF⁻¹ M_FE φ_E

solved in the inverse form M_c z = μ K_E z, μ = 1/λ, so that massless unknowns (μ = 0) are harmless.
What may be round-off instead of a mode with mass is settled by `massless`, for all solvers alike.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import MechanismError, MissingMassError, UsageError
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.modal.arguments import whole
from eigassign.modal.exact.dense import Modes, solve_dense
from eigassign.modal.exact.inertia import require_hanging, require_standing
from eigassign.modal.exact.large import solve_large

Floats = NDArray[np.float64]


def eigenvalues(pencil: Pencil, x: Floats, count: int) -> Floats:
    """λ (n_samples, count) of the lowest elastic modes at x (n_samples, n_x), in rad²/s².

    Raises UsageError for more modes than there are, MissingMassError for more than have mass,
    MechanismError where K_E or M_FF is singular, or a pose falls or buckles under its weight.
    """
    return _solve(pencil, pencil.theta(x), count, vectors=False, x=x).lam


def modes(pencil: Pencil, x: Floats, count: int) -> Modes:
    """Eigenvalues and mass-normalised modes of the lowest elastic modes."""
    return _solve(pencil, pencil.theta(x), count, vectors=True, x=x)


def _solve(
    pencil: Pencil, theta: Floats, count: int, vectors: bool, x: Floats | None = None
) -> Modes:
    elastic, count = len(pencil.elastic), whole(count, "count")
    if not 1 <= count <= elastic:
        raise UsageError(f"{count} modes asked for; the model has 1 to {elastic} elastic ones")
    if not np.isfinite(theta).all():
        raise UsageError("q or y is not finite, or outside the domain of a section or length")
    require_hanging(pencil, theta, x)
    try:
        if pencil.is_dense or 2 * count > elastic:  # Lanczos is for few modes of many
            return solve_dense(pencil, theta, count, vectors)
        return solve_large(pencil, theta, count, vectors)
    except MissingMassError:
        raise
    except MechanismError:
        require_standing(pencil, theta, x)
        raise


def lowest_modes(pencil: Pencil, theta: Floats, least: int, extra: int) -> Modes:
    """The lowest ``least`` modes at θ (n_theta, n_samples), and up to ``extra`` more with mass."""
    count = max(min(least + extra, len(pencil.elastic)), least)
    while True:
        try:
            return _solve(pencil, theta, count, vectors=True)
        except MissingMassError as error:
            if count == least:
                raise
            count = min(max(error.most, least), count - 1)
