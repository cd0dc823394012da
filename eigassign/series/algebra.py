"""The algebras a program runs in: samples, samples with tangents, and truncated power series."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.errors import SingularityError
from eigassign.series.multi_index import LowerSet
from eigassign.series.power_series import (
    compose,
    exponential_taylor,
    matrix_product,
    multiply,
    power_taylor,
    wave_taylor,
)

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
Weights = sparse.csr_array | NDArray[np.float64]


class Algebra(Protocol):
    """Operations that a program needs to run, on rows of numbers standing for values."""

    def constant(self, values: Floats) -> Floats:
        """Numbers (n,) as rows (n, …)."""

    def linear(self, weights: Weights, constants: Floats, values: Floats) -> Floats:
        """Linear forms of rows: constants (k,) + weights (k, n) × values."""

    def product(self, a: Floats, b: Floats) -> Floats:
        """Row by row product."""

    def power(self, a: Floats, exponents: Floats) -> Floats:
        """Row by row power with one exponent a row."""

    def wave(self, a: Floats, quarters: Ints) -> Floats:
        """Row by row sin(a + quarters π/2): the sine for 0, the cosine for 1."""

    def exponential(self, a: Floats) -> Floats:
        """Row by row eᵃ."""

    def solve(self, A: Floats, B: Floats, n: int) -> Floats:
        """X as rows (n m, …) of A X = B, entries as rows (n², …) and (n m, …)."""


class Function(Protocol):
    """A vector function that is no formula, such as the solution of equations, in any algebra."""

    @property
    def size(self) -> int:
        """Number of components."""

    def evaluate(self, algebra: Algebra, a: Floats) -> Floats:
        """Components as rows (size, …) from the arguments as rows (n_arguments, …)."""


class Samples:
    """Ordinary numbers, many samples at once."""

    def constant(self, values: Floats) -> Floats:
        """(n,) → (n, 1), broadcast over samples."""
        return values[:, None]

    def linear(self, weights: Weights, constants: Floats, values: Floats) -> Floats:
        """A sum for each form."""
        return np.asarray(weights @ values + constants[:, None])

    def product(self, a: Floats, b: Floats) -> Floats:
        """Elementwise."""
        return a * b

    def power(self, a: Floats, exponents: Floats) -> Floats:
        """Elementwise; a domain error shows as NaN, which callers refuse."""
        with np.errstate(all="ignore"):
            return np.power(a, exponents[:, None])

    def wave(self, a: Floats, quarters: Ints) -> Floats:
        """Elementwise."""
        out = np.sin(a)
        out[quarters == 1] = np.cos(a[quarters == 1])
        return out

    def exponential(self, a: Floats) -> Floats:
        """Elementwise; what overflows is infinite, which callers refuse."""
        with np.errstate(over="ignore"):
            return np.exp(a)

    def solve(self, A: Floats, B: Floats, n: int) -> Floats:
        """Sample by sample; raises SingularityError where A is singular."""
        left, right = A.T.reshape(-1, n, n), B.T.reshape(A.shape[1], n, -1)
        try:
            return np.asarray(np.linalg.solve(left, right).reshape(A.shape[1], -1).T)
        except np.linalg.LinAlgError as error:
            raise SingularityError("the mechanism is at a dead point") from error


@dataclass(frozen=True)
class Tangents:
    """Samples with their derivatives in some directions, exact: rows (k, (1 + n_directions) n).

    The first n columns are the values at n ``samples``, the next n the derivatives in the first
    direction, and so on.
    """

    samples: int
    directions: int

    def constant(self, values: Floats) -> Floats:
        """Numbers as rows without derivatives."""
        rows = np.zeros((len(values), (1 + self.directions) * self.samples))
        rows[:, : self.samples] = values[:, None]
        return rows

    def linear(self, weights: Weights, constants: Floats, values: Floats) -> Floats:
        """The sums of values and of derivatives; numbers have none."""
        rows = np.asarray(weights @ values)
        rows[:, : self.samples] += constants[:, None]
        return rows

    def product(self, a: Floats, b: Floats) -> Floats:
        """(a b)' = a' b + a b'."""
        a, b = self._apart(a), self._apart(b)
        out = a * b[:, :1] + a[:, :1] * b
        out[:, 0] = a[:, 0] * b[:, 0]
        return out.reshape(len(out), -1)

    def power(self, a: Floats, exponents: Floats) -> Floats:
        """(aᵖ)' = p aᵖ⁻¹ a'; 0 of the zeroth power, NaN outside the domain."""
        a, p = self._apart(a), exponents[:, None]
        with np.errstate(all="ignore"):
            value = np.power(a[:, 0], p)
            slope = np.where(p == 0.0, 0.0, p * np.power(a[:, 0], p - 1.0))
            return self._chained(value, slope, a)

    def wave(self, a: Floats, quarters: Ints) -> Floats:
        """sin' = cos."""
        a = self._apart(a)
        turned = a[:, 0] + 0.5 * np.pi * quarters[:, None]
        return self._chained(Samples().wave(a[:, 0], quarters), np.cos(turned), a)

    def exponential(self, a: Floats) -> Floats:
        """exp' = exp."""
        a = self._apart(a)
        value = Samples().exponential(a[:, 0])
        return self._chained(value, value, a)

    def solve(self, A: Floats, B: Floats, n: int) -> Floats:
        """X' = A⁻¹ (B' − A' X)."""
        A, B = self._apart(A), self._apart(B)
        X = Samples().solve(A[:, 0], B[:, 0], n)
        parts, m = [X], len(B) // n
        by_sample = X.reshape(n, m, -1)
        for k in range(1, A.shape[1]):
            moved = np.einsum("ijs,jms->ims", A[:, k].reshape(n, n, -1), by_sample)
            parts.append(Samples().solve(A[:, 0], B[:, k] - moved.reshape(n * m, -1), n))
        return np.concatenate(parts, axis=1)

    def _apart(self, rows: Floats) -> Floats:
        """(k, 1 + n_directions, n)."""
        return rows.reshape(len(rows), 1 + self.directions, self.samples)

    def _chained(self, value: Floats, slope: Floats, a: Floats) -> Floats:
        out = np.where(a == 0.0, 0.0, slope[:, None] * a)
        out[:, 0] = value
        return out.reshape(len(out), -1)


