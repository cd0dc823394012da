"""Order, clusters and expansion points of polynomials: the cheapest that meets an accuracy."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

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
from eigassign.modal.taylor_estimate import polynomial_error

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
ORDERS = (2, 3, 4, 5, 6, 8, 10)
MAX_POINTS = 8
WIDEST_CLUSTER = 0.7  # relative gap in λ up to which neighbours are tried as one cluster
FINER = 0.05  # part of the accuracy that the reduced model beside them has to reach


@dataclass(frozen=True, eq=False)
class ExpansionChoice:
    """Expansions that together are within ``accuracy`` at every sample, and why these."""

    expansions: tuple[Expansion, ...]
    owner: Ints  # (n,): which one is used at each sample
    estimate: Floats  # (n, n_modes), of that one
    beside: AdaptiveReduction
    reasons: tuple[str, ...]

    @property
    def order(self) -> int:
        """Their order."""
        return self.expansions[0].order

    def frequencies(self, q: ArrayLike, y: ArrayLike) -> Floats:
        """(n, n_modes) in Hz, each sample by the expansion whose own estimate is smallest there."""
        return self._best(q, y)[0]

    def error_estimate(self, q: ArrayLike, y: ArrayLike) -> Floats:
        """Relative error of ``frequencies``, (n, n_modes); infinite where refused."""
        return self._best(q, y)[1]

    def _best(self, q: ArrayLike, y: ArrayLike) -> tuple[Floats, Floats]:
        reduced = self.beside.reduced
        f, e = reduced.frequencies(q, y), reduced.error_estimate(q, y)
        values = np.array([part.frequencies(q, y) for part in self.expansions])
        errors = np.array([polynomial_error(value, f, e) for value in values])
        owner = errors.max(axis=2).argmin(axis=0)
        each = np.arange(values.shape[1])
        return values[owner, each], errors[owner, each]


def choose_expansion(
    pencil: Pencil,
    x: Floats,
    accuracy: float,
    modes: Sequence[int] = (1,),
    linear_in_y: bool = False,
    orders: Sequence[int] = ORDERS,
    start: Floats | None = None,
    place: Callable[[int], str] = row_in_words,
) -> ExpansionChoice:
    """The expansions with the fewest coefficients whose estimate is ≤ ``accuracy`` at x (n, n_x).

    Tried in order of cost: the order p at one point, ``start`` or the most central sample; with
    neighbouring modes as one cluster; at several points. Judged against one reduced model.
    ``place`` says in words what row k of x is. Raises AccuracyError, naming the sample, where
    nothing does.
    """
    beside = reduce_adaptively(pencil, x, FINER * accuracy, modes, place=place)
    judge = (
        f"judged beside a reduced model of {beside.reduced.size} vectors, itself right to "
        f"{beside.estimate.max():.1e}"
    )
    trial = _Trial(pencil, x, accuracy, tuple(modes), linear_in_y, beside, [judge], place)
    first = x[central(x)] if start is None else start
    best = _cheapest(trial, _single(trial, first, orders))
    if best is None:
        best = _cheapest(trial, _several(trial, first, orders))
    if best is None:
        k = trial.worst_sample
        raise AccuracyError(
            f"no expansion of order up to {max(orders)} at up to {MAX_POINTS} points reaches "
            f"{accuracy:.1e}: the last left {trial.last:.1e} at {place(k)}, (q, y) = {shown(x[k])}"
        )
    parts, owner, estimate = best
    return ExpansionChoice(parts, owner, estimate, beside, tuple(trial.reasons))


_Found = tuple[tuple[Expansion, ...], Ints, Floats]


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

    def errors(self, part: Expansion) -> Floats:
        q, y = self.x[:, : self.pencil.n_q], self.x[:, self.pencil.n_q :]
        f = self.beside.reduced.frequencies(q, y)
        return polynomial_error(part.frequencies(q, y), f, self.beside.estimate)

    def share(self, part: Expansion) -> float:
        q, y = self.x[:, : self.pencil.n_q], self.x[:, self.pencil.n_q :]
        return float(radius_share(part, q, y).max())

    def note(self, what: str, worst: Floats, share: float = np.nan) -> None:
        self.worst_sample = int(np.argmax(worst))
        self.last = float(worst[self.worst_sample])
        error = f"error at most {self.last:.1e}" if np.isfinite(self.last) else "no number"
        reach = f", {share:.2f} of the radius of convergence" if np.isfinite(share) else ""
        self.reasons.append(f"{what}: {error} ({self.place(self.worst_sample)}{reach})")


def _cheapest(trial: _Trial, candidates: Iterator[tuple[int, _Found]]) -> _Found | None:
    """Of the candidates within the accuracy the one with the fewest coefficients."""
    best: tuple[int, _Found] | None = None
    for cost, found in candidates:
        if found[2].max() <= trial.accuracy and (best is None or cost < best[0]):
            best = (cost, found)
    return None if best is None else best[1]


def _cost(parts: Sequence[Expansion]) -> int:
    return sum(c.coefficients.size for part in parts for c in part.clusters)


def _single(trial: _Trial, point: Floats, orders: Sequence[int]) -> Iterator[tuple[int, _Found]]:
    """One expansion point, the modes alone and then with their neighbours."""
    nobody = np.zeros(len(trial.x), dtype=np.intp)
    for gap in _gaps(trial, point):
        for order in orders:
            part = trial.expand(point, order, gap)
            errors = trial.errors(part)
            share = trial.share(part)
            trial.note(_named(part), errors.max(axis=1), share)
            yield _cost((part,)), ((part,), nobody, errors)
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
    """Points added where the best expansion so far is worst, for every order."""
    for order in orders:
        parts = [trial.expand(first, order, CLUSTER_GAP)]
        errors = [trial.errors(parts[0])]
        while len(parts) < MAX_POINTS:
            smallest = np.min([e.max(axis=1) for e in errors], axis=0)
            parts.append(trial.expand(trial.x[int(np.argmax(smallest))], order, CLUSTER_GAP))
            errors.append(trial.errors(parts[-1]))
            owner = np.argmin([e.max(axis=1) for e in errors], axis=0)
            estimate = np.array(errors)[owner, np.arange(len(trial.x))]
            if estimate.max() <= trial.accuracy:
                break
        trial.note(f"order {order} at {len(parts)} points", estimate.max(axis=1))
        yield _cost(parts), (tuple(parts), owner, estimate)
