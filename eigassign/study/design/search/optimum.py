"""The design that meets a case's targets best: one loop over all that is discrete.

A **choice** is a row of every list and a number of modes below every band. Each makes a problem of
its own (`variants`). The loop takes the choice that promises most by what is known of it:

    a bound      no design of it is better: by linear limits, price and mass, and, where frequencies
                 are monotone in all that is continuous, by those of two corners, on more and more
                 samples
    an estimate  what one start leads to, on few samples
    its optimum  from all starts, on all samples; bands are looked at between these too

It ends where nothing that is left can be better, or where the exact solves are used up: what no
bound excludes and no search has seen is counted. Nothing else is done for lists, bands or both.

Bands of an optimum are checked (`clearance`): where modes come too near between the samples, the
limits at the samples are drawn in by what is lacking, and it is sought anew from where it was.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from math import prod
from time import monotonic

import numpy as np

from eigassign.arrays import Bools, Floats, Ints
from eigassign.assignment.exact.design_problem import MET, best_first
from eigassign.assignment.exact.sequential import STOPPED, End, minimise, worth
from eigassign.assignment.program import can_be_kept
from eigassign.assignment.requirements.kinds import Margin
from eigassign.case.case_file import CaseFile
from eigassign.errors import CaseError, EigassignError
from eigassign.study.design.clearance import check_band, wanting
from eigassign.study.design.lists import KEEP, catalogues, with_rows
from eigassign.study.design.search.response import Designs
from eigassign.study.design.search.variants import (
    SOLVES,
    Counts,
    PosedProblem,
    Searched,
    Task,
    coarse_to_fine,
    most_starts,
    search_starts,
    variant_of,
)
from eigassign.study.results import ClearanceRow
from eigassign.study.scene import Scene

MARGIN = 1e-5  # relative, by which modes keep off a band at the samples at least
MOST = 200_000  # choices that are gone through: 81 000 take 3 s beside their solves
TRIES = 100  # choices that are estimated before the best of them is searched
TOGETHER = 64  # choices that are bounded together
PROMISING = 4  # of designs all over the bounds: those that a choice with bands is searched from
DRAWN = 6  # times that limits are drawn in
BEFORE = 1e-12  # of F: less is no better
BOUNDED, TRIED, DONE, EXCLUDED = 0, 100, 101, 102  # what is known of a choice; bounds by level


@dataclass(frozen=True, kw_only=True)
class Found(Searched):
    """The best choice, what it was chosen among, and how much work that was in all."""

    task: Task
    outcomes: tuple[Searched, ...]  # of the choices that were searched, the best first
    choices: int  # of all lists and bands
    untried: int  # of these, neither excluded nor searched
    initial: tuple[float, float]  # violation and objective of the initial design
    every: Choices  # what is known of each choice

    @property
    def are_listed(self) -> bool:
        """True where lists are chosen from."""
        return bool(self.every.listed)

    @property
    def is_discrete(self) -> bool:
        """True where nothing continuous is left beside the choices."""
        return self.every.is_discrete


def find_optimum(
    scene: Scene,
    starts: Sequence[Floats],
    progress: Callable[[str], None],
    near: Sequence[Floats] = (),
    scenarios: Sequence[Floats] = (),
    deadline: float | None = None,
) -> Found:
    """The best local optimum of the exact problem from the initial design and ``starts``.

    In these ``scenarios`` too, and first from designs ``near`` it, such as optima without some.
    ``deadline`` is a time of `time.monotonic`, that of the case from now on unless given.

    No design is returned that is worse than the initial one. Where none meets all limits, it is the
    one that misses them least, relative to the limits.
    """
    deadline = deadline_of(scene.file) if deadline is None else deadline
    designs = [*near, scene.initial, *starts][: most_starts(scene.file)]
    bands = sum(len(one.bands) for one in scene.wanted)
    task = Task(scene, scene.wanted, (Margin(MARGIN),) * bands, scenarios=tuple(scenarios))
    return _Search(task, designs, deadline, progress).found()


def deadline_of(file: CaseFile) -> float:
    """The time of `time.monotonic` when a search that begins now has to end."""
    seconds = file.assignment.seconds
    return np.inf if seconds is None else monotonic() + seconds


# --- What is known of every choice


class Choices:
    """All choices of a task, and what no design of each is below: more and more, as it is asked.

    Of the limits ``names`` only, where these are given, and without prices; linear ones may then be
    missed as others.
    """

    def __init__(
        self, task: Task, belows: Sequence[Counts], names: Collection[str] | None = None
    ) -> None:
        self.task, self.names, self.listed = task, names, catalogues(task.scene.file)
        self.belows = belows
        lower, upper = task.scene.bounds
        columns = [column for own in self.listed for column in own.columns]
        self.is_discrete = bool(columns) and not np.delete(upper > lower, columns).any()
        allowed = [own.distinct for own in self.listed]
        self.count = prod(map(len, allowed)) * len(belows)
        if self.count > MOST:
            message = (
                f"leaves {self.count} choices of its lists and of modes below bands, and {MOST} "
                "are gone through at most: shorten the lists"
            )
            raise CaseError((task.scene.file.problem("design", message),))
        rows = np.array([*product(*allowed)], dtype=np.intp)
        self.bases: dict[int, PosedProblem] = {}
        self.rows = np.tile(rows, (len(belows), 1))
        self.of = np.repeat(range(len(belows)), len(rows))
        self.lower, self.upper = (with_rows(self.listed, self.rows, y) for y in (lower, upper))
        self.level = np.full(len(self.of), BOUNDED)
        kept = can_be_kept(task.scene.constraints, self.lower, self.upper)
        self.soft = names is not None or not kept.any()  # linear limits are missed as others are
        self.missed = np.where(kept | self.soft, 0.0, np.inf)
        problem = self.base(0).problem
        cost = None if problem.cost is None else problem.cost.least(self.lower, self.upper)
        self.cost = np.zeros(len(self.of)) if cost is None else cost
        self.value = self.cost + problem.least_measure(np.zeros(0))
        outlook = self.base(0).outlook
        self.levels = 0 if outlook is None else outlook.levels

    def base(self, k: int) -> PosedProblem:
        """The problem of some numbers below the bands, whatever the rows."""
        if k not in self.bases:
            task, below = self.task, self.belows[k]
            self.bases[k] = variant_of(task, below, self.soft, names=self.names)
        return self.bases[k]

    def posed(self, k: int, task: Task) -> PosedProblem:
        """The problem of a choice in a task, such as on few samples."""
        held = self.lower[k], self.upper[k]
        return variant_of(task, self.belows[self.of[k]], self.soft, held, self.names)

    @property
    def bounds_left(self) -> Bools:
        """True of each of which more can be known before it is searched."""
        return np.asarray(self.level < self.levels)

    def ahead(self, open_: Bools, behind: Bools | None = None) -> Ints:
        """Those that are open, the best first by what is known of them; some ``behind`` others."""
        own = np.flatnonzero(open_)
        missed, value = self.missed[own], self.value[own]
        met = missed <= missed.min(initial=np.inf) + MET
        late = np.zeros(len(own)) if behind is None else behind[own]
        return own[np.lexsort((value, np.where(met, 0.0, missed), late))]

    def left(self, most: int) -> Iterator[PosedProblem | None]:
        """Yield problems that bounds do not exclude, the best first; None for more than most."""
        open_, met = np.ones(len(self.of), dtype=bool), 0
        while open_.any():
            order = self.ahead(open_)
            k = int(order[0])
            if self.missed[k] > MET:  # a bound
                break
            if self.bounds_left[k]:
                self.learn(k, order)
                continue
            if (met := met + 1) > most:
                yield None
                break
            open_[k] = False
            yield self.posed(k, self.task)

    def learn(self, first: int, order: Ints) -> None:
        """Look at the next level of one choice, and of some that are alike in this order."""
        level, base = self.level[first], self.base(self.of[first])
        alike = order[(self.level[order] == level) & (self.of[order] == self.of[first])]
        alike, know = alike[:TOGETHER], base.outlook
        known = () if know is None else know(int(level), self.lower[alike], self.upper[alike])
        for k, (missed, residual) in zip(alike, known, strict=True):
            self.missed[k] = max(self.missed[k], missed)
            least = base.problem.least_measure(residual) + self.cost[k]
            self.value[k] = max(self.value[k], least)
        self.level[alike] += 1


# --- The loop


class _Search:
    """The choices, those that were searched, and how much work that was."""

    def __init__(
        self,
        task: Task,
        starts: Sequence[Floats],
        deadline: float,
        progress: Callable[[str], None],
    ) -> None:
        self.task, self.starts = task, starts
        self.deadline, self.progress = deadline, progress
        self.levels = coarse_to_fine(task)
        few = self.levels[0]
        self.designs = Designs.all_over(few.scene, few.wanted) if few.bands else None
        belows: Sequence[Counts] = [()] if self.designs is None else self.designs.choices
        self.every = Choices(task, belows)
        self.outcomes: list[Searched] = []
        self.failed: EigassignError | None = None
        self.ended: End | None = None
        self.made = self.tried = self.spent = 0
        self.leads: dict[int, Floats] = {}  # what the estimate of a choice came to
        self.keep = KEEP if self.every.is_discrete else 1

    @property
    def ranked(self) -> list[Searched]:
        """Those that were searched, the best first."""
        return best_first(self.outcomes, lambda one: (one.missed, one.best.objective))

    def found(self) -> Found:
        """The best of all choices."""
        self.run()
        if not self.outcomes and self.failed is not None:
            raise self.failed
        every = self.every
        best, *others = self.ranked
        if self.ended is not None:
            ended = best.best._replace(end=self.ended)
            best = replace(best, optima=(ended, *best.optima[1:]))
        solved = [one for level in self.levels for one in level.glances.values()]
        beside = sum(one.exact_solves for one in solved)
        outcomes, scene = [best, *others], self.task.scene
        work = {
            "starts": self.made,
            "exact_solves": len(scene.path.q) + self.spent + beside,
            "lost": tuple(dict.fromkeys(line for one in outcomes for line in one.lost)),
            "ended": self.ended,
        }
        return Found(
            **vars(best) | work,
            task=self.task,
            outcomes=tuple(outcomes),
            choices=every.count,
            untried=int((every.level < DONE).sum()),
            initial=_initial(scene, best.variant),
            every=every,
        )

    def run(self) -> None:
        """Go on with the choice that promises most, as long as one may be better."""
        every = self.every
        try:
            while (order := self.ahead()).size and self.ended is None:
                k = int(order[0])
                if monotonic() > self.deadline:
                    self.ended = End.SECONDS
                elif len(every.of) > 1 and every.level[k] < TRIED and every.bounds_left[k]:
                    every.learn(k, order)
                elif len(every.of) > 1 and every.level[k] < TRIED and not every.is_discrete:
                    self.estimate(k)
                elif self.outcomes and self.spent > SOLVES:
                    break
                else:
                    self.search(k)
        except KeyboardInterrupt:
            self.ended = End.INTERRUPTED
        if not self.outcomes and self.ended is not None:
            self.progress(f"  {self.ended.value}: judging the best that is known")
            near = [own.nearest(self.starts[0]) for own in every.listed]
            nearest = int(np.equal(every.rows, near).all(axis=1).argmax())
            best = every.ahead(np.isin(range(len(every.of)), [*self.leads]))
            self.search(int(best[0]) if best.size else nearest)

    def ahead(self) -> Ints:
        """The choices that may be better than the best few that were searched."""
        every = self.every
        best = self.ranked[: self.keep]
        open_ = every.level < DONE
        if len(best) == self.keep:
            missed, value = best[-1].missed, best[-1].best.objective
            least = value - BEFORE * abs(value)
            beyond = every.missed > MET if missed <= MET else every.missed >= missed - MET
            beyond |= (every.value >= least) & (missed <= MET)
            beyond &= every.level < TRIED  # what is a bound
            every.level[beyond & open_] = EXCLUDED
            open_ &= ~beyond
        late = (every.level < TRIED) & ~every.bounds_left & (self.tried >= TRIES)
        return every.ahead(open_, late)

    def estimate(self, k: int) -> None:
        """What one start leads to, on few samples."""
        variant = self.every.posed(k, self.levels[0])
        steps, self.tried = self.task.scene.file.assignment.steps, self.tried + 1
        start, *_ = self.near(variant)
        self.every.level[k] = TRIED
        self.progress(f"  trying choice {self.tried} of {len(self.every.of)}")
        try:
            found = minimise(variant.problem, start, steps, self.deadline)
        except EigassignError:
            self.every.missed[k] = np.inf
            return
        self.ended = found.end if found.end in STOPPED else self.ended
        self.every.missed[k], self.every.value[k] = worth(found)
        self.leads[k] = found.y
        self.spent += variant.response.exact_solves

    def near(self, variant: PosedProblem) -> list[Floats]:
        """Designs to search a choice from; few that are like those of other choices."""
        starts, least = [*self.starts], most_starts(self.task.scene.file, alone=False)
        if self.designs is not None and not self.task.followers:
            modes = variant.requirements.modes
            starts = [*self.designs.best_of(modes, variant.worth, PROMISING), *starts]
        if self.every.listed:
            starts = [*(one.best.y for one in self.ranked[:1]), *starts][: min(2, least)]
        return [np.clip(y, variant.problem.lower, variant.problem.upper) for y in starts]

    def search(self, k: int) -> None:
        """The optima of a choice from all starts, with its bands clear between the samples too."""
        every, below = self.every, self.every.belows[self.every.of[k]]
        every.level[k] = DONE
        margins = self.task.margins
        try:
            found = self.searched(k, margins, (), not every.is_discrete)
        except EigassignError as error:
            self.failed, every.missed[k] = self.failed or error, np.inf
            if len(every.of) == 1:
                raise
            return
        if margins and MET < found.missed <= 2.0 * MARGIN:  # but for the margin it may be met
            margins = (Margin(),) * len(margins)
            found = self.searched(k, margins, [found.best.y], False)
        missed, rows = found.missed, _clearances(self.task, below, found.best.y)
        for drawn in range(DRAWN if missed <= MET and not self.ended else 0):
            if not wanting(rows):
                break
            margins = _drawn_in(margins, rows, 1.1 if 2 * drawn < DRAWN else 2.0)
            again = self.searched(k, margins, [found.best.y], False)
            if again.missed > MET:
                break
            found, rows = again, _clearances(self.task, below, again.best.y)
        missed = missed if missed > MET else wanting(rows)
        every.missed[k], every.value[k] = missed, found.best.objective
        rows_of_lists = tuple(every.rows[k].tolist())
        self.outcomes.append(
            replace(found, rows=rows_of_lists, below=below, missed=missed, clearances=rows)
        )

    def searched(
        self, k: int, margins: tuple[Margin, ...], near: Sequence[Floats], spread: bool
    ) -> Searched:
        """The optima of a choice from some designs, or from all starts."""
        which = self.levels[-1:] if self.every.is_discrete else self.levels
        levels = tuple(replace(level, margins=margins) for level in which)

        def posed(task: Task) -> PosedProblem:
            return self.every.posed(k, task)

        few = self.every.posed(k, replace(self.levels[0], margins=margins))  # as designs are solved
        starts = near or self.near(few)[: 1 if self.every.is_discrete else None]
        if self.ended and not near and k in self.leads:
            starts = [self.leads[k]]
        alone = len(self.every.of) == 1
        most = most_starts(self.task.scene.file, alone) if spread else 0
        choice = "" if alone else f"choice {len(self.outcomes) + 1} of {len(self.every.of)}, "

        def progress(line: str) -> None:
            self.progress(f"  {choice}{line}")

        found = search_starts(levels, posed, starts, self.deadline, progress, most, self.ended)
        self.made, self.spent = self.made + found.starts, self.spent + found.exact_solves
        self.ended = found.ended or self.ended
        return found


def can_be_met(found: Found, names: Sequence[str], most: int, steps: int) -> bool | None:
    """Whether some choice meets the limits ``names`` together; None where that cannot be said."""
    named = [band.name in names for band in found.task.bands]
    belows = [
        tuple(n if own else None for n, own in zip(below, named, strict=True))
        for below in found.every.belows
    ]
    y = found.best.y
    for variant in Choices(found.task, list(dict.fromkeys(belows)), names).left(most):
        if variant is None:
            return None
        lower, upper = variant.problem.lower, variant.problem.upper
        try:
            met = minimise(variant.problem, np.clip(y, lower, upper), steps)
        except EigassignError:
            return True
        if met.seen.violation <= MET:
            return True
    return False


def _drawn_in(
    margins: tuple[Margin, ...], rows: Sequence[ClearanceRow], more: float
) -> tuple[Margin, ...]:
    """Margins by the room that lacked: first by what the model raises modes, then a little more."""
    found = []
    for (room, raised), row in zip(margins, rows, strict=True):
        if not row.clear and row.raised is not None:
            rest = -row.room - max(row.raised - raised, 0.0)
            room, raised = room + more * max(rest, 0.0) + MARGIN, max(row.raised, raised)
        found.append(Margin(room, raised))
    return tuple(found)


def _clearances(task: Task, below: Counts, y: Floats) -> tuple[ClearanceRow, ...]:
    """The bands that are not left out, checked at a design, in the scenario of least room."""
    model, path, designs, found = task.scene.model, task.scene.path, task.designs(y), []
    for band, k in zip(task.bands, below, strict=True):
        if k is not None:
            rows = (check_band(model, path, band, k, one, task.followers) for one in designs)
            found.append(min(rows, key=lambda row: (row.clear, row.room)))
    return tuple(found)


def _initial(scene: Scene, variant: PosedProblem) -> tuple[float, float]:
    """Violation (of bounds and constraints too, relative to their ranges) and F at the start."""
    y, problem, (lower, upper) = scene.initial, variant.problem, scene.bounds
    try:
        seen = problem.appraise(y)
    except EigassignError:
        if not variant.task.scenarios:
            raise
        seen = variant.requirements.appraise(y, variant.response(y))
    width = np.where(upper > lower, upper - lower, 1.0)
    outside = np.maximum(lower - y, y - upper) / width
    worst = max(seen.violation, float(outside.max(initial=0.0)))
    for row in problem.constraints:
        value, size = row.coefficients @ y, np.abs(row.coefficients) @ width
        worst = max(worst, float(max(row.lower - value, value - row.upper) / (size or 1.0)))
    return worst, problem(y, seen)
