"""Order, clusters and expansion points of polynomials: the cheapest that meets an accuracy."""

from __future__ import annotations

from collections.abc import Callable, Sequence
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
)
from eigassign.modal.clusters import CLUSTER_GAP
from eigassign.modal.expansion import Expansion
from eigassign.modal.expansion_search import MAX_POINTS, Points, cheapest, terms
from eigassign.modal.expansion_trial import Found, Trial
from eigassign.modal.nearest import picked
from eigassign.modal.sizes import MOST_TERMS
from eigassign.modal.taylor_estimate import polynomial_error

Floats = NDArray[np.float64]
ORDERS = (2, 3, 4, 5, 6, 8, 10, 12, 14, 17, 20)
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
    ``begun`` at fewer samples, with further points if need be. Else the search of
    `expansion_search`: orders at one point, ``start`` or the most central sample, with neighbouring
    modes as one cluster, and at several points of one design; no order of over `MOST_TERMS` terms.
    Judged against one reduced model, as they are evaluated. ``place`` says in words what row k of x
    is. Raises AccuracyError, naming the sample, where nothing does.
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
    best = _first(trial, suggestions) or _continued(trial, begun)
    best = best or cheapest(trial, first, orders)
    if best is None:
        raise AccuracyError(
            f"no expansion of order up to {max(orders)} at up to {MAX_POINTS} points reaches "
            f"{accuracy:.1e}: {trial.nearest}; ask for less, narrow the bounds of the design, or "
            "take ea.reduce or ea.fit"
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


def _continued(trial: Trial, begun: ExpansionChoice | None) -> Found | None:
    """What met the accuracy at fewer samples, with the points that these need."""
    if begun is None:
        return None
    ladder = Points(trial, begun.expansions, begun.cluster_gap)
    while not ladder.ended:
        ladder.step()
    ladder.tell()
    return ladder.found if ladder.meets else None
