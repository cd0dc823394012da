"""The chart of one case: every method put the same question, timed, and compared.

One question with its exact answers, put to every method: fitted, evaluated, timed, compared.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import comb

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.chart import methods as own
from eigassign.chart import rivals
from eigassign.chart.effort import Effort, suited
from eigassign.chart.front import advise_accuracy, advise_budget, break_even, front, front_notes
from eigassign.chart.methods import (
    Evaluator,
    Method,
    Taken,
    auto_methods,
    beside_auto,
    fit_methods,
    taken_by_auto,
)
from eigassign.chart.question import SEED, Features, Points, build_features, build_points
from eigassign.chart.results import NOTHING, Advice, Asked, ChartPoint, Errors, Front, Timing
from eigassign.chart.timing import Patience, take_turns, timed
from eigassign.errors import EigassignError
from eigassign.modal.arguments import DENSE_LIMIT
from eigassign.modal.model import Model
from eigassign.study.scene import Scene

# --- The chart of one case: every method put the same question, timed, and compared

Floats = NDArray[np.float64]
ACCURACIES = (1e-2, 1e-4, 1e-6, 1e-8)
FEWEST = 3  # designs followed along the trajectory, however dear: two, and a corner of the box
MANY = 1000.0  # trajectories of the second front: a search over designs


@dataclass(frozen=True)
class Compared:
    """All methods on one case."""

    asked: Asked
    points: tuple[ChartPoint, ...]
    skipped: tuple[tuple[str, str], ...]
    fronts: tuple[Front, ...]
    advice: tuple[Advice, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True)
class Wish:
    """What a recommendation is wanted for, beside the usual accuracies."""

    accuracy: float | None = None  # worst relative error in Hz
    budget_s: float | None = None
    evaluations: float | None = None  # the samples of one trajectory if None


def compare_methods(
    scene: Scene, effort: Effort, wish: Wish, progress: Callable[[str], None]
) -> Compared:
    """Time against error of every method. Raises CaseError where nothing varies."""
    features, effort = build_features(scene), suited(effort, scene.model.n_dof)
    solve_s = _solve_cost(scene)
    progress("asking what auto takes")
    taken, told = taken_by_auto(scene, _accuracies(wish), effort.choosing_s)
    points = _affordable_points(scene, features, effort, solve_s)
    progress(f"solving {len(points.x)} points exactly")
    exact_hz, whole = exact_frequencies(scene, points.x), points.whole(features)
    bench = Bench(scene, points, exact_hz, effort.patience, whole)
    floor = _floor(bench)
    charted, skipped = chart_methods(
        bench, _methods(scene, features, points, effort, solve_s, taken), progress
    )
    charted = with_floor(charted, floor)
    asked = _asked(bench, features, floor, wish)
    fronts = _fronts(charted, asked, wish)
    given = _advice(charted, asked, wish)
    advice = tuple(beside_auto(each, charted, taken) for each in given)
    left_out = _size_notes(scene, features, effort, solve_s)
    notes = (*told, *left_out, *front_notes(charted, fronts))
    return Compared(asked, charted, skipped, fronts, advice, notes)


def _fronts(charted: Sequence[ChartPoint], asked: Asked, wish: Wish) -> tuple[Front, ...]:
    once = float(asked.trajectory_samples)
    counts = {"one trajectory": once, f"{MANY:.0f} trajectories": MANY * once}
    if wish.evaluations is not None:
        counts[f"{wish.evaluations:g} evaluations"] = wish.evaluations
    made = [front(charted, name, n, asked.floor_hz) for name, n in counts.items()]
    return (*made, front(charted, "online alone", None, asked.floor_hz))


def _advice(charted: Sequence[ChartPoint], asked: Asked, wish: Wish) -> Iterator[Advice]:
    floor, once = asked.floor_hz / asked.typical_hz, float(asked.trajectory_samples)
    counts = (once, MANY * once) if wish.evaluations is None else (wish.evaluations,)
    for n in counts:
        yield from (advise_accuracy(charted, a, n, floor) for a in _accuracies(wish))
        if wish.budget_s is not None:
            yield advise_budget(charted, wish.budget_s, n)


def _accuracies(wish: Wish) -> tuple[float, ...]:
    return ACCURACIES if wish.accuracy is None else (wish.accuracy,)


def _solve_cost(scene: Scene) -> float:
    """Seconds of one exact solve, roughly: to decide how many can be afforded."""
    few = 1 if scene.model.n_dof > 1000 else 16
    x = scene.model.x(scene.path.q[spread_rows(len(scene.path.q), few)], scene.initial)
    exact_frequencies(scene, x[:1])
    return max(timed(lambda: exact_frequencies(scene, x))[1] / len(x), 1e-6)


def _affordable_points(scene: Scene, features: Features, effort: Effort, solve_s: float) -> Points:
    along = effort.designs * effort.samples_per_design
    share = min(1.0, effort.reference_s / ((effort.random_points + along) * solve_s))
    designs = max(min(FEWEST, effort.designs), round(effort.designs * share))
    n_random, per_design = int(effort.random_points * share), int(along * share / designs)
    return build_points(scene, features, max(4, n_random), designs, max(4, per_design))


def _floor(bench: Bench) -> float:
    """What rounding does to the exact answers, in Hz: no error below it means anything.

    The larger of two: how far two exact solvers disagree on a few of the points, and what it does
    there to change every entry of the K_j and M_j by one unit in its last place.
    """
    scene, small = bench.scene, bench.scene.model.n_dof <= DENSE_LIMIT
    few = spread_rows(len(bench.points.x), 40 if small else 2)
    x, exact, modes = bench.points.x[few], bench.exact_hz[few], scene.expansions.modes
    pick = np.array(modes) - 1
    others = [exact_frequencies(replace(scene, model=_rounded(scene.model)), x)]
    if small:
        others.append(own.sparse_frequencies(scene.model, x, max(modes))[:, pick])
    elif scene.model.n_dof <= rivals.MOST_DENSE:
        others.append(rivals.lapack_frequencies(scene.model, x, max(modes))[:, pick])
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


def _asked(bench: Bench, features: Features, floor: float, wish: Wish) -> Asked:
    scene, points = bench.scene, bench.points
    once = float(len(scene.path.q))
    return Asked(
        modes=scene.expansions.modes,
        n_dof=scene.model.n_dof,
        features=features.names,
        random_points=points.n_random,
        designs=points.designs,
        samples_per_design=(len(points.x) - points.n_random) // points.designs,
        trajectory_samples=len(scene.path.q),
        evaluations=once if wish.evaluations is None else wish.evaluations,
        seed=SEED,
        typical_hz=float(np.median(bench.exact_hz)),
        floor_hz=floor,
    )


def _methods(
    scene: Scene,
    features: Features,
    points: Points,
    effort: Effort,
    solve_s: float,
    taken: Sequence[Taken],
) -> Iterator[Method]:
    model, modes = scene.model, scene.expansions.modes
    most = max(4, int(effort.training_s / solve_s))  # exact solves that a training may take
    orders = _orders(scene, effort)
    few = max(1, min(len(points.x), int(0.2 * effort.reference_s / solve_s), effort.one_by_one))
    yield from own.exact_methods(model, modes, few)
    if model.n_dof <= min(effort.most_dense, rivals.MOST_DENSE):
        yield rivals.lapack(model, modes, max(1, min(40, int(4e9 / model.n_dof**3))))
    autos = {t.choice.order for t in taken if t.choice is not None and t.is_plain}
    yield from own.taylor_methods(scene, sorted({*orders, *autos}), orders)
    yield from own.reciprocal_methods(scene, orders)
    yield from own.piecewise_methods(scene, orders[1:], effort.expansion_points[1:])
    yield from auto_methods(scene, taken)
    yield from own.reduced_methods(scene, effort.half_orders, effort.expansion_points)
    sources = [each for each in effort.fitted if each[1] <= max(effort.expansion_points)]
    yield from fit_methods(scene, features, points, effort.accuracies, sources, most)
    yield from _rivals(scene, features, points, effort, most)


def _rivals(
    scene: Scene, features: Features, points: Points, effort: Effort, most: int
) -> Iterator[Method]:
    stations = [k for k in effort.stations if k * points.designs <= most]
    yield from rivals.trajectory_methods(features, stations, len(scene.model.q_names))
    yield from rivals.grid_methods(features, _powers(effort.nodes, features.d, most))
    counts = [n for n in effort.training if n <= most] or [most]
    kriging = [n for n in counts if n <= effort.kriging]
    yield from rivals.surrogate_methods(features, counts, kriging)


def _powers(nodes: Iterable[int], d: int, most: int) -> list[int]:
    """Nodes an axis whose grid has at most ``most`` points."""
    return [k for k in nodes if k**d <= most]


def _orders(scene: Scene, effort: Effort) -> list[int]:
    n = int(scene.model.pencil.active.sum())
    wanted = {*effort.orders, scene.expansions.order}
    return sorted(p for p in wanted if comb(n + p, p) <= effort.coefficients)


def _size_notes(scene: Scene, features: Features, effort: Effort, solve_s: float) -> Iterator[str]:
    """What was left out, or thinned, because it would take too long."""
    most, d = max(4, int(effort.training_s / solve_s)), features.d
    dropped = [k for k in effort.nodes if k**d > most]
    if dropped:
        yield (
            f"grids of {', '.join(map(str, dropped))} nodes an axis in {d} dimensions are left "
            f"out: over {most} exact solves"
        )
    fewer = [n for n in effort.training if n > most]
    if fewer:
        yield f"no surrogate is trained on over {most} exact solves: {effort.training_s:g} s"
    if scene.model.n_dof > min(effort.most_dense, rivals.MOST_DENSE):
        yield f"no dense solve one by one: {scene.model.n_dof} degrees of freedom"
    if not rivals.can_krige():
        yield "no Kriging: it is charted where scikit-learn is installed"


# --- One question with its exact answers, put to every method: fitted, evaluated, timed, compar

BATCH = 32768  # evaluations in one call, where methods are timed
LONG_BATCH_S = 0.02  # no batch that would take longer is timed, but few of the question's own runs
TIMED = 3  # runs along the trajectory on which slow methods are timed


@dataclass(frozen=True, eq=False)
class Bench:
    """The question with its exact answers (n, n_modes) in Hz."""

    scene: Scene
    points: Points
    exact_hz: Floats
    patience: Patience
    whole: Points  # the designs of the runs at every sample: for times only

    def solved(self, x: Floats) -> Floats:
        """Exact answers elsewhere, for training."""
        return exact_frequencies(self.scene, x)


def exact_frequencies(scene: Scene, x: Floats) -> Floats:
    """The charted modes at x (n, n_x) by the product's own exact solve, (n, n_modes) in Hz."""
    model, modes = scene.model, scene.expansions.modes
    if not len(x):
        return np.zeros((0, len(modes)))
    n_q = len(model.q_names)
    hz = model.frequencies(x[:, :n_q], x[:, n_q:], max(modes))
    return np.asarray(hz[:, np.array(modes) - 1])


