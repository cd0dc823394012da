"""The problem that one choice makes, and its local optima from several starts.

What the case file asks for becomes requirements (`assignment.exact.requirements`). A band to keep
out of leaves a choice: on a connected trajectory it is clear if and only if the number k of
modes below it is the same everywhere, so each k that the bounds may allow is one more problem.

Starts are followed on few samples of a long trajectory; what they lead to is then optimised on all.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice, zip_longest
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eigassign.arrays import Floats
from eigassign.assignment.exact.design_problem import (
    MET,
    Appraisal,
    Cost,
    DesignProblem,
    Objective,
    UnitBox,
    best_first,
)
from eigassign.assignment.exact.requirements import Appraise, Requirements, with_scenarios
from eigassign.assignment.exact.sequential import (
    FINISHED,
    NOTHING,
    PAYS,
    ROUND_OFF,
    STOPPED,
    End,
    Optimum,
    Tally,
    minimise,
    with_end,
    worth,
)
from eigassign.assignment.program import constraints_agree
from eigassign.assignment.requirements.kinds import ForbiddenBand, Margin, ModeGap
from eigassign.assignment.requirements.requirement import Frequencies, Requirement
from eigassign.assignment.requirements.sampling import time_weights
from eigassign.case.case_file import CaseFile
from eigassign.case.schema.trajectory import DURATION_PATH
from eigassign.errors import CaseError, EigassignError
from eigassign.study.design.clearance import mode_above
from eigassign.study.design.followed import Named, followers
from eigassign.study.design.lists import catalogues, price_of_one
from eigassign.study.design.search.response import (
    DesignResponse,
    Glances,
    Outlook,
    outlook_of,
    response_of,
    solved_below,
    spread_designs,
)
from eigassign.study.results import ClearanceRow
from eigassign.study.scene import Scene

Counts = tuple[int | None, ...]  # of modes below each band, None of one that is left out


class PosedProblem(NamedTuple):
    """One choice of the number of modes below some bands, with the problem that it makes."""

    task: Task
    requirements: Requirements
    problem: DesignProblem
    response: DesignResponse
    outlook: Outlook | None  # None where modes are followed

    @property
    def limit_names(self) -> tuple[str, ...]:
        """The names of all limits, those that every step keeps the last."""
        kept = (row.name for row in self.problem.constraints)
        return tuple(dict.fromkeys((*self.requirements.limit_names, *kept)))

    def worth(self, y: Floats, hz: Floats) -> tuple[float, float]:
        """What a design of frequencies (n_t, n_modes) misses, and F."""
        seen = self.requirements.appraise(y, Frequencies(hz, np.zeros((*hz.shape, len(y)))))
        return seen.violation, self.problem(y, seen)


@dataclass(frozen=True)
class Task:
    """Targets on the samples of a scene."""

    scene: Scene
    wanted: tuple[Requirement, ...]
    margins: tuple[Margin, ...] = ()  # by which modes keep off each band; none without bands
    scenarios: tuple[Floats, ...] = ()  # in which it is asked too

    def designs(self, y: Floats) -> list[Floats]:
        """A design, and what it is in each scenario."""
        return [y, *(self.scene.tolerances.deviated(y, sigma)[0] for sigma in self.scenarios)]

    @cached_property
    def bands(self) -> tuple[ForbiddenBand, ...]:
        """The bands along each trajectory for itself."""
        return tuple(band for one in self.wanted for band in one.bands)

    @cached_property
    def glances(self) -> dict[int, Glances]:
        """What is known of many designs, by the number of modes."""
        return {}

    @cached_property
    def followers(self) -> tuple[Named, ...]:
        """The followers of every mode that targets follow by its shape."""
        return followers(self.scene, self.wanted)


def thinned(whole: Task, few: int) -> Task | None:
    """The problem on few samples; None where there are few, or a target would have none of them."""
    path = whole.scene.path
    if len(path.q) < 2 * few:
        return None
    scene = replace(whole.scene, trajectory=path.chosen(_few(whole, few)))
    try:
        task = replace(whole, scene=scene, wanted=scene.wanted)
    except CaseError:
        return None
    return task if len(task.bands) == len(whole.bands) else None


def _few(whole: Task, few: int) -> NDArray[np.intp]:
    """About so many samples, and of each target first, last, lowest and highest edge."""
    path = whole.scene.path
    most = [
        one.rows.start + row
        for one in whole.wanted
        for row in (0, len(one.hz) - 1, int(one.lower.argmin()), int(one.upper.argmax()))
    ]
    between = [row for row in most if path.inserted[row]]
    return np.union1d(path.spread(few), np.array(between, dtype=np.intp))


def variant_of(
    task: Task,
    below: Counts,
    missed: bool = False,
    held: tuple[Floats, Floats] | None = None,
    names: Collection[str] | None = None,
) -> PosedProblem:
    """The problem of a task with so many modes below each of its bands, without those of None.

    Linear limits may be ``missed`` as others may, and are where they contradict each other. The
    bounds are those of the scene, or what a choice from lists leaves ``held`` of them. With those
    limits only that are in ``names``, if any are given, and then without prices.
    """
    scene, wanted = task.scene, task.wanted
    lower, upper = held or scene.bounds
    aim = scene.file.assignment.named_objective
    asked = [one for one in wanted if not one.bands and not one.is_aim]
    aims = [one for one in wanted if one.is_aim]
    aims += (one for one in asked if aim == "widest" and isinstance(one, ModeGap))
    for band, k, margin in zip(task.bands, below, task.margins, strict=True):
        if k is None:
            continue
        q = scene.path.at(scene.initial)[0][band.rows]
        above = mode_above(scene.model, k, band.counted, q, scene.initial)
        asked += band.kept_clear(k, above, margin)
        aims += band.kept_clear(k, above, Margin()) if aim == "widest" else ()
    # linear limits are kept by every step; where they contradict, they are missed least
    kept = not (missed or task.scenarios)
    kept = kept and constraints_agree(scene.constraints, lower, upper)
    asked += (one for one in scene.limits if not kept or one.constraint is None)
    width = np.ptp(scene.bounds, axis=0)
    width = np.where(width > 0.0, width, 1.0)
    has_goals = any(one.is_goal for one in asked)
    objective = Objective.LARGEST if aims else Objective.LEAST_SQUARES
    objective = Objective.WORST_CASE if has_goals and aim == "worst_case" else objective
    cost = cost_of(scene, 1.0 / price_of_one(scene.file))
    requirements = Requirements(
        asked=tuple(asked),
        time_weights=time_weights(scene.path),
        objective=objective,
        least_change=None if has_goals or aims or cost else (scene.initial, width),
        aims=tuple(aims),
    )
    response = response_of(scene, requirements.modes, task.followers)
    if names is not None:
        requirements = requirements.with_limits(names)
    problem = DesignProblem(
        appraise=_appraise(task, requirements, response),
        lower=lower,
        upper=upper,
        constraints=tuple(
            row for row in scene.constraints if kept and (names is None or row.name in names)
        ),
        cost=cost if names is None else None,
        objective=objective,
    )
    outlook = outlook_of(scene, requirements, task.followers, task.glances)
    return PosedProblem(task, requirements, problem, response, outlook)


def _appraise(task: Task, asked: Requirements, response: DesignResponse) -> Appraise:
    """What sees a design by what is asked, in all scenarios of the task, by aims too."""

    def nominal(y: Floats) -> Appraisal:
        return asked.appraise(y, response(y))

    largest = bool(asked.goals or asked.aims) and asked.objective is not Objective.LEAST_SQUARES
    return with_scenarios(nominal, task.scene.tolerances, task.scenarios, largest)


def cost_of(scene: Scene, unit: float) -> Cost | None:
    """What designs cost more than the initial one, in ``unit`` for 1 of the file; None: nothing.

    What is chosen of lists with a price each counts in full. Of the lightest design the mass is
    all that counts, in kg, of the fastest the motion time, in s.
    """
    design, mass, n = scene.file.design, scene.model.total_mass, len(scene.initial)
    if scene.file.assignment.objective == "fastest":
        of_time = [c.parameter == DURATION_PATH for c in design.parameters.values()]
        return Cost(np.array(of_time, dtype=np.float64), np.zeros(n), is_time=True)
    if scene.file.assignment.objective == "lightest":
        return Cost(np.zeros(n), scene.initial, 1.0, mass, is_affine=mass.is_affine)
    prices = np.array([column.price or 0.0 for column in design.parameters.values()])
    listed = [own for own in catalogues(scene.file) if own.prices]
    of_mass = (design.mass and design.mass.price) or 0.0
    if not of_mass and not prices.any() and not listed:
        return None
    return Cost(
        prices=unit * prices,
        reference=scene.initial,
        of_mass=unit * of_mass,
        mass=mass if of_mass else None,
        free=mass(scene.initial)[0] if of_mass else 0.0,
        is_affine=not of_mass or mass.is_affine,
        listed=lambda y: sum(own.price(y) for own in listed),
    )


def lacking(task: Task, y: Floats) -> list[Floats]:
    """What a design lacks to be clear of each band, by the number of modes below it from 0."""
    if not task.bands:
        return []
    each = []
    for one in task.designs(y):
        solved = solved_below(task.scene, task.bands, task.followers, one)
        both = zip(task.bands, task.margins, strict=True)
        each.append([band.errors_by_count(solved, margin) for band, margin in both])
    # of numbers of modes below those that all designs know
    known = ([e[: min(map(len, own))] for e in own] for own in zip(*each, strict=True))
    return [np.max(own, axis=0) for own in known]


STARTS = 100  # with `starts: auto`, at most
LOBES, FEW_LOBES = 8, 3  # of residuals, over the motion time, that the fastest motion is sought in
# Of each of several choices: those that cannot meet the limits have many optima. Of 150 random
# problems with lists beside continuous parameters none was worse than with ten each.
OF_SEVERAL = 20
# Exact solves of a search after which `starts: auto` ends: a count, so that no answer depends on
# the clock; 100 starts of 20 steps on 24 samples take 50 000
SOLVES = 50_000
FEW = 24  # samples on which starts are followed, of more than twice as many
SCREENED, MOST_SCREENED = 7, 48  # designs for each parameter of which the best are starts


@dataclass(frozen=True)
class Searched:
    """The optima found of one choice, and how much work that was."""

    variant: PosedProblem
    optima: tuple[Optimum, ...] = ()  # distinct ones, the best first
    starts: int = 0
    tally: Tally | None = None  # None where no start was made
    ended: End | None = None  # by the clock or by Ctrl-C
    exact_solves: int = 0
    lost: tuple[str, ...] = ()  # designs passed over because a followed mode is lost there
    rows: tuple[int, ...] = ()  # of every list
    below: Counts = ()  # the numbers of modes below every band, None of one that is left out
    missed: float = np.inf  # by the best, of bands between the samples too
    clearances: tuple[ClearanceRow, ...] = ()  # the bands as they were checked

    @property
    def best(self) -> Optimum:
        """The best design found."""
        return self.optima[0]


def coarse_to_fine(whole: Task) -> tuple[Task, ...]:
    """The levels on which optima are sought one after the other, the whole task last."""
    few = thinned(whole, FEW)
    return (whole,) if few is None else (few, whole)


def most_starts(file: CaseFile, alone: bool = True) -> int:
    """The number of designs to start from, of a choice that is ``alone`` or of each of several."""
    asked, moves = file.assignment.starts, any(hasattr(one, "residual") for one in file.targets)
    if asked == "auto" and (moves or file.assignment.objective == "fastest"):
        return FEW_LOBES if file.assignment.robust else LOBES
    return asked if not isinstance(asked, str) else STARTS if alone else OF_SEVERAL


def search_starts(
    levels: Sequence[Task],
    posed: Callable[[Task], PosedProblem],
    starts: Sequence[Floats],
    deadline: float,
    progress: Callable[[str], None],
    most: int,
    ended: End | None = None,
) -> Searched:
    """The local optima of what is ``posed`` that ``starts`` lead to, and spread designs up to most.

    Of a search that has ``ended`` the first is judged alone.
    ``deadline`` is a time of `time.monotonic`. Raises EigassignError where the first start has no
    answer; with scenarios, in which others may have one, where none has.
    """
    first, keys = levels[0], levels[0].scene.file.assignment
    search, lost = Searched(posed(first), ended=ended), list[EigassignError]()
    for start in _in_turn(first, posed, search.variant, starts, most):
        progress(f"start {search.starts + 1} of {max(most, len(starts))} at most")
        try:
            search = _after(search, start, keys.steps, deadline)
        except EigassignError as error:
            if not first.scenarios:
                raise
            lost.append(error)
        search = replace(search, starts=search.starts + 1)
        if search.ended or (keys.starts == "auto" and _is_enough(search)):
            break
    if lost and not search.optima:
        raise lost[0]
    responses = [search.variant.response]
    for level in levels[1:]:
        if not search.ended:
            progress("from what was found, on all samples and exactly")
        refined = replace(search, variant=posed(level), optima=())
        finer = _refined(refined, search.optima, first.scene.initial, keys.steps, deadline)
        search = replace(finer, tally=search.tally)
        responses.append(search.variant.response)
    return replace(
        search,
        missed=search.best.seen.violation,
        exact_solves=sum(response.exact_solves for response in responses),
        lost=tuple(line for response in responses for line in response.lost),
    )


def _after(
    search: Searched, start: Floats, steps: int, deadline: float, before: Optimum | None = None
) -> Searched:
    """The search with what ``start`` leads to, ``before`` being a rougher level's optimum."""
    problem, optima = search.variant.problem, search.optima
    try:
        found = minimise(problem, start, 0 if search.ended else steps, deadline)
        ended = search.ended or (found.end if found.end in STOPPED else None)
        if before is not None:  # what was said there is its prediction
            said, steps_before = before.seen.residual, before.steps
            if found.predicted is None and said.shape == found.seen.residual.shape:
                found = found._replace(predicted=said)
            found = found._replace(steps=(*steps_before, *found.steps))
        apart = with_end(optima, found, None if ended else problem)
    except KeyboardInterrupt:
        if search.ended:  # pressed again
            raise
        search = replace(search, ended=End.INTERRUPTED)
        return search if optima else _after(search, start, steps, deadline, before)
    except EigassignError:
        if not optima and before is None:
            raise
        return search
    known, there = search.tally or Tally(), sum(one.end in FINISHED for one in apart)
    tally = Tally(known.starts + (found.end in FINISHED), there)
    return replace(search, optima=apart, tally=tally, ended=ended)


