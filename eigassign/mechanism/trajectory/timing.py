"""Timing laws s(τ), how far along its path the tip is at the relative time τ = t/T; point to point.

Point to point, q(t) runs between joint coordinates, each segment by the same timing law.

Shapes: m points, n samples in time, n_q coordinates. SI units, angles in rad.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import ArrayLike, NDArray

from eigassign.errors import UsageError

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class TimingLaw:
    """Polynomials s(τ) = Σ c_k (τ − τ_i)^k on τ_i ≤ τ ≤ τ_{i+1}, from s(0) = 0 to s(1) = 1.

    Defined on 0 ≤ τ ≤ 1 only; ``ends`` are the τ_{i+1} of all pieces but the last.
    """

    name: str
    pieces: tuple[tuple[float, ...], ...]  # c_0, c_1, ... of each
    ends: tuple[float, ...] = ()

    def position(self, tau: ArrayLike) -> Floats:
        """s(τ), dimensionless, same shape as ``tau``; UsageError outside [0, 1]."""
        return self._derivative(0, tau)

    def velocity(self, tau: ArrayLike) -> Floats:
        """ds/dτ, dimensionless (divide by the duration for 1/s); UsageError outside [0, 1]."""
        return self._derivative(1, tau)

    def acceleration(self, tau: ArrayLike) -> Floats:
        """d²s/dτ² (divide by the duration squared for 1/s²), from the right where it jumps."""
        return self._derivative(2, tau)

    def _derivative(self, order: int, tau: ArrayLike) -> Floats:
        relative_time = np.asarray(tau, dtype=np.float64)
        if not np.all((relative_time >= 0.0) & (relative_time <= 1.0)):
            raise UsageError(f"the {self.name} timing law is defined for 0 <= tau <= 1 only")
        value = np.zeros_like(relative_time)
        for start, piece in zip((0.0, *self.ends), self.pieces, strict=True):
            own = polynomial.polyval(relative_time - start, polynomial.polyder(piece, order))
            value = np.where(relative_time >= start, own, value)
        return value


POLYNOMIALS: Mapping[str, TimingLaw] = MappingProxyType(
    {
        "linear": TimingLaw("linear", ((0.0, 1.0),)),
        "cubic": TimingLaw("cubic", ((0.0, 0.0, 3.0, -2.0),)),
        "quintic": TimingLaw("quintic", ((0.0, 0.0, 0.0, 10.0, -15.0, 6.0),)),
    }
)


def trapezoidal(share: float) -> TimingLaw:
    """Constant acceleration for the ``share`` a of the time, constant velocity, and braking for a.

    s = v τ²/(2a), then v (τ − a/2), then 1 − v (1 − τ)²/(2a), at the peak velocity v = 1/(1 − a).
    UsageError unless 0 < a ≤ 1/2.
    """
    if not 0.0 < share <= 0.5:
        raise UsageError(f"the share of time spent accelerating must be in (0, 0.5], got {share:g}")
    v, a = 1.0 / (1.0 - share), share
    ramp = 0.5 * v * a  # covered while accelerating, and while braking
    pieces = ((0.0, 0.0, 0.5 * v / a), (ramp, v), (1.0 - ramp, v, -0.5 * v / a))
    return TimingLaw("trapezoidal", pieces, (a, 1.0 - a))


def timing_law(name: str, acceleration_share: float = 1.0 / 3.0) -> TimingLaw:
    """The law called ``name``: linear s = τ, cubic 3τ² − 2τ³, quintic 10τ³ − 15τ⁴ + 6τ⁵, or
    trapezoidal with the share of its time that it accelerates.

    All but linear start and stop at rest, quintic also without acceleration. UsageError for other
    names.
    """
    if name == "trapezoidal":
        return trapezoidal(acceleration_share)
    if name not in POLYNOMIALS:
        known = ", ".join((*POLYNOMIALS, "trapezoidal"))
        raise UsageError(f"unknown timing law {name!r}; there are {known}")
    return POLYNOMIALS[name]


# --- point to point


def shared_times(points: Floats, duration: float) -> Floats:
    """When each point (m, n_q) is reached, (m,) in s from 0 to ``duration``.

    The time of a segment is in proportion to the largest move of a coordinate, each relative to the
    range R_i which that coordinate has over all points: T_k ∝ max_i |q_{k+1,i} − q_{k,i}| / R_i. So
    radians and metres need no common measure.
    """
    extent = np.ptp(points, axis=0)
    moves = np.abs(np.diff(points, axis=0)) / np.where(extent > 0.0, extent, 1.0)
    share = moves.max(axis=1)
    reached = np.asarray(np.concatenate([[0.0], np.cumsum(share)]) * (duration / share.sum()))
    reached[-1] = duration
    return reached
