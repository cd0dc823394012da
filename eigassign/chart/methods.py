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

from eigassign.chart.question import Bench, Points
from eigassign.chart.timing import timed
from eigassign.errors import AccuracyError, UsageError
from eigassign.modal.exact.condensation import condense
from eigassign.modal.expansion import NearestExpansion, expand
from eigassign.modal.fit.fit import fit
from eigassign.modal.fit.region import Box
from eigassign.modal.model import Model
from eigassign.modal.reduced.model import ReducedModel
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


@dataclass(frozen=True)
class Method:
    """A way to the frequencies, which `build` sets up from its ``parameters`` alone."""

    name: str
    family: str
    parameters: Mapping[str, Any]

    @property
    def ours(self) -> bool:
        """True of what eigassign offers; the others are what people do without it."""
        return self.family.startswith(("Taylor", "1/λ", "reduced", "fit")) or self.family == "exact"

    @property
    def per_design(self) -> bool:
        """True where it is set up anew for each design, which is a cost of the evaluation."""
        return self.family.startswith("stations") or self.family.endswith("one trajectory")


# --- The list, in the order in which they are charted


def list_methods(bench: Bench, accuracies: Sequence[float]) -> Iterator[Method]:
    """The list of all methods; no training takes more exact solves than the time allows."""
    model = bench.scene.model
    kind = "dense" if model.pencil.is_dense else "sparse"
    yield Method(f"exact {kind}", "exact", {"solver": f"{kind}, in batches"})
    # one sample at a time, and few: about 20 n³ operations each at 6e9 a second
    if few := min(40, int(3e8 * bench.effort.most_s / model.n_dof**3)):
        told = {"solver": "scipy.linalg.eigh, subset by index", "points": few}
        yield Method("exact dense, SciPy one by one", "exact by others", told)
    yield from _series(bench)
    yield from _auto(bench, accuracies)
    yield from _reduced_models(bench)
    yield from _fits(bench)
    yield from _surrogates(bench)


def _about(bench: Bench, count: int) -> tuple[Floats, Floats, str]:
    """Points q, y to expand about, the case's own or spread along the trajectory; and how many."""
    full, path = bench.scene.expansions.full, bench.scene.path.q
    q = full.q0[None] if count == 1 else path[spread_samples(path, count)]
    return q, np.tile(full.y0, (len(q), 1)), f"{len(q)} point{'s' if len(q) > 1 else ''}"


def _series(bench: Bench) -> Iterator[Method]:
    """λ and 1/λ expanded to each order, in full and linearised; λ in full at several points too."""
    effort, full = bench.effort, bench.scene.expansions.full
    n = int(bench.scene.model.pencil.active.sum())
    wanted = sorted({*effort.orders, bench.scene.expansions.order})
    orders = [p for p in wanted if comb(n + p, p) <= effort.coefficients]
    for symbol, linear, order in product(("Taylor", "1/λ"), (False, True), orders):
        kind = "linearised" if linear else "full"
        told = {"order": order, "linear_in_y": linear, "q0": full.q0, "y0": full.y0}
        yield Method(f"{symbol} {order} {kind}", f"{symbol}, {kind}", told)
    for count, order in product(effort.expansion_points[1:], orders[1:]):
        q, y, where = _about(bench, count)
        told = {"order": order, "q0": q, "y0": y}
        yield Method(f"Taylor {order} at {where}", "Taylor, several points", told)


def _auto(bench: Bench, accuracies: Sequence[float]) -> Iterator[Method]:
    """What ``expansion.order: auto`` takes, by the very function that a run asks.

    The loosest accuracy first; after a choice that takes too long no other is made.
    """
    scene, full, spent = bench.scene, bench.scene.expansions.full, 0.0
    told: dict[str, Any]
    for accuracy in sorted(accuracies, reverse=True):
        expansion = scene.file.expansion.model_copy(update={"accuracy": accuracy})
        case = replace(scene.file, expansion=expansion), scene.model, scene.trajectory
        name = f"auto {accuracy:.0e}"
        try:
            if spent > bench.effort.most_s:
                raise AccuracyError(f"choosing took {spent:.1f} s before")
            choice, spent = timed(partial(choose_order, *case, full.q0, full.y0, full.modes))
        except AccuracyError as error:
            yield Method(name, "Taylor, auto", {"refused": str(error)})
            continue
        q = np.vstack([choice.q0, *choice.more_q])
        told = {"order": choice.order, "cluster_gap": choice.cluster_gap, "accuracy": accuracy}
        told |= {"q0": q, "y0": np.tile(full.y0, (len(q), 1)), "choosing_s": spent}
        name += f": Taylor {choice.order}{f' at {len(q)} points' if len(q) > 1 else ''}"
        yield Method(name, "Taylor, auto", told)


