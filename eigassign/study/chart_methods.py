"""What a charted method is, and eigassign's own: exact, Taylor, 1/λ, reduced models."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.modal.clusters import CLUSTER_GAP
from eigassign.modal.exact_sparse import solve_sparse
from eigassign.modal.expansion import expand
from eigassign.modal.model import Model
from eigassign.modal.nearest import nearest
from eigassign.modal.reduced import ReducedModel, reduce
from eigassign.modal.sizes import DENSE_LIMIT
from eigassign.study.chart_follow import FULL, SEVERAL
from eigassign.study.chart_question import Points
from eigassign.study.drawing import spread_samples
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]
Evaluator = Callable[[Points], Floats]  # → Hz (n, n_modes)


UNGUARDED = "eigassign.modal.reduced.reduce"


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
    lam, _ = solve_sparse(model.pencil, model.pencil.theta(x), count, False)
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
