"""From residuals of Ritz pairs to an estimate of the relative error in frequency.

In the inverse form (μ = 1/λ, ‖z‖_K = 1) let ρ_i be the residuals of the first c Ritz pairs and ν
the largest μ among modes that the basis does not represent. Eliminating those modes moves the pairs
by the symmetric matrix C_ij = ρ_iᵀρ_j / (μ̂_i − ν) (Kato-Temple, for all pairs together), so that

    0 ≤ μ_i − μ̂_i ≲ ε_i = C_ii + Σ_{j≠i} min(|C_ij|, C_ij² / |μ̂_i − μ̂_j|).

Pairs that cross or veer inside the basis do not disturb each other: only the gap to ν counts. The
i-th largest of all μ̂_j + ε_j bounds μ_i, so a pair that might overtake is counted in.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
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
