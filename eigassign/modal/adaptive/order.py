"""Order and expansion points of the Taylor polynomial: the cheapest that meet an accuracy.

Of every order there is one expansion with the modes alone and, where a mode lies close to another,
one with both as a cluster. Each may get further points of the same design, one after the other
where its error estimate is largest. All of these are tried in the order of what they cost, until
the first one meets the accuracy.

Several points cost `SEVERAL` times their coefficients: each of them is expanded and evaluated, and
from one to the next the frequency jumps, if by less than the error. All are judged exactly as they
are evaluated: each sample by the nearest point, beside one reduced model of the mechanism.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import comb

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.errors import AccuracyError
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.modal.adaptive.cheapest import Rung
from eigassign.modal.adaptive.reduced_model import (
    AdaptiveReduction,
    central,
    reduce_adaptively,
    row_in_words,
)
from eigassign.modal.arguments import MOST_TERMS, shown_numbers
from eigassign.modal.exact.clusters import CLUSTER_GAP, whole_clusters
from eigassign.modal.expansion import (
    Expansion,
    NearestExpansion,
    expand,
    radius_share,
)
from eigassign.modal.reduced.error_estimate import error_beside

Floats = NDArray[np.float64]
ORDERS = (2, 3, 4, 5, 6, 8, 10, 12, 14, 17, 20)
MAX_POINTS = 32
# With several points only where one will not do, four of the 36 choices for the shipped cases to
# 1e-3, 1e-5 and 1e-7 have three to five times as many coefficients.
SEVERAL = 3.0
# Orders from which a cluster must halve the error of the modes alone. Followed on, the search of
# stress/wide_motion to 1e-5 takes four times as long, for the same choice.
FAIR_ORDERS = 4
# Number of points from which doubling them must halve the error. That ends a hopeless search before
# MAX_POINTS; without it three shipped cases at 1e-3 and 1e-5 choose the same at the same cost.
FAIR_COUNT = 8
# Products of coefficients (2.3 µs each) above which an order is not tried if that before does not
# halve the error of that two steps before: 8 of eight variables, 10 of five, 12 of four. Followed
# on, series that diverge or miss a mode took 10 s and 1.7 GB, and came to nothing.
LARGE = 100_000


@dataclass(frozen=True, eq=False, kw_only=True)
class ExpansionChoice(Rung, NearestExpansion):
    """Expansions of one order with their error estimate (n, n_modes) at the samples.

    Modes closer than ``cluster_gap`` (relative in λ) are expanded together.
    """

    cluster_gap: float
    beside: AdaptiveReduction

    @property
    def order(self) -> int:
        """Their order, at least 1; where no variable matters, their degree is 0."""
        return max(self.parts[0].order, 1)

    def error_estimate(self, q: ArrayLike, y: ArrayLike) -> Floats:
        """Relative error of ``frequencies`` (n, n_modes), beside the one reduced model."""
        reduced = self.beside.reduced
        f, e = reduced.frequencies(q, y), reduced.error_estimate(q, y)
        return error_beside(self.frequencies(q, y), f, e)


@dataclass(frozen=True, eq=False)
class _Trial:
    """An order, which modes go together, and what was made so far, point by point."""

    order: int
    gap: float
    size: int  # coefficients at one point
    parts: tuple[Expansion, ...] = ()
    hz: tuple[Floats, ...] = ()  # (n, n_modes) of each part at all samples
    errors: tuple[float, ...] = ()  # the largest estimate with one point, two, …
    point: Floats | None = None  # x0 of the next part

    @property
    def cost(self) -> float:
        """Coefficients with the next point, `SEVERAL` times where there is more than one."""
        return self.size * (SEVERAL * (len(self.parts) + 1) if self.parts else 1.0)


def expansions(
    pencil: Pencil,
    x: Floats,
    accuracy: float,
    modes: Sequence[int] = (1,),
    orders: Sequence[int] = ORDERS,
    start: Floats | None = None,
    place: Callable[[int], str] = row_in_words,
    most_looks: float = np.inf,
) -> Iterator[ExpansionChoice]:
    """Expansions from the fewest coefficients on, judged to ``accuracy`` at samples x (n, n_x).

    The first point is ``start`` (n_x,) or the most central sample; all share its design. No order
    of over `MOST_TERMS` coefficients is tried. ``place`` says in words what row k of x is. Raises
    AccuracyError, naming the sample, where nothing meets the accuracy, or nothing is found while
    all that is tried takes fewer than ``most_looks`` at samples, and coefficients.
    """
    beside = reduce_adaptively(  # half of the accuracy where round-off allows no more
        pencil, x, 0.05 * accuracy, modes, place=place, tolerable=0.5 * accuracy
    )
    q, y = x[:, : pencil.n_q], x[:, pencil.n_q :]
    told = f"{beside.reduced.size} vectors, which is right to {beside.worst:.1e}"
    reduced_hz = beside.reduced.frequencies(q, y)
    x0 = x[central(x)] if start is None else start
    waiting = _first_trials(pencil, x0, modes, orders)
    alone: dict[float, list[float]] = {trial.gap: [] for trial in waiting}  # errors of one point
    lines: dict[tuple[float, int, bool], str] = {}
    least, at, looks = np.inf, 0, len(x) * len(beside.reasons)
    while waiting and looks < most_looks:
        trial = min(waiting, key=lambda each: each.cost)
        waiting.remove(trial)
        if not trial.parts and _hopeless(trial, alone, int(pencil.active.sum())):
            continue
        looks += len(x) + trial.size
        q0, y0 = np.split(x0 if trial.point is None else trial.point, [pencil.n_q])
        part = expand(pencil, q0, y0, modes, trial.order, cluster_gap=trial.gap)
        parts, hz = (*trial.parts, part), (*trial.hz, part.frequencies(q, y))
        chosen = NearestExpansion(parts).pick(q, hz)
        estimate = error_beside(chosen, reduced_hz, beside.error)
        error, worst = float(estimate.max()), int(np.argmax(estimate.max(axis=1)))
        several = len(parts) > 1
        reach = "" if several else _reach(part, x, estimate)
        lines[trial.gap, trial.order, several] = _line(parts, error, f"{place(worst)}{reach}")
        reasons = (f"compared with a reduced model of {told}", *lines.values())
        made = parts, estimate, reasons, looks
        yield ExpansionChoice(*made, cluster_gap=trial.gap, beside=beside)
        if error <= least:
            least, at = error, worst
        if not several:
            alone[trial.gap].append(error)
        errors, further = (*trial.errors, error), np.append(q[worst], part.y0)
        more = replace(trial, parts=parts, hz=hz, errors=errors, point=further)
        is_new = not any(np.array_equal(each.x0, further) for each in parts)
        if is_new and more.cost < 10 * MOST_TERMS and _more_points_help(errors):
            waiting.append(more)
    where = f"at {place(at)}, (q, y) = {shown_numbers(x[at])}"
    none = f"none has an error estimate {where}"
    nearest = f"the best has an error of {least:.1e} {where}" if np.isfinite(least) else none
    tried = f"of order up to {max(_affordable(pencil, orders))} at up to {MAX_POINTS} points"
    raise AccuracyError(
        f"no expansion {tried if looks < most_looks else 'tried'} reaches {accuracy:.1e}: "
        f"{nearest}. Ask for less, narrow the bounds of the design, or use ea.reduce"
    )


def _first_trials(
    pencil: Pencil, x0: Floats, modes: Sequence[int], orders: Sequence[int]
) -> list[_Trial]:
    """One point, every order, the modes alone and together with their nearest neighbour."""
    theta0, wanted = pencil.theta(x0), set(modes)
    lam = whole_clusters(pencil, theta0, modes, CLUSTER_GAP)[0].lam[0]
    near = [
        1.001 * float(1.0 - below / above)
        for k, (below, above) in enumerate(itertools.pairwise(lam), 1)
        if {k, k + 1} & wanted
    ]
    wider = [gap for gap in near if CLUSTER_GAP <= gap < 0.7]  # in λ: a fifth in frequency
    trials = []
    for gap in (CLUSTER_GAP, *sorted(wider)[:1]):
        groups = whole_clusters(pencil, theta0, modes, gap)[1]
        entries, n = sum(len(group) ** 2 for group in groups), int(pencil.active.sum())
        trials += [_Trial(p, gap, entries * comb(n + p, p)) for p in _affordable(pencil, orders)]
    return trials


def _affordable(pencil: Pencil, orders: Sequence[int]) -> Sequence[int]:
    n = int(pencil.active.sum())
    return [p for p in orders if comb(n + p, p) <= MOST_TERMS] or orders[:1]


def _hopeless(trial: _Trial, alone: Mapping[float, Sequence[float]], n: int) -> bool:
    """True where orders before did not help: one of a cluster, or the last of a large one."""
    errors, without = alone[trial.gap], alone[CLUSTER_GAP]
    if trial.gap > CLUSTER_GAP and len(errors) >= FAIR_ORDERS:
        return not errors[-1] < 0.5 * without[: len(errors)][-1]
    if comb(2 * n + trial.order, trial.order) <= LARGE or not errors:
        return False
    return not errors[-1] < 0.5 * (errors[-3] if len(errors) > 2 else np.inf)


def _more_points_help(errors: Sequence[float]) -> bool:
    """True where a point may be added after those that left the largest ``errors``."""
    count = len(errors)
    if count < FAIR_COUNT:
        return True
    return count < MAX_POINTS and errors[-1] < 0.5 * errors[count // 2 - 1]


def _line(parts: Sequence[Expansion], error: float, where: str) -> str:
    """Order, clusters, points and error in words."""
    groups = [c.modes for c in parts[0].clusters if len(c.modes) > 1]
    what = f"order {parts[0].order}"
    what += "".join(f", modes {g[0]}-{g[-1]} as one cluster" for g in groups)
    what += f" at {len(parts)} points" if len(parts) > 1 else ""
    said = f"error at most {error:.1e}" if np.isfinite(error) else "no estimate"
    return f"{what}: {said} ({where})"


def _reach(part: Expansion, x: Floats, estimate: Floats) -> str:
    """Share of the radius of convergence in words, at the 32 samples of largest error."""
    farthest = np.argsort(-estimate.max(axis=1), kind="stable")[:32]
    q, y = np.split(x[farthest], [len(part.q0)], axis=1)
    share = float(radius_share(part, q, y).max())
    return f", {share:.2f} of the radius of convergence" if np.isfinite(share) else ""
