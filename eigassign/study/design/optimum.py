"""The design that meets a case's targets best, by the sequential method on exact frequencies.

Every problem that the targets make (`variants`) is tried from several starts, and the best kept.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from time import monotonic

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.catalogues.branching import KEEP, ListedValues
from eigassign.assignment.catalogues.choosing import RELAXED, Chosen, choose
from eigassign.assignment.exact.design_problem import MET, UnitBox, best_first
from eigassign.assignment.exact.requirements import Frequencies
from eigassign.assignment.exact.sequential import End, Optimum, distinct, minimise, worth
from eigassign.errors import EigassignError, InfeasibleError
from eigassign.study.design.clearance import Band, Clearance, prove_clear, wanting
from eigassign.study.design.one_shot import catalogues
from eigassign.study.design.response import ReducedModels, reduced_models
from eigassign.study.design.variants import (
    PosedProblem,
    Task,
    possible_counts,
    spread_designs,
    thinned,
    variant_of,
)
from eigassign.study.requirements.named_modes import followed_modes
from eigassign.study.requirements.requirement import Requirement
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]
STARTS = 12  # with `starts: auto`, at most
MARGIN = 1e-5  # relative, by which modes keep off a band at the samples at least
FEW = 24  # samples on which starts are followed, of more than twice as many
SCREENED, MOST_SCREENED = 7, 48  # designs for each parameter of which the best are starts
BEHIND, FAR_BEHIND = 3, 2.0  # starts of a variant, and how much worse than the best it may be then
SAME = 1e-4  # relative, in F: optima of the same worth
NOTHING = 1e-14  # of F: no error


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
    wanted: Sequence[Requirement],
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
    for _ in range(5):  # each time drawn in by twice the room that was lacking
        found = _search_all(scene, wanted, designs, margin, models, deadline, progress)
        lacking = wanting(found.clearances)
        met = found.best.seen.violation <= MET
        if lacking == 0.0 or not met or found.best.end in (End.SECONDS, End.INTERRUPTED):
            break
        designs, margin = [found.best.y], margin + 2.0 * lacking + MARGIN
    return found


def _search_all(
    scene: Scene,
    wanted: Sequence[Requirement],
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
    keys, listed = scene.file.assignment, catalogues(scene.file)
    whole = Task(scene, tuple(wanted), margin)
    few = thinned(whole, FEW)
    tasks = [] if few is None else [replace(few, models=models)]
    tasks += [whole] if models is None else [replace(whole, models=models), whole]
    best_of: list[tuple[PosedProblem, tuple[Optimum, ...], Chosen | None]] = []
    made, solves = 0, 0
    ended: End | None = None
    lost: list[str] = []
    counts = (possible_counts(scene, band) for _, band in whole.bands)
    for below in itertools.islice(itertools.product(*counts), 24):
        if listed:
            near = list(starts[: KEEP + 1])
            variant, chosen = _chosen(whole, below, listed, near, deadline, progress)
            best_of.append((variant, chosen.optima, chosen))
            lost += variant.response.lost
            solves += chosen.appraisals * len(scene.path.q)
            made += min(len(near), RELAXED)
            if chosen.search is None:
                break
            continue
        search = _Search(variant_of(tasks[0], below), keys.steps, deadline)
        for start in _in_turn(tasks[0], search.variant, starts, keys.starts):
            made += 1
            progress(f"  from start {made}")
            search.run(start)
            if search.ended:
                break
            best = [optima[0] for _, optima, _ in best_of]
            if keys.starts == "auto" and (search.agreed() or search.falls_behind(best)):
                break
        searches = [search]
        for task in tasks[1:]:
            if not search.ended:
                progress("  from what was found, on all samples and exactly")
            search = _refined(variant_of(task, below), search, scene.initial)
            searches.append(search)
        solves += sum(one.variant.response.exact_solves for one in searches)
        lost += (line for one in searches for line in one.variant.response.lost)
        if search.optima:
            optima = distinct(search.optima, search.variant.problem)
            best_of.append((search.variant, optima, None))
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
        lost=tuple(dict.fromkeys(lost)),
    )


def _chosen(
    task: Task,
    below: tuple[int, ...],
    listed: Sequence[ListedValues],
    near: Sequence[Floats],
    deadline: float,
    progress: Callable[[str], None],
) -> tuple[PosedProblem, Chosen]:
    """The best combinations; where none meets the linear limits, these are missed as others are."""
    steps = task.scene.file.assignment.steps
    variant = variant_of(task, below)
    try:
        return variant, choose(variant.problem, listed, near, steps, deadline, progress)
    except InfeasibleError:
        variant = variant_of(task, below, missed=True)
        return variant, choose(variant.problem, listed, near, steps, deadline, progress)


def _clearances(task: Task, variant: PosedProblem, y: Floats) -> Iterator[Clearance]:
    q = task.scene.path.at(y)[0]
    for (label, band), (_, below) in zip(task.bands, variant.below, strict=True):
        own = Band(label, q[band.rows], band.lower_hz, band.upper_hz, below, band.counted)
        yield prove_clear(task.scene.model, own, y)


def _refined(variant: PosedProblem, coarse: _Search, initial: Floats) -> _Search:
    """What the optima on few samples lead to on all; from the initial design too if it is better.

    An optimum keeps the steps that led to it. One that has no frequencies on all samples leads
    nowhere.
    """
    fine = _Search(variant, coarse.steps, coarse.deadline, coarse.ended)
    for optimum in distinct(coarse.optima, variant.problem)[:3]:  # the best few
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
            if not self.optima:
                raise
            return
        self.optima.append(found if before is None else _continued(before, found))
        if found.end in (End.SECONDS, End.INTERRUPTED):
            self.ended = self.ended or found.end

    def _follow(self, start: Floats) -> Optimum:
        deadline = -np.inf if self.ended else self.deadline
        return minimise(self.variant.problem, start, self.steps, deadline)

    def falls_behind(self, others: Sequence[Optimum]) -> bool:
        """True where some starts came nowhere near what ``others`` have: more would not either."""
        if len(self.optima) < BEHIND or not others:
            return False
        own, best = (worth(best_first(optima, worth)[0]) for optima in (self.optima, others))
        if own[0] > FAR_BEHIND * max(best[0], MET):
            return True
        return own[0] >= best[0] - MET and own[1] > best[1] + (FAR_BEHIND - 1.0) * abs(best[1])

    def agreed(self) -> bool:
        """True where enough starts led to the best optimum: more where others were seen.

        No errors at all cannot be improved; a price, which may be negative, can.
        """
        if not self.optima:
            return False
        problem = self.variant.problem
        violation, value = worth(best_first(self.optima, worth)[0])
        if problem.prices is None and violation <= MET and value <= NOTHING:
            return True
        least = value + SAME * abs(value) + NOTHING
        same = [
            o for o in self.optima if o.seen.violation <= violation + MET and o.objective <= least
        ]
        enough = 3 + len(problem.lower) // 2
        return len(same) >= enough * len(distinct(self.optima, problem))


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
        yield from spread_designs(task.scene, most, 0)
        return
    box, fewest = UnitBox.of(variant.problem), thinned(task, 8) or task
    asked = variant_of(fewest, tuple(k for _, k in variant.below))
    ranked: list[tuple[tuple[float, float], Floats]] = []
    for y in spread_designs(task.scene, max(most, min(SCREENED * box.n, MOST_SCREENED)), 0):
        z = box.inside(box.z(y))
        try:
            ranked.append((_merit(fewest, asked, box.y(z)), z))
        except EigassignError:
            ranked.append(((np.inf, np.inf), z))
    apart: list[Floats] = []
    near: list[Floats] = []
    for _, z in sorted(ranked, key=lambda one: one[0]):
        alone = all(np.abs(z - other).max(initial=0.0) > 0.2 for other in apart)  # of the bounds
        (apart if alone else near).append(z)
    yield from (box.y(z) for z in [*apart, *near][:most])


def _merit(task: Task, variant: PosedProblem, y: Floats) -> tuple[float, float]:
    """Violation and F of a design, by its frequencies alone."""
    asked, scene = variant.requirements, task.scene
    hz = scene.model.frequencies(scene.path.at(y)[0], y, asked.modes)
    seen = asked.appraise(y, Frequencies(hz, np.zeros((*hz.shape, len(y)))))
    return max(seen.violation, MET), variant.problem(y, seen)
