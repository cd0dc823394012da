"""The exact optimum: quadratic programs in a row, each inside a trust region, judged exactly.

A step (`step`) is taken only if the exact merit, F plus ν times the largest excess, falls by a
tenth of what its program promised; a step spoilt by curvature is corrected once. Near an optimum
the fall, of second order, drowns in round-off before the slopes balance: there a step is taken if
it halves the stationarity and costs no more than round-off. The trust region grows and shrinks with
how well promises are kept. The answer is judged by first-order optimality of the exact problem
(`first_order` in `design_point`).

**One optimum** are ends of searches with no barrier between them, however far they are apart: a
parameter that nothing feels, or two that do the same, make a valley of designs that are equally
good. The way between two ends is looked at half-way; where it is worse there than at both ends, the
parameter that differs most is held, and a few steps of the others lead down to the floor of a
valley that bends, if there is one. Then both halves of the way are looked at in turn.

**Not seen.** After n starts that led to w optima about w (n − 1)/(n − w − 2) are to be expected in
all (Boender, Rinnooy Kan, Math. Programming 37 (1987) 59), if starts are drawn at random and
nothing is known of the sizes of the regions from which each optimum is reached.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from time import monotonic
from typing import Annotated, NamedTuple

import numpy as np

from eigassign.arrays import Floats
from eigassign.assignment.exact.design_point import BindingLimit, DesignPoint, first_order
from eigassign.assignment.exact.design_problem import (
    MET,
    ON,
    Appraisal,
    DesignProblem,
    UnitBox,
    best_first,
    merit,
)
from eigassign.assignment.exact.step import SMALLEST, ProposedStep, TrustRegion, step_program
from eigassign.assignment.program import SNAP, frozen
from eigassign.errors import EigassignError
from eigassign.facts import Fact, Unwritten, Violation

FIRST, LARGEST = 0.3, 1.0  # trust region, of the bounds
TAKEN, GOOD = 0.1, 0.7  # of the promised fall: a step is taken, the region doubled
OPTIMAL = 1e-7  # stationarity that is accepted
ROUND_OFF = 1e-12  # of F, and of residuals whose squares it has
PAYS = 0.5  # optima not seen yet: where no more are expected, no further start is made
# Designs met from which curvature is gathered, for each parameter: with stale residuals instead,
# 4 of 4 starts with 30 parameters ended after 100 steps, with these after 36 to 72 at an optimum
MET_AGAIN = 2
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

    y: Annotated[Floats, Fact(name="design")]
    objective: float
    violation: Violation
    radius: Annotated[float, Fact("of the trust region", unit="widths of the bounds")]
    promised: Unwritten[float]  # fall of the merit
    taken: bool


class Optimum(NamedTuple):
    """The best design found: by violation first, then by F.

    ``stationarity`` as `first_order` recomputes it. ``predicted`` is what the last program that
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


def minimise(
    problem: DesignProblem, start: Floats, steps: int = 100, deadline: float | None = None
) -> Optimum:
    """The local optimum that steps from ``start`` (n_y,) lead to; start is put within its limits.

    ``deadline`` is a time of `time.monotonic`, looked at between steps; Ctrl-C ends them too then,
    and the best design so far is returned: without one no part of the work is an answer, and it is
    raised. Raises what ``appraise`` raises at the start.
    """
    run = _Run(problem)
    place = best = run.placed(run.box.inside(run.box.z(start)))
    predicted: Floats | None = None
    end = End.STEPS
    try:
        while len(run.steps) < steps:
            # beyond a limit by a little, where one more program ends on it
            beyond = place is not best or MET < place.seen.violation <= ON
            if not beyond and run.unbalanced(place) <= OPTIMAL:
                end = End.OPTIMAL
                break
            if deadline is not None and monotonic() > deadline:
                end = End.SECONDS
                break
            move = run.proposed(place)
            if move is None or run.region.radius < SMALLEST:
                end = End.STALLED
                break
            reached = run.taken(place, move)
            if reached is not None:
                missed = max(place.seen.violation, MET)
                nearer = place is best and reached.seen.violation <= missed  # also by its slopes
                place, predicted = reached, move.expected.values[: reached.m]
                both = [place] if nearer else [best, place]
                best = best_first(both, lambda p: (p.seen.violation, p.value))[0]
            elif move.promised == 0.0 and np.abs(move.d).max() < NEAR:
                end = End.STALLED
                break
    except KeyboardInterrupt:
        if deadline is None:
            raise
        end = End.INTERRUPTED
    y = run.box.y(best.z)
    left, limits = first_order(problem, y, best.seen)
    return Optimum(
        y=frozen(y),
        seen=best.seen,
        objective=best.value,
        stationarity=left,
        limits=limits,
        predicted=predicted if best is place else None,
        end=End.OPTIMAL if left <= OPTIMAL and end not in STOPPED else end,
        steps=tuple(run.steps),
        appraisals=run.appraisals,
    )


