"""The figures of a chart: time against error on each front, elements, and ways to a design.

Every figure is a scatter over two logarithmic axes. Methods that differ by a setting are joined by
a line: eigassign's filled, the others hollow and dashed. A colour is a kind of method; the legend
names the kinds. A broad band joins the methods that no other beats.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import cycle

import numpy as np
from numpy.typing import NDArray

from eigassign.chart.results import Chart, ChartPoint, Front, excess_over
from eigassign.output.figures import graph
from eigassign.output.figures.graph import (
    BLACK,
    GREY,
    Curve,
    FigurePlan,
    Graph,
    Look,
    Mark,
    Panel,
    Rule,
    labelled,
)

Floats = NDArray[np.float64]
LEAST_EXCESS = 1e-10  # an objective nearer to the best one is drawn there
_KINDS = (  # of methods whose family begins so; the first that fits
    ("Taylor", "series of λ"),
    ("1/λ", "series of 1/λ"),
    ("reduced", "reduced models"),
    ("fit", "fits"),
    ("exact by others", "exact solves by others"),
    ("exact", "exact solves"),
    ("", "interpolation and surrogates"),
)
COLOURS = (*graph.SERIES[:5], BLACK, graph.SKY, GREY)
BAND = Look("#c9dfee", 7.0)
RING = Look(BLACK, 0.0, marker="o", size=12.0, filled=False)
LEVEL = Look(GREY, 1.0, "fine")


def chart_figures(chart: Chart) -> tuple[FigurePlan, ...]:
    """The figures that this chart has something to show for, in reading order."""
    plans = [_front(chart, each) for each in chart.fronts]
    if chart.mesh:
        plans.append(_mesh(chart))
    if chart.designs:
        plans.append(_designs(chart))
    return tuple(plans)


# --- A front


def _front(chart: Chart, front: Front) -> FigurePlan:
    words = "".join(c if c.isalnum() else "_" for c in front.name)
    if front.evaluations is None:
        name, what = words, "time of one evaluation"
    else:
        name, what = f"cost_{words}", f"set-up and {front.evaluations:,.0f} evaluations"
    lost = sum(not _is_shown(chart, p) for p in chart.points)
    verb = "method is" if lost == 1 else "methods are"
    beyond = f" {lost} {verb} wrong by over 100 % somewhere and not drawn." if lost else ""
    asked = chart.asked
    return FigurePlan(
        name,
        f"{what[0].upper()}{what[1:]} against worst error",
        f"Worst |f − f exact| over {asked.random_points} random samples of trajectory × design "
        f"box and {asked.designs} × {asked.samples_per_design} samples along the trajectory at "
        "several designs. Filled: eigassign's; hollow: what people do without it; the band: no "
        "charted method is both quicker and more accurate; ringed: taken by "
        f"`expansion.order: auto`.{beyond}",
        f"Scatter of worst error in Hz over {what} for every method.",
        _points(chart, front),
    )


def _kind(family: str) -> str:
    return next(kind for beginning, kind in _KINDS if family.startswith(beginning))


def _is_shown(chart: Chart, point: ChartPoint) -> bool:
    """Whether it is wrong by less than 100 % everywhere."""
    return point.everywhere.worst_hz <= chart.asked.typical_hz


def _points(chart: Chart, front: Front) -> Graph:
    """Every method by family, eigassign's first, and the front through the best."""
    floor = chart.asked.floor_hz
    shown = [p for p in chart.points if _is_shown(chart, p)]
    # what is set up anew for every design has no part in the front of single evaluations
    able = [p for p in shown if p.at_once == 1 or front.evaluations is not None]

    def places(points: Sequence[ChartPoint]) -> Floats:
        at = [(front.cost_s(p), max(p.everywhere.worst_hz, floor)) for p in points]
        return np.array(at).reshape(-1, 2)

    families: dict[str, list[ChartPoint]] = {}
    for point in sorted(able, key=lambda p: not p.ours):
        families.setdefault(point.family, []).append(point)
    taken = {a.auto.method for a in chart.advice if a.auto is not None}
    ringed = places([p for p in shown if p.method in taken])
    what = "Time of one evaluation" if front.evaluations is None else front.name.capitalize()
    return scatter(
        f"{what} against worst error",
        ("time", "s"),
        ("worst error", "Hz"),
        [
            MethodLine(
                _kind(family),
                places(own)[:, 0],
                places(own)[:, 1],
                own[0].ours,
                tuple(each.method for each in own),
            )
            for family, own in families.items()
        ],
        band=places([p for p in shown if p.method in front.methods]),
        level=("round-off of exact solves", floor),
        ringed=("taken by order: auto", ringed) if len(ringed) else None,
    )


# --- Elements


def _mesh(chart: Chart) -> FigurePlan:
    own = next((row for row in chart.mesh if row.factor == 1.0), None)
    here, beside = "", ""
    if own is not None:
        here = (
            f" The case's own mesh ({own.elements} elements) is {own.worst_hz:.3g} Hz from the "
            "limit."
        )
    taylor = _taylor(chart)
    if taylor is not None and _is_shown(chart, taylor):
        beside = f" The dashed line is the error of {taylor.method} at the case's mesh."
    elif taylor is not None:
        beside = (
            f" {taylor.method} is wrong by over 100 % somewhere at the case's mesh, and not drawn."
        )
    return FigurePlan(
        "mesh",
        "Elements against discretisation error",
        "Worst error of exact frequencies against the limit that the meshes converge to, "
        f"extrapolated from the two finest ({chart.mesh[-1].elements} elements).{here}{beside}",
        "Discretisation error in Hz over the number of elements.",
        _meshes(chart),
    )


