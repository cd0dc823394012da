"""Polynomials at many points, quickly: Σ_γ a_γ x^γ with γ in a lower set.

The variables are split in two groups, x = (v, w), and with them every index, γ = (μ, ν):

    Σ_γ a_γ x^γ = Σ_ν w^ν Σ_μ v^μ A_μν ,

one product of matrices for a block of points. The monomials of a group are built degree by degree,
x^γ = x_i x^(γ − e_i), one product each.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from eigassign.series.lower_set import LowerSet, lower_set

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
BLOCK = 512  # points at once: what they need stays in the cache


@dataclass(frozen=True, eq=False)
class Monomials:
    """All x^γ of one lower set, as rows; ``steps`` hold (first, last, parents, variables)."""

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
        values = np.empty((len(x), len(self.table)))
        for i in range(0, len(x), BLOCK):
            self._block(x[i : i + BLOCK].T, values[i : i + BLOCK])
        return values

    def _block(self, x: Floats, values: Floats) -> None:
        cut = self.first.n_variables
        left, right = self.first(x[:cut]), self.second(x[cut:])
        for k, A in enumerate(self.table):
            values[:, k] = np.einsum("ij,ij->j", A @ left, right)


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


def monomials_of(space: LowerSet) -> Monomials:
    """How the monomials of a set follow from one another."""
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
