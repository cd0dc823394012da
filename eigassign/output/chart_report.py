"""The tables of a chart, as text: for the console, the report and Markdown.

chart.json, report.html and the figures of a chart, written into a folder.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from eigassign.chart.results import SCHEMA, Advice, Chart, ChartPoint, Front, Timing
from eigassign.chart.timing import time_in_words as time
from eigassign.output import report
from eigassign.output.figures.front import chart_figures
from eigassign.output.figures.style import FigurePlan
from eigassign.output.results_json import dumps
from eigassign.output.tables import Table

# --- The tables of a chart, as text: for the console, the report and Markdown


def tables(chart: Chart) -> tuple[Table, ...]:
    """What to choose, the fronts, all methods, the mesh, the designs: those there are."""
    fronts = (front(chart, each) for each in chart.fronts)
    made = (advice(chart), auto(chart), *fronts, methods(chart),
            mesh(chart), designs(chart), machine(chart))  # fmt: skip
    return tuple(table for table in made if table.rows)


def spread(timing: Timing) -> str:
    """Median and quartiles; one run alone is marked."""
    if not timing.median_s:
        return "0"
    if not timing.repeats:
        return f"{time(timing.median_s)} (once)"
    return f"{time(timing.median_s)} ({time(timing.low_s)}–{time(timing.high_s)})"


def advice(chart: Chart) -> Table:
    """The recommendations."""
    rows = []
    for a in chart.advice:
        found = ("none", "", "") if a.method is None else (
            a.method, f"{a.worst_relative:.1e}", time(a.total_s or 0.0),
        )  # fmt: skip
        rows.append((_accuracy(a), f"{a.evaluations:,.0f}", *found))
    columns = ("asked for", "evaluations", "choose", "worst error", "time in all")
    caption = "Accuracy is the worst relative error in Hz; time is set-up and all evaluations."
    return Table("What to choose", columns, tuple(rows), caption)


def auto(chart: Chart) -> Table:
    """What ``auto`` takes, against the recommendation."""
    looked_at = [a for a in chart.advice if a.auto is not None]
    rows = tuple((_accuracy(a), f"{a.evaluations:,.0f}", *_taken(a)) for a in looked_at)
    columns = (
        "asked for", "evaluations", "auto takes", "worst error", "time in all",
        "against the choice", "choosing took",
    )  # fmt: skip
    refused = {a.auto.refused: _accuracy(a) for a in looked_at if a.auto and a.auto.refused}
    caption = (
        "expansion.order: auto takes the fewest coefficients, by its own error estimate and no "
        "timing."
    )
    why = [f"{accuracy} is refused: {words}." for words, accuracy in refused.items()]
    return Table(
        "What auto takes", columns, rows, " ".join([caption, *why, *_not_looked_at(chart)])
    )


def _not_looked_at(chart: Chart) -> Iterator[str]:
    """The accuracies for which auto was not asked any more."""
    asked = [a for a in chart.advice if a.accuracy is not None and not a.is_below_round_off]
    left = dict.fromkeys(_accuracy(a) for a in asked if a.auto is None)
    if left:
        yield f"Not asked for {', '.join(left)}: choosing had already taken too long."


def _accuracy(a: Advice) -> str:
    return f"{a.accuracy:.0e}" if a.accuracy is not None else f"in {time(a.budget_s or 0.0)}"


def _taken(a: Advice) -> tuple[str, ...]:
    if a.auto is None or a.auto.total_s is None:
        return ("refused", "", "", "", "" if a.auto is None else time(a.auto.choosing_s))
    against = f"{a.auto.total_s / a.total_s:.2g} × as long" if a.total_s else ""
    own = (str(a.auto.method), f"{a.auto.worst_relative:.1e}", time(a.auto.total_s), against)
    return (*own, time(a.auto.choosing_s))


def front(chart: Chart, each: Front) -> Table:
    """The methods of one front, the quickest first."""
    known = {p.method: p for p in chart.points}
    rows = tuple(
        (name, "yes" if known[name].ours else "no", *_cost(known[name], each),
         f"{known[name].everywhere.worst_hz:.2e}", f"{known[name].everywhere.worst_relative:.1e}")
        for name in reversed(each.methods)
    )  # fmt: skip
    columns = ("method", "eigassign's", "time", "worst error [Hz]", "relative")
    what = "one evaluation" if each.evaluations is None else f"{each.evaluations:,.0f} evaluations"
    caption = f"Nothing charted is both quicker and more accurate; time is that of {what}."
    return Table(f"Front: {each.name}", columns, rows, caption)


def _cost(point: ChartPoint, each: Front) -> tuple[str]:
    if each.evaluations is None:
        return (time(point.online.median_s),)
    return (time(point.total_s(each.evaluations)),)


def methods(chart: Chart) -> Table:
    """Every method, the most accurate first."""
    ordered = sorted(chart.points, key=lambda p: p.everywhere.worst_hz)
    columns = (
        "method", "set-up", "one evaluation", "exact solves", "worst [Hz]", "rms [Hz]",
        "worst along the trajectory [Hz]", "no number", "pays from",
    )  # fmt: skip
    caption = (
        'Time as median (quartiles); errors against the same exact solves; "pays from" is the '
        "number of evaluations from which it beats exact solves."
    )
    return Table("All methods", columns, tuple(_methods(ordered)), caption)


def _methods(points: Sequence[ChartPoint]) -> Iterator[tuple[str, ...]]:
    for p in points:
        along = "" if p.trajectory is None else f"{p.trajectory.worst_hz:.2e}"
        gain = "never" if p.break_even is None else f"{p.break_even:,.0f}"
        solves = f"{p.solves}" + (f" + {p.solves_online:.2g} each" if p.solves_online else "")
        yield (
            p.method, spread(p.offline), spread(p.online), solves, f"{p.everywhere.worst_hz:.2e}",
            f"{p.everywhere.rms_hz:.2e}", along, str(p.everywhere.failed or ""), gain,
        )  # fmt: skip


def mesh(chart: Chart) -> Table:
    """Meshes from coarse to fine."""
    columns = ("elements", "factor", "dof", "worst error [Hz]", "relative", "order", "exact solve")
    rows = tuple(
        (str(r.elements), f"{r.factor:g}", str(r.n_dof), f"{r.worst_hz:.2e}",
         f"{r.worst_relative:.1e}", "" if r.order is None else f"{r.order:.2f}", spread(r.solve))
        for r in chart.mesh
    )  # fmt: skip
    caption = "Against the limit extrapolated from the two finest; factor 1 is the case's own mesh."
    return Table("Mesh", columns, rows, caption)


def designs(chart: Chart) -> Table:
    """Ways to a design, the best objective first."""
    columns = ("method", "time", "exact solves", "objective", "above best", "worst", "rms", "")
    rows = tuple(
        (r.method, spread(r.seconds), str(r.solves), f"{r.objective:.6e}", f"{r.excess:.1e}",
         f"{100 * r.max_relative:.4f} %", f"{100 * r.rms_relative:.4f} %", r.note)
        for r in sorted(chart.designs, key=lambda r: r.excess)
    )  # fmt: skip
    caption = "Objective and distances to the target by exact solves along the trajectory."
    return Table("Designs", columns, rows, caption)


def machine(chart: Chart) -> Table:
    """What the times are from."""
    m = chart.machine
    rows = (
        ("processor", m.processor),
        ("cores", str(m.cores)),
        ("system", m.system),
        ("versions", ", ".join(f"{name} {version}" for name, version in m.versions.items())),
        ("linear algebra", f"{m.blas}, threads: {m.threads}"),
    )
    return Table("Machine", ("", ""), rows)


# --- chart.json, report.html and the figures of a chart, written into a folder


def write_chart(chart: Chart, folder: Path, formats: Sequence[str] = ("png",)) -> None:
    """Into ``folder``, which must exist: chart.json, report.html, the figures in these formats."""
    (folder / "chart.json").write_text(to_json(chart), encoding="utf-8")
    plans = chart_figures(chart)
    files = report.write_figures(plans, folder, formats)
    (folder / "report.html").write_bytes(to_html(chart, plans, files))


def to_json(chart: Chart) -> str:
    """All that a chart holds; every point can be computed again from its parameters."""
    return dumps(_finite({"schema": SCHEMA, **asdict(chart)})) + "\n"


def _finite(value: Any) -> Any:
    """Numbers that JSON has not, of methods that gave none, as null."""
    if isinstance(value, dict):
        return {key: _finite(inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def to_html(chart: Chart, plans: Sequence[FigurePlan], files: Mapping[str, bytes]) -> bytes:
    """The report as UTF-8; ``files`` holds what `render` made of ``plans``."""
    return report.page(chart, None, tables(chart), plans, files)
