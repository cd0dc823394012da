"""Surrogates of f(u) on the unit box from its values at training points: what people fit.

Every fit takes u (n, d) in [0, 1] and f (n, n_modes) and gives a function of u (k, d) that returns
(k, n_modes). Kriging is in `surrogates_kriging`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache
from itertools import product
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import UsageError
from eigassign.series.evaluation import polynomials
from eigassign.series.lower_set import total_degree
from eigassign.series.newton import spread_steps
from eigassign.series.power_series import monomials
from eigassign.study.surrogates_lines import (
    Separable,
    polynomial_lines,
    spline_lines,
    tensor_lines,
)

Floats = NDArray[np.float64]
Surrogate = Callable[[Floats], Floats]
BLOCK = 1024  # points at once: what they need stays in the cache


def spread_points(count: int, d: int) -> Floats:
    """Training points (count, d): the corners where they are few, then the R_d sequence.

    u_k = (1/2 + k α) mod 1 fills the box evenly for every count.
    """
    corners = (
        np.array(list(product((0.0, 1.0), repeat=d))) if 3 * 2**d <= count else np.zeros((0, d))
    )
    k = np.arange(1, count - len(corners) + 1)[:, None]
    inside = (0.5 + k * spread_steps(d)) % 1.0
    return np.vstack([corners, inside])


def grid_points(nodes: Floats, d: int) -> Floats:
    """The tensor grid of ``nodes`` (k,) in d dimensions, (k^d, d), the last varying fastest."""
    mesh = np.meshgrid(*[nodes] * d, indexing="ij")
    return np.stack([axis.ravel() for axis in mesh], axis=1)


def equal_nodes(k: int) -> Floats:
    """k nodes from 0 to 1."""
    return np.linspace(0.0, 1.0, k)


def chebyshev_nodes(k: int) -> Floats:
    """The k extrema of the Chebyshev polynomial of degree k − 1, ends included, on [0, 1]."""
    return np.asarray(0.5 - 0.5 * np.cos(np.pi * np.arange(k) / (k - 1)))


def response_surface(u: Floats, f: Floats, degree: int) -> Separable:
    """Least squares over all monomials up to total ``degree``."""
    space = total_degree(u.shape[1], degree)
    if len(space) > len(u):
        raise UsageError(f"{len(space)} coefficients from {len(u)} training points")
    beta = np.linalg.lstsq(monomials(space, 2.0 * u - 1.0), f, rcond=None)[0]
    coefficients = np.asarray(beta.T, dtype=np.float64)
    made = polynomials(space, coefficients)
    return Separable(lambda at: made(2.0 * at - 1.0), polynomial_lines(space, coefficients))


Kernel = Literal["thin_plate_spline", "quintic"]


def radial_basis(u: Floats, f: Floats, kernel: Kernel) -> Surrogate:
    """SciPy's radial basis functions with the polynomial that the kernel asks for."""
    from scipy.interpolate import RBFInterpolator

    try:
        interpolant = RBFInterpolator(u, f, kernel=kernel)
    except (ValueError, np.linalg.LinAlgError) as error:
        raise UsageError(f"radial basis functions: {error}") from error
    return lambda at: np.asarray(interpolant(at))


def grid_interpolation(k: int, d: int, f: Floats, cubic: bool) -> Separable:
    """Linear or cubic-spline interpolation on the grid of `equal_nodes`; f (k^d, n_modes)."""
    values = f.reshape(*([k] * d), f.shape[1])
    if cubic:
        return _tensor_spline(k, d, values)
    from scipy.interpolate import RegularGridInterpolator

    axes = tuple(equal_nodes(k) for _ in range(d))
    # rounding may put a point an ulp beyond the last node
    interpolant = RegularGridInterpolator(axes, values, bounds_error=False, fill_value=None)
    knots = np.concatenate([[0.0], axes[0], [1.0]])
    return Separable(lambda at: np.asarray(interpolant(at)), spline_lines(knots, 1, values))


def _tensor_spline(k: int, d: int, values: Floats) -> Separable:
    """Spline coefficients axis by axis, solved directly: SciPy's own grid solver is iterative."""
    from scipy.interpolate import NdBSpline, make_interp_spline

    knots, coefficients = equal_nodes(k), values
    for axis in range(d):
        spline = make_interp_spline(equal_nodes(k), coefficients, k=3, axis=axis)
        knots, coefficients = spline.t, np.moveaxis(spline.c, 0, axis)
    made = NdBSpline((knots,) * d, np.ascontiguousarray(coefficients), 3)
    return Separable(lambda at: np.asarray(made(at)), spline_lines(knots, 3, coefficients))


def chebyshev(k: int, d: int, f: Floats) -> Separable:
    """The tensor polynomial through f (k^d, n_modes) on the grid of `chebyshev_nodes`."""
    coefficients = _coefficients([k] * d, f)

    def anywhere(at: Floats) -> Floats:
        blocks = (at[i : i + BLOCK] for i in range(0, len(at), BLOCK))
        return np.concatenate([_tensor_polynomial(coefficients, block) for block in blocks])

    return Separable(anywhere, tensor_lines(lambda u: _polynomials(u, k), coefficients))


def _coefficients(sizes: Sequence[int], f: Floats) -> Floats:
    """Of the Chebyshev series, (k_0, k_1, …, n_modes)."""
    coefficients = f.reshape(*sizes, f.shape[1])
    for axis, k in enumerate(sizes):
        made = np.tensordot(_inverse_cosines(k), coefficients, (1, axis))
        coefficients = np.moveaxis(made, 0, axis)
    return coefficients


@lru_cache(maxsize=64)
def _inverse_cosines(k: int) -> Floats:
    """From values at the k nodes to coefficients of T_0 … T_{k−1}."""
    cosines = np.cos(np.pi * np.outer(np.arange(k), np.arange(k)) / max(k - 1, 1))[::-1]
    return _frozen(np.linalg.inv(cosines))


def _tensor_polynomial(coefficients: Floats, u: Floats) -> Floats:
    """Σ c_ij… T_i(u_0) T_j(u_1) …, contracted one variable at a time."""
    sizes, modes = coefficients.shape[:-1], coefficients.shape[-1]
    values = _polynomials(u[:, 0], sizes[0]) @ coefficients.reshape(sizes[0], -1)
    for j in range(1, u.shape[1]):
        left = values.reshape(len(u), sizes[j], -1)
        values = np.matmul(_polynomials(u[:, j], sizes[j])[:, None, :], left)[:, 0]
    return np.asarray(values.reshape(len(u), modes))


def _polynomials(u: Floats, k: int) -> Floats:
    """T_0 … T_{k−1} at 2u − 1, (n, k)."""
    return np.asarray(np.polynomial.chebyshev.chebvander(2.0 * u - 1.0, k - 1), dtype=np.float64)


def _frozen(table: Floats) -> Floats:
    """Shared by all who ask again."""
    table.setflags(write=False)
    return table


def along(place: Floats, f: Floats, cubic: bool) -> Surrogate:
    """One variable: linear or cubic-spline interpolation of f (k, n_modes) at ``place`` (k,)."""
    if cubic:
        from scipy.interpolate import CubicSpline

        spline = CubicSpline(place, f)
        return lambda at: np.asarray(spline(at[:, 0]))
    return lambda at: np.column_stack([np.interp(at[:, 0], place, column) for column in f.T])
