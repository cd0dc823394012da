"""Slopes of exact eigenvalues in coordinates and design, without a further eigensolve.

With a mode φ of K φ = λ M φ, φᵀMφ = 1, and the affine pencil K = Σ_j θ_j K_j, M = Σ_j θ_j M_j,

    ∂λ/∂x_i = φᵀ (∂K/∂x_i − λ ∂M/∂x_i) φ = Σ_j (φᵀK_jφ − λ φᵀM_jφ) ∂θ_j/∂x_i

(Fox, Kapoor, AIAA J. 6 (1968) 2426). Where modes of different slope meet, λ by size has a kink
there, and the slope is that of the mode which the solver returns. Smooth there is the small matrix
of both modes, whose entry off the diagonal has the slope

    φ_iᵀ (∂K/∂x − ½ (λ_i + λ_j) ∂M/∂x) φ_j.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.modal.arguments import chunks
from eigassign.modal.exact.condensation import Modes
from eigassign.modal.exact.solver import lowest_modes, modes_at

Floats = NDArray[np.float64]


def eigenvalue_slopes(
    pencil: Pencil, x: Floats, count: int, wanted: ArrayLike
) -> tuple[Floats, Floats]:
    """λ (n, count) and ∂λ/∂x (n, count, n_x) of the lowest elastic modes at x (n, n_x).

    Slopes are taken in those variables where ``wanted`` (n_x,) is not 0; else 0 is returned.

    Raises UsageError for more modes than there are or x outside the domain of a section or length,
    MissingMassError for more modes than have mass, MechanismError where K_E or M_FF is singular.
    """
    found = modes_at(pencil, pencil.theta(x), count)
    return found.lam, mode_slopes(pencil, x, found, wanted)


def mode_slopes(pencil: Pencil, x: Floats, found: Modes, wanted: ArrayLike) -> Floats:
    """∂λ/∂x (n, count, n_x) of modes found at x, in the same variables."""
    pairs = [(mode, mode) for mode in range(found.lam.shape[1])]
    return _slopes(pencil, x, found, pairs, wanted)


def mixed_slopes(
    pencil: Pencil, x: Floats, count: int, wanted: ArrayLike, above: int = 1
) -> tuple[Floats, Floats, Floats]:
    """The same, of the mode above too if there is one, and the slopes of neighbours' mixture.

    λ (n, count + above), slopes (n, count + 1, n_x), those off the diagonal (n, count, n_x); fewer
    where no more modes have mass.
    """
    found = lowest_modes(pencil, pencil.theta(x), count, above)
    own = Modes(found.lam[:, : count + 1], found.phi[..., : count + 1])
    return found.lam, *neighbour_slopes(pencil, x, own, wanted)


def neighbour_slopes(
    pencil: Pencil, x: Floats, found: Modes, wanted: ArrayLike
) -> tuple[Floats, Floats]:
    """Slopes (n, count, n_x) of modes found at x, and off the diagonal (n, count − 1, n_x)."""
    there = found.lam.shape[1]
    pairs = [(k, k) for k in range(there)] + [(k, k + 1) for k in range(there - 1)]
    slopes = _slopes(pencil, x, found, pairs, wanted)
    return slopes[:, :there], slopes[:, there:]


def _slopes(
    pencil: Pencil,
    x: Floats,
    found: Modes,
    pairs: Sequence[tuple[int, int]],
    wanted: ArrayLike,
) -> Floats:
    """φ_iᵀ (∂K/∂x − ½ (λ_i + λ_j) ∂M/∂x) φ_j (n, n_pairs, n_x) of pairs of modes (i, j)."""
    along = np.flatnonzero(wanted)
    rates = pencil.theta_slopes(x, along)
    moving = np.flatnonzero(np.abs(rates).max(axis=(0, 2), initial=0.0) > 0.0)
    stiffness, mass = pencil.stiffness[:, moving], pencil.mass[:, moving]
    entries = np.flatnonzero(np.diff(stiffness.indptr) + np.diff(mass.indptr))
    stiffness, mass = stiffness[entries], mass[entries]
    rows, columns = pencil.rows[entries], pencil.columns[entries]
    result = np.zeros((len(x), len(pairs), x.shape[1]))
    for part in chunks(np.arange(len(x)), max(len(entries), 1)):
        own = rates[:, moving][:, :, part]
        for k, (i, j) in enumerate(pairs):
            left, right = found.phi[part, :, i], found.phi[part, :, j]
            products = left[:, rows] * right[:, columns]
            lam = 0.5 * (found.lam[part, i] + found.lam[part, j])[:, None]
            forms = products @ stiffness - lam * (products @ mass)
            result[part[:, None], k, along] = np.einsum("nt,jtn->nj", forms, own)
    return result
