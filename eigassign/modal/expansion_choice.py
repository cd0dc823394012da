"""Order, clusters and expansion points of polynomials: the cheapest that meets an accuracy."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from math import comb, isfinite, log2

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
from eigassign.modal.expansion import Expansion
from eigassign.modal.expansion_trial import Found, Trial, size
from eigassign.modal.nearest import picked
from eigassign.modal.sizes import MOST_TERMS
from eigassign.modal.taylor_estimate import polynomial_error

Floats = NDArray[np.float64]
ORDERS = (2, 3, 4, 5, 6, 8, 10, 12, 14, 17, 20)
MAX_POINTS = 32
LOOKED_AT = (8, 16)  # numbers of points at which it is asked whether more of them will do
IN_VAIN = 3  # orders after which neighbours that do not help are no longer tried
HELPFUL = 0.5  # times the error without them
HOPE = 3.0  # by how much more points may do better than the last ones promise
WIDEST_CLUSTER = 0.7  # relative gap in λ up to which neighbours are tried as one cluster
FINER = 0.05  # part of the accuracy that the reduced model beside them should reach
TOLERABLE = 0.5  # the same where round-off does not allow that


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
    begun: ExpansionChoice | None = None,
) -> ExpansionChoice:
    """The expansions with the fewest coefficients whose estimate is ≤ ``accuracy`` at x (n, n_x).

    The first of ``suggestions`` that does is taken unseen what else there is; so is what was
    ``begun`` at fewer samples, with further points if need be. Then are tried, in order of cost:
    the order p at one point, ``start`` or the most central sample; with neighbouring modes as one
    cluster; at several points of one design; no order of over `MOST_TERMS` terms. Judged against
    one reduced model, as they are evaluated. ``place`` says in words what row k of x is. Raises
    AccuracyError, naming the sample, where nothing does.
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
    orders = [p for p in orders if _terms(pencil, p) <= MOST_TERMS] or orders[:1]
    best = _first(trial, suggestions) or _continued(trial, begun)
    if best is None:
        best = _cheapest(trial, _single(trial, first, orders))
    if best is None:
        best = _cheapest(trial, _several(trial, first, orders))
    if best is None:
        k = trial.worst_sample
        raise AccuracyError(
            f"no expansion of order up to {max(orders)} at up to {MAX_POINTS} points reaches "
            f"{accuracy:.1e}: the last left {trial.last:.1e} at {place(k)}, (q, y) = {shown(x[k])}"
            "; ask for less, narrow the bounds of the design, or take ea.reduce or ea.fit"
        )
    return ExpansionChoice(*best, beside, tuple(trial.reasons))


def _first(trial: Trial, suggestions: Sequence[Suggestion]) -> Found | None:
    """The first suggestion within the accuracy."""
    for each in suggestions:
        parts = tuple(trial.expand(point, each.order, each.cluster_gap) for point in each.points)
        errors = trial.errors(parts, [trial.values(part) for part in parts])
        trial.note(each.name, errors.max(axis=1))
        if errors.max() <= trial.accuracy:
            return parts, each.cluster_gap, errors
    if suggestions:
        trial.reasons.append("the estimate bears none of these out: chosen without them")
    return None


def _cheapest(trial: Trial, candidates: Iterator[tuple[int, Found]]) -> Found | None:
    """Of the candidates within the accuracy the one with the fewest coefficients."""
    best: tuple[int, Found] | None = None
    for cost, found in candidates:
        if found[2].max() <= trial.accuracy and (best is None or cost < best[0]):
            best, trial.cheapest = (cost, found), cost
    return None if best is None else best[1]


def _terms(pencil: Pencil, order: int) -> int:
    """Coefficients of one series in everything that anything depends on."""
    return comb(int(pencil.active.sum()) + order, order)


def _single(trial: Trial, point: Floats, orders: Sequence[int]) -> Iterator[tuple[int, Found]]:
    """One expansion point, the modes alone and then with their neighbours."""
    alone: dict[int, float] = {}  # the errors by order
    for gap in _gaps(trial, point):
        costs: list[int] = []  # of the orders so far
        in_vain = 0
        for order in orders:
            if in_vain == IN_VAIN or (costs and costs[-1] >= trial.cheapest):
                break  # the next order costs more still
            part = trial.expand(point, order, gap)
            costs.append(size((part,)))
            errors = trial.errors([part], [trial.values(part)])
            share = trial.share(part, errors)
            trial.note(_named(part), errors.max(axis=1), share)
            yield size((part,)), ((part,), gap, errors)
            if errors.max() <= trial.accuracy or share > 1.5:
                break
            in_vain += errors.max() > HELPFUL * alone.get(order, np.inf)
            alone.setdefault(order, float(errors.max()))


def _named(part: Expansion) -> str:
    together = [c.modes for c in part.clusters if len(c.modes) > 1]
    groups = "".join(f", modes {g[0]}-{g[-1]} as one cluster" for g in together)
    return f"order {part.order}{groups}"


def _gaps(trial: Trial, point: Floats) -> list[float]:
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


def _several(trial: Trial, first: Floats, orders: Sequence[int]) -> Iterator[tuple[int, Found]]:
    """Points added where they are worst in all, of the first one's design, for every order."""
    for order in orders:
        part = trial.expand(first, order, CLUSTER_GAP)
        if size([part]) >= trial.cheapest:
            break
        found = _grown(trial, [part], CLUSTER_GAP)
        yield size(found[0]), found


def _continued(trial: Trial, begun: ExpansionChoice | None) -> Found | None:
    """What met the accuracy at fewer samples, with the points that these need."""
    if begun is None:
        return None
    found = _grown(trial, list(begun.expansions), begun.cluster_gap)
    return found if found[2].max() <= trial.accuracy else None


def _grown(trial: Trial, parts: list[Expansion], gap: float) -> Found:
    """``parts`` and others like them where they are worst, until they suffice or cost too much."""
    order, y0 = parts[0].order, parts[0].y0
    values = [trial.values(part) for part in parts]
    errors = trial.errors(parts, values)
    highest = [float(errors.max())] * len(parts)  # with one point, two, …
    while _go_on(highest, trial.accuracy) and size(parts) < trial.cheapest:
        worst = trial.x[int(np.argmax(errors.max(axis=1))), : trial.pencil.n_q]
        parts.append(trial.expand(np.concatenate([worst, y0]), order, gap))
        values.append(trial.values(parts[-1]))
        errors = trial.errors(parts, values)
        highest.append(float(errors.max()))
    trial.note(f"order {order} at {len(parts)} points", errors.max(axis=1))
    return tuple(parts), gap, errors


def _go_on(highest: Sequence[float], accuracy: float) -> bool:
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
