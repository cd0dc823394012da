"""What a chart leaves: its tables, for console, report and Markdown; chart.json; the report."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from eigassign.chart.results import Chart
from eigassign.facts import capital
from eigassign.output.documents import dumps, results_document
from eigassign.output.figures.front import chart_figures
from eigassign.output.reports import page as report
from eigassign.output.tables import Table, facts_table


def headline(chart: Chart) -> str | None:
    """What to write in the case, in a sentence; None where no advice is asked for."""
    return f"{capital(chart.advice[0].words)}." if chart.advice else None


def chart_tables(chart: Chart) -> tuple[Table, ...]:
    """The tables that have rows."""
    return tuple(table for table in _tables(chart) if table.rows)


def _tables(chart: Chart) -> Iterator[Table]:
    """What to write, all methods, and mesh."""
    names = "accuracy key worst_relative sample_s"
    yield facts_table("What to write in the case", chart.advice, names)
    names = (
        "method offline online exact_solves everywhere.worst_hz everywhere.rms_hz "
        "trajectory.worst_hz everywhere.failed break_even use"
    )
    points = sorted(chart.points, key=lambda p: p.everywhere.worst_hz)
    caption = (
        'Time as median (quartiles); errors against the same exact solves; "pays from" is the '
        "number of evaluations from which it beats exact solves."
    )
    yield facts_table("All methods", points, names, caption)
    names = "elements factor n_dof worst_hz worst_relative order solve"
    caption = "Against the limit extrapolated from the two finest; factor 1 is the case's own mesh."
    yield facts_table("Mesh", chart.mesh, names, caption)
    m = dict(chart.machine)
    m["linear algebra"] = f"{m.pop('blas')}, threads: {m.pop('threads')}"
    m["versions"] = ", ".join(f"{name} {version}" for name, version in m["versions"].items())
    yield Table("Machine", ("", ""), tuple((name, str(value)) for name, value in m.items()))


def write_chart(
    chart: Chart, folder: Path, formats: Sequence[str] = ("png",), kind: str = "full"
) -> None:
    """Into ``folder``, which must exist: chart.json, a report of this kind, the figures.

    Every point in chart.json can be computed again from its parameters.
    """
    data = f"{dumps(results_document(chart, may_lack=True))}\n".encode()
    tone = "good" if any(a.key for a in chart.advice[:1]) else "fair"
    report.write_page(
        chart, chart_tables(chart), chart_figures(chart), folder, formats, kind,
        ("chart.json", data), line=headline(chart), tone=tone,
    )  # fmt: skip
