"""Arithmetic of truncated multivariate power series Σ a_γ x^γ, γ in a lower set.

The kernels act on stacks of series: arrays (..., N) over a :class:`LowerSet` of N members, so that
a thousand products cost one call. :class:`PowerSeries` is the same algebra for one series, with
operators; it carries its set, and mixing two sets raises.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import UsageError
from eigassign.series.lower_set import LowerSet

Floats = NDArray[np.float64]
CHUNK = 4_000_000  # numbers gathered at once in a product: 32 MB


def multiply(space: LowerSet, a: Floats, b: Floats) -> Floats:
    """(ab)_γ = Σ_{δ ≤ γ} a_δ b_{γ-δ} for stacks a, b of shape (n, N)."""
    table = space.table
    rows = max(1, CHUNK // len(table.left))
    if len(a) <= rows:
        return np.add.reduceat(a[:, table.left] * b[:, table.right], table.starts, axis=1)
    parts = [multiply(space, a[i : i + rows], b[i : i + rows]) for i in range(0, len(a), rows)]
    return np.concatenate(parts)


def compose(space: LowerSet, taylor: Floats, a: Floats) -> Floats:
    """f(a) for stacks a (n, N), given f's own Taylor coefficients at a_0: ``taylor`` (p + 1, n).

    f(a_0 + ã) = Σ_k f_k ã^k by Horner's rule, exact because ã is nilpotent of order p + 1.
    """
    small = a.copy()
    small[:, 0] = 0.0
    if len(taylor) == 1:
        result = np.zeros_like(a)
        result[:, 0] = taylor[0]
        return result
    result = taylor[-1][:, None] * small
    result[:, 0] = taylor[-2]
    for coefficient in taylor[-3::-1]:
        result = multiply(space, result, small)
        result[:, 0] += coefficient
    return result


def sine_taylor(at: Floats, order: int) -> Floats:
    """sin^(k)(a)/k! for k = 0…p: shape (p + 1, n)."""
    return np.array([np.sin(at + k * (np.pi / 2)) / math.factorial(k) for k in range(order + 1)])


def cosine_taylor(at: Floats, order: int) -> Floats:
    """cos^(k)(a)/k! for k = 0…p: shape (p + 1, n)."""
    return np.array([np.cos(at + k * (np.pi / 2)) / math.factorial(k) for k in range(order + 1)])


def power_taylor(at: Floats, exponent: float, order: int) -> Floats:
    """Binomial coefficients of (a + h)^e: C(e, k) a^(e-k) for k = 0…p: shape (p + 1, n)."""
    rows = [np.power(at, exponent)]
    for k in range(1, order + 1):
        rows.append(rows[-1] * ((exponent - k + 1) / k) / at)
    return np.array(rows)


def monomials(space: LowerSet, x: Floats) -> Floats:
    """x^γ for every γ of the set, at points x (n_points, n): shape (n_points, N)."""
    result = np.ones((len(x), len(space)))
    for variable in range(space.n_variables):
        exponents = space.indices[:, variable]
        powers = np.ones((len(x), int(exponents.max()) + 1))
        np.cumprod(
            np.broadcast_to(x[:, [variable]], powers[:, 1:].shape), axis=1, out=powers[:, 1:]
        )
        result *= powers[:, exponents]
    return result


@dataclass(frozen=True, eq=False)
class PowerSeries:
    """One truncated series over ``space``; immutable."""

    space: LowerSet
    coefficients: Floats  # (N,)

    def __post_init__(self) -> None:
        values = np.array(self.coefficients, dtype=np.float64)
        if values.shape != (len(self.space),):
            raise UsageError(f"{values.shape} coefficients for a set of {len(self.space)}")
        values.setflags(write=False)
        object.__setattr__(self, "coefficients", values)

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
            if other.space is not self.space:
                raise UsageError("two series over different sets cannot be combined")
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
        if self.coefficients[0] == 0.0:
            raise UsageError("a power of a series needs a non-zero constant term")
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
