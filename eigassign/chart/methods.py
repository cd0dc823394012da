"""The methods that a chart puts side by side, in the order in which they are charted.

Interpolation between stations of the trajectory or on grids, surrogates (response surfaces, radial
basis functions, Kriging) and SciPy's eigensolver are what people do without eigassign: NumPy's,
SciPy's and scikit-learn's. They are trained on its exact solves, so that only the method differs.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from math import comb
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import NdBSpline, RBFInterpolator, make_interp_spline
from scipy.linalg import eigh
from scipy.stats.qmc import Halton

from eigassign.chart.question import Bench, Points
from eigassign.chart.timing import timed
from eigassign.errors import AccuracyError, UsageError
from eigassign.modal.exact.condensation import condense
from eigassign.modal.expansion import NearestExpansion, expand
from eigassign.modal.fit.fit import fit
from eigassign.modal.fit.region import Box
from eigassign.modal.model import Model
from eigassign.modal.reduced.reduce import reduce
from eigassign.series.multi_index import total_degree
from eigassign.series.power_series import monomials
from eigassign.study.drawing import spread_samples
from eigassign.study.planning import choose_order

Floats = NDArray[np.float64]
Surrogate = Callable[[Floats], Floats]  # points u (k, d) → (k, n_modes)
Learn = Callable[[Floats, Floats], Surrogate]  # training points u (n, d) in [0, 1], their values
KINDS = ("linear", "cubic", "Chebyshev")
SOLVES = (3, 4, 5, 6, 7, 9, 11, 13, 17, 25, 42, 60, 84, 120, 160, 220, 300, 400, 550)  # of fits


@dataclass(frozen=True, eq=False)
class Built:
    """A method that is set up: points → Hz (n, n_modes)."""

    evaluate: Callable[[Points], Floats]
    solves: int = 0  # exact ones of the set-up
    estimate: float | None = None  # of its error by the method itself, relative in Hz
    along: Callable[[Floats], Floats] | None = None  # of fits: many designs on whole trajectories


@dataclass(frozen=True)
class Method:
    """``build`` sets it up.

    With ``per_design`` that is done anew for the design y (n_y,) of each run along the trajectory,
    which counts as a cost of the evaluation. ``most`` limits the points of slow methods.
    """

    name: str
    family: str
    parameters: Mapping[str, Any]
    build: Callable[[Floats], Built]
    use: str = ""  # how to ask for it: a line of a case file, or a call
    ours: bool = True
    per_design: bool = False
    most: int | None = None


def list_methods(bench: Bench, accuracies: Sequence[float]) -> Iterator[Method]:
    """The list of all methods; no training takes more exact solves than the time allows."""
    yield from exact_methods(bench)
    yield from expansions(bench)
    yield from auto_methods(bench, accuracies)
    yield from reduced_models(bench)
    yield from fits(bench)
    yield from surrogates(bench)


# --- Exact solves


def exact_methods(bench: Bench) -> Iterator[Method]:
    """Eigassign's solver and SciPy's, which takes one sample at a time and answers few."""
    model, modes = bench.scene.model, bench.scene.expansions.modes
    kind = "dense" if model.pencil.is_dense else "sparse"
    told: dict[str, Any] = {"solver": f"{kind}, in batches"}
    yield Method(f"exact {kind}", "exact", told, lambda _: Built(bench.exact))
    # about 20 n³ operations each at 6e9 a second
    if most := min(40, int(3e8 * bench.effort.most_s / model.n_dof**3)):
        name, built = "exact dense, SciPy one by one", Built(partial(by_scipy, model, modes))
        told = {"solver": "scipy.linalg.eigh, subset by index", "points": most}
        yield Method(name, "exact by others", told, lambda _: built, ours=False, most=most)


def by_scipy(model: Model, modes: Sequence[int], points: Points) -> Floats:
    """Frequencies (n, n_modes) in Hz by scipy.linalg.eigh on M_c z = μ K_E z, μ = 1/λ."""
    elastic, mu = model.pencil.elastic, np.empty((len(points), max(modes)))
    which = [len(elastic) - max(modes), len(elastic) - 1]
    for k, x in enumerate(np.hstack([points.q, points.y])):
        K, M = model.pencil.matrices(model.pencil.theta(x[None]))
        _, M_c = condense(M, elastic, model.pencil.rigid)
        K_E = K[0][np.ix_(elastic, elastic)]
        mu[k] = eigh(M_c[0], K_E, eigvals_only=True, subset_by_index=which)[::-1]
    return np.asarray(1.0 / (2.0 * np.pi * np.sqrt(mu[:, np.array(modes) - 1])))


# --- Series, reduced models and fits


def _call(bench: Bench, function: str, arguments: str, **how: Any) -> str:
    """A call as one writes it, with the charted modes if it needs them."""
    modes = bench.scene.expansions.modes
    named = how if modes == (1,) else {"modes": modes, **how}
    return f"{function}({', '.join([arguments, *(f'{k}={v!r}' for k, v in named.items())])})"


def _answering(made: Any, solves: int, estimate: float | None = None) -> Built:
    return Built(lambda points: made.frequencies(points.q, points.y), solves, estimate)


def _about(bench: Bench, count: int) -> tuple[Floats, Floats, str]:
    """Points q, y to expand about, the case's own or spread along the trajectory; and how many."""
    full, path = bench.scene.expansions.full, bench.scene.path.q
    q = full.q0[None] if count == 1 else path[spread_samples(path, count)]
    return q, np.tile(full.y0, (len(q), 1)), f"{len(q)} point{'s' if len(q) > 1 else ''}"


