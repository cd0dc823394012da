"""What a chart leaves: its tables, for console, report and Markdown; chart.json; the report."""

from __future__ import annotations

from collections.abc import Sequence
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
    """The tables that have rows: what to write, the quickest and all methods, mesh, designs."""
    names = "asked_for evaluations method worst_relative total_s"
    caption = "Set-up and all evaluations. Not all of these can be asked for in a case file."
    quickest = facts_table("The quickest of all methods", chart.advice, names, caption)
    more = (_methods(chart), _mesh(chart), _designs(chart), _machine(chart))
    return tuple(table for table in (to_write(chart), quickest, *more) if table.rows)


def to_write(chart: Chart) -> Table:
    """What a case can ask for, for each accuracy, beside what ``order: auto`` takes."""
    names = "asked_for key key_relative key_sample_s auto.method auto.worst_relative"
    rows = [a for a in chart.advice if a.evaluations == chart.advice[0].evaluations]
    both = f"{names} auto.choosing_s auto.refused"
    return facts_table("What to write in the case", rows, both, "", **{"auto.refused": "refused"})


def _methods(chart: Chart) -> Table:
    """The table of all methods, the most accurate first."""
    names = (
        "method offline online exact_solves everywhere.worst_hz everywhere.rms_hz "
        "trajectory.worst_hz everywhere.failed break_even use"
    )
    rows = sorted(chart.points, key=lambda p: p.everywhere.worst_hz)
    caption = (
        'Time as median (quartiles); errors against the same exact solves; "pays from" is the '
        "number of evaluations from which it beats exact solves."
    )
    return facts_table("All methods", rows, names, caption)


def _mesh(chart: Chart) -> Table:
    """Meshes from coarse to fine."""
    names = "elements factor n_dof worst_hz worst_relative order solve"
    caption = "Against the limit extrapolated from the two finest; factor 1 is the case's own mesh."
    return facts_table("Mesh", chart.mesh, names, caption)


def _designs(chart: Chart) -> Table:
    """Ways to a design, the best objective first."""
    names = "method seconds solves objective excess max_relative rms_relative note"
    rows = sorted(chart.designs, key=lambda r: r.excess)
    caption = "Objective and distances to the target by exact solves along the trajectory."
    return facts_table("Designs", rows, names, caption)


def _machine(chart: Chart) -> Table:
    """The machine and versions that the times are from."""
    m = dict(chart.machine)
    m["linear algebra"] = f"{m.pop('blas')}, threads: {m.pop('threads')}"
    m["versions"] = ", ".join(f"{name} {version}" for name, version in m["versions"].items())
    return Table("Machine", ("", ""), tuple((name, str(value)) for name, value in m.items()))


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
