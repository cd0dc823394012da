"""The mechanism in several poses with the path of its tip (the paper's Figures 1 and 2).

From the bottom up: a parallel projection of a plane or of space on the sheet; a drawing at one
scale in all directions; the parts of the scene on it; the figure of the poses.
Symbols are measured in inches on the sheet, places in m; `scene` has both.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise, product
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from eigassign.output.figures import graph, scene, style
from eigassign.output.figures.graph import BLACK, GREY, FigurePlan, short
from eigassign.output.figures.scene import Part, Shape
from eigassign.study.results import DrawnPoses

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]
Box = tuple[float, float, float, float]  # left, bottom, width, height in inches
THINNEST, CASING = 1.3, 1.6  # points of the thinnest line; of what is left free around it

# --- A parallel projection

_ELEVATIONS = np.radians([22.0, 50.0])
_AZIMUTHS = np.radians([-60.0, -30.0, -90.0, -120.0, -5.0, -150.0])  # of the viewer


@dataclass(frozen=True)
class View:
    """A parallel projection: rows are the sheet's directions across and up, in world axes."""

    directions: Floats  # (2, d)

    def flat(self, points: Floats) -> Floats:
        """(…, d) → (…, 2) in the same unit."""
        return np.asarray(points @ self.directions.T)

    @property
    def spatial(self) -> bool:
        """True of a view of space."""
        return bool(self.directions.shape[1] == 3)


def view_of(points: Floats) -> View:
    """A plane as it is; space with z upright, by a viewer far away who faces the motion.

    The first view that shows 85 % of the best one's area; what is nearly a line on the sheet counts
    by its length. From high above only what is flat on the floor is seen better.
    """
    if points.shape[1] == 2:
        return View(np.eye(2))
    views, seen = [], []
    for elevation, azimuth in product(_ELEVATIONS, _AZIMUTHS):
        c, s, low, high = *_turned(azimuth), *_turned(elevation)[::-1]
        views.append(View(np.array([[-s, c, 0.0], [-low * c, -low * s, high]])))
        flat = views[-1].flat(points)
        long, wide = np.linalg.svd(flat - flat.mean(axis=0), compute_uv=False)
        seen.append(long * max(wide, 0.2 * long))
    return next(v for v, area in zip(views, seen, strict=True) if area >= 0.85 * max(seen))


def _turned(angle: float) -> tuple[float, float]:
    return float(np.cos(angle)), float(np.sin(angle))


# --- A drawing at one scale in all directions


@dataclass(frozen=True)
class Extent:
    """The box in the view, m, that holds some points; never without width and height both."""

    view: View
    middle: Floats  # (2,)
    size: Floats  # (2,) width and height
    thick: float  # of the thickest link

    def drawing(self, figure: Figure, box: Box, room: float = 1.0, grain: float = 1.0) -> Drawing:
        """Axes at ``box`` of the figure that show it in their middle, ``room`` times as large."""
        inside = np.array(box[2:])
        per_inch = room * float(np.max(self.size / inside))
        sheet = np.tile(figure.get_size_inches(), 2)
        axes = figure.add_axes(tuple(np.array(box) / sheet))
        low, high = (self.middle + side * per_inch * inside / 2.0 for side in (-1.0, 1.0))
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
        larger = float(np.clip(self.thick / per_inch / scene.SYMBOL_IN, 1.0, scene.LARGEST))
        return Drawing(axes, self.view, per_inch, grain, larger * grain)


def extent(poses: DrawnPoses, others: Iterable[Floats] = ()) -> Extent:
    """The extent of these poses and other points in the view that suits the poses."""
    shown = points_of(poses)
    view = view_of(shown)
    flat = view.flat(np.concatenate([shown, *others]))
    low, high = flat.min(axis=0), flat.max(axis=0)
    thick = scene.thickest(poses)
    size = high - low + thick
    size = np.maximum(size, 0.02 * float(np.max(size)) or 1.0)
    return Extent(view, 0.5 * (low + high), size, thick)


