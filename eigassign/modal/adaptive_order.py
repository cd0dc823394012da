"""Order and expansion points of the Taylor polynomial, raised until it is accurate enough.

Its errors are measured at samples that are given, which are solved exactly once. The order rises as
long as two steps lessen the largest error; then a point of the same design is added where the best
order errs most. A pose is answered by the nearest point. Where a mode lies close to another, both
are expanded as a cluster, too, and the better of the two counts.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import comb

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import AccuracyError
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.modal.arguments import MOST_TERMS, shown_numbers, solve_blocks
from eigassign.modal.exact.clusters import CLUSTER_GAP, whole_clusters
from eigassign.modal.exact.solver import eigenvalues
from eigassign.modal.expansion import Expansion, NearestExpansion, expand

Floats = NDArray[np.float64]
ORDERS = (2, 3, 4, 5, 6, 8, 10, 12, 14, 17, 20)
MAX_POINTS = 32
# Number of points from which doubling them must halve the error. That ends a hopeless search before
# MAX_POINTS; without it three shipped cases at 1e-3 and 1e-5 choose the same at the same cost.
FAIR_COUNT = 8
# Orders after which a cluster must halve the error of the modes alone. Followed on, the search of
# stress/wide_motion to 1e-5 takes four times as long, for the same choice.
FAIR_ORDERS = 4
# Products of coefficients (2.3 µs each) from which the next order is not tried unless the last two
# halved the error: 8 of eight variables, 10 of five, 12 of four. Followed on, series that diverge
# or miss a mode took 10 s and 1.7 GB, and came to nothing.
LARGE = 100_000
# On the worst error measured, where an accuracy is stated: of 540 answers at other poses and
# designs (`tests/stability/test_measured_errors.py`) none lies above it.
MARGIN = 1.25


@dataclass(frozen=True, eq=False)
class ExpansionChoice(NearestExpansion):
    """Expansions of one order, and their errors (n, n_modes) measured at the samples, in Hz/Hz.

    Modes closer than ``cluster_gap`` (relative in λ) are expanded together.
    """

    error: Floats
    cluster_gap: float
    reasons: tuple[str, ...] = ()  # all that was tried, in words

    @property
    def order(self) -> int:
        """Their order, at least 1; where no variable matters, their degree is 0."""
        return max(self.parts[0].order, 1)

    @property
    def worst(self) -> int:
        """The sample where the error is largest."""
        return int(np.argmax(self.error.max(axis=1)))

    @property
    def stated(self) -> float:
        """The largest error, with its margin."""
        return MARGIN * float(self.error.max())


def row_in_words(k: int) -> str:
    """The name of row k of x where nothing better is known."""
    return f"sample {k}"


def raise_order(
    pencil: Pencil,
    x: Floats,
    accuracy: float,
    modes: Sequence[int] = (1,),
    orders: Sequence[int] = ORDERS,
    start: Floats | None = None,
    place: Callable[[int], str] = row_in_words,
    most: float = np.inf,
) -> ExpansionChoice:
    """The first expansions whose error, with its margin, is within ``accuracy`` at x (n, n_x).

    The first point is ``start`` (n_x,) or the most central sample; all share its design. No order
    of over `MOST_TERMS` coefficients is tried, and no further point after ``most`` coefficients in
    all. ``place`` says in words what row k of x is. Raises AccuracyError, naming the sample, where
    nothing meets the accuracy.
    """
    x0, n = x[central(x)] if start is None else start, int(pencil.active.sum())
    orders = [p for p in orders if comb(n + p, p) <= MOST_TERMS] or orders[:1]
    trials, points = _Trials(pencil, x, tuple(modes), _gaps(pencil, x0, modes)), [x0]
    reasons = [f"compared with exact solves at {len(x)} poses and designs"]
    best, lowest = list[ExpansionChoice](), 0
    while True:
        found = list[ExpansionChoice]()
        for order in orders[lowest:]:
            found.append(trials.at(order, points))
            reasons.append(_line(found[-1], place))
            if found[-1].stated <= accuracy:
                return replace(found[-1], reasons=tuple(reasons))
            back = 3 if len(points) == 1 else 2  # in a symmetric pose every other degree vanishes
            least = 0.5 if comb(2 * n + order, order) > LARGE else 1.0
            if len(found) >= back and not found[-1].stated < least * found[-back].stated:
                break
        best.append(min(found, key=lambda one: one.stated))
        lowest, worst = orders.index(best[-1].order), best[-1].worst
        further = np.append(x[worst, : pencil.n_q], x0[pencil.n_q :])
        is_new = not any(np.array_equal(each, further) for each in points)
        if not is_new or trials.made > most or not _more_points_help(best):
            break
        points.append(further)
    nearest = min(best, key=lambda one: one.stated)
    where = f"at {place(nearest.worst)}, (q, y) = {shown_numbers(x[nearest.worst])}"
    tried = f"of order up to {max(orders)} at up to {MAX_POINTS} points"
    off = f"the best is about {nearest.stated:.1e} off" if np.isfinite(nearest.stated) else "λ < 0"
    raise AccuracyError(
        f"no expansion {tried if trials.made <= most else 'tried'} reaches {accuracy:.1e}: "
        f"{off} {where}. Ask for less, narrow the bounds of the design, or use ea.reduce"
    )


class _Trials:
    """Expansions about points, made once each, and beside exact solves at samples x (n, n_x)."""

    def __init__(
        self, pencil: Pencil, x: Floats, modes: tuple[int, ...], gaps: Sequence[float]
    ) -> None:
        self.pencil, self.modes, self.gaps, self.made = pencil, modes, list(gaps), 0
        self.q, self.y = np.split(x, [pencil.n_q], axis=1)
        lam = [eigenvalues(pencil, some, max(modes)) for some in solve_blocks(x, pencil.n_dof)]
        exact = np.sqrt(np.concatenate(lam)) / (2.0 * np.pi)
        self.exact_hz = exact[:, np.array(modes) - 1]
        self.known: dict[tuple[float, int, bytes], tuple[Expansion, Floats]] = {}
        self.helped = [0, 0]  # orders that were tried with clusters, and where these helped

    def at(self, order: int, points: Sequence[Floats]) -> ExpansionChoice:
        """The better of the modes alone and together with their neighbours."""
        found = [self._of(gap, order, points) for gap in self.gaps]
        best = min(found, key=lambda one: one.stated)
        if len(found) > 1:
            self.helped[0] += 1
            self.helped[1] += found[1].stated < 0.5 * found[0].stated
            if self.helped[0] >= FAIR_ORDERS and not self.helped[1]:
                del self.gaps[1]
        return best

    def _of(self, gap: float, order: int, points: Sequence[Floats]) -> ExpansionChoice:
        made = [self._about(gap, order, point) for point in points]
        parts, hz = zip(*made, strict=True)
        off = np.abs(NearestExpansion(parts).pick(self.q, hz) / self.exact_hz - 1.0)
        return ExpansionChoice(parts, np.where(np.isnan(off), np.inf, off), gap)

    def _about(self, gap: float, order: int, point: Floats) -> tuple[Expansion, Floats]:
        key = gap, order, point.tobytes()
        if key not in self.known:
            q0, y0 = np.split(point, [self.pencil.n_q])
            made = expand(self.pencil, q0, y0, self.modes, order, cluster_gap=gap)
            self.made += sum(cluster.coefficients.size for cluster in made.clusters)
            self.known[key] = made, made.frequencies(self.q, self.y)
        return self.known[key]


def _gaps(pencil: Pencil, x0: Floats, modes: Sequence[int]) -> list[float]:
    """Up to which modes are a cluster: the modes alone, and together with a near neighbour."""
    lam, wanted = whole_clusters(pencil, pencil.theta(x0), modes, CLUSTER_GAP)[0].lam[0], set(modes)
    near = [
        1.001 * float(1.0 - below / above)
        for k, (below, above) in enumerate(itertools.pairwise(lam), 1)
        if {k, k + 1} & wanted
    ]
    # in λ: a fifth in frequency
    return [CLUSTER_GAP, *sorted(gap for gap in near if CLUSTER_GAP <= gap < 0.7)[:1]]


def _more_points_help(best: Sequence[ExpansionChoice]) -> bool:
    """True where a point may be added after those that left these errors with one point, two, …"""
    count = len(best)
    if count < FAIR_COUNT:
        return True
    return count < MAX_POINTS and best[-1].stated < 0.5 * best[count // 2 - 1].stated


def _line(found: ExpansionChoice, place: Callable[[int], str]) -> str:
    """Order, clusters, points and error in words."""
    groups = [c.modes for c in found.parts[0].clusters if len(c.modes) > 1]
    what = f"order {found.order}"
    what += "".join(f", modes {g[0]}-{g[-1]} as one cluster" for g in groups)
    what += f" at {len(found.parts)} points" if len(found.parts) > 1 else ""
    off = f"about {found.stated:.1e} off" if np.isfinite(found.stated) else "no frequency (λ < 0)"
    return f"{what}: {off} ({place(found.worst)})"


def central(x: Floats) -> int:
    """The sample nearest to the middle of the ranges of x (n, n_x), each range taken as 1."""
    low, high = x.min(axis=0), x.max(axis=0)
    width = np.where(high > low, high - low, 1.0)
    return int(np.argmin((((x - 0.5 * (low + high)) / width) ** 2).sum(axis=1)))
