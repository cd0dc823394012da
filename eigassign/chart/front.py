"""Which methods no other beats, from how many evaluations one pays, and what to choose."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from eigassign.chart.results import Advice, ChartPoint, Front

Floats = NDArray[np.float64]
DOUBTED = 100.0  # times an accuracy that an estimate may be where it is advised: most are cautious


def pareto(cost: Floats, error: Floats) -> list[int]:
    """Indices that nothing beats in cost (n,) and error (n,) at once, the most accurate first.

    A point that equals another in one of the two and is no better in the other is beaten; numbers
    that are not finite never win.
    """
    order = np.lexsort((error, cost))
    kept: list[int] = []
    best = np.inf
    for k in order.tolist():
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
    able = [p for p in points if p.random is not None or evaluations is not None]
    cost = np.array([_cost(p, evaluations) for p in able])
    error = np.array([max(p.everywhere.worst_hz, floor) for p in able])
    return Front(name, evaluations, tuple(able[k].method for k in pareto(cost, error)))


def _cost(point: ChartPoint, evaluations: float | None) -> float:
    return point.online.median_s if evaluations is None else point.total_s(evaluations)


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
    asked = f"for {evaluations:.3g} evaluations, each within {accuracy:.1e} of exact"
    if accuracy < floor:
        words = f"{asked}: nothing, for round-off moves even exact solves by {floor:.1e}"
        return Advice(
            "accuracy", accuracy, None, evaluations, None, {}, None, None, words, True
        )  # fmt: skip
    found = cheapest(points, accuracy, evaluations)
    return _advice("accuracy", accuracy, None, evaluations, found, asked)


def advise_budget(points: Sequence[ChartPoint], budget_s: float, evaluations: float) -> Advice:
    """What to choose for a time, set-up and all evaluations together."""
    found = most_accurate(points, budget_s, evaluations)
    asked = f"for {evaluations:.3g} evaluations within {time_words(budget_s)}"
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
        return Advice(
            kind, accuracy, budget_s, evaluations, None, {}, None, None, f"{asked}: nothing charted"
        )
    total, worst = found.total_s(evaluations), found.everywhere.worst_relative
    anew = "" if found.random else ", solved anew for every design"
    words = (
        f"{asked}: {found.method}{anew}, {time_words(total)} in all, worst error {worst:.1e}"
        f"{'; ' + found.use if found.use else ''}"
    )
    return Advice(
        kind, accuracy, budget_s, evaluations, found.method, found.parameters, worst, total, words
    )


def time_words(seconds: float) -> str:
    """Three digits with a unit."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds / 1e-9:.3g} ns"


def front_notes(points: Sequence[ChartPoint], fronts: Sequence[Front]) -> Iterator[str]:
    """Who holds each front between 1e-2 and 1e-8 of relative error, peers by name."""
    known = {p.method: p for p in points}
    for each in fronts:
        inside = [
            known[name]
            for name in each.methods
            if 1e-8 <= known[name].everywhere.worst_relative <= 1e-2
        ]
        peers = [p.method for p in inside if not p.ours]
        held = f"{len(inside) - len(peers)} of {len(inside)} methods are eigassign's"
        others = f"; the others: {', '.join(peers)}" if peers else ""
        yield f"front between 1e-2 and 1e-8, {each.name}: {held}{others}"
