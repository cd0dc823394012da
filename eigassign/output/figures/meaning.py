"""What an answer means: what it hangs on, what it can reach, what deviations and mass do to it."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from eigassign.output.figures import style
from eigassign.output.figures.curves import OPTIMAL, POINT, TARGET, Look, plot, stacked
from eigassign.output.figures.style import FigurePlan, labelled, legend_above, short
from eigassign.output.formats import percent
from eigassign.study.results import (
    RangeRow,
    RunResults,
    SensitivityRow,
    TargetAlong,
    TargetStudy,
    TradeOff,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]
_BAR = 0.16  # inches of a bar
_MOST = 10  # parameters whose bars are drawn
_TALLEST = 6.0  # inches


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


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


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
        partial(draw_sensitivities, rows),
    )


def draw_sensitivities(rows: tuple[SensitivityRow, ...]) -> Figure:
    """A group of bars a parameter, one colour a target."""
    names = _most_sensitive(rows)
    labels = list(dict.fromkeys(row.label for row in rows))
    height = min(max(1.2, _BAR * len(names) * (len(labels) + 1)), _TALLEST)
    figure, (axes,) = stacked("Sensitivity of the frequencies", "% per %", (height,))
    width = 0.8 / len(labels)
    for k, label in enumerate(labels):
        own = {row.parameter: row for row in rows if row.label == label and row.parameter in names}
        at = np.array([names.index(name) + (k + 0.5) * width - 0.4 for name in own])
        mean = np.array([row.percent_per_percent for row in own.values()])
        most = np.array([row.percent_per_percent_largest for row in own.values()])
        colour = style.SERIES[k % len(style.SERIES)]
        axes.barh(at, mean, 0.85 * width, color=colour, label=short(label, 60))
        axes.hlines(at, mean, most, color=style.BLACK, linewidth=0.8)
    axes.axvline(0.0, color=style.BLACK, linewidth=0.8)
    axes.set_yticks(range(len(names)), [short(name) for name in names])
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.margins(x=0.05)
    legend_above(axes, axes.get_legend_handles_labels()[0])
    return figure


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
        f"{_capital(target.label)}: reach and tolerance{where}",
        " ".join(said),
        "The answer's frequency over time inside the range of others.",
        partial(draw_ranges, results, target, along.rows, shown, where),
    )


def draw_ranges(
    results: RunResults,
    target: TargetStudy,
    rows: slice,
    shown: tuple[RangeRow | None, RangeRow | None],
    where: str,
) -> Figure:
    """The answer over what is within reach and within tolerance, with what is wanted."""
    figure, (axes,) = stacked(f"{_capital(target.label)}{where}", "time [s]", (2.4,))
    time_s = results.time_s[target.rows][rows]
    colours, labels = (style.GREY, style.BLUE), ("within the bounds", "within the tolerances")
    edges, shades = [], []
    for row, colour, label in zip(shown, colours, labels, strict=True):
        if row is not None:
            low, high = row.lowest_hz[rows], row.highest_hz[rows]
            edges += [low, high]
            shades.append(
                axes.fill_between(
                    time_s, low, high, color=colour, alpha=0.35, linewidth=0.0, label=label
                )
            )
    hidden: Look = {"linestyle": "none"}
    label = "distance of the modes [Hz]" if target.kind == "gap" else "frequency [Hz]"
    curves = [
        (target.exact_hz[rows], {**OPTIMAL, "label": "answer"}),
        (target.target_hz[rows], {**TARGET, "label": "wanted"}),
    ]
    plot(axes, time_s, [*curves, *((edge, hidden) for edge in edges)], label)
    legend_above(axes, [*shades, *axes.get_lines()[:2]])
    return figure


# --- Error against mass or price


def trade_off(found: TradeOff) -> FigurePlan:
    """What each kilogram, or each unit of the price, gains."""
    first, last = found.points[0], found.points[-1]
    return FigurePlan(
        "trade_off",
        f"{_capital(found.error)} against {found.quantity}",
        f"The least {found.error} found for each {found.quantity}: from {percent(first.error)} to "
        f"{percent(last.error)}, the answer.",
        f"A falling curve of the {found.error} over the {found.quantity}.",
        partial(draw_trade_off, found),
    )


def draw_trade_off(found: TradeOff) -> Figure:
    """Error in % over mass or price, the initial design's upright, the answer at the end."""
    figure, (axes,) = stacked(
        f"{_capital(found.error)} against {found.quantity}",
        labelled(found.quantity, found.unit),
        (2.4,),
    )
    amount = np.array([point.amount for point in found.points])
    error = np.array([100.0 * point.error for point in found.points])
    look: Look = {"color": style.BLUE, "linewidth": 1.4, "marker": "o", "label": "best found"}
    (curve,) = axes.plot(amount, error, **look)
    axes.set(ylabel=f"{found.error} [%]", ylim=(0.0, 1.08 * error.max()))
    axes.margins(x=0.04)
    answer: Look = {"color": style.SKY, "marker": "o", "markersize": 10.0, "linestyle": "none"}
    (end,) = axes.plot(amount[-1:], error[-1:], **answer, label="answer", zorder=1.5)
    initial = axes.axvline(found.initial, **POINT, label=f"{found.quantity} of the initial design")
    legend_above(axes, [curve, end, initial])
    return figure
