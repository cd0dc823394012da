"""The figures of a chart: what each shows, and how it is drawn.

Points over two logarithmic axes with a front through the best of them, legend beside them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from eigassign.chart.results import Chart, ChartPoint, DesignRun, Front, excess_over
from eigassign.output.figures import style
from eigassign.output.figures.style import BLACK, GREY, FigurePlan, labelled, short

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# --- The figures of a chart: what each shows, and how it is drawn

Floats = NDArray[np.float64]
_LEAST_EXCESS = 1e-10  # an objective nearer to the best one is drawn there
_MARKED = ("filled: eigassign's; hollow: what people do without it; the band: nothing is both "
           "quicker and more accurate; ringed: taken by `expansion.order: auto`")  # fmt: skip


def chart_figures(chart: Chart) -> tuple[FigurePlan, ...]:
    """The figures that this chart has something to show for, in reading order."""
    return tuple(_figures(chart))


def _figures(chart: Chart) -> Iterator[FigurePlan]:
    for each in chart.fronts:
        yield _errors(chart, each)
    if chart.mesh:
        yield _mesh(chart)
    if chart.designs:
        yield _designs(chart)


def file_name(front: Front) -> str:
    """``cost_one_trajectory``."""
    words = "".join(c if c.isalnum() else "_" for c in front.name)
    return f"cost_{words}" if front.evaluations else words


def _errors(chart: Chart, front: Front) -> FigurePlan:
    if front.evaluations is None:
        heading, what = "Time of one evaluation against worst error", "time of one evaluation"
    else:
        heading = f"Set-up and {front.evaluations:,.0f} evaluations against worst error"
        what = f"set-up and {front.evaluations:,.0f} evaluations"
    lost = sum(not _shown(chart, p) for p in chart.points)
    beyond = f" {lost} methods are wrong by over 100 % somewhere and not drawn." if lost else ""
    asked = chart.asked
    question = (
        f"Worst |f − f exact| over {asked.random_points} random samples of trajectory × design "
        f"box and {asked.designs} × {asked.samples_per_design} samples along the trajectory at "
        f"several designs; {_MARKED}."
    )
    return FigurePlan(
        file_name(front),
        heading,
        f"{question}{beyond}",
        f"Scatter of worst error in Hz over {what} for every method.",
        partial(draw_errors, chart, front),
    )


def _shown(chart: Chart, point: ChartPoint) -> bool:
    return point.everywhere.worst_hz <= chart.asked.typical_hz


def cost(point: ChartPoint, front: Front) -> float:
    """Seconds that a front counts."""
    if front.evaluations is None:
        return point.online.median_s
    return point.total_s(front.evaluations)


def draw_errors(chart: Chart, front: Front) -> Figure:
    """Every method by family, the front through the best."""

    floor = chart.asked.floor_hz

    def places(points: Sequence[ChartPoint]) -> Floats:
        at = [(cost(p, front), max(p.everywhere.worst_hz, floor)) for p in points]
        return np.array(at).reshape(-1, 2)

    known = {p.method: p for p in chart.points}
    best = [known[name] for name in front.methods if _shown(chart, known[name])]
    taken = {a.auto.method for a in chart.advice if a.auto is not None}
    ringed = [p for p in chart.points if p.method in taken and _shown(chart, p)]
    title = "Time of one evaluation" if front.evaluations is None else front.name.capitalize()
    return scatter(
        f"{title} against worst error",
        ("time", "s"),
        ("worst error", "Hz"),
        ladders(chart, front),
        places(best),
        [("disagreement of two exact solvers", floor)],
        ("taken by order: auto", places(ringed)) if ringed else None,
    )


def ladders(chart: Chart, front: Front) -> list[Ladder]:
    """The points by family, eigassign's first, in the order in which they were charted."""

    alone = front.evaluations is None  # what is set up anew for every design has no part in that
    able = [p for p in chart.points if _shown(chart, p) and not (alone and p.at_once > 1)]
    families = dict.fromkeys(p.family for p in sorted(able, key=lambda p: not p.ours))
    made = []
    for family in families:
        mine = [p for p in able if p.family == family]
        x = np.array([cost(p, front) for p in mine])
        y = np.array([max(p.everywhere.worst_hz, chart.asked.floor_hz) for p in mine])
        made.append(Ladder(family, x, y, mine[0].ours))
    return made


