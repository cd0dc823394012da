"""How far a Taylor expansion reaches: its radius of convergence, seen from the coefficients.

At a displacement w the terms of one degree k sum up to t_k(w) ~ (|w|/R)^k, so that over two degrees

    |w| / R ≈ ( (|t_p| + |t_{p−1}|) / (|t_{p−2}| + |t_{p−3}|) )^{1/2} ;

pairs of degrees, for in a symmetric pose every other one vanishes. Above 1 more order only harms.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.modal.expansion import Cluster, Expansion
from eigassign.modal.samples import samples
from eigassign.series.power_series import monomials

Floats = NDArray[np.float64]
LEAST_ORDER = 4


def radius_share(expansion: Expansion, q: ArrayLike, y: ArrayLike) -> Floats:
    """|w|/R (n_samples, n_clusters): below 1 the series converges at that sample.

    NaN below order 4, where nothing can be said.
    """
    x = samples(q, y, len(expansion.q0), len(expansion.y0)) - expansion.x0
    powers = monomials(expansion.space, x @ expansion.directions.T)
    return np.column_stack([_share(expansion, c, powers) for c in expansion.clusters])


def _share(expansion: Expansion, cluster: Cluster, powers: Floats) -> Floats:
    if expansion.order < LEAST_ORDER:
        return np.full(len(powers), np.nan)
    size = [_term(expansion, cluster, powers, expansion.order - k) for k in range(4)]
    late, early = size[0] + size[1], size[2] + size[3]
    tiny = np.finfo(float).eps * np.abs(cluster.coefficients[:, :, 0]).max()
    return np.asarray(np.sqrt(np.maximum(late - tiny, 0.0) / np.maximum(early, tiny)))


def _term(expansion: Expansion, cluster: Cluster, powers: Floats, degree: int) -> Floats:
    """‖t_degree(w)‖ of the cluster's matrix, (n_samples,)."""
    starts = expansion.space.degree_starts
    here = slice(starts[degree], starts[degree + 1])
    matrix = np.tensordot(powers[:, here], cluster.coefficients[:, :, here], axes=(1, 2))
    return np.asarray(np.linalg.norm(matrix, axis=(1, 2)))
