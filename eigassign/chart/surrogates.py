"""Interpolation and regression on the unit box: SciPy's, NumPy's and scikit-learn's.

Every fit takes training points u (n, d) in [0, 1] with values f (n, n_modes), and gives a function
of points u (k, d) that returns (k, n_modes).
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from functools import partial
from itertools import product
from typing import Any

import numpy as np
from numpy.polynomial.chebyshev import chebvander
from numpy.typing import NDArray
from scipy.interpolate import NdBSpline, RBFInterpolator, make_interp_spline

from eigassign.errors import UsageError
from eigassign.series.multi_index import total_degree
from eigassign.series.power_series import monomials

Floats = NDArray[np.float64]
Surrogate = Callable[[Floats], Floats]
FitSurrogate = Callable[[Floats, Floats], Surrogate]
KINDS = ("linear", "cubic", "Chebyshev")


def nodes(kind: str, k: int) -> Floats:
    """k nodes on [0, 1] with both ends: even, or the extrema of a Chebyshev polynomial."""
    even = np.linspace(0.0, 1.0, k)
    return np.asarray(0.5 - 0.5 * np.cos(np.pi * even)) if kind == "Chebyshev" else even


def grid_interpolation(kind: str, u: Floats, f: Floats) -> Surrogate:
    """Through f on a tensor grid: linear, by cubic splines, or by Chebyshev polynomials."""
    axes = [np.unique(column) for column in u.T]
    shape = [len(axis) for axis in axes]
    table = np.empty((*shape, f.shape[1]))
    table[tuple(np.searchsorted(axis, column) for axis, column in zip(axes, u.T, strict=True))] = f
    if kind != "Chebyshev":
        degrees, knots = [1 if kind == "linear" else min(3, n - 1) for n in shape], []
        for k, axis in enumerate(axes):
            spline = make_interp_spline(axis, table, k=degrees[k], axis=k)
            knots.append(spline.t)
            table = np.moveaxis(spline.c, 0, k)
        return NdBSpline(tuple(knots), np.ascontiguousarray(table), tuple(degrees))
    for k, axis in enumerate(axes):
        inverse = np.linalg.inv(chebvander(2.0 * axis - 1.0, len(axis) - 1))
        table = np.moveaxis(np.tensordot(inverse, table, (1, k)), 0, k)

    def evaluate(u: Floats) -> Floats:
        value = np.tensordot(chebvander(2.0 * u[:, 0] - 1.0, shape[0] - 1), table, 1)
        for k in range(1, len(shape)):
            value = np.einsum(
                "nk,nk...->n...", chebvander(2.0 * u[:, k] - 1.0, shape[k] - 1), value
            )
        return value

    # what a thousand points need stays in the cache
    return lambda u: np.vstack([evaluate(u[i : i + 1000]) for i in range(0, len(u), 1000)])


def response_surface(degree: int, u: Floats, f: Floats) -> Surrogate:
    """Least squares over all monomials of 2u − 1 up to total ``degree``."""
    space = total_degree(u.shape[1], degree)
    if len(space) > len(u):
        raise UsageError(f"{len(space)} coefficients from {len(u)} training points")
    coefficients = np.linalg.lstsq(monomials(space, 2.0 * u - 1.0), f, rcond=None)[0]
    return lambda u: monomials(space, 2.0 * u - 1.0) @ coefficients


def radial_basis(kernel: Any, u: Floats, f: Floats) -> Surrogate:
    """Radial basis functions with the polynomial that the kernel asks for."""
    try:
        return RBFInterpolator(u, f, kernel=kernel)
    except (ValueError, np.linalg.LinAlgError) as error:
        raise UsageError(f"radial basis functions: {error}") from error


def kriging(u: Floats, f: Floats) -> Surrogate:
    """A Gaussian process with one length scale for each variable."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel

    kernel = ConstantKernel(1.0, (1e-3, 1e6)) * RBF(np.ones(u.shape[1]), (1e-2, 1e2))
    process = GaussianProcessRegressor(
        kernel, alpha=1e-10, normalize_y=True, n_restarts_optimizer=1, random_state=1
    )
    with warnings.catch_warnings():  # of length scales at their bounds
        warnings.simplefilter("ignore")
        process.fit(u, f)
    return lambda u: process.predict(u).reshape(len(u), -1)


def surrogate_families() -> Iterator[tuple[str, FitSurrogate, dict[str, Any]]]:
    """Family, fit and parameters; Kriging where scikit-learn is installed."""
    for name, degree in (("quadratic", 2), ("cubic", 3)):
        yield f"response surface, {name}", partial(response_surface, degree), {"degree": degree}
    for kernel in ("thin_plate_spline", "quintic"):
        name = f"RBF, {kernel.replace('_', ' ')}"
        yield name, partial(radial_basis, kernel), {"kernel": kernel}
    try:  # here, or the first fit would be charged for the import
        import sklearn.gaussian_process  # noqa: F401
    except ImportError:
        return
    yield "Kriging", kriging, {"kernel": "squared exponential", "by": "scikit-learn"}


def spread_points(count: int, d: int) -> Floats:
    """Training points (count, d): the corners where they are few, then the R_d sequence.

    u_k = (1/2 + k α) mod 1 with α_i = g^-i, g^(d+1) = g + 1, fills the box evenly for every count
    (Roberts 2018).
    """
    corners = list(product((0.0, 1.0), repeat=d)) if 3 * 2**d <= count else []
    g = max(np.roots([1.0, *np.zeros(d - 1), -1.0, -1.0]).real)
    k = np.arange(1, count - len(corners) + 1)[:, None]
    inside = (0.5 + k * g ** -np.arange(1.0, d + 1.0)) % 1.0
    return np.vstack([np.array(corners).reshape(-1, d), inside])
