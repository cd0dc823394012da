"""The exact optimum: quadratic programs in a row, each inside a trust region, judged exactly.

A step (`step`) is taken only if the exact merit, F plus ν times the largest excess, falls by a
tenth of what its program promised; a step spoilt by curvature is corrected once. Near an optimum
the fall, of second order, drowns in round-off before the slopes balance: there a step is taken if
it halves the stationarity and costs no more than round-off. The trust region grows and shrinks with
how well promises are kept. The answer is judged by first-order optimality of the exact problem
(`stationarity`).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np

from eigassign.assignment.checks import Floats, frozen
from eigassign.assignment.exact.design_problem import (
    MET,
    ON,
    Appraisal,
    DesignPoint,
    DesignProblem,
    UnitBox,
    best_first,
    merit,
)
from eigassign.assignment.exact.stationarity import BindingLimit, active_limits, stationarity
from eigassign.assignment.exact.step import SMALLEST, ProposedStep, TrustRegion, step_program
from eigassign.assignment.program import SNAP
from eigassign.errors import EigassignError

FIRST, LARGEST = 0.3, 1.0  # trust region, of the bounds
TAKEN, GOOD = 0.1, 0.7  # of the promised fall: a step is taken, the region doubled
OPTIMAL = 1e-7  # stationarity that is accepted
ROUND_OFF = 1e-12  # of F
NEAR = 1e-4  # of the bounds: a step longer than this that promises nothing teaches curvature


class End(StrEnum):
    """Why the steps ended."""

    OPTIMAL = "first-order optimal"
    STALLED = "no step improves it further"
    STEPS = "steps used up"
    SECONDS = "time used up"
    INTERRUPTED = "interrupted"


@dataclass(frozen=True)
class StepRecord:
    """One program: the design it led to, what that is worth, and whether it was taken."""

    y: Floats
    objective: float
    violation: float
    radius: float  # of the bounds
    promised: float  # fall of the merit
    taken: bool


@dataclass(frozen=True)
class Optimum:
    """The best design found: by violation first, then by F.

    ``stationarity`` as `stationarity` recomputes it. ``predicted`` is what the last program that
    was taken promised of the residuals (m,) here, None if none was.
    """

    y: Floats
    seen: Appraisal
    objective: float
    stationarity: float
    limits: tuple[BindingLimit, ...]
    predicted: Floats | None
    end: End
    steps: tuple[StepRecord, ...]
    appraisals: int


@dataclass
class _Progress(TrustRegion):
    """The steps made, too."""

    steps: list[StepRecord] = field(default_factory=list)
    appraisals: int = 0


def minimise(
    problem: DesignProblem,
    start: Floats,
    steps: int = 100,
    stop: Callable[[], End | None] = lambda: None,
) -> Optimum:
    """The local optimum that steps from ``start`` (n_y,) lead to; start is put within its limits.

    ``stop`` is asked between steps; Ctrl-C ends them too, and the best design so far is returned.
    Raises what ``appraise`` raises at the start.
    """
    box = UnitBox.of(problem)
    progress = _Progress(FIRST, np.zeros((box.n, box.n)), 0.0)
    place = best = _placed(problem, box, box.inside(box.z(start)), progress)
    predicted: Floats | None = None
    end = End.STEPS
    try:
        while len(progress.steps) < steps:
            # beyond a limit by a little, where one more program ends on it
            beyond = place is not best or MET < place.seen.violation <= ON
            if not beyond and stationarity(problem, box.y(place.z), place.seen) <= OPTIMAL:
                end = End.OPTIMAL
                break
            if (asked := stop()) is not None:
                end = asked
                break
            move = step_program(problem, box, place, progress)
            if move is None or progress.radius < SMALLEST:
                end = End.STALLED
                break
            reached = _try(problem, box, place, move, progress)
            if reached is not None:
                last = place is best and move.promised == 0.0
                place, predicted = reached, move.model.residual
                best = place if last else _better(best, place)
            elif move.promised == 0.0 and np.abs(move.d).max() < NEAR:
                end = End.STALLED
                break
    except KeyboardInterrupt:
        end = End.INTERRUPTED
    y = box.y(best.z)
    if best is not place:
        predicted = None
    left = stationarity(problem, y, best.seen)
    return Optimum(
        y=frozen(y),
        seen=best.seen,
        objective=best.value,
        stationarity=left,
        limits=tuple(active_limits(problem, y, best.seen)),
        predicted=predicted,
        end=End.OPTIMAL if left <= OPTIMAL else end,
        steps=tuple(progress.steps),
        appraisals=progress.appraisals,
    )


def _placed(problem: DesignProblem, box: UnitBox, z: Floats, progress: _Progress) -> DesignPoint:
    progress.appraisals += 1
    return DesignPoint.of(problem, box, z, problem.appraise(box.y(z)))


def _better(best: DesignPoint, place: DesignPoint) -> DesignPoint:
    """By violation first, then by F."""
    return best_first([best, place], lambda p: (p.seen.violation, p.value))[0]


def _try(
    problem: DesignProblem,
    box: UnitBox,
    place: DesignPoint,
    move: ProposedStep,
    progress: _Progress,
) -> DesignPoint | None:
    """The place that a move leads to if it keeps a tenth of its promise, corrected once if not."""
    reached = _go(problem, box, place, move, progress)
    if reached is not None and not _kept(problem, box, place, reached, move, progress):
        corrected = step_program(problem, box, place, progress, (reached, move))
        if corrected is not None:
            again = _go(problem, box, place, corrected, progress)
            if again is not None and _kept(problem, box, place, again, move, progress):
                reached, move = again, replace(corrected, promised=move.promised)
    length = float(np.abs(move.d).max(initial=0.0))
    taken = reached is not None and _kept(problem, box, place, reached, move, progress)
    _record(progress, box, place if reached is None else reached, move, taken)
    if reached is None or not taken:
        progress.radius = 0.25 * min(length, progress.radius)
        if reached is not None:
            progress.S = _updated(progress.S, place, reached, move)
        return None
    fall = _fall(problem, place, reached, progress)
    if fall > GOOD * move.promised and length > 0.9 * progress.radius:
        progress.radius = min(2.0 * progress.radius, LARGEST)
    elif fall < 0.25 * move.promised:
        progress.radius = max(0.5 * length, SMALLEST)
    progress.S = _updated(progress.S, place, reached, move)
    return reached


def _go(
    problem: DesignProblem,
    box: UnitBox,
    place: DesignPoint,
    move: ProposedStep,
    progress: _Progress,
) -> DesignPoint | None:
    """Where a move leads, None where no design is."""
    z = place.z + move.d
    z = np.where(z <= SNAP, 0.0, np.where(z >= 1.0 - SNAP, 1.0, z))
    try:
        return _placed(problem, box, z, progress)
    except EigassignError:
        return None


def _fall(
    problem: DesignProblem, place: DesignPoint, reached: DesignPoint, progress: _Progress
) -> float:
    before, after = (
        merit(problem, p.value, p.seen.violation, progress.weight) for p in (place, reached)
    )
    return before - after


def _kept(
    problem: DesignProblem,
    box: UnitBox,
    place: DesignPoint,
    reached: DesignPoint,
    move: ProposedStep,
    progress: _Progress,
) -> bool:
    fall = _fall(problem, place, reached, progress)
    if move.promised > 0.0:
        return bool(fall > TAKEN * move.promised)
    if reached.seen.violation > max(place.seen.violation, MET):
        return False
    # the program keeps off limits by `MET`, which may cost this much
    paid = ROUND_OFF * abs(place.value) + MET * float(np.abs(move.on_excess).sum())
    before, after = (stationarity(problem, box.y(p.z), p.seen) for p in (place, reached))
    return fall >= -paid and after <= 0.5 * before


def _record(
    progress: _Progress, box: UnitBox, reached: DesignPoint, move: ProposedStep, taken: bool
) -> None:
    progress.steps.append(
        StepRecord(
            y=frozen(box.y(reached.z)),
            objective=reached.value,
            violation=reached.seen.violation,
            radius=progress.radius,
            promised=move.promised,
            taken=taken,
        )
    )


def _updated(S: Floats, place: DesignPoint, reached: DesignPoint, move: ProposedStep) -> Floats:
    """S with S d = (J⁺ − J)ᵀ w + (C⁺ − C)ᵀ μ, by a symmetric rank-one update.

    Of rows at kinks the mean of both branches is taken, which is smooth.
    """
    d = reached.z - place.z
    w = reached.seen.residual if move.on_residual.size == 0 else move.on_residual
    before, after = (p.smooth_slopes(move.model.kinked) for p in (place, reached))
    rest = (after - before).T @ np.append(w, move.on_excess) - S @ d
    along = float(rest @ d)
    if abs(along) <= 1e-8 * np.linalg.norm(rest) * np.linalg.norm(d):
        return S
    return np.asarray(S + np.outer(rest, rest) / along)


# --- Several starts


def worth(optimum: Optimum) -> tuple[float, float]:
    """Violation and F, by which `best_first` orders."""
    return optimum.seen.violation, optimum.objective


def distinct(optima: Sequence[Optimum], problem: DesignProblem) -> tuple[Optimum, ...]:
    """Optima by violation, then F, those of the same design (to 1e-3 of the bounds) once."""
    width = np.where(problem.upper > problem.lower, problem.upper - problem.lower, 1.0)
    kept: list[Optimum] = []
    for found in best_first(optima, worth):
        if all(np.abs((found.y - other.y) / width).max(initial=0.0) > 1e-3 for other in kept):
            kept.append(found)
    return tuple(kept)
