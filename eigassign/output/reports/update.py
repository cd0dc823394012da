"""What an update leaves: its tables, for console and report; results.json; the report."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from eigassign.output.figures.update import shown_in, update_figures
from eigassign.output.formats import number
from eigassign.output.reports import page as report
from eigassign.output.result_files import dumps, origin
from eigassign.output.tables import Table
from eigassign.study.updating.fit import POOR, UpdatedParameter, UpdateResults

_SHOWN = 30  # measurements in a table on the console

# --- The verdict and the tables


def headline(results: UpdateResults) -> str:
    """The verdict in a sentence: what the parameters are, and whether that explains anything."""
    return f"{_verdict(results)}. {', '.join(map(_found, results.parameters))}."


def _found(row: UpdatedParameter) -> str:
    """``k1 = 52.47 kN m/rad (50.75 to 54.27)``."""
    unit, size = shown_in(row)
    value, low, high = (f"{each / size:.4g}" for each in (row.value, row.low, row.high))
    return f"{row.name} = {value} {unit}".rstrip() + f" ({low} to {high})"


def _verdict(results: UpdateResults) -> str:
    chance = "" if results.p_value is None else f", p = {results.p_value:.2g}"
    fit = f"χ² = {results.chi_squared:.3g} with {results.degrees} degrees of freedom{chance}"
    return {
        "fitted": f"Explained: the model fits the measurements ({fit})",
        "poor_fit": f"NOT EXPLAINED: the measurements are further off than their standard "
        f"deviations allow ({fit}, below {POOR:g}); the intervals do not hold",
        "not_identified": f"NOT IDENTIFIED: {'; '.join(d.words for d in results.unidentified)} "
        f"({fit})",
        "unfinished": f"UNFINISHED: the fit ended before its optimum ({results.ended}; {fit})",
    }[results.verdict]


def tables(results: UpdateResults, most: int | None = None) -> tuple[Table, ...]:
    """Parameters, what is not identified, the fit, and measurements (``most`` of them)."""
    made = (parameters(results), directions(results), fit(results), measurements(results, most))
    return tuple(table for table in made if table.rows)


def console_tables(results: UpdateResults) -> tuple[Table, ...]:
    """For the terminal: not more measurements than can be read there."""
    return tables(results, _SHOWN)


def parameters(results: UpdateResults) -> Table:
    """Each parameter before and after, with its standard deviation and interval."""
    columns = ("name", "parameter", "unit", "before", "after", "deviation", "95 % from", "to", "")
    rows = []
    for row in results.parameters:
        unit, size = shown_in(row)
        initial, value, low, high = (
            number(each / size) for each in (row.initial, row.value, row.low, row.high)
        )
        deviation = "" if row.deviation is None else f"{row.deviation / size:.3g}"
        rows.append(
            (row.name, row.parameter, unit, initial, value, deviation, low, high, remark(row))
        )
    caption = (
        "The deviation is the standard deviation by the linear model; the interval is that of the "
        "profile likelihood, the other parameters fitted anew at each of its values."
    )
    held = [row.name for row in results.parameters if row.held]
    if held and any(row.deviation is not None for row in results.parameters):
        caption += f" The deviations hold only with {' and '.join(held)} at the bound."
    return Table("Parameters", columns, tuple(rows), caption)


def remark(row: UpdatedParameter) -> str:
    """Where an interval is one-sided, and why."""
    ends = [name for name, at in (("lower", row.low_is_bound), ("upper", row.high_is_bound)) if at]
    if row.held:
        return f"held by its {row.held} bound: one-sided"
    if len(ends) == 2:
        return "the whole range of its bounds is possible"
    return f"the {ends[0]} bound is possible: one-sided" if ends else ""


def directions(results: UpdateResults) -> Table:
    """What the measurements cannot tell."""
    rows = tuple(
        (each.words, ", ".join(f"{name}: {number(v)}" for name, v in each.change.items()))
        for each in results.unidentified
    )
    caption = (
        "Changes, in SI units, that alter all measured frequencies together by less than 1.96 "
        "standard deviations, from bound to bound."
    )
    return Table("Not identified", ("what", "change"), rows, caption)


def fit(results: UpdateResults) -> Table:
    """Before and after."""
    chance = "none" if results.p_value is None else f"{results.p_value:.3g}"
    before, after = results.initial_chi_squared, results.chi_squared
    chi_squared = f"{before:.4g}", f"{after:.4g}"
    row = (*chi_squared, str(results.degrees), chance, str(results.steps), results.ended)
    columns = ("χ² before", "χ² after", "degrees of freedom", "p", "steps", "ended")
    caption = (
        "χ² is the sum of squared residuals in standard deviations; p is the chance of so large a "
        "χ² if the model is right and the deviations are those stated."
    )
    return Table("Fit", columns, (row,), caption)


def measurements(results: UpdateResults, most: int | None = None) -> Table:
    """Each measurement with its residual; of many those that are worst explained."""
    shown = list(results.measurements)
    more = most is not None and len(shown) > most
    if more:
        worst = sorted(shown, key=lambda row: -abs(row.residual))[:most]
        shown = [row for row in shown if row in worst]
    columns = ("measurement", "mode", "measured [Hz]", "± [Hz]", "before [Hz]", "after [Hz]",
               "residual", "")  # fmt: skip
    rows = tuple(
        (row.label, str(row.mode), number(row.measured_hz), f"{row.deviation_hz:.3g}",
         f"{row.initial_hz:.5g}", f"{row.updated_hz:.5g}", f"{row.residual:+.2f}",
         "outlier" if row.is_outlier else "")
        for row in shown
    )  # fmt: skip
    caption = "Residuals in standard deviations of the measurement, after updating."
    if more:
        caption += f" The {len(shown)} worst of {len(results.measurements)}."
    return Table("Measurements", columns, rows, caption)


# --- The files


def write_update(
    results: UpdateResults, folder: Path, formats: Sequence[str] = ("png",), kind: str = "full"
) -> None:
    """Into ``folder``, which must exist: results.json, a report of this kind, figures."""
    data = f"{dumps(document(results))}\n".encode()
    (folder / "results.json").write_bytes(data)
    plans = update_figures(results)
    files = report.write_figures(plans, folder, formats)
    report.write_page(
        folder, kind, results, tables(results), plans, files,
        line=headline(results), tone="good" if results.verdict == "fitted" else "bad",
        first=len(plans), document=("results.json", data),
    )  # fmt: skip


def document(results: UpdateResults) -> dict[str, Any]:
    """Plain values in a fixed order; what is not identified has no deviation (null)."""
    return {
        **origin(results),
        "verdict": results.verdict,
        "headline": headline(results),
        "parameters": {
            row.name: {k: v for k, v in asdict(row).items() if k != "name"}
            for row in results.parameters
        },
        "covariance": _finite(results.covariance),
        "correlation": _finite(results.correlation),
        "not_identified": [asdict(each) for each in results.unidentified],
        "fit": {
            "initial_chi_squared": results.initial_chi_squared,
            "chi_squared": results.chi_squared,
            "degrees_of_freedom": results.degrees,
            "p_value": results.p_value,
            "steps": results.steps,
            "ended": results.ended,
        },
        "measurements": [
            {**asdict(row), "residual": row.residual, "outlier": row.is_outlier}
            for row in results.measurements
        ],
        "warnings": results.warnings,
        "notes": results.notes,
        "timing_s": dict(results.timing_s),
    }


def _finite(matrix: np.ndarray[Any, Any]) -> list[list[float | None]]:
    return [[float(v) if np.isfinite(v) else None for v in row] for row in matrix]