def _mesh(chart: Chart) -> FigurePlan:
    finest = chart.mesh[-1]
    own = next((row for row in chart.mesh if row.factor == 1.0), None)
    here = (
        f" The case's own mesh ({own.elements} elements) is {own.worst_hz:.3g} Hz from the limit."
        if own
        else ""
    )
    return FigurePlan(
        "mesh",
        "Elements against discretisation error",
        "Worst error of exact frequencies against the limit that the meshes converge to, "
        f"extrapolated from the two finest ({finest.elements} elements).{here}{_beside(chart)}",
        "Discretisation error in Hz over the number of elements.",
        partial(draw_mesh, chart),
    )


def draw_mesh(chart: Chart) -> Figure:
    """Error over elements, with the approximation error beside it."""

    rows = [row for row in chart.mesh if row.worst_hz > 0.0]
    counts, off = np.array([r.elements for r in rows], float), np.array([r.worst_hz for r in rows])
    solve = np.array([r.solve.median_s for r in rows])
    return scatter(
        "Elements against discretisation error",
        ("elements", ""),
        ("worst error [Hz], time [s]", ""),
        [
            Ladder("worst error [Hz]", counts, off, True),
            Ladder("time of an exact solve [s]", counts, solve, True),
        ],
        None,
        _taylor_level(chart),
    )


def _beside(chart: Chart) -> str:
    """What the caption says of the Taylor expansion's error."""
    taylor = _taylor(chart.points)
    if taylor is None:
        return ""
    if not _shown(chart, taylor):
        return (
            f" {taylor.method} is wrong by over 100 % somewhere at the case's mesh, and not drawn."
        )
    return f" The dashed line is the error of {taylor.method} at the case's mesh."


def _taylor_level(chart: Chart) -> list[tuple[str, float]]:
    taylor = _taylor(chart.points)
    if taylor is None or not _shown(chart, taylor):
        return []
    return [(f"error of {taylor.method}", max(taylor.everywhere.worst_hz, chart.asked.floor_hz))]


def _taylor(points: Sequence[ChartPoint]) -> ChartPoint | None:
    """The Taylor polynomial of order 4, or the highest below."""
    full = [p for p in points if p.family == "Taylor, full" and p.parameters["order"] <= 4]
    return max(full, key=lambda p: int(p.parameters["order"]), default=None)


def _designs(chart: Chart) -> FigurePlan:
    best = min(chart.designs, key=lambda run: run.objective)
    return FigurePlan(
        "designs",
        "Time to a design against the objective it reaches",
        "Exact objective (mean square relative error in λ) above the best one that any method "
        f"found ({best.objective:.6g}, by {best.method}), relative to it; searches with all their "
        f"steps. What is nearer than {_LEAST_EXCESS:.0e} is drawn there.",
        "Scatter of excess objective over seconds for every way to a design.",
        partial(draw_designs, chart),
    )


def draw_designs(chart: Chart) -> Figure:
    """Single answers as points, searches as ladders of their improvements."""

    best = min(run.objective for run in chart.designs)
    made = []
    for run in sorted(chart.designs, key=lambda run: not run.ours):
        seconds, values = _steps(run)
        excess = np.maximum([excess_over(best, value) for value in values], _LEAST_EXCESS)
        made.append(Ladder(run.method, seconds, excess, run.ours))
    x, y = ("time", "s"), ("objective above the best", "relative")
    return scatter("Time to a design against the objective it reaches", x, y, made)


def _steps(run: DesignRun) -> tuple[Floats, Floats]:
    if not run.trace:
        return np.array([run.seconds.median_s]), np.array([run.objective])
    trace = np.array(run.trace)
    return trace[:, 0], trace[:, 1]


# --- Points over two logarithmic axes with a front through the best of them, legend beside them

_TALL_IN, _KEY_IN = 4.9, 0.2  # of the figure, and of a line of its legend
_COLOURS = (*style.SERIES[:5], BLACK, style.SKY, GREY)
_MARKERS = {True: ("o", "^"), False: ("s", "D", "p")}
_RING: dict[str, Any] = {
    "linestyle": "none", "marker": "o", "markersize": 12.0, "markerfacecolor": "none",
    "markeredgecolor": BLACK, "markeredgewidth": 1.4, "zorder": 4.0,
}  # fmt: skip


