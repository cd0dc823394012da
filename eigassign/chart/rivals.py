"""What people do without eigassign, trained on its exact solves so that only the idea differs.

Surrogates of f(u) on the unit box from its values at training points: what people fit.

Every fit takes u (n, d) in [0, 1] and f (n, n_modes) and gives a function of u (k, d) that returns
(k, n_modes).

Surrogates along whole trajectories of many designs: one product of matrices, as fits have it.

    f(u) = Σ_k a_k(u_0) b_k(u_1, …)

with the place u_0 along the trajectory and the design in the other variables. What is a polynomial,
a tensor of splines is of this form: the a_k at all samples are
made once, and a design needs its b_k only.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial, reduce
from importlib.util import find_spec
from itertools import product
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.interpolate import BSpline
from scipy.linalg import eigh

from eigassign.chart.methods import Evaluator, Method
from eigassign.chart.question import Features, Points
from eigassign.errors import UsageError
from eigassign.interpolation.newton import spread_steps
from eigassign.modal.exact.condensation import condense
from eigassign.modal.model import Model
from eigassign.series.multi_index import LowerSet, lower_set, total_degree
from eigassign.series.power_series import monomials, monomials_of, polynomials

# --- What people do without eigassign, trained on its exact solves so that only the idea differs

Floats = NDArray[np.float64]
MOST_NODES = 20  # of one Chebyshev polynomial along the trajectory
MOST_DENSE = 2500  # n_dof up to which a dense solve is tried


def lapack(model: Model, modes: Sequence[int], most: int) -> Method:
    """SciPy's dense generalised solver, one sample after the other."""
    count, pick = max(modes), np.array(modes) - 1
    return Method(
        "exact dense, SciPy one by one",
        "exact by others",
        False,
        {"solver": "scipy.linalg.eigh, subset by index", "points": most},
        lambda _: lambda points: lapack_frequencies(model, points.x, count)[:, pick],
        exact=True,
        most=most,
    )


def lapack_frequencies(model: Model, x: Floats, count: int) -> Floats:
    """Exact frequencies (n, count) in Hz by scipy.linalg.eigh on M_c z = μ K_E z."""
    rows = [_lapack_one(model, model.pencil.theta(each[None]), count) for each in x]
    return np.asarray(1.0 / (2.0 * np.pi * np.sqrt(np.array(rows))))


def _lapack_one(model: Model, theta: Floats, count: int) -> Floats:
    K, M = model.pencil.matrices(theta)
    elastic = model.pencil.elastic
    _, M_c = condense(M, elastic, model.pencil.rigid)
    n = len(elastic)
    K_E = K[0][np.ix_(elastic, elastic)]
    mu = eigh(M_c[0], K_E, eigvals_only=True, subset_by_index=[n - count, n - 1])
    return np.asarray(mu[::-1])


def trajectory_methods(features: Features, stations: Sequence[int], n_q: int) -> Iterator[Method]:
    """Static modal analyses at stations of the trajectory, interpolated; anew for every design."""
    if features.place is None:
        return
    for k in stations:
        for kind in ("linear", "cubic", "Chebyshev"):
            if kind == "Chebyshev" and k > MOST_NODES:
                continue
            yield Method(
                f"stations {kind} {k}",
                f"stations, {kind}",
                False,
                {"interpolation": kind, "stations": station_nodes(kind, k)},
                partial(_per_run, features, kind, k),
                partial(_stations, features, station_nodes(kind, k), n_q),
                per_design=True,
                note="solved anew for every design: answers the runs along the trajectory only",
            )


def station_nodes(kind: str, k: int) -> Floats:
    """Where along the trajectory the stations are, (k,) in [0, 1]."""
    return chebyshev_nodes(k) if kind == "Chebyshev" else equal_nodes(k)