def _refined(
    search: Searched, coarse: Sequence[Optimum], initial: Floats, steps: int, deadline: float
) -> Searched:
    """The optima on a finer level from ``coarse`` ones; or the initial design, if it is better."""
    problem = search.variant.problem
    for optimum in coarse[:3]:  # the best few
        search = _after(search, optimum.y, steps, deadline, optimum)
        if search.ended:
            break
    try:
        seen = problem.appraise(initial)
    except EigassignError:
        if not search.optima:
            raise
        return search
    inside = np.all((initial >= problem.lower) & (initial <= problem.upper))
    own, known = (seen.violation, problem(initial, seen)), map(worth, search.optima)
    if not search.optima or (inside and best_first([*known, own], lambda each: each)[0] is own):
        search = _after(search, initial, steps, deadline)
    return search


# --- Whether more starts would help


def _is_enough(search: Searched) -> bool:
    """True where hardly more optima are expected, solves are used up, or nothing can be better."""
    if search.tally is None:
        return False
    (violation, value), problem = worth(search.optima[0]), search.variant.problem
    least = problem.least_value(problem.lower, problem.upper, np.zeros(0))
    if violation <= MET and value <= least + ROUND_OFF * abs(least) + NOTHING:
        return True
    return search.tally.unseen <= PAYS or search.variant.response.exact_solves > SOLVES


