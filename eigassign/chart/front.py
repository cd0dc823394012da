"""Which methods no other beats, from how many evaluations one pays, and what to choose."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from eigassign.chart.methods import AutoOrder
from eigassign.chart.results import Advice, AutoTakes, ChartPoint, Front
from eigassign.chart.timing import time_in_words

Floats = NDArray[np.float64]
DOUBTED = 100.0  # times an accuracy that an estimate may be where it is advised: most are cautious
LOW, HIGH = 1e-8, 1e-2  # relative errors between which the methods of a front are counted


def pareto(cost: Floats, error: Floats) -> list[int]:
    """Indices that nothing beats in cost (n,) and error (n,) at once, the most accurate first.

    A point that equals another in one of the two and is no better in the other is beaten; numbers
    that are not finite never win.
    """
    kept: list[int] = []
    best = np.inf
    for k in np.lexsort((error, cost)).tolist():
        if np.isfinite(cost[k]) and error[k] < best:
            kept.append(k)
            best = error[k]
    return kept[::-1]


def front(
    points: Sequence[ChartPoint], name: str, evaluations: float | None, floor: float
) -> Front:
    """The front of these points; errors below ``floor`` (Hz) count as equal.

    A method that is set up anew for every design answers whole trajectories only: it has no part in
    the front of single evaluations.
    """
    made = Front(name, evaluations, ())
    able = [p for p in points if p.random is not None or evaluations is not None]
    cost = np.array([made.cost_s(p) for p in able])
    error = np.array([max(p.everywhere.worst_hz, floor) for p in able])
    return replace(made, methods=tuple(able[k].method for k in pareto(cost, error)))


def front_notes(points: Sequence[ChartPoint], fronts: Sequence[Front]) -> Iterator[str]:
    """How many methods of each front are eigassign's, and the others by name."""
    known = {p.method: p for p in points}
    for each in fronts:
        inside = [
            known[name]
            for name in each.methods
            if LOW <= known[name].everywhere.worst_relative <= HIGH
        ]
        others = [p.method for p in inside if not p.ours]
        ours = f"{len(inside) - len(others)} of {len(inside)} methods are eigassign's"
        named = f"; the others: {', '.join(others)}" if others else ""
        yield f"front of {each.name}, errors between 1e-2 and 1e-8: {ours}{named}"


def break_even(offline_s: float, online_s: float, exact_s: float) -> float | None:
    """Evaluations N from which offline + N online < N exact; None where that never is."""
    if online_s >= exact_s:
        return None
    return offline_s / (exact_s - online_s)


def cheapest(
    points: Sequence[ChartPoint], accuracy: float, evaluations: float
) -> ChartPoint | None:
    """The quickest method whose worst relative error is at most ``accuracy``.

    Without those whose own estimate is over `DOUBTED` times as large: they may know of places that
    the points of the question miss.
    """
    good = [
        p
        for p in points
        if p.everywhere.worst_relative <= accuracy
        and (p.estimate is None or p.estimate <= DOUBTED * accuracy)
    ]
    return min(good, key=lambda p: p.total_s(evaluations), default=None)


def most_accurate(
    points: Sequence[ChartPoint], budget_s: float, evaluations: float
) -> ChartPoint | None:
    """The method of least worst error that is done within ``budget_s``; the quicker of equals."""
    able = [p for p in points if p.total_s(evaluations) <= budget_s]
    return min(able, key=lambda p: (p.everywhere.worst_hz, p.total_s(evaluations)), default=None)


def advise_accuracy(
    points: Sequence[ChartPoint], accuracy: float, evaluations: float, floor: float
) -> Advice:
    """What to choose for a worst relative error in Hz, in words and as data.

    Nothing is advised below ``floor`` (relative): no method can be seen to be that accurate.
    """
    asked = f"for {evaluations:,.0f} evaluations within {_share(accuracy)} of exact"
    if accuracy >= floor:
        found = cheapest(points, accuracy, evaluations)
        return _advice("accuracy", accuracy, None, evaluations, found, asked)
    nothing = _advice("accuracy", accuracy, None, evaluations, None, asked)
    words = f"{asked}: nothing, for round-off moves even exact solves by {floor:.1e}"
    return replace(nothing, words=words, is_below_round_off=True)


def advise_budget(points: Sequence[ChartPoint], budget_s: float, evaluations: float) -> Advice:
    """What to choose for a time, set-up and all evaluations together."""
    found = most_accurate(points, budget_s, evaluations)
    asked = f"for {evaluations:,.0f} evaluations within {time_in_words(budget_s)}"
    return _advice("budget", None, budget_s, evaluations, found, asked)


def _advice(
    kind: str,
    accuracy: float | None,
    budget_s: float | None,
    evaluations: float,
    found: ChartPoint | None,
    asked: str,
) -> Advice:
    if found is None:
        words = f"{asked}: no charted method does that"
        return Advice(kind, accuracy, budget_s, evaluations, None, {}, None, None, words)
    total, worst = found.total_s(evaluations), found.everywhere.worst_relative
    anew = "" if found.random else "; it is set up anew for every design"
    words = (
        f"{asked} the {'quickest' if kind == 'accuracy' else 'most accurate'} is {found.method}: "
        f"{_explained(found.family)}. It takes {time_in_words(total)} in all and is off by "
        f"{_share(worst)} at most{anew}"
    )
    return Advice(
        kind, accuracy, budget_s, evaluations, found.method, found.parameters, worst, total, words
    )


def beside_auto(advice: Advice, points: Sequence[ChartPoint], autos: Sequence[AutoOrder]) -> Advice:
    """The advice with what ``expansion.order: auto`` takes for the same accuracy."""
    own = next((each for each in autos if each.accuracy == advice.accuracy), None)
    if own is None or advice.is_below_round_off:
        return advice
    point = next((p for p in points if p.method == own.method), None)
    if point is None:
        why = own.refused or f"{own.method} could not be charted"
        auto = AutoTakes(None, None, None, own.seconds, why)
        said = f"`expansion.order: auto` refuses: {why}"
        return replace(advice, auto=auto, words=f"{advice.words}. {said}")
    total, worst = point.total_s(advice.evaluations), point.everywhere.worst_relative
    against = ""
    if advice.total_s and advice.method != point.method:
        against = f" ({total / advice.total_s:.2g} times as long)"
    said = (
        f"`expansion.order: auto` takes {point.method}: {time_in_words(total)}{against}, off by "
        f"{_share(worst)} at most, after {time_in_words(own.seconds)} of choosing"
    )
    auto = AutoTakes(point.method, worst, total, own.seconds, "")
    return replace(advice, auto=auto, words=f"{advice.words}. {said}")


_EXPLAINED = (  # what the methods of a family do; the first whose name it begins with
    ("Taylor", "power series of λ about one pose and design, or several"),
    ("1/λ", "power series of 1/λ about one pose and design"),
    ("reduced", "small models of modes and their derivatives at a few points"),
    ("fit", "polynomials through exact solves"),
    ("exact", "eigenvalues solved at every sample"),
    ("stations", "exact solves at a few samples of the trajectory, interpolated between them"),
    ("grid", "exact solves on a grid of poses and designs, interpolated between them"),
    ("", "a surrogate through exact solves at random poses and designs"),
)


def _explained(family: str) -> str:
    return next(words for beginning, words in _EXPLAINED if family.startswith(beginning))


def _share(relative: float) -> str:
    """``0.13 %``; of what is far below as a power of ten."""
    return f"{100.0 * relative:.2g} %" if relative >= 1e-6 or not relative else f"{relative:.1e}"