@dataclass(frozen=True)
class _Job:
    """What is timed, and the seconds it took the first time."""

    run: Callable[[], object]
    first: float


@dataclass(frozen=True)
class _Trial:
    """A method that has run once: what it answered, and the jobs to time."""

    method: Method
    trains: bool  # on exact answers that are given to it
    trained: int  # exact solves of its training
    hz: Floats
    points: Points
    jobs: tuple[_Job, _Job, _Job]  # training, of one design if it is done for each; fit; evaluate
    evaluations: int  # in one call of the last job
    estimate: float | None  # of its error by the method itself, relative in Hz


def chart_methods(
    bench: Bench, methods: Iterable[Method], progress: Callable[[str], None]
) -> tuple[tuple[ChartPoint, ...], tuple[tuple[str, str], ...]]:
    """A point for every method, and (method, why) for those that cannot answer.

    First all run once, which gives the answers and warms caches; then they are timed in turns.
    """
    trials, skipped, told = [], [], set[str]()
    known: dict[bytes, tuple[Floats, float]] = {}
    for method in methods:
        if method.family not in told:
            told.add(method.family)
            progress(f"charting {method.family}")
        try:
            trials.append(_trial(bench, method, known))
        except EigassignError as error:
            skipped.append((method.name, str(error)))
    progress("timing all methods in turns")
    spent = take_turns([(j.run, j.first) for t in trials for j in t.jobs], bench.patience)
    exact = [
        spent[3 * k + 2].times(1.0 / t.evaluations) for k, t in enumerate(trials) if t.method.exact
    ]
    solve = min(exact, key=lambda s: s.median_s)
    made = [_point(bench, trial, spent[3 * k : 3 * k + 3], solve) for k, trial in enumerate(trials)]
    return tuple(made), tuple(skipped)


