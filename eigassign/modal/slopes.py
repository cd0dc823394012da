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
from eigassign.modal.arguments import chunks, solve_blocks
from eigassign.modal.exact.dense import Modes
from eigassign.modal.exact.solver import lowest_modes

Floats = NDArray[np.float64]


def exact_slopes(
    pencil: Pencil, x: Floats, count: int, wanted: ArrayLike, above: int = 0
) -> tuple[Floats, Floats, Floats]:
    """λ (n, count + above) of the lowest elastic modes at x (n, n_x), and slopes by `mode_slopes`.

    These are of ``count`` modes; where there are some ``above``, as many as have mass at all
    samples, of the first of these too, and mixed.

    Raises UsageError for more modes than there are or x outside the domain of a section or length,
    MissingMassError for more than have mass, MechanismError where K_E or M_FF is singular.
    """
    parts = []
    for some in solve_blocks(x, pencil.n_dof):
        found = lowest_modes(pencil, pencil.theta(some), count, above)
        own = Modes(*(values[..., : count + bool(above)] for values in (found.lam, found.phi)))
        parts.append((found.lam, *mode_slopes(pencil, some, own, wanted, mixed=above > 0)))
    lam, slopes, mixed = map(_together, zip(*parts, strict=True))
    return lam, slopes, mixed


def _together(blocks: Sequence[Floats]) -> Floats:
    """One array of blocks (n, m, …), of the modes that there are in all."""
    there = min(each.shape[1] for each in blocks)
    return np.concatenate([each[:, :there] for each in blocks])


def mode_slopes(
    pencil: Pencil, x: Floats, found: Modes, wanted: ArrayLike, mixed: bool = False
) -> tuple[Floats, Floats]:
    """∂λ/∂x (n, m, n_x) of modes found at x; ``mixed``, those off the diagonal (n, m − 1, n_x) too.

    Slopes are taken in those variables where ``wanted`` (n_x,) is not 0; else 0 is returned.
    """
    there = found.lam.shape[1]
    pairs = [(k, k) for k in range(there)]
    pairs += [(k, k + 1) for k in range(there - 1) if mixed]
    i, j = map(list, zip(*pairs, strict=True))
    lam = 0.5 * (found.lam[:, i] + found.lam[:, j])
    result = works_changed(pencil, x, found.phi[..., i], found.phi[..., j], lam, wanted)
    return result[:, :there], result[:, there:]


def works_changed(
    pencil: Pencil, x: Floats, left: Floats, right: Floats, lam: Floats, wanted: ArrayLike
) -> Floats:
    """lᵀ (∂K/∂x − λ ∂M/∂x) r (n, m, n_x) of vectors l and r (n, n_dof, m) at x, with λ (n, m)."""
    along = np.flatnonzero(wanted)
    rates = pencil.theta_slopes(x, along)
    moving = np.flatnonzero(np.abs(rates).max(axis=(0, 2), initial=0.0) > 0.0)
    stiffness, mass = pencil.stiffness[:, moving], pencil.mass[:, moving]
    entries = np.flatnonzero(np.diff(stiffness.indptr) + np.diff(mass.indptr))
    stiffness, mass = stiffness[entries], mass[entries]
    rows, columns = pencil.rows[entries], pencil.columns[entries]
    result = np.zeros((*lam.shape, x.shape[1]))
    for part in chunks(np.arange(len(x)), max(len(entries), 1)):
        own = rates[:, moving][:, :, part]
        for k in range(lam.shape[1]):
            products = left[part, :, k][:, rows] * right[part, :, k][:, columns]
            forms = products @ stiffness - lam[part, k, None] * (products @ mass)
            result[part[:, None], k, along] = np.einsum("nt,jtn->nj", forms, own)
    return result


def in_hz(lam: Floats, slopes: Floats) -> tuple[Floats, Floats]:
    """f = √λ/2π (n, m) in Hz, and ∂f = ∂λ/(8π² f) (n, m, …)."""
    hz = np.sqrt(lam) / (2.0 * np.pi)
    return hz, slopes / (8.0 * np.pi**2 * hz[..., None])
