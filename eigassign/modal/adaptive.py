"""Expansion points, order and basis chosen from error estimates, never more than is asked for."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import AccuracyError
from eigassign.mechanism.pencil import Pencil
from eigassign.modal.reduced import reduce
from eigassign.modal.reduced_model import ReducedModel

Floats = NDArray[np.float64]
MAX_SIZE = 200  # basis vectors
MAX_POINTS = 12
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
            f"(q, y) = {shown(x[k])}, the estimated error is {error:.1e}"
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
    while len(points) <= MAX_POINTS:
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


def shown(x: Floats) -> str:
    """Numbers for a message."""
    return "(" + ", ".join(f"{value:.6g}" for value in x) + ")"
