"""What a chart leaves: errors against time and against the size of the box; tables; files.

A colour is a kind of method, its orders or sizes stand at its points. What the front passes by is
pale, not absent. Of several cases there are tables of scenes × methods.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from eigassign.arrays import Floats
from eigassign.chart.results import BoxRow, Cell, Chart, ChartPoint, Kind, Matrix
from eigassign.facts import fact, percent
from eigassign.output.documents import dumps, results_document
from eigassign.output.figures import graph
from eigassign.output.figures.graph import Curve, FigurePlan, Graph, Look, Mark, Panel, Rule
from eigassign.output.reports import page as report
from eigassign.output.tables import Table, facts_table

COLOURS: dict[str, str] = dict(zip(Kind, (
    *graph.SERIES[:6], "#882255", "#999933", graph.BLACK, graph.GREY, "#8a5a2b"
), strict=True))  # fmt: skip
WANTED = Look(graph.BLACK, 1.0, "fine")
SECTIONS = {"fails": "What fails, and what serves instead", "write": "What to write",
            "reach": "How far each method goes", "scenes": "Scenes × methods"}  # fmt: skip


def _figure(
    name: str, heading: str, caption: str, label: str, panels: Sequence[Panel], section: str
) -> FigurePlan:
    ends = (0.008, 1.25) if name == "boxes" else None  # of half-widths from 0.01 to 1
    shows = Graph(heading, label, np.zeros(0), tuple(panels), ends, True, beside=True)
    return FigurePlan(name, heading, caption, f"{heading}.", shows, section)


def _pale(colour: str) -> str:
    """The colour on white, at a half."""
    return "#" + "".join(f"{(255 + int(colour[k : k + 2], 16)) // 2:02x}" for k in (1, 3, 5))


def _plane(chart: Chart) -> FigurePlan:
    """A panel for each number of trajectories that a preparation is spread over."""
    asked, shown = chart.asked, [p for p in chart.points if p.worst_relative <= 1.0]
    panels = list[Panel]()
    for one in chart.fronts:
        n, marks, written = one.evaluations, [_wanted(chart)], list[Floats]()
        for curve in Kind:
            own = [p for p in shown if p.curve == curve]
            if curve == Kind.MESH:  # one is the case's own
                own.sort(key=lambda p: p.worst_relative)
            best = [p for p in own if p.method in one.methods]
            full = Look(COLOURS[curve], 0.0, marker="s" if curve == Kind.MESH else "o", size=7.0)
            if own:  # the legend shows full colours, in the first panel
                pale = replace(full, colour=_pale(full.colour), width=1.0, size=5.0)
                label = "" if panels else curve
                marks += [_curve(own, n, pale, written), _curve(best, n, full, written, label)]
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
    label = "time of a trajectory [s]"
    return _figure("plane", "Error against time", caption, label, panels, "answer")


def _wanted(chart: Chart) -> Mark:
    return Rule(100.0 * chart.asked.accuracy, WANTED, note="wanted")


def _curve(
    points: Sequence[ChartPoint], n: float, look: Look, written: list[Floats], label: str = ""
) -> Curve:
    """Their orders or sizes are written at points that are not too near to a ``written`` one."""
    y = np.array([100.0 * p.worst_relative for p in points])
    x = np.array([p.cost_s(n) for p in points])
    names = tuple(f"{p.method}, rms {percent(p.rms_relative)}" for p in points)
    marks = list[str]()
    for p, place in zip(points, np.log10([x, np.maximum(y, 1e-12)]).T, strict=True):
        is_free = all(np.abs((place - other) / (0.12, 0.6)).max() > 1.0 for other in written)
        size = "case" if p.size.endswith("the case") else "".join(re.findall(r"\d+", p.size)[:1])
        marks.append(size if is_free else "")
        written += [place] if is_free else []
    return Curve(y, look, label, x, names=names, marks=tuple(marks))


def _looks(rows: Sequence[BoxRow]) -> dict[str, Look]:
    """A colour for each kind of method, dashes for its orders."""
    looks = dict[str, Look]()
    for method in dict.fromkeys(row.method for row in rows):
        curve, _, size = method.rpartition(", ")
        dashes = {"order 1": "dotted", "order 2": "dash-dotted", "order 4": "dashed"}
        width, filled = (7.0, False) if curve == Kind.LINEAR else (4.0, True)  # rings of full ones
        looks[method] = Look(COLOURS[curve], 1.4, dashes.get(size, "solid"), "o", width, filled)
    return looks


def _boxes(chart: Chart) -> FigurePlan:
    """Worst error over half-width, a panel for q, y and both."""
    looks, panels = _looks(chart.boxes), list[Panel]()
    for varied in dict.fromkeys(row.varied for row in chart.boxes):
        marks = [_wanted(chart)]
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
    return _figure("boxes", heading, caption, "half-width of the ranges", panels, "reach")


def chart_tables(made: Chart | Matrix) -> tuple[Table, ...]:
    """The tables that have rows; the findings and what to write first."""
    found = _tables(made) if isinstance(made, Chart) else _matrix_tables(made)
    return tuple(table for table in found if table.rows)


def _facts(section: str, rows: Sequence[Any], names: str, caption: str = "") -> Table:
    return facts_table(SECTIONS[section], rows, names, caption)._replace(section=section)


def _tables(chart: Chart) -> Iterator[Table]:
    yield _facts("fails", chart.findings, "kind where modes gap methods why instead")
    yield _facts("write", chart.advice, "question words")
    limited = [row for row in chart.reach if row.half_width < 1.0]
    wanted, clock = percent(chart.asked.accuracy), f"{chart.asked.clock_s:.0e} s"
    caption = f"To {wanted}; methods that are not here hold all of the ranges."
    yield _facts("reach", limited, "method varied half_width error_at_all", caption)
    points = sorted(chart.points, key=lambda p: p.worst_relative)
    names = "method preparation_s trajectory_s spread_s worst_relative rms_relative failed use"
    caption = f"Least processor time of repeats in turns; the clock resolves {clock}."
    yield facts_table("All methods", points, names, caption)
    yield facts_table("All boxes", chart.boxes, "method varied half_width worst_relative")
    fronts = tuple((f"{f.evaluations:,}", "; ".join(f.methods)) for f in chart.fronts)
    yield Table("Fronts", ("trajectories", "no other is quicker and more accurate"), fronts)
    yield Table("Left out", ("method", "why"), chart.skipped)
    m = dict(chart.machine)
    m["versions"] = ", ".join(f"{name} {version}" for name, version in m["versions"].items())
    yield Table("Machine", ("", ""), tuple((name, str(value)) for name, value in m.items()))


def write_chart(
    made: Chart | Matrix, folder: Path, formats: Sequence[str] = ("png",), kind: str = "full"
) -> None:
    """Into ``folder``, which must exist: the numbers, a report of this kind, the figures.

    Numbers are chart.json, or matrix.json.
    """
    name, tone = type(made).__name__.lower(), "fair" if made.findings else "good"
    data = f"{dumps(results_document(made, may_lack=True))}\n".encode()
    numbers, plans = (f"{name}.json", data), list[FigurePlan]()
    if isinstance(made, Chart):
        plans = [_plane(made), *([_boxes(made)] if made.boxes else [])]
    report.write_page(
        made, chart_tables(made), plans, folder, formats, kind, numbers,
        line=made.headline, tone=tone, headings=SECTIONS,
    )  # fmt: skip


# --- Several cases


def _matrix_tables(matrix: Matrix) -> Iterator[Table]:
    """What fails, by case; errors and costs, cases × methods; what was refused."""
    columns = ("case", "what", "where", "fail", "instead")
    failing = [(c, f) for c in matrix.cases for f in matrix.findings[c]]
    rows = tuple((c, f.kind, f.where, f.methods, f.instead) for c, f in failing)
    yield Table(SECTIONS["fails"], columns, rows, section="fails")
    spread = f"Preparations are spread over {matrix.evaluations} trajectories."
    error = f"The worst error for the time of exact solves. {spread}"
    time = f"Time for {percent(matrix.accuracy)}, of that of exact solves."
    for title, name, caption in (
        ("Errors at equal cost", "error_at_equal_cost", error),
        ("Costs at equal accuracy", "cost_at_equal_accuracy", time),
    ):
        text = fact(Cell, name).text
        found = {(c.case, c.curve): text(getattr(c, name)) for c in matrix.cells}
        body = tuple((c, *(found[c, curve] for curve in Kind)) for c in matrix.cases)
        yield Table(title, ("case", *Kind), body, caption, "scenes")
    yield Table("Refused", ("case", "why"), matrix.refused, section="fails")
