"""Reduced model of few vectors that meets an accuracy at given samples, by its own error estimate.

Half order after half order, expansion points are added at the sample where the estimate is largest,
until it meets the accuracy. The smallest model that does so is kept.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import AccuracyError
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.modal.adaptive.cheapest import Rung
from eigassign.modal.arguments import shown_numbers
from eigassign.modal.reduced.model import ReducedModel
from eigassign.modal.reduced.reduce import reduce

Floats = NDArray[np.float64]
MAX_POINTS = 12  # expansion points; the shipped cases need 6 at most, to 1e-7
HALF_ORDERS = (1, 2, 3)


@dataclass(frozen=True, eq=False, kw_only=True)
class AdaptiveReduction(Rung):
    """A reduced model with its error estimate (n, n_modes) at the samples."""

    reduced: ReducedModel

    @property
    def at(self) -> int:
        """The sample where the error is largest."""
        return int(np.argmax(self.error.max(axis=1)))


def row_in_words(k: int) -> str:
    """The name of row k of x where nothing better is known."""
    return f"sample {k}"


def reduce_adaptively(
    pencil: Pencil,
    x: Floats,
    accuracy: float,
    modes: Sequence[int] = (1,),
    max_size: int = 200,
    half_orders: Sequence[int] = HALF_ORDERS,
    place: Callable[[int], str] = row_in_words,
    tolerable: float | None = None,
) -> AdaptiveReduction:
    """The smallest reduced model found whose estimate is ≤ ``accuracy`` at samples x (n, n_x).

    ``place`` says in words what row k of x is. Where no model meets the accuracy, as where the
    round-off of a fine mesh is larger, the one with the least error if that is ≤ ``tolerable``;
    else raises AccuracyError, naming the sample.
    """
    best: AdaptiveReduction | None = None  # the smallest that meets the accuracy
    closest: AdaptiveReduction | None = None  # that with the least error
    least, at = np.inf, 0  # of all, also those of too many vectors
    reasons: list[str] = []
    q, y = x[:, : pencil.n_q], x[:, pencil.n_q :]
    for half_order in half_orders:
        limit = max_size if best is None else best.reduced.size - 1
        points = [central(x)]
        while len(points) <= MAX_POINTS:
            reduced = reduce(pencil, q[points], y[points], modes, half_order)
            made = AdaptiveReduction(reduced.error_estimate(q, y), (), reduced=reduced)
            reasons.append(_line(half_order, made, place(made.at)))
            least, at = min((least, at), (made.worst, made.at))
            if reduced.size > limit:
                break
            if closest is None or made.worst < closest.worst:
                closest = made
            if made.worst <= accuracy:
                best = made
                break
            if made.at in points:
                break
            points.append(made.at)
    found, bound = best or closest, accuracy if tolerable is None else tolerable
    if found is None or not found.worst <= bound:
        raise AccuracyError(
            f"no reduced model of up to {max_size} vectors reaches {bound:.1e}: at {place(at)}, "
            f"(q, y) = {shown_numbers(x[at])}, the estimated error is {least:.1e}"
        )
    return replace(found, reasons=tuple(reasons))


def _line(half_order: int, made: AdaptiveReduction, sample: str) -> str:
    points = len(made.reduced.points)
    where = f"{points} point{'s' if points > 1 else ''}"
    what = f"at most {made.worst:.1e}" if np.isfinite(made.worst) else "refused"
    size = made.reduced.size
    return f"vectors to order {half_order} at {where} ({size} in all): {what} ({sample})"


def central(x: Floats) -> int:
    """The sample nearest to the middle of the ranges of x (n, n_x), each range taken as 1."""
    low, high = x.min(axis=0), x.max(axis=0)
    width = np.where(high > low, high - low, 1.0)
    return int(np.argmin((((x - 0.5 * (low + high)) / width) ** 2).sum(axis=1)))
