"""What a chart leaves: its tables, for console, report and Markdown; chart.json; the report."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from eigassign.chart.results import SCHEMA, Advice, Chart, Front, Timing
from eigassign.chart.timing import time_in_words
from eigassign.output.figures.front import chart_figures
from eigassign.output.formats import capital
from eigassign.output.reports import page as report
from eigassign.output.result_files import dumps
from eigassign.output.tables import Table

# --- The tables


def tables(chart: Chart) -> tuple[Table, ...]:
    """What to choose, the fronts, all methods, the mesh, the designs: those there are."""
    fronts = (front(chart, each) for each in chart.fronts)
    made = (advice(chart, how=True), auto(chart), *fronts, methods(chart),
            mesh(chart), designs(chart), machine(chart))  # fmt: skip
    return tuple(table for table in made if table.rows)


def main_tables(chart: Chart) -> tuple[Table, ...]:
    """For the terminal: the fronts, the ways to a design and what to choose."""
    fronts = (front(chart, each) for each in chart.fronts)
    made = (*fronts, designs(chart), advice(chart), auto(chart))
    return tuple(table for table in made if table.rows)


def spread(timing: Timing) -> str:
    """Median and quartiles; one run alone is marked."""
    median = time_in_words(timing.median_s)
    if not timing.median_s:
        return median
    if not timing.repeats:
        return f"{median} (once)"
    return f"{median} ({time_in_words(timing.low_s)}–{time_in_words(timing.high_s)})"


def advice(chart: Chart, how: bool = False) -> Table:
    """The recommendations; ``how`` they are followed, as a call or in the case file."""
    rows, uses = [], {p.method: p.use for p in chart.points}
    for a in chart.advice:
        found = ("none", "", "") if a.method is None else (
            a.method, f"{a.worst_relative:.1e}", time_in_words(a.total_s or 0.0),
        )  # fmt: skip
        use = (uses.get(a.method or "", ""),) if how else ()
        rows.append((_asked_for(a), f"{a.evaluations:,.0f}", *found, *use))
    last = ("how",) if how else ()
    columns = ("asked for", "evaluations", "choose", "worst error", "time in all", *last)
    caption = "Accuracy is the worst relative error in Hz; time is set-up and all evaluations."
    return Table("What to choose", columns, tuple(rows), caption)


def _asked_for(a: Advice) -> str:
    if a.accuracy is not None:
        return f"{a.accuracy:.0e}"
    return f"in {time_in_words(a.budget_s or 0.0)}"


def auto(chart: Chart) -> Table:
    """What ``auto`` takes, against the recommendation; and where it refuses or was not asked."""
    rows, refused, unasked = [], dict[str, str](), dict[str, None]()
    for a in chart.advice:
        taken = a.auto
        if taken is None:
            if a.accuracy is not None and not a.is_below_round_off:
                unasked[_asked_for(a)] = None
            continue
        if taken.total_s is None:
            refused[taken.refused] = _asked_for(a)
            found = ("refused", "", "", "")
        else:
            against = f"{taken.total_s / a.total_s:.2g} × as long" if a.total_s else ""
            worst, total = f"{taken.worst_relative:.1e}", time_in_words(taken.total_s)
            found = (str(taken.method), worst, total, against)
        spent = time_in_words(taken.choosing_s)
        rows.append((_asked_for(a), f"{a.evaluations:,.0f}", *found, spent))
    columns = (
        "asked for", "evaluations", "auto takes", "worst error", "time in all",
        "against the choice", "choosing took",
    )  # fmt: skip
    caption = [
        "expansion.order: auto takes the fewest coefficients, by its own error estimate and no "
        "timing.",
        *(f"{accuracy} is refused: {words}." for words, accuracy in refused.items()),
    ]
    if unasked:
        caption.append(f"Not asked for {', '.join(unasked)}: choosing had already taken too long.")
    return Table("What auto takes", columns, tuple(rows), " ".join(caption))


def front(chart: Chart, each: Front) -> Table:
    """The methods of one front, the quickest first."""
    known = {p.method: p for p in chart.points}
    rows = tuple(
        (p.method, "yes" if p.ours else "no", time_in_words(each.cost_s(p)),
         f"{p.everywhere.worst_hz:.2e}", f"{p.everywhere.worst_relative:.1e}")
        for p in (known[name] for name in reversed(each.methods))
    )  # fmt: skip
    columns = ("method", "eigassign's", "time", "worst error [Hz]", "relative")
    what = "one evaluation" if each.evaluations is None else f"{each.evaluations:,.0f} evaluations"
    caption = f"No charted method is both quicker and more accurate; time is that of {what}."
    return Table(f"Front: {each.name}", columns, rows, caption)


def methods(chart: Chart) -> Table:
    """Every method, the most accurate first."""
    rows = []
    for p in sorted(chart.points, key=lambda p: p.everywhere.worst_hz):
        along = "" if p.trajectory is None else f"{p.trajectory.worst_hz:.2e}"
        gain = "never" if p.break_even is None else f"{p.break_even:,.0f}"
        solves = f"{p.solves}" + (f" + {p.solves_online:.2g} each" if p.solves_online else "")
        errors, failed = p.everywhere, str(p.everywhere.failed or "")
        rows.append(
            (p.method, spread(p.offline), spread(p.online), solves, f"{errors.worst_hz:.2e}",
             f"{errors.rms_hz:.2e}", along, failed, gain)
        )  # fmt: skip
    columns = (
        "method", "set-up", "one evaluation", "exact solves", "worst [Hz]", "rms [Hz]",
        "worst along the trajectory [Hz]", "no number", "pays from",
    )  # fmt: skip
    caption = (
        'Time as median (quartiles); errors against the same exact solves; "pays from" is the '
        "number of evaluations from which it beats exact solves."
    )
    return Table("All methods", columns, tuple(rows), caption)


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


# --- The files


def write_chart(
    chart: Chart, folder: Path, formats: Sequence[str] = ("png",), kind: str = "full"
) -> None:
    """Into ``folder``, which must exist: chart.json, a report of this kind, the figures."""
    (folder / "chart.json").write_text(to_json(chart), encoding="utf-8")
    plans = chart_figures(chart)
    files = report.write_figures(plans, folder, formats)
    words = chart.advice[0].words if chart.advice else ""
    line = f"{capital(words)}." if words else None
    report.write_page(
        folder, kind, chart, tables(chart), plans, files,
        line=line, tone="good", document=("chart.json", to_json(chart).encode()),
    )  # fmt: skip


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