def _series(
    bench: Bench, name: str, family: str, at: Sequence[Floats], use: str, **how: Any
) -> Method:
    """λ about one or several points (q, y), of which the nearest answers; if so named 1/λ."""
    pencil, modes = bench.scene.model.pencil, bench.scene.expansions.modes

    def build(_: Floats) -> Built:
        points = zip(*map(np.atleast_2d, at), strict=True)
        parts = tuple(expand(pencil, *point, modes, **how) for point in points)
        made = parts[0].inverse if name.startswith("1/λ") else NearestExpansion(parts)
        return _answering(made, len(parts))

    return Method(name, family, {**how, "q0": at[0], "y0": at[1]}, build, use)


def expansions(bench: Bench) -> Iterator[Method]:
    """λ and 1/λ expanded to each order, in full and linearised; λ in full at several points too."""
    effort, own = bench.effort, bench.scene.expansions
    n, wanted = int(bench.scene.model.pencil.active.sum()), sorted({*effort.orders, own.order})
    orders = [p for p in wanted if comb(n + p, p) <= effort.coefficients]
    for symbol, linear, order in product(("Taylor", "1/λ"), (False, True), orders):
        kind, how = "linearised" if linear else "full", {"order": order, "linear_in_y": linear}
        call, at = _call(bench, "ea.expand", "model, q0, y0", **how), (own.full.q0, own.full.y0)
        use = f"in the case file, expansion: {{order: {order}}}"
        use = f"{call}.inverse" if symbol == "1/λ" else use
        yield _series(bench, f"{symbol} {order} {kind}", f"{symbol}, {kind}", at, use, **how)
    for count, order in product(effort.expansion_points[1:], orders[1:]):
        *at, where = _about(bench, count)
        each = _call(bench, "ea.expand", "model, q, y", order=order)
        use = f"[{each} for q, y in zip(q0, y0)], at a pose the one whose q is nearest"
        name = f"Taylor {order} at {where}"
        yield _series(bench, name, "Taylor, several points", at, use, order=order)


def auto_methods(bench: Bench, accuracies: Sequence[float]) -> Iterator[Method]:
    """What ``expansion.order: auto`` takes, by the very function that a run asks."""
    scene, full, family = bench.scene, bench.scene.expansions.full, "Taylor, auto"
    for accuracy in accuracies:
        name = f"auto {accuracy:.0e}"
        expansion = scene.file.expansion.model_copy(update={"accuracy": accuracy})
        case = replace(scene.file, expansion=expansion), scene.model, scene.trajectory
        try:
            choice, spent = timed(partial(choose_order, *case, full.q0, full.y0, full.modes))
        except AccuracyError as error:
            yield Method(name, family, {}, partial(_refused, error))
            continue
        q = np.vstack([choice.q0, *choice.more_q])
        at, how = (q, np.tile(full.y0, (len(q), 1))), {"cluster_gap": choice.cluster_gap}
        use = f"in the case file, expansion: {{order: auto, accuracy: {accuracy:g}}}"
        name += f": Taylor {choice.order}{f' at {len(q)} points' if len(q) > 1 else ''}"
        made = _series(bench, name, family, at, use, order=choice.order, **how)
        yield replace(made, parameters={**made.parameters, "choosing_s": spent})


