"""The figures of an update: measured frequencies against the model's, parameters with intervals."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from eigassign.output.figures import graph, style
from eigassign.output.figures.curves import INITIAL
from eigassign.output.figures.graph import FigurePlan, short
from eigassign.output.figures.style import legend_above
from eigassign.output.formats import number
from eigassign.study.updating.fit import OUTLIER, UpdateResults

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def update_figures(results: UpdateResults) -> tuple[FigurePlan, ...]:
    """What the measurements are explained by, and how narrow that leaves the parameters."""
    after = max((abs(row.residual) for row in results.measurements), default=0.0)
    return (
        FigurePlan(
            "measurements",
            "Measured frequencies and the model",
            "The model's frequencies against the measured ones, whose bars are one standard "
            f"deviation. The worst is {after:.2g} standard deviations off after updating.",
            "Measured frequencies with error bars, and those of the model before and after.",
            partial(draw_measurements, results),
        ),
        FigurePlan(
            "parameters",
            "Parameters with their 95 % intervals",
            "Each parameter between its bounds: as in the file, as updated, and the interval of "
            "values that the measurements allow while the others are fitted anew.",
            "One line for each parameter between its bounds, with its interval.",
            partial(draw_parameters, results),
        ),
    )


def draw_measurements(results: UpdateResults) -> Figure:
    """Frequencies relative to the measured ones above, standardised residuals below."""
    rows = results.measurements
    at = np.arange(1, len(rows) + 1)
    measured = np.array([row.measured_hz for row in rows])
    before, after = (
        100.0 * (np.array([getattr(row, when) for row in rows]) / measured - 1.0)
        for when in ("initial_hz", "updated_hz")
    )
    bars = 100.0 * np.array([row.deviation_hz for row in rows]) / measured
    figure = style.new_figure("Measured frequencies and the model", 5.2)
    above, below = figure.subplots(2, 1, sharex=True, gridspec_kw={"height_ratios": (2.2, 1.6)})
    below.set_xlabel("measurement")
    dots = above.errorbar(
        at, np.zeros(len(at)), bars, fmt="o", color=graph.BLACK, markersize=3.0, capsize=2.0,
        linewidth=1.0, label="measured ± standard deviation",
    )  # fmt: skip
    marks = [
        above.plot(
            at, values, marker, color=color, markersize=6.0, markeredgewidth=1.8, label=label
        )[0]
        for values, marker, color, label in (
            (before, "x", INITIAL.colour, "model before"),
            (after, "_", graph.BLUE, "model after"),
        )
    ]
    above.set_ylabel("off the measured [%]")
    legend_above(above, [dots, *marks])
    below.bar(at, [row.residual for row in rows], color=graph.BLUE, width=0.6)
    largest = max(OUTLIER + 0.5, 1.1 * max(abs(row.residual) for row in rows))
    for limit in (-OUTLIER, OUTLIER):
        below.axhline(limit, color=graph.GREY, linewidth=0.9, linestyle="dashed")
    below.set(ylabel="residual [σ]", ylim=(-largest, largest), xlim=(0.4, len(at) + 0.6))
    return figure


def draw_parameters(results: UpdateResults) -> Figure:
    """From bound to bound, one line each."""
    rows = [row for row in results.parameters if row.upper > row.lower]
    figure = style.new_figure("Parameters with their 95 % intervals", 1.2 + 0.45 * len(rows))
    axes = figure.subplots()
    for k, row in enumerate(rows):
        width = row.upper - row.lower
        low, high, value, initial = (
            (each - row.lower) / width for each in (row.low, row.high, row.value, row.initial)
        )
        axes.plot(
            [low, high],
            [k, k],
            color=graph.SKY,
            linewidth=5.0,
            label="95 % interval",
            solid_capstyle="butt",
        )
        axes.plot(initial, k, "x", color=INITIAL.colour, markersize=6.0, label="before")
        axes.plot(value, k, "o", color=graph.BLUE, markersize=5.0, label="after")
    labels = [f"{short(row.name, 20)}\n{number(row.value)} {row.unit}".rstrip() for row in rows]
    axes.set_yticks(range(len(rows)), labels)
    axes.set(xlim=(-0.02, 1.02), ylim=(len(rows) - 0.5, -0.5), xlabel="from bound to bound")
    legend_above(axes, axes.get_lines()[:3])
    return figure
