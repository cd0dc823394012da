"""One truncated power series with operators, so that tests read like the identities they check."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.series import LowerSet, compose, monomials, multiply, power_taylor, wave_taylor

Floats = NDArray[np.float64]


def sine_taylor(at: Floats, order: int) -> Floats:
    return wave_taylor(at, np.zeros(len(at), dtype=np.intp), order)


def cosine_taylor(at: Floats, order: int) -> Floats:
    return wave_taylor(at, np.ones(len(at), dtype=np.intp), order)


@dataclass(frozen=True, eq=False)
class PowerSeries:
    """One truncated series over ``space``; immutable."""

    space: LowerSet
    coefficients: Floats  # (N,)

    @classmethod
    def variable(cls, space: LowerSet, which: int, at: float = 0.0) -> PowerSeries:
        """The series of x_i about x_i = ``at``."""
        unit = np.eye(space.n_variables, dtype=np.int64)[which]
        values = np.zeros(len(space))
        values[0] = at
        position = int(space.find(unit)[0])
        if position >= 0:
            values[position] = 1.0
        return cls(space, values)

    def _other(self, other: PowerSeries | float) -> Floats:
        if isinstance(other, PowerSeries):
            return other.coefficients
        values = np.zeros(len(self.space))
        values[0] = other
        return values

    def __add__(self, other: PowerSeries | float) -> PowerSeries:
        return PowerSeries(self.space, self.coefficients + self._other(other))

    __radd__ = __add__

    def __neg__(self) -> PowerSeries:
        return PowerSeries(self.space, -self.coefficients)

    def __sub__(self, other: PowerSeries | float) -> PowerSeries:
        return PowerSeries(self.space, self.coefficients - self._other(other))

    def __rsub__(self, other: float) -> PowerSeries:
        return -self + other

    def __mul__(self, other: PowerSeries | float) -> PowerSeries:
        left, right = self.coefficients[None], self._other(other)[None]
        return PowerSeries(self.space, multiply(self.space, left, right)[0])

    __rmul__ = __mul__

    def __pow__(self, exponent: float) -> PowerSeries:
        return self._apply(lambda at, p: power_taylor(at, exponent, p))

    def __truediv__(self, other: PowerSeries | float) -> PowerSeries:
        if isinstance(other, PowerSeries):
            return self * other**-1.0
        return self * (1.0 / other)

    def __rtruediv__(self, other: float) -> PowerSeries:
        return other * self**-1.0

    def sin(self) -> PowerSeries:
        """Sine of the series (argument in rad)."""
        return self._apply(sine_taylor)

    def cos(self) -> PowerSeries:
        """Cosine of the series (argument in rad)."""
        return self._apply(cosine_taylor)

    def _apply(self, taylor: Callable[[Floats, int], Floats]) -> PowerSeries:
        derivatives = taylor(self.coefficients[:1], self.space.order)
        return PowerSeries(self.space, compose(self.space, derivatives, self.coefficients[None])[0])

    def __call__(self, x: Floats) -> Floats:
        """Value at displacements x (n,) or (n_points, n) from the expansion point."""
        points = np.atleast_2d(np.asarray(x, dtype=np.float64))
        values = monomials(self.space, points) @ self.coefficients
        return values if np.ndim(x) == 2 else values[0]
