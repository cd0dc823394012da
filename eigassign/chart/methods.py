"""What a charted method is, and those of eigassign.

In the order in which they are charted:

    exact        dense in batches, and sparse
    Taylor, 1/λ  expanded to each order, in full and linearised in y; at several points
    auto         what ``expansion.order: auto`` takes for each accuracy
    reduced      on Taylor vectors at one or several points
    fit          of given solves or to an accuracy; along one trajectory, or over the box
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.chart.question import EvaluationPoints, Features
from eigassign.chart.timing import time_in_words, timed
from eigassign.errors import AccuracyError
from eigassign.modal.exact.clusters import CLUSTER_GAP
from eigassign.modal.exact.sparse import solve_sparse
from eigassign.modal.expansion import NearestExpansion, expand
from eigassign.modal.fit.fit import MOST, Fit, PathFit, fit
from eigassign.modal.fit.region import Box
from eigassign.modal.model import Model
from eigassign.modal.reduced.model import ReducedModel
from eigassign.modal.reduced.reduce import reduce
from eigassign.study.drawing import spread_samples
from eigassign.study.planning import OrderChoice, choose_order
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]
Evaluator = Callable[[EvaluationPoints], Floats]  # → Hz (n, n_modes)
UNGUARDED = "eigassign.modal.reduced.reduce.reduce"


@dataclass(frozen=True)
class Method:
    """``build`` makes an evaluator from exact frequencies (n, n_modes) in Hz at ``train``'s points.

    A method that wants no exact frequencies has no ``train``; ``solves`` are the exact eigensolves
    inside ``build``. With ``per_design`` all is done anew for every design, and counts as a cost of
    the evaluation; ``one`` does it for a single design where ``build`` does it for each. ``most``
    limits the evaluation points of slow methods.
    """

    name: str
    family: str
    parameters: Mapping[str, Any]
    build: Callable[[Floats], Evaluator]
    train: Callable[[EvaluationPoints], Floats] | None = None  # → x (n, n_x)
    ours: bool = True
    solves: int = 0
    exact: bool = False
    per_design: bool = False
    one: Callable[[], object] | None = None
    most: int | None = None
    note: str = ""
    use: str = ""  # how to ask for it: a line of a case file, or a call


def modes_argument(scene: Scene) -> str:
    """The charted modes as an argument of `ea.fit`, `ea.expand`, `ea.reduce`, if they need it."""
    modes = scene.expansions.modes
    return "" if modes == (1,) else f", modes={modes}"


def _at_points(count: int) -> str:
    return f"{count} point{'s' if count > 1 else ''}"


# --- Exact solves


def exact_methods(model: Model, modes: Sequence[int], most: int | None) -> Iterator[Method]:
    """The exact solves that eigassign offers: dense in batches where small, and sparse."""
    count, wanted = max(modes), np.array(modes) - 1
    if model.pencil.is_dense:
        yield Method(
            "exact dense",
            "exact",
            {"solver": "dense, in batches"},
            lambda _: lambda points: model.frequencies(points.q, points.y, count)[:, wanted],
            exact=True,
        )
    yield Method(
        "exact sparse",
        "exact",
        {"solver": "sparse Lanczos", "points": most},
        lambda _: lambda points: sparse_frequencies(model, points.x, count)[:, wanted],
        exact=True,
        most=most,
    )


def sparse_frequencies(model: Model, x: Floats, count: int) -> Floats:
    """Exact frequencies (n, count) in Hz by the sparse solver, whatever the size."""
    lam = solve_sparse(model.pencil, model.pencil.theta(x), count, False).lam
    return np.asarray(np.sqrt(lam) / (2.0 * np.pi))


# --- Series


def series_methods(
    scene: Scene, orders: Sequence[int], full_orders: Sequence[int]
) -> Iterator[Method]:
    """λ and 1/λ expanded to each of ``orders``, λ in full to each of ``full_orders``.

    1/λ is the reciprocal of λ's series: the same coefficients, summed in another way.
    """
    for symbol in ("Taylor", "1/λ"):
        for linear in (False, True):
            plain = symbol == "Taylor" and not linear
            for order in full_orders if plain else orders:
                yield _series(scene, symbol, order, linear)


def _series(scene: Scene, symbol: str, order: int, linear: bool) -> Method:
    kind, point = "linearised" if linear else "full", scene.expansions.full

    def build(_: Floats) -> Evaluator:
        made = expand(scene.model.pencil, point.q0, point.y0, point.modes, order, linear)
        series = made if symbol == "Taylor" else made.inverse
        return lambda points: series.frequencies(points.q, points.y)

    line = f"in the case file, expansion: {{order: {order}}}"
    call = f"{modes_argument(scene)}, order={order}{', linear_in_y=True' * linear}"
    return Method(
        f"{symbol} {order} {kind}",
        f"{symbol}, {kind}",
        {"order": order, "linear_in_y": linear, "q0": point.q0, "y0": point.y0},
        build,
        solves=1,
        use=line if symbol == "Taylor" else f"ea.expand(model, q0, y0{call}).inverse",
    )


def points_along(scene: Scene, count: int) -> tuple[Floats, Floats]:
    """``count`` expansion points (q, y): the case's own, or spread evenly over the trajectory."""
    full = scene.expansions.full
    q = full.q0[None]
    if count > 1:
        q = scene.path.q[spread_samples(scene.path.q, count)]
    return q, np.tile(full.y0, (len(q), 1))


