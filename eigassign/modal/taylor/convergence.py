"""How far a Taylor expansion reaches: its radius of convergence, seen from the coefficients.

At a displacement w the terms of one degree k sum up to t_k(w) ~ (|w|/R)^k, so that over two degrees

    |w| / R ≈ ( (|t_p| + |t_{p−1}|) / (|t_{p−2}| + |t_{p−3}|) )^{1/2} ;

pairs of degrees, for in a symmetric pose every other one vanishes. Above 1 more order only harms.

Error estimate of a Taylor polynomial: beside it stands a reduced model on the same vectors.

With f̂ of the reduced model and its own estimate e, |f_T/f − 1| ≤ |f_T/f̂ − 1| (1 + e) + e.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import comb

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.errors import UsageError
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.modal.arguments import samples
from eigassign.modal.reduced.model import ReducedModel
from eigassign.modal.reduced.reduce import reduce
from eigassign.modal.taylor.expansion import Cluster, Expansion
from eigassign.series.multi_index import LowerSet
from eigassign.series.power_series import monomials

# --- How far a Taylor expansion reaches: its radius of convergence, seen from the coefficients

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


# --- Error estimate of a Taylor polynomial: beside it stands a reduced model on the same vectors

MOST_VECTORS = 150  # Taylor vectors of one mode that are taken along


def companion(
    pencil: Pencil | None,
    q0: ArrayLike,
    y0: ArrayLike,
    modes: Sequence[int],
    space: LowerSet,
    vectors: Sequence[Floats],
) -> ReducedModel:
    """The reduced model beside an expansion with ``vectors`` (N_H, n_dof, r) over ``space``.

    Vectors to second order at least, to first order in very many variables. Raises UsageError for
    an expansion without its pencil.
    """
    if pencil is None:
        raise UsageError("this expansion was read from arrays without its model: no error estimate")
    order = companion_order(space.n_variables, space.order)
    known = space.order >= order and bool((space.degrees <= order).sum() == _full(space, order))
    if not known:
        return reduce(pencil, q0, y0, modes, order)
    keep = space.degrees <= order
    columns = [X[keep].transpose(1, 0, 2).reshape(X.shape[1], -1) for X in vectors]
    return reduce(pencil, q0, y0, modes, order, given=np.hstack(columns))


def companion_order(n_variables: int, known: int) -> int:
    """Order m of the vectors: as known, but 2 at least and no more vectors than MOST_VECTORS."""
    orders = range(max(known, 2), 1, -1)
    fitting = [m for m in orders if comb(n_variables + m, m) <= MOST_VECTORS]
    return fitting[0] if fitting else 1


def _full(space: LowerSet, order: int) -> int:
    return comb(space.n_variables + order, order)


def polynomial_error(polynomial: Floats, reduced: Floats, estimate: Floats) -> Floats:
    """Relative error in frequency (n, n_modes); infinite where λ < 0 or f̂ is refused."""
    apart = np.abs(polynomial / reduced - 1.0)
    bound = apart * (1.0 + estimate) + estimate
    return np.where(np.isfinite(bound), bound, np.inf)