def _reduced_models(bench: Bench) -> Iterator[Method]:
    """Reduced models of each half order m at one or several points; at one without guards too."""
    kinds = [*((count, True) for count in bench.effort.expansion_points), (1, False)]
    for (count, guard), m in product(kinds, bench.effort.half_orders):
        q, y, where = _about(bench, count)
        name, family = f"reduced m = {m}, {where}", f"reduced, {where}"
        if not guard:
            name, family = f"{name}, no guard", "reduced, no guard"
        yield Method(name, family, {"half_order": m, "guard": guard, "q": q, "y": y})


def _fits(bench: Bench) -> Iterator[Method]:
    """Fits of given solves and to accuracies, of as many exact solves as the time allows.

    Along the trajectory for each design, and over trajectory × box; there of reduced models too.
    """
    most, moves = bench.most_solves, bench.place is not None
    told: dict[str, Any]
    for k in [k for k in SOLVES if k <= most]:
        name, family, told = f"fit of {k} solves", "fit of given solves", {"solves": k}
        if k <= 25 and moves:
            yield Method(f"{name} along", f"{family}, one trajectory", told)
        if k >= 9:
            yield Method(name, family, told)
    for a in bench.effort.accuracies:
        name, family, told = f"fit {a:.0e}", "fit to an accuracy", {"accuracy": a, "most": most}
        if moves:
            yield Method(f"{name} along", f"{family}, one trajectory", told)
        yield Method(name, family, told)
    for (m, count), a in product(bench.effort.fitted, bench.effort.accuracies):
        q, y, where = _about(bench, count)
        of, told = f"of reduced m = {m}, {where}", {"accuracy": a, "half_order": m, "q": q, "y": y}
        yield Method(f"fit {a:.0e} {of}", f"fit {of}", told)


def _surrogates(bench: Bench) -> Iterator[Method]:
    """Interpolation between stations and on grids, and fits to spread-out points."""
    effort, most, features = bench.effort, bench.most_solves, bench.names
    for k, kind in product(effort.stations, KINDS if bench.place is not None else ()):
        if k <= most and (kind != "Chebyshev" or k <= 20):  # of a higher degree: ill-conditioned
            told = {"interpolation": kind, "stations": k}
            yield Method(f"stations {kind} {k}", f"stations, {kind}", told)
    for k, kind in product(effort.nodes, KINDS):
        if k ** len(features) <= most and (kind != "cubic" or k >= 4):
            told = {"nodes": k, "features": features, "interpolation": kind}
            yield Method(f"grid {kind} {k}", f"grid, {kind}", told)
    counts = sorted({min(k, most) for k in effort.training})
    for n, (family, _, how) in product(counts, list(surrogate_families())):
        told = {**how, "training_points": n, "features": features}
        yield Method(f"{family.replace(',', '')} {n}", family, told)


# --- How they are asked for, and set up


def use_of(bench: Bench, method: Method) -> str:
    """How to ask for a method: a line of a case file, or a call; empty of those by others."""
    family, p, modes = method.family, method.parameters, bench.scene.expansions.modes

    def call(function: str, arguments: str, *keys: str) -> str:
        given = {"modes": modes} if modes != (1,) else {}
        given |= {key: p[key] for key in keys if key in p}
        return f"{function}({', '.join([arguments, *(f'{k}={v!r}' for k, v in given.items())])})"

    if family == "Taylor, auto":
        return f"in the case file, expansion: {{order: auto, accuracy: {p['accuracy']:g}}}"
    if family == "Taylor, several points":
        each = call("ea.expand", "model, q, y", "order")
        return f"[{each} for q, y in zip(q0, y0)], at a pose the one whose q is nearest"
    if family.startswith("Taylor"):
        return f"in the case file, expansion: {{order: {p['order']}}}"
    if family.startswith("1/λ"):
        linear = ("linear_in_y",) * p["linear_in_y"]
        return f"{call('ea.expand', 'model, q0, y0', 'order', *linear)}.inverse"
    reduced = call("ea.reduce", "model, q0, y0", "half_order")
    if family == "reduced, no guard":
        function = "no argument of ea.reduce: eigassign.modal.reduced.reduce.reduce"
        return call(function, "model.pencil, q0, y0", "half_order", "guard")
    if family.startswith("reduced"):
        return reduced
    if method.per_design and method.ours:
        return call("ea.fit", "model, q, y", "solves", "accuracy", "most")
    if family.startswith("fit"):
        over = f"{reduced if 'half_order' in p else 'model'}, q, ea.Box(lower, upper)"
        return f"{call('ea.fit', over, 'solves', 'accuracy', 'most')}.along(designs)"
    return ""


@dataclass(frozen=True, eq=False)
class Built:
    """A method that is set up: points → Hz (n, n_modes)."""

    evaluate: Callable[[Points], Floats]
    solves: int = 0  # exact ones of the set-up
    estimate: float | None = None  # of its error by the method itself, relative in Hz
    along: Callable[[Floats], Floats] | None = None  # of fits: many designs on whole trajectories


