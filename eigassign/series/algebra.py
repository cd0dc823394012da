"""Truncated power series and the arithmetic of θ on numbers, slopes and series.

All functions act on stacks of series: arrays (n, N) over a :class:`LowerSet` of N members, so that
a thousand products cost one call.

To evaluate a polynomial at many points the variables are split in two groups, x = (v, w), and with
them every index, γ = (μ, ν):

    Σ_γ a_γ x^γ = Σ_ν w^ν Σ_μ v^μ A_μν ,

one product of matrices for a block of points. The monomials of a group are built degree by degree,
x^γ = x_i x^(γ − e_i), one product each.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple, Protocol, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.arrays import Bools, Floats, Ints
from eigassign.errors import SingularityError
from eigassign.series.multi_index import LowerSet, first_of_each, lower_set

CHUNK = 4_000_000  # numbers gathered at once in a product: 32 MB
SMALL_TABLE = 1_000  # pairs up to which looking for zeros costs more than it saves
MOST = 0.5  # part of all pairs of coefficients from which leaving the others out saves nothing


def multiply(space: LowerSet, a: Floats, b: Floats) -> Floats:
    """(ab)_γ = Σ_{δ ≤ γ} a_δ b_{γ-δ} for stacks a, b of shape (n, N)."""
    table = space.table
    if len(table.left) > SMALL_TABLE:
        used = [np.asarray(stack.any(axis=0)) for stack in (a, b)]
        if np.count_nonzero(used[0]) * np.count_nonzero(used[1]) < MOST * len(space) ** 2:
            return _multiply_present(space, a, b, used[0], used[1])
    return _sums(a, b, table.left, table.right, table.starts)


def _multiply_present(
    space: LowerSet, a: Floats, b: Floats, used_a: Bools, used_b: Bools
) -> Floats:
    """The product over coefficients that are there: of six_bar, order 8, in half the time."""
    table = space.table
    keep = np.flatnonzero(used_a[table.left] & used_b[table.right])
    target, result = table.target[keep], np.zeros_like(a)
    if len(keep):
        first = first_of_each(target)
        result[:, target[first]] = _sums(a, b, table.left[keep], table.right[keep], first)
    return result


def _sums(a: Floats, b: Floats, left: Ints, right: Ints, first: Ints) -> Floats:
    """Σ a_left b_right over the pairs from each ``first`` on to the next, some rows at a time."""
    rows = max(1, CHUNK // len(left))
    result = np.empty((len(a), len(first)))
    for i in range(0, len(a), rows):
        products = a[i : i + rows].take(left, axis=1)
        products *= b[i : i + rows].take(right, axis=1)
        np.add.reduceat(products, first, axis=1, out=result[i : i + rows])
    return result


def matrix_product(space: LowerSet, a: Floats, b: Floats) -> Floats:
    """Product of two series of matrices, (r, s, N) × (s, t, N) → (r, t, N)."""
    r, s, size = a.shape
    t = b.shape[1]
    left = np.broadcast_to(a[:, :, None], (r, s, t, size)).reshape(-1, size)
    right = np.broadcast_to(b[None], (r, s, t, size)).reshape(-1, size)
    products = multiply(space, left, right).reshape(r, s, t, size)
    return np.asarray(products.sum(axis=1))


def compose(space: LowerSet, taylor: Floats, a: Floats) -> Floats:
    """f(a) for stacks a (n, N), given f's own Taylor coefficients at a_0: ``taylor`` (p + 1, n).

    f(a_0 + ã) = Σ_k f_k ã^k by Horner's rule, exact because ã is nilpotent of order p + 1.
    """
    small = a.copy()
    small[:, 0] = 0.0
    result = np.asarray(taylor[-1][:, None] * small)  # small is zero where p = 0
    result[:, 0] = taylor[-2:][0]
    for coefficient in taylor[-3::-1]:
        result = multiply(space, result, small)
        result[:, 0] += coefficient
    return result


def wave_taylor(at: Floats, quarters: Ints, order: int) -> Floats:
    """Derivatives of sin(a + quarters π/2) over k!, k = 0…p: shape (p + 1, n); 1 is the cosine.

    Every derivative is a quarter turn more: sin, cos, −sin, −cos, and again.
    """
    s, c = np.sin(at), np.cos(at)
    turns = np.arange(order + 1)[:, None] + quarters
    values = np.array([s, c, -s, -c])[turns % 4, np.arange(len(at))]
    return np.asarray(values / _factorials(order))


@lru_cache(maxsize=64)
def _factorials(order: int) -> Floats:
    """k! for k = 0…p as a column."""
    return np.array([[math.factorial(k)] for k in range(order + 1)], dtype=np.float64)


def power_taylor(at: Floats, exponent: float, order: int) -> Floats:
    """Binomial coefficients of (a + h)^e: C(e, k) a^(e-k) for k = 0…p: shape (p + 1, n)."""
    rows = [np.power(at, exponent)]
    for k in range(1, order + 1):
        rows.append(rows[-1] * ((exponent - k + 1) / k) / at)
    return np.array(rows)


# --- Polynomials at many points

BLOCK = 512  # points at once: what they need stays in the cache


@dataclass(frozen=True, eq=False)
class Monomials:
    """The x^γ of one lower set as rows; ``steps`` hold (first, last, parents, variables)."""

    size: int
    n_variables: int
    steps: tuple[tuple[int, int, Ints, Ints], ...]

    def __call__(self, x: Floats) -> Floats:
        """(N, n_points) at points x (n, n_points), one row a variable."""
        rows = np.empty((self.size, x.shape[1]))
        rows[0] = 1.0
        for first, last, parents, variables in self.steps:
            np.multiply(rows[parents], x[variables], out=rows[first:last])
        return rows


@dataclass(frozen=True, eq=False)
class Polynomials:
    """Several polynomials over one set, ready to be evaluated."""

    first: Monomials  # of the leading variables
    second: Monomials
    table: Floats  # (n_polynomials, N_second, N_first)

    def __call__(self, x: Floats) -> Floats:
        """Values (n_points, n_polynomials) at displacements x (n_points, n)."""
        values, cut = np.empty((len(x), len(self.table))), self.first.n_variables
        for i in range(0, len(x), BLOCK):
            part = x[i : i + BLOCK].T
            left, right = self.first(part[:cut]), self.second(part[cut:])
            for k, A in enumerate(self.table):
                values[i : i + BLOCK, k] = np.einsum("ij,ij->j", A @ left, right)
        return values


def polynomials(space: LowerSet, coefficients: Floats) -> Polynomials:
    """Prepare ``coefficients`` (n_polynomials, N) over ``space``."""
    heads, tails, row, column = _split(space)
    table = np.zeros((len(coefficients), tails.size, heads.size))
    table[:, column, row] = coefficients
    return Polynomials(heads, tails, table)


@lru_cache(maxsize=64)
def _split(space: LowerSet) -> tuple[Monomials, Monomials, Ints, Ints]:
    """The monomials of both groups, and the place of every index in each: once for each set."""
    cut = space.n_variables // 2
    heads, row = _projection(space.indices[:, :cut])
    tails, column = _projection(space.indices[:, cut:])
    return monomials_of(heads), monomials_of(tails), row, column


def monomials(space: LowerSet, x: Floats) -> Floats:
    """x^γ for every γ of the set, at points x (n_points, n): shape (n_points, N)."""
    return monomials_of(space)(x.T).T


@lru_cache(maxsize=64)
def monomials_of(space: LowerSet) -> Monomials:
    """The products by which the monomials of a set follow from one another."""
    steps = []
    for first, last in itertools.pairwise(space.degree_starts[1:]):
        members = space.indices[first:last]
        variables = (members > 0).argmax(axis=1)
        parents = members.copy()
        parents[np.arange(len(members)), variables] -= 1
        steps.append((int(first), int(last), space.find(parents), variables))
    return Monomials(len(space), space.n_variables, tuple(steps))


def _projection(indices: NDArray[np.int64]) -> tuple[LowerSet, Ints]:
    """The set that the indices form (lower again), and the place of each in it."""
    space = lower_set(indices)
    return space, space.find(indices)


Weights = sparse.csr_array | Floats


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


class Tangents(NamedTuple):
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


class Truncated(NamedTuple):
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
        return compose(self.space, np.exp(a[:, 0]) / _factorials(self.space.order), a)

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


Algebra: TypeAlias = Samples | Tangents | Truncated  # what a program runs on: rows of numbers
