"""Interpolants of a positive function from a given number of values, with what they leave as error.

On a single axis all values are asked for at once. On more, first the axes alone to degree 2; then,
in a few batches, the members that are predicted to matter most, and with the last some points that
are held out for a check.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from math import ceil, log

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dtrtrs

from eigassign.errors import AccuracyError, UsageError
from eigassign.series.adaptive_newton import Asking, Growing, held_out
from eigassign.series.interpolant import Interpolant, on_line, powers_of
from eigassign.series.margin import margin
from eigassign.series.newton import cross

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
LOOK = 2  # degree on each axis that is looked at first
CHECKS, CHECKED = 2, 25  # values held out on several axes, and for how many there is one more
GROWTH = 4.5  # times as many members after a batch as before, at most
DOUBT = 2.0  # on what the coefficients show on several axes
WORTHLESS = 0.5  # an estimate that is no estimate


def given(tables: Sequence[Floats], count: int, whole: Sequence[bool]) -> Asking:
    """The interpolant from ``count`` values, fewer if there are no more nodes.

    ``tables`` and ``whole`` are as for `adaptive`. Raises UsageError for too few values to tell an
    error, AccuracyError where they show that it is large.
    """
    d = len(tables)
    if count < fewest(d):
        axes = "axis" if d == 1 else "axes"
        raise UsageError(f"{count} solves for {d} {axes}: at least {fewest(d)} are needed")
    run = _on_line(tables[0], count, whole[0]) if d == 1 else _on_box(tables, count, whole)
    found = yield from run
    if not found.error < WORTHLESS:
        raise AccuracyError(f"{found.asked} values leave an estimated error of {found.error:.1e}")
    return found


def fewest(d: int) -> int:
    """Values on ``d`` axes that tell an error."""
    return 1 + LOOK if d == 1 else 1 + LOOK * d + CHECKS


def _on_line(table: Floats, count: int, whole: bool) -> Asking:
    n = min(count, len(table))
    members = _degrees(n)
    values = yield members
    g = powers_of(values)
    c = dtrtrs(table[:n, :n], g, lower=1, unitdiag=1)[0]
    return on_line(members, c, np.minimum.reduce(g), whole and n == len(table), n)


@lru_cache(maxsize=64)
def _degrees(n: int) -> Ints:
    """0 … n − 1 on a single axis, (n, 1)."""
    degrees = np.arange(n)[:, None]
    degrees.setflags(write=False)
    return degrees


def _on_box(tables: Sequence[Floats], count: int, whole: Sequence[bool]) -> Asking:
    tops = np.array([len(table) - 1 for table in tables], dtype=np.intp)
    count = min(count, int(np.prod(tops + 1.0)))
    lines = cross(len(tops), LOOK)
    fresh, expected = lines[(lines <= tops).all(axis=1)], np.inf
    state = Growing.empty(tables, np.where(whole, tops, tops + 1))
    for target in _targets(len(fresh), count - CHECKS - count // CHECKED):
        state = state.grown(fresh, (yield fresh), len(fresh))
        found = state.best()
        fresh, expected = _largest(found, tops, target - len(state.members))
    done = np.vstack([state.members, fresh])
    apart = held_out(done, tops, 0)[: count - len(done)]
    values = yield np.vstack([fresh, apart])
    state = state.grown(fresh, values[: len(fresh)], len(values))
    found = state.best()
    surprise = max(1.0, float(found.sizes[-len(fresh) :].sum()) / expected)
    missed = state.missed(found, apart, values[len(fresh) :])
    error = max(DOUBT * surprise * found.error, missed)
    return replace(found, error=error, rounds=((len(done), error),), asked=state.asked)


def _targets(start: int, members: int) -> list[int]:
    """How many members there are to be after each batch but the first of ``start``."""
    ratio = max(members / start, 1.0)
    batches = ceil(log(ratio) / log(GROWTH))
    return [round(start * ratio ** (k / batches)) for k in range(1, batches + 1)]


def _largest(found: Interpolant, tops: Ints, count: int) -> tuple[Ints, float]:
    """The ``count`` missing members predicted largest, predecessors first, and their sum."""
    members, sizes, have = found.members, found.sizes, len(found.members)
    while len(members) < have + count:
        edge = margin(members, tops)
        if not len(edge.rows):
            break
        predicted = edge.predicted(sizes, found.rates)
        room = have + count - len(members)
        order = np.argsort(-predicted)[: max(1, min(room, len(predicted) // 2))]
        members = np.vstack([members, edge.rows[order]])
        sizes = np.append(sizes, predicted[order])
    return members[have:], float(sizes[have:].sum())
