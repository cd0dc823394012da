"""Every method put the same question: built, evaluated, timed, and compared.

All methods run once, which gives their answers and warms caches; then they are timed in turns.
Evaluations are timed in large batches of whole runs along the trajectory, as a search over designs
asks for them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import comb

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.chart import methods, rivals
from eigassign.chart.effort import Effort, suited
from eigassign.chart.front import (
    advise_accuracy,
    advise_budget,
    beside_auto,
    break_even,
    front,
    front_notes,
)
from eigassign.chart.methods import AutoOrder, Evaluator, Method
from eigassign.chart.question import (
    SEED,
    EvaluationPoints,
    Features,
    build_features,
    build_points,
)
from eigassign.chart.results import NO_TIME, Advice, Asked, ChartPoint, Errors, Front, Timing
from eigassign.chart.surrogates import has_kriging
from eigassign.chart.timing import Patience, take_turns, timed
from eigassign.errors import EigassignError
from eigassign.modal.model import Model
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]
ACCURACIES = (1e-2, 1e-4, 1e-6, 1e-8)
FEWEST = 3  # designs along the trajectory, however long a solve takes: two, and a corner of the box
MANY = 1000.0  # trajectories of the second front: a search over designs
BATCH = 32768  # evaluations in one call, where methods are timed
LONG_BATCH_S = 0.02  # no batch that would take longer is timed, but few of the question's own runs
TIMED = 3  # runs along the trajectory on which slow methods are timed


@dataclass(frozen=True)
class Request:
    """What advice is asked for."""

    accuracy: float | None = None  # worst relative error in Hz; `ACCURACIES` if None
    budget_s: float | None = None  # advice for this time, too
    evaluations: float | None = None  # one trajectory, and `MANY` of them, if None

    @property
    def accuracies(self) -> tuple[float, ...]:
        """Those for which advice is given."""
        return ACCURACIES if self.accuracy is None else (self.accuracy,)


@dataclass(frozen=True)
class MethodComparison:
    """All methods on one case."""

    asked: Asked
    points: tuple[ChartPoint, ...]
    skipped: tuple[tuple[str, str], ...]
    fronts: tuple[Front, ...]
    advice: tuple[Advice, ...]
    notes: tuple[str, ...]


def compare_methods(
    scene: Scene, effort: Effort, request: Request, progress: Callable[[str], None]
) -> MethodComparison:
    """Time against error of every method. Raises CaseError where nothing varies."""
    features, effort = build_features(scene), suited(effort, scene.model.n_dof)
    solve_s = _solve_cost(scene)
    progress("asking what auto takes")
    autos, unasked = methods.auto_orders(scene, request.accuracies, effort.choosing_s)
    points = affordable_points(scene, features, effort, solve_s)
    progress(f"solving {len(points.x)} points exactly")
    exact_hz = exact_frequencies(scene, points.x)
    bench = Bench(scene, points, exact_hz, effort.patience, points.whole_runs(features))
    floor_hz = _round_off(bench)
    listed = _methods(scene, features, points, effort, solve_s, autos)
    charted, skipped = chart_methods(bench, listed, floor_hz, progress)
    asked = Asked(
        modes=scene.expansions.modes,
        n_dof=scene.model.n_dof,
        features=features.names,
        random_points=points.n_random,
        designs=points.designs,
        samples_per_design=len(points.along),
        trajectory_samples=len(scene.path.q),
        evaluations=request.evaluations or float(len(scene.path.q)),
        seed=SEED,
        typical_hz=float(np.median(exact_hz)),
        floor_hz=floor_hz,
    )
    fronts = _fronts(charted, asked, request)
    given = _advice(charted, asked, request)
    advice = tuple(beside_auto(each, charted, autos) for each in given)
    left_out = _left_out(scene, features, effort, solve_s)
    notes = (*unasked, *left_out, *front_notes(charted, fronts))
    return MethodComparison(asked, charted, skipped, fronts, advice, notes)


def _fronts(charted: Sequence[ChartPoint], asked: Asked, request: Request) -> tuple[Front, ...]:
    once = float(asked.trajectory_samples)
    counts: dict[str, float | None] = {
        "one trajectory": once,
        f"{MANY:.0f} trajectories": MANY * once,
    }
    if request.evaluations is not None:
        counts[f"{request.evaluations:g} evaluations"] = request.evaluations
    counts["online alone"] = None
    return tuple(front(charted, name, n, asked.floor_hz) for name, n in counts.items())


def _advice(charted: Sequence[ChartPoint], asked: Asked, request: Request) -> Iterator[Advice]:
    floor, once = asked.floor_hz / asked.typical_hz, float(asked.trajectory_samples)
    for n in (once, MANY * once) if request.evaluations is None else (request.evaluations,):
        yield from (advise_accuracy(charted, a, n, floor) for a in request.accuracies)
        if request.budget_s is not None:
            yield advise_budget(charted, request.budget_s, n)


# --- What can be afforded: points, methods


def exact_frequencies(scene: Scene, x: Floats) -> Floats:
    """The charted modes at x (n, n_x) by eigassign's own exact solve, (n, n_modes) in Hz."""
    model, modes = scene.model, scene.expansions.modes
    if not len(x):
        return np.zeros((0, len(modes)))
    n_q = len(model.q_names)
    hz = model.frequencies(x[:, :n_q], x[:, n_q:], max(modes))
    return np.asarray(hz[:, np.array(modes) - 1])