@dataclass(frozen=True)
class Truncated:
    """Power series truncated to ``space``."""

    space: LowerSet

    def constant(self, values: Floats) -> Floats:
        """(n,) → (n, N): the constant series."""
        rows = np.zeros((len(values), len(self.space)))
        rows[:, 0] = values
        return rows

    def linear(self, weights: Weights, constants: Floats, values: Floats) -> Floats:
        """The sum of each coefficient; numbers enter the constant terms."""
        rows = np.asarray(weights @ values)
        rows[:, 0] += constants
        return rows

    def product(self, a: Floats, b: Floats) -> Floats:
        """Cauchy product over the set."""
        return multiply(self.space, a, b)

    def power(self, a: Floats, exponents: Floats) -> Floats:
        """Binomial series about the constant terms, one exponent a row."""
        out = np.empty_like(a)
        for exponent in np.unique(exponents):
            rows = exponents == exponent
            taylor = power_taylor(a[rows, 0], float(exponent), self.space.order)
            out[rows] = compose(self.space, taylor, a[rows])
        return out

    def wave(self, a: Floats, quarters: Ints) -> Floats:
        """Sine or cosine of each series."""
        return compose(self.space, wave_taylor(a[:, 0], quarters, self.space.order), a)

    def exponential(self, a: Floats) -> Floats:
        """Exponential of each series."""
        return compose(self.space, exponential_taylor(a[:, 0], self.space.order), a)

    def solve(self, A: Floats, B: Floats, n: int) -> Floats:
        """Chord steps X ← X + A_0⁻¹ (B − A X), each of which gains one degree."""
        m, size = len(B) // n, len(self.space)
        inverse = np.linalg.inv(A[:, 0].reshape(n, n))
        right = B.reshape(n, m * size)
        X = inverse @ right
        for _ in range(self.space.order):
            product = matrix_product(self.space, A.reshape(n, n, size), X.reshape(n, m, size))
            X = X + inverse @ (right - product.reshape(n, -1))
        return np.asarray(X.reshape(n * m, size))