def _refused(why: AccuracyError, _: Floats) -> Built:
    raise why


def reduced_models(bench: Bench) -> Iterator[Method]:
    """Reduced models of each half order m at one or several points; at one without guards too."""
    kinds = [*((count, True) for count in bench.effort.expansion_points), (1, False)]
    for (count, guard), m in product(kinds, bench.effort.half_orders):
        q, y, where = _about(bench, count)
        name, family = f"reduced m = {m}, {where}", f"reduced, {where}"
        use = _call(bench, "ea.reduce", "model, q0, y0", half_order=m)
        if not guard:
            name, family = f"{name}, no guard", "reduced, no guard"
            function = "no argument of ea.reduce: eigassign.modal.reduced.reduce.reduce"
            use = _call(bench, function, "model.pencil, q0, y0", half_order=m, guard=False)

        def build(_: Floats, how: Any = (m, q, y, guard)) -> Built:
            return _answering(*_reduced(bench, *how))

        told = {"half_order": m, "guard": guard, "q": q, "y": y}
        yield Method(name, family, told, build, use)


def _reduced(bench: Bench, m: int, q: Floats, y: Floats, guard: bool = True) -> tuple[Any, int]:
    """The reduced model, and its exact solves: for modes, wanted vectors and guards' vectors."""
    pencil, modes = bench.scene.model.pencil, bench.scene.expansions.modes
    others = set(range(1, min(max(modes) + 1, len(pencil.elastic)) + 1)) - set(modes)
    solves = 3 if guard and others and m >= 2 else 2
    return reduce(pencil, q, y, modes, m, guard), solves * len(q)


def fits(bench: Bench) -> Iterator[Method]:
    """Fits of given solves and to accuracies, of as many exact solves as the time allows.

    Along the trajectory for each design, and over trajectory × box; there of reduced models too.
    """
    most, accuracies, over = bench.most_solves, bench.effort.accuracies, "q, ea.Box(lower, upper)"
    given: list[dict[str, Any]] = [{"solves": k} for k in SOLVES if k <= most]
    for how in (*given, *({"accuracy": a, "most": most} for a in accuracies)):
        k, name, kind = how.get("solves", 0), f"of {how.get('solves')} solves", "of given solves"
        if k == 0:
            name, kind = f"{how['accuracy']:.0e}", "to an accuracy"
        if k <= 25 and bench.place is not None:
            use, build = _call(bench, "ea.fit", "model, q, y", **how), _fitted(bench, how, False)
            family = f"fit {kind}, one trajectory"
            yield Method(f"fit {name} along", family, how, build, use, per_design=True)
        if not 0 < k < 9:
            use = f"{_call(bench, 'ea.fit', f'model, {over}', **how)}.along(designs)"
            yield Method(f"fit {name}", f"fit {kind}", how, _fitted(bench, how, True), use)
    for (m, count), a in product(bench.effort.fitted, accuracies):
        q, y, where = _about(bench, count)
        use = _call(bench, "ea.reduce", "model, q0, y0", half_order=m)
        use = f"{_call(bench, 'ea.fit', f'{use}, {over}', accuracy=a)}.along(designs)"
        build = _fitted(bench, {"accuracy": a}, True, partial(_reduced, bench, m, q, y))
        told, of = {"accuracy": a, "half_order": m, "q": q, "y": y}, f"reduced m = {m}, {where}"
        yield Method(f"fit {a:.0e} of {of}", f"fit of {of}", told, build, use)


def _fitted(
    bench: Bench, how: Mapping[str, Any], over_box: bool, source: Callable[[], Any] | None = None
) -> Callable[[Floats], Built]:
    """Fits over the box or at one design, of the model or of a ``source`` with its exact solves."""
    scene, box = bench.scene, Box(bench.lower, bench.upper)

    def build(y: Floats) -> Built:
        model, solves = (scene.model, 0) if source is None else source()
        made = fit(model, scene.path, box if over_box else y, scene.expansions.modes, **how)
        built = _answering(made, solves or made.solves, made.error_estimate)
        return replace(built, along=made.along) if over_box else built

    return build