@dataclass(frozen=True)
class Ladder:
    """Like methods, joined by a line; ``ours`` is filled, others are hollow and dashed."""

    label: str
    x: Floats
    y: Floats
    ours: bool


def ladder_style(number: int, ours: bool) -> dict[str, Any]:
    """The ``number``-th ladder of its kind: no two of a kind share colour and shape."""
    markers, colour = _MARKERS[ours], _COLOURS[number % len(_COLOURS)]
    return {
        "color": colour,
        "linewidth": 0.9,
        "linestyle": "solid" if ours else (0, (2.5, 2.0)),
        "marker": markers[number // len(_COLOURS) % len(markers)],
        "markersize": 6.0,
        "markerfacecolor": colour if ours else "white",
        "markeredgewidth": 0.8,
    }


def scatter(
    title: str,
    x: tuple[str, str],
    y: tuple[str, str],
    ladders: Sequence[Ladder],
    front: Floats | None = None,
    levels: Sequence[tuple[str, float]] = (),
    ringed: tuple[str, Floats] | None = None,
) -> Figure:
    """``front`` (n, 2) is drawn as steps; ``levels`` are named heights across the axes.

    ``ringed``: what the points (n, 2) with a ring around them are.
    """
    figure = style.new_figure(title, max(_TALL_IN, _KEY_IN * (len(ladders) + 4) + 0.4))
    axes = figure.subplots()
    axes.set(xlabel=labelled(*x), ylabel=labelled(*y))
    x_limits = style.decades([ladder.x for ladder in ladders])
    heights = [ladder.y for ladder in ladders]
    y_limits = style.decades([*heights, *(np.array([v, v / 2.0]) for _, v in levels)])
    style.logarithmic(axes, "x", x_limits)
    style.logarithmic(axes, "y", y_limits)
    for name, value in levels:
        axes.axhline(value, color=GREY, linewidth=1.0, linestyle=(0, (3.0, 3.0)), zorder=1.5)
        axes.annotate(
            short(name, 60), (x_limits[0], value), (4.0, -4.0), textcoords="offset points",
            va="top", size=style.SMALL_PT,
        )  # fmt: skip
    if front is not None and len(front):
        along, best = front[np.argsort(front[:, 0])].T
        steps = np.append(along, x_limits[1]), np.append(best, best[-1])
        axes.step(*steps, where="post", color="#c9dfee", linewidth=7.0, zorder=1.6)
        axes.vlines(along[0], best[0], y_limits[1], color="#c9dfee", linewidth=7.0, zorder=1.6)
    handles: dict[bool, list[Any]] = {True: [], False: []}
    for ladder in ladders:
        look = ladder_style(len(handles[ladder.ours]), ladder.ours)
        above = 3.0 - 1e-3 * sum(map(len, handles.values()))  # the first ones lie on top
        (line,) = axes.plot(
            ladder.x, np.maximum(ladder.y, y_limits[0]), **look, zorder=above,
            label=short(ladder.label), clip_on=False,
        )  # fmt: skip
        handles[ladder.ours].append(line)
    rings = [] if ringed is None else axes.plot(*ringed[1].T, **_RING, label=ringed[0])
    _add_key(figure, handles, rings)
    return figure


def _add_key(figure: Figure, handles: dict[bool, list[Any]], rings: Sequence[Any]) -> None:
    """The legend at the right: eigassign's ladders, then the others, then the rings."""
    from matplotlib.lines import Line2D

    entries: list[Any] = []
    for ours, heading in ((True, "eigassign"), (False, "others")):
        if handles[ours] and handles[False]:
            entries.append(Line2D([], [], linestyle="none", label=heading))
        entries += handles[ours]
    key = figure.legend(handles=[*entries, *rings], loc="outside right upper", handlelength=1.6)
    for entry, text in zip([*entries, *rings], key.get_texts(), strict=True):
        if entry not in handles[True] and entry not in handles[False] and entry not in rings:
            text.set_fontweight("bold")