def spread_rows(n: int, count: int) -> NDArray[np.intp]:
    """At most ``count`` of n rows, evenly spread."""
    return np.unique(np.linspace(0, n - 1, min(n, count)).astype(np.intp))


def _solve_cost(scene: Scene) -> float:
    """Seconds of one exact solve, roughly: to decide how many can be afforded."""
    few = 1 if scene.model.n_dof > 1000 else 16
    x = scene.model.x(scene.path.q[spread_rows(len(scene.path.q), few)], scene.initial)
    exact_frequencies(scene, x[:1])
    return max(timed(lambda: exact_frequencies(scene, x))[1] / len(x), 1e-6)


def affordable_points(
    scene: Scene, features: Features, effort: Effort, solve_s: float
) -> EvaluationPoints:
    """The points of the question, fewer where an exact solve takes long (``solve_s``)."""
    along = effort.designs * effort.samples_per_design
    share = min(1.0, effort.reference_s / ((effort.random_points + along) * solve_s))
    designs = max(min(FEWEST, effort.designs), round(effort.designs * share))
    n_random, per_design = int(effort.random_points * share), int(along * share / designs)
    return build_points(scene, features, max(4, n_random), designs, max(4, per_design))


def _methods(
    scene: Scene,
    features: Features,
    points: EvaluationPoints,
    effort: Effort,
    solve_s: float,
    autos: Sequence[AutoOrder],
) -> Iterator[Method]:
    model, modes = scene.model, scene.expansions.modes
    most = _most_solves(effort, solve_s)
    few = max(1, min(len(points.x), int(0.2 * effort.reference_s / solve_s), effort.one_by_one))
    yield from methods.exact_methods(model, modes, few)
    if model.n_dof <= effort.most_dense:
        most_points = max(1, min(40, int(4e9 / model.n_dof**3)))
        yield rivals.dense_by_scipy(model, modes, most_points)
    n = int(model.pencil.active.sum())
    wanted = {*effort.orders, scene.expansions.order}
    orders = sorted(p for p in wanted if comb(n + p, p) <= effort.coefficients)
    of_auto = {each.plain_order for each in autos if each.plain_order is not None}
    yield from methods.series_methods(scene, orders, sorted({*orders, *of_auto}))
    yield from methods.piecewise_methods(scene, orders[1:], effort.expansion_points[1:])
    yield from methods.auto_methods(scene, autos)
    yield from methods.reduced_methods(scene, effort.half_orders, effort.expansion_points)
    reduced = [each for each in effort.fitted if each[1] <= max(effort.expansion_points)]
    yield from methods.fit_methods(scene, features, points, effort.accuracies, reduced, most)
    stations = [k for k in effort.stations if k * points.designs <= most]
    yield from rivals.station_methods(features, stations, len(model.q_names))
    yield from rivals.grid_methods(features, [k for k in effort.nodes if k**features.d <= most])
    yield from rivals.surrogate_methods(
        features, [k for k in effort.training if k <= most] or [most]
    )


def _most_solves(effort: Effort, solve_s: float) -> int:
    """Exact solves that the training of one method may take."""
    return max(4, int(effort.training_s / solve_s))