# --- What people do without eigassign


def surrogates(bench: Bench) -> Iterator[Method]:
    """Interpolation between stations and on grids, and fits to spread-out points."""
    most, d = bench.most_solves, len(bench.names)
    for k, kind in product(bench.effort.stations, KINDS if bench.place is not None else ()):
        if k <= most and (kind != "Chebyshev" or k <= 20):  # of a higher degree: ill-conditioned
            u = np.pad(grid_points(kind, k, 1), ((0, 0), (0, d - 1)))
            name, told = f"stations {kind} {k}", {"interpolation": kind, "stations": k}
            learn = partial(grid_interpolation, kind)
            yield _trained(bench, name, f"stations, {kind}", told, learn, u, True)
    for k, kind in product(bench.effort.nodes, KINDS):
        if k**d <= most and (kind != "cubic" or k >= 4):
            told = {"nodes": k, "features": bench.names, "interpolation": kind}
            learn, u = partial(grid_interpolation, kind), grid_points(kind, k, d)
            yield _trained(bench, f"grid {kind} {k}", f"grid, {kind}", told, learn, u)
    counts = sorted({min(k, most) for k in bench.effort.training})
    for n, (family, learn, how) in product(counts, list(surrogate_families())):
        told = {**how, "training_points": n, "features": bench.names}
        name = f"{family.replace(',', '')} {n}"
        yield _trained(bench, name, family, told, learn, spread_points(n, d))


def _trained(
    bench: Bench, name: str, family: str, told: Mapping[str, Any], learn: Learn, u: Floats,
    per_design: bool = False,
) -> Method:  # fmt: skip
    """A fit to exact solves at the samples nearest to u (n, d), each once; or at their places."""
    near, d = bench.nearest(u), 1 if per_design else len(bench.names)

    def build(y: Floats) -> Built:
        at = replace(near, y=np.tile(y, (len(near), 1))) if per_design else near
        made = learn(at.u[:, :d], bench.exact(at))
        return Built(lambda points: made(points.u[:, :d]), len(at))

    return Method(name, family, told, build, ours=False, per_design=per_design)


def grid_points(kind: str, k: int, d: int) -> Floats:
    """k^d points (n, d) with the box's corners: even, or extrema of Chebyshev polynomials."""
    even = np.linspace(0.0, 1.0, k)
    axis = 0.5 - 0.5 * np.cos(np.pi * even) if kind == "Chebyshev" else even
    return np.array(list(product(axis, repeat=d)))


def grid_interpolation(kind: str, u: Floats, f: Floats) -> Surrogate:
    """Through f on a tensor grid: linear, by cubic splines, or by one polynomial along each axis.

    All are splines; that of "Chebyshev" has no knots within.
    """
    axes = [np.unique(column) for column in u.T]
    table = np.empty((*map(len, axes), f.shape[1]))
    table[tuple(np.searchsorted(axis, column) for axis, column in zip(axes, u.T, strict=True))] = f
    knots, degrees = [], []
    for k, axis in enumerate(axes):
        degree = min({"linear": 1, "cubic": 3}.get(kind, len(axis)), len(axis) - 1)
        ends = np.repeat(axis[[0, -1]], degree + 1) if degree == len(axis) - 1 else None
        spline = make_interp_spline(axis, table, degree, ends, axis=k)
        table = np.moveaxis(spline.c, 0, k)
        knots.append(spline.t)
        degrees.append(degree)
    return NdBSpline(tuple(knots), np.ascontiguousarray(table), tuple(degrees))


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


def surrogate_families() -> Iterator[tuple[str, Learn, dict[str, Any]]]:
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
    """Training points (count, d): the corners where they are few, then Halton's sequence."""
    corners = list(product((0.0, 1.0), repeat=d)) if 3 * 2**d <= count else []
    inside = Halton(d, scramble=False).random(1 + count - len(corners))[1:]  # the first is a corner
    return np.vstack([np.array(corners).reshape(-1, d), inside])
