"""Timing laws: how far along its path (s, 0 to 1) the tip is at the relative time τ = t / T."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.errors import UsageError

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class TimingLaw:
    """A polynomial s(τ) = Σ c_k τ^k with s(0) = 0 and s(1) = 1, defined on 0 ≤ τ ≤ 1 only."""

    name: str
    coefficients: tuple[float, ...]  # c_0, c_1, ...

    def position(self, tau: ArrayLike) -> Floats:
        """s(τ), dimensionless, same shape as ``tau``; UsageError outside [0, 1]."""
        return self._evaluate(self.coefficients, tau)

    def velocity(self, tau: ArrayLike) -> Floats:
        """ds/dτ, dimensionless (divide by the duration for 1/s); UsageError outside [0, 1]."""
        return self._evaluate(_derivative(self.coefficients), tau)

    def acceleration(self, tau: ArrayLike) -> Floats:
        """d²s/dτ² (divide by the duration squared for 1/s²); UsageError outside [0, 1]."""
        return self._evaluate(_derivative(_derivative(self.coefficients)), tau)

    def _evaluate(self, coefficients: tuple[float, ...], tau: ArrayLike) -> Floats:
        relative_time = np.asarray(tau, dtype=np.float64)
        if not np.all((relative_time >= 0.0) & (relative_time <= 1.0)):
            raise UsageError(f"the {self.name} timing law is defined for 0 <= tau <= 1 only")
        value = np.zeros_like(relative_time)
        for coefficient in reversed(coefficients):  # Horner
            value = value * relative_time + coefficient
        return value


def _derivative(coefficients: tuple[float, ...]) -> tuple[float, ...]:
    """d/dτ Σ c_k τ^k = Σ k c_k τ^(k-1)."""
    return tuple(k * c for k, c in enumerate(coefficients))[1:]


TIMING_LAWS: Mapping[str, TimingLaw] = MappingProxyType(
    {
        "linear": TimingLaw("linear", (0.0, 1.0)),
        "cubic": TimingLaw("cubic", (0.0, 0.0, 3.0, -2.0)),
        "quintic": TimingLaw("quintic", (0.0, 0.0, 0.0, 10.0, -15.0, 6.0)),
    }
)


def timing_law(name: str) -> TimingLaw:
    """The law called ``name``: linear s = τ, cubic 3τ² − 2τ³, quintic 10τ³ − 15τ⁴ + 6τ⁵.

    Cubic starts and stops at rest, quintic also without acceleration. UsageError for other names.
    """
    if name not in TIMING_LAWS:
        raise UsageError(f"unknown timing law {name!r}; there are {', '.join(TIMING_LAWS)}")
    return TIMING_LAWS[name]
