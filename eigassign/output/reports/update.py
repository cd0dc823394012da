"""What an update leaves: its figures and tables; results.json, and the report."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from eigassign.output.documents import to_json
from eigassign.output.figures import graph
from eigassign.output.figures.curves import LEVEL
from eigassign.output.figures.graph import Curve, FigurePlan, Graph, Look, Mark, Panel, Rule
from eigassign.output.reports import page as report
from eigassign.output.tables import Table, facts_table
from eigassign.study.updating.fit import OUTLIER, UpdatedParameter, UpdateResults

_BEFORE = Look(graph.ORANGE, 0.0, marker="s", filled=False)
_AFTER = Look(graph.BLACK, 0.0, marker="o")
_STEM = Look(graph.BLACK, 1.2)
_OUTLIER = Look(graph.GREY, 0.9, "dashed")
_INTERVAL = Look(graph.SKY, 5.0)
_OUTER = Look(graph.GREY, 3.0)


def update_figures(results: UpdateResults) -> tuple[FigurePlan, ...]:
    """Measurements against the model, and the intervals of the parameters."""
    after = max((abs(row.residual) for row in results.measurements), default=0.0)
    unit = "standard deviation" if results.fit else "half the width of its range"
    return (
        FigurePlan(
            "measurements",
            "Measured frequencies and the model",
            f"The model's frequencies against the measured ones, whose bars are {unit}. The worst "
            f"is {after:.2g} times that off after updating.",
            "Measured frequencies with error bars, and those of the model before and after.",
            _measurements(results),
            "answer",
        ),
        _parameters(results),
    )


def _measurements(results: UpdateResults) -> Graph:
    """Frequencies relative to the measured ones before and after, standardised residuals below."""
    rows = results.measurements
    at = np.arange(1.0, len(rows) + 1.0)
    measured = np.array([row.measured_hz for row in rows])
    before, after = (
        100.0 * (np.array([getattr(row, when) for row in rows]) / measured - 1.0)
        for when in ("initial_hz", "updated_hz")
    )
    names = tuple(f"{row.label}, mode {row.mode}" for row in rows)
    bars = 100.0 * np.array([row.deviation_hz for row in rows]) / measured
    initial = (Rule(0.0, LEVEL), Curve(before, _BEFORE, "model before", names=names))
    above: tuple[Mark, ...] = (
        Rule(0.0, LEVEL),
        graph.segments(at, -bars, bars, _INTERVAL, "measured"),
        Curve(after, _AFTER, "model after", names=names),
    )
    residual, far = np.array([row.residual for row in rows]), OUTLIER if results.fit else 1.0
    below: tuple[Mark, ...] = (
        Rule(0.0, LEVEL),
        *(Rule(limit, _OUTLIER) for limit in (-far, far)),
        graph.segments(at, np.zeros(at.size), residual, _STEM),
        Curve(residual, _AFTER, names=names),
    )
    room = np.array([-far - 0.5, far + 0.5])
    panels = (
        Panel("before, off [%]", initial, 1.2, holds=(np.zeros(1),)),
        Panel("after, off [%]", above, 2.2),
        Panel("residual [σ]" if results.fit else "off [half range]", below, 1.6, holds=(room,)),
    )
    ends = 0.4, at.size + 0.6
    title = "Measured frequencies and the model"
    return Graph(title, "measurement", at, panels, x_limits=ends)


def _parameters(results: UpdateResults) -> FigurePlan:
    """A line a parameter: its interval about the value found; its ranges between the bounds."""
    rows = [row for row in results.parameters if row.upper > row.lower]
    at, fitted = -np.arange(float(len(rows))), results.fit is not None
    amounts = [(r.lower, r.upper, r.value, r.initial, r.low, r.high, *r.ends) for r in rows]
    lower, upper, value, *_ = every = np.reshape(amounts, (-1, 8)).T
    zero, size = (value, np.abs(value)) if fitted else (lower, upper - lower)
    size = np.where(size > 0.0, size, upper - lower)
    least, most, found, initial, low, high, left, right = 100.0 * (every - zero) / size
    words = "95 % interval" if fitted else "found"
    drawn: tuple[Curve, ...] = (graph.segments(at, low, high, _INTERVAL, words, lying=True),)
    ends = -2.0, 102.0
    if fitted:
        ends = graph.bounds([1.2 * low, 1.2 * high, np.zeros(1)])
        initial = np.where((initial >= ends[0]) & (initial <= ends[1]), initial, np.nan)
        title, label = "Parameters with their 95 % intervals", "off the value found [%]"
        caption = (
            "Of each parameter the interval of values that the measurements allow while the others "
            "are fitted anew, in % of the value found; the file's value where it is so near."
        )
    else:
        outer = graph.segments(at, left, right, _OUTER, "none is outside", lying=True)
        drawn = graph.segments(at, least, most, _STEM, "bounds", lying=True), outer, *drawn
        title, label = "What the parameters may be", "between the bounds [%]"
        caption = (
            "The values that explain all measured ranges, beside the bounds of each parameter: "
            "those that were found, and the range that none which explains them lies outside of."
        )
    names = tuple(_between(row, fitted) for row in rows)
    drawn += (Curve(at, _BEFORE, "before", initial, names=names),)
    drawn += (Curve(at, _AFTER, "after", found, names=names),) * fitted
    room = np.array([0.5, 0.5 - len(rows)])
    panel = Panel("", drawn, 0.4 + 0.5 * len(rows), holds=(room,), names=names)
    shows = Graph(title, label, np.zeros(0), (panel,), x_limits=ends)
    alt = "One line for each parameter, with its interval or ranges."
    return FigurePlan("parameters", title, caption, alt, shows, "parameters")


def _between(row: UpdatedParameter, fitted: bool) -> str:
    """``k1: 40 → 52.47 kN m/rad``, before and after; of ranges the bounds."""
    unit, size = row.handy
    pair = f"{row.initial / size:.4g} → {row.value / size:.4g}"
    pair = pair if fitted else f"{row.lower / size:.4g} … {row.upper / size:.4g}"
    return f"{row.name}: {pair} {unit}".rstrip()


SECTIONS = {"parameters": "Parameters", "fit": "How well it fits"}

# --- The tables


def update_tables(results: UpdateResults, most: int | None = 30) -> tuple[Table, ...]:
    """Parameters, what is not identified, the fit, and ``most`` measurements; None: all."""
    sections = {"parameters": _found(results), "fit": _fit(results, most)}
    every = (table._replace(section=key) for key, own in sections.items() for table in own)
    return tuple(table for table in every if table.rows)


def _found(results: UpdateResults) -> Iterator[Table]:
    """Parameters before and after, with intervals; what cannot be told; of several minima all."""
    caption = (
        "Deviation: standard deviation of the linear model. From, to: 95 % by the profile "
        "likelihood, with the other parameters fitted again at each value."
    )
    if results.fit is None:
        caption = "From, to: of designs found that explain all ranges"
        caption += "; none does outside the others." if results.parameters[0].outer_low else "."
        if results.verdict == "poor_fit":
            caption = "No design explains all ranges: these are of the nearest."
        names = "name handy initial low high outer_low outer_high lower upper parameter"
        yield facts_table("Parameters", results.parameters, names, caption)
        return
    held = [row.name for row in results.parameters if row.held]
    if held and any(row.deviation is not None for row in results.parameters):
        caption += f" The deviations assume {' and '.join(held)} at the bound."
    names = "name handy initial value deviation low high remark parameter"
    yield facts_table("Parameters", results.parameters, names, caption)
    caption = (
        "Changes from bound to bound that move all measured frequencies together by "
        "less than 1.96 standard deviations."
    )
    yield facts_table("Not identified", results.unidentified, "words amounts", caption)
    several = results.minima if len(results.minima) > 1 else ()
    caption = "Distinct minima of χ², the best first: the parameters above are those of the first."
    yield facts_table("Explanations", several, "amounts chi_squared", caption)


def _fit(results: UpdateResults, most: int | None) -> Iterator[Table]:
    """χ² before and after, and the chance of it; of many measurements the worst explained."""
    names = "initial_chi_squared chi_squared degrees p_value steps ended"
    caption = (
        "χ²: sum of the squared residuals in standard deviations. p: the chance of a χ² this large "
        "if the model and the stated deviations are right."
    )
    yield facts_table("Fit", [results.fit] if results.fit else (), names, caption)
    shown = list(results.measurements)
    unit = "standard deviations of the measurement" if results.fit else "half widths of the range"
    caption = f"Residuals after updating, in {unit}."
    if most is not None and len(shown) > most:
        worst = sorted(shown, key=lambda row: -abs(row.residual))[:most]
        caption += f" The {most} worst of {len(shown)}."
        shown = [row for row in shown if row in worst]
    names = "label mode measured_hz deviation_hz initial_hz updated_hz residual"
    names += " is_outlier" * (results.fit is not None)
    yield facts_table("Measurements", shown, names, caption)


# --- The files


def write_update(
    results: UpdateResults, folder: Path, formats: Sequence[str] = ("png",), kind: str = "full"
) -> None:
    """Into ``folder``, which must exist: results.json, a report of this kind, figures."""
    report.write_page(
        results, update_tables(results, None), update_figures(results), folder, formats, kind,
        ("results.json", to_json(results)), line=results.headline, headings=SECTIONS,
        tone="good" if results.verdict == "fitted" else "bad",
    )  # fmt: skip
