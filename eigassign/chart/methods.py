"""The list of methods, in the order in which they are charted.

    exact        dense in batches, sparse, and SciPy's one by one
    Taylor, 1/λ  expanded to each order, in full and linearised in y; at several points
    auto         what ``expansion.order: auto`` takes for each accuracy
    reduced      on Taylor vectors at one or several points
    fit          of given solves or to an accuracy; along one trajectory, or over the box
    stations     exact solves at stations of the trajectory, interpolated; anew for every design
    grid         interpolation on a grid in place and design
    others       response surfaces, radial basis functions, Kriging

The last three, and SciPy's solver, are what people do without eigassign. They are trained on its
exact solves, so that only the method differs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from math import comb
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import eigh

from eigassign.chart.question import Features, Points, exact_frequencies
from eigassign.chart.surrogates import (
    KINDS,
    FitSurrogate,
    grid_interpolation,
    nodes,
    spread_points,
    surrogate_families,
)
from eigassign.chart.timing import Effort, timed
from eigassign.errors import AccuracyError
from eigassign.modal.exact.condensation import condense
from eigassign.modal.exact.sparse import solve_sparse
from eigassign.modal.expansion import NearestExpansion, expand
from eigassign.modal.fit.fit import fit
from eigassign.modal.fit.region import Box
from eigassign.modal.model import Model
from eigassign.modal.reduced.reduce import reduce
from eigassign.study.drawing import spread_samples
from eigassign.study.planning import choose_order
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]
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


def list_methods(
    scene: Scene, features: Features, effort: Effort, accuracies: Sequence[float], solve_s: float
) -> Iterator[Method]:
    """The list of all methods; no training takes more exact solves than the time allows."""
    most = most_solves(effort, solve_s)
    yield from exact_methods(scene, effort, solve_s)
    yield from expansions(scene, effort)
    yield from auto_methods(scene, accuracies, effort)
    yield from reduced_models(scene, effort)
    yield from fits(scene, features, effort, most)
    yield from stations(scene, features, [k for k in effort.stations if k <= most])
    yield from grids(scene, features, [k for k in effort.nodes if k ** len(features.names) <= most])
    yield from regressions(scene, features, sorted({min(k, most) for k in effort.training}))


def most_solves(effort: Effort, solve_s: float) -> int:
    """Exact solves of one training: a table of 20 000 numbers stays in the cache."""
    return max(4, min(20_000, int(effort.most_s / solve_s)))


def _answering(made: Any, solves: int, estimate: float | None = None) -> Built:
    return Built(lambda points: made.frequencies(points.q, points.y), solves, estimate)


def _modes(scene: Scene) -> str:
    """The charted modes as an argument of `ea.fit`, `ea.expand`, `ea.reduce`, if they need it."""
    modes = scene.expansions.modes
    return "" if modes == (1,) else f", modes={modes}"


def _points_along(scene: Scene, count: int) -> tuple[Floats, Floats]:
    """``count`` expansion points (q, y): the case's own, or spread evenly over the trajectory."""
    full, path = scene.expansions.full, scene.path.q
    q = full.q0[None] if count == 1 else path[spread_samples(path, count)]
    return q, np.tile(full.y0, (len(q), 1))


# --- Exact solves


