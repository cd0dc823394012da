"""The design that meets a case's targets best, by the sequential method on exact frequencies.

What the case file asks for becomes requirements (`assignment.exact.requirements`). A band to keep
out of leaves a choice: on a connected trajectory it is clear if and only if the number k of
modes below it is the same everywhere, so every k that the bounds may allow is tried, and the best
kept.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from time import monotonic

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.catalogues.choosing import KEPT, RELAXED, Chosen, choose
from eigassign.assignment.exact.design_problem import (
    MET,
    DesignProblem,
    Objective,
    UnitBox,
    best_first,
)
from eigassign.assignment.exact.requirements import (
    Frequencies,
    FrequencyLimit,
    ModeTarget,
    QuantityLimit,
    Requirements,
)
from eigassign.assignment.exact.sequential import End, Optimum, distinct, minimise, worth
from eigassign.assignment.feasibility import constraints_agree
from eigassign.assignment.program import Bounds, LinearConstraint
from eigassign.errors import (
    CaseError,
    EigassignError,
    InfeasibleError,
    LostModeError,
    MissingMassError,
)
from eigassign.study.design.clearance import Band, Clearance, mode_above, prove_clear, wanting
from eigassign.study.design.followed import Follower, followers
from eigassign.study.design.one_shot import catalogues, linear_constraints
from eigassign.study.design.response import (
    ExactResponse,
    ReducedModels,
    ReducedResponse,
    exact_response,
    reduced_models,
)
from eigassign.study.scene import Scene
from eigassign.study.wanted import Wanted, followed_modes, target_frequencies, time_weights

Floats = NDArray[np.float64]
MOST_BELOW = 24  # combinations of numbers of modes below the bands that are tried
MASS = "design.mass"  # what the limit of the whole mechanism's mass is called
STARTS = 12  # with `starts: auto`, at most
MARGIN = 1e-5  # relative, by which modes keep off a band at the samples at least
WIDENED = 5  # times that the margin is widened at most
FEW = 24  # samples on which starts are followed, of more than twice as many
FEWEST = 8  # samples at which designs are screened, of more than twice as many
SCREENED, MOST_SCREENED = 7, 48  # designs for each parameter of which the best are starts
APART = 0.2  # of the bounds: two starts differ by more in some parameter
BEHIND, FAR_BEHIND = 3, 2.0  # starts of a variant, and how much worse than the best it may be then
REFINED = 3  # optima on few samples that are followed on all
AGREED = 3  # starts, and half the parameters more, for each optimum seen that lead to the best
SAME = 1e-4  # relative, in F: optima of the same worth
NOTHING = 1e-14  # of F: no error
PERCENT = {Objective.LEAST_SQUARES: 1e4, Objective.WORST_CASE: 1e2}  # of F: what prices count in


@dataclass(frozen=True)
class PosedProblem:
    """One choice of the number of modes below each band, with the problem that it makes."""

    below: tuple[tuple[str, int], ...]  # the band in words, and k
    requirements: Requirements
    problem: DesignProblem
    response: ExactResponse | ReducedResponse
    asks: Callable[[Collection[str]], DesignProblem]  # the problem with these limits only


@dataclass(frozen=True)
class Found:
    """The best design, what it was chosen among, and how much work that was."""

    variant: PosedProblem
    best: Optimum
    optima: tuple[Optimum, ...]  # distinct local optima of the best variant, the best first
    variants: tuple[tuple[PosedProblem, Optimum], ...]  # the best of each
    initial: tuple[float, float]  # violation and objective of the initial design
    clearances: tuple[Clearance, ...]  # of every band along every trajectory
    starts: int
    exact_solves: int
    chosen: Chosen | None = None  # from the catalogues, where there are any; then of `optima`
    lost: tuple[str, ...] = ()  # designs passed over because a followed mode is lost there


def find_optimum(
    scene: Scene,
    wanted: Sequence[Wanted],
    starts: Sequence[Floats],
    progress: Callable[[str], None],
) -> Found:
    """The best local optimum of the exact problem from the initial design and ``starts``.

    Bands to keep out of are proved clear (`clearance`): where modes come too near between the
    samples, the limits at the samples are drawn in by what is lacking, and the answer is sought
    anew from where it was.
    """
    keys, margin = scene.file.assignment, MARGIN
    deadline = np.inf if keys.seconds is None else monotonic() + keys.seconds
    most = STARTS if isinstance(keys.starts, str) else keys.starts
    designs = [scene.initial, *starts][:most]
    models = None if followed_modes(scene.file) else reduced_models(scene)
    for _ in range(WIDENED):
        found = _search_all(scene, wanted, designs, margin, models, deadline, progress)
        lacking = wanting(found.clearances)
        met = found.best.seen.violation <= MET
        if lacking == 0.0 or not met or found.best.end in (End.SECONDS, End.INTERRUPTED):
            break
        designs, margin = [found.best.y], margin + 2.0 * lacking + MARGIN
    return found


def _search_all(
    scene: Scene,
    wanted: Sequence[Wanted],
    starts: Sequence[Floats],
    margin: float,
    models: ReducedModels | None,
    deadline: float,
    progress: Callable[[str], None],
) -> Found:
    """The best local optimum, the limits of bands drawn in by ``margin`` (relative).

    Starts are followed on few samples of a long trajectory, of large models by reduced ones; what
    they lead to is then optimised on all samples, and by exact solves last. No design is returned
    that is worse than the initial one. Where none meets all limits, it is the one that misses them
    least, relative to the limits.
    """
    keys = scene.file.assignment
    listed = catalogues(scene.file)
    whole = Task(scene, tuple(wanted), margin)
    tasks = [whole] if listed else _rougher(whole, models)
    best_of: list[tuple[PosedProblem, tuple[Optimum, ...], Chosen | None]] = []
    made, solves = 0, 0
    ended: End | None = None
    for below in _below(whole):
        if listed:
            near = list(starts[: KEPT + 1])
            for missed in (False, True):
                variant = variant_of(whole, below, missed)
                try:
                    chosen = choose(variant.problem, listed, near, keys.steps, deadline, progress)
                    break
                except InfeasibleError:  # no combination meets the linear limits
                    if missed:
                        raise
            best_of.append((variant, chosen.optima, chosen))
            solves += chosen.appraisals * len(scene.path.q)
            made += min(len(near), RELAXED)
            if chosen.search is None:
                break
            continue
        search = _Search(variant_of(tasks[0], below), keys.steps, deadline)
        for start in _in_turn(tasks[0], search.variant, starts, keys.starts):
            made += 1
            progress(f"  from start {made}{search.left(keys.starts)}")
            search.run(start)
            if search.ended or search.agreed(keys.starts):
                break
            if keys.starts == "auto" and search.falls_behind([o[0] for _, o, _ in best_of]):
                break
        solves += search.variant.response.exact_solves
        for task in tasks[1:]:
            if not search.ended:
                progress("  from what was found, on all samples and exactly")
            search = _refined(variant_of(task, below), search, scene.initial)
            solves += search.variant.response.exact_solves
        if search.optima:
            found = search.variant, distinct(search.optima, search.variant.problem), None
            best_of.append(found)
        if ended := search.ended:
            break
    best_of = best_first(best_of, lambda found: worth(found[1][0]))
    variant, optima, chosen_of = best_of[0]
    return Found(
        variant=variant,
        best=optima[0] if ended is None else replace(optima[0], end=ended),
        optima=optima,
        variants=tuple((v, o[0]) for v, o, _ in best_of),
        initial=_initial(scene, variant),
        clearances=tuple(_clearances(whole, variant, optima[0].y)),
        starts=made,
        exact_solves=solves + len(scene.path.q),
        chosen=chosen_of,
        lost=tuple(dict.fromkeys(whole.lost)),
    )


def _clearances(task: Task, variant: PosedProblem, y: Floats) -> Iterator[Clearance]:
    q = task.scene.path.at(y)[0]
    for band, (label, below) in zip(task.bands, variant.below, strict=True):
        named = tuple(sorted(band.wanted.requirement.modes))
        own = Band(label, q[band.rows], band.lower_hz, band.upper_hz, below, named)
        yield prove_clear(task.scene.model, own, y)


def _refined(variant: PosedProblem, coarse: _Search, initial: Floats) -> _Search:
    """What the optima on few samples lead to on all; from the initial design too if it is better.

    An optimum keeps the steps that led to it. One that has no frequencies on all samples leads
    nowhere.
    """
    fine = _Search(variant, coarse.steps, coarse.deadline, coarse.ended)
    for optimum in distinct(coarse.optima, variant.problem)[:REFINED]:
        with suppress(EigassignError):
            fine.run(optimum.y, optimum)
        if fine.ended:
            break
    seen = variant.problem.appraise(initial)
    inside = np.all((initial >= variant.problem.lower) & (initial <= variant.problem.upper))
    known = list(map(worth, fine.optima))
    own = seen.violation, variant.problem(initial, seen)
    if not fine.optima or (inside and best_first([*known, own], lambda each: each)[0] is own):
        fine.run(initial)
    return fine


def _initial(scene: Scene, variant: PosedProblem) -> tuple[float, float]:
    """Violation (of bounds and constraints too, relative to their ranges) and F at the start."""
    y, problem = scene.initial, variant.problem
    seen = problem.appraise(y)
    width = np.where(problem.upper > problem.lower, problem.upper - problem.lower, 1.0)
    outside = np.maximum(problem.lower - y, y - problem.upper) / width
    worst = max(seen.violation, float(outside.max(initial=0.0)))
    for row in problem.constraints:
        value, size = row.coefficients @ y, np.abs(row.coefficients) @ width
        worst = max(worst, float(max(row.lower - value, value - row.upper) / (size or 1.0)))
    return worst, problem(y, seen)


class _Search:
    """The optima of one variant, start after start."""

    def __init__(
        self, variant: PosedProblem, steps: int, deadline: float, ended: End | None = None
    ) -> None:
        self.variant, self.steps, self.deadline = variant, steps, deadline
        self.optima: list[Optimum] = []
        self.appraisals = 0
        self.began = monotonic()
        self.ended = ended  # by the clock or by Ctrl-C, here or in the search before

    def run(self, start: Floats, before: Optimum | None = None) -> None:
        """Follow the steps from ``start``, the optimum ``before`` of a rougher problem, if any.

        Where Ctrl-C hits before the start itself is judged, it is judged only if nothing is known.
        """
        try:
            found = self._follow(start)
        except KeyboardInterrupt:
            if self.ended:  # pressed again
                raise
            self.ended = End.INTERRUPTED
            if self.optima:
                return
            found = self._follow(start)
        except EigassignError:
            if not self.optima and self.appraisals == 0:
                raise
            return
        self.optima.append(found if before is None else _continued(before, found))
        self.appraisals += found.appraisals
        if found.end in (End.SECONDS, End.INTERRUPTED):
            self.ended = found.end

    def _follow(self, start: Floats) -> Optimum:
        return minimise(self.variant.problem, start, self.steps, self._stop)

    def _stop(self) -> End | None:
        return self.ended or (End.SECONDS if monotonic() > self.deadline else None)

    def falls_behind(self, others: Sequence[Optimum]) -> bool:
        """Whether some starts came nowhere near what ``others`` have: more would not either."""
        if len(self.optima) < BEHIND or not others:
            return False
        own, best = (worth(best_first(optima, worth)[0]) for optima in (self.optima, others))
        if own[0] > FAR_BEHIND * max(best[0], MET):
            return True
        return own[0] >= best[0] - MET and own[1] > best[1] + (FAR_BEHIND - 1.0) * abs(best[1])

    def agreed(self, starts: int | str) -> bool:
        """Whether enough starts led to the best optimum: more where others were seen.

        No errors at all cannot be improved; a price, which may be negative, can.
        """
        if isinstance(starts, int) or not self.optima:
            return False
        best = worth(best_first(self.optima, worth)[0])
        if self.variant.problem.prices is None and best[0] <= MET and best[1] <= NOTHING:
            return True
        return self._lacking() <= 0

    def _lacking(self) -> int:
        """How many more starts have to lead to the best optimum, if no other is found."""
        problem, best = self.variant.problem, worth(best_first(self.optima, worth)[0])
        least = best[1] + SAME * abs(best[1]) + NOTHING
        same = [
            o for o in self.optima if o.seen.violation <= best[0] + MET and o.objective <= least
        ]
        enough = AGREED + len(problem.lower) // 2
        return enough * len(distinct(self.optima, problem)) - len(same)

    def left(self, starts: int | str) -> str:
        """In words how long the starts take that are still to come, at the pace so far."""
        done = len(self.optima)
        if not done:
            return ""
        more = starts - done if isinstance(starts, int) else min(self._lacking(), STARTS - done)
        seconds = (monotonic() - self.began) / done * max(more, 1)
        return f", some {seconds:.0f} s left at least" if seconds >= 1.0 else ""


def _continued(before: Optimum, found: Optimum) -> Optimum:
    """An optimum with the steps that led to its start; what was said there is its prediction."""
    said = before.seen.residual
    if found.predicted is None and said.shape == found.seen.residual.shape:
        found = replace(found, predicted=said)
    return replace(found, steps=(*before.steps, *found.steps))


def _in_turn(
    task: Task, variant: PosedProblem, starts: Sequence[Floats], count: int | str
) -> Iterator[Floats]:
    """The first starts, then spread designs, those that promise most first.

    Of a design only frequencies at fewest samples are solved to judge it: all of them are less work
    than a start. Where modes are followed or reduced models lead, it is more: there none is judged.
    """
    yield from starts
    most = (STARTS if isinstance(count, str) else count) - len(starts)
    if most <= 0:
        return
    if task.models is not None or task.followers:
        yield from _spread_designs(task.scene, most, 0)
        return
    box, fewest = UnitBox.of(variant.problem), _thinned(task, FEWEST) or task
    asked = variant_of(fewest, tuple(k for _, k in variant.below))
    ranked: list[tuple[tuple[float, float], Floats]] = []
    for y in _spread_designs(task.scene, max(most, min(SCREENED * box.n, MOST_SCREENED)), 0):
        z = box.inside(box.z(y))
        try:
            ranked.append((_merit(fewest, asked, box.y(z)), z))
        except EigassignError:
            ranked.append(((np.inf, np.inf), z))
    apart: list[Floats] = []
    near: list[Floats] = []
    for _, z in sorted(ranked, key=lambda one: one[0]):
        alone = all(np.abs(z - other).max(initial=0.0) > APART for other in apart)
        (apart if alone else near).append(z)
    yield from (box.y(z) for z in [*apart, *near][:most])


def _merit(task: Task, variant: PosedProblem, y: Floats) -> tuple[float, float]:
    """Violation and F of a design, by its frequencies alone."""
    asked, scene = variant.requirements, task.scene
    hz = scene.model.frequencies(scene.path.at(y)[0], y, asked.modes)
    seen = asked.appraise(y, Frequencies(hz, np.zeros((*hz.shape, len(y)))))
    return max(seen.violation, MET), variant.problem(y, seen)


def _spread_designs(scene: Scene, count: int, seed: int) -> Floats:
    """Designs (count, n_y) of a Latin hypercube over the bounds."""
    lower, upper = scene.bounds
    cells = np.tile(np.arange(count), (len(lower), 1))
    share = (np.random.default_rng(seed).permuted(cells, axis=1).T + 0.5) / count
    wide = (lower > 0.0) & (upper > 10.0 * lower)
    low = np.where(wide, lower, 1.0)
    ratio = np.where(wide, upper, 1.0) / low
    return np.where(wide, low * ratio**share, lower + share * (upper - lower))


# --- From targets to requirements


@dataclass(frozen=True)
class Task:
    """Targets on the samples of a scene."""

    scene: Scene
    wanted: tuple[Wanted, ...]
    margin: float  # by which the limits of bands are drawn in, relative
    models: ReducedModels | None = None  # that stand for exact solves
    lost: list[str] = field(default_factory=list)  # where followed modes were lost

    @cached_property
    def bands(self) -> tuple[_Band, ...]:
        """Every band along each trajectory for itself: only there k must not change."""
        return tuple(_bands(self.scene, self.wanted))

    @cached_property
    def followers(self) -> tuple[Follower, ...]:
        """Of every mode that targets follow by its shape."""
        return followers(self.scene, self.wanted)


def _rougher(whole: Task, models: ReducedModels | None) -> list[Task]:
    """The task on few samples, if it has many; by reduced models, if there are; and as it is."""
    few = _thinned(whole, FEW)
    tasks = [] if few is None else [replace(few, models=models)]
    return [*tasks, *([] if models is None else [replace(whole, models=models)]), whole]


def _thinned(whole: Task, few: int) -> Task | None:
    """The same on few samples; None where there are few, or a target would have none of them."""
    path = whole.scene.path
    if len(path.q) < 2 * few:
        return None
    scene = replace(whole.scene, trajectory=path.chosen(path.spread(few)))
    try:
        task = replace(whole, scene=scene, wanted=target_frequencies(scene.file, scene.path))
    except CaseError:
        return None
    return task if len(task.bands) == len(tuple(_bands(scene, whole.wanted))) else None


def _below(task: Task) -> Iterator[tuple[int, ...]]:
    """How many modes are below each band: every combination, the likeliest first."""
    possible = [_possible(task.scene, band) for band in task.bands]
    yield from itertools.islice(itertools.product(*possible), MOST_BELOW)


def variant_of(task: Task, below: tuple[int, ...], missed: bool = False) -> PosedProblem:
    """The problem of a task with so many modes below each of its bands.

    Linear limits may be ``missed`` as others may, and are where they contradict each other.
    """
    scene, wanted = task.scene, task.wanted
    lower, upper = scene.bounds
    width = np.where(upper > lower, upper - lower, 1.0)
    targets = tuple(
        ModeTarget(w.mode, w.hz, w.rows, w.weight)
        for w in wanted
        if w.requirement.kind == "frequency"
    )
    objective = Objective(scene.file.assignment.objective)
    prices = _prices(scene, objective if targets else None)
    of_bands = [
        limit
        for band, k in zip(task.bands, below, strict=True)
        for limit in _beside(scene, band, k, task.margin)
    ]
    constraints, elastic = _linear(scene, missed)
    asked = Requirements(
        targets=targets,
        limits=(*_limits(wanted), *of_bands),
        quantities=(*_mass(scene), *elastic),
        time_weights=time_weights(scene.path),
        objective=objective,
        least_change=(scene.initial, width) if not targets and not prices.any() else None,
    )
    exact = exact_response(scene, asked.modes, task.followers)
    response = exact if task.models is None else ReducedResponse(exact, task.models)

    def frequencies(y: Floats) -> Frequencies:
        try:
            return response(y)
        except LostModeError as error:
            task.lost.append(str(error))
            raise

    def asks(names: Collection[str]) -> DesignProblem:
        some = asked.with_limits(names)
        return DesignProblem(
            appraise=lambda y: some.appraise(y, frequencies(y)),
            lower=lower,
            upper=upper,
            constraints=constraints,
            prices=prices if prices.any() else None,
            reference=scene.initial,
            objective=objective if targets else Objective.LEAST_SQUARES,
        )

    labels = (band.label for band in task.bands)
    named = tuple(zip(labels, below, strict=True))
    return PosedProblem(named, asked, asks(asked.limit_names), response, asks)


def _mass(scene: Scene) -> Iterator[QuantityLimit]:
    given = scene.file.design.mass
    if given is not None:
        low = -np.inf if given.min is None else given.min
        high = np.inf if given.max is None else given.max
        yield QuantityLimit(MASS, scene.model.total_mass, low, high)


def _linear(
    scene: Scene, missed: bool
) -> tuple[tuple[LinearConstraint, ...], tuple[QuantityLimit, ...]]:
    """Linear limits that every step keeps; where they contradict, limits to be missed least."""
    rows = tuple(linear_constraints(scene.file))
    if not missed and constraints_agree(rows, Bounds(*scene.bounds)):
        return rows, ()
    return (), tuple(
        QuantityLimit(row.name, partial(_linear_value, row.coefficients), row.lower, row.upper)
        for row in rows
    )


def _linear_value(coefficients: Floats, y: Floats) -> tuple[float, Floats]:
    return float(coefficients @ y), coefficients


def _prices(scene: Scene, objective: Objective | None) -> Floats:
    """Of F per SI unit; where F is errors, prices are in %² of them (worst case: %)."""
    given = np.array([column.price or 0.0 for column in scene.file.design.parameters.values()])
    return given if objective is None else given / PERCENT[objective]


def _limits(wanted: Sequence[Wanted]) -> Iterator[FrequencyLimit]:
    for w in wanted:
        kind, label = w.requirement.kind, w.requirement.label
        if kind == "at_least":
            yield FrequencyLimit(label, ((w.mode, 1.0),), w.lower_hz, w.rows, True)
        elif kind == "at_most":
            yield FrequencyLimit(label, ((w.mode, 1.0),), w.upper_hz, w.rows, False)
        elif kind == "gap":
            low, high = w.requirement.modes
            yield FrequencyLimit(label, ((high, 1.0), (low, -1.0)), w.lower_hz, w.rows, True)


@dataclass(frozen=True)
class _Band:
    """A band to keep out of along one trajectory."""

    wanted: Wanted
    label: str  # with the trajectory, of several
    rows: slice  # of all samples
    lower_hz: Floats
    upper_hz: Floats


def _bands(scene: Scene, wanted: Sequence[Wanted]) -> Iterator[_Band]:
    """Every band along each trajectory for itself: only there the number below must not change."""
    for w in wanted:
        if w.requirement.kind != "keep_out":
            continue
        for part, rows in zip(scene.path.parts, scene.path.rows, strict=True):
            label = w.requirement.label
            label = f"{label} along {part.name!r}" if scene.path.several else label
            first, last = max(rows.start, w.rows.start), min(rows.stop, w.rows.stop)
            if first < last:
                own = slice(first - w.rows.start, last - w.rows.start)
                yield _Band(w, label, slice(first, last), w.lower_hz[own], w.upper_hz[own])


def _possible(scene: Scene, band: _Band) -> list[int]:
    """What k may be: from the fewest modes below the band to the most, at designs all over."""
    counts = _counts(scene, band, tuple(sorted(band.wanted.requirement.modes)))
    first = int(np.median(counts[0]))
    possible = range(int(counts.min()), int(counts.max()) + 1)
    return sorted(possible, key=lambda k: (abs(k - first), k))


def _beside(scene: Scene, band: _Band, k: int, margin: float) -> Iterator[FrequencyLimit]:
    """The limits that say: k of the named modes (of all, if none is named) are below the band."""
    lower, upper = band.lower_hz * (1.0 - margin), band.upper_hz * (1.0 + margin)
    label, named = band.wanted.requirement.label, tuple(sorted(band.wanted.requirement.modes))
    if k:
        below = named[k - 1] if named else k
        yield FrequencyLimit(label, ((below, 1.0),), lower, band.rows, False)
    q = scene.path.at(scene.initial)[0][band.rows]
    if above := mode_above(scene.model, k, named, q, scene.initial):
        yield FrequencyLimit(label, ((above, 1.0),), upper, band.rows, True)


def _counts(scene: Scene, band: _Band, named: tuple[int, ...]) -> NDArray[np.intp]:
    """How many of the modes are below the band's lower and upper edge, (designs, 2 · samples)."""
    lower, upper = scene.bounds
    designs = [scene.initial, lower, upper, 0.5 * (lower + upper)]
    if len(lower):
        designs += list(_spread_designs(scene, 8, 1))
    found = []
    for y in designs:
        try:
            hz = _all_below(scene, scene.path.at(y)[0][band.rows], y, float(band.upper_hz.max()))
        except EigassignError:
            continue
        columns = [m - 1 for m in named if m <= hz.shape[1]] if named else list(range(hz.shape[1]))
        edges = (band.lower_hz, band.upper_hz)
        found.append(np.concatenate([(hz[:, columns] < e[:, None]).sum(axis=1) for e in edges]))
    return np.array(found)


def _all_below(scene: Scene, q: Floats, y: Floats, hz: float) -> Floats:
    """The lowest frequencies (n, count), as many as reach beyond ``hz`` everywhere or have mass."""
    available = scene.model.n_dof - scene.model.n_rigid
    count = min(4, available)
    while True:
        try:
            found = scene.model.frequencies(q, y, count)
        except MissingMassError as error:
            count = available = error.most
            continue
        if count == available or found[:, -1].min() > hz:
            return found
        count = min(2 * count, available)