def points_of(poses: DrawnPoses) -> Floats:
    """Everything that a drawing of these poses has to hold, (n, d)."""
    parts = [line for lines in poses.lines for line in lines]
    parts += [body.places for body in poses.bodies]
    parts += [joint.places for joint in poses.joints]
    parts += [] if poses.tip_path is None else [poses.tip_path]
    every = np.concatenate(parts)
    return every[np.isfinite(every).all(axis=1)]


@dataclass(frozen=True)
class Drawing:
    """Axes on which places are drawn; ``grain`` is the size of letters, 1 in a full figure.

    That of symbols is ``larger``, beside thick links.
    What is drawn later lies above what was drawn before, whatever it is.
    """

    axes: Axes
    view: View
    per_inch: float  # m
    grain: float = 1.0
    larger: float = 1.0

    @property
    def inch(self) -> float:
        """An inch of a symbol, m."""
        return self.per_inch * self.larger

    def symbol(self, at: Floats, shape: Floats) -> Floats:
        """A shape (n, 2) in inches around the flat place ``at``, in m."""
        return np.asarray(at + self.inch * shape)

    def heading(self, direction: Floats) -> Floats:
        """Unit vector on the sheet of a direction; across where it points at the viewer."""
        flat = self.view.flat(direction)
        length = float(np.linalg.norm(flat))
        return flat / length if length > 0.05 * np.linalg.norm(direction) else np.array([1.0, 0.0])

    def line(self, points: Floats, colour: str, width: float, **look: Any) -> Artist:
        """A polyline through flat points (n, 2), width in points; NaN interrupts it."""
        (line,) = self.axes.plot(
            *points.T, color=colour, linewidth=width, zorder=2.0, clip_on=False, **look
        )
        return line

    def dots(self, places: Floats, diameter: float, edge: str, fill: str) -> None:
        """Circles at flat places (n, 2), diameter in points."""
        self.axes.plot(
            *places.T, "o", markersize=diameter * self.larger, markeredgecolor=edge,
            markerfacecolor=fill, markeredgewidth=0.8, zorder=2.0, clip_on=False,
        )  # fmt: skip

    def area(self, corners: Floats, edge: str, fill: str) -> None:
        """A filled polygon."""
        self.axes.fill(
            *corners.T, edgecolor=edge, facecolor=fill, linewidth=0.8, zorder=2.0, clip_on=False
        )


# --- The parts of the scene

LOOK = {"body": graph.VERMILLION, "spring": graph.GREEN, "ground": GREY}  # others: as the pose
_GROUND = "#e6e6e6"


def draw(
    drawing: Drawing, shown: Iterable[Part], pose: int, colour: str, look: Mapping[str, str] = LOOK
) -> None:
    """The parts in one pose, in ``colour`` but for the roles in ``look``."""
    for part in shown:
        draw_part(drawing, part, min(pose, len(part.places) - 1), look.get(part.role, colour))


def of_roles(shown: Iterable[Part], *roles: str) -> list[Part]:
    """The parts of these roles."""
    return [part for part in shown if part.role in roles]


def draw_part(drawing: Drawing, part: Part, pose: int, colour: str) -> None:
    """One part in one pose."""
    places = drawing.view.flat(part.places[pose])
    if part.kind == "line":
        _draw_thick(drawing, places, part.ends, colour)
    elif part.kind == "spring":
        zigzag = scene.zigzagged((places[1] - places[0]) / drawing.inch)
        drawing.line(drawing.symbol(places[0], zigzag), colour, 1.1)
    elif part.kind == "rail":
        assert part.axes is not None
        along = drawing.heading(part.axes[0])
        along = -along if along[0] < 0.0 else along  # so that the strokes are below it
        half = 0.5 * float(np.linalg.norm(places[1] - places[0])) / drawing.inch + 0.2
        rail = _aligned(scene.hatched(half) + np.array([0.0, -0.09]), along)
        drawing.line(drawing.symbol(places.mean(axis=0), rail), colour, 0.8)
    else:
        turned = None if part.axes is None else drawing.heading(part.axes[pose])
        for shape in part.shapes:
            _draw_shape(drawing, places[0], shape, turned, colour)


