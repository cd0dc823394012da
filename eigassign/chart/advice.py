"""Which methods no other beats, and what to choose."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from eigassign.chart.results import Advice, Asked, AutoTakes, ChartPoint, Front, Request
from eigassign.chart.timing import time_in_words

Floats = NDArray[np.float64]


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
    points: Sequence[ChartPoint], name: str, evaluations: float | None, floor_hz: float
) -> Front:
    """The front of these points; errors below ``floor_hz`` count as equal.

    A method that is set up anew for every design answers whole trajectories only: it has no part in
    the front of single evaluations.
    """
    made = Front(name, evaluations, ())
    able = [p for p in _rivals(points) if p.at_once == 1 or evaluations is not None]
    cost = np.array([made.cost_s(p) for p in able])
    error = np.array([max(p.everywhere.worst_hz, floor_hz) for p in able])
    return replace(made, methods=tuple(able[k].method for k in pareto(cost, error)))


def advise(
    points: Sequence[ChartPoint],
    asked: Asked,
    request: Request,
    counts: Sequence[float],
    skipped: Mapping[str, str],
) -> Iterator[Advice]:
    """What to choose for each number of evaluations, in words and as data.

    For an accuracy the quickest method that is accurate enough, without those whose own estimate is
    over a hundred times as large (most are cautious): they may know of places that the points of
    the question miss. Nothing is advised below round-off: no method can be seen to be that
    accurate. For a time, which counts the set-up, the most accurate method, the quicker of equals.
    """
    floor = asked.floor_hz / asked.typical_hz
    rivals = _rivals(points)
    for n in counts:
        words = f"for {n:,.0f} evaluations within"
        for a in request.accuracies:
            within = Advice("accuracy", a, None, n, words=f"{words} {_share(a)} of exact")
            if a < floor:
                said = f"nothing, for round-off moves even exact solves by {floor:.1e}"
                yield replace(within, words=f"{within.words}: {said}", is_below_round_off=True)
                continue
            good = [p for p in rivals if p.everywhere.worst_relative <= a]
            good = [p for p in good if (p.estimate or 0.0) <= 100.0 * a]
            best = min(good, key=lambda p: p.total_s(n), default=None)
            yield _beside_auto(_chosen(within, "quickest", best), points, skipped)
        if (seconds := request.budget_s) is not None:
            within = Advice("budget", None, seconds, n, words=f"{words} {time_in_words(seconds)}")
            in_time = [p for p in rivals if p.total_s(n) <= seconds]
            best = min(in_time, key=lambda p: (p.everywhere.worst_hz, p.total_s(n)), default=None)
            yield _chosen(within, "most accurate", best)


def _rivals(points: Sequence[ChartPoint]) -> list[ChartPoint]:
    """The points without those that ``order: auto`` takes, whose time lacks that of choosing."""
    return [p for p in points if not p.method.startswith("auto ")]


def _chosen(within: Advice, superlative: str, found: ChartPoint | None) -> Advice:
    if found is None:
        return replace(within, words=f"{within.words}: no charted method does that")
    total, worst = found.total_s(within.evaluations), found.everywhere.worst_relative
    words = (
        f"{within.words} the {superlative} is {found.method}: {_explained(found.family)}. It takes "
        f"{time_in_words(total)} in all and is off by {_share(worst)} at most"
        f"{'; it is set up anew for every design' if found.at_once > 1 else ''}"
    )
    within = replace(within, method=found.method, parameters=found.parameters, words=words)
    return replace(within, worst_relative=worst, total_s=total)


def _beside_auto(
    advice: Advice, points: Sequence[ChartPoint], skipped: Mapping[str, str]
) -> Advice:
    """The advice with what ``expansion.order: auto`` takes for the same accuracy."""
    name = f"auto {advice.accuracy:.0e}"
    own = next((p for p in points if p.method.startswith(name)), None)
    if own is None:
        why = next((why for method, why in skipped.items() if method.startswith(name)), "")
        auto = AutoTakes(None, None, None, 0.0, why)
        said = f"{advice.words}. `expansion.order: auto` refuses: {why}"
        return replace(advice, auto=auto, words=said) if why else advice
    total, worst = own.total_s(advice.evaluations), own.everywhere.worst_relative
    longer = f" ({total / advice.total_s:.2g} times as long)" if advice.total_s else ""
    choosing_s = own.parameters["choosing_s"]
    said = (
        f"{advice.words}. `expansion.order: auto` takes {own.method.partition(': ')[2]}: "
        f"{time_in_words(total)}{longer}, off by {_share(worst)} at most, after "
        f"{time_in_words(choosing_s)} of choosing"
    )
    return replace(advice, auto=AutoTakes(own.method, worst, total, choosing_s, ""), words=said)


def _explained(family: str) -> str:
    """The work of a family's methods in words: the first whose name it begins with."""
    known = (
        ("Taylor", "power series of λ about one pose and design, or several"),
        ("1/λ", "power series of 1/λ about one pose and design"),
        ("reduced", "small models of modes and their derivatives at a few points"),
        ("fit", "polynomials through exact solves"),
        ("exact", "eigenvalues solved at every sample"),
        ("stations", "exact solves at a few samples of the trajectory, interpolated between them"),
        ("grid", "exact solves on a grid of poses and designs, interpolated between them"),
        ("", "a surrogate through exact solves at random poses and designs"),
    )
    return next(words for beginning, words in known if family.startswith(beginning))


def _share(relative: float) -> str:
    """``0.13 %``; of what is far below as a power of ten."""
    return f"{100.0 * relative:.2g} %" if relative >= 1e-6 or not relative else f"{relative:.1e}"
