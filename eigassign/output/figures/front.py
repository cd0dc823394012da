"""The figures of a chart: time against error on each front, elements, and ways to a design.

Every figure is a scatter over two logarithmic axes. Like methods are joined by a line: eigassign's
filled, the others hollow and dashed. A broad band joins the methods that no other beats.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from eigassign.chart.results import Chart, ChartPoint, Front, excess_over
from eigassign.output.figures import style
from eigassign.output.figures.style import BLACK, GREY, FigurePlan, labelled, short

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]
LEAST_EXCESS = 1e-10  # an objective nearer to the best one is drawn there
BAND = "#c9dfee"
LEGEND_LETTERS = 46  # the longest name of a method has 43
TALL_IN, KEY_IN = 4.9, 0.2  # of the figure, and of a line of its legend
COLOURS = (*style.SERIES[:5], BLACK, style.SKY, GREY)
MARKERS = {True: ("o", "^"), False: ("s", "D", "p")}
RING: dict[str, Any] = {
    "linestyle": "none", "marker": "o", "markersize": 12.0, "markerfacecolor": "none",
    "markeredgecolor": BLACK, "markeredgewidth": 1.4, "zorder": 4.0,
}  # fmt: skip


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
        partial(_draw_front, chart, front),
    )


def _is_shown(chart: Chart, point: ChartPoint) -> bool:
    """Whether it is wrong by less than 100 % everywhere."""
    return point.everywhere.worst_hz <= chart.asked.typical_hz


def _draw_front(chart: Chart, front: Front) -> Figure:
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
            MethodLine(name, places(own)[:, 0], places(own)[:, 1], own[0].ours)
            for name, own in families.items()
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
        partial(_draw_mesh, chart),
    )


def _taylor(chart: Chart) -> ChartPoint | None:
    """The Taylor polynomial of order 4, or the highest below."""
    full = [p for p in chart.points if p.family == "Taylor, full" and p.parameters["order"] <= 4]
    return max(full, key=lambda p: int(p.parameters["order"]), default=None)


def _draw_mesh(chart: Chart) -> Figure:
    """Error and time over elements, with the error of the expansion beside them."""
    rows = [row for row in chart.mesh if row.worst_hz > 0.0]
    counts = np.array([float(r.elements) for r in rows])
    level, taylor = None, _taylor(chart)
    if taylor is not None and _is_shown(chart, taylor):
        error = max(taylor.everywhere.worst_hz, chart.asked.floor_hz)
        level = (f"error of {taylor.method}", error)
    solve = np.array([r.solve.median_s for r in rows])
    return scatter(
        "Elements against discretisation error",
        ("elements", ""),
        ("worst error [Hz], time [s]", ""),
        [
            MethodLine("worst error [Hz]", counts, np.array([r.worst_hz for r in rows]), True),
            MethodLine("time of an exact solve [s]", counts, solve, True),
        ],
        level=level,
    )


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
        partial(_draw_designs, chart),
    )


def _draw_designs(chart: Chart) -> Figure:
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
    """Like methods, joined by a line; ``ours`` is filled, others are hollow and dashed."""

    label: str
    x: Floats
    y: Floats
    ours: bool


def line_style(number: int, ours: bool) -> dict[str, Any]:
    """The ``number``-th line of its kind: no two of a kind share colour and marker."""
    markers, colour = MARKERS[ours], COLOURS[number % len(COLOURS)]
    return {
        "color": colour,
        "linewidth": 0.9,
        "linestyle": "solid" if ours else (0, (2.5, 2.0)),
        "marker": markers[number // len(COLOURS) % len(markers)],
        "markersize": 6.0,
        "markerfacecolor": colour if ours else "white",
        "markeredgewidth": 0.8,
    }


def scatter(
    title: str,
    x: tuple[str, str],
    y: tuple[str, str],
    lines: Sequence[MethodLine],
    band: Floats | None = None,
    level: tuple[str, float] | None = None,
    ringed: tuple[str, Floats] | None = None,
) -> Figure:
    """``lines`` over the axes ``x``, ``y`` (name, unit), with a legend beside them.

    ``band`` (n, 2) is drawn as steps, ``level`` is a named height across the axes, and ``ringed``
    says what the points (n, 2) with a ring around them are.
    """
    from matplotlib.lines import Line2D

    figure = style.new_figure(title, max(TALL_IN, KEY_IN * (len(lines) + 4) + 0.4))
    axes = figure.subplots()
    axes.set(xlabel=labelled(*x), ylabel=labelled(*y))
    heights = [line.y for line in lines]
    if level is not None:
        heights.append(np.array([level[1], level[1] / 2.0]))  # with room for its name
    x_limits, y_limits = style.decades([line.x for line in lines]), style.decades(heights)
    style.logarithmic(axes, "x", x_limits)
    style.logarithmic(axes, "y", y_limits)
    if level is not None:
        axes.axhline(level[1], color=GREY, linewidth=1.0, linestyle=(0, (3.0, 3.0)), zorder=1.5)
        axes.annotate(
            short(level[0], 60), (x_limits[0], level[1]), (4.0, -4.0), textcoords="offset points",
            va="top", size=style.SMALL_PT,
        )  # fmt: skip
    if band is not None and len(band):
        along, best = band[np.argsort(band[:, 0])].T
        steps = np.append(along, x_limits[1]), np.append(best, best[-1])
        axes.step(*steps, where="post", color=BAND, linewidth=7.0, zorder=1.6)
        axes.vlines(along[0], best[0], y_limits[1], color=BAND, linewidth=7.0, zorder=1.6)
    handles: dict[bool, list[Any]] = {True: [], False: []}
    for line in lines:
        above = 3.0 - 1e-3 * sum(map(len, handles.values()))  # the first ones lie on top
        look = line_style(len(handles[line.ours]), line.ours)
        handles[line.ours] += axes.plot(
            line.x, np.maximum(line.y, y_limits[0]), **look, zorder=above,
            label=short(line.label, LEGEND_LETTERS), clip_on=False,
        )  # fmt: skip
    entries: list[Any] = [*handles[True], *handles[False]]
    headed = bool(handles[True] and handles[False])
    if headed:
        ours, others = (Line2D([], [], linestyle="none", label=k) for k in ("eigassign", "others"))
        entries = [ours, *handles[True], others, *handles[False]]
    if ringed is not None:
        entries += axes.plot(*ringed[1].T, **RING, label=ringed[0])
    key = figure.legend(handles=entries, loc="outside right upper", handlelength=1.6)
    for place in (0, 1 + len(handles[True])) if headed else ():
        key.get_texts()[place].set_fontweight("bold")
    return figure