def _taylor(chart: Chart) -> ChartPoint | None:
    """The Taylor polynomial of order 4, or the highest below."""
    full = [p for p in chart.points if p.family == "Taylor, full" and p.parameters["order"] <= 4]
    return max(full, key=lambda p: int(p.parameters["order"]), default=None)


def _meshes(chart: Chart) -> Graph:
    """Error over elements, with the error of the expansion beside it; below, time over elements."""
    rows = [row for row in chart.mesh if row.worst_hz > 0.0]
    counts = np.array([float(r.elements) for r in rows])
    level, taylor = None, _taylor(chart)
    if taylor is not None and _is_shown(chart, taylor):
        error = max(taylor.everywhere.worst_hz, chart.asked.floor_hz)
        level = (f"error of {taylor.method}", error)
    errors = np.array([r.worst_hz for r in rows])
    times = np.array([r.solve.median_s for r in rows])
    title, x = "Elements against discretisation error", ("elements", "")
    above = scatter(
        title, x, ("worst error", "Hz"), [MethodLine("", counts, errors, True)], level=level
    )
    below = scatter(title, x, ("exact solve", "s"), [MethodLine("", counts, times, True)])
    panels = (*above.panels, replace(below.panels[0], height=2.0))
    return replace(above, panels=panels)


# --- Designs


def _designs(chart: Chart) -> FigurePlan:
    best = min(chart.designs, key=lambda run: run.objective)
    return FigurePlan(
        "designs",
        "Time to a design against the objective it reaches",
        "Exact objective (mean square of f/f_d − 1) above the best one that any method "
        f"found ({best.objective:.6g}, by {best.method}), relative to it; searches with all their "
        f"steps. What is nearer than {LEAST_EXCESS:.0e} is drawn there.",
        "Scatter of excess objective over seconds for every way to a design.",
        _searches(chart),
    )


def _searches(chart: Chart) -> Graph:
    """Single answers as points, searches as lines of their improvements."""
    best = min(run.objective for run in chart.designs)
    lines = []
    for run in sorted(chart.designs, key=lambda run: not run.ours):
        steps = run.trace or ((run.seconds.median_s, run.objective),)
        excess = [max(excess_over(best, value), LEAST_EXCESS) for _, value in steps]
        seconds = np.array([at for at, _ in steps])
        lines.append(MethodLine(run.method, seconds, np.array(excess), run.ours))
    x, y = ("time", "s"), ("objective above the best", "relative")
    return scatter("Time to a design against the objective it reaches", x, y, lines)


# --- The scatter


@dataclass(frozen=True, eq=False)
class MethodLine:
    """Like methods, joined by a line; ``ours`` is filled, others are hollow and dashed.

    Lines of one ``label`` look alike; ``names`` are those of the points.
    """

    label: str
    x: Floats
    y: Floats
    ours: bool
    names: tuple[str, ...] = ()


def _looks(lines: Sequence[MethodLine]) -> dict[str, Look]:
    """Of each label: eigassign's and the others' take colours from opposite ends."""
    looks: dict[str, Look] = {}
    for ours, colours in ((True, COLOURS), (False, COLOURS[::-1])):
        labels = dict.fromkeys(line.label for line in lines if line.ours is ours)
        dash, marker = ("solid", "o") if ours else ("fine", "s")
        for label, colour in zip(labels, cycle(colours), strict=False):
            looks[label] = Look(colour, 0.9, dash, marker, 6.0, ours)
    return looks


def scatter(
    title: str,
    x: tuple[str, str],
    y: tuple[str, str],
    lines: Sequence[MethodLine],
    band: Floats | None = None,
    level: tuple[str, float] | None = None,
    ringed: tuple[str, Floats] | None = None,
) -> Graph:
    """``lines`` over the axes ``x``, ``y`` (name, unit), with a legend beside them.

    ``band`` (n, 2) is drawn as steps, ``level`` is a named height across the axes, and ``ringed``
    says what the points (n, 2) with a ring around them are.
    """
    curves: list[Curve] = []
    looks = _looks(lines)
    for ours, group in ((False, "others"), (True, "eigassign")):
        named = set[str]()
        for line in lines:
            if line.ours is ours:
                label = "" if line.label in named else line.label
                named.add(line.label)
                look = looks[line.label]
                curves.append(Curve(line.y, look, label, line.x, "", group, line.names))
    holds = () if level is None else (np.array([level[1], level[1] / 2.0]),)  # room for its name
    panel = Panel(labelled(*y), tuple(curves), 3.8, True, None, holds)
    marks: list[Mark] = []
    if level is not None:
        marks.append(Rule(level[1], LEVEL, note=level[0]))
    if band is not None and len(band):
        right = graph.decades([line.x for line in lines])[1]
        marks.append(_steps(band, panel.limits[1], right))
    marks += panel.curves
    if ringed is not None:
        marks.append(Curve(ringed[1][:, 1], RING, ringed[0], ringed[1][:, 0]))
    return Graph(
        title=title,
        x_label=labelled(*x),
        x=np.zeros(0),
        panels=(replace(panel, marks=tuple(marks)),),
        x_logarithmic=True,
        beside=True,
    )


def _steps(band: Floats, top: float, right: float) -> Curve:
    """From the top down through the points (n, 2) of a front, and on to the right edge."""
    along, best = band[np.argsort(band[:, 0])].T
    y = np.insert(np.repeat(best, 2), 0, top)
    return Curve(y, BAND, x=np.append(np.repeat(along, 2), right))
