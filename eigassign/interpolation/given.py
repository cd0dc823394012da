"""Interpolants of a positive function from a given number of values, with what they leave as error.

On a single axis all values are asked for at once. On more, first the axes alone to degree 2; then,
in a few batches, the members that are predicted to matter most, and with the last some points that
are held out for a check.
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
LOOK = 2  # degree on each axis that is looked at first
CHECKS, CHECKED = 2, 25  # values held out on several axes, and for how many there is one more
GROWTH = 4.5  # times as many members after a batch as before, at most
DOUBT = 2.0  # on what the coefficients show on several axes
WORTHLESS = 0.5  # an estimate that is no estimate


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
    """Values on ``d`` axes that tell an error."""
    return 1 + LOOK if d == 1 else 1 + LOOK * d + CHECKS


def _on_box(axes: Sequence[Nodes], count: int) -> Asking:
    state = Growing(axes)
    count = min(count, int(np.prod(np.array(state.border.tops) + 1.0)))
    fresh, expected = _looks(state.border.tops), np.inf
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
def _looks(tops: tuple[int, ...]) -> Ints:
    """The axes alone."""
    lines = cross(len(tops), LOOK)
    return frozen(lines[(lines <= tops).all(axis=1)])


def _targets(start: int, members: int) -> list[int]:
    """How many members there are to be after each batch but the first of ``start``."""
    ratio = max(members / start, 1.0)
    batches = ceil(log(ratio) / log(GROWTH))
    return [round(start * ratio ** (k / batches)) for k in range(1, batches + 1)]


def _largest(border: Border, found: Interpolant, count: int) -> tuple[Ints, float]:
    """The ``count`` missing members predicted largest, predecessors first, and their sum."""
    adding = Adding(border, found)
    while len(adding.keys) < count and (ranked := adding.ranked()):
        adding.take(ranked[: max(1, min(count - len(adding.keys), len(ranked) // 2))])
    return adding.rows, adding.expected
