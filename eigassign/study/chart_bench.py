"""One question with its exact answers, put to every method: fitted, evaluated, timed, compared."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import EigassignError
from eigassign.study.chart_data import NOTHING, ChartPoint, Errors, Timing
from eigassign.study.chart_front import break_even
from eigassign.study.chart_methods import Evaluator, Method
from eigassign.study.chart_question import Points
from eigassign.study.chart_timing import Patience, take_turns, timed
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]
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
