"""The figures of a chart: time against error on each front, elements, and ways to a design.

Every figure is a scatter over two logarithmic axes. Methods that differ by a setting are joined by
a line: eigassign's filled, the others hollow and dashed. A colour is a kind of method; the legend
names the kinds. A broad band joins the methods that no other beats.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import cycle

import numpy as np
from numpy.typing import NDArray

from eigassign.chart.results import Chart, ChartPoint, Front, excess_over
from eigassign.output.figures import graph
from eigassign.output.figures.graph import Curve, FigurePlan, Graph, Look, Mark, Panel, Rule

Floats = NDArray[np.float64]
LEAST_EXCESS = 1e-10  # of an objective over the best one: less is the rounding of a search's end
_KINDS = (  # of methods whose family begins so; the first that fits
    ("Taylor", "series of λ"),
    ("1/λ", "series of 1/λ"),
    ("reduced", "reduced models"),
    ("fit", "fits"),
    ("exact by others", "exact solves by others"),
    ("exact", "exact solves"),
    ("", "interpolation and surrogates"),
)
COLOURS = (*graph.SERIES[:5], graph.BLACK, graph.SKY, graph.GREY)


def chart_figures(chart: Chart) -> tuple[FigurePlan, ...]:
    """The figures that this chart has something to show for, in reading order."""
    plans = [_front(chart, each) for each in chart.fronts]
    if chart.mesh:
        plans.append(_mesh(chart))
    if chart.designs:
        plans.append(_designs(chart))
    return tuple(plans)


def _front(chart: Chart, front: Front) -> FigurePlan:
    """The methods by family, and the front through the best."""
    asked, single = chart.asked, front.evaluations is None
    words = "".join(c if c.isalnum() else "_" for c in front.name)
    name, what = words, "time of one evaluation"
    if front.evaluations is not None:
        name, what = f"cost_{words}", f"set-up and {front.evaluations:,.0f} evaluations"
    shown = [p for p in chart.points if p.everywhere.worst_hz <= asked.typical_hz]
    lost = len(chart.points) - len(shown)
    verb = "method is" if lost == 1 else "methods are"
    beyond = f" {lost} {verb} wrong by over 100 % somewhere and not drawn." if lost else ""
    caption = (
        f"Worst |f − f exact| over {asked.random_points} random samples of trajectory × design "
        f"box and {asked.designs} × {asked.samples_per_design} samples along the trajectory at "
        "several designs. Filled: eigassign's; hollow: what people do without it; the band: no "
        "charted method is both quicker and more accurate; ringed: taken by "
        f"`expansion.order: auto`.{beyond}"
    )

    def curve(points: Sequence[ChartPoint], label: str) -> Curve:
        x = np.array([front.cost_s(p) for p in points])
        y = np.array([max(p.everywhere.worst_hz, asked.floor_hz) for p in points])
        group = "eigassign" if points and points[0].ours else "others"
        names = tuple(p.method for p in points)
        return Curve(y, Look(""), label, x, group=group, names=names)

    families: dict[str, list[ChartPoint]] = {}
    for p in shown:  # what is set up anew for every design has no part in single evaluations
        if p.at_once == 1 or not single:
            families.setdefault(p.family, []).append(p)
    kinds = {
        f: next(kind for beginning, kind in _KINDS if f.startswith(beginning)) for f in families
    }
    taken = {a.auto.method for a in chart.advice if a.auto is not None}
    ringed = curve([p for p in shown if p.method in taken], "taken by order: auto")
    drawn = scatter(
        f"{'Time of one evaluation' if single else front.name.capitalize()} against worst error",
        ("time", "s"),
        ("worst error", "Hz"),
        [curve(own, kinds[family]) for family, own in families.items()],
        band=curve([p for p in shown if p.method in front.methods], ""),
        level=("round-off of exact solves", asked.floor_hz),
        ringed=ringed,
    )
    heading = f"{what[0].upper()}{what[1:]} against worst error"
    alt = f"Scatter of worst error in Hz over {what} for every method."
    return FigurePlan(name, heading, caption, alt, drawn)


def _mesh(chart: Chart) -> FigurePlan:
    """Error over elements; below, time over elements."""
    own = [row for row in chart.mesh if row.factor == 1.0]
    here = "".join(
        f" The case's own mesh ({row.elements} elements) is {row.worst_hz:.3g} Hz from the limit."
        for row in own
    )
    caption = (
        "Worst error of exact frequencies against the limit that the meshes converge to, "
        f"extrapolated from the two finest ({chart.mesh[-1].elements} elements).{here}"
    )
    rows = [row for row in chart.mesh if row.worst_hz > 0.0]
    counts = np.array([float(row.elements) for row in rows])
    errors, times = np.array([(row.worst_hz, row.solve.median_s) for row in rows]).T
    heading, x = "Elements against discretisation error", ("elements", "")
    drawn = scatter(heading, x, ("worst error", "Hz"), [_ours(errors, counts)])
    below = scatter(heading, x, ("exact solve", "s"), [_ours(times, counts)])
    drawn = replace(drawn, panels=(*drawn.panels, replace(below.panels[0], height=2.0)))
    alt = "Discretisation error in Hz over the number of elements."
    return FigurePlan("mesh", heading, caption, alt, drawn)


def _ours(y: Floats, x: Floats) -> Curve:
    return Curve(y, Look(""), x=x, group="eigassign")


def _designs(chart: Chart) -> FigurePlan:
    """Single answers as points, searches as lines of their improvements."""
    best = min(chart.designs, key=lambda run: run.objective)
    caption = (
        "Exact objective (mean square of f/f_d − 1) above the best one that any method "
        f"found ({best.objective:.6g}, by {best.method}), relative to it; searches with all their "
        f"steps. What is nearer than {LEAST_EXCESS:.0e} is drawn there."
    )
    curves = []
    for run in chart.designs:
        seconds, found = np.array(run.trace or ((run.seconds.median_s, run.objective),)).T
        excess = [max(excess_over(best.objective, value), LEAST_EXCESS) for value in found]
        group = "eigassign" if run.ours else "others"
        curves.append(Curve(np.array(excess), Look(""), run.method, seconds, group=group))
    heading = "Time to a design against the objective it reaches"
    drawn = scatter(heading, ("time", "s"), ("objective above the best", "relative"), curves)
    alt = "Scatter of excess objective over seconds for every way to a design."
    return FigurePlan("designs", heading, caption, alt, drawn)


def scatter(
    title: str,
    x: tuple[str, str],
    y: tuple[str, str],
    curves: Sequence[Curve],
    band: Curve | None = None,
    level: tuple[str, float] | None = None,
    ringed: Curve | None = None,
) -> Graph:
    """``curves`` over the axes ``x``, ``y`` (name, unit), with a legend beside them.

    The group "eigassign" is filled, the others are hollow and dashed; of one label all look alike,
    and the two groups take colours from opposite ends. ``band`` is drawn as steps, ``level`` is a
    named height across the axes, ``ringed`` are points with a ring around them.
    """
    drawn: list[Curve] = []
    for ours, colours in ((False, COLOURS[::-1]), (True, COLOURS)):
        own = [curve for curve in curves if (curve.group == "eigassign") is ours]
        dash, marker = ("solid", "o") if ours else ("fine", "s")
        labels = dict.fromkeys(curve.label for curve in own)
        looks = dict(zip(labels, cycle(colours), strict=False))
        for k, curve in enumerate(own):
            label = "" if curve.label in [other.label for other in own[:k]] else curve.label
            look = Look(looks[curve.label], 0.9, dash, marker, 6.0, ours)
            drawn.append(replace(curve, look=look, label=label))
    holds = () if level is None else (np.array([level[1], level[1] / 2.0]),)  # room for its name
    panel = Panel(graph.labelled(*y), tuple(drawn), 3.8, True, None, holds)
    marks: list[Mark] = []
    if level is not None:
        marks.append(Rule(level[1], Look(graph.GREY, 1.0, "fine"), note=level[0]))
    if band is not None and len(band.y):
        right = graph.decades([curve.x for curve in curves if curve.x is not None])[1]
        marks.append(_steps(band, panel.limits[1], right))
    marks += panel.curves
    if ringed is not None and len(ringed.y):
        ring = Look(graph.BLACK, 0.0, marker="o", size=12.0, filled=False)
        marks.append(Curve(ringed.y, ring, ringed.label, ringed.x))
    panel = replace(panel, marks=tuple(marks))
    label = graph.labelled(*x)
    return Graph(title, label, np.zeros(0), (panel,), x_logarithmic=True, beside=True)


def _steps(band: Curve, top: float, right: float) -> Curve:
    """A line from the top down through the points of a front, and on to the right edge."""
    assert band.x is not None
    order = np.argsort(band.x)
    y = np.insert(np.repeat(band.y[order], 2), 0, top)
    x = np.append(np.repeat(band.x[order], 2), right)
    return Curve(y, Look("#c9dfee", 7.0), x=x)
