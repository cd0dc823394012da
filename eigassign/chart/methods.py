"""What a charted method is, and eigassign's own: exact, Taylor, 1/λ, reduced models.

eigassign's fits as charted methods: along one trajectory at a design, and over trajectory × box.

To a stated accuracy, or of a given number of exact solves. Their set-up holds every exact solve,
the checks and the error estimate, but for round-off that decides nothing and is looked at when the
estimate is asked for; what can state none is left out, as what is refused.

What ``expansion.order: auto`` takes for each accuracy, charted beside everything else.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.chart.front import time_words
from eigassign.chart.question import Features, Points
from eigassign.chart.results import Advice, AutoTakes, ChartPoint
from eigassign.chart.timing import timed
from eigassign.errors import AccuracyError
from eigassign.modal.arguments import DENSE_LIMIT
from eigassign.modal.exact.clusters import CLUSTER_GAP
from eigassign.modal.exact.sparse import solve_sparse
from eigassign.modal.expansion import expand, nearest
from eigassign.modal.fit.domain import Box
from eigassign.modal.fit.fit import MOST, Fit, PathFit, fit
from eigassign.modal.model import Model
from eigassign.modal.reduced.reduce import ReducedModel, reduce
from eigassign.study.drawing import spread_samples
from eigassign.study.planning import OrderChoice, choose_order
from eigassign.study.scene import Scene

# --- What a charted method is, and eigassign's own: exact, Taylor, 1/λ, reduced models

Floats = NDArray[np.float64]
Evaluator = Callable[[Points], Floats]  # → Hz (n, n_modes)


FULL, SEVERAL, CLUSTERED = "Taylor, full", "Taylor, several points", "Taylor, wider cluster"
UNGUARDED = "eigassign.modal.reduced.reduce.reduce"


def said(scene: Scene) -> str:
    """The charted modes as an argument of `ea.fit`, `ea.expand`, `ea.reduce`, if they need it."""
    modes = scene.expansions.modes
    return "" if modes == (1,) else f", modes={modes}"


def nowhere(points: Points) -> Floats:
    """Training points of methods that ask for no exact answers."""
    return np.zeros((0, points.x.shape[1]))


@dataclass(frozen=True)
class Method:
    """``fit`` makes an evaluator from exact answers (n, n_modes) in Hz at ``train``'s points x.

    ``solves`` are exact eigensolves inside ``fit`` itself. With ``per_design`` the training is
    repeated for every design of the runs along the trajectory, and its cost is an online one; so is
    that of the fit, timed as ``one`` design's where each has a fit of its own. ``most`` limits the
    evaluation points of slow methods.
    """

    name: str
    family: str
    ours: bool
    parameters: Mapping[str, Any]
    fit: Callable[[Floats], Evaluator]
    train: Callable[[Points], Floats] = nowhere
    solves: int = 0
    exact: bool = False
    per_design: bool = False
    most: int | None = None
    note: str = ""
    one: Callable[[], object] | None = None
    use: str = ""  # how to ask for it: a line of a case file, or a call


def exact_methods(model: Model, modes: Sequence[int], most: int | None) -> Iterator[Method]:
    """The exact solves that eigassign offers: dense in batches where small, and sparse."""
    count, pick = max(modes), np.array(modes) - 1
    if model.n_dof <= DENSE_LIMIT:

        def dense(points: Points) -> Floats:
            return model.frequencies(points.q, points.y, count)[:, pick]

        yield Method(
            "exact dense",
            "exact",
            True,
            {"solver": "dense, in batches"},
            lambda _: dense,
            exact=True,
        )
    yield Method(
        "exact sparse",
        "exact",
        True,
        {"solver": "sparse Lanczos", "points": most},
        lambda _: lambda points: sparse_frequencies(model, points.x, count)[:, pick],
        exact=True,
        most=most,
    )


def sparse_frequencies(model: Model, x: Floats, count: int) -> Floats:
    """Exact frequencies (n, count) in Hz by the sparse solver, whatever the size."""
    lam = solve_sparse(model.pencil, model.pencil.theta(x), count, False).lam
    return np.asarray(np.sqrt(lam) / (2.0 * np.pi))


def taylor_methods(
    scene: Scene, orders: Sequence[int], linear_orders: Sequence[int]
) -> Iterator[Method]:
    """λ expanded to each order, in full and partially linearised in y."""
    for linear, wanted in ((False, orders), (True, linear_orders)):
        for order in wanted:
            yield _taylor(scene, order, linear)


def _taylor(scene: Scene, order: int, linear: bool) -> Method:
    kind = "linearised" if linear else "full"
    point = scene.expansions.full

    def fit(_: Floats) -> Evaluator:
        made = expand(scene.model.pencil, point.q0, point.y0, point.modes, order, linear)
        return lambda points: made.frequencies(points.q, points.y)

    return Method(
        f"Taylor {order} {kind}",
        "Taylor, linearised" if linear else FULL,
        True,
        {"order": order, "linear_in_y": linear, "q0": point.q0, "y0": point.y0},
        fit,
        solves=1,
        use=f"in the case file, expansion: {{order: {order}}}",
    )


def reciprocal_methods(scene: Scene, orders: Sequence[int]) -> Iterator[Method]:
    """1/λ by the reciprocal of λ's series: the same coefficients, summed in another way."""
    for order in orders:
        for linear in (False, True):
            yield _reciprocal(scene, order, linear)