def builder(bench: Bench, method: Method) -> Callable[[Floats], Built]:
    """The set-up of a method, a function of the design y (n_y,) where each has its own."""
    family, scene = method.family, bench.scene
    if family == "exact":
        return lambda _: Built(bench.exact)
    if family == "exact by others":
        return lambda _: Built(partial(by_scipy, scene.model, scene.expansions.modes))
    if not method.ours:
        return _trained(bench, method)
    series = family.startswith(("Taylor", "1/λ"))
    return partial(_expanded if series else _reduced_or_fitted, bench, method)


def _answering(made: Any, solves: int, **more: Any) -> Built:
    return Built(lambda points: made.frequencies(points.q, points.y), solves, **more)


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


def _expanded(bench: Bench, method: Method, _: Floats) -> Built:
    """λ about one or several points, of which the nearest answers, or 1/λ about one."""
    pencil, modes, p = bench.scene.model.pencil, bench.scene.expansions.modes, method.parameters
    if why := p.get("refused"):
        raise AccuracyError(why)
    how = {key: p[key] for key in ("order", "linear_in_y", "cluster_gap") if key in p}
    points = zip(np.atleast_2d(p["q0"]), np.atleast_2d(p["y0"]), strict=True)
    parts = tuple(expand(pencil, q0, y0, modes, **how) for q0, y0 in points)
    made = parts[0].inverse if method.family.startswith("1/λ") else NearestExpansion(parts)
    return _answering(made, len(parts))


def _reduced_or_fitted(bench: Bench, method: Method, y: Floats) -> Built:
    """A reduced model; or a fit of it, or of the model, over the box or at one design."""
    scene, modes, p = bench.scene, bench.scene.expansions.modes, method.parameters
    source: Model | ReducedModel = scene.model
    solves = 0
    if (m := p.get("half_order")) is not None:
        pencil, guard = scene.model.pencil, p.get("guard", True)
        source = reduce(pencil, p["q"], p["y"], modes, m, guard)
        # for modes, wanted vectors, and vectors of guards
        others = set(range(1, min(max(modes) + 1, len(pencil.elastic)) + 1)) - set(modes)
        solves = (3 if guard and others and m >= 2 else 2) * len(p["q"])
    if method.family.startswith("reduced"):
        return _answering(source, solves)
    over = y if method.per_design else Box(bench.lower, bench.upper)
    how = {key: p[key] for key in ("solves", "accuracy", "most") if key in p}
    made = fit(source, scene.path, over, modes, **how)
    along = None if method.per_design else made.along
    return _answering(made, solves or made.solves, estimate=made.error_estimate, along=along)


def _trained(bench: Bench, method: Method) -> Callable[[Floats], Built]:
    """Trained on exact solves at the samples nearest to training points, each once."""
    p, d = method.parameters, 1 if method.per_design else len(bench.names)
    if kind := p.get("interpolation"):
        learn: Learn = partial(grid_interpolation, kind)
        u = grid_points(kind, p.get("stations") or p["nodes"], d)
    else:
        learn = {family: learn for family, learn, _ in surrogate_families()}[method.family]
        u = spread_points(p["training_points"], d)
    near = bench.nearest(np.pad(u, ((0, 0), (0, len(bench.names) - d))))

    def build(y: Floats) -> Built:
        at = replace(near, y=np.tile(y, (len(near), 1))) if method.per_design else near
        try:
            made = learn(at.u[:, :d], bench.exact(at))
        except (ValueError, np.linalg.LinAlgError) as error:  # too few points, or all in a plane
            raise UsageError(f"{method.family}: {error}") from error
        return Built(lambda points: made(points.u[:, :d]), len(at))

    return build


# --- Interpolation and regression on the unit box


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
        raise ValueError(f"{len(space)} coefficients from {len(u)} training points")
    coefficients = np.linalg.lstsq(monomials(space, 2.0 * u - 1.0), f, rcond=None)[0]
    return lambda u: monomials(space, 2.0 * u - 1.0) @ coefficients


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
        yield name, partial(RBFInterpolator, kernel=kernel), {"kernel": kernel}
    try:  # here, or the first fit would be charged for the import
        import sklearn.gaussian_process  # noqa: F401
    except ImportError:
        return
    yield "Kriging", kriging, {"kernel": "squared exponential", "by": "scikit-learn"}


def spread_points(count: int, d: int) -> Floats:
    """Training points (count, d): the corners where they are few, then the R_d sequence.

    u_k = (1/2 + k α) mod 1 with α_i = g^-i, g^(d+1) = g + 1 (Roberts 2018). SciPy's Halton and
    Sobol points left quintic RBF on the paper's arm 1.8 and 1.7 times as far off at 125 points.
    """
    corners = list(product((0.0, 1.0), repeat=d)) if 3 * 2**d <= count else []
    g = max(np.roots([1.0, *np.zeros(d - 1), -1.0, -1.0]).real)
    k = np.arange(1, count - len(corners) + 1)[:, None]
    inside = (0.5 + k * g ** -np.arange(1.0, d + 1.0)) % 1.0
    return np.vstack([np.array(corners).reshape(-1, d), inside])
