"""The chart of one case: every method put the same question, timed, and compared."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import comb

import numpy as np
from numpy.typing import NDArray
from scipy import sparse

from eigassign.modal.model import Model
from eigassign.modal.sizes import DENSE_LIMIT
from eigassign.study import chart_methods as own
from eigassign.study import rivals
from eigassign.study.chart_auto import Taken, auto_methods, beside_auto, taken_by_auto
from eigassign.study.chart_bench import (
    Bench,
    chart_methods,
    exact_frequencies,
    spread_rows,
    with_floor,
)
from eigassign.study.chart_data import Advice, Asked, ChartPoint, Front
from eigassign.study.chart_effort import Effort, suited
from eigassign.study.chart_fits import fit_methods
from eigassign.study.chart_front import advise_accuracy, advise_budget, front, front_notes
from eigassign.study.chart_methods import Method
from eigassign.study.chart_question import SEED, Features, Points, build_features, build_points
from eigassign.study.chart_timing import timed
from eigassign.study.scene import Scene

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
    advice = tuple(beside_auto(each, scene, charted, taken) for each in given)
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