def _left_out(scene: Scene, features: Features, effort: Effort, solve_s: float) -> Iterator[str]:
    """What was left out because it would take too long, or is not there."""
    most, d = _most_solves(effort, solve_s), features.d
    dropped = [k for k in effort.nodes if k**d > most]
    if dropped:
        yield (
            f"grids of {', '.join(map(str, dropped))} nodes an axis in {d} dimensions are left "
            f"out: over {most} exact solves"
        )
    if any(n > most for n in effort.training):
        yield f"no surrogate is trained on over {most} exact solves: {effort.training_s:g} s"
    if scene.model.n_dof > effort.most_dense:
        yield f"no dense solve one by one: {scene.model.n_dof} degrees of freedom"
    if not has_kriging():
        yield "no Kriging: it is charted where scikit-learn is installed"


# --- The question with its exact answers, and what round-off does to them


@dataclass(frozen=True, eq=False)
class Bench:
    """The question with its exact answers (n, n_modes) in Hz."""

    scene: Scene
    points: EvaluationPoints
    exact_hz: Floats
    patience: Patience
    whole: EvaluationPoints  # the designs of the runs at every sample: for times only


def _round_off(bench: Bench) -> float:
    """What rounding does to the exact answers, in Hz: no error below it means anything.

    The larger of two: how far two exact solvers disagree on a few of the points, and what it does
    there to change every entry of the K_j and M_j by one unit in its last place.
    """
    model, modes = bench.scene.model, bench.scene.expansions.modes
    small = model.pencil.is_dense
    few = spread_rows(len(bench.points.x), 40 if small else 2)
    x, exact, wanted = bench.points.x[few], bench.exact_hz[few], np.array(modes) - 1
    others = [exact_frequencies(replace(bench.scene, model=_rounded(model)), x)]
    if small:
        others.append(methods.sparse_frequencies(model, x, max(modes))[:, wanted])
    elif model.n_dof <= rivals.MOST_DENSE:
        others.append(rivals.scipy_frequencies(model, x, max(modes))[:, wanted])
    off = [float(np.abs(other - exact).max()) for other in others]
    return float(max(*off, np.finfo(float).eps * bench.exact_hz.max()))


def _rounded(model: Model) -> Model:
    """The model with its numbers changed in the last place, up or down at random."""
    random, eps = np.random.default_rng(SEED), np.finfo(float).eps

    def changed(weights: sparse.csr_array) -> sparse.csr_array:
        signs = random.choice(np.array([-1.0, 1.0]), len(weights.data))
        data = weights.data * (1.0 + eps * signs)
        return sparse.csr_array((data, weights.indices, weights.indptr), shape=weights.shape)

    pencil = model.pencil
    rounded = replace(pencil, stiffness=changed(pencil.stiffness), mass=changed(pencil.mass))
    return replace(model, pencil=rounded)


# --- Each method run once, then timed in turns with all others

_Job = tuple[Callable[[], object], float]  # what is timed, and the seconds it took the first time


@dataclass(frozen=True)
class _FirstRun:
    """A method that has run once: what it answered, and the jobs to time."""

    method: Method
    trained: int  # exact solves of its training, and of fits
    hz: Floats
    points: EvaluationPoints
    set_up: _Job  # of one design where that is done for each
    evaluate: _Job
    evaluations: int  # in one call of the last job
    estimate: float | None  # of its error by the method itself, relative in Hz


def chart_methods(
    bench: Bench, listed: Iterable[Method], floor_hz: float, progress: Callable[[str], None]
) -> tuple[tuple[ChartPoint, ...], tuple[tuple[str, str], ...]]:
    """A point for every method, and (method, why) for those that cannot answer.

    The error of an exact method is at least what round-off does to exact answers (``floor_hz``).
    """
    first_runs, skipped, families = [], [], set[str]()
    known: dict[bytes, tuple[Floats, float]] = {}
    for method in listed:
        if method.family not in families:
            families.add(method.family)
            progress(f"charting {method.family}")
        try:
            first_runs.append(_run_first(bench, method, known))
        except EigassignError as error:
            skipped.append((method.name, str(error)))
    progress("timing all methods in turns")
    jobs = [job for each in first_runs for job in (each.set_up, each.evaluate)]
    spent = take_turns(jobs, bench.patience)
    pairs = [
        (set_up, batch.times(1.0 / each.evaluations))
        for each, set_up, batch in zip(first_runs, spent[::2], spent[1::2], strict=True)
    ]
    exact_s = min(
        online.median_s
        for each, (_, online) in zip(first_runs, pairs, strict=True)
        if each.method.exact
    )
    made = (
        _point(bench, each, *pair, exact_s, floor_hz)
        for each, pair in zip(first_runs, pairs, strict=True)
    )
    return tuple(made), tuple(skipped)


