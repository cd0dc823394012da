"""What an answer means: what it hangs on, what it can reach, what deviations and mass do to it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from eigassign.output.figures import graph
from eigassign.output.figures.curves import OPTIMAL, POINT, TARGET
from eigassign.output.figures.graph import (
    BarGroup,
    Bars,
    Curve,
    FigurePlan,
    Graph,
    Look,
    Panel,
    Rule,
    Shade,
    labelled,
)
from eigassign.output.formats import capital, percent
from eigassign.study.results import (
    RangeRow,
    RunResults,
    SensitivityRow,
    TargetAlong,
    TargetStudy,
    TradeOff,
)

Floats = NDArray[np.float64]
_MOST = 10  # parameters whose bars are drawn
_TALL = 2.4  # inches


def meaning_figures(results: RunResults) -> Iterator[FigurePlan]:
    """Sensitivities, reach and tolerance of each target, error against mass or price."""
    found = results.meaning
    if any(row.percent_per_percent_largest for row in found.sensitivity):
        yield sensitivities(found.sensitivity)
    reach = {row.label: row for row in found.reach}
    spread = {row.label: row for row in found.tolerance.targets} if found.tolerance else {}
    number = 0
    for target in results.targets:
        shown = reach.get(target.label), spread.get(target.label)
        for along in target.along if any(shown) and target.kind != "keep_out" else ():
            number += 1
            yield ranges(results, target, along, shown, number)
    if found.trade_off is not None and len(found.trade_off.points) > 1:
        yield trade_off(found.trade_off)


# --- What the frequencies hang on


def sensitivities(rows: tuple[SensitivityRow, ...]) -> FigurePlan:
    """(y/f) ∂f/∂y of every parameter and target, of many parameters the largest."""
    names, count = _most_sensitive(rows), len({row.parameter for row in rows})
    of_many = "" if count == len(names) else f"; the {len(names)} largest of {count} parameters"
    return FigurePlan(
        "sensitivity",
        "Sensitivity",
        "By how many per cent a frequency changes when a parameter changes by one, at the answer: "
        "bars are means over the samples, whiskers reach to the largest"
        f"{of_many}.",
        "Bars of the relative sensitivity of each target to each parameter.",
        _bars(rows, names),
    )


def _bars(rows: tuple[SensitivityRow, ...], names: list[str]) -> Bars:
    """A group of bars a parameter, one colour a target."""
    groups = []
    for k, label in enumerate(dict.fromkeys(row.label for row in rows)):
        own = {row.parameter: row for row in rows if row.label == label}
        mean, most = np.full((2, len(names)), np.nan)
        for at, name in enumerate(names):
            if name in own:
                mean[at] = own[name].percent_per_percent
                most[at] = own[name].percent_per_percent_largest
        groups.append(BarGroup(label, graph.SERIES[k % len(graph.SERIES)], mean, most))
    return Bars("Sensitivity of the frequencies", "% per %", tuple(names), tuple(groups))


def _most_sensitive(rows: tuple[SensitivityRow, ...]) -> list[str]:
    """The parameters with the largest shares, in the order of the design."""
    most: dict[str, float] = {}
    for row in rows:
        share = abs(row.percent_per_percent_largest)
        most[row.parameter] = max(share, most.get(row.parameter, 0.0))
    chosen = sorted(most, key=lambda name: -most[name])[:_MOST]
    return [name for name in most if name in chosen]


# --- What can be reached, and what deviations do


def ranges(
    results: RunResults,
    target: TargetStudy,
    along: TargetAlong,
    shown: tuple[RangeRow | None, RangeRow | None],
    number: int,
) -> FigurePlan:
    """The frequencies that designs within the bounds, and within the tolerances, have."""
    where = f" along {along.name!r}" if len(results.trajectories) > 1 else ""
    said = [
        f"{what} ({row.how}): {words} {percent(row.error)}."
        for row, what, words in (
            (shown[0], "All designs within the bounds", "least error"),
            (shown[1], "Deviations within the tolerances", "worst error"),
        )
        if row is not None
    ]
    return FigurePlan(
        f"range_{number}",
        f"{capital(target.label)}: reach and tolerance{where}",
        " ".join(said),
        "The answer's frequency over time inside the range of others.",
        _ranges(results, target, along.rows, shown, where),
    )


def _ranges(
    results: RunResults,
    target: TargetStudy,
    rows: slice,
    shown: tuple[RangeRow | None, RangeRow | None],
    where: str,
) -> Graph:
    """The answer over what is within reach and within tolerance, with what is wanted."""
    colours, labels = (graph.GREY, graph.BLUE), ("within the bounds", "within the tolerances")
    shades = [
        Shade(row.lowest_hz[rows], row.highest_hz[rows], colour, label, 0.35)
        for row, colour, label in zip(shown, colours, labels, strict=True)
        if row is not None
    ]
    curves = (
        Curve(target.exact_hz[rows], OPTIMAL, "answer"),
        Curve(target.target_hz[rows], TARGET, "wanted"),
    )
    edges = tuple(e for shade in shades for e in (shade.low, shade.high) if e is not None)
    label = "distance of the modes [Hz]" if target.kind == "gap" else "frequency [Hz]"
    panel = Panel(label, (*shades, *curves), _TALL, holds=edges)
    time_s = results.time_s[target.rows][rows]
    return Graph(f"{capital(target.label)}{where}", "time [s]", time_s, (panel,))


# --- Error against mass or price


def trade_off(found: TradeOff) -> FigurePlan:
    """What each kilogram, or each unit of the price, gains."""
    first, last = found.points[0], found.points[-1]
    return FigurePlan(
        "trade_off",
        f"{capital(found.error)} against {found.quantity}",
        f"The least {found.error} found for each {found.quantity}: from {percent(first.error)} to "
        f"{percent(last.error)}, the answer.",
        f"A falling curve of the {found.error} over the {found.quantity}.",
        _trade_off(found),
    )


def _trade_off(found: TradeOff) -> Graph:
    """Error in % over mass or price, the initial design's upright, the answer at the end."""
    amount = np.array([point.amount for point in found.points])
    error = np.array([100.0 * point.error for point in found.points])
    marks = (
        Curve(error, _BEST, "best found"),
        Curve(error[-1:], _ANSWER, "answer", amount[-1:]),
        Rule(found.initial, POINT, f"{found.quantity} of the initial design", upright=True),
    )
    low, high = graph.bounds([amount, np.array([found.initial])])
    margin = 0.04 * (high - low)
    return Graph(
        title=f"{capital(found.error)} against {found.quantity}",
        x_label=labelled(found.quantity, found.unit),
        x=amount,
        panels=(Panel(f"{found.error} [%]", marks, _TALL, from_zero=True),),
        x_limits=(low - margin, high + margin),
    )


_BEST = Look(graph.BLUE, 1.4, marker="o")
_ANSWER = Look(graph.SKY, 0.0, marker="o", size=10.0, filled=False)