def _trial(bench: Bench, method: Method, known: dict[bytes, tuple[Floats, float]]) -> _Trial:
    """Train, fit and evaluate once; answers that are ``known`` are not solved for again.

    A method that was fitted in its own way says how many ``solves`` that took.
    """
    points = bench.points.runs() if method.per_design else bench.points
    points = points.head(method.most or len(points.x))
    x = method.train(bench.points)
    key = x.tobytes()
    if key not in known:
        known[key] = timed(lambda: bench.solved(x))
    answers, solving = known[key]
    parts = bench.points.designs if method.per_design else 1
    once = x[: len(x) // parts]
    evaluator, fitting = timed(lambda: method.fit(answers))
    hz = evaluator(points)
    many, evaluating = _batch(bench, method, evaluator, points)
    jobs = (
        _Job(lambda: bench.solved(once), solving / parts),
        _Job(method.one or partial(method.fit, answers), fitting / (parts if method.one else 1)),
        _Job(lambda: evaluator(many), evaluating),
    )
    trained = len(x) + getattr(evaluator, "solves", 0)
    estimate = getattr(evaluator, "estimate", None)
    return _Trial(method, len(x) > 0, trained, hz, points, jobs, len(many.x), estimate)


def _batch(
    bench: Bench, method: Method, evaluator: Evaluator, points: Points
) -> tuple[Points, float]:
    """What evaluations are timed on, and about the seconds that takes.

    Whole runs along the trajectory, as a search over designs asks for them, many at once; a slow
    method answers few, at those of their samples that the question has.
    """
    many = points if method.most else points.runs(TIMED)
    many = bench.whole if method.per_design else many
    spent = timed(partial(evaluator, many))[1]
    for larger in () if method.most or method.per_design else _larger(bench, many):
        if spent * len(larger.x) > LONG_BATCH_S * len(many.x):
            break
        many, spent = larger, timed(partial(evaluator, larger))[1]
    return many, spent


def _larger(bench: Bench, few: Points) -> Iterator[Points]:
    """4, 16 … times as many, then a whole batch: a short one tells what a call costs by itself."""
    copies = 4
    while copies * len(few.x) < BATCH:
        yield few.repeated(copies)
        copies *= 4
    yield bench.whole.repeated(-(-BATCH // len(bench.whole.x)))


def _point(bench: Bench, trial: _Trial, spent: Sequence[Timing], solve: Timing) -> ChartPoint:
    method, trained = trial.method, trial.trained
    training, fitting, online = spent[0], spent[1], spent[2].times(1.0 / trial.evaluations)
    offline, solves_online = fitting.plus(training) if trial.trains else fitting, 0.0
    if method.exact:
        offline, solves_online, trained = NOTHING, 1.0, 0
    elif method.per_design:
        designs, samples = bench.points.designs, len(bench.scene.path.q)
        solves_online = trained / (designs * samples)
        anew = fitting if trial.method.one else fitting.times(1.0 / designs)
        anew = anew.plus(training) if trial.trains else anew
        online, offline, trained = online.plus(anew.times(1.0 / samples)), NOTHING, 0
    gain = break_even(offline.median_s, online.median_s, solve.median_s)
    return ChartPoint(
        method.name,
        method.family,
        method.ours,
        method.parameters,
        offline,
        online,
        method.solves + trained,
        solves_online,
        *_errors(bench, trial.points, trial.hz),
        None if method.exact else gain,
        method.note,
        method.use,
        len(bench.scene.path.q) if method.per_design else 1,
        trial.estimate,
    )


def _errors(
    bench: Bench, points: Points, hz: Floats
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


def spread_rows(n: int, count: int) -> NDArray[np.intp]:
    """At most ``count`` of n rows, evenly spread."""
    return np.unique(np.linspace(0, n - 1, min(n, count)).astype(np.intp))


def with_floor(points: Sequence[ChartPoint], floor_hz: float) -> tuple[ChartPoint, ...]:
    """The error of an exact method is at least the disagreement of two exact solvers."""
    return tuple(
        replace(p, everywhere=replace(p.everywhere, worst_hz=max(p.everywhere.worst_hz, floor_hz)))
        if p.solves_online == 1.0
        else p
        for p in points
    )