def _run_first(bench: Bench, method: Method, known: dict[bytes, tuple[Floats, float]]) -> _FirstRun:
    """Train, build and evaluate once; answers that are ``known`` are not solved for again."""
    points = bench.points.runs() if method.per_design else bench.points
    points = points.head(method.most or len(points.x))
    x = bench.points.x[:0] if method.train is None else method.train(bench.points)
    key = x.tobytes()
    if key not in known:
        known[key] = timed(lambda: exact_frequencies(bench.scene, x))
    answers, solving = known[key]
    evaluator, building = timed(lambda: method.build(answers))
    hz = evaluator(points)
    many, evaluating = timed_batch(bench, method, evaluator, points)
    parts = bench.points.designs if method.per_design else 1
    of_one = x[: len(x) // parts]
    set_up = method.one or (lambda: method.build(exact_frequencies(bench.scene, of_one)))
    return _FirstRun(
        method,
        trained=len(x) + getattr(evaluator, "solves", 0),
        hz=hz,
        points=points,
        set_up=(set_up, (solving + building) / parts),
        evaluate=(lambda: evaluator(many), evaluating),
        evaluations=len(many.x),
        estimate=getattr(evaluator, "estimate", None),
    )


def timed_batch(
    bench: Bench,
    method: Method,
    evaluator: Evaluator,
    points: EvaluationPoints,
) -> tuple[EvaluationPoints, float]:
    """What evaluations are timed on, and about the seconds that takes.

    Whole runs along the trajectory, many at once: 4, 16 … times as many, then a whole batch, for a
    short one tells what a call costs by itself. A slow method answers few, at those of their
    samples that the question has.
    """
    if method.most or method.per_design:
        many = points if method.most else bench.whole
        return many, timed(partial(evaluator, many))[1]
    many = points.runs(TIMED)
    spent = timed(partial(evaluator, many))[1]
    larger, copies = [], 4
    while copies * len(many.x) < BATCH:
        larger.append((many, copies))
        copies *= 4
    for runs, times in (*larger, (bench.whole, -(-BATCH // len(bench.whole.x)))):
        if spent * len(runs.x) * times > LONG_BATCH_S * len(many.x):
            break
        many = runs.repeated(times)
        spent = timed(partial(evaluator, many))[1]
    return many, spent


def _point(
    bench: Bench,
    first: _FirstRun,
    set_up: Timing,
    online: Timing,
    exact_s: float,
    floor_hz: float,
) -> ChartPoint:
    method, samples = first.method, len(bench.scene.path.q)
    offline, solves, solves_online = set_up, method.solves + first.trained, 0.0
    everywhere, random, along = _errors(bench, first.points, first.hz)
    if method.exact:
        offline, solves, solves_online = NO_TIME, 0, 1.0
        everywhere = replace(everywhere, worst_hz=max(everywhere.worst_hz, floor_hz))
    elif method.per_design:
        online = online.plus(set_up.times(1.0 / samples))
        offline, solves, solves_online = NO_TIME, 0, first.trained / len(bench.whole.x)
    gain = break_even(offline.median_s, online.median_s, exact_s)
    return ChartPoint(
        method=method.name,
        family=method.family,
        ours=method.ours,
        parameters=method.parameters,
        offline=offline,
        online=online,
        solves=solves,
        solves_online=solves_online,
        everywhere=everywhere,
        random=random,
        trajectory=along,
        break_even=None if method.exact else gain,
        note=method.note,
        use=method.use,
        at_once=samples if method.per_design else 1,
        estimate=first.estimate,
    )


def _errors(
    bench: Bench, points: EvaluationPoints, hz: Floats
) -> tuple[Errors, Errors | None, Errors | None]:
    """Everywhere, at the random points, and along the trajectory."""
    start = 0 if points.n_random else bench.points.n_random
    exact = bench.exact_hz[start : start + len(hz)]
    n = points.n_random
    return (
        errors(hz, exact),
        errors(hz[:n], exact[:n]) if n else None,
        errors(hz[n:], exact[n:]) if len(hz) > n else None,
    )


def errors(hz: Floats, exact: Floats) -> Errors:
    """Worst and root mean square of |f − f_exact|, infinite where a method gives no number."""
    off = np.abs(hz - exact)
    failed = ~np.isfinite(off)
    off = np.where(failed, np.inf, off)
    return Errors(
        float(off.max()),
        float(np.sqrt(np.mean(np.square(off)))),
        float((off / exact).max()),
        len(hz),
        int(failed.any(axis=1).sum()),
    )
