"""The optima of one choice of what bands leave open: start after start, on few samples first.

Starts are followed on few samples of a long trajectory, of large models by reduced ones; what they
lead to is then optimised on all samples, and by exact solves last.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import islice, zip_longest

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.exact.design_problem import MET, UnitBox, best_first
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
from eigassign.case.case_file import CaseFile
from eigassign.errors import EigassignError
from eigassign.study.design.search.response import ReducedModels
from eigassign.study.design.search.variants import (
    Counts,
    PosedProblem,
    Task,
    spread_designs,
    thinned,
)
from eigassign.study.results import ClearanceRow

Floats = NDArray[np.float64]
STARTS = 100  # with `starts: auto`, at most
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

    def with_best(self, best: Optimum) -> Searched:
        """The same with another best design."""
        return replace(self, optima=(best, *self.optima[1:]))


def coarse_to_fine(whole: Task, models: ReducedModels | None) -> tuple[Task, ...]:
    """The levels on which optima are sought one after the other, the whole task last."""
    few = thinned(whole, FEW)
    coarse = ([] if few is None else [few]) + ([] if models is None else [whole])
    return (*(replace(task, models=models) for task in coarse), whole)


def most_starts(file: CaseFile, alone: bool = True) -> int:
    """The number of designs to start from, of a choice that is ``alone`` or of each of several."""
    asked = file.assignment.starts
    return asked if not isinstance(asked, str) else STARTS if alone else OF_SEVERAL


def search_starts(
    levels: Sequence[Task],
    posed: Callable[[Task], PosedProblem],
    starts: Sequence[Floats],
    made: int,
    deadline: float,
    progress: Callable[[str], None],
    most: int,
    ended: End | None = None,
) -> Searched:
    """The local optima of what is ``posed`` that ``starts`` lead to, and spread designs up to most.

    So many starts were ``made`` before. Of a search that has ``ended`` the first is judged alone.
    ``deadline`` is a time of `time.monotonic`. Raises EigassignError where the first start has no
    answer; with scenarios, in which others may have one, where none has.
    """
    first, keys = levels[0], levels[0].scene.file.assignment
    search, lost = Searched(posed(first), ended=ended), list[EigassignError]()
    for start in _in_turn(first, posed, search.variant, starts, most):
        progress(f"  from start {made + search.starts + 1}")
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
            progress("  from what was found, on all samples and exactly")
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
    """The search with what ``start`` leads to, the optimum ``before`` of a rougher level, if any.

    Once it has ended, a start is only judged. Where Ctrl-C hits before the start itself is judged,
    it is judged only if nothing is known. A start without an answer leads nowhere; the first one of
    all raises EigassignError.
    """
    problem, optima = search.variant.problem, search.optima
    try:
        found = minimise(problem, start, 0 if search.ended else steps, deadline)
        ended = search.ended or (found.end if found.end in STOPPED else None)
        if before is not None:  # what was said there is its prediction
            said, steps_before = before.seen.residual, before.steps
            if found.predicted is None and said.shape == found.seen.residual.shape:
                found = replace(found, predicted=said)
            found = replace(found, steps=(*steps_before, *found.steps))
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
    """True where more starts are not expected to lead to more optima, or exact solves are used up.

    No errors at all cannot be improved, nor what is cheapest of all within the bounds.
    """
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
    """The first starts, then by turns those that promise most of a sample, and spread ones.

    What promises most leads to good optima; what is expected not to be seen rests on designs that
    are spread. Of a design only frequencies at fewest samples are solved to judge it: all of them
    are less work than a start. Where modes are followed or reduced models lead, it is more: there
    none is judged.
    """
    yield from starts
    most -= len(starts)
    if most <= 0:
        return
    bounds = variant.problem.lower, variant.problem.upper
    box, spread = UnitBox.of(variant.problem), spread_designs(bounds, most, 0)
    if task.models is not None or task.followers:
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