def piecewise_methods(
    scene: Scene, orders: Sequence[int], counts: Sequence[int]
) -> Iterator[Method]:
    """Taylor polynomials at several points of the trajectory, the nearest one evaluated."""
    for count in counts:
        q, y = points_along(scene, count)
        for order in orders:
            call = f"ea.expand(model, q, y{modes_argument(scene)}, order={order})"
            yield Method(
                f"Taylor {order} at {len(q)} points",
                "Taylor, several points",
                {"order": order, "q0": q, "y0": y},
                partial(_nearest_expansion, scene, q, y[0], order, CLUSTER_GAP),
                solves=len(q),
                use=f"[{call} for q, y in zip(q0, y0)], at a pose the one whose q is nearest",
            )


def _nearest_expansion(
    scene: Scene, q: Floats, y0: Floats, order: int, cluster_gap: float, _: Floats
) -> Evaluator:
    """Expansions about q (k, n_q) at the design y0, the nearest one evaluated."""
    pencil, modes = scene.model.pencil, scene.expansions.full.modes
    made = [expand(pencil, each, y0, modes, order, cluster_gap=cluster_gap) for each in q]
    at = NearestExpansion(tuple(made))

    def evaluate(points: EvaluationPoints) -> Floats:
        owner = at.owner(points.q)
        hz = np.empty((len(owner), len(modes)))
        for k in np.unique(owner):
            mine = owner == k
            hz[mine] = made[k].frequencies(points.q[mine], points.y[mine])
        return hz

    return evaluate


# --- What ``expansion.order: auto`` takes


@dataclass(frozen=True, eq=False)
class AutoOrder:
    """The choice for one accuracy, or in words why there is none, and the seconds it took."""

    accuracy: float
    choice: OrderChoice | None
    refused: str
    seconds: float

    @property
    def method(self) -> str | None:
        """The charted method that it is."""
        if self.choice is None:
            return None
        order, n = self.choice.order, 1 + len(self.choice.more_q)
        if n > 1:
            return f"Taylor {order} at {n} points by auto {self.accuracy:.0e}"
        wider = self.choice.cluster_gap != CLUSTER_GAP
        return f"Taylor {order}, modes in a wider cluster" if wider else f"Taylor {order} full"

    @property
    def plain_order(self) -> int | None:
        """Its order where it is in full about the case's own point, as are the charted orders."""
        order = self.choice.order if self.choice is not None else None
        return order if self.method == f"Taylor {order} full" else None


def auto_orders(
    scene: Scene, accuracies: Sequence[float], most_s: float
) -> tuple[tuple[AutoOrder, ...], tuple[str, ...]]:
    """The choices by the very function that a run asks, the loosest accuracy first; notes.

    After one that took over ``most_s`` seconds no other is made.
    """
    made: list[AutoOrder] = []
    for accuracy in sorted(accuracies, reverse=True):
        if made and made[-1].seconds > most_s:
            note = (
                f"what auto takes is not charted from {accuracy:.0e} on: its choice for "
                f"{made[-1].accuracy:.0e} took {time_in_words(made[-1].seconds)}"
            )
            return tuple(made), (note,)
        (choice, refused), spent = timed(partial(_choice, scene, accuracy))
        made.append(AutoOrder(accuracy, choice, refused, spent))
    return tuple(made), ()


