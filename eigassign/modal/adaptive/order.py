"""Order and expansion points of the Taylor polynomial: few coefficients that meet an accuracy.

Two loops over orders, each with the modes alone and, where a mode lies close to another, with both
as one cluster:

1. about one point, order by order, until the error estimate meets the accuracy: the coefficients
   of this expansion are the most that others may cost;
2. from each of these expansions, the smallest first, further points of the same design, each added
   where the estimate is largest, while they would still cost less.

Several points cost `SEVERAL` times their coefficients: each of them is expanded and evaluated, and
from one to the next the frequency jumps, if by less than the error. All are judged exactly as they
are evaluated: each sample by the nearest point, beside one reduced model of the mechanism.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import comb

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.errors import AccuracyError
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.modal.adaptive.reduced_model import (
    AdaptiveReduction,
    central,
    reduce_adaptively,
    row_in_words,
)
from eigassign.modal.arguments import MOST_TERMS, shown_numbers
from eigassign.modal.exact.clusters import CLUSTER_GAP
from eigassign.modal.exact.solver import eigenvalues
from eigassign.modal.expansion import (
    Expansion,
    NearestExpansion,
    expand,
    polynomial_error,
    radius_share,
)

Floats = NDArray[np.float64]
ORDERS = (2, 3, 4, 5, 6, 8, 10, 12, 14, 17, 20)
MAX_POINTS = 32
# With several points only where one will not do, four of the 36 choices for the shipped cases to
# 1e-3, 1e-5 and 1e-7 have three to five times as many coefficients.
SEVERAL = 3.0
MOST_IN_ALL = 10 * MOST_TERMS  # what several points may cost where one will not do
FINER = 0.05  # part of the accuracy that the reduced model beside them should reach
TOLERABLE = 0.5  # the same where round-off does not allow that
WIDEST_CLUSTER = 0.7  # relative gap in λ up to which two neighbours are tried as one cluster
# Order from which a cluster that does not halve the error of the modes alone is given up. Followed
# on, it costs 1.7 times as many coefficients for the paper's arm at 1e-5, for the same choice.
FAIR_ORDER = 5
# Number of points from which doubling them must halve the error. That ends a hopeless search before
# MAX_POINTS; without it three shipped cases at 1e-3 and 1e-5 choose the same at the same cost.
FAIR_COUNT = 8
# Products of coefficients (2.3 µs each) above which an order is not tried if that before does not
# halve the error of that two steps before: 8 of eight variables, 10 of five, 12 of four. Followed
# on, series that diverge or miss a mode took 10 s and 1.7 GB, and came to nothing.
LARGE = 100_000
FARTHEST = 32  # samples at which the radius of convergence is looked at: all have n × N monomials


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
        """Their order, at least 1; where no variable matters, their degree is 0."""
        return max(self.expansions[0].order, 1)

    def frequencies(self, q: ArrayLike, y: ArrayLike) -> Floats:
        """(n, n_modes) in Hz, each sample by the nearest expansion."""
        return NearestExpansion(self.expansions).frequencies(q, y)

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
    orders: Sequence[int] = ORDERS,
    start: Floats | None = None,
    place: Callable[[int], str] = row_in_words,
) -> ExpansionChoice:
    """Expansions of few coefficients whose estimate is ≤ ``accuracy`` at samples x (n, n_x).

    The first point is ``start`` (n_x,) or the most central sample; all share its design. No order
    of over `MOST_TERMS` coefficients is tried. ``place`` says in words what row k of x is. Raises
    AccuracyError, naming the sample, where nothing meets the accuracy.
    """
    beside = reduce_adaptively(
        pencil, x, FINER * accuracy, modes, place=place, tolerable=TOLERABLE * accuracy
    )
    reasons = [
        f"judged beside a reduced model of {beside.reduced.size} vectors, itself right to "
        f"{beside.error:.1e}"
    ]
    judge = _Judge(pencil, x, tuple(modes), accuracy, beside)
    count = int(pencil.active.sum())
    orders = [p for p in orders if comb(count + p, p) <= MOST_TERMS] or orders[:1]
    found: _Candidate | None = None
    least, at = np.inf, 0
    for made in _candidates(judge, x[central(x)] if start is None else start, orders):
        reasons.append(judge.line(made, place(made.worst)))
        if made.error <= least:
            least, at = made.error, made.worst
        if made.error <= accuracy:
            found = made
    if found is None:
        where = f"at {place(at)}, (q, y) = {shown_numbers(x[at])}"
        none = f"none has a number that it vouches for {where}"
        nearest = f"the nearest left {least:.1e} {where}" if np.isfinite(least) else none
        raise AccuracyError(
            f"no expansion of order up to {max(orders)} at up to {MAX_POINTS} points reaches "
            f"{accuracy:.1e}: {nearest}; ask for less, narrow the bounds of the design, or "
            "take ea.reduce or ea.fit"
        )
    return ExpansionChoice(found.parts, found.gap, found.estimate, beside, tuple(reasons))


@dataclass(frozen=True, eq=False)
class _Candidate:
    """Expansions ``parts`` of one order and design, and the estimate of their error."""

    parts: tuple[Expansion, ...]
    gap: float
    hz: tuple[Floats, ...]  # (n, n_modes) of each part at all samples
    estimate: Floats  # (n, n_modes)

    @property
    def error(self) -> float:
        """The largest estimate at any sample."""
        return float(self.estimate.max())

    @property
    def worst(self) -> int:
        """The sample where that is."""
        return int(np.argmax(self.estimate.max(axis=1)))

    @property
    def cost(self) -> float:
        """Coefficients of all parts, `SEVERAL` times where there is more than one."""
        size = sum(c.coefficients.size for part in self.parts for c in part.clusters)
        return size if len(self.parts) == 1 else SEVERAL * size


@dataclass(frozen=True, eq=False)
class _Judge:
    """Makes candidates for ``modes`` of a pencil and estimates their error at x (n, n_x)."""

    pencil: Pencil
    x: Floats
    modes: tuple[int, ...]
    accuracy: float
    beside: AdaptiveReduction

    @cached_property
    def reduced_hz(self) -> Floats:
        """(n, n_modes) of the reduced model that all are compared with."""
        return self.beside.reduced.frequencies(*self._split(self.x))

    def candidate(
        self, point: Floats, order: int, gap: float, before: _Candidate | None = None
    ) -> _Candidate:
        """An expansion about ``point`` (n_x,), beside those of ``before``."""
        part = expand(self.pencil, *self._split(point), self.modes, order, cluster_gap=gap)
        own = part.frequencies(*self._split(self.x))
        parts = (*(before.parts if before else ()), part)
        hz = (*(before.hz if before else ()), own)
        chosen = NearestExpansion(parts).pick(self._split(self.x)[0], hz)
        estimate = polynomial_error(chosen, self.reduced_hz, self.beside.estimate)
        return _Candidate(parts, gap, hz, estimate)

    def with_worst(self, before: _Candidate) -> _Candidate | None:
        """A point more where the error is largest; None where there is one already."""
        q = self._split(self.x[before.worst])[0]
        first = before.parts[0]
        if any(np.array_equal(q, part.q0) for part in before.parts):
            return None
        order = max(first.order, 1)  # the degree is 0 where no variable matters
        return self.candidate(np.append(q, first.y0), order, before.gap, before)

    def line(self, made: _Candidate, place: str) -> str:
        """Order, clusters, points and error in words; of one point how far its series reaches."""
        groups = [c.modes for c in made.parts[0].clusters if len(c.modes) > 1]
        what = f"order {made.parts[0].order}"
        what += "".join(f", modes {g[0]}-{g[-1]} as one cluster" for g in groups)
        error = f"error at most {made.error:.1e}" if np.isfinite(made.error) else "no number"
        if len(made.parts) > 1:
            return f"{what} at {len(made.parts)} points: {error} ({place})"
        farthest = np.argsort(-made.estimate.max(axis=1), kind="stable")[:FARTHEST]
        share = float(radius_share(made.parts[0], *self._split(self.x[farthest])).max())
        reach = f", {share:.2f} of the radius of convergence" if np.isfinite(share) else ""
        return f"{what}: {error} ({place}{reach})"

    def large(self, order: int) -> bool:
        """Whether it has so many coefficients that the orders before must have helped."""
        n = int(self.pencil.active.sum())
        return comb(2 * n + order, order) > LARGE

    def _split(self, x: Floats) -> tuple[Floats, Floats]:
        """q and y of x."""
        return x[..., : self.pencil.n_q], x[..., self.pencil.n_q :]


def _candidates(judge: _Judge, x0: Floats, orders: Sequence[int]) -> Iterator[_Candidate]:
    """What the two loops come to; of those that meet the accuracy the last costs least."""
    limit = np.inf
    singles: list[_Candidate] = []
    alone: dict[int, float] = {}  # order: error without neighbours
    for gap in _gaps(judge.pencil, x0, judge.modes):
        earlier = [np.inf, np.inf]  # errors of the orders before
        for order, following in zip(orders, (*orders[1:], orders[-1]), strict=True):
            one = judge.candidate(x0, order, gap)
            if one.cost >= limit:
                break
            yield one
            if one.error <= judge.accuracy:
                limit = one.cost
                break
            singles.append(one)
            if judge.large(following) and not one.error < 0.5 * earlier[-2]:
                break
            earlier.append(one.error)
            if gap == CLUSTER_GAP:
                alone[order] = one.error
            elif order >= FAIR_ORDER and not one.error < 0.5 * alone.get(order, np.inf):
                break
    limit = min(limit, MOST_IN_ALL)
    for one in sorted(singles, key=lambda single: single.cost):
        made, errors = one, [one.error]
        while SEVERAL * one.cost * (len(errors) + 1) < limit and more_points_help(errors):
            more = judge.with_worst(made)
            if more is None:
                break
            made, errors = more, [*errors, more.error]
            if made.error <= judge.accuracy:
                limit = made.cost
                break
        if made is not one:
            yield made


def more_points_help(errors: Sequence[float]) -> bool:
    """Whether to add a point after those that left the largest ``errors`` with one, two, …"""
    count = len(errors)
    if count < FAIR_COUNT:
        return True
    return count < MAX_POINTS and errors[-1] < 0.5 * errors[count // 2 - 1]


def _gaps(pencil: Pencil, x0: Floats, modes: Sequence[int]) -> list[float]:
    """Cluster gaps worth a try: the usual one, and that which takes in the nearest neighbour."""
    count = min(max(modes) + 2, len(pencil.elastic))
    lam = eigenvalues(pencil, x0[None], count)[0]
    near = [
        float(1.0 - lam[k] / lam[k + 1]) for k in range(count - 1) if {k + 1, k + 2} & set(modes)
    ]
    wider = [gap * 1.001 for gap in near if CLUSTER_GAP <= gap < WIDEST_CLUSTER]
    return [CLUSTER_GAP, *sorted(wider)[:1]]