class _Run:
    """The steps made, and the trust region that they have left."""

    def __init__(self, problem: DesignProblem) -> None:
        self.problem, self.box = problem, UnitBox.of(problem)
        self.region = TrustRegion(FIRST, np.zeros((self.box.n, self.box.n)), 0.0)
        self.steps: list[StepRecord] = []
        self.appraisals = 0
        self.met: deque[DesignPoint] = deque(maxlen=MET_AGAIN * self.box.n)
        self.multipliers: Floats | None = None  # of the last program

    def placed(self, z: Floats) -> DesignPoint:
        """The design at z, appraised."""
        self.appraisals += 1
        seen = self.problem.appraise(self.box.y(z))
        place = DesignPoint.of(self.problem, self.box, z, seen)
        self.met.append(place)
        return place

    def unbalanced(self, place: DesignPoint) -> float:
        """The stationarity of a place."""
        return first_order(self.problem, self.box.y(place.z), place.seen)[0]

    def proposed(
        self, place: DesignPoint, spoilt: tuple[DesignPoint, ProposedStep] | None = None
    ) -> ProposedStep | None:
        """The step of the program there, or its correction after a ``spoilt`` one."""
        if spoilt is None:
            self.region.S = _curvature(place, self.met, self.multipliers)
        move = step_program(self.problem, self.box, place, self.region, spoilt)
        if move is not None:
            self.multipliers = move.multipliers
        return move

    def taken(self, place: DesignPoint, move: ProposedStep) -> DesignPoint | None:
        """The place that a move leads to if it keeps a tenth of its promise, or once corrected."""
        reached = self._reached(place, move)
        taken = reached is not None and self._kept(place, reached, move)
        if reached is not None and not taken:
            corrected = self.proposed(place, (reached, move))
            again = None if corrected is None else self._reached(place, corrected)
            if corrected and again is not None and self._kept(place, again, move):
                reached, move = again, corrected._replace(promised=move.promised)
                taken = True
        at, radius = place if reached is None else reached, self.region.radius
        length = float(np.abs(move.d).max(initial=0.0))
        y = frozen(self.box.y(at.z))
        step = StepRecord(y, at.value, at.seen.violation, radius, move.promised, bool(taken))
        self.steps.append(step)
        if reached is None or not taken:
            radius = 0.25 * min(length, radius)
        else:
            fall = self._fall(place, reached)
            if fall > GOOD * move.promised and length > 0.9 * radius:
                radius = min(2.0 * radius, LARGEST)
            elif fall < 0.25 * move.promised:
                radius = max(0.5 * length, SMALLEST)
        self.region.radius = radius
        return reached if taken else None

    def _reached(self, place: DesignPoint, move: ProposedStep) -> DesignPoint | None:
        """The place that a move leads to, None where no design is."""
        z = place.z + move.d
        z = np.where(z <= SNAP, 0.0, np.where(z >= 1.0 - SNAP, 1.0, z))
        try:
            return self.placed(z)
        except EigassignError:
            return None

    def _fall(self, place: DesignPoint, reached: DesignPoint) -> float:
        """The fall of the merit between two places."""
        both = ((p.value, p.seen.violation) for p in (place, reached))
        before, after = (merit(self.problem, *each, self.region.weight) for each in both)
        return before - after

    def _kept(self, place: DesignPoint, reached: DesignPoint, move: ProposedStep) -> bool:
        """True where enough of what the move promised has come, or its slopes balance better."""
        fall = self._fall(place, reached)
        if fall > TAKEN * move.promised > 0.0:
            return True
        if reached.seen.violation > max(place.seen.violation, MET):
            return False
        # the program keeps off limits by `MET`, which may cost this much
        paid = MET * float(np.abs(move.multipliers[place.m :]).sum())
        of_squares = float(np.linalg.norm(place.seen.residual)) if place.squared else 0.0
        paid += ROUND_OFF * (abs(place.value) + of_squares)
        return fall >= -paid and self.unbalanced(reached) <= 0.5 * self.unbalanced(place)