# --- Starts


def _in_turn(
    task: Task,
    posed: Callable[[Task], PosedProblem],
    variant: PosedProblem,
    starts: Sequence[Floats],
    most: int,
) -> Iterator[Floats]:
    """The first starts, then by turns those that promise most of a sample, and spread ones."""
    yield from starts
    most -= len(starts)
    if most <= 0:
        return
    bounds = variant.problem.lower, variant.problem.upper
    box, spread = UnitBox.of(variant.problem), spread_designs(bounds, most, 0)
    if task.followers:
        yield from spread
        return
    asked = posed(thinned(task, 8) or task)
    ranked: list[tuple[tuple[float, float], Floats]] = []
    for y in spread_designs(bounds, min(SCREENED * box.n, MOST_SCREENED), 1):
        z = box.inside(box.z(y))
        y, worths = box.y(z), (np.inf, np.inf)
        with suppress(EigassignError):
            q, model = asked.response.path.at(y)[0], asked.response.model
            missed, value = asked.worth(y, model.frequencies(q, y, asked.requirements.modes))
            worths = max(missed, MET), value
        ranked.append((worths, z))
    apart: list[Floats] = []
    near: list[Floats] = []
    for _, z in sorted(ranked, key=lambda one: one[0]):
        alone = all(np.abs(z - other).max(initial=0.0) > 0.2 for other in apart)  # of the bounds
        (apart if alone else near).append(z)
    promising = [box.y(z) for z in (*apart, *near)]
    turns = zip_longest(promising, spread)
    yield from islice((y for turn in turns for y in turn if y is not None), most)
