"""Point to point: q(t) between joint coordinates, each segment by the same timing law.

Shapes: m points, n samples in time, n_q coordinates. SI units, angles in rad.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import MechanismError
from eigassign.mechanism.timing import TimingLaw

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Motion:
    """q(t) at n equal steps of time, and when each point is reached."""

    time_s: Floats  # (n,)
    q: Floats  # (n, n_q)
    reached_s: Floats  # (m,)


def shared_times(points: Floats, duration: float) -> Floats:
    """When each point (m, n_q) is reached, (m,) in s from 0 to ``duration``.

    The time of a segment is in proportion to the largest move of a coordinate, each relative to the
    range R_i which that coordinate has over all points: T_k ∝ max_i |q_{k+1,i} − q_{k,i}| / R_i. So
    radians and metres need no common measure. Raises MechanismError for a point that equals the one
    before it.
    """
    extent = np.ptp(points, axis=0)
    moves = np.abs(np.diff(points, axis=0)) / np.where(extent > 0.0, extent, 1.0)
    share = moves.max(axis=1)
    for k in np.flatnonzero(share == 0.0):
        message = "the same point as the one before it: give times instead of duration to wait"
        raise MechanismError(f"trajectory.points[{k + 1}]", message)
    reached = np.asarray(np.concatenate([[0.0], np.cumsum(share)]) * (duration / share.sum()))
    reached[-1] = duration
    return reached


def point_to_point(points: Floats, reached_s: Floats, law: TimingLaw, n: int) -> Motion:
    """q(t) = q_k + s((t − t_k)/(t_{k+1} − t_k)) (q_{k+1} − q_k) at n equal steps of time."""
    time_s = np.linspace(reached_s[0], reached_s[-1], n)
    k = np.clip(np.searchsorted(reached_s, time_s, side="right") - 1, 0, len(points) - 2)
    tau = (time_s - reached_s[k]) / (reached_s[k + 1] - reached_s[k])
    s = law.position(np.clip(tau, 0.0, 1.0))[:, None]
    # this form gives both ends exactly
    return Motion(time_s, (1.0 - s) * points[k] + s * points[k + 1], reached_s)