def _choice(scene: Scene, accuracy: float) -> tuple[OrderChoice | None, str]:
    full, modes = scene.expansions.full, scene.expansions.modes
    expansion = scene.file.expansion.model_copy(update={"accuracy": accuracy})
    file = replace(scene.file, expansion=expansion)
    try:
        return choose_order(file, scene.model, scene.trajectory, full.q0, full.y0, modes), ""
    except AccuracyError as error:
        return None, str(error)


def auto_methods(scene: Scene, autos: Sequence[AutoOrder]) -> Iterator[Method]:
    """The choices that are no plain order, each once."""
    for auto in {each.method: each for each in autos}.values():
        choice, y0 = auto.choice, scene.expansions.full.y0
        if choice is None or auto.plain_order is not None:
            continue
        q, order, gap = np.vstack([choice.q0, *choice.more_q]), choice.order, choice.cluster_gap
        yield Method(
            str(auto.method),
            "Taylor, several points" if len(q) > 1 else "Taylor, wider cluster",
            {"order": order, "q0": q, "y0": np.tile(y0, (len(q), 1)), "cluster_gap": gap},
            partial(_nearest_expansion, scene, q, y0, order, gap),
            solves=len(q),
            use=f"in the case file, expansion: {{order: auto, accuracy: {auto.accuracy:g}}}",
        )


# --- Reduced models


def reduced_methods(
    scene: Scene, half_orders: Sequence[int], counts: Sequence[int]
) -> Iterator[Method]:
    """Reduced models of each half order m at one or several points; at one without guards too."""
    for count, guard in (*((count, True) for count in counts), (1, False)):
        q, y = points_along(scene, count)
        where = _at_points(len(q))
        for m in half_orders:
            call = f"q0, y0{modes_argument(scene)}, half_order={m}"
            yield Method(
                f"reduced m = {m}, {where}" + ("" if guard else ", no guard"),
                f"reduced, {where}" if guard else "reduced, no guard",
                {"half_order": m, "guard": guard, "q": q, "y": y},
                partial(_reduced, scene, m, q, y, guard),
                solves=len(q) * solves_per_point(scene, m, guard),
                use=f"ea.reduce(model, {call})"
                if guard
                else f"no argument of ea.reduce: {UNGUARDED}(model.pencil, {call}, guard=False)",
            )


def _reduced(scene: Scene, m: int, q: Floats, y: Floats, guard: bool, _: Floats) -> Evaluator:
    made = reduced_model(scene, m, q, y, guard)
    return lambda points: made.frequencies(points.q, points.y)


def reduced_model(scene: Scene, m: int, q: Floats, y: Floats, guard: bool = True) -> ReducedModel:
    """The reduced model of the charted modes at points q (k, n_q), y (k, n_y)."""
    return reduce(scene.model.pencil, q, y, scene.expansions.full.modes, m, guard)


def solves_per_point(scene: Scene, m: int, guard: bool) -> int:
    """Exact eigensolves at one expansion point: the modes, the wanted vectors, the guards'."""
    modes, elastic = scene.expansions.full.modes, len(scene.model.pencil.elastic)
    others = set(range(1, min(max(modes) + 1, elastic) + 1)) - set(modes)
    return 3 if guard and others and m >= 2 else 2


# --- Fits

ALONG = (3, 4, 5, 6, 7, 9, 11, 13, 17, 25)  # exact solves of a fit along one trajectory
OVER_BOX = (9, 12, 16, 22, 30, 42, 60, 84, 120, 160, 220, 300, 400, 550)  # over all designs


@dataclass(frozen=True, eq=False)
class FitEvaluator:
    """Fits that answer points, and how many exact solves they took."""

    fits: tuple[Fit | PathFit, ...]  # one for all designs, or one for each
    solves: int

    def __call__(self, points: EvaluationPoints) -> Floats:
        """(n, n_modes) in Hz."""
        n = points.n_random
        parts = [self.fits[0].frequencies(points.q[:n], points.y[:n])] if n else []
        if points.designs:
            one = len(self.fits) == 1
            hz = (
                self.fits[0].along(points.run_designs)
                if one
                else np.array([each.along() for each in self.fits])
            )
            if len(points.along) < hz.shape[1]:
                hz = hz[:, points.along]
            parts.append(hz.reshape(-1, hz.shape[2]))
        return parts[0] if len(parts) == 1 else np.vstack(parts)

    @property
    def estimate(self) -> float:
        """The largest error estimate of all fits, relative in Hz."""
        return max(each.error_estimate for each in self.fits)


