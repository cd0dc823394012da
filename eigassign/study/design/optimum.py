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
from eigassign.assignment.catalogues.choosing import MOST, RELAXED, Chosen, choose, combinations
from eigassign.assignment.checks import frozen
from eigassign.assignment.exact.design_problem import MET, best_first
from eigassign.assignment.exact.sequential import End, Optimum, worth
from eigassign.assignment.requirements.named_modes import followed_modes
from eigassign.assignment.requirements.requirement import Requirement, Solved
from eigassign.errors import InfeasibleError
from eigassign.study.design.clearance import check_clear, wanting
from eigassign.study.design.one_shot import catalogues
from eigassign.study.design.response import reduced_models
from eigassign.study.design.starts import Searched, coarse_to_fine, most_starts, search_starts
from eigassign.study.design.variants import (
    PosedProblem,
    Task,
    counts_of,
    possible_counts,
    variant_of,
)
from eigassign.study.results import ClearanceRow
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]
MARGIN = 1e-5  # relative, by which modes keep off a band at the samples at least
VARIANTS = 24  # tried at most, the likeliest: of more it is said how many were left out


@dataclass(frozen=True)
class Found:
    """The best design, what it was chosen among, and how much work that was."""

    variant: PosedProblem
    optima: tuple[Optimum, ...]  # distinct local optima of the variant, the best first
    variants: tuple[Searched, ...]  # all that were tried, the best first
    initial: tuple[float, float]  # violation and objective of the initial design
    clearances: tuple[ClearanceRow, ...]  # of every band along every trajectory
    starts: int
    exact_solves: int
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
) -> Found:
    """The best local optimum of the exact problem from the initial design and ``starts``.

    Bands to keep out of are checked (`clearance`): where modes come too near between the samples,
    the limits at the samples are drawn in by what is lacking, and the answer is sought anew from
    where it was. It stays as it was where limits that are drawn in so far cannot be met.
    """
    seconds, margin = scene.file.assignment.seconds, MARGIN
    deadline = np.inf if seconds is None else monotonic() + seconds
    designs = [scene.initial, *starts][: most_starts(scene.file)]
    models = None if followed_modes(scene.file) else reduced_models(scene)

    def sought(designs: Sequence[Floats], margin: float) -> Found:
        task = Task(scene, tuple(wanted), margin)
        return _best_variant(task, coarse_to_fine(task, models), designs, deadline, progress)

    found = sought(designs, margin)
    for _ in range(4):  # each time drawn in by twice the room that was lacking
        lacking, ended = wanting(found.clearances), (End.SECONDS, End.INTERRUPTED)
        if not lacking or found.best.seen.violation > MET or found.best.end in ended:
            break
        margin += 2.0 * lacking + MARGIN
        other = sought([found.best.y], margin)
        if other.best.seen.violation > MET:
            break
        found = other
    return found


def _best_variant(
    task: Task,
    levels: Sequence[Task],
    starts: Sequence[Floats],
    deadline: float,
    progress: Callable[[str], None],
) -> Found:
    """The best local optimum of all variants.

    No design is returned that is worse than the initial one. Where none meets all limits, it is the
    one that misses them least, relative to the limits.
    """
    scene, listed = task.scene, catalogues(task.scene.file)
    choices, total = possible_counts(scene, task.bands)
    if task.bands and listed and prod(len(own.rows) for own in listed) <= MOST:
        _, lower, upper = combinations(listed, *scene.bounds)
        every = counts_of(scene, task.bands, lower) if np.array_equal(lower, upper) else []
        choices, total = (every, len(every)) if every else (choices, total)
    tried: list[Searched] = []
    for below in choices[:VARIANTS]:
        if listed:
            found = _search_catalogues(task, below, listed, levels, starts, deadline, progress)
        else:
            found = search_starts(levels, below, starts, tried, deadline, progress)
        tried.append(found)
        ended, chosen = tried[-1].ended, tried[-1].chosen
        if ended or (chosen and chosen.search is None):
            break
    variants = best_first(tried, lambda one: worth(one.optima[0]))
    variant, (best, *others) = variants[0].variant, variants[0].optima
    return Found(
        variant=variant,
        optima=(best if ended is None else replace(best, end=ended), *others),
        variants=tuple(variants),
        initial=_initial(scene, variant),
        clearances=tuple(_clearances(task, variant, best.y)),
        starts=sum(one.starts for one in tried),
        exact_solves=len(scene.path.q)
        + sum(one.exact_solves for one in (*tried, *task.glances.values())),
        chosen=variants[0].chosen,
        lost=tuple(dict.fromkeys(line for one in tried for line in one.lost)),
        untried=total - len(tried),
    )


def _search_catalogues(
    task: Task,
    below: tuple[int, ...],
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
    if prod(len(own.rows) for own in listed) > MOST:
        relaxed = search_starts(levels, below, starts, (), deadline, progress)
        near = [*(found.y for found in relaxed.optima[:RELAXED]), *near]

    def chosen_of(variant: PosedProblem) -> Chosen:
        def lacking(y: Floats) -> float:
            return wanting([*_clearances(task, variant, y)])

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
        lost=tuple(variant.response.lost),
        chosen=chosen,
    )


def _clearances(task: Task, variant: PosedProblem, y: Floats) -> Iterator[ClearanceRow]:
    q = task.scene.path.at(y)[0]
    for band, (_, below) in zip(task.bands, variant.below, strict=True):
        yield check_clear(task.scene.model, band, below, q[band.rows], y)


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
