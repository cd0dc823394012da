"""Interpolants of a positive function to a stated relative accuracy, from as few values as will do.

With f also f² and f⁻² are interpolated on the same members, and the one whose coefficients fall
fastest is kept. What is missing is estimated from the coefficients (`series.margin`), and checked
at points held out. The members wanted next are all those predicted to matter: few rounds, each of
them one batch of values.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dtrtrs

from eigassign.errors import AccuracyError
from eigassign.series.interpolant import (
    POWERS,
    Interpolant,
    nearly_best,
    on_line,
    powers_of,
    sizes_of,
    tail,
)
from eigassign.series.lower_set import total_degree
from eigassign.series.margin import UNKNOWN, Margin, keys, margin, rate
from eigassign.series.newton import cross, ordered, products, spread_steps

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
MISSED = 3.0  # how much worse than at the points held out it may be elsewhere
CHECKED = 12  # members for each further point that is held out
TRUSTED = 4  # degree from which a rate is believed
STARTS = (5e-3, 5e-4)  # accuracies below each of which one degree more is started with
STARTS_LINE = (
    5e-3,
    5e-3,
    5e-4,
    5e-5,
    5e-6,
    5e-7,
    5e-8,
    5e-9,
)  # on a single axis: two more at first
FEW = 12  # nodes below which an axis is taken whole
GROWTH = 3  # times as many members in one round at most
STEPS = 4  # further members in one round on a single axis at most
ROUNDS = 12


Asking = Generator[Ints, Floats, Interpolant]  # members wanted → values (n, n_outputs) sent


def interpolate(sample: Callable[[Ints], Floats], run: Asking) -> Interpolant:
    """What a run ends with that is sent f = ``sample``(members) (n, n_outputs)."""
    wanted = next(run)
    while True:
        try:
            wanted = run.send(sample(wanted))
        except StopIteration as end:
            found: Interpolant = end.value
            return found


def adaptive(
    tables: Sequence[Floats], accuracy: float, most: int, whole: Sequence[bool] | None = None
) -> Asking:
    """The interpolant of f to a relative ``accuracy``; asks for values, round by round.

    ``tables`` hold Newton's basis at the nodes of each axis; an axis is ``whole`` if nothing but
    its nodes is ever asked for. Raises AccuracyError where ``most`` values, or the nodes, do not
    suffice.
    """
    tops = np.array([len(table) - 1 for table in tables], dtype=np.intp)
    finite = np.array(whole if whole is not None else [False] * len(tops))
    state = Growing.empty(tables, np.where(finite, tops, tops + 1))
    fresh, expected = _start(tops, finite, accuracy), np.inf
    rounds: list[tuple[int, float]] = []
    while True:
        apart = held_out(np.vstack([state.members, fresh]), tops, len(rounds))
        values = yield np.vstack([fresh, apart])
        state = state.grown(fresh, values[: len(fresh)], len(values))
        found = state.best()
        missed = state.missed(found, apart, values[len(fresh) :])
        surprise = max(1.0, float(found.sizes[-len(fresh) :].sum()) / expected)
        rounds.append((len(state.members), max(surprise * found.error, missed)))
        if rounds[-1][1] <= accuracy:
            return replace(found, error=rounds[-1][1], rounds=tuple(rounds), asked=state.asked)
        doubt = max(surprise, missed / found.error if found.error else 1.0)
        fresh, expected = _wanted(found, tops, accuracy / doubt)
        count = len(state.members) + len(fresh)
        if not len(fresh) or count > most or len(rounds) == ROUNDS:
            raise AccuracyError(_refusal(rounds[-1], accuracy, count, most))


def _refusal(reached: tuple[int, float], accuracy: float, count: int, most: int) -> str:
    done = f"{reached[0]} values leave an estimated error of {reached[1]:.1e}, not {accuracy:.1e}"
    return f"{done}, and " + (
        f"over {most} are not allowed" if count > most else "more do not help"
    )


def _start(tops: Ints, whole: NDArray[np.bool_], accuracy: float) -> Ints:
    """All members of degree 2, and the axes alone to what the accuracy will surely need.

    A whole axis of few nodes is taken at once: so few samples show no rate.
    """
    d = len(tops)
    degree = 2 + sum(accuracy < each for each in (STARTS_LINE if d == 1 else STARTS))
    reach = np.where(whole & (tops < FEW), tops, np.minimum(degree, tops))
    if d == 1:
        return np.arange(reach[0] + 1)[:, None]
    lines = cross(d, int(reach.max()))
    plain = total_degree(d, 2).indices
    keep = np.vstack([lines[(lines <= reach).all(axis=1)], plain[(plain <= tops).all(axis=1)]])
    return ordered(keep)


def held_out(members: Ints, tops: Ints, rounds: int) -> Ints:
    """Points for a check (n, d): corners, one far from all nodes, and others all over the box.

    None on a single axis, where every value was a check of the interpolant before it.
    """
    d = len(tops)
    if d == 1:
        return members[:0]
    turns = np.arange(d) % 2
    corners = np.array([np.full(d, 1), np.full(d, 2), 1 + turns, 2 - turns])  # nodes 1, 2: ends
    far = np.vstack([corners, members.max(axis=0) + 1])
    k = np.arange(1, 2 + len(members) // CHECKED)[:, None] + 100 * rounds
    spread = np.floor((0.5 + k * spread_steps(d)) % 1.0 * (tops + 1)).astype(np.intp)
    apart = np.minimum(np.vstack([far, spread]), tops)
    return np.asarray(apart[~np.isin(keys(apart), keys(members))])


@dataclass(frozen=True, eq=False)
class Growing:
    """Members so far, and the coefficients of every power, (N, n_powers · n_outputs)."""

    tables: Sequence[Floats]
    limits: Ints  # degrees beyond which nothing is missing
    members: Ints
    c: Floats
    smallest: Floats  # the least f^p seen, (n_powers · n_outputs,)
    asked: int

    @staticmethod
    def empty(tables: Sequence[Floats], limits: Ints) -> Growing:
        """Before any value is known."""
        nothing = np.zeros((0, len(limits)), dtype=np.intp)
        return Growing(tables, limits, nothing, np.zeros((0, 1)), np.full(1, np.inf), 0)

    def grown(self, fresh: Ints, values: Floats, asked: int) -> Growing:
        """With further members; the coefficients of the others stay as they are."""
        g = powers_of(values)
        rest = g if not len(self.c) else g - products(self.tables, fresh, self.members) @ self.c
        own = dtrtrs(products(self.tables, fresh, fresh), rest, lower=1, unitdiag=1)[0]
        return replace(
            self,
            members=np.vstack([self.members, fresh]),
            c=np.vstack([self.c.reshape(-1, g.shape[1]), own]),
            smallest=np.minimum(self.smallest, g.min(axis=0)),
            asked=self.asked + asked,
        )

    def best(self) -> Interpolant:
        """The power with the least error, or nearly."""
        if len(self.limits) == 1:
            return on_line(self.members, self.c, self.smallest, len(self.c) > self.limits[0])
        edge, sizes = margin(self.members, self.limits), sizes_of(self.c, self.smallest)
        rates = [np.array([rate(axis, each) for axis in self.members.T]) for each in sizes]
        errors = [self._rest(edge, *pair) for pair in zip(sizes, rates, strict=True)]
        k = nearly_best(errors)
        c = np.split(self.c, len(POWERS), axis=1)[k].T
        return Interpolant(POWERS[k], self.members, c, sizes[k], rates[k], errors[k])

    def _rest(self, edge: Margin, sizes: Floats, rates: Floats) -> float:
        """Estimated Σ |c_γ| over all γ that are missing.

        While an axis has shown few coefficients, its rate is not trusted to be small.
        """
        short = (self.members.max(axis=0) < TRUSTED) & (rates > 0.0)
        cautious = np.where(short, np.maximum(rates, UNKNOWN), rates)
        return float(edge.predicted(sizes, cautious).sum()) * tail(float(cautious.max()))

    def missed(self, found: Interpolant, apart: Ints, values: Floats) -> float:
        """|δf/f| at the points held out, with a margin."""
        g = products(self.tables, apart, found.members) @ found.coefficients.T
        off = np.abs(g / values**found.power - 1.0)
        return MISSED * float(off.max(initial=0.0)) / abs(found.power)


def _wanted(found: Interpolant, tops: Ints, accuracy: float) -> tuple[Ints, float]:
    """Members to add, predecessors first, and Σ |c_γ| expected of them.

    Of the margin, and of that of what is added, the largest until the rest is small enough; none
    where every axis is at its end.
    """
    members, sizes, have = found.members, found.sizes, len(found.members)
    left = 0.5 * accuracy / tail(float(found.rates.max()))
    most = have + STEPS if len(tops) == 1 else (1 + GROWTH) * have
    while len(members) < most:
        edge = margin(members, tops)
        predicted = edge.predicted(sizes, found.rates)
        order = np.argsort(predicted)
        keep = order[int(np.searchsorted(np.cumsum(predicted[order]), left, side="right")) :]
        if not len(keep) and len(members) == have:
            keep = order[predicted[order] > 0.0]  # the error is too large for another reason
        if not len(keep):
            break
        members, sizes = np.vstack([members, edge.rows[keep]]), np.append(sizes, predicted[keep])
    return members[have:], float(sizes[have:].sum())
