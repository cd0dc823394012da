"""Error estimate of a Taylor polynomial: beside it stands a reduced model on the same vectors.

With f̂ of the reduced model and its own estimate e, |f_T/f − 1| ≤ |f_T/f̂ − 1| (1 + e) + e.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import comb

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.errors import UsageError
from eigassign.mechanism.pencil import Pencil
from eigassign.modal.reduced import reduce
from eigassign.modal.reduced_model import ReducedModel
from eigassign.series.lower_set import LowerSet

Floats = NDArray[np.float64]
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
