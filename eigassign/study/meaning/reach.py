"""What can be reached within the bounds.

Where all frequencies are monotone in every parameter (`response`), two corners of the bounds prove
between what values each mode stays at every sample. Otherwise the target is searched for at the
samples where it is missed most, each by itself: a sample at which no design comes near enough, from
several starts, is out of reach. A target that is missed somewhere but within reach at every sample
is not called unreachable: there, one design cannot serve all samples.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.exact.design_problem import MET
from eigassign.assignment.exact.sequential import minimise
from eigassign.assignment.requirements.kinds import AssignedFrequency, Margin
from eigassign.assignment.requirements.requirement import Requirement, Solved
from eigassign.errors import EigassignError
from eigassign.study.design.followed import solve_design
from eigassign.study.design.search.optimum import Choices
from eigassign.study.design.search.response import corners, effects
from eigassign.study.design.search.variants import SPREAD, Designs, Task
from eigassign.study.results import RangeRow
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]
LIMIT = 1e-4  # of a limit: by so much it must be missed to be called out of reach
STEPS, STARTS = 30, 3  # of a search at one sample
COMBINED = 64  # combinations of catalogues, each searched there
CHOICES = 8  # of the numbers of modes below bands there
R = TypeVar("R", bound=Requirement)


def proved_ranges(scene: Scene) -> tuple[Solved, Solved] | None:
    """Lowest and highest frequencies of all designs within the bounds, of numbered modes only.

    None where that is not known of every parameter, or a corner of the bounds has no frequencies.
    """
    lower, upper = scene.bounds
    if not np.all((effects(scene.file) != 0.0) | (lower == upper)):
        return None
    softest, stiffest = corners(scene.file, lower, lower, upper)
    try:
        return solve_design(scene, (), softest), solve_design(scene, (), stiffest)
    except EigassignError:
        return None


def reach_rows(wanted: Sequence[Requirement], ranges: tuple[Solved, Solved]) -> Iterator[RangeRow]:
    """The range of each target's curve at every sample, and the least error that is left."""
    for w in wanted:
        if w.terms and not w.followed:
            error = float(w.least_errors(*ranges).max())
            how = "proved" if len(w.terms) == 1 else "bounded"
            yield RangeRow(w.label, *w.curve_range(*ranges), how, error)


def misses(wanted: Requirement, exact: Solved, max_error: float) -> bool:
    """True if a target is missed by more than is allowed, ``max_error`` of a wanted frequency."""
    return bool(np.abs(wanted.errors(exact)).max() > _allowed(wanted, max_error))


def _allowed(wanted: Requirement, max_error: float) -> float:
    return max_error if wanted.is_goal else LIMIT


def unreachable(
    scene: Scene,
    wanted: Sequence[Requirement],
    y: Floats,
    exact: Solved,
    max_error: float,
    ranges: tuple[Solved, Solved] | None,
) -> Iterator[str]:
    """The targets that y misses and that are out of reach at some sample, in words.

    A wanted frequency is out of reach where no design that keeps all limits comes near enough; a
    limit where no design does that keeps the linear ones: with others it contradicts.
    """
    for w in wanted:
        if not misses(w, exact, max_error):
            continue
        allowed, errors = _allowed(w, max_error), w.errors(exact)
        known = ranges is not None and not w.followed
        # of listed values one beyond a limit may meet it, though another is nearer to that
        listed = bool(scene.file.design.catalogues) and not w.is_goal
        others = [*scene.limits, *(one for one in wanted if not one.is_goal)] if w.is_goal else []
        if known and ranges is not None:
            left = w.least_errors(*ranges)
            k = int(left.argmax())
            if left[k] > allowed:
                low, high = (float(values[k]) for values in w.curve_range(*ranges))
                how = f"between {low:.4g} and {high:.4g} Hz within the bounds, proved"
                free = not (others or scene.constraints or scene.file.design.catalogues)
                best: float | None = low if low > w.lower[k] else high
                if not free or len(w.terms) > 1:  # the corners need not keep all limits
                    best = None if listed else _nearest(scene, w, others, k, y, allowed)
                    how = how if best is None else f"found by a search; it is {how}"
                yield _words(scene, w, k, best, how)
                continue
        if w.terms and (others or not known) and not listed:
            yield from _searched(scene, w, others, y, errors, allowed)


