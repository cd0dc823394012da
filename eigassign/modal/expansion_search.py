"""The search of `expansion_choice`: candidates in the order of their cost, the first that will do.

A candidate costs its number of coefficients, thrice at several points, for each of them is expanded
and evaluated, and from one to the next the answer jumps, if by less than the error. Ladders of
candidates, each dearer than the last: the orders at one point, with the modes alone or with
neighbours as one cluster; and, from each of these, more points of the same design, added where the
error is largest. A ladder ends where its next rungs promise nothing.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import comb, isfinite, log2

import numpy as np
from numpy.typing import NDArray

from eigassign.mechanism.pencil import Pencil
from eigassign.modal.clusters import CLUSTER_GAP
from eigassign.modal.exact import eigenvalues
from eigassign.modal.expansion import Expansion
from eigassign.modal.expansion_trial import Found, Trial, size
from eigassign.modal.sizes import MOST_TERMS

Floats = NDArray[np.float64]
MAX_POINTS = 32
SEVERAL = 3.0  # times the coefficients: what several points cost beside one
MOST_IN_ALL = 10 * MOST_TERMS  # what all points together may cost
LOOKED_AT = (8, 16)  # numbers of points at which it is asked whether more of them will do
HOPE = 3.0  # by how much more points may do better than the last ones promise
COMPARED = 8  # points at which an order must be better than lower ones
SATURATED = 0.05  # an error that says nothing but that the radius of convergence is exceeded
BEYOND = 1.5  # of that radius: neighbours do not help there
HELPFUL = 0.5  # times the error without neighbours: from there several points are tried with them
WIDEST_CLUSTER = 0.7  # relative gap in λ up to which neighbours are tried as one cluster


def cheapest(trial: Trial, point: Floats, orders: Sequence[int]) -> Found | None:
    """The cheapest candidate within the accuracy, about ``point`` (n_x,) first; None of all."""
    alone, *together = (Orders(trial, point, gap, orders) for gap in _gaps(trial, point))
    ladders: list[Orders | Points] = [alone, *together]
    while ladders:
        ladder = min(ladders, key=lambda each: each.cost)
        ladder.step()
        if isinstance(ladder, Orders) and not ladder.meets and ladder.helps(alone):
            ladders += [branch for branch in [ladder.branch()] if not branch.ended]
        if isinstance(ladder, Points):
            ladder.ended |= any(ladder.is_in_vain_beside(each) for each in ladders)
        if ladder.meets or ladder.ended:
            ladder.tell()
        if ladder.meets:
            return ladder.found
        ladders = [each for each in ladders if not each.ended]
    return None


def terms(pencil: Pencil, order: int) -> int:
    """Coefficients of one series in everything that anything depends on."""
    return comb(int(pencil.active.sum()) + order, order)


def _gaps(trial: Trial, point: Floats) -> list[float]:
    """Cluster gaps worth a try: the usual one, and those that take in the nearest neighbours."""
    count = min(max(trial.modes) + 2, len(trial.pencil.elastic))
    lam = eigenvalues(trial.pencil, point[None], count)[0]
    near = {
        float(1.0 - lam[k] / lam[k + 1])
        for k in range(count - 1)
        if {k + 1, k + 2} & set(trial.modes)
    }
    wider = sorted(gap * 1.001 for gap in near if CLUSTER_GAP <= gap < WIDEST_CLUSTER)
    return [CLUSTER_GAP, *wider[:2]]


class Orders:
    """One point, order by order; modes closer than ``gap`` together."""

    def __init__(self, trial: Trial, point: Floats, gap: float, orders: Sequence[int]) -> None:
        """Before the first."""
        self.trial, self.point, self.gap, self.orders = trial, point, gap, orders
        self.ended = False
        self.errors: dict[int, float] = {}  # by order
        self.width = 1.0 if gap == CLUSTER_GAP else 4.0  # series: of two modes a matrix

    @property
    def cost(self) -> float:
        """Coefficients of the next."""
        return self.width * terms(self.trial.pencil, self.orders[len(self.errors)])

    @property
    def meets(self) -> bool:
        """Whether the last one does."""
        return float(self.found[2].max()) <= self.trial.accuracy

    def step(self) -> None:
        """The next order."""
        trial, order = self.trial, self.orders[len(self.errors)]
        part = trial.expand(self.point, order, self.gap)
        self.values = trial.values(part)
        errors = trial.errors([part], [self.values])
        share = trial.share(part, errors)
        trial.note(_named(part), errors.max(axis=1), share)
        self.found: Found = ((part,), self.gap, errors)
        self.width = size([part]) / terms(trial.pencil, order)
        self.errors[order] = float(errors.max())
        beyond = share > BEYOND and self.gap > CLUSTER_GAP
        self.ended = len(self.errors) == len(self.orders) or beyond

    def tell(self) -> None:
        """Nothing: every order is told of as it is tried."""

    def helps(self, alone: Orders) -> bool:
        """Whether the last order is worth several points, beside the same without neighbours."""
        order, error = next(reversed(self.errors.items()))
        return self is alone or error <= HELPFUL * alone.errors.get(order, np.inf)

    def branch(self) -> Points:
        """Several points of the last order."""
        return Points(self.trial, self.found[0], self.gap, [self.values])


class Points:
    """One order, point by point."""

    def __init__(
        self,
        trial: Trial,
        parts: Sequence[Expansion],
        gap: float,
        values: Sequence[Floats] | None = None,
    ) -> None:
        """Before the first more than ``parts``, whose ``values`` at all samples may be known."""
        self.trial, self.gap, self.parts = trial, gap, list(parts)
        self.values = [trial.values(part) for part in parts] if values is None else list(values)
        self.highest = [np.inf] * (len(parts) - 1)  # the largest error with one point, two, …
        self._judge()

    def _judge(self) -> None:
        errors = self.trial.errors(self.parts, self.values)
        self.found: Found = (tuple(self.parts), self.gap, errors)
        self.highest.append(float(errors.max()))
        self.worst = self.trial.x[int(np.argmax(errors.max(axis=1))), : self.trial.pencil.n_q]
        there = any(np.array_equal(self.worst, part.q0) for part in self.parts)
        self.ended = (
            there or self.cost > MOST_IN_ALL or not go_on(self.highest, self.trial.accuracy)
        )

    @property
    def order(self) -> int:
        """Of all of them."""
        return self.parts[0].order

    @property
    def cost(self) -> float:
        """Of all of them with the next point."""
        return SEVERAL * size(self.parts) * (1.0 + 1.0 / len(self.parts))

    @property
    def meets(self) -> bool:
        """Whether they do."""
        return self.highest[-1] <= self.trial.accuracy

    def step(self) -> None:
        """A point more where they are worst in all."""
        point = np.concatenate([self.worst, self.parts[0].y0])
        self.parts.append(self.trial.expand(point, self.order, self.gap))
        self.values.append(self.trial.values(self.parts[-1]))
        self._judge()

    def tell(self) -> None:
        """Say how far they got."""
        what = f"{_named(self.parts[0])} at {len(self.parts)} points"
        self.trial.note(what, self.found[2].max(axis=1))

    def is_in_vain_beside(self, other: Orders | Points) -> bool:
        """Whether a lower order does as well with as many points: higher ones diverge."""
        if isinstance(other, Orders) or len(self.parts) != COMPARED:
            return False
        mine, theirs = self.highest[-1], other.highest[COMPARED - 1 : COMPARED]
        lower = other.gap == self.gap and other.order < self.order
        return lower and mine <= SATURATED and theirs != [] and theirs[0] <= mine


def _named(part: Expansion) -> str:
    together = [c.modes for c in part.clusters if len(c.modes) > 1]
    groups = "".join(f", modes {g[0]}-{g[-1]} as one cluster" for g in together)
    return f"order {part.order}{groups}"


def go_on(highest: Sequence[float], accuracy: float) -> bool:
    """Whether a point more may help: as the last doubling of their number did, up to the most."""
    points, error = len(highest), highest[-1]
    if error <= accuracy or points >= MAX_POINTS:
        return False
    if points not in LOOKED_AT:
        return True
    before = highest[points // 2 - 1]
    gain = min(error / before, 1.0) if isfinite(error) else 1.0
    promised: float = error * gain ** log2(MAX_POINTS / points)
    return promised <= HOPE * accuracy
