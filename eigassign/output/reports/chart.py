"""What a chart leaves: its tables, for console, report and Markdown; chart.json; the report."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from eigassign.chart.results import Chart, ChartDocument
from eigassign.facts import capital, time_in_words
from eigassign.output.documents import document, dumps
from eigassign.output.figures.front import chart_figures
from eigassign.output.reports import page as report
from eigassign.output.tables import Table, facts_table


def chart_tables(chart: Chart) -> tuple[Table, ...]:
    """The tables that have rows: the choice, the fronts, all methods, the mesh, the designs."""
    more = (_methods(chart), _mesh(chart), _designs(chart), _machine(chart))
    return tuple(t for t in (_choice(chart, how=True), *_fronts(chart), *more) if t.rows)


def main_tables(chart: Chart) -> tuple[Table, ...]:
    """The tables for a terminal: the fronts, the ways to a design and what to choose."""
    return tuple(t for t in (*_fronts(chart), _designs(chart), _choice(chart)) if t.rows)


def _choice(chart: Chart, how: bool = False) -> Table:
    """The recommendations beside what ``auto`` takes; with ``how``, as a call or in a case file."""
    rows, refused, uses = [], dict[str, str](), {p.method: p.use for p in chart.points}
    for a in chart.advice:
        asked = f"{a.accuracy:.0e}" if a.accuracy else f"in {time_in_words(a.budget_s or 0.0)}"
        found, taken = ("none", "", ""), ("", "", "", "")
        if a.method is not None:
            found = (a.method, f"{a.worst_relative:.1e}", time_in_words(a.total_s or 0.0))
        if (auto := a.auto) is not None and auto.method is None:
            taken, refused[auto.refused] = ("refused", "", "", ""), asked
        elif auto is not None:
            times = time_in_words(auto.total_s or 0.0), time_in_words(auto.choosing_s)
            taken = (str(auto.method).partition(": ")[2], f"{auto.worst_relative:.1e}", *times)
        row = (asked, f"{a.evaluations:,.0f}", *found, *taken, uses.get(a.method or "", ""))
        rows.append(row[: 9 + how])
    columns = (
        "asked for", "evaluations", "choose", "worst error", "time in all",
        "auto takes", "its worst error", "its time in all", "choosing took", "how",
    )  # fmt: skip
    caption = (
        "Accuracy is the worst relative error in Hz; time is set-up and all evaluations. "
        "expansion.order: auto takes the fewest coefficients, by its own error estimate and no "
        "timing."
    )
    caption += "".join(f" {accuracy} is refused: {why}." for why, accuracy in refused.items())
    return Table("What to choose", columns[: 9 + how], tuple(rows), caption)


def _fronts(chart: Chart) -> Iterator[Table]:
    """The methods of each front, the quickest first."""
    known = {p.method: p for p in chart.points}
    columns = ("method", "eigassign's", "time", "worst error [Hz]", "relative")
    for each in chart.fronts:
        n = each.evaluations
        rows = tuple(
            (p.method, "yes" if p.ours else "no", time_in_words(p.cost_s(n)),
             f"{p.everywhere.worst_hz:.2e}", f"{p.everywhere.worst_relative:.1e}")
            for p in map(known.__getitem__, reversed(each.methods))
        )  # fmt: skip
        what = "one evaluation" if n is None else f"{n:,.0f} evaluations"
        caption = f"No charted method is both quicker and more accurate; time is that of {what}."
        yield Table(f"Front: {each.name}", columns, rows, caption)


def _methods(chart: Chart) -> Table:
    """The table of all methods, the most accurate first."""
    names = (
        "method offline online exact_solves everywhere.worst_hz everywhere.rms_hz "
        "trajectory.worst_hz everywhere.failed break_even"
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
    data = f"{dumps(document(ChartDocument(**vars(chart)), may_lack=True))}\n".encode()
    line = f"{capital(chart.advice[0].words)}." if chart.advice else None
    report.write_page(
        chart, chart_tables(chart), chart_figures(chart), folder, formats, kind,
        ("chart.json", data), line=line, tone="good",
    )  # fmt: skip