def _words(scene: Scene, wanted: Requirement, k: int, reached: float | None, how: str) -> str:
    """The frequency that is ``reached`` at sample k of a target, and the one that was asked for."""
    asked = float(wanted.hz[k])
    curve = wanted.curve_name if len(wanted.terms) == 1 else f"the {wanted.axis}"
    where = f"{wanted.label} is out of reach at {scene.path.where(wanted.rows.start + k)}"
    said = f"{where}: {asked:.4g} Hz was asked, "
    if reached is None:
        return f"{said}{curve} is {how}"
    most = "highest" if reached < asked else "lowest"
    return f"{said}the {most} that {curve} reaches there is {reached:.4g} Hz ({how})"


def _searched(
    scene: Scene,
    wanted: Requirement,
    others: Sequence[Requirement],
    y: Floats,
    errors: Floats,
    allowed: float,
) -> Iterator[str]:
    """The first of the samples missed most, above and below, at which no design is near enough."""
    missed = [int(errors.argmax()), *([int(errors.argmin())] if wanted.is_goal else [])]
    for k in dict.fromkeys(k for k in missed if abs(errors[k]) > allowed):
        nearest = _nearest(scene, wanted, others, k, y, allowed)
        if nearest is not None and abs(nearest / wanted.hz[k] - 1.0) > allowed:
            how = f"found by a search from {STARTS} starts within the limits"
            yield _words(scene, wanted, k, nearest, how)
            return


def _nearest(
    scene: Scene,
    wanted: Requirement,
    others: Sequence[Requirement],
    k: int,
    y: Floats,
    allowed: float,
) -> float | None:
    """The frequency nearest to the one wanted at sample k of the target, by a search of its own.

    Within the linear limits and those of the ``others`` that hold at this sample, with each
    combination of catalogues. The search ends with the first start that leads within ``allowed`` of
    it. None where none leads to a design within the limits, or there are many combinations.
    """
    at, goal = wanted.rows.start + k, wanted.hz[k : k + 1]
    there = AssignedFrequency(
        *(wanted.label, wanted.place, wanted.terms, slice(0, 1), goal, goal),
        followed=wanted.followed,
    )
    alone = replace(scene, trajectory=scene.path.chosen([at]))
    beside = [_at(one, at) for one in others if one.mode_terms and _holds(one, at)]
    bands = [_at(band, at) for one in others for band in one.bands if _holds(band, at)]
    names = {one.name for one in (*others, *scene.limits) if one in others or one.constraint}
    task = Task(alone, (there, *beside, *bands), (Margin(),) * len(bands))
    belows = Designs.all_over(alone, bands, SPREAD).choices[:CHOICES]
    every, (lower, upper) = Choices(task, belows, y, names), scene.bounds
    if every.count > COMBINED * len(belows):
        return None
    found = []
    for variant in filter(None, every.left(every.count)):
        for start in (y, 0.5 * (lower + upper), scene.initial)[:STARTS]:
            problem = variant.problem
            try:
                best = minimise(problem, np.clip(start, problem.lower, problem.upper), STEPS)
            except EigassignError:
                continue
            if best.seen.violation > MET:
                continue
            found.append((abs(best.seen.residual[0]), (best.seen.residual[0] + 1.0) * goal[0]))
            if found[-1][0] <= allowed:
                return float(found[-1][1])
    return float(min(found)[1]) if found else None


def _holds(one: Requirement, at: int) -> bool:
    return bool(one.rows.start <= at < one.rows.stop)


def _at(one: R, at: int) -> R:
    """A requirement at one of its samples, which is the only one there is."""
    own = slice(at - one.rows.start, at - one.rows.start + 1)
    return replace(one, rows=slice(0, 1), lower=one.lower[own], upper=one.upper[own], along=())
