"""Order, clusters and expansion points of polynomials: the cheapest that meets an accuracy.

The search of `expansion_choice`: candidates in the order of their cost, the first that will do.

A candidate costs its number of coefficients, thrice at several points, for each of them is expanded
and evaluated, and from one to the next the answer jumps, if by less than the error. Ladders of
candidates, each dearer than the last: the orders at one point, with the modes alone or with
neighbours as one cluster; and, from each of these, more points of the same design, added where the
error is largest. A ladder ends where its next rungs promise nothing.

One candidate of `expansion_choice` after the other: made, judged, and what is said of it.

Expansion points, order and basis chosen from error estimates, never more than is asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import comb, isfinite, log2
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.errors import AccuracyError
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.modal.arguments import MOST_TERMS, shown_numbers
from eigassign.modal.exact.clusters import CLUSTER_GAP
from eigassign.modal.exact.solver import eigenvalues
from eigassign.modal.expansion import (
    Expansion,
    expand,
    nearest_values,
    polynomial_error,
    radius_share,
)
from eigassign.modal.reduced.model import ReducedModel
from eigassign.modal.reduced.reduce import reduce

# --- The search of `expansion_choice`: candidates in the order of their cost, the first that wi

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


# --- One candidate of `expansion_choice` after the other: made, judged, and what is said of it

LOOKED_FAR = 32  # samples at which the radius of convergence is looked at
Found = tuple[tuple[Expansion, ...], float, Floats]  # with cluster gap and estimate


@dataclass
class Trial:
    """What all candidates are judged by, and what was said of them."""

    pencil: Pencil
    x: Floats
    accuracy: float
    modes: tuple[int, ...]
    linear_in_y: bool
    beside: AdaptiveReduction
    reasons: list[str]
    place: Callable[[int], str]
    least: float = np.inf  # of the largest errors of all candidates
    least_at: int = 0  # the sample where that is

    def expand(self, point: Floats, order: int, gap: float) -> Expansion:
        """About ``point`` (n_x,), modes closer than ``gap`` (relative in λ) together."""
        n_q = self.pencil.n_q
        return expand(
            self.pencil,
            point[:n_q],
            point[n_q:],
            self.modes,
            order,
            self.linear_in_y,
            cluster_gap=gap,
        )

    @cached_property
    def reduced_hz(self) -> Floats:
        """(n, n_modes) of the reduced model that all are compared with."""
        n_q = self.pencil.n_q
        return self.beside.reduced.frequencies(self.x[:, :n_q], self.x[:, n_q:])

    def values(self, part: Expansion) -> Floats:
        """(n, n_modes) in Hz at all samples."""
        n_q = self.pencil.n_q
        return part.frequencies(self.x[:, :n_q], self.x[:, n_q:])

    def errors(self, parts: Sequence[Expansion], values: Sequence[Floats]) -> Floats:
        """(n, n_modes), each sample by the nearest of ``parts``, with their ``values``."""
        hz = nearest_values(parts, self.x[:, : self.pencil.n_q], values)
        return polynomial_error(hz, self.reduced_hz, self.beside.estimate)

    def share(self, part: Expansion, errors: Floats) -> float:
        """Of the radius of convergence, at the samples that are farthest off."""
        n_q = self.pencil.n_q
        far = self.x[np.argsort(-errors.max(axis=1), kind="stable")[:LOOKED_FAR]]
        return float(radius_share(part, far[:, :n_q], far[:, n_q:]).max())

    def note(self, what: str, worst: Floats, share: float = np.nan) -> None:
        """Keep what is said of a candidate of ``worst`` errors (n,)."""
        k = int(np.argmax(worst))
        if worst[k] <= self.least:
            self.least, self.least_at = float(worst[k]), k
        error = f"error at most {worst[k]:.1e}" if np.isfinite(worst[k]) else "no number"
        reach = f", {share:.2f} of the radius of convergence" if np.isfinite(share) else ""
        self.reasons.append(f"{what}: {error} ({self.place(k)}{reach})")

    @property
    def nearest(self) -> str:
        """How near all candidates came, in words."""
        at = f"at {self.place(self.least_at)}, (q, y) = {shown_numbers(self.x[self.least_at])}"
        if np.isfinite(self.least):
            return f"the nearest left {self.least:.1e} {at}"
        return f"none has a number that it vouches for {at}"


def size(parts: Sequence[Expansion]) -> int:
    """How many coefficients they have."""
    return sum(c.coefficients.size for part in parts for c in part.clusters)


# --- Expansion points, order and basis chosen from error estimates, never more than is asked for

MAX_SIZE = 200  # basis vectors
MOST_POINTS = 12
HALF_ORDERS = (1, 2, 3)


@dataclass(frozen=True, eq=False)
class AdaptiveReduction:
    """A reduced model whose estimate is within ``accuracy`` at every sample, and why this one."""

    reduced: ReducedModel
    estimate: Floats  # (n, n_modes)
    accuracy: float
    reasons: tuple[str, ...]


def row_in_words(k: int) -> str:
    """What row k of x is called where nothing better is known."""
    return f"sample {k}"


def reduce_adaptively(
    pencil: Pencil,
    x: Floats,
    accuracy: float,
    modes: Sequence[int] = (1,),
    max_size: int = MAX_SIZE,
    half_orders: Sequence[int] = HALF_ORDERS,
    place: Callable[[int], str] = row_in_words,
    tolerable: float | None = None,
) -> AdaptiveReduction:
    """The smallest reduced model found whose estimate is ≤ ``accuracy`` at samples x (n, n_x).

    For each half order, expansion points are added where the estimate is largest. ``place`` says
    in words what row k of x is. Where nothing meets the accuracy, as where round-off of a fine mesh
    is larger, the best within ``tolerable``; else raises AccuracyError, naming the sample.
    """
    best: _Candidate | None = None  # that meets the accuracy
    closest: _Candidate | None = None
    reasons: list[str] = []
    reached = (np.inf, 0)
    for half_order in half_orders:
        limit = max_size if best is None else best.reduced.size - 1
        found, lines, least = _greedy(pencil, x, accuracy, modes, half_order, limit, place)
        reasons += lines
        reached = min(reached, least)
        if found is not None and found.error <= accuracy:
            best = found
        if found is not None and (closest is None or found.error < closest.error):
            closest = found
    bound = accuracy if tolerable is None else tolerable
    taken = best or closest
    if taken is None or not taken.error <= bound:
        error, k = reached
        raise AccuracyError(
            f"no reduced model of up to {max_size} vectors reaches {bound:.1e}: at {place(k)}, "
            f"(q, y) = {shown_numbers(x[k])}, the estimated error is {error:.1e}"
        )
    return AdaptiveReduction(taken.reduced, taken.estimate, accuracy, tuple(reasons))


class _Candidate(NamedTuple):
    """A reduced model with its estimate (n, n_modes), and the largest of that."""

    reduced: ReducedModel
    estimate: Floats
    error: float


def _greedy(
    pencil: Pencil,
    x: Floats,
    accuracy: float,
    modes: Sequence[int],
    half_order: int,
    limit: int,
    place: Callable[[int], str],
) -> tuple[_Candidate | None, list[str], tuple[float, int]]:
    """The worst sample added as an expansion point, until it fits or grows beyond ``limit``.

    The best of up to ``limit`` vectors; and the least error, with its sample, of any.
    """
    points, n_q = [central(x)], pencil.n_q
    lines: list[str] = []
    best: _Candidate | None = None
    least = (np.inf, 0)
    while len(points) <= MOST_POINTS:
        at = x[points]
        reduced = reduce(pencil, at[:, :n_q], at[:, n_q:], modes, half_order)
        estimate = reduced.error_estimate(x[:, :n_q], x[:, n_q:])
        highest = estimate.max(axis=1)
        k = int(np.argmax(highest))
        error = float(highest[k])
        least = min(least, (error, k))
        lines.append(_line(half_order, len(points), reduced.size, error, place(k)))
        if reduced.size > limit:
            break
        if best is None or error < best.error:
            best = _Candidate(reduced, estimate, error)
        if error <= accuracy or k in points:
            break
        points.append(k)
    return best, lines, least


def _line(half_order: int, points: int, size: int, error: float, sample: str) -> str:
    where = f"{points} point{'s' if points > 1 else ''}"
    what = f"at most {error:.1e}" if np.isfinite(error) else "refused"
    return f"vectors to order {half_order} at {where} ({size} in all): {what} ({sample})"


def central(x: Floats) -> int:
    """The sample nearest to the middle of the ranges of x (n, n_x), each range taken as 1."""
    low, high = x.min(axis=0), x.max(axis=0)
    width = np.where(high > low, high - low, 1.0)
    return int(np.argmin((((x - 0.5 * (low + high)) / width) ** 2).sum(axis=1)))


# --- Order, clusters and expansion points of polynomials: the cheapest that meets an accuracy

ORDERS = (2, 3, 4, 5, 6, 8, 10, 12, 14, 17, 20)
FINER = 0.05  # part of the accuracy that the reduced model beside them should reach
TOLERABLE = 0.5  # the same where round-off does not allow that


@dataclass(frozen=True, eq=False)
class ExpansionChoice:
    """Expansions that together are within ``accuracy`` at every sample, and why these.

    They share y0 and the order; each sample belongs to the one whose q0 is nearest, and modes
    closer than ``cluster_gap`` (relative in λ) are expanded together.
    """

    expansions: tuple[Expansion, ...]
    cluster_gap: float
    estimate: Floats  # (n, n_modes) at the samples
    beside: AdaptiveReduction
    reasons: tuple[str, ...]

    @property
    def order(self) -> int:
        """Their order."""
        return self.expansions[0].order

    def frequencies(self, q: ArrayLike, y: ArrayLike) -> Floats:
        """(n, n_modes) in Hz, each sample by the nearest expansion."""
        values = [part.frequencies(q, y) for part in self.expansions]
        return nearest_values(
            self.expansions, np.atleast_2d(np.asarray(q, dtype=np.float64)), values
        )

    def error_estimate(self, q: ArrayLike, y: ArrayLike) -> Floats:
        """Relative error of ``frequencies``, (n, n_modes); infinite where refused."""
        reduced = self.beside.reduced
        f, e = reduced.frequencies(q, y), reduced.error_estimate(q, y)
        return polynomial_error(self.frequencies(q, y), f, e)


def choose_expansion(
    pencil: Pencil,
    x: Floats,
    accuracy: float,
    modes: Sequence[int] = (1,),
    linear_in_y: bool = False,
    orders: Sequence[int] = ORDERS,
    start: Floats | None = None,
    place: Callable[[int], str] = row_in_words,
    begun: ExpansionChoice | None = None,
) -> ExpansionChoice:
    """The expansions with the fewest coefficients whose estimate is ≤ ``accuracy`` at x (n, n_x).

    What was ``begun`` at fewer samples is taken, with further points if need be. Else the search:
    orders at one point, ``start`` or the most central sample, with neighbouring modes as one
    cluster, and at several points of one design; no order of over `MOST_TERMS` terms. Judged
    against one reduced model, as they are evaluated. ``place`` says in words what row k of x is.
    Raises AccuracyError, naming the sample, where nothing does.
    """
    beside = reduce_adaptively(
        pencil, x, FINER * accuracy, modes, place=place, tolerable=TOLERABLE * accuracy
    )
    judge = (
        f"judged beside a reduced model of {beside.reduced.size} vectors, itself right to "
        f"{beside.estimate.max():.1e}"
    )
    trial = Trial(pencil, x, accuracy, tuple(modes), linear_in_y, beside, [judge], place)
    first = x[central(x)] if start is None else start
    orders = [p for p in orders if terms(pencil, p) <= MOST_TERMS] or orders[:1]
    best = _continued(trial, begun) or cheapest(trial, first, orders)
    if best is None:
        raise AccuracyError(
            f"no expansion of order up to {max(orders)} at up to {MAX_POINTS} points reaches "
            f"{accuracy:.1e}: {trial.nearest}; ask for less, narrow the bounds of the design, or "
            "take ea.reduce or ea.fit"
        )
    return ExpansionChoice(*best, beside, tuple(trial.reasons))


def _continued(trial: Trial, begun: ExpansionChoice | None) -> Found | None:
    """What met the accuracy at fewer samples, with the points that these need."""
    if begun is None:
        return None
    ladder = Points(trial, begun.expansions, begun.cluster_gap)
    while not ladder.ended:
        ladder.step()
    ladder.tell()
    return ladder.found if ladder.meets else None