def _stations(features: Features, nodes: Floats, n_q: int, points: Points) -> Floats:
    """x (designs · k, n_x)."""
    runs, k = points.runs(), len(nodes)
    q = features.travel(nodes)
    y = runs.x[:: len(runs.x) // runs.designs, n_q:]
    return np.hstack([np.tile(q, (len(y), 1)), np.repeat(y, k, axis=0)])


def _per_run(features: Features, kind: str, k: int, f: Floats) -> Evaluator:
    """One product for all designs: what stations contribute to each sample is the same for all."""
    by_design = f.reshape(-1, k, f.shape[1])

    def evaluate(points: Points) -> Floats:
        hz = np.matmul(station_shares(features, kind, k)[points.along], by_design)
        return np.asarray(hz.reshape(-1, f.shape[1]))

    return evaluate


@lru_cache(maxsize=64)
def station_shares(features: Features, kind: str, k: int) -> Floats:
    """What each station contributes to each sample of the trajectory, (n_t, k)."""
    assert features.place is not None
    one = chebyshev(k, 1, np.eye(k)) if kind == "Chebyshev" else None
    made = one or along(equal_nodes(k), np.eye(k), kind == "cubic")
    shares: Floats = made(features.place[:, None])
    shares.setflags(write=False)
    return shares


def grid_methods(features: Features, nodes: Sequence[int]) -> Iterator[Method]:
    """Interpolation over a grid in place and design: linear, cubic spline, Chebyshev polynomial."""
    for k in nodes:
        for kind in ("linear", "cubic", "Chebyshev"):
            if kind == "cubic" and k < 4:
                continue
            axis = chebyshev_nodes(k) if kind == "Chebyshev" else equal_nodes(k)
            yield Method(
                f"grid {kind} {k}",
                f"grid, {kind}",
                False,
                {"nodes": k, "features": features.names, "interpolation": kind},
                partial(_on_grid, features, kind, k),
                partial(_at, features, grid_points(axis, features.d)),
            )


def _on_grid(features: Features, kind: str, k: int, f: Floats) -> Evaluator:
    if kind == "Chebyshev":
        return _by_lines(features, chebyshev(k, features.d, f))
    return _by_lines(features, grid_interpolation(k, features.d, f, kind == "cubic"))


def _at(features: Features, u: Floats, _: Points) -> Floats:
    """Training points x, whatever is asked."""
    return features.x(u)


def _by_lines(features: Features, made: Separable) -> Evaluator:
    """Whole trajectories of many designs at once, as fits answer them; other points one by one."""
    if features.place is None or features.d == 1:
        return lambda points: made(points.u)
    path = Trajectory(made.lines, features.place)

    def evaluate(points: Points) -> Floats:
        n = points.n_random if points.designs else len(points.u)
        parts = [made(points.u[:n])] if n else []
        if points.designs:
            hz = path(points.u[n :: len(points.along), 1:])
            whole = len(points.along) == hz.shape[1]
            parts.append((hz if whole else hz[:, points.along]).reshape(-1, hz.shape[2]))
        return parts[0] if len(parts) == 1 else np.vstack(parts)

    return evaluate


def surrogate_methods(
    features: Features, counts: Sequence[int], kriged: Sequence[int]
) -> Iterator[Method]:
    """Surrogates fitted to the same spread-out exact solves; Kriging for the counts ``kriged``."""
    for n in counts:
        u = spread_points(n, features.d)
        yield from (_fitted(features, u, n, *each) for each in _fits(features, u))
        if n in kriged and can_krige():
            how = {"kernel": "squared exponential", "by": "scikit-learn"}
            yield _fitted(features, u, n, "Kriging", how, partial(_kriging, u))


def _fits(
    features: Features, u: Floats
) -> Iterator[tuple[str, dict[str, object], Callable[[Floats], Evaluator]]]:
    """Family, parameters and fit of the cheap surrogates."""
    for name, degree in (("quadratic", 2), ("cubic", 3)):
        yield (
            f"response surface, {name}",
            {"degree": degree},
            partial(_surface, features, u, degree),
        )
    kernels: tuple[Kernel, ...] = ("thin_plate_spline", "quintic")
    for kernel in kernels:
        yield f"RBF, {kernel}".replace("_", " "), {"kernel": kernel}, partial(_rbf, u, kernel)


def _fitted(
    features: Features,
    u: Floats,
    n: int,
    family: str,
    how: Mapping[str, object],
    fit: Callable[[Floats], Evaluator],
) -> Method:
    parameters = {**how, "training_points": n, "features": features.names}
    name = f"{family.replace(',', '')} {n}"
    return Method(name, family, False, parameters, fit, partial(_at, features, u))


def _surface(features: Features, u: Floats, degree: int, f: Floats) -> Evaluator:
    return _by_lines(features, response_surface(u, f, degree))


def _rbf(u: Floats, kernel: Kernel, f: Floats) -> Evaluator:
    """Point by point: neither kernel is a sum of products."""
    made = radial_basis(u, f, kernel)
    return lambda points: made(points.u)


def can_krige() -> bool:
    """Whether scikit-learn is installed: it is no dependency of eigassign."""
    return find_spec("sklearn") is not None


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


def _kriging(u: Floats, f: Floats) -> Evaluator:
    made = kriging(u, f)
    return lambda points: made(points.u)


# --- Surrogates of f(u) on the unit box from its values at training points: what people fit

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


# --- Surrogates along whole trajectories of many designs: one product of matrices, as fits have

Second = Floats | sparse.csr_array
Local = tuple[Floats, NDArray[np.intp]]  # values (n, p) that are not zero, and where in a row
SPARSE = 10  # a dense product is quicker up to so many times the numbers that are not zero


@dataclass(frozen=True, eq=False)
class Lines:
    """``first``: u_0 (n_t,) → (n_modes, N, n_t); ``second``: the rest (n, d − 1) → (n, N)."""

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
            out[:, :, k] = right @ table
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
