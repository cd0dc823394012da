"""One truncated power series with operators, so that tests read like the identities they check."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.series import LowerSet, Truncated, monomials

Floats = NDArray[np.float64]


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
        return PowerSeries(self.space, Truncated(self.space).product(left, right)[0])

    __rmul__ = __mul__

    def __pow__(self, exponent: float) -> PowerSeries:
        algebra, one = Truncated(self.space), self.coefficients[None]
        return PowerSeries(self.space, algebra.power(one, np.array([exponent]))[0])

    def __truediv__(self, other: PowerSeries | float) -> PowerSeries:
        if isinstance(other, PowerSeries):
            return self * other**-1.0
        return self * (1.0 / other)

    def __rtruediv__(self, other: float) -> PowerSeries:
        return other * self**-1.0

    def sin(self) -> PowerSeries:
        """Sine of the series (argument in rad)."""
        return self._wave(0)

    def cos(self) -> PowerSeries:
        """Cosine of the series (argument in rad)."""
        return self._wave(1)

    def _wave(self, quarters: int) -> PowerSeries:
        algebra, one = Truncated(self.space), self.coefficients[None]
        return PowerSeries(self.space, algebra.wave(one, np.array([quarters]))[0])

    def __call__(self, x: Floats) -> Floats:
        """Value at displacements x (n,) or (n_points, n) from the expansion point."""
        points = np.atleast_2d(np.asarray(x, dtype=np.float64))
        values = monomials(self.space, points) @ self.coefficients
        return values if np.ndim(x) == 2 else values[0]
