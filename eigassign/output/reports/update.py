"""What an update leaves: its tables, for console and report; results.json; the report."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.exact.identification import POOR
from eigassign.facts import Fact
from eigassign.output import documents
from eigassign.output.documents import OriginDocument, dumps
from eigassign.output.figures.update import update_figures
from eigassign.output.reports import page as report
from eigassign.output.tables import Table, facts_table
from eigassign.study.updating.fit import (
    ExplainedMeasurement,
    ExplainingMinimum,
    FitRow,
    UnidentifiedDirection,
    UpdatedParameter,
    UpdateResults,
)

Floats = NDArray[np.float64]

SECTIONS = {"parameters": "Parameters", "fit": "How well it fits"}

# --- The verdict and the tables


def headline(results: UpdateResults) -> str:
    """The verdict in a sentence: what the parameters are, and whether that explains anything."""
    found = []
    for row in results.parameters:  # k1 = 52.47 kN m/rad (50.75 to 54.27)
        unit, size = row.handy
        value, low, high = (f"{each / size:.4g}" for each in (row.value, row.low, row.high))
        found.append(f"{row.name} = {value} {unit}".rstrip() + f" ({low} to {high})")
    of = results.fit
    chance = "" if of.p_value is None else f", p = {of.p_value:.2g}"
    fit = f"χ² = {of.chi_squared:.3g} with {of.degrees} degrees of freedom{chance}"
    verdict = {
        "fitted": f"Explained: the model fits the measurements ({fit})",
        "poor_fit": f"NOT EXPLAINED: the measurements are farther off than their standard "
        f"deviations allow ({fit}, below {POOR:g}), and the intervals do not hold",
        "not_identified": f"NOT IDENTIFIED: {'; '.join(_why_not(results))} ({fit})",
        "unfinished": f"UNFINISHED: the fit ended before its optimum ({of.ended}; {fit})",
    }[results.verdict]
    return f"{verdict}. {', '.join(found)}."


def _why_not(results: UpdateResults) -> Iterator[str]:
    yield from (direction.words for direction in results.unidentified)
    if len(results.minima) > 1:
        yield f"{len(results.minima)} distinct sets of values explain the measurements"


def update_tables(results: UpdateResults, most: int | None = 30) -> tuple[Table, ...]:
    """Parameters, what is not identified, the fit, and ``most`` measurements; None: all."""
    made = {
        "parameters": (parameters(results), directions(results), minima(results)),
        "fit": (fit(results), measurements(results, most)),
    }
    every = (replace(table, section=key) for key, own in made.items() for table in own)
    return tuple(table for table in every if table.rows)


def parameters(results: UpdateResults) -> Table:
    """Parameters before and after, with standard deviations and intervals."""
    caption = (
        "Deviation: standard deviation of the linear model. Interval: 95 % by the profile "
        "likelihood, with the other parameters fitted again at each value."
    )
    held = [row.name for row in results.parameters if row.held]
    if held and any(row.deviation is not None for row in results.parameters):
        caption += f" The deviations assume {' and '.join(held)} at the bound."
    names = "name parameter handy initial value deviation low high remark"
    return facts_table("Parameters", results.parameters, names, caption)


def directions(results: UpdateResults) -> Table:
    """Directions that the measurements cannot tell."""
    caption = (
        "Changes from bound to bound, in SI units, that move all measured frequencies together by "
        "less than 1.96 standard deviations."
    )
    return facts_table("Not identified", results.unidentified, "words change", caption)


def minima(results: UpdateResults) -> Table:
    """The minima of χ² that explain the measurements, where there are several."""
    several = results.minima if len(results.minima) > 1 else ()
    caption = "Distinct minima of χ², the best first: the parameters above are those of the first."
    return facts_table("Explanations", several, "values chi_squared", caption)


def fit(results: UpdateResults) -> Table:
    """χ² before and after, and the chance of it."""
    names = "initial_chi_squared chi_squared degrees p_value steps ended"
    caption = (
        "χ²: sum of the squared residuals in standard deviations. p: the chance of a χ² this large "
        "if the model and the stated deviations are right."
    )
    return facts_table("Fit", [results.fit], names, caption)


def measurements(results: UpdateResults, most: int | None) -> Table:
    """Measurements with their residuals; of many those that are worst explained."""
    shown = list(results.measurements)
    more = most is not None and len(shown) > most
    if more:
        worst = sorted(shown, key=lambda row: -abs(row.residual))[:most]
        shown = [row for row in shown if row in worst]
    names = "label mode measured_hz deviation_hz initial_hz updated_hz residual is_outlier"
    caption = "Residuals after updating, in standard deviations of the measurement."
    if more:
        caption += f" The {len(shown)} worst of {len(results.measurements)}."
    return facts_table("Measurements", shown, names, caption)


# --- The files


def write_update(
    results: UpdateResults, folder: Path, formats: Sequence[str] = ("png",), kind: str = "full"
) -> None:
    """Into ``folder``, which must exist: results.json, a report of this kind, figures."""
    data, plans = f"{dumps(document(results))}\n".encode(), update_figures(results)
    report.write_page(
        results, update_tables(results, None), plans, folder, formats, kind,
        ("results.json", data), line=headline(results), headings=SECTIONS,
        tone="good" if results.verdict == "fitted" else "bad",
    )  # fmt: skip


@dataclass(frozen=True)
class UpdateDocument(OriginDocument):
    """An update as its file of results has it."""

    verdict: Annotated[str, Fact("fitted, poor_fit, not_identified or unfinished")]
    headline: Annotated[str, Fact("the verdict in words")]
    parameters: Mapping[str, UpdatedParameter]
    covariance: Annotated[Floats, Fact("of the parameters, SI", may_lack=True)]
    correlation: Annotated[Floats, Fact("of the parameters", may_lack=True)]
    not_identified: Sequence[UnidentifiedDirection]
    minima: Annotated[
        Sequence[ExplainingMinimum], Fact("distinct ones that explain the measurements")
    ]
    fit: FitRow
    measurements: Sequence[ExplainedMeasurement]
    warnings: Sequence[str]
    notes: Sequence[str]
    timing_s: Annotated[Mapping[str, float], Fact("by stage", unit="s")]


def document(results: UpdateResults) -> dict[str, Any]:
    """Plain values in a fixed order; what is not identified has no deviation (null)."""
    made = documents.filled(
        UpdateDocument,
        documents.beginning(results),
        results,
        headline=headline(results),
        parameters={row.name: row for row in results.parameters},
        not_identified=results.unidentified,
    )
    return dict(documents.document(made))