def _reciprocal(scene: Scene, order: int, linear: bool) -> Method:
    kind = "linearised" if linear else "full"
    point = scene.expansions.full

    def fit(_: Floats) -> Evaluator:
        made = expand(scene.model.pencil, point.q0, point.y0, point.modes, order, linear).inverse
        return lambda points: made.frequencies(points.q, points.y)

    return Method(
        f"1/λ {order} {kind}",
        f"1/λ, {kind}",
        True,
        {"order": order, "linear_in_y": linear, "q0": point.q0, "y0": point.y0},
        fit,
        solves=1,
        use=f"ea.expand(model, q0, y0{said(scene)}, order={order}"
        f"{', linear_in_y=True' * linear}).inverse",
    )


def points_along(scene: Scene, count: int) -> tuple[Floats, Floats]:
    """``count`` expansion points (q, y): the case's own, or spread evenly over the trajectory."""
    full = scene.expansions.full
    q = full.q0[None]
    if count > 1:
        q = scene.path.q[spread_samples(scene.path.q @ np.eye(q.shape[1]), count)]
    return q, np.tile(full.y0, (len(q), 1))


def piecewise_methods(
    scene: Scene, orders: Sequence[int], counts: Sequence[int]
) -> Iterator[Method]:
    """Taylor polynomials at several points of the trajectory, the nearest one evaluated."""
    for count in counts:
        for order in orders:
            q, y = points_along(scene, count)
            yield Method(
                f"Taylor {order} at {len(q)} points",
                SEVERAL,
                True,
                {"order": order, "q0": q, "y0": y},
                partial(nearest_expansion, scene, q, y[0], order, CLUSTER_GAP),
                solves=len(q),
                use=f"[ea.expand(model, q, y{said(scene)}, order={order}) for q, y in zip(q0, y0)]"
                ", at a pose the one whose q is nearest",
            )


def nearest_expansion(
    scene: Scene, q: Floats, y0: Floats, order: int, cluster_gap: float, _: Floats
) -> Evaluator:
    """Expansions about q (k, n_q) at the design y0, the nearest one evaluated."""
    pencil, modes = scene.model.pencil, scene.expansions.full.modes
    made = [expand(pencil, each, y0, modes, order, cluster_gap=cluster_gap) for each in q]

    def evaluate(points: Points) -> Floats:
        owner = nearest(made, points.q)
        hz = np.empty((len(owner), len(modes)))
        for k in np.unique(owner):
            mine = owner == k
            hz[mine] = made[k].frequencies(points.q[mine], points.y[mine])
        return hz

    return evaluate


