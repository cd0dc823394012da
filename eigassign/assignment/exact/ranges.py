"""All values of parameters that explain frequencies which are known to lie between two each.

With middles m_i and half-widths h_i of what was measured, a design y explains it where

    |r_i(y)| ≤ 1,      r_i = (f_i(y) − m_i)/h_i.

Inner ranges are the least and the largest of each parameter among designs found that explain it:
there are such. Outer ranges leave no design out that does. They need frequencies of which those of
all designs between two lie between those of two: boxes that can have none of them fall away, and
what is left beyond the inner ranges is halved, and searched from, until little is left. No design
is better than another here (Richiedei, Tamellin, Trevisani, 2021: so with intervals of shapes).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass
from itertools import product

import numpy as np

from eigassign.arrays import Floats
from eigassign.assignment.exact.design_problem import ON, Appraisal, DesignProblem, Objective
from eigassign.assignment.exact.sequential import Optimum, minimise
from eigassign.errors import EigassignError

Response = Callable[[Floats], tuple[Floats, Floats]]  # y → r (m,), ∂r/∂y (m, n_y)
# of boxes (n, n_y) each: r (n, m) that none of their designs is below, and that none is above
Between = Callable[[Floats, Floats], tuple[Floats, Floats]]
MOST = 10_000  # boxes that are looked at
NEAR = 1e-2  # of the inner range: boxes that are no further beyond are not halved
SPREAD = 24  # designs all over the bounds that are searched from where boxes tell nothing
LOOKS = 8  # searches from boxes that are left


@dataclass(frozen=True)
class Explained:
    """What explains the measurements; ``y`` (n_y,) is the design of the least largest |r|.

    Ranges are (2, n_y): ``inner`` None where no design was found that explains them, ``outer``
    None where frequencies are not known to lie between two.
    """

    y: Floats
    inner: Floats | None
    outer: Floats | None
    is_impossible: bool  # no design of the bounds explains them


def explain(
    response: Response,
    lower: Floats,
    upper: Floats,
    starts: Iterable[Floats],
    between: Between | None = None,
) -> Explained:
    """The ranges of what explains the measurements; raises what ``response`` does at all starts."""
    search, every = _Search(response, lower, upper), [*starts]
    centre = search.centre(every)
    worst = float(np.abs(response(centre)[0]).max())
    if worst <= 1.0 + ON:
        search.found = [centre]
        while search.widened(centre, *search.inner):
            pass
    for start in every[:SPREAD] if between is None else ():  # another set may explain it, too
        search.widened(start)
    outer = None if between is None else _outer(search, between)
    inner = search.inner if search.found else None
    empty = outer is not None and not np.isfinite(outer).all()
    return Explained(centre, inner, None if empty else outer, empty)


class _Search:
    """Designs found that explain the measurements, and searches for more."""

    def __init__(self, response: Response, lower: Floats, upper: Floats) -> None:
        self.response, self.lower, self.upper = response, lower, upper
        self.width = np.where(upper > lower, upper - lower, 1.0)
        self.found: list[Floats] = []

    @property
    def inner(self) -> Floats:
        """The range (2, n_y) of all that were found."""
        return np.array([np.min(self.found, axis=0), np.max(self.found, axis=0)])

    def centre(self, starts: Iterable[Floats]) -> Floats:
        """The design of the least of the largest |r| that a start leads to; one that explains."""

        def appraise(y: Floats) -> Appraisal:
            return Appraisal(*self.response(y), np.zeros(0), np.zeros((0, len(y))))

        problem = DesignProblem(appraise, self.lower, self.upper, objective=Objective.WORST_CASE)
        found = list[Optimum]()
        for start in starts:
            try:
                found.append(minimise(problem, start))
            except EigassignError as error:
                lost = error
            if found and found[-1].objective <= 1.0:
                break
        if not found:
            raise lost
        return min(found, key=lambda one: one.objective).y

    def widened(self, *starts: Floats) -> bool:
        """Whether searches from starts widen the inner ranges, by more than `NEAR`."""
        before = self.inner if self.found else np.array([self.upper, self.lower])
        for j, sign, start in product(np.flatnonzero(self.upper > self.lower), (-1.0, 1.0), starts):
            with suppress(EigassignError):
                found = minimise(self._outwards(int(j), sign), start)
                if found.seen.violation <= ON:
                    self.found.append(found.y)
        if not self.found:
            return False
        gained = (before - self.inner) * np.array([[1.0], [-1.0]])
        return bool((gained > NEAR * np.maximum(np.ptp(self.inner, axis=0), 0.0) + ON).any())

    def _outwards(self, j: int, sign: float) -> DesignProblem:
        """The problem of the largest (+1) or the least (−1) y_j that explains the measurements."""
        slope = np.zeros((1, len(self.lower)))
        slope[0, j] = -sign / self.width[j]

        def appraise(y: Floats) -> Appraisal:
            r, slopes = self.response(y)
            far = (y[j] - self.lower[j]) / self.width[j]
            excess = np.concatenate([r - 1.0, -r - 1.0])
            return Appraisal(np.array([-sign * far]), slope, excess, np.vstack([slopes, -slopes]))

        return DesignProblem(appraise, self.lower, self.upper, objective=Objective.LARGEST)


def _outer(search: _Search, between: Between) -> Floats:
    """The range (2, n_y) that all designs lie in which explain; infinite where there is none."""
    boxes, looks, made = np.array([[search.lower, search.upper]]), 0, 0  # (n, 2, n_y)
    done = boxes[:0]
    while len(boxes) and made < MOST:
        least, most = between(boxes[:, 0], boxes[:, 1])
        made += len(boxes)
        boxes = boxes[((least <= 1.0) & (most >= -1.0)).all(axis=1)]
        far = _beyond(search, boxes)
        if len(far) and far.max() > 0.0 and looks < LOOKS:
            looks += 1
            search.widened(boxes[far.argmax()].mean(axis=0))
            far = _beyond(search, boxes)
        done, boxes = np.concatenate([done, boxes[far <= 0.0]]), boxes[far > 0.0]
        side = (np.ptp(boxes, axis=1) / search.width).argmax(axis=1)
        at = np.arange(len(search.lower)) == side[:, None]
        low, high = boxes[:, 0], boxes[:, 1]
        middle = 0.5 * (low + high)
        halves = [[low, np.where(at, middle, high)], [np.where(at, middle, low), high]]
        boxes = np.concatenate([np.stack(half, axis=1) for half in halves])
    left = np.concatenate([done, boxes])
    least, most = left[:, 0].min(axis=0, initial=np.inf), left[:, 1].max(axis=0, initial=-np.inf)
    return np.array([least, most])


def _beyond(search: _Search, boxes: Floats) -> Floats:
    """How far boxes (n, 2, n_y) lie beyond inner ranges and `NEAR` (n,), in shares of bounds."""
    if not search.found:
        return np.ones(len(boxes))
    inner = search.inner
    beyond = np.maximum(inner[0] - boxes[:, 0], boxes[:, 1] - inner[1])
    beyond -= NEAR * np.ptp(inner, axis=0)
    return np.asarray((beyond / search.width).max(axis=1, initial=-1.0) - ON)
