"""Surrogates along whole trajectories of many designs: one product of matrices, as fits have it.

    f(u) = Σ_k a_k(u_0) b_k(u_1, …)

with the place u_0 along the trajectory and the design in the other variables. What is a polynomial,
a tensor of splines or a squared-exponential Kriging is of this form: the a_k at all samples are
made once, and a design needs its b_k only.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, reduce

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.interpolate import BSpline

from eigassign.series.evaluation import monomials_of
from eigassign.series.lower_set import LowerSet, lower_set

Floats = NDArray[np.float64]
Second = Floats | sparse.csr_array
Local = tuple[Floats, NDArray[np.intp]]  # values (n, p) that are not zero, and where in a row
SPARSE = 10  # a dense product is quicker up to so many times the numbers that are not zero


@dataclass(frozen=True, eq=False)
class Lines:
    """``first``: u_0 (n_t,) → (n_modes, N, n_t); ``second``: the rest (n, d − 1) → (n, N).

    ``second`` is (n_modes, n, N) where the modes differ in it.
    """

    first: Callable[[Floats], Floats]
    second: Callable[[Floats], Second]


@dataclass(frozen=True, eq=False)
class Separable:
    """A surrogate that can be asked anywhere, u (n, d) → (n, n_modes), or by lines."""

    anywhere: Callable[[Floats], Floats]
    lines: Lines

    def __call__(self, at: Floats) -> Floats:
        """Point by point."""
        return self.anywhere(at)


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Lines at the samples of one trajectory; what they share is made when first asked for."""

    lines: Lines
    place: Floats  # u_0 (n_t,) of the samples

    def __call__(self, design: Floats) -> Floats:
        """(n_designs, n_t, n_modes) at designs (n_designs, d − 1)."""
        right = self.lines.second(design)
        out = np.empty((len(design), len(self.place), len(self._samples)))
        for k, table in enumerate(self._samples):
            out[:, :, k] = (right[k] if right.ndim == 3 else right) @ table
        return out

    @cached_property
    def _samples(self) -> Floats:
        return np.ascontiguousarray(self.lines.first(self.place))


def polynomial_lines(space: LowerSet, coefficients: Floats) -> Lines:
    """Σ_γ c_γ (2u − 1)^γ over ``space``, coefficients (n_modes, N)."""
    rest = np.ascontiguousarray(space.indices[:, 1:])
    tails = lower_set(rest)
    table = np.zeros((len(coefficients), len(tails), int(space.indices[:, 0].max()) + 1))
    table[:, tails.find(rest), space.indices[:, 0]] = coefficients
    powers, monomials = table.shape[2], monomials_of(tails)
    return Lines(
        lambda place: table @ np.vander(2.0 * place - 1.0, powers, increasing=True).T,
        lambda design: monomials(np.ascontiguousarray(2.0 * design.T - 1.0)).T,
    )


def tensor_lines(basis: Callable[[Floats], Floats], coefficients: Floats) -> Lines:
    """Σ c_ij… h_i(u_0) h_j(u_1) …: coefficients (k, k, …, n_modes), ``basis`` (n,) → (n, k)."""
    return Lines(lambda place: _first(basis(place), coefficients), lambda w: _rows(basis, w))


def _first(values: Floats, coefficients: Floats) -> Floats:
    """(n_modes, N, n_t)."""
    table = coefficients.reshape(len(coefficients), -1, coefficients.shape[-1])
    return np.asarray(np.moveaxis(table, 2, 0).transpose(0, 2, 1) @ values.T)


def _rows(basis: Callable[[Floats], Floats], w: Floats) -> Floats:
    """Products of the basis over all axes, (n, k^(d − 1)), the last axis varying fastest."""
    return reduce(
        lambda left, right: (left[:, :, None] * right[:, None, :]).reshape(len(w), -1),
        (basis(column) for column in w.T),
    )


def spline_lines(knots: Floats, degree: int, coefficients: Floats) -> Lines:
    """The same in B-splines, of which few are not zero at a point: sparse where that is quicker."""
    k = len(coefficients)
    return Lines(
        lambda place: _first(_dense(_local(knots, degree, place), k), coefficients),
        lambda w: _spline_rows(knots, degree, k, w),
    )


def _local(knots: Floats, degree: int, u: Floats) -> Local:
    # rounding may put a point an ulp outside
    made = BSpline.design_matrix(np.clip(u, 0.0, 1.0), knots, degree)
    shape = (len(u), degree + 1)
    return made.data.reshape(shape), made.indices.reshape(shape).astype(np.intp)


def _spline_rows(knots: Floats, degree: int, k: int, w: Floats) -> Second:
    values, where = _local(knots, degree, w[:, 0])
    for column in w.T[1:]:
        more, at = _local(knots, degree, column)
        values = (values[:, :, None] * more[:, None, :]).reshape(len(w), -1)
        where = (k * where[:, :, None] + at[:, None, :]).reshape(len(w), -1)
    count, total = values.shape[1], k ** w.shape[1]
    if total <= SPARSE * count:
        return _dense((values, where), total)
    starts = np.arange(0, values.size + 1, count)
    return sparse.csr_array((values.ravel(), where.ravel(), starts), shape=(len(w), total))


def _dense(local: Local, count: int) -> Floats:
    values, where = local
    out = np.zeros((len(values), count))
    np.put_along_axis(out, where, values, axis=1)
    return out
