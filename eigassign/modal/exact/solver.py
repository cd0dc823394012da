"""Exact elastic modes of any pencil, their slopes, round-off and clusters.

With E the elastic unknowns (u and held coordinates) and F the free coordinates, K = diag(K_E, 0):

    K_E φ_E = λ M_c φ_E,   M_c = M_EE − M_EF M_FF⁻¹ M_FE,   φ_F = −M_FF⁻¹ M_FE φ_E

solved in the inverse form M_c z = μ K_E z, μ = 1/λ, so that massless unknowns (μ = 0) are harmless.
What may be round-off instead of a mode with mass is settled by `modes_with_mass`.

With a mode φ of K φ = λ M φ, φᵀMφ = 1, and the affine pencil K = Σ_j θ_j K_j, M = Σ_j θ_j M_j,

    ∂λ/∂x_i = φᵀ (∂K/∂x_i − λ ∂M/∂x_i) φ = Σ_j (φᵀK_jφ − λ φᵀM_jφ) ∂θ_j/∂x_i

(Fox, Kapoor, AIAA J. 6 (1968) 2426). Where modes of different slope meet, λ by size has a kink
there, and the slope is that of the mode which the solver returns. Smooth there is the small matrix
of both modes, whose entry off the diagonal has the slope

    φ_iᵀ (∂K/∂x − ½ (λ_i + λ_j) ∂M/∂x) φ_j.

In a fine mesh the strain energy is a small difference of large terms, and a stiff spring beside a
soft beam drowns it. How much of that an eigenvalue feels is measured: θ → c θ scales K and M alike,
and would change no eigenvalue if numbers were exact. But every product, sum and pivot is rounded
anew, unless c is a power of two; what eigenvalues then differ by is their round-off.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from eigassign.arrays import Floats
from eigassign.errors import AccuracyError, MechanismError, MissingMassError, UsageError
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.modal.arguments import chunks, solve_blocks, whole
from eigassign.modal.exact.dense import Modes, solve_dense
from eigassign.modal.exact.inertia import require_hanging, require_standing
from eigassign.modal.exact.large import solve_large


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


# No powers of two, beside 1; so many, for some models spread widely at one in ten of them only.
SCALES = np.array([1.0837, 0.8391, 1.2943, 0.7213, 1.613, 0.9127, 1.4711, 0.6173])
# Times the spread in frequency: in some 300 chains of fine beams and stiff springs
# (`tests/stability/test_roundoff.py`) the true round-off was at most 8.2 times that.
SAFETY = 10.0


def rounding_error(pencil: Pencil, x: Floats, count: int) -> float:
    """Relative round-off in frequency of the lowest ``count`` modes at x (n_x,), the largest.

    Infinite where other roundings of the same matrices have no such modes.
    """
    theta = pencil.theta(x[None])
    plain = lowest_modes(pencil, theta, count, 0).lam
    try:
        lam = lowest_modes(pencil, theta * SCALES, count, 0).lam
    except (AccuracyError, MechanismError):
        return np.inf
    spread = float(np.abs(lam / plain - 1.0).max())
    return 0.5 * SAFETY * max(spread, float(np.finfo(float).eps))


LEAST_GAP = 1e-10  # modes that round-off hardly tells apart have no series of their own
CLUSTER_GAP = 0.02  # modes closer than this (relative in λ) are expanded together


def clusters(lam: Floats, wanted: Sequence[int], gap: float) -> tuple[tuple[int, ...], ...]:
    """Modes (1-based) grouped where neighbours are closer than ``gap`` (relative in λ).

    Never less than LEAST_GAP: of modes that coincide any mixture is a mode.
    """
    gap = max(gap, LEAST_GAP)
    groups = [[1]]
    for k, (below, above) in enumerate(itertools.pairwise(lam.tolist()), 2):
        if above - below < gap * above:
            groups[-1].append(k)
        else:
            groups.append([k])
    return tuple(tuple(g) for g in groups if not set(wanted).isdisjoint(g))


def whole_clusters(
    pencil: Pencil, theta0: Floats, wanted: Sequence[int], gap: float
) -> tuple[Modes, tuple[tuple[int, ...], ...]]:
    """The wanted modes' clusters, and modes up to above the last: a cluster cut short is wrong."""
    elastic = len(pencil.elastic)
    count = min(max(wanted) + 1, elastic) if max(wanted) <= elastic else max(wanted)
    while True:
        found = lowest_modes(pencil, theta0, max(wanted), count - max(wanted))
        there = found.lam.shape[1]  # fewer than asked for where no more have mass
        groups = clusters(found.lam[0], wanted, gap)
        if there < count or count == elastic or groups[-1][-1] < count:
            return found, groups
        count = min(2 * count, elastic)
