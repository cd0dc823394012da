"""The local optima that several starts lead to: which of them are one, how many are not seen.

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

from dataclasses import dataclass, replace

import numpy as np

from eigassign.assignment.exact.design_problem import MET, DesignProblem, best_first
from eigassign.assignment.exact.sequential import End, Optimum, minimise, unseen, worth
from eigassign.assignment.inputs import Floats
from eigassign.errors import EigassignError

SAME = 1e-4  # relative, in F: optima of the same worth
NOTHING = 1e-14  # of F: no error
NEAR = 1e-3  # of the bounds: the same design
DOWN = 5  # steps from the side of a valley to its floor: those of Gauss and Newton took 2 or 3
HALVINGS = 2  # of the way between two ends: it is looked at in 7 places
FINISHED = (End.OPTIMAL, End.STALLED)


@dataclass(frozen=True)
class Tally:
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
    if problem is None:
        return tuple(best_first((*optima, found), worth))
    width = np.where(problem.upper > problem.lower, problem.upper - problem.lower, 1.0)
    apart = [float(np.abs((found.y - one.y) / width).max(initial=0.0)) for one in optima]
    for k in np.argsort(apart, kind="stable"):  # most are the same design as another
        if apart[k] <= NEAR or _no_barrier(problem, found, optima[k]):
            better = best_first((optima[k], found), worth)[0]
            return tuple(best_first((*optima[:k], better, *optima[k + 1 :]), worth))
    return tuple(best_first((*optima, found), worth))


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
    return _joined(problem, a.y, b.y, (violation + missed, value + room), HALVINGS)


def _joined(
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
            middle = minimise(replace(problem, lower=lower, upper=upper), middle.y, DOWN)
    except EigassignError:
        return False
    if np.any(np.array(worth(middle)) > most):
        return False
    halves = ((a, middle.y), (middle.y, b))
    return halvings == 0 or all(_joined(problem, *each, most, halvings - 1) for each in halves)