def fit_methods(
    scene: Scene,
    features: Features,
    points: EvaluationPoints,
    accuracies: Sequence[float],
    reduced: Sequence[tuple[int, int]],
    most: int,
) -> Iterator[Method]:
    """Fits of given solves and to ``accuracies``, of at most ``most`` exact solves each.

    Along the trajectory for each design, and over trajectory × box; and fits over both of the
    ``reduced`` models with these half orders and numbers of points.
    """
    free = features.upper > features.lower
    box = Box(
        np.where(free, features.lower, features.fixed_y),
        np.where(free, features.upper, features.fixed_y),
    )
    if features.place is not None:
        counts = [k for k in ALONG if k * points.designs <= most]
        for how in _of_fits(counts, accuracies, min(most, MOST)):
            name, kind, arguments = _in_words(how)
            along = partial(_fit_along, scene, how)
            yield Method(
                f"fit {name} along",
                f"fit {kind}, one trajectory",
                how,
                partial(along, points.run_designs),
                per_design=True,
                one=partial(along, points.run_designs[:1], np.zeros(0)),
                use=f"ea.fit(model, q, y{modes_argument(scene)}, {arguments}).along()",
                note="fitted anew for every design: answers the runs along the trajectory only",
            )
    for how in _of_fits([k for k in OVER_BOX if k <= most], accuracies, most):
        name, kind, arguments = _in_words(how)
        call = f"model, q, ea.Box(lower, upper){modes_argument(scene)}, {arguments}"
        yield Method(
            f"fit {name}",
            f"fit {kind}",
            how,
            partial(_fit_over_box, scene, box, how),
            use=f"ea.fit({call}).along(designs)",
        )
    for m, count in reduced:
        q, y = points_along(scene, count)
        name = f"reduced m = {m}, {_at_points(len(q))}"
        call = f"ea.reduce(model, q0, y0{modes_argument(scene)}, half_order={m})"
        for accuracy in accuracies:
            yield Method(
                f"fit {accuracy:.0e} of {name}",
                f"fit of {name}",
                {"accuracy": accuracy, "half_order": m, "q": q, "y": y},
                partial(_fit_of_reduced, scene, box, accuracy, m, q, y),
                use=f"ea.fit({call}, q, ea.Box(lower, upper), accuracy={accuracy:g})",
            )


def _of_fits(
    solves: Sequence[int], accuracies: Sequence[float], most: int
) -> Iterator[dict[str, Any]]:
    """What is asked of each fit, as keywords of `ea.fit`."""
    yield from ({"solves": k} for k in solves)
    yield from ({"accuracy": accuracy, "most": most} for accuracy in accuracies)


def _in_words(how: Mapping[str, Any]) -> tuple[str, str, str]:
    """Name, kind and arguments of a fit; ``most`` only where its default might not do."""
    if "solves" in how:
        return f"of {how['solves']} solves", "of given solves", f"solves={how['solves']}"
    more = f", most={how['most']}" if how["most"] > MOST else ""
    return f"{how['accuracy']:.0e}", "to an accuracy", f"accuracy={how['accuracy']:g}{more}"


def _fit_along(scene: Scene, how: Mapping[str, Any], designs: Floats, _: Floats) -> FitEvaluator:
    """One fit for each design."""
    modes = scene.expansions.modes
    fits = tuple(fit(scene.model, scene.path, y, modes, **how) for y in designs)
    return FitEvaluator(fits, sum(each.solves for each in fits))


def _fit_over_box(scene: Scene, box: Box, how: Mapping[str, Any], _: Floats) -> FitEvaluator:
    made = fit(scene.model, scene.path, box, scene.expansions.modes, **how)
    return FitEvaluator((made,), made.solves)


def _fit_of_reduced(
    scene: Scene, box: Box, accuracy: float, m: int, q: Floats, y: Floats, _: Floats
) -> FitEvaluator:
    model = reduced_model(scene, m, q, y)
    made = fit(model, scene.path, box, scene.expansions.modes, accuracy)
    return FitEvaluator((made,), len(q) * solves_per_point(scene, m, True))