def _draw_shape(
    drawing: Drawing, at: Floats, shape: Shape, along: Floats | None, colour: str
) -> None:
    fill = {"own": colour, "page": "white", "ground": _GROUND, "": "none"}[shape.fill]
    if shape.dot:
        drawing.dots(at[None], shape.dot, colour, fill)
        return
    points = shape.points if along is None else _aligned(shape.points, along)
    placed = drawing.symbol(at, points)
    if shape.fill:
        drawing.area(placed, colour, fill)
    else:
        drawing.line(placed, colour, shape.width)


def _aligned(points: Floats, along: Floats) -> Floats:
    """Points (n, 2), their first direction turned to a unit vector."""
    return np.asarray(points @ np.array([along, [-along[1], along[0]]]))


def _draw_thick(drawing: Drawing, flat: Floats, ends: tuple[float, float], colour: str) -> None:
    """A line as thick as its section, but no hair; a taper in eight pieces."""
    from matplotlib.collections import LineCollection

    if len(flat) < 2 or not np.ptp(flat, axis=0).any():
        return
    start, end = (max(72.0 * thick / drawing.per_inch, THINNEST) for thick in ends)
    own, count = np.linspace(0.0, 1.0, len(flat)), 1 if start == end else 8
    pieces, widths = [], []
    for low, high in pairwise(np.linspace(0.0, 1.0, count + 1)):
        at = np.linspace(low, high, 1 + max(1, len(flat) // count)) if count > 1 else own
        pieces.append(np.column_stack([np.interp(at, own, column) for column in flat.T]))
        widths.append(start + (end - start) * 0.5 * (low + high))
    for colours, wider in (
        ("white", CASING),
        (colour, 0.0),
    ):  # so that links that cross are told apart
        drawing.axes.add_collection(
            LineCollection(
                pieces, colors=colours, linewidths=wider * drawing.grain + np.array(widths),
                capstyle="round", joinstyle="round", zorder=2.0, clip_on=False,
            ),
            autolim=False,
        )  # fmt: skip


def draw_bearings(figure: Figure, drawing: Drawing, left: float, bottom: float) -> None:
    """The axes' directions, and a bar of round length as scale, from (left, bottom) inches."""
    width, height = figure.get_size_inches()
    sheet = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    sheet.set(xlim=(0.0, width), ylim=(0.0, height))
    sheet.set_axis_off()
    inset = (0.2, 0.24) if drawing.view.spatial else (0.08, 0.12)
    origin = np.add((left, bottom), inset)
    for axis, name in zip(np.eye(drawing.view.directions.shape[1]), "xyz", strict=False):
        end = origin + 0.3 * drawing.grain * drawing.view.flat(axis)
        sheet.plot(*np.array([origin, end]).T, color=GREY, linewidth=1.0)
        x, y = end + 0.09 * drawing.heading(axis)
        sheet.text(x, y, name, ha="center", va="center", size=style.SMALL_PT)
    length, start, y = round_length(drawing.per_inch), left + 0.75, bottom + 0.12
    end = start + length / drawing.per_inch
    sheet.plot([start, end], [y, y], "|-", color=BLACK, linewidth=1.0, markersize=4.5)
    sheet.text(end + 0.08, y, length_label(length), va="center", size=style.SMALL_PT)


def round_length(most: float) -> float:
    """1, 2 or 5 times a power of ten, not above ``most``."""
    power = 10.0 ** np.floor(np.log10(most))
    return float(max(step * power for step in (1.0, 2.0, 5.0) if step * power <= most * 1.000001))


def length_label(length: float) -> str:
    """``0.2 m``, ``50 mm``."""
    if 1e-3 <= length < 0.1:
        return f"{1e3 * length:.6g} mm"
    exponent = round(np.floor(np.log10(length)))
    if -3 <= exponent <= 3:
        return f"{length:.6g} m"
    return f"{length / 10.0**exponent:.0f}·{graph.power(10.0**exponent)} m"


# --- The poses along the trajectory

_BODIES = (graph.BLUE, graph.GREEN, graph.PURPLE, graph.SKY)


def poses(title: str, shown: DrawnPoses) -> FigurePlan:
    """The mechanism at samples of the trajectory, or in one pose, and the path of its tip."""
    links, count = ", ".join(shown.link_names), len(shown.lines)
    several = f"{count} poses" if count > 1 else "one pose"
    tip = "" if shown.tip_path is None else ", and the path of the tip"
    return FigurePlan(
        "mechanism",
        "Mechanism",
        f"The links ({links}) in {several}{tip}. {scene.scale_words(shown)}".strip(),
        f"Line drawing of the mechanism with links {links} in {several}.",
        partial(_draw_poses, title, shown),
        "answer",
    )


def _draw_poses(title: str, shown: DrawnPoses) -> Figure:
    """Links as lines, coloured by the time of the pose."""
    held, colours = extent(shown), _colours(len(shown.lines))
    spatial, more = held.view.spatial, ": poses along the trajectory" * (len(colours) > 1)
    figure = style.new_figure(f"{short(title, 60)}{more}", 4.0)
    key = figure.legend(handles=_entries(shown, colours), loc="upper left")
    left, foot = (0.2, 0.8) if spatial else (0.75, 0.5)  # inches
    wide = style.WIDTH_IN - left - key.get_window_extent().width / figure.dpi - 0.2
    tall = float(np.clip(wide * held.size[1] / held.size[0], 2.0, 4.8))
    figure.set_size_inches(style.WIDTH_IN, foot + tall + 0.42)
    drawing = held.drawing(figure, (left, foot, wide, tall), room=1.12)
    key.set_bbox_to_anchor((1.02, 1.0), drawing.axes.transAxes)
    if spatial:
        drawing.axes.set_axis_off()
        draw_bearings(figure, drawing, 0.1, 0.1)
    else:
        drawing.axes.set(xlabel="x [m]", ylabel="y [m]")
    if shown.tip_path is not None:
        drawing.line(drawing.view.flat(shown.tip_path), graph.VERMILLION, 1.8)
    every = scene.parts(shown)
    draw(drawing, of_roles(every, "ground"), 0, GREY)
    for pose, colour in enumerate(colours):
        moving = of_roles(every, "spring", "link", "rigid", "slide", "pivot")
        draw(drawing, moving, pose, colour, {"spring": GREY})
    for at, body in enumerate(of_roles(every, "body")):
        for pose in range(len(colours)):
            draw_part(drawing, body, pose, _BODIES[at % len(_BODIES)])
    return figure


def _colours(count: int) -> list[str]:
    """Colours from dark to light, one a pose."""
    import matplotlib
    from matplotlib.colors import to_hex

    return [
        to_hex(colour) for colour in matplotlib.colormaps[style.SCALE](np.linspace(0, 0.9, count))
    ]


def _entries(shown: DrawnPoses, colours: Sequence[str]) -> list[Artist]:
    """The legend: tip path, the first six bodies, and the time of each pose."""
    from matplotlib.lines import Line2D

    entries = []
    if shown.tip_path is not None:
        entries.append(Line2D([], [], color=graph.VERMILLION, linewidth=1.8, label="tip path"))
    for at, body in enumerate(shown.bodies[:6]):
        look: Any = {"color": _BODIES[at % len(_BODIES)], "linestyle": "none", "marker": "o"}
        entries.append(Line2D([], [], **look, label=short(body.name, 22)))
    timed = zip(colours, shown.time_s, strict=True) if len(colours) > 1 else ()
    for at, (colour, time) in enumerate(timed):
        whose = f"{short(shown.of[at], 12)} " if shown.of else ""
        entries.append(Line2D([], [], color=colour, linewidth=2.6, label=f"{whose}at {time:.3g} s"))
    return list(entries)
