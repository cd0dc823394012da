"""Several expansions about points along a trajectory: each pose belongs to the nearest of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from eigassign.modal.expansion import Expansion

Floats = NDArray[np.float64]


def nearest(parts: Sequence[Expansion], q: Floats) -> NDArray[np.intp]:
    """Which of ``parts`` each of q (n, n_q) is nearest to, in the variables of the series.

    Distances are |V (q − q0_k)|, so that coordinates on which nothing depends do not count.
    """
    V = parts[0].directions[:, : len(parts[0].q0)]
    away = [np.square((q - part.q0) @ V.T).sum(axis=1) for part in parts]
    return np.asarray(np.argmin(away, axis=0), dtype=np.intp)


def picked(parts: Sequence[Expansion], q: Floats, values: Sequence[Floats]) -> Floats:
    """Of ``values``, one array (n, …) for each of ``parts``, the nearest one's at each sample."""
    if len(values) == 1:
        return values[0]
    owner = nearest(parts, q)
    return np.asarray(np.array(values)[owner, np.arange(len(owner))])
