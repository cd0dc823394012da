"""The figures of a chart: what each shows, and how it is drawn.

Points over two logarithmic axes with a front through the best of them, legend beside them.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from matplotlib.path import Path
from numpy.typing import NDArray

from eigassign.chart.results import Chart, ChartPoint, DesignRun, Front, excess_over
from eigassign.output.figures.frame import Frame, axis_label, draw_frame, label_width, titled_sheet
from eigassign.output.figures.ink import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    LINE_IN,
    ORANGE,
    PURPLE,
    SKY,
    VERMILLION,
    Box,
    Sheet,
    Stroke,
    short,
)
from eigassign.output.figures.lettering import text_width
from eigassign.output.figures.plan import FigurePlan
from eigassign.output.figures.ticks import Scale, power_of_ten

# --- The figures of a chart: what each shows, and how it is drawn

Floats = NDArray[np.float64]
_LEAST_EXCESS = 1e-10  # an objective nearer to the best one is drawn there
_MARKED = ("filled: eigassign's; hollow: what people do without it; the band: nothing is both "
           "quicker and more accurate; ringed: taken by `expansion.order: auto`")  # fmt: skip


def plan(chart: Chart) -> tuple[FigurePlan, ...]:
    """The figures that this chart has something to show for, in reading order."""
    return tuple(_plans(chart))


def _plans(chart: Chart) -> Iterator[FigurePlan]:
    for each in chart.fronts:
        yield _errors(chart, each)
    if chart.mesh:
        yield _mesh(chart)
    if chart.designs:
        yield _designs(chart)


def file_name(front: Front) -> str:
    """``cost_one_trajectory.png``."""
    words = "".join(c if c.isalnum() else "_" for c in front.name)
    return f"cost_{words}.png" if front.evaluations else f"{words}.png"


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


def draw_errors(chart: Chart, front: Front) -> Sheet:
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
        "mesh.png",
        "Elements against discretisation error",
        "Worst error of exact frequencies against the limit that the meshes converge to, "
        f"extrapolated from the two finest ({finest.elements} elements).{here}{_beside(chart)}",
        "Discretisation error in Hz over the number of elements.",
        partial(draw_mesh, chart),
    )


def draw_mesh(chart: Chart) -> Sheet:
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
        "designs.png",
        "Time to a design against the objective it reaches",
        "Exact objective (mean square relative error in λ) above the best one that any method "
        f"found ({best.objective:.6g}, by {best.method}), relative to it; searches with all their "
        f"steps. What is nearer than {_LEAST_EXCESS:.0e} is drawn there.",
        "Scatter of excess objective over seconds for every way to a design.",
        partial(draw_designs, chart),
    )


def draw_designs(chart: Chart) -> Sheet:
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

_FOOT_IN, _TOP_IN, _KEY_IN, _FRAME_IN = 0.5, 0.42, 0.2, 4.2
_WHITE = (1.0, 1.0, 1.0)
_LABELS = 9  # at most, on one axis
_BELOW = 2.0  # room for a level's name below it, as a factor
_RING_IN = 0.085
_FRONT = Stroke("#c9dfee", 7.0)
_COLOURS = (BLUE, VERMILLION, GREEN, PURPLE, ORANGE, BLACK, SKY, GREY)
_SIDES = {"circle": 0, "square": 4, "triangle": 3, "diamond": -4, "pentagon": 5}


@dataclass(frozen=True)
class Ladder:
    """Like methods, joined by a line; ``ours`` is filled, others are hollow and dashed."""

    label: str
    x: Floats
    y: Floats
    ours: bool


@dataclass(frozen=True)
class Style:
    """How one ladder is drawn."""

    colour: str
    shape: str
    filled: bool


def style(number: int, ours: bool) -> Style:
    """The ``number``-th ladder of its kind: no two of a kind share colour and shape."""
    shapes = ("circle", "triangle") if ours else ("square", "diamond", "pentagon")
    shape = shapes[(number // len(_COLOURS)) % len(shapes)]
    return Style(_COLOURS[number % len(_COLOURS)], shape, ours)


def decades(values: Sequence[Floats]) -> Scale:
    """Whole decades that hold all positive ``values``, however many."""
    every = np.concatenate([np.ravel(v) for v in values] or [np.ones(1)])
    every = every[np.isfinite(every) & (every > 0.0)]
    low, high = (every.min(), every.max()) if every.size else (1.0, 1.0)
    bottom = math.floor(math.log10(low) - 0.02)
    top = max(math.ceil(math.log10(high) + 0.02), bottom + 1)
    step = 1 + (top - bottom) // _LABELS
    shown = range(bottom, top + 1, step)
    labels = tuple(f"{10.0**d:g}" if -3 <= d <= 3 else power_of_ten(d) for d in shown)
    ticks = tuple(10.0**d for d in shown)
    return Scale(10.0**bottom, 10.0**top, ticks, labels, logarithmic=True)


def scatter(
    title: str,
    x: tuple[str, str],
    y: tuple[str, str],
    ladders: Sequence[Ladder],
    front: Floats | None = None,
    levels: Sequence[tuple[str, float]] = (),
    ringed: tuple[str, Floats] | None = None,
) -> Sheet:
    """``front`` (n, 2) is drawn as steps; ``levels`` are named heights across the frame.

    ``ringed``: what the points (n, 2) with a ring around them are.
    """
    heights = [ladder.y for ladder in ladders] + [np.array([v, v / _BELOW]) for _, v in levels]
    x_scale, y_scale = decades([ladder.x for ladder in ladders]), decades(heights)
    key = _KEY_IN * (len(ladders) + (2 if ringed is None else 3))
    tall = max(_FRAME_IN, key)
    sheet = titled_sheet(_TOP_IN + tall + _FOOT_IN, title)
    left = 0.3 + label_width(y_scale)
    labels = [ladder.label for ladder in ladders] + ([] if ringed is None else [ringed[0]])
    room = 0.5 + max(text_width(label) for label in labels)
    box = (left, _FOOT_IN, sheet.width - left - room - 0.15, tall)
    frame = Frame(box, x_scale, y_scale)
    draw_frame(sheet, frame)
    _draw_levels(sheet, frame, levels)
    if front is not None and len(front):
        _draw_front(sheet, frame, front)
    styles = _styles(ladders)
    for ladder, look in reversed(list(zip(ladders, styles, strict=True))):
        _draw_ladder(sheet, frame, ladder, look)
    if ringed is not None:
        for x_at, y_at in frame.place(*ringed[1].T):
            _draw_ring(sheet, (x_at, y_at))
    _draw_key(sheet, ladders, styles, ringed, (box[0] + box[2] + 0.15, _FOOT_IN, room, tall))
    sheet.text(box[0] + box[2] / 2.0, 0.14, axis_label(*x), align="center")
    sheet.text(0.14, _FOOT_IN + tall / 2.0, axis_label(*y), upright=True)
    return sheet


def _styles(ladders: Sequence[Ladder]) -> list[Style]:
    counts = {True: 0, False: 0}
    styles = []
    for ladder in ladders:
        styles.append(style(counts[ladder.ours], ladder.ours))
        counts[ladder.ours] += 1
    return styles


def _draw_levels(sheet: Sheet, frame: Frame, levels: Sequence[tuple[str, float]]) -> None:
    left, _, width, _ = frame.box
    for name, value in levels:
        at = float(frame.place(np.array([frame.x.low]), np.array([value]))[0, 1])
        sheet.line(np.array([(left, at), (left + width, at)]), Stroke(GREY, 1.0, (3.0, 3.0)))
        sheet.text(left + 0.06, at - 0.13, short(name, 60), points=8.0)


def _draw_front(sheet: Sheet, frame: Frame, front: Floats) -> None:
    """Steps: what can be had for each cost."""
    left, bottom, width, height = frame.box
    places = frame.place(*front[np.argsort(front[:, 0])].T)
    steps = [(places[0, 0], bottom + height)]
    for (x, y), following in zip(places, [*places[1:, 0], left + width], strict=True):
        steps += [(x, y), (following, y)]
    sheet.line(np.array(steps), _FRONT, frame.box)


def _draw_ladder(sheet: Sheet, frame: Frame, ladder: Ladder, look: Style) -> None:
    left, bottom, width, height = frame.box
    clip: Box = (left - 0.08, bottom - 0.08, width + 0.16, height + 0.16)
    places = frame.place(ladder.x, ladder.y)
    if len(places) > 1:
        dashes = () if ladder.ours else (2.5, 2.0)
        sheet.line(places, Stroke(look.colour, 0.9, dashes), clip)
    for x, y in places:
        marker(sheet, (x, y), look)


def marker(sheet: Sheet, centre: tuple[float, float], look: Style) -> None:
    """One point: filled for ours, hollow for others."""
    colour = tuple(int(look.colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5))
    fill = (colour[0], colour[1], colour[2]) if look.filled else _WHITE
    sides = _SIDES[look.shape]
    if not sides:
        sheet.dot(centre, 6.0, fill, look.colour)
        return
    turn = np.pi / 4.0 if sides == 4 else np.pi / 2.0
    angles = turn + 2.0 * np.pi * np.arange(abs(sides) + 1) / abs(sides)
    corners = np.column_stack([np.cos(angles), np.sin(angles)]) * 0.052 + np.array(centre)
    sheet.area(Path(corners), fill, look.colour)


def _draw_ring(sheet: Sheet, centre: tuple[float, float]) -> None:
    angles = 2.0 * np.pi * np.arange(41) / 40.0
    round_it = np.column_stack([np.cos(angles), np.sin(angles)]) * _RING_IN + np.array(centre)
    sheet.line(round_it, Stroke(BLACK, 1.4))


def _draw_key(
    sheet: Sheet,
    ladders: Sequence[Ladder],
    styles: Sequence[Style],
    ringed: tuple[str, Floats] | None,
    box: Box,
) -> None:
    left, bottom, _, height = box
    at, headed = bottom + height - LINE_IN / 2.0, not all(ladder.ours for ladder in ladders)
    for ours, heading in ((True, "eigassign"), (False, "others")):
        if not any(ladder.ours is ours for ladder in ladders):
            continue
        if headed:
            sheet.text(left, at, heading, bold=True)
            at -= _KEY_IN
        for ladder, look in zip(ladders, styles, strict=True):
            if ladder.ours is ours:
                marker(sheet, (left + 0.1, at), look)
                sheet.text(left + 0.25, at, ladder.label)
                at -= _KEY_IN
    if ringed is not None:
        _draw_ring(sheet, (left + 0.1, at))
        sheet.text(left + 0.25, at, ringed[0])
