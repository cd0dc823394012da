"""What a chart leaves: figures of time against error; its tables; chart.json and the report.

Every figure is a scatter over two logarithmic axes. Methods that differ by a setting are joined by
a line: eigassign's filled, the others hollow and dashed. A colour is a kind of method; the legend
names the kinds. A broad band joins the methods that no other beats.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import cycle
from pathlib import Path

import numpy as np

from eigassign.chart.results import Chart, ChartPoint, Front, kind_of
from eigassign.facts import capital
from eigassign.output.documents import dumps, results_document
from eigassign.output.figures import graph
from eigassign.output.figures.graph import Curve, FigurePlan, Graph, Look, Mark, Panel, Rule
from eigassign.output.reports import page as report
from eigassign.output.tables import Table, facts_table

BAND, PLAIN = Look("#c9dfee", 7.0), Look(graph.GREY, 1.0, "fine")
RING = Look(graph.BLACK, 0.0, marker="o", size=12.0, filled=False)


def chart_figures(chart: Chart) -> tuple[FigurePlan, ...]:
    """The figures that this chart has something to show for; the time of a sample first."""
    plans = [_front(chart, f) for f in sorted(chart.fronts, key=lambda f: bool(f.evaluations))]
    plans += [_mesh(chart)] if chart.mesh else []
    return tuple(plans)


def _front(chart: Chart, front: Front) -> FigurePlan:
    """The methods by family, over the band through the best; what to write is ringed."""
    asked, n = chart.asked, front.evaluations
    what = "time of a sample" if n is None else f"set-up and {n:,.0f} evaluations"
    name = "".join(c if c.isalnum() else "_" for c in front.name)
    shown = [p for p in chart.points if p.everywhere.worst_hz <= asked.typical_hz]
    lost = len(chart.points) - len(shown)
    verb = "method is" if lost == 1 else "methods are"
    beyond = f" {lost} {verb} wrong by over 100 % somewhere and not drawn." if lost else ""
    caption = (
        f"Worst |f / f exact − 1| over {asked.random_points} random samples of trajectory × design "
        f"box and {asked.designs} × {asked.samples_per_design} samples along the trajectory at "
        "several designs. Filled: eigassign's; hollow: what people do without it; the band: no "
        f"charted method is both quicker and more accurate.{beyond}"
    )
    floor = asked.floor_hz / asked.typical_hz

    def curve(points: Sequence[ChartPoint], look: Look, label: str = "") -> Curve:
        x = np.array([p.cost_s(n) for p in points])
        y = np.array([100.0 * max(p.everywhere.worst_relative, floor) for p in points])
        return Curve(y, look, label, x, names=tuple(p.method for p in points))

    best = sorted((p for p in shown if p.method in front.methods), key=lambda p: p.cost_s(n))
    ringed = [p for p in shown if p.method in {a.method for a in chart.advice[:1]}]
    curves = [
        (ours, curve([p for p in shown if p.family == family], PLAIN, kind_of(family)))
        for family, ours in dict.fromkeys((p.family, p.ours) for p in shown)
    ]
    marks: list[Mark] = [
        Rule(100.0 * floor, PLAIN, note="round-off of exact solves"),
        curve(best, BAND),
        *([curve(ringed, RING, "to write in the case")] if ringed else ()),
        *_coloured(curves),
    ]
    room = (np.array([50.0 * floor]),)  # for the name of the level
    heading = f"{capital(what)} against worst error"
    alt = f"Scatter of worst error in % over {what} for all methods."
    panel = Panel("worst error [%]", tuple(marks), 3.8, True, None, room)
    section = "answer" if n is None else "appendix"
    name = name if n is None else f"cost_{name}"
    return FigurePlan(name, heading, caption, alt, _scatter(heading, "time [s]", panel), section)


def _mesh(chart: Chart) -> FigurePlan:
    """Error over elements; below, time over elements."""
    caption = (
        "Worst error of exact frequencies against the limit that the meshes converge to, "
        f"extrapolated from the two finest ({chart.mesh[-1].elements} elements)."
    )
    for row in [row for row in chart.mesh if row.factor == 1.0]:
        own = f"The case's own mesh ({row.elements} elements)"
        caption += f" {own} is {row.worst_hz:.3g} Hz from the limit."
    rows = [(row.elements, row.worst_hz, row.solve.median_s) for row in chart.mesh if row.worst_hz]
    counts, *values = np.array(rows, dtype=np.float64).T
    heading = "Elements against discretisation error"
    above, below = (Curve(y, Look(graph.BLUE, 0.9, marker="o"), x=counts) for y in values)
    panels = (
        Panel("worst error [Hz]", (above,), 3.8, True, None),
        Panel("exact solve [s]", (below,), 2.0, True, None),
    )
    alt = "Discretisation error in Hz over the number of elements."
    return FigurePlan("mesh", heading, caption, alt, _scatter(heading, "elements", *panels))


def _scatter(title: str, x: str, *panels: Panel) -> Graph:
    return Graph(title, x, np.zeros(0), panels, x_logarithmic=True, beside=True)


def _coloured(curves: Sequence[tuple[bool, Curve]]) -> Iterator[Curve]:
    """The others first, hollow and dashed; of one label all look alike, and one has it."""
    names = dict.fromkeys(curve.label for _, curve in curves)
    colours = dict(zip(names, cycle(graph.SERIES), strict=False))
    named = set[tuple[bool, str]]()
    for ours, curve in sorted(curves, key=lambda pair: pair[0]):
        dash, marker = ("solid", "o") if ours else ("fine", "s")
        look = Look(colours[curve.label], 0.9, dash, marker, 6.0, ours)
        yield replace(curve, look=look, label="" if (ours, curve.label) in named else curve.label)
        named.add((ours, curve.label))


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
