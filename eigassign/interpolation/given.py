"""Interpolants of a positive function from a given number of values, with an error estimate.

On a single axis all values are asked for at once. On several, first come members on the axes to
degree 2; then, in a few batches, those whose coefficients are predicted to be largest, and with the
last batch some points that are held out as a check.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from math import ceil, log

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import AccuracyError, UsageError
from eigassign.interpolation.adaptive import Adding, Growing, held_out
from eigassign.interpolation.margin import Border, keys
from eigassign.interpolation.newton import Asking, Interpolant, Nodes, cross, frozen
from eigassign.interpolation.single_axis import given_on_line

Ints = NDArray[np.intp]
FIRST = 2  # degree on each axis in the first batch
CHECKS, CHECKED = 2, 25  # values held out on several axes, and one more for so many values
GROWTH = 4.5  # times as many members after a batch as before, at most
DOUBT = 2.0  # times the error that the coefficients show is the estimate on several axes
WORTHLESS = 0.5  # estimate from which the interpolant is refused


def given(axes: Sequence[Nodes], count: int) -> Asking:
    """The interpolant from ``count`` values, fewer if there are no more nodes on the axes.

    Raises UsageError for too few values to tell an error, AccuracyError where they show that it is
    large.
    """
    d = len(axes)
    if count < fewest(d):
        named = "axis" if d == 1 else "axes"
        raise UsageError(f"{count} solves for {d} {named}: at least {fewest(d)} are needed")
    found = yield from given_on_line(axes[0], count) if d == 1 else _on_box(axes, count)
    if not found.error < WORTHLESS:
        raise AccuracyError(f"{found.asked} values leave an estimated error of {found.error:.1e}")
    return found


def fewest(d: int) -> int:
    """Values on ``d`` axes that an error estimate needs at least."""
    return 1 + FIRST if d == 1 else 1 + FIRST * d + CHECKS


def _on_box(axes: Sequence[Nodes], count: int) -> Asking:
    state = Growing(axes)
    count = min(count, int(np.prod(np.array(state.border.tops) + 1.0)))
    fresh, expected = _on_axes(state.border.tops), np.inf
    state.border.grow(keys(fresh).tolist())
    for target in _targets(len(fresh), count - CHECKS - count // CHECKED):
        state.take(fresh, (yield fresh))
        fresh, expected = _largest(state.border, state.best(), target - len(state.members))
    apart = held_out(state.border, axes, 0)[: count - len(state.border.places)]
    values = yield np.vstack([fresh, apart])
    state.take(fresh, values)
    found = state.best()
    surprise = max(1.0, float(found.sizes[-len(fresh) :].sum()) / expected)
    missed = state.missed(found, apart, values[len(fresh) :])
    error = max(DOUBT * surprise * found.error, missed)
    return found._replace(error=error, rounds=((len(state.members), error),))


@lru_cache(maxsize=64)
def _on_axes(tops: tuple[int, ...]) -> Ints:
    """Members on the axes to degree `FIRST`."""
    lines = cross(len(tops), FIRST)
    return frozen(lines[(lines <= tops).all(axis=1)])


def _targets(start: int, members: int) -> list[int]:
    """Numbers of members after each batch but the first, which has ``start``."""
    ratio = max(members / start, 1.0)
    batches = ceil(log(ratio) / log(GROWTH))
    return [round(start * ratio ** (k / batches)) for k in range(1, batches + 1)]


def _largest(border: Border, found: Interpolant, count: int) -> tuple[Ints, float]:
    """The ``count`` missing members predicted largest, predecessors first, and their sum."""
    adding = Adding(border, found)
    while len(adding.keys) < count and (ranked := adding.ranked()):
        adding.take(ranked[: max(1, min(count - len(adding.keys), len(ranked) // 2))])
    return adding.rows, adding.expected
