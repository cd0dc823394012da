"""Interpolation and regression on the unit box, from values at training points.

Every fit takes u (n, d) in [0, 1] and f (n, n_modes), and gives a function of u (k, d) that returns
(k, n_modes). A polynomial, and a tensor product of splines or Chebyshev polynomials, separates:

    f(u) = Σ_k a_k(u_0) b_k(u_1, …, u_{d−1})

With the place along the trajectory as u_0 and the design as the rest, the a_k at all samples are
made once, and whole trajectories of many designs are one product of matrices.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial, reduce
from itertools import product
from typing import Literal

import numpy as np
from numpy.polynomial.chebyshev import chebvander
from numpy.typing import NDArray
from scipy.interpolate import BSpline, RBFInterpolator, make_interp_spline
from scipy.sparse import csr_array

from eigassign.errors import UsageError
from eigassign.modal.fit.interpolation import spread_steps
from eigassign.series.multi_index import lower_set, total_degree
from eigassign.series.power_series import monomials, monomials_of

Floats = NDArray[np.float64]
Surrogate = Callable[[Floats], Floats]
Kind = Literal["linear", "cubic", "Chebyshev"]
KINDS: tuple[Kind, ...] = ("linear", "cubic", "Chebyshev")
BLOCK = 1024  # points at once: what they need stays in the cache
SPARSE = 10  # a dense product is quicker up to so many times the numbers that are not zero


# --- Training points


def spread_points(count: int, d: int) -> Floats:
    """Training points (count, d): the corners where they are few, then the R_d sequence.

    u_k = (1/2 + k α) mod 1 fills the box evenly for every count.
    """
    corners = list(product((0.0, 1.0), repeat=d)) if 3 * 2**d <= count else []
    k = np.arange(1, count - len(corners) + 1)[:, None]
    return np.vstack([np.array(corners).reshape(-1, d), (0.5 + k * spread_steps(d)) % 1.0])


def nodes(kind: Kind, k: int) -> Floats:
    """k nodes on [0, 1]: evenly spaced, or the extrema of the Chebyshev polynomial of degree k − 1.

    Both ends are included.
    """
    if kind == "Chebyshev":
        return np.asarray(0.5 - 0.5 * np.cos(np.pi * np.arange(k) / (k - 1)))
    return np.linspace(0.0, 1.0, k)


def grid_points(axis: Floats, d: int) -> Floats:
    """The tensor grid of ``axis`` (k,) in d dimensions, (k^d, d), the last varying fastest."""
    mesh = np.meshgrid(*[axis] * d, indexing="ij")
    return np.stack([one.ravel() for one in mesh], axis=1)


# --- What separates into place and design


@dataclass(frozen=True, eq=False)
class Separable:
    """Σ_k a_k(u_0) b_k(u_1, …): ``first`` (n,) → (n_modes, N, n), ``rest`` (n, d − 1) → (n, N)."""

    first: Callable[[Floats], Floats]
    rest: Callable[[Floats], Floats | csr_array]

    def __call__(self, u: Floats) -> Floats:
        """(n, n_modes) at points u (n, d)."""
        return np.concatenate([self._block(u[i : i + BLOCK]) for i in range(0, len(u), BLOCK)])

    def _block(self, u: Floats) -> Floats:
        b = self.rest(u[:, 1:])
        dense = b.toarray() if isinstance(b, csr_array) else b
        return np.asarray(np.einsum("mkn,nk->nm", self.first(u[:, 0]), dense))

    def along(self, place: Floats) -> Callable[[Floats], Floats]:
        """From designs (n, d − 1) to (n, n_t, n_modes) at the places (n_t,) of all samples."""
        tables = np.ascontiguousarray(self.first(place))

        def evaluate(designs: Floats) -> Floats:
            b = self.rest(designs)
            out = np.empty((len(designs), len(place), len(tables)))
            for m, table in enumerate(tables):
                out[:, :, m] = b @ table
            return out

        return evaluate


def response_surface(u: Floats, f: Floats, degree: int) -> Separable:
    """Least squares over all monomials of 2u − 1 up to total ``degree``."""
    space = total_degree(u.shape[1], degree)
    if len(space) > len(u):
        raise UsageError(f"{len(space)} coefficients from {len(u)} training points")
    coefficients = np.linalg.lstsq(monomials(space, 2.0 * u - 1.0), f, rcond=None)[0]
    rest = np.ascontiguousarray(space.indices[:, 1:])
    tails = lower_set(rest)
    table = np.zeros((f.shape[1], len(tails), degree + 1))
    table[:, tails.find(rest), space.indices[:, 0]] = coefficients.T
    evaluate = monomials_of(tails)
    return Separable(
        lambda place: table @ np.vander(2.0 * place - 1.0, degree + 1, increasing=True).T,
        lambda designs: evaluate(np.ascontiguousarray(2.0 * designs.T - 1.0)).T,
    )


def tensor_interpolation(kind: Kind, k: int, d: int, f: Floats) -> Separable:
    """Through f (k^d, n_modes) on the grid of `nodes`: linear, cubic spline, or Chebyshev."""
    values = f.reshape(*([k] * d), f.shape[1])
    if kind == "Chebyshev":
        inverse = np.linalg.inv(_chebyshev(k, nodes(kind, k)))
        for axis in range(d):
            values = np.moveaxis(np.tensordot(inverse, values, (1, axis)), 0, axis)
        return Separable(
            lambda place: _contracted(_chebyshev(k, place), values),
            lambda designs: _products(partial(_chebyshev, k), designs),
        )
    degree = 1 if kind == "linear" else min(3, k - 1)
    for axis in range(d):
        spline = make_interp_spline(nodes(kind, k), values, k=degree, axis=axis)
        knots, values = spline.t, np.moveaxis(spline.c, 0, axis)
    return Separable(
        lambda place: _contracted(_dense(*_local(knots, degree, place), k), values),
        lambda designs: _spline_products(knots, degree, k, designs),
    )


def _chebyshev(k: int, u: Floats) -> Floats:
    """T_0 … T_{k−1} at 2u − 1, (n, k)."""
    return np.asarray(chebvander(2.0 * u - 1.0, k - 1), dtype=np.float64)


def _contracted(basis: Floats, coefficients: Floats) -> Floats:
    """Σ_i h_i(u_0) c_ij…m, (n_modes, k^(d − 1), n), for the basis (n, k) at u_0."""
    table = coefficients.reshape(len(coefficients), -1, coefficients.shape[-1])
    return np.asarray(table.transpose(2, 1, 0) @ basis.T)


def _products(basis: Callable[[Floats], Floats], designs: Floats) -> Floats:
    """h_i(u_1) h_j(u_2) … at ``designs`` (n, d − 1), (n, k^(d − 1)), the last axis fastest."""
    n = len(designs)
    return reduce(
        lambda left, right: (left[:, :, None] * right[:, None, :]).reshape(n, -1),
        (basis(column) for column in designs.T),
        np.ones((n, 1)),
    )


def _local(knots: Floats, degree: int, u: Floats) -> tuple[Floats, NDArray[np.intp]]:
    """The B-splines that are not zero at u (n,), and which they are: both (n, degree + 1)."""
    # rounding may put a point an ulp outside
    made = BSpline.design_matrix(np.clip(u, 0.0, 1.0), knots, degree)
    shape = (len(u), degree + 1)
    return made.data.reshape(shape), made.indices.reshape(shape).astype(np.intp)


def _spline_products(knots: Floats, degree: int, k: int, designs: Floats) -> Floats | csr_array:
    """As `_products`, of B-splines; sparse where that is quicker."""
    values, where = np.ones((len(designs), 1)), np.zeros((len(designs), 1), dtype=np.intp)
    for column in designs.T:
        more, at = _local(knots, degree, column)
        values = (values[:, :, None] * more[:, None, :]).reshape(len(designs), -1)
        where = (k * where[:, :, None] + at[:, None, :]).reshape(len(designs), -1)
    count, total = values.shape[1], k ** designs.shape[1]
    if total <= SPARSE * count:
        return _dense(values, where, total)
    starts = np.arange(0, values.size + 1, count)
    return csr_array((values.ravel(), where.ravel(), starts), shape=(len(designs), total))


def _dense(values: Floats, where: NDArray[np.intp], count: int) -> Floats:
    out = np.zeros((len(values), count))
    np.put_along_axis(out, where, values, axis=1)
    return out


# --- What does not


def radial_basis(
    u: Floats, f: Floats, kernel: Literal["thin_plate_spline", "quintic"]
) -> Surrogate:
    """SciPy's radial basis functions with the polynomial that the kernel asks for."""
    try:
        interpolant = RBFInterpolator(u, f, kernel=kernel)
    except (ValueError, np.linalg.LinAlgError) as error:
        raise UsageError(f"radial basis functions: {error}") from error
    return lambda at: np.asarray(interpolant(at))


def has_kriging() -> bool:
    """Whether scikit-learn is installed: eigassign itself does not need it.

    It is imported here, or the first fit would be charged for the import.
    """
    try:
        import sklearn.gaussian_process  # noqa: F401
    except ImportError:
        return False
    return True


def kriging(u: Floats, f: Floats) -> Surrogate:
    """scikit-learn's Gaussian process for each column of f, one length scale a variable."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel

    kernel = ConstantKernel(1.0, (1e-3, 1e6)) * RBF(np.ones(u.shape[1]), (1e-2, 1e2))
    process = partial(
        GaussianProcessRegressor,
        kernel, alpha=1e-10, normalize_y=True, n_restarts_optimizer=1, random_state=1,
    )  # fmt: skip
    with warnings.catch_warnings():  # of length scales at their bounds
        warnings.simplefilter("ignore")
        fitted = [process().fit(u, column) for column in f.T]
    return lambda at: np.column_stack([one.predict(at) for one in fitted])