def _curvature(
    place: DesignPoint, met: Iterable[DesignPoint], multipliers: Floats | None
) -> Floats:
    """S with S d = (J(z + d) − J(z))ᵀ r + (C(z + d) − C(z))ᵀ μ for the designs z + d met.

    By symmetric rank-one updates, the nearest last, so that it holds there best. They are made anew
    at every place: with residuals and multipliers of earlier ones S would be out of date, above all
    where residuals fall. Where the largest is made small, the multipliers of residuals take the
    place of r. The cost counts as a row. Of rows at kinks the mean of both branches is taken, which
    is smooth.
    """
    weights = np.zeros(len(place.values)) if multipliers is None else multipliers
    if place.squared:
        weights = np.append(place.seen.residual, weights[place.m :])
    of_cost = 0.5 if place.squared else 1.0  # the program has half of squares
    S = np.zeros((len(place.z), len(place.z)))
    others = ((np.linalg.norm(one.z - place.z), one) for one in met)
    for length, other in sorted(others, key=lambda each: -each[0]):
        d = other.z - place.z
        behind = place.at(d).behind
        after, before = (
            weights @ one.smooth_slopes(behind) + of_cost * one.cost_slopes
            for one in (other, place)
        )
        rest = after - before - S @ d
        along = float(rest @ d)
        if abs(along) > 1e-8 * np.linalg.norm(rest) * length:
            S += np.outer(rest, rest) / along
    return S


# --- Several starts


def worth(optimum: Optimum) -> tuple[float, float]:
    """Violation and F, by which `best_first` orders."""
    return optimum.seen.violation, optimum.objective


def unseen(starts: int, found: int) -> float:
    """The expected number of optima not seen by so many starts that found so many.

    w (n − 1)/(n − w − 2) − w (Boender, Rinnooy Kan); infinite for n ≤ w + 2.
    """
    return found * (found + 1) / (starts - found - 2) if starts > found + 2 else np.inf


SAME = 1e-4  # relative, in F: optima of the same worth
NOTHING = 1e-14  # of F: no error
ALIKE = 1e-3  # of the bounds: the same design
DOWN = 5  # steps from the side of a valley to its floor: those of Gauss and Newton took 2 or 3
HALVINGS = 2  # of the way between two ends: it is looked at in 7 places
FINISHED = (End.OPTIMAL, End.STALLED)
STOPPED = (End.SECONDS, End.INTERRUPTED)


class Tally(NamedTuple):
    """The number of starts whose steps ended at an optimum, and that of distinct ones."""

    starts: int = 0
    optima: int = 0

    @property
    def unseen(self) -> float:
        """Optima that are expected not to be seen yet; infinite where that cannot be told."""
        return unseen(self.starts, self.optima)


def with_end(
    optima: tuple[Optimum, ...], found: Optimum, problem: DesignProblem | None
) -> tuple[Optimum, ...]:
    """The distinct ``optima`` with what one more search ``found``, the best first.

    Without a problem ends are told apart as they are: no way between them is looked at.
    """
    others = list(optima)
    if problem is not None:
        width = np.where(problem.upper > problem.lower, problem.upper - problem.lower, 1.0)
        apart = [float(np.abs((found.y - one.y) / width).max(initial=0.0)) for one in optima]
        for k in np.argsort(apart, kind="stable"):  # most are the same design as another
            if apart[k] <= ALIKE or _no_barrier(problem, found, optima[k]):
                found = best_first((others.pop(k), found), worth)[0]
                break
    return tuple(best_first((*others, found), worth))


def _no_barrier(problem: DesignProblem, a: Optimum, b: Optimum) -> bool:
    """True where a way from one end to the other was found that is nowhere worse than both."""
    violation, value = (max(pair) for pair in zip(worth(a), worth(b), strict=True))
    if min(a.seen.violation, b.seen.violation) > MET:
        value = np.inf  # where limits are missed nothing else counts
    room, missed = SAME * abs(value) + NOTHING, SAME * violation + MET
    alike = a.seen.violation + b.seen.violation >= 2.0 * violation - missed
    if np.isfinite(value):
        alike = alike and a.objective + b.objective >= 2.0 * value - room
    if not alike and a.end in FINISHED and b.end in FINISHED:
        return False  # from the worse one, which is an optimum, no way leads down
    return has_way(problem, a.y, b.y, (violation + missed, value + room), HALVINGS)


def has_way(
    problem: DesignProblem, a: Floats, b: Floats, most: tuple[float, float], halvings: int
) -> bool:
    """True where a way from a to b was found that is nowhere worse than ``most``, violation and F.

    Half-way, where need be, with the parameter held that differs most, and a few steps of others.
    """
    width = np.where(problem.upper > problem.lower, problem.upper - problem.lower, 1.0)
    lower, upper = problem.lower.copy(), problem.upper.copy()
    j = int((np.abs(b - a) / width).argmax())
    try:
        middle = minimise(problem, 0.5 * (a + b), 0)
        if np.any(np.array(worth(middle)) > most):
            lower[j] = upper[j] = middle.y[j]
            middle = minimise(problem._replace(lower=lower, upper=upper), middle.y, DOWN)
    except EigassignError:
        return False
    if np.any(np.array(worth(middle)) > most):
        return False
    halves = ((a, middle.y), (middle.y, b))
    return halvings == 0 or all(has_way(problem, *each, most, halvings - 1) for each in halves)
