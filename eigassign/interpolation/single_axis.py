"""Interpolants of a positive function on a single axis: of given values, or to an accuracy.

The inverse of Newton's basis at the nodes is triangular, and its leading blocks are the inverses of
those of the basis: the coefficients of f, f² and f⁻² at the first n nodes are one product,

    c = (T⁻¹)_nn [f, f², f⁻²] ,

with T⁻¹ made once for the nodes. Every value is a check of the interpolant before it, but values at
symmetric nodes can agree though f is not constant: where an accuracy is asked for, one more point,
at an irrational place, is held out in each round. The first coefficient missing is about

    |c_N| ≈ max_k |c_{N−k}| r^k ,

over the last few but the constant, for several in turn may be small by accident; r is the factor by
which they fall from one degree to the next, not trusted to be small while few have been seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from eigassign.interpolation.margin import UNKNOWN, decay
from eigassign.interpolation.newton import (
    POWERS,
    ROUNDS,
    Asking,
    Interpolant,
    Nodes,
    frozen,
    nearly_best,
    powers_of,
    refuse,
    sizes_of,
    tail,
)

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
TRUSTED = 6  # degree from which the rate of decay is believed
LAST = 4  # coefficients from which the next is predicted
FIRST = 3  # degree at first: one too many costs less than a round more
STARTS = (5e-3, 5e-3, 5e-3, 5e-6, 5e-7, 5e-8)  # accuracies below each of which it is one more
FEW = 12  # nodes up to which all are asked for at once: so few show no rate
STEPS = 4  # further members in one round, at most
MISSED = 3.0  # times the error at the points held out is what it may be elsewhere
LEAST_SHARE = 0.2  # of the largest Π |v − v_i| that a point held out has, at least


def given_on_line(nodes: Nodes, count: int) -> Asking:
    """The interpolant from ``count`` values, fewer if there are no more nodes."""
    n = min(count, len(nodes.v))
    values = yield _degrees(0, n)
    return on_line(nodes, powers_of(values))


def adaptive_on_line(nodes: Nodes, accuracy: float, most: int) -> Asking:
    """The interpolant to a relative ``accuracy``; asks for values, round by round.

    Raises AccuracyError where ``most`` values, or the nodes, do not suffice.
    """
    have, n, expected = 0, _start(nodes, accuracy), np.inf
    rounds: list[tuple[int, float]] = []
    values, apart = np.empty((0, 0)), HeldOut(nodes)
    while True:
        wanted = apart.members_and_check(have, n)
        asked = n + len(apart.rows)
        if asked > most:
            refuse(rounds[-1] if rounds else (0, np.inf), accuracy, asked, most)
        fresh = apart.values_of_members((yield wanted), n - have)
        values = np.concatenate([values, fresh]) if have else fresh
        found = on_line(nodes, powers_of(values))
        surprise = max(1.0, sum(found.sizes[have:].tolist()) / (expected or np.inf))
        missed = apart.missed(found)
        rounds.append((n, max(surprise * found.error, MISSED * missed)))
        if rounds[-1][1] <= accuracy:
            return found._replace(error=rounds[-1][1], rounds=tuple(rounds), asked=asked)
        have, (n, expected) = n, _further(found, missed, len(nodes.v), accuracy / surprise)
        if n == have or len(rounds) == ROUNDS:
            refuse(rounds[-1], accuracy, asked, most)


class HeldOut:
    """Points held out, one more in each round: rows of ``nodes.table``, and values there."""

    def __init__(self, nodes: Nodes) -> None:
        """Before any is chosen."""
        self.nodes = nodes
        self.rows: list[int] = []
        self.values: list[Floats] = []

    def members_and_check(self, have: int, n: int) -> Ints:
        """Members ``have`` … n − 1 and the point held out with them, none if nothing is missing."""
        row = None if self.nodes.whole and n == len(self.nodes.v) else farthest(self.nodes, n)
        if row is None or row in self.rows:
            return _degrees(have, n)
        self.rows.append(row)
        return _with(have, n, row)

    def values_of_members(self, values: Floats, fresh: int) -> Floats:
        """Those of the members; that of the point held out is kept."""
        self.values.extend(values[fresh:])
        return values[:fresh]

    def missed(self, found: Interpolant) -> float:
        """|δf/f| that the points held out show, where it is largest.

        The error goes as Π_i (v − v_i), of which h_n at a point is the share of the largest.
        """
        n = len(found.members)
        if not self.rows or (self.nodes.whole and n == len(self.nodes.v)):
            return 0.0
        table = self.nodes.table[self.rows]
        g = table[:, :n] @ found.coefficients.T
        off = np.abs(g / np.array(self.values) ** found.power - 1.0).max(axis=1)
        if n < table.shape[1]:
            off /= np.clip(np.abs(table[:, n]), LEAST_SHARE, 1.0)
        return float(off.max()) / abs(found.power)


@lru_cache(maxsize=256)
def farthest(nodes: Nodes, n: int) -> int | None:
    """Of the places for checks that farthest from n nodes; of a whole axis these are nodes too."""
    first = n + STEPS if nodes.whole else len(nodes.v)
    rows = nodes.table[first:, min(n, len(nodes.v) - 1)]
    return first + int(np.abs(rows).argmax()) if len(rows) else None


@lru_cache(maxsize=256)
def _degrees(first: int, last: int) -> Ints:
    """first … last − 1, (n, 1)."""
    return frozen(np.arange(first, last)[:, None])


@lru_cache(maxsize=256)
def _with(first: int, last: int, row: int) -> Ints:
    """first … last − 1 and one more, (n, 1)."""
    return frozen(np.append(np.arange(first, last), row)[:, None])


def _start(nodes: Nodes, accuracy: float) -> int:
    """Members that the accuracy will most likely need."""
    n = len(nodes.v)
    if nodes.whole and n <= FEW:
        return n
    start = min(1 + FIRST + sum(accuracy < each for each in STARTS), n)
    return n if nodes.whole and n <= start + STEPS else start


def _further(found: Interpolant, missed: float, nodes: int, accuracy: float) -> tuple[int, float]:
    """How many members there are to be, and Σ |c_k| expected of the new ones.

    Until the first that is missing is small enough; as many as there are at the last of the nodes.
    What was ``missed`` at points held out is what the first of them is likely to be.
    """
    sizes, rate = found.sizes.tolist(), float(found.rates[0]) or UNKNOWN
    have, left = len(sizes), 0.5 * accuracy / tail(rate)
    while len(sizes) < min(have + STEPS, nodes):
        predicted = max(sizes[-1] * rate, sizes[-2] * rate**2)
        if len(sizes) == have:
            predicted = max(predicted, missed)
        enough = predicted <= left
        if enough and (len(sizes) > have or predicted == 0.0):
            break
        sizes.append(predicted)
        if enough:  # the error is too large for another reason
            break
    return len(sizes), sum(sizes[have:])


def on_line(nodes: Nodes, g: Floats) -> Interpolant:
    """The best power of values at the first nodes, ``g`` (N, n_powers · n_outputs) of `powers_of`.

    Nothing is missing where no other node will ever be asked for.
    """
    n = len(g)
    c = nodes.inverse[:n, :n] @ g
    sizes = sizes_of(c, np.minimum.reduce(g))
    layers: list[list[float]] = sizes.tolist()
    rates = [decay(each) for each in layers]
    ended = nodes.whole and n == len(nodes.v)
    errors = [0.0 if ended else _rest(*pair) for pair in zip(layers, rates, strict=True)]
    k = nearly_best(errors)
    each = g.shape[1] // len(POWERS)
    own, rate = c[:, k * each : (k + 1) * each].T, np.array(rates[k : k + 1])
    done = ((n, errors[k]),)
    return Interpolant(POWERS[k], _degrees(0, n), own, sizes[k], rate, errors[k], done, n)


def _rest(sizes: Sequence[float], rate: float) -> float:
    """Estimated Σ |c_k| over all k that are missing."""
    if 0.0 < rate < UNKNOWN and len(sizes) <= TRUSTED:
        rate = UNKNOWN
    elif len(sizes) > LAST:  # beside a kink the first coefficients fall and the last no longer
        rate = max(rate, decay([1.0, *sizes[-LAST:]]))
    largest, factor = 0.0, 1.0
    for size in sizes[: max(0, len(sizes) - LAST - 1) : -1]:  # the constant shows no rate
        factor *= rate
        largest = max(largest, size * factor)
    return largest * tail(rate)
