"""The design that meets a case's targets best, by the sequential method on exact frequencies.

Every problem that the targets make (`variants`) is tried from several starts, and the best kept.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import prod
from time import monotonic

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.catalogues.branching import KEEP, ListedValues
from eigassign.assignment.catalogues.choosing import RELAXED, Chosen, are_few, choose, combinations
from eigassign.assignment.exact.design_problem import MET, best_first
from eigassign.assignment.exact.optima import NOTHING, SAME, Tally
from eigassign.assignment.exact.sequential import Optimum, minimise, worth
from eigassign.assignment.requirements.band import Margin
from eigassign.assignment.requirements.named_modes import followed_modes
from eigassign.assignment.requirements.requirement import Requirement, Solved
from eigassign.assignment.targets import frozen
from eigassign.case.case_file import CaseFile
from eigassign.errors import EigassignError, InfeasibleError
from eigassign.study.design.clearance import check_band, wanting
from eigassign.study.design.one_shot import catalogues
from eigassign.study.design.search.response import reduced_models
from eigassign.study.design.search.starts import (
    Searched,
    coarse_to_fine,
    continued,
    most_starts,
    search_starts,
)
from eigassign.study.design.search.variants import (
    SPREAD,
    Designs,
    PosedProblem,
    Task,
    counts_of,
    lacking,
    variant_of,
)
from eigassign.study.results import ClearanceRow
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]
MARGIN = 1e-5  # relative, by which modes keep off a band at the samples at least
SEARCHES = 100  # of branches: from then on only the best goes on, in its likeliest part
# Designs all over the bounds from which a branch is searched too: with 1, 4 of 7 known cases ended
# up to 45 % short of their best optimum, with 4 none
PROMISING = 4
DRAWN = 6  # times that the limits of a branch are drawn in
FEW = 5  # branches of an ended search that are completed
Counts = tuple[int | None, ...]  # of modes below each band, None of one that is left out


@dataclass(frozen=True)
class Found:
    """The best design, what it was chosen among, and how much work that was."""

    task: Task
    counts: tuple[Sequence[int], ...]  # the numbers of modes that may be below each band
    choices: int  # of them for all bands
    variant: PosedProblem
    optima: tuple[Optimum, ...]  # distinct local optima of the variant, the best first
    variants: tuple[Searched, ...]  # it, and others with some of the bands, the best first
    initial: tuple[float, float]  # violation and objective of the initial design
    clearances: tuple[ClearanceRow, ...]  # of every band along every trajectory
    starts: int
    tally: Tally | None  # of the variant; None of catalogues
    exact_solves: int
    searches: int
    chosen: Chosen | None = None  # from the catalogues, where there are any; then of `optima`
    lost: tuple[str, ...] = ()  # designs passed over because a followed mode is lost there
    untried: int = 0  # choices of the numbers of modes below the bands

    @property
    def best(self) -> Optimum:
        """The best design."""
        return self.optima[0]

    def initial_solved(self, count: int) -> Solved | None:
        """The initial design as the search has solved it; None without so many modes."""
        solved = self.variant.response.solved
        if solved is None or solved.hz.shape[1] < count:
            return None
        return replace(solved, hz=frozen(solved.hz[:, :count]))


def find_optimum(
    scene: Scene,
    wanted: Sequence[Requirement],
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
    return _Tree(scene, wanted, designs, deadline, progress, scenarios).found()


def deadline_of(file: CaseFile) -> float:
    """The time of `time.monotonic` when a search that begins now has to end."""
    seconds = file.assignment.seconds
    return np.inf if seconds is None else monotonic() + seconds


@dataclass(frozen=True)
class _Branch:
    """All choices that have some numbers of modes below bands."""

    below: Counts
    searched: Searched
    margins: tuple[Margin, ...]
    was: Counts | None = None  # of a settled branch, before it was settled
    drawn: int = 0  # times that its limits were drawn in
    is_alone: bool = True  # of a settled one: what is beside it was searched

    @property
    def best(self) -> Optimum:
        """The best design found."""
        return self.searched.optima[0]


class _Tree:
    """Branch and bound over the numbers of modes below the bands.

    A branch is searched with some of the bands only, the first with none: as far as a few starts
    find its optimum, no choice of it has a better one. The best branch of all is taken. If its
    optimum is in a band that was left out, it is divided by the number of modes below this band;
    otherwise it is settled, from all starts, on all samples and exactly.

    Bands of an answer are checked (`clearance`): where modes come too near between the samples, the
    limits at the samples are drawn in by what is lacking, and the answer is sought anew from where
    it was. It stays as it was where no choice can be met with limits that are drawn in so far.
    """

    def __init__(
        self,
        scene: Scene,
        wanted: Sequence[Requirement],
        starts: Sequence[Floats],
        deadline: float,
        progress: Callable[[str], None],
        scenarios: Sequence[Floats] = (),
    ) -> None:
        bands = sum(len(one.bands) for one in wanted)
        margins = (Margin(MARGIN),) * bands
        self.task = Task(scene, tuple(wanted), margins, scenarios=tuple(scenarios))
        models = None if followed_modes(scene.file) else reduced_models(scene)
        self.levels: dict[tuple[Margin, ...], tuple[Task, ...]] = {
            self.task.margins: coarse_to_fine(self.task, models)
        }
        self.listed = catalogues(scene.file)
        self.starts, self.deadline, self.progress = starts, deadline, progress
        few = self.at(self.task.margins)[0]
        self.designs = Designs.all_over(few.scene, few.wanted, SPREAD) if few.bands else None
        self.counts: tuple[Sequence[int], ...] = ()
        self.every: list[tuple[int, ...]] = []  # choices that combinations of catalogues have
        if self.designs is not None:
            self.counts, self.every = self.designs.counts, _of_combinations(self.task, self.listed)
        if self.every:
            both = zip(self.counts, zip(*self.every, strict=True), strict=True)
            self.counts = tuple(sorted({*some, *more}) for some, more in both)
        self.made: list[Searched] = []
        self.untried = 0  # choices that no search stands for

    def found(self) -> Found:
        """The best settled branch, and what it was chosen among."""
        open_ = list(self.roots())
        answer: _Branch | None = None
        unclear: list[_Branch] = []
        while open_ and answer is None and not self.stopped:
            best, *open_ = best_first(open_, _promise)
            missed = best.best.seen.violation
            if missed > MET and unclear:
                break
            if best.was is None:
                if len(self.made) > SEARCHES:
                    self.untried += sum(self.size(one.below) for one in open_ if one.was is None)
                    open_ = [one for one in open_ if one.was is not None]
                open_ += self.divided(best)
                continue
            if self.counts and MET < missed <= 2.0 * MARGIN and not best.drawn:
                none = (Margin(),) * len(self.counts)  # but for the margin it may be met
                best = self.branch(best.below, [best.best.y], none, best.was, DRAWN)
                missed = best.best.seen.violation
            if not best.is_alone:
                open_ += [replace(best, is_alone=True), *self.beside(best)]
                continue
            rows = _clearances(self.task, best.below, best.best.y)
            if missed > MET or not wanting(rows):
                answer = best
                continue
            drawn = self.drawn_in(best, rows)
            if drawn is None or drawn.best.seen.violation > MET:
                unclear.append(best)
            else:
                open_.append(drawn)
        if answer is None and self.stopped:
            self.untried += sum(self.size(one.below) for one in open_ if one.was is None)
            unclear += map(self.completed, best_first(open_, _promise)[:FEW])
        answer = answer or best_first(unclear, _promise)[0]
        others = best_first((one.searched for one in open_), lambda one: worth(one.optima[0]))
        return self.account(answer, others)

    def roots(self) -> Iterator[_Branch]:
        """Yield the branch without bands; or every choice that combinations of catalogues have.

        Where none of these can be met, the others too: one may be missed by less.
        """
        none: Counts = (None,) * len(self.counts)
        if not self.every:
            yield self.branch(none, self.starts, was=None if none else none)
        known, missed = self.every, True
        likely = self.designs.choices if self.designs is not None and known else ()
        others = [one for one in likely if one not in known]
        for k, below in enumerate([*known, *others]):
            if k == len(known):
                if not missed:
                    return
                self.every = [*known, *others]
            if k == SEARCHES or (k and self.stopped):
                self.untried = len(self.every) - k
                return
            root = self.branch(below, self.starts, was=below)
            missed = missed and root.best.seen.violation > MET
            yield root

    def at(self, margins: tuple[Margin, ...]) -> tuple[Task, ...]:
        """The levels with limits drawn in so far."""
        if margins not in self.levels:
            levels = (replace(one, margins=margins) for one in self.levels[self.task.margins])
            self.levels[margins] = tuple(levels)
        return self.levels[margins]

    @property
    def stopped(self) -> bool:
        """True where the last search was ended, or that of catalogues too long."""
        last = self.made[-1]
        return last.ended is not None or (last.chosen is not None and last.chosen.search is None)

    def account(self, answer: _Branch, others: Sequence[Searched]) -> Found:
        """The answer with what it was chosen among, and how much work that was."""
        scene, (best, *more) = self.task.scene, answer.searched.optima
        variant = answer.searched.variant
        own = [one.tally for one in self.made if one.variant.below == variant.below and one.tally]
        ended = self.made[-1].ended
        return Found(
            task=self.task,
            counts=self.counts,
            choices=len(self.every) or self.size((None,) * len(self.counts)),
            variant=variant,
            optima=(best if ended is None else replace(best, end=ended), *more),
            variants=(answer.searched, *others),
            initial=_initial(scene, variant),
            clearances=_clearances(self.task, answer.below, best.y),
            starts=sum(one.starts for one in self.made),
            tally=max(own, key=lambda tally: tally.starts, default=None),
            exact_solves=len(scene.path.q)
            + sum(one.exact_solves for one in self.made)
            + sum(
                one.exact_solves
                for levels in self.levels.values()
                for one in levels[-1].glances.values()
            ),
            searches=len(self.made),
            chosen=answer.searched.chosen,
            lost=tuple(dict.fromkeys(line for one in self.made for line in one.lost)),
            untried=self.untried,
        )

    def branch(
        self,
        below: Counts,
        near: Sequence[Floats],
        margins: tuple[Margin, ...] | None = None,
        was: Counts | None = None,
        drawn: int = 0,
    ) -> _Branch:
        """The branch as it is searched; from all starts if it is settled and was not drawn in."""
        levels = self.at(margins or self.task.margins)
        near, clock = near[: most_starts(self.task.scene.file)], (self.deadline, self.progress)
        if self.listed:
            searched = _search_catalogues(levels[-1], below, self.listed, levels, near, *clock)
        else:
            made = sum(one.starts for one in self.made)
            spread = was is not None and not drawn
            levels = levels if was is not None else levels[:1]
            searched = search_starts(levels, below, near, made, *clock, spread)
        self.made.append(searched)
        is_alone = drawn > 0 or not was or None not in was
        return _Branch(below, searched, levels[-1].margins, was, drawn, is_alone)

    def divided(self, branch: _Branch) -> Iterator[_Branch]:
        """Yield the parts of a branch by the number of modes below the band that it is in most.

        Or the branch settled, where it is in no band by more than it misses anyway; where the room
        is to be wide, where every band leaves as much as there is.
        """
        errors, missed = self.lacking(branch), max(branch.best.seen.violation, MET)
        if self.task.scene.file.assignment.objective == "widest" and missed <= MET:
            found = branch.searched.variant
            has_rows = len(found.requirements.aims) > 0
            missed = found.problem.measure(branch.best.seen.residual) + MET if has_rows else -np.inf
        nearest = [int(own.argmin()) for own in errors]
        open_ = [k for k, n in enumerate(branch.below) if n is None and errors[k].min() > missed]
        if not open_:
            both = zip(branch.below, nearest, strict=True)
            settled = tuple(n if own is None else own for own, n in both)
            yield self.branch(settled, [branch.best.y, *self.starts], was=branch.below)
            return
        band = max(open_, key=lambda k: float(errors[k].min()))
        counts = sorted({*self.counts[band], nearest[band]}, key=lambda n: float(errors[band][n]))
        if len(self.made) > SEARCHES:
            counts, others = counts[:1], counts[1:]
            self.untried += sum(self.size(_with(branch.below, band, n)) for n in others)
        for n in counts:
            below = _with(branch.below, band, n)
            if self.stopped:
                self.untried += self.size(below)
            else:
                yield self.branch(below, self.near(branch, below))

    def beside(self, branch: _Branch) -> Iterator[_Branch]:
        """Yield the choices that a branch was settled without: other numbers below its bands."""
        below = branch.was or ()
        for band in (k for k, n in enumerate(below) if n is None and not self.stopped):
            for n in self.counts[band]:
                if n != branch.below[band]:
                    other = _with(below, band, n)
                    yield self.branch(other, self.near(branch, other))
            below = _with(below, band, branch.below[band])

    def drawn_in(self, branch: _Branch, rows: Sequence[ClearanceRow]) -> _Branch | None:
        """The branch with limits drawn in by the room that was lacking; None after a few times.

        First by what the model raises the mode above the band, then by a little more than the rest.
        """
        if branch.drawn == DRAWN:
            return None
        margins, more = list(branch.margins), 1.1 if 2 * branch.drawn < DRAWN else 2.0
        for k, row in enumerate(rows):
            room, raised = margins[k]
            if not row.clear and row.raised is not None:
                rest = -row.room - max(row.raised - raised, 0.0)
                room += more * max(rest, 0.0) + MARGIN
                margins[k] = Margin(room, max(row.raised, raised))
        near, drawn = [branch.best.y], branch.drawn + 1
        return self.branch(branch.below, near, tuple(margins), branch.was, drawn)

    def completed(self, branch: _Branch) -> _Branch:
        """The best design of a search that was ended, with the numbers that it is nearest to."""
        if branch.was is not None:
            return branch
        nearest = zip(branch.below, self.lacking(branch), strict=True)
        below = tuple(int(own.argmin()) if n is None else n for n, own in nearest)
        variant = variant_of(self.at(branch.margins)[-1], below)
        found = continued(branch.best, minimise(variant.problem, branch.best.y, 0))
        searched = replace(branch.searched, variant=variant, optima=(found,), chosen=None)
        return replace(branch, below=below, searched=searched)

    def near(self, branch: _Branch, below: Counts) -> list[Floats]:
        """Designs to search a part of a branch from."""
        few = self.at(self.task.margins)[0]
        if self.designs is None or few.followers:
            return [one.y for one in branch.searched.optima[: 1 + PROMISING]]
        return [branch.best.y, *self.designs.best_of(variant_of(few, below), PROMISING)]

    def lacking(self, branch: _Branch) -> list[Floats]:
        """What the optimum lacks to be clear of each band, by the number of modes below it."""
        found = lacking(self.at(branch.margins)[-1], branch.best.y)
        return [
            np.pad(own, (0, max(max(each) + 1 - len(own), 0)), constant_values=np.inf)
            for own, each in zip(found, self.counts, strict=True)
        ]

    def size(self, below: Counts) -> int:
        """The number of choices in a branch."""
        return prod(len(c) for c, n in zip(self.counts, below, strict=True) if n is None)


def _promise(branch: _Branch) -> tuple[float, float]:
    """Violation and F; of a settled branch F less what makes no difference."""
    missed, value = worth(branch.best)
    return missed, value if branch.was is None else value - SAME * abs(value) - NOTHING


def _with(below: Counts, band: int, count: int | None) -> Counts:
    return (*below[:band], count, *below[band + 1 :])


def _search_catalogues(
    task: Task,
    below: Counts,
    listed: Sequence[ListedValues],
    levels: Sequence[Task],
    starts: Sequence[Floats],
    deadline: float,
    progress: Callable[[str], None],
) -> Searched:
    """The best combinations; where none meets the linear limits, these are missed as others are.

    More than can be gone through are searched about the local optima without lists.
    """
    steps, near = task.scene.file.assignment.steps, starts[: KEEP + 1]
    relaxed = Searched(variant_of(task, below))
    if not are_few(listed, *task.scene.bounds):
        relaxed = search_starts(levels, below, starts, 0, deadline, progress)
        near = [*(found.y for found in relaxed.optima[:RELAXED]), *near]

    def chosen_of(variant: PosedProblem) -> Chosen:
        def lacking(y: Floats) -> float:
            return wanting(_clearances(task, below, y))

        return choose(variant.problem, listed, near, steps, deadline, progress, lacking)

    variant = variant_of(task, below)
    try:
        chosen = chosen_of(variant)
    except InfeasibleError:
        variant = variant_of(task, below, missed=True)
        chosen = chosen_of(variant)
    return Searched(
        variant=variant,
        optima=chosen.optima,
        starts=relaxed.starts or min(len(near), RELAXED),
        exact_solves=chosen.appraisals * len(task.scene.path.q) + relaxed.exact_solves,
        ended=chosen.ended,
        lost=tuple(variant.response.lost),
        chosen=chosen,
    )


def _of_combinations(task: Task, listed: Sequence[ListedValues]) -> list[tuple[int, ...]]:
    """The choices that all combinations of catalogues have, where they are all that is designed."""
    are_followed = any(band.followed for band in task.bands)
    if not listed or are_followed or not are_few(listed, *task.scene.bounds):
        return []
    _, lower, upper = combinations(listed, *task.scene.bounds)
    return counts_of(task.scene, task.bands, lower) if np.array_equal(lower, upper) else []


def _clearances(task: Task, below: Counts, y: Floats) -> tuple[ClearanceRow, ...]:
    """The bands that are not left out, checked at a design, in the scenario of least room."""
    return tuple(
        min(
            (check_band(task.scene, task.followers, band, k, one) for one in task.designs(y)),
            key=lambda row: (row.clear, row.room),
        )
        for band, k in zip(task.bands, below, strict=True)
        if k is not None
    )


def _initial(scene: Scene, variant: PosedProblem) -> tuple[float, float]:
    """Violation (of bounds and constraints too, relative to their ranges) and F at the start.

    Alone where it has no answer in a scenario.
    """
    y, problem = scene.initial, variant.problem
    try:
        seen = problem.appraise(y)
    except EigassignError:
        if not variant.task.scenarios:
            raise
        seen = variant.requirements.appraise(y, variant.response(y))
    width = np.where(problem.upper > problem.lower, problem.upper - problem.lower, 1.0)
    outside = np.maximum(problem.lower - y, y - problem.upper) / width
    worst = max(seen.violation, float(outside.max(initial=0.0)))
    for row in problem.constraints:
        value, size = row.coefficients @ y, np.abs(row.coefficients) @ width
        worst = max(worst, float(max(row.lower - value, value - row.upper) / (size or 1.0)))
    return worst, problem(y, seen)