def exact_methods(scene: Scene, effort: Effort, solve_s: float) -> Iterator[Method]:
    """Exact solvers that suit the size; those that take one sample at a time answer few."""
    model, modes = scene.model, scene.expansions.modes
    columns = np.array(modes) - 1

    def build(solve: Callable[..., Floats], _: Floats) -> Built:
        return Built(lambda points: solve(points.q, points.y, max(modes))[:, columns])

    told: dict[str, Any] = {"solver": "dense, in batches"}
    if model.pencil.is_dense:
        yield Method("exact dense", "exact", told, partial(build, model.frequencies))
    most = max(1, min(effort.random_points // 3, int(effort.most_s / solve_s / 5)))
    told, solve = {"solver": "sparse Lanczos", "points": most}, partial(sparse_frequencies, model)
    yield Method("exact sparse", "exact", told, partial(build, solve), most=most)
    # about 20 n³ operations each at 6e9 a second
    if few := min(40, int(3e8 * effort.most_s / model.n_dof**3)):
        told = {"solver": "scipy.linalg.eigh, subset by index", "points": few}
        name, build_one = "exact dense, SciPy one by one", partial(build, partial(by_scipy, model))
        yield Method(name, "exact by others", told, build_one, ours=False, most=few)


def sparse_frequencies(model: Model, q: Floats, y: Floats, count: int) -> Floats:
    """Exact frequencies (n, count) in Hz by the sparse solver, whatever the size."""
    theta = model.pencil.theta(np.hstack([q, y]))
    return np.asarray(np.sqrt(solve_sparse(model.pencil, theta, count, False).lam) / (2.0 * np.pi))


def by_scipy(model: Model, q: Floats, y: Floats, count: int) -> Floats:
    """Exact frequencies (n, count) in Hz by scipy.linalg.eigh on M_c z = μ K_E z, μ = 1/λ."""
    elastic, mu = model.pencil.elastic, np.empty((len(q), count))
    last = len(elastic) - 1
    for k, x in enumerate(np.hstack([q, y])):
        K, M = model.pencil.matrices(model.pencil.theta(x[None]))
        _, M_c = condense(M, elastic, model.pencil.rigid)
        K_E = K[0][np.ix_(elastic, elastic)]
        lowest = eigh(M_c[0], K_E, eigvals_only=True, subset_by_index=[last + 1 - count, last])
        mu[k] = lowest[::-1]
    return np.asarray(1.0 / (2.0 * np.pi * np.sqrt(mu)))


# --- Series


def _expanded(scene: Scene, q: Floats, how: Mapping[str, Any], inverse: bool, _: Floats) -> Built:
    """Expansions about q (k, n_q) at the usual design, the nearest one evaluated."""
    full, pencil = scene.expansions.full, scene.model.pencil
    made = [expand(pencil, each, full.y0, full.modes, **how) for each in q]
    return _answering(made[0].inverse if inverse else NearestExpansion(tuple(made)), len(q))


def expansions(scene: Scene, effort: Effort) -> Iterator[Method]:
    """λ and 1/λ expanded to each order, in full and linearised; λ at several points too.

    1/λ is the reciprocal of λ's series: the same coefficients, summed in another way.
    """
    n = int(scene.model.pencil.active.sum())
    wanted = sorted({*effort.orders, scene.expansions.order})
    orders = [p for p in wanted if comb(n + p, p) <= effort.coefficients]
    q0, y0 = scene.expansions.full.q0, scene.expansions.full.y0
    for inverse, linear, order in product((False, True), (False, True), orders):
        symbol, kind = "1/λ" if inverse else "Taylor", "linearised" if linear else "full"
        how: dict[str, Any] = {"order": order, "linear_in_y": linear}
        call = f"ea.expand(model, q0, y0{_modes(scene)}, order={order}"
        use = f"{call}{', linear_in_y=True' * linear}).inverse"
        if not inverse:
            use = f"in the case file, expansion: {{order: {order}}}"
        build, told = partial(_expanded, scene, q0[None], how, inverse), {"q0": q0, "y0": y0}
        yield Method(f"{symbol} {order} {kind}", f"{symbol}, {kind}", how | told, build, use)
    for count, order in product(effort.expansion_points[1:], orders[1:]):
        q, y = _points_along(scene, count)
        call = f"ea.expand(model, q, y{_modes(scene)}, order={order})"
        use = f"[{call} for q, y in zip(q0, y0)], at a pose the one whose q is nearest"
        build = partial(_expanded, scene, q, {"order": order}, False)
        name, told = f"Taylor {order} at {len(q)} points", {"q0": q, "y0": y}
        yield Method(name, "Taylor, several points", {"order": order, **told}, build, use)


def auto_methods(scene: Scene, accuracies: Sequence[float], effort: Effort) -> Iterator[Method]:
    """What ``expansion.order: auto`` takes, by the very function that a run asks.

    The loosest accuracy first; after a choice that takes too long no other is made.
    """
    full, modes, family, spent = scene.expansions.full, scene.expansions.modes, "Taylor, auto", 0.0
    for accuracy in sorted(accuracies, reverse=True):
        name = f"auto {accuracy:.0e}"
        if spent > effort.most_s:
            yield Method(name, family, {}, partial(_refused, f"choosing took {spent:.1f} s before"))
            continue
        expansion = scene.file.expansion.model_copy(update={"accuracy": accuracy})
        case = replace(scene.file, expansion=expansion), scene.model, scene.trajectory
        try:
            choice, spent = timed(partial(choose_order, *case, full.q0, full.y0, modes))
        except AccuracyError as error:
            yield Method(name, family, {}, partial(_refused, str(error)))
            continue
        q = np.vstack([choice.q0, *choice.more_q])
        how = {"order": choice.order, "cluster_gap": choice.cluster_gap}
        told = {"q0": q, "y0": np.tile(full.y0, (len(q), 1)), "choosing_s": spent}
        use = f"in the case file, expansion: {{order: auto, accuracy: {accuracy:g}}}"
        name += f": Taylor {choice.order}{f' at {len(q)} points' if len(q) > 1 else ''}"
        yield Method(name, family, how | told, partial(_expanded, scene, q, how, False), use)


def _refused(why: str, _: Floats) -> Built:
    raise AccuracyError(why)


# --- Reduced models and fits


def reduced_models(scene: Scene, effort: Effort) -> Iterator[Method]:
    """Reduced models of each half order m at one or several points; at one without guards too."""
    unguarded = "no argument of ea.reduce: eigassign.modal.reduced.reduce.reduce(model.pencil, "
    kinds = [*((count, True) for count in effort.expansion_points), (1, False)]
    for (count, guard), m in product(kinds, effort.half_orders):
        q, y = _points_along(scene, count)
        where, call = _where(len(q)), f"q0, y0{_modes(scene)}, half_order={m}"
        use = f"ea.reduce(model, {call})" if guard else f"{unguarded}{call}, guard=False)"
        name = f"reduced m = {m}, {where}{'' if guard else ', no guard'}"
        family = f"reduced, {where if guard else 'no guard'}"
        told = {"half_order": m, "guard": guard, "q": q, "y": y}

        def build(_: Floats, how: Any = (m, q, y, guard)) -> Built:
            return _answering(*_reduced(scene, *how))

        yield Method(name, family, told, build, use)


def _where(count: int) -> str:
    return f"{count} point{'s' if count > 1 else ''}"


def _reduced(scene: Scene, m: int, q: Floats, y: Floats, guard: bool = True) -> tuple[Any, int]:
    """The reduced model, and its exact solves: for modes, wanted vectors and guards' vectors."""
    modes, elastic = scene.expansions.full.modes, len(scene.model.pencil.elastic)
    others = set(range(1, min(max(modes) + 1, elastic) + 1)) - set(modes)
    solves = 3 if guard and others and m >= 2 else 2
    return reduce(scene.model.pencil, q, y, modes, m, guard), solves * len(q)


def fits(scene: Scene, features: Features, effort: Effort, most: int) -> Iterator[Method]:
    """Fits of given solves and to accuracies, of at most ``most`` exact solves each.

    Along the trajectory for each design, and over trajectory × box; there of reduced models too.
    """
    box, modes = Box(features.lower, features.upper), _modes(scene)
    given: list[dict[str, Any]] = [{"solves": k} for k in SOLVES if k <= most]
    for how in (*given, *({"accuracy": a, "most": most} for a in effort.accuracies)):
        call = ", ".join(f"{key}={value:g}" for key, value in how.items())
        k, name, kind = how.get("solves"), f"of {how.get('solves')} solves", "of given solves"
        if k is None:
            name, kind = f"{how['accuracy']:.0e}", "to an accuracy"
        if (k is None or k <= 25) and features.place is not None:
            use, build = f"ea.fit(model, q, y{modes}, {call})", partial(_fitted, scene, how, None)
            family = f"fit {kind}, one trajectory"
            yield Method(f"fit {name} along", family, how, build, use, per_design=True)
        if k is None or k >= 9:
            use = f"ea.fit(model, q, ea.Box(lower, upper){modes}, {call}).along(designs)"
            build = partial(_fitted, scene, how, box)
            yield Method(f"fit {name}", f"fit {kind}", how, build, use)
    for (m, count), accuracy in product(effort.fitted, effort.accuracies):
        q, y = _points_along(scene, count)
        of, asked = f"reduced m = {m}, {_where(len(q))}", {"accuracy": accuracy}
        call = f"ea.reduce(model, q0, y0{modes}, half_order={m})"
        use = f"ea.fit({call}, q, ea.Box(lower, upper), accuracy={accuracy:g}).along(designs)"
        told = {**asked, "half_order": m, "q": q, "y": y}
        build = partial(_fitted, scene, asked, box, (m, q, y))
        yield Method(f"fit {accuracy:.0e} of {of}", f"fit of {of}", told, build, use)


def _fitted(scene: Scene, how: Mapping[str, Any], box: Box | None, *more: Any) -> Built:
    """A fit over the box, or at one design; of the model, or of a reduced one (m, q, y)."""
    *reduced, y = more
    source, solves = _reduced(scene, *reduced[0]) if reduced else (scene.model, 0)
    made = fit(source, scene.path, y if box is None else box, scene.expansions.modes, **how)
    built = _answering(made, solves if reduced else made.solves, made.error_estimate)
    return built if box is None else replace(built, along=made.along)


# --- What people do without eigassign


def _training(features: Features, u: Floats) -> Points:
    """The points near u (n, d) that are samples of the trajectory, each once."""
    at = features.nearest(u)
    return at[np.unique(at.u, axis=0, return_index=True)[1]]


def _trained(scene: Scene, at: Points, fit_to: FitSurrogate, along: bool, y: Floats) -> Built:
    """Fitted to exact solves; ``along`` the trajectory alone, at the design y."""
    if along:
        at = Points(at.q, np.tile(y, (len(at), 1)), at.u[:, :1])
    made = fit_to(at.u, exact_frequencies(scene, at))
    return Built(lambda points: made(points.u[:, :1] if along else points.u), len(at))


def stations(scene: Scene, features: Features, counts: Sequence[int]) -> Iterator[Method]:
    """Modal analyses at stations of the trajectory, interpolated; anew for every design."""
    for k, kind in product(counts, KINDS if features.place is not None else ()):
        if kind != "Chebyshev" or k <= 20:  # a polynomial of higher degree is ill-conditioned
            u = np.pad(nodes(kind, k)[:, None], ((0, 0), (0, len(features.names) - 1)))
            fit_to, told = partial(grid_interpolation, kind), {"interpolation": kind, "stations": k}
            build = partial(_trained, scene, _training(features, u), fit_to, True)
            name, family = f"stations {kind} {k}", f"stations, {kind}"
            yield Method(name, family, told, build, ours=False, per_design=True)


def grids(scene: Scene, features: Features, counts: Sequence[int]) -> Iterator[Method]:
    """Interpolation on a grid in place and design: linear, cubic spline, Chebyshev polynomial."""
    for k, kind in product(counts, KINDS):
        if kind != "cubic" or k >= 4:
            mesh = np.meshgrid(*[nodes(kind, k)] * len(features.names), indexing="ij")
            u = np.stack([axis.ravel() for axis in mesh], axis=1)
            told = {"nodes": k, "features": features.names, "interpolation": kind}
            fit_to, at = partial(grid_interpolation, kind), _training(features, u)
            build = partial(_trained, scene, at, fit_to, False)
            yield Method(f"grid {kind} {k}", f"grid, {kind}", told, build, ours=False)


def regressions(scene: Scene, features: Features, counts: Sequence[int]) -> Iterator[Method]:
    """Surrogates fitted to ``counts`` spread-out points."""
    for n, (family, fit_to, how) in product(counts, list(surrogate_families())):
        told = {**how, "training_points": n, "features": features.names}
        at = _training(features, spread_points(n, len(features.names)))
        build = partial(_trained, scene, at, fit_to, False)
        yield Method(f"{family.replace(',', '')} {n}", family, told, build, ours=False)
