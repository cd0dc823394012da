"""From residual norms of Ritz pairs to an estimate of the relative error in frequency.

In the inverse form (μ = 1/λ, ‖z‖_K = 1) each ‖ρ_i‖ bounds the distance of μ̂_i to *some* eigenvalue.
Where the neighbours keep their distance, the Kato-Temple bound |μ − μ̂| ≤ ‖ρ‖²/gap is far sharper;
the gap is taken to the neighbours' nearer ends, μ̂_j ± ‖ρ_j‖.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
SAFETY = 3.0  # on ‖ρ‖²/gap: the norm is taken at x0 instead of x, the gap from Ritz values
LOST = 0.5  # residual relative to μ̂ above which a pair says nothing about a mode


def frequency_error(mu: Floats, norms: Floats) -> Floats:
    """Relative error in frequency (n, count) of Ritz values μ̂ (n, count), descending.

    f ∝ μ^{−1/2}: half the relative error in μ. Infinite where the pair or its neighbour below is
    lost; the last pair only serves as a neighbour and gets its linear bound.
    """
    n, count = mu.shape
    gap = np.full((n, count), np.inf)
    distance = mu[:, :-1] - mu[:, 1:]
    gap[:, :-1] = np.minimum(gap[:, :-1], distance - norms[:, 1:])
    gap[:, 1:] = np.minimum(gap[:, 1:], distance - norms[:, :-1])
    linear = norms
    with np.errstate(divide="ignore", invalid="ignore"):
        quadratic = np.where(gap > norms, SAFETY * norms**2 / gap, np.inf)
    error = 0.5 * np.minimum(linear, quadratic) / mu
    lost = norms > LOST * mu
    lost[:, :-1] |= norms[:, 1:] > LOST * mu[:, :-1]
    return np.where(lost, np.inf, error)