def reduced_methods(
    scene: Scene, half_orders: Sequence[int], counts: Sequence[int]
) -> Iterator[Method]:
    """The reduced model with m = 0 … at one or several points; at one also without guards."""
    for count in counts:
        for m in half_orders:
            yield _reduced(scene, m, count, True)
    for m in half_orders:
        yield _reduced(scene, m, 1, False)


def _reduced(scene: Scene, m: int, count: int, guard: bool) -> Method:
    q, y = points_along(scene, count)
    where = f"{len(q)} point{'s' if len(q) > 1 else ''}"
    source = "model, q0, y0" if guard else "model.pencil, q0, y0"
    asked = f"({source}{said(scene)}, half_order={m}{'' if guard else ', guard=False'})"

    def fit(_: Floats) -> Evaluator:
        made = reduced_model(scene, m, q, y, guard)
        return lambda points: made.frequencies(points.q, points.y)

    return Method(
        f"reduced m = {m}, {where}" + ("" if guard else ", no guard"),
        f"reduced, {where}" if guard else "reduced, no guard",
        True,
        {"half_order": m, "guard": guard, "q": q, "y": y},
        fit,
        solves=len(q) * solves_per_point(scene, m, guard),
        use=f"ea.reduce{asked}" if guard else f"no argument of ea.reduce: {UNGUARDED}{asked}",
    )


def reduced_model(scene: Scene, m: int, q: Floats, y: Floats, guard: bool = True) -> ReducedModel:
    """The reduced model of the charted modes."""
    return reduce(scene.model.pencil, q, y, scene.expansions.full.modes, m, guard)


def solves_per_point(scene: Scene, m: int, guard: bool) -> int:
    """Exact eigensolves at one expansion point: the modes, the wanted vectors, the guards'."""
    modes, elastic = scene.expansions.full.modes, len(scene.model.pencil.elastic)
    others = set(range(1, min(max(modes) + 1, elastic) + 1)) - set(modes)
    return 3 if guard and others and m >= 2 else 2


# --- eigassign's fits as charted methods: along one trajectory at a design, and over trajectory

Made = Fit | PathFit
ALONG = (3, 4, 5, 6, 7, 9, 11, 13, 17, 25)  # exact solves of a fit along one trajectory
OVER_BOX = (9, 12, 16, 22, 30, 42, 60, 84, 120, 160, 220, 300, 400, 550)  # over all designs


@dataclass(frozen=True, eq=False)
class Fitted:
    """Fits that answer points, and how many exact solves they took."""

    fits: tuple[Made, ...]  # one for all designs, or one for each
    solves: int

    def __call__(self, points: Points) -> Floats:
        """(n, n_modes) in Hz."""
        n = points.n_random
        parts = [] if not n else [self.fits[0].frequencies(points.q[:n], points.y[:n])]
        if points.designs:
            hz = self._runs(points.y[n :: len(points.along)])
            if len(points.along) < hz.shape[1]:
                hz = hz[:, points.along]
            parts.append(hz.reshape(-1, hz.shape[2]))
        return parts[0] if len(parts) == 1 else np.vstack(parts)

    @property
    def estimate(self) -> float:
        """The largest error estimate of all fits, relative in Hz."""
        return max(each.error_estimate for each in self.fits)

    def _runs(self, y: Floats) -> Floats:
        if len(self.fits) == 1:
            return self.fits[0].along(y)
        return np.array([each.along() for each in self.fits])


