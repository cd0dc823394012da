"""What a chart leaves: errors against time and against the size of the box; tables; files.

A colour is a kind of method, its orders or sizes stand at its points. What the front passes by is
pale, not absent. Of several cases there is one picture of scenes × methods.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from eigassign.chart.advice import headline
from eigassign.chart.methods import CURVES, LINEAR, MESH
from eigassign.chart.results import BoxRow, Cell, Chart, ChartPoint, Matrix
from eigassign.facts import fact, percent
from eigassign.output.documents import dumps, results_document
from eigassign.output.figures import graph
from eigassign.output.figures.graph import Curve, FigurePlan, Graph, Look, Mark, Panel, Rule
from eigassign.output.reports import page as report
from eigassign.output.tables import Table, facts_table

COLOURS = dict(zip(CURVES, (
    *graph.SERIES[:6], "#882255", "#999933", graph.BLACK, graph.GREY, "#8a5a2b"
), strict=True))  # fmt: skip
LEAST = 1e-10  # %, of claims: what is below is as good as nothing
WANTED = Look(graph.BLACK, 1.0, "fine")
SHADES = ("#1a6e3c", "#56ae6b", "#c3dd8a", "#d9694a", "#e9e9e9")  # of heat maps, and no answer
ERRORS = {1e-6: "≤ 0.0001 %", 1e-4: "≤ 0.01 %", 1e-2: "≤ 1 %", np.inf: "over 1 %"}
COSTS = {0.01: "≤ 1/100", 0.1: "≤ 1/10", 1.0: "≤ 1", np.inf: "over 1"}
SECTIONS = {"fails": "What fails, and what serves instead", "write": "What to write",
            "reach": "How far each method goes"}  # fmt: skip


def chart_figures(chart: Chart) -> tuple[FigurePlan, ...]:
    """Error against time; where something varies, against the size of the box, and as claimed."""
    return (_plane(chart), *((_boxes(chart), _claims(chart)) if chart.boxes else ()))


def _pale(colour: str) -> str:
    """The colour on white, at a half."""
    return "#" + "".join(f"{(255 + int(colour[k : k + 2], 16)) // 2:02x}" for k in (1, 3, 5))


def _mark(size: str) -> str:
    """What is written at a point: the order, or the number of points, vectors, elements."""
    return "".join(re.findall(r"\d+", size)[:1])


def _plane(chart: Chart) -> FigurePlan:
    """A panel for each number of trajectories that a preparation is spread over."""
    asked, shown = chart.asked, [p for p in chart.points if p.worst_relative <= 1.0]
    panels = list[Panel]()
    for one in chart.fronts:
        n, marks = one.evaluations, list[Mark]()
        marks.append(Rule(100.0 * asked.accuracy, WANTED, note="wanted"))
        for curve in CURVES:
            own = [p for p in shown if p.curve == curve]
            own.sort(key=lambda p: p.worst_relative * (p.curve == MESH))  # one is the case's own
            best = [p for p in own if p.method in one.methods]
            colour, shape = COLOURS[curve], "s" if curve == MESH else "o"
            if own:  # the legend shows full colours, in the first panel
                marks.append(_curve(own, n, Look(_pale(colour), 1.0, "solid", shape, 5.0)))
                full = Look(colour, 0.0, "solid", shape, 7.0)
                marks.append(_curve(best, n, full, "" if panels else curve))
        label = "one trajectory" if n == 1 else f"{n:,} trajectories"
        panels.append(Panel(f"worst error [%], {label}", tuple(marks), 3.4, True, 14))
    lost = len(chart.points) - len(shown)
    caption = (
        f"Worst error of a frequency at {asked.test_points} test points that no method has seen, "
        f"against the time of a trajectory of {asked.trajectory_samples} samples; what is prepared "
        "is spread over 1, 100 and 10,000 trajectories. Numbers are orders, vectors, stations, "
        "points, elements a link. Full colours: within what is wanted, and nothing is both quicker "
        "and more accurate. Squares: the error of the mesh itself."
    )
    caption += f" Not drawn: {lost} over 100 %." if lost else ""
    heading = "Error against time"
    shows = Graph(heading, "time of a trajectory [s]", np.zeros(0), tuple(panels),
                  x_logarithmic=True, beside=True)  # fmt: skip
    return FigurePlan("plane", heading, caption, "Worst error over time.", shows, "answer")


def _curve(points: Sequence[ChartPoint], n: float, look: Look, label: str = "") -> Curve:
    y = np.array([100.0 * p.worst_relative for p in points])
    x = np.array([p.cost_s(n) for p in points])
    names = tuple(f"{p.method}, rms {percent(p.rms_relative)}" for p in points)
    return Curve(y, look, label, x, names=names, marks=tuple(_mark(p.size) for p in points))


def _looks(rows: Sequence[BoxRow]) -> dict[str, Look]:
    """A colour for each kind of method, dashes for its orders."""
    looks = dict[str, Look]()
    for method in dict.fromkeys(row.method for row in rows):
        colour = COLOURS[method.rpartition(", ")[0]]
        dash = {"1": "dotted", "2": "dash-dotted", "4": "dashed"}.get(method[-1], "solid")
        is_linear = method.startswith(LINEAR)  # its points ring those of full series
        dash, size = dash if " order " in method else "solid", 7.0 if is_linear else 4.0
        looks[method] = Look(colour, 1.4, dash, "o", size, not is_linear)
    return looks


def _boxes(chart: Chart) -> FigurePlan:
    """Worst error over half-width, a panel for q, y and both."""
    looks, panels = _looks(chart.boxes), list[Panel]()
    for varied in dict.fromkeys(row.varied for row in chart.boxes):
        marks: list[Mark] = [Rule(100.0 * chart.asked.accuracy, WANTED, note="wanted")]
        for method, look in looks.items():
            own = [r for r in chart.boxes if (r.method, r.varied) == (method, varied)]
            y = np.array([100.0 * r.worst_relative for r in own])
            x, label = np.array([r.half_width for r in own]), "" if panels else method
            marks.append(Curve(np.where(y <= 1e4, y, np.nan), look, label, x))
        panels.append(Panel(f"worst error [%] over {varied}", tuple(marks), 3.0, True, 14))
    heading = "Error against the size of the box"
    caption = (
        "Worst error where poses, designs or both keep within a part of the case's ranges about "
        "the point of expansion; 1 is all of them. Where a curve passes the line, its method is "
        "no longer as accurate as wanted."
    )
    shows = Graph(heading, "half-width of the ranges", np.zeros(0), tuple(panels), (0.008, 1.25),
                  x_logarithmic=True, beside=True)  # fmt: skip
    return FigurePlan("boxes", heading, caption, "Worst error over half-width.", shows, "reach")


def _claims(chart: Chart) -> FigurePlan:
    """What methods say of their own error, over what is true."""
    rows = [r for r in chart.boxes if r.claimed is not None and r.worst_relative < 1.0]
    marks: list[Mark] = []
    for method, look in _looks(chart.boxes).items():
        own = [r for r in rows if r.method == method and r.claimed is not None]
        x = 100.0 * np.array([r.worst_relative for r in own])
        y = np.maximum(100.0 * np.array([r.claimed for r in own], dtype=np.float64), LEAST)
        if own:
            marks.append(Curve(y, replace(look, width=0.0), method, x))
    ends = np.array([LEAST, 1e2])
    marks.append(Curve(ends, WANTED, "claimed = true", ends))
    heading = "Claimed and true errors"
    caption = (
        "In every box: the share of a series' last degree, or Kriging's own deviation, against the "
        "worst error that was measured. Below the diagonal a method is surer than it should be."
    )
    panel = Panel("claimed error [%]", tuple(marks), 4.0, True, 16)
    shows = Graph(heading, "worst error [%]", np.zeros(0), (panel,), x_logarithmic=True,
                  beside=True)  # fmt: skip
    return FigurePlan("claims", heading, caption, "Claimed error over true error.", shows, "reach")


def chart_tables(chart: Chart) -> tuple[Table, ...]:
    """The tables that have rows; the findings and what to write first."""
    return tuple(table for table in _tables(chart) if table.rows)


def _tables(chart: Chart) -> Iterator[Table]:
    names = "kind where modes gap methods why instead"
    yield _in("fails", facts_table(SECTIONS["fails"], chart.findings, names))
    yield _in("write", facts_table(SECTIONS["write"], chart.advice, "question words"))
    table = facts_table("What optimize makes of each order", chart.orders, "order moved one_shot")
    yield _in("write", table)
    limited = [row for row in chart.reach if row.half_width < 1.0]
    caption = (
        f"To {percent(chart.asked.accuracy)}; methods that are not here hold all of the ranges."
    )
    names = "method varied half_width error_at_all"
    yield _in("reach", facts_table(SECTIONS["reach"], limited, names, caption))
    names = (
        "method preparation_s trajectory_s spread_s worst_relative rms_relative worst_by_shape "
        "failed use"
    )
    points = sorted(chart.points, key=lambda p: p.worst_relative)
    clock = f"{chart.asked.clock_s:.0e} s"
    caption = f"Least processor time of repeats in turns; the clock resolves {clock}. By shape: "
    caption += "against the mode that has the shape, where modes meet and numbers change places."
    yield facts_table("All methods", points, names, caption)
    names = "method varied half_width worst_relative claimed"
    yield facts_table("All boxes", chart.boxes, names)
    yield Table("Left out", ("method", "why"), chart.skipped)
    m = dict(chart.machine)
    m["versions"] = ", ".join(f"{name} {version}" for name, version in m["versions"].items())
    yield Table("Machine", ("", ""), tuple((name, str(value)) for name, value in m.items()))


def _in(section: str, table: Table) -> Table:
    return Table(table.title, table.columns, table.rows, table.caption, section)


def write_chart(
    chart: Chart, folder: Path, formats: Sequence[str] = ("png",), kind: str = "full"
) -> None:
    """Into ``folder``, which must exist: chart.json, a report of this kind, the figures."""
    data = f"{dumps(results_document(chart, may_lack=True))}\n".encode()
    tone = "fair" if chart.findings else "good"
    report.write_page(
        chart, chart_tables(chart), chart_figures(chart), folder, formats, kind,
        ("chart.json", data), line=headline(chart), tone=tone, headings=SECTIONS,
    )  # fmt: skip


# --- Several cases


def matrix_figures(matrix: Matrix) -> tuple[FigurePlan, ...]:
    """Two heat maps: errors at equal cost, costs at equal accuracy."""
    wanted = percent(matrix.accuracy)
    dearer, exact = "error_at_equal_cost", "Worst error for the time of exact solves"
    cheaper, time = "cost_at_equal_accuracy", f"Time for {wanted}, of that of exact solves"
    return (
        _heat(matrix, "errors", exact, ERRORS, dearer),
        _heat(matrix, "costs", time, COSTS, cheaper),
    )


def _heat(
    matrix: Matrix, name: str, heading: str, levels: Mapping[float, str], fact: str
) -> FigurePlan:
    values = [getattr(cell, fact) for cell in matrix.cells]
    level = np.searchsorted(list(levels), [np.inf if v is None else v for v in values])
    level[[v is None for v in values]] = len(levels)
    at = np.array([CURVES.index(cell.curve) + 1.0 for cell in matrix.cells])
    below = np.array([-float(matrix.cases.index(cell.case)) for cell in matrix.cells])
    told = [f"{c.case}: {c.curve}, {v}" for c, v in zip(matrix.cells, values, strict=True)]
    marks: list[Mark] = []
    for k, label in enumerate((*levels.values(), "none is")):
        own = np.flatnonzero(level == k)
        look = Look(SHADES[k], 0.0, "solid", "s", 15.0)
        names = tuple(told[i] for i in own)
        marks.append(Curve(below[own], look, label, at[own], names=names))
    failing = {c: ", ".join(f.kind for f in matrix.findings[c]) for c in matrix.cases}
    rows = np.array([-float(k) for k, c in enumerate(matrix.cases) if failing[c]])
    look, names = Look(graph.VERMILLION, 0.0, marker="o"), tuple(filter(None, failing.values()))
    marks.append(Curve(rows, look, "something fails by name", 0.0 * rows, names=names))
    caption = f"Preparations are spread over {matrix.evaluations} trajectories."
    room = np.array([0.6, 0.4 - len(matrix.cases)])
    panel = Panel(
        "", tuple(marks), 0.5 + 0.3 * len(matrix.cases), holds=(room,), names=matrix.cases
    )
    ends = (-0.6, len(CURVES) + 0.6)
    shows = Graph(heading, "", np.zeros(0), (panel,), ends, x_names=CURVES)
    return FigurePlan(name, heading, caption, f"Heat map: {heading}.", shows, "answer")


def matrix_tables(matrix: Matrix) -> tuple[Table, ...]:
    """What fails, by case; errors and costs, cases × methods; what was refused."""
    rows = [
        (c, f.kind, f.where, f.methods, f.instead) for c in matrix.cases for f in matrix.findings[c]
    ]
    tables = [
        _in(
            "fails",
            Table(SECTIONS["fails"], ("case", "what", "where", "fail", "instead"), tuple(rows)),
        )
    ]
    for title, name in (
        ("Errors at equal cost", "error_at_equal_cost"),
        ("Costs at equal accuracy", "cost_at_equal_accuracy"),
    ):
        text = fact(Cell, name).text
        found = {(c.case, c.curve): text(getattr(c, name)) for c in matrix.cells}
        body = tuple((c, *(found[c, curve] for curve in CURVES)) for c in matrix.cases)
        tables.append(Table(title, ("case", *CURVES), body))
    tables.append(_in("fails", Table("Refused", ("case", "why"), matrix.refused)))
    return tuple(table for table in tables if table.rows)


def write_matrix(
    matrix: Matrix, folder: Path, formats: Sequence[str] = ("png",), kind: str = "full"
) -> None:
    """Into ``folder``: matrix.json, matrix.csv, a report of this kind, the heat maps."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    names = ("case", "curve", "error_at_equal_cost", "cost_at_equal_accuracy")
    writer.writerows([names, *([getattr(c, name) for name in names] for c in matrix.cells)])
    (folder / "matrix.csv").write_text(text.getvalue(), encoding="utf-8")
    data = f"{dumps(results_document(matrix, may_lack=True))}\n".encode()
    report.write_page(
        matrix, matrix_tables(matrix), matrix_figures(matrix), folder, formats, kind,
        ("matrix.json", data), line=matrix.headline, tone="fair", headings=SECTIONS,
    )  # fmt: skip
