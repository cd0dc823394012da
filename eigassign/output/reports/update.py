"""What an update leaves: its tables, for console and report; results.json, and the report."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from eigassign.output.documents import to_json
from eigassign.output.figures.update import update_figures
from eigassign.output.reports import page as report
from eigassign.output.tables import Table, facts_table
from eigassign.study.updating.fit import UpdateResults

SECTIONS = {"parameters": "Parameters", "fit": "How well it fits"}

# --- The tables


def update_tables(results: UpdateResults, most: int | None = 30) -> tuple[Table, ...]:
    """Parameters, what is not identified, the fit, and ``most`` measurements; None: all."""
    sections = {"parameters": _parameters(results), "fit": _fit(results, most)}
    every = (replace(table, section=key) for key, own in sections.items() for table in own)
    return tuple(table for table in every if table.rows)


def _parameters(results: UpdateResults) -> Iterator[Table]:
    """Parameters before and after, with intervals; what cannot be told; of several minima all."""
    caption = (
        "Deviation: standard deviation of the linear model. Interval: 95 % by the profile "
        "likelihood, with the other parameters fitted again at each value."
    )
    held = [row.name for row in results.parameters if row.held]
    if held and any(row.deviation is not None for row in results.parameters):
        caption += f" The deviations assume {' and '.join(held)} at the bound."
    names = "name parameter handy initial value deviation low high remark"
    yield facts_table("Parameters", results.parameters, names, caption)
    caption = (
        "Changes from bound to bound, in SI units, that move all measured frequencies together by "
        "less than 1.96 standard deviations."
    )
    yield facts_table("Not identified", results.unidentified, "words change", caption)
    several = results.minima if len(results.minima) > 1 else ()
    caption = "Distinct minima of χ², the best first: the parameters above are those of the first."
    yield facts_table("Explanations", several, "values chi_squared", caption)


def _fit(results: UpdateResults, most: int | None) -> Iterator[Table]:
    """χ² before and after, and the chance of it; of many measurements the worst explained."""
    names = "initial_chi_squared chi_squared degrees p_value steps ended"
    caption = (
        "χ²: sum of the squared residuals in standard deviations. p: the chance of a χ² this large "
        "if the model and the stated deviations are right."
    )
    yield facts_table("Fit", [results.fit], names, caption)
    shown = list(results.measurements)
    caption = "Residuals after updating, in standard deviations of the measurement."
    if most is not None and len(shown) > most:
        worst = sorted(shown, key=lambda row: -abs(row.residual))[:most]
        caption += f" The {most} worst of {len(shown)}."
        shown = [row for row in shown if row in worst]
    names = "label mode measured_hz deviation_hz initial_hz updated_hz residual is_outlier"
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