def fit_methods(
    scene: Scene,
    features: Features,
    points: Points,
    accuracies: Sequence[float],
    sources: Sequence[tuple[int, int]],
    most: int,
) -> Iterator[Method]:
    """Every fit for every accuracy; ``most`` exact solves at most for one.

    ``sources`` are half order and expansion points of the reduced models that are fitted.
    """
    if features.place is not None:
        counts: list[dict[str, Any]] = [{"solves": k} for k in ALONG if k * points.designs <= most]
        for how in (*counts, *_to_accuracies(accuracies, min(most, MOST))):
            yield _method(
                f"fit {_named(how)} along",
                f"fit {_kind(how)} along one trajectory",
                how,
                partial(_along, scene, points, how),
                per_design=True,
                one=partial(_one, scene, points, how),
                use=f"ea.fit(model, q, y{said(scene)}, {_call(how)}).along()",
                note="fitted anew for every design: answers the runs along the trajectory only",
            )
    over: list[dict[str, Any]] = [{"solves": k} for k in OVER_BOX if k <= most]
    for how in (*over, *_to_accuracies(accuracies, most)):
        yield _method(
            f"fit {_named(how)}",
            f"fit {_kind(how)}",
            how,
            partial(_over_box, scene, features, how),
            use=f"ea.fit(model, q, ea.Box(lower, upper){said(scene)}, {_call(how)}).along(designs)",
        )
    for m, count in sources:
        q, y = points_along(scene, count)
        name = f"reduced m = {m}, {len(q)} point{'s' if len(q) > 1 else ''}"
        for accuracy in accuracies:
            yield _method(
                f"fit {accuracy:.0e} of {name}",
                f"fit of {name}",
                {"accuracy": accuracy, "half_order": m, "q": q, "y": y},
                partial(_of_reduced, scene, features, accuracy, m, q, y),
                use=f"ea.fit(ea.reduce(model, q0, y0{said(scene)}, half_order={m}), q, "
                f"ea.Box(lower, upper), accuracy={accuracy:g})",
            )


def _method(name: str, family: str, parameters: dict[str, Any], fit: Any, **more: Any) -> Method:
    return Method(name, family, True, parameters, fit, **more)


def _to_accuracies(accuracies: Sequence[float], most: int) -> Iterator[dict[str, Any]]:
    """What is asked of fits, ``most`` frequencies for each."""
    yield from ({"accuracy": accuracy, "most": most} for accuracy in accuracies)


def _kind(how: Mapping[str, Any]) -> str:
    return "of given solves" if "solves" in how else "to an accuracy"


def _named(how: Mapping[str, Any]) -> str:
    return f"of {how['solves']} solves" if "solves" in how else f"{how['accuracy']:.0e}"


def _call(how: Mapping[str, Any]) -> str:
    """As arguments of `ea.fit`; ``most`` only where its default might not do."""
    if "solves" in how:
        return f"solves={how['solves']}"
    more = f", most={how['most']}" if how["most"] > MOST else ""
    return f"accuracy={how['accuracy']:g}{more}"


def _one(scene: Scene, points: Points, how: Mapping[str, Any]) -> Made:
    """The fit of the first design of the runs."""
    y = points.y[points.n_random]
    return fit(scene.model, scene.path, y, scene.expansions.modes, **how)


def _along(scene: Scene, points: Points, how: Mapping[str, Any], _: Floats) -> Evaluator:
    """One fit for each design of the runs."""
    y = points.y[points.n_random :: len(points.along)]
    modes, q = scene.expansions.modes, scene.path
    fits = tuple(fit(scene.model, q, each, modes, **how) for each in y)
    return Fitted(fits, sum(each.solves for each in fits))


def _box(features: Features) -> Box:
    """The bounds of y, parameters without room where they are kept."""
    free = features.upper > features.lower
    low = np.where(free, features.lower, features.fixed_y)
    return Box(low, np.where(free, features.upper, features.fixed_y))


def _over_box(scene: Scene, features: Features, how: Mapping[str, Any], _: Floats) -> Evaluator:
    made = fit(scene.model, scene.path, _box(features), scene.expansions.modes, **how)
    return Fitted((made,), made.solves)


def _of_reduced(
    scene: Scene, features: Features, accuracy: float, m: int, q: Floats, y: Floats, _: Floats
) -> Evaluator:
    reduced = reduced_model(scene, m, q, y)
    made = fit(reduced, scene.path, _box(features), scene.expansions.modes, accuracy)
    return Fitted((made,), len(q) * solves_per_point(scene, m, True))


