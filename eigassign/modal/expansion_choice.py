"""Order, clusters and expansion points of polynomials: the cheapest that meets an accuracy."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import comb

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.errors import AccuracyError
from eigassign.mechanism.pencil import Pencil
from eigassign.modal.adaptive import (
    AdaptiveReduction,
    central,
    reduce_adaptively,
    row_in_words,
    shown,
)
from eigassign.modal.clusters import CLUSTER_GAP
from eigassign.modal.convergence import radius_share
from eigassign.modal.expansion import Expansion, expand
from eigassign.modal.nearest import picked
from eigassign.modal.sizes import MOST_TERMS
from eigassign.modal.taylor_estimate import polynomial_error

Floats = NDArray[np.float64]
ORDERS = (2, 3, 4, 5, 6, 8, 10)
MAX_POINTS = 8
WIDEST_CLUSTER = 0.7  # relative gap in λ up to which neighbours are tried as one cluster
FINER = 0.05  # part of the accuracy that the reduced model beside them has to reach


@dataclass(frozen=True, eq=False)
class Suggestion:
    """An expansion worth a try before any other: its order, about ``points`` (k, n_x)."""

    name: str
    order: int
    points: Floats
    cluster_gap: float = CLUSTER_GAP


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
        return picked(self.expansions, np.atleast_2d(np.asarray(q, dtype=np.float64)), values)

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
    suggestions: Sequence[Suggestion] = (),
) -> ExpansionChoice:
    """The expansions with the fewest coefficients whose estimate is ≤ ``accuracy`` at x (n, n_x).

    The first of ``suggestions`` that does is taken unseen what else there is. Then are tried, in
    order of cost: the order p at one point, ``start`` or the most central sample; with
    neighbouring modes as one cluster; at several points of one design; no order of over
    `MOST_TERMS` terms. Judged against one reduced model, as they are evaluated. ``place`` says in
    words what row k of x is. Raises AccuracyError, naming the sample, where nothing does.
    """
    beside = reduce_adaptively(pencil, x, FINER * accuracy, modes, place=place)
    judge = (
        f"judged beside a reduced model of {beside.reduced.size} vectors, itself right to "
        f"{beside.estimate.max():.1e}"
    )
    trial = _Trial(pencil, x, accuracy, tuple(modes), linear_in_y, beside, [judge], place)
    first = x[central(x)] if start is None else start
    orders = [p for p in orders if _terms(pencil, p) <= MOST_TERMS] or orders[:1]
    best = _first(trial, suggestions)
    if best is None:
        best = _cheapest(trial, _single(trial, first, orders))
    if best is None:
        best = _cheapest(trial, _several(trial, first, orders))
    if best is None:
        k = trial.worst_sample
        raise AccuracyError(
            f"no expansion of order up to {max(orders)} at up to {MAX_POINTS} points reaches "
            f"{accuracy:.1e}: the last left {trial.last:.1e} at {place(k)}, (q, y) = {shown(x[k])}"
        )
    return ExpansionChoice(*best, beside, tuple(trial.reasons))


_Found = tuple[tuple[Expansion, ...], float, Floats]  # with cluster gap and estimate


@dataclass
class _Trial:
    """What all candidates are judged by, and what was said of them."""

    pencil: Pencil
    x: Floats
    accuracy: float
    modes: tuple[int, ...]
    linear_in_y: bool
    beside: AdaptiveReduction
    reasons: list[str]
    place: Callable[[int], str]
    last: float = np.inf
    worst_sample: int = 0
    cheapest: float = np.inf  # coefficients of the best found so far

    def expand(self, point: Floats, order: int, gap: float) -> Expansion:
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

    def errors(self, *parts: Expansion) -> Floats:
        """(n, n_modes), each sample by the nearest of ``parts``."""
        q, y = self.x[:, : self.pencil.n_q], self.x[:, self.pencil.n_q :]
        values = picked(parts, q, [part.frequencies(q, y) for part in parts])
        return polynomial_error(values, self.reduced_hz, self.beside.estimate)

    def share(self, part: Expansion) -> float:
        q, y = self.x[:, : self.pencil.n_q], self.x[:, self.pencil.n_q :]
        return float(radius_share(part, q, y).max())

    def note(self, what: str, worst: Floats, share: float = np.nan) -> None:
        self.worst_sample = int(np.argmax(worst))
        self.last = float(worst[self.worst_sample])
        error = f"error at most {self.last:.1e}" if np.isfinite(self.last) else "no number"
        reach = f", {share:.2f} of the radius of convergence" if np.isfinite(share) else ""
        self.reasons.append(f"{what}: {error} ({self.place(self.worst_sample)}{reach})")


def _first(trial: _Trial, suggestions: Sequence[Suggestion]) -> _Found | None:
    """The first suggestion within the accuracy."""
    for each in suggestions:
        parts = tuple(trial.expand(point, each.order, each.cluster_gap) for point in each.points)
        errors = trial.errors(*parts)
        trial.note(each.name, errors.max(axis=1))
        if errors.max() <= trial.accuracy:
            return parts, each.cluster_gap, errors
    if suggestions:
        trial.reasons.append("the estimate bears none of these out: chosen without them")
    return None


def _cheapest(trial: _Trial, candidates: Iterator[tuple[int, _Found]]) -> _Found | None:
    """Of the candidates within the accuracy the one with the fewest coefficients."""
    best: tuple[int, _Found] | None = None
    for cost, found in candidates:
        if found[2].max() <= trial.accuracy and (best is None or cost < best[0]):
            best, trial.cheapest = (cost, found), cost
    return None if best is None else best[1]


def _terms(pencil: Pencil, order: int) -> int:
    """Coefficients of one series in everything that anything depends on."""
    return comb(int(pencil.active.sum()) + order, order)


def _cost(parts: Sequence[Expansion]) -> int:
    return sum(c.coefficients.size for part in parts for c in part.clusters)


def _single(trial: _Trial, point: Floats, orders: Sequence[int]) -> Iterator[tuple[int, _Found]]:
    """One expansion point, the modes alone and then with their neighbours."""
    for gap in _gaps(trial, point):
        costs: list[int] = []  # of the orders so far
        for order in orders:
            if costs and costs[-1] >= trial.cheapest:
                break  # the next order costs more still
            part = trial.expand(point, order, gap)
            costs.append(_cost((part,)))
            errors = trial.errors(part)
            share = trial.share(part)
            trial.note(_named(part), errors.max(axis=1), share)
            yield _cost((part,)), ((part,), gap, errors)
            if errors.max() <= trial.accuracy or share > 1.5:
                break


def _named(part: Expansion) -> str:
    together = [c.modes for c in part.clusters if len(c.modes) > 1]
    groups = "".join(f", modes {g[0]}-{g[-1]} as one cluster" for g in together)
    return f"order {part.order}{groups}"


def _gaps(trial: _Trial, point: Floats) -> list[float]:
    """Cluster gaps worth a try: the usual one, and those that take in the nearest neighbours."""
    from eigassign.modal.exact import eigenvalues

    count = min(max(trial.modes) + 2, len(trial.pencil.elastic))
    lam = eigenvalues(trial.pencil, point[None], count)[0]
    near = {
        float(1.0 - lam[k] / lam[k + 1])
        for k in range(count - 1)
        if {k + 1, k + 2} & set(trial.modes)
    }
    wider = sorted(gap * 1.001 for gap in near if CLUSTER_GAP <= gap < WIDEST_CLUSTER)
    return [CLUSTER_GAP, *wider[:2]]


def _several(trial: _Trial, first: Floats, orders: Sequence[int]) -> Iterator[tuple[int, _Found]]:
    """Points added where they are worst in all, of the first one's design, for every order."""
    n_q = trial.pencil.n_q
    for order in orders:
        parts = [trial.expand(first, order, CLUSTER_GAP)]
        if _cost(parts) >= trial.cheapest:
            break
        errors = trial.errors(*parts)
        while (
            len(parts) < MAX_POINTS
            and errors.max() > trial.accuracy
            and _cost(parts) < trial.cheapest
        ):
            worst = trial.x[int(np.argmax(errors.max(axis=1))), :n_q]
            parts.append(trial.expand(np.concatenate([worst, first[n_q:]]), order, CLUSTER_GAP))
            errors = trial.errors(*parts)
        trial.note(f"order {order} at {len(parts)} points", errors.max(axis=1))
        yield _cost(parts), (tuple(parts), CLUSTER_GAP, errors)
