"""How fast a sampled motion is: q̇ and q̈ at its samples, never across a corner.

Where the velocity jumps (straight tip paths, points joined by linear timing) there is a blow and no
acceleration that samples could tell: each smooth part is differentiated by itself.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from eigassign.mechanism.trajectory import Trajectory

Floats = NDArray[np.float64]
SAME = 1e-9  # of the duration: a sample this near to a corner is on it, and ends both parts


@dataclass(frozen=True, eq=False)
class Rates:
    """q, q̇ and q̈ (m, n_q) at ``samples`` (m,); a sample on a corner stands there for both sides."""

    samples: NDArray[np.intp]
    q: Floats
    rate: Floats
    acceleration: Floats


def rates(trajectory: Trajectory) -> Rates:
    """By differences within each smooth part; of a part with one sample nothing is known."""
    parts = [part for part in _smooth_parts(trajectory) if len(part) > 1]
    samples = np.concatenate([np.zeros(0, dtype=np.intp), *parts])
    q, time_s = trajectory.q, trajectory.time_s
    found = [_differences(time_s[part], q[part]) for part in parts]
    nothing = np.zeros((0, q.shape[1]))
    rate, acceleration = (np.concatenate([nothing, *(f[k] for f in found)]) for k in (0, 1))
    return Rates(samples, q[samples], rate, acceleration)


def _smooth_parts(trajectory: Trajectory) -> list[NDArray[np.intp]]:
    """The samples from each corner to the next."""
    time_s = trajectory.time_s
    near = SAME * float(np.ptp(time_s))
    cuts = [time_s[0], *trajectory.corners_s, time_s[-1]]
    return [
        np.flatnonzero((time_s >= a - near) & (time_s <= b + near))
        for a, b in itertools.pairwise(cuts)
    ]


def _differences(time_s: Floats, q: Floats) -> tuple[Floats, Floats]:
    """Of second order; of two samples their difference, and no acceleration."""
    order: Literal[1, 2] = 2 if len(time_s) > 2 else 1
    rate = np.gradient(q, time_s, axis=0, edge_order=order)
    return rate, np.gradient(rate, time_s, axis=0, edge_order=order)