# --- What ``expansion.order: auto`` takes for each accuracy, charted beside everything else


@dataclass(frozen=True, eq=False)
class Taken:
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
    def is_plain(self) -> bool:
        """Whether it is one of the charted orders about the case's own point."""
        return self.choice is not None and self.method == f"Taylor {self.choice.order} full"


def taken_by_auto(
    scene: Scene, accuracies: Sequence[float], most_s: float
) -> tuple[tuple[Taken, ...], tuple[str, ...]]:
    """The choices by the very function that a run asks, the loosest accuracy first; notes.

    None is made any more after one that took over ``most_s`` seconds.
    """
    made: list[Taken] = []
    for accuracy in sorted(accuracies, reverse=True):
        if made and made[-1].seconds > most_s:
            note = (
                f"what auto takes is not charted from {accuracy:.0e} on: its choice for "
                f"{made[-1].accuracy:.0e} took {time_words(made[-1].seconds)}"
            )
            return tuple(made), (note,)
        (choice, refused), spent = timed(partial(_choice, scene, accuracy))
        made.append(Taken(accuracy, choice, refused, spent))
    return tuple(made), ()


def _choice(scene: Scene, accuracy: float) -> tuple[OrderChoice | None, str]:
    full = scene.expansions.full
    expansion = scene.file.expansion.model_copy(update={"accuracy": accuracy})
    file = replace(scene.file, expansion=expansion)
    try:
        made = choose_order(
            file, scene.model, scene.trajectory, full.q0, full.y0, scene.expansions.modes
        )
    except AccuracyError as error:
        return None, str(error)
    return made, ""


def auto_methods(scene: Scene, taken: Sequence[Taken]) -> Iterator[Method]:
    """Choices that are no plain order about the case's own point, each once."""
    special = [t for t in taken if t.choice is not None and not t.is_plain]
    for each in {t.method: t for t in special}.values():
        choice, y0 = each.choice, scene.expansions.full.y0
        assert choice is not None
        q = np.vstack([choice.q0, *choice.more_q])
        yield Method(
            str(each.method),
            SEVERAL if len(q) > 1 else CLUSTERED,
            True,
            {
                "order": choice.order,
                "q0": q,
                "y0": np.tile(y0, (len(q), 1)),
                "cluster_gap": choice.cluster_gap,
            },
            partial(nearest_expansion, scene, q, y0, choice.order, choice.cluster_gap),
            solves=len(q),
            use=f"in the case file, expansion: {{order: auto, accuracy: {each.accuracy:g}}}",
        )


def beside_auto(advice: Advice, points: Sequence[ChartPoint], taken: Sequence[Taken]) -> Advice:
    """The advice with what ``auto`` takes for the same accuracy."""
    own = next((t for t in taken if t.accuracy == advice.accuracy), None)
    if own is None or advice.is_below_round_off:
        return advice
    auto = _takes(own, {p.method: p for p in points}, advice.evaluations)
    return replace(advice, auto=auto, words=f"{advice.words}; {_words(advice, auto)}")


def _takes(own: Taken, known: dict[str, ChartPoint], evaluations: float) -> AutoTakes:
    point = known.get(own.method or "")
    if point is None:
        why = own.refused or f"{own.method} could not be charted"
        return AutoTakes(None, None, None, own.seconds, why)
    worst, total = point.everywhere.worst_relative, point.total_s(evaluations)
    return AutoTakes(point.method, worst, total, own.seconds, "")


def _words(advice: Advice, auto: AutoTakes) -> str:
    if auto.total_s is None:
        return f"`expansion.order: auto` refuses: {auto.refused}"
    against = ""
    if advice.total_s and advice.method != auto.method:
        times = auto.total_s / advice.total_s
        against = f", {times:.2g} times as long as {advice.method}"
    return (
        f"`expansion.order: auto` takes {auto.method}, {time_words(auto.total_s)} in all{against}, "
        f"worst error {auto.worst_relative:.1e}, after {time_words(auto.choosing_s)} of choosing"
    )
