"""The mechanism in several poses with the path of its tip (the paper's Figures 1 and 2).

From the bottom up: a parallel projection of a plane or of space on the sheet; a drawing at one
scale in all directions; a symbol for each joint, body and spring; the figure of the poses.
Symbols are measured in inches on the sheet, places in m.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from eigassign.output.figures import graph, style
from eigassign.output.figures.graph import BLACK, GREY, FigurePlan, short
from eigassign.study.results import DrawnBody, DrawnJoint, DrawnPoses, DrawnSpring, RunResults

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]
Box = tuple[float, float, float, float]  # left, bottom, width, height in inches

# --- A parallel projection

_ELEVATION = np.radians(22.0)
_AZIMUTHS = np.radians([-60.0, -30.0, -120.0])  # of the viewer


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
    """A plane as it is; space with z upright, by a viewer far away above the x-y plane.

    From the first azimuth that shows 70 % of the best one's area; what is nearly a line on the
    sheet counts by its length.
    """
    if points.shape[1] == 2:
        return View(np.eye(2))
    views, seen = [], []
    low, high = np.sin(_ELEVATION), np.cos(_ELEVATION)
    for c, s in zip(np.cos(_AZIMUTHS), np.sin(_AZIMUTHS), strict=True):
        views.append(View(np.array([[-s, c, 0.0], [-low * c, -low * s, high]])))
        flat = views[-1].flat(points)
        long, wide = np.linalg.svd(flat - flat.mean(axis=0), compute_uv=False)
        seen.append(long * max(wide, 0.2 * long))
    return next(v for v, area in zip(views, seen, strict=True) if area >= 0.7 * max(seen))


# --- A drawing at one scale in all directions


@dataclass(frozen=True)
class Extent:
    """The box in the view, m, that holds some points; never without width and height both."""

    view: View
    middle: Floats  # (2,)
    size: Floats  # (2,) width and height

    def drawing(self, figure: Figure, box: Box, room: float = 1.0, grain: float = 1.0) -> Drawing:
        """Axes at ``box`` of the figure that show it in their middle, ``room`` times as large."""
        inside = np.array(box[2:])
        per_inch = room * float(np.max(self.size / inside))
        sheet = np.tile(figure.get_size_inches(), 2)
        axes = figure.add_axes(tuple(np.array(box) / sheet))
        low, high = (self.middle + side * per_inch * inside / 2.0 for side in (-1.0, 1.0))
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
        return Drawing(axes, self.view, per_inch, grain)


def extent(poses: DrawnPoses, others: Iterable[Floats] = ()) -> Extent:
    """The extent of these poses and other points in the view that suits the poses."""
    shown = points_of(poses)
    view = view_of(shown)
    flat = view.flat(np.concatenate([shown, *others]))
    low, high = flat.min(axis=0), flat.max(axis=0)
    largest = float(np.max(high - low)) or 1.0
    return Extent(view, 0.5 * (low + high), np.maximum(high - low, 0.02 * largest))


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
    """Axes on which places are drawn; ``grain`` is the size of symbols, 1 in a full figure.

    What is drawn later lies above what was drawn before, whatever it is.
    """

    axes: Axes
    view: View
    per_inch: float  # m
    grain: float = 1.0

    def symbol(self, at: Floats, shape: Floats) -> Floats:
        """A shape (n, 2) in inches around the flat place ``at``, in m."""
        return np.asarray(at + self.per_inch * self.grain * shape)

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
            *places.T, "o", markersize=diameter * self.grain, markeredgecolor=edge,
            markerfacecolor=fill, markeredgewidth=0.8, zorder=2.0, clip_on=False,
        )  # fmt: skip

    def area(self, corners: Floats, edge: str, fill: str) -> None:
        """A filled polygon."""
        self.axes.fill(
            *corners.T, edgecolor=edge, facecolor=fill, linewidth=0.8, zorder=2.0, clip_on=False
        )


# --- A symbol for each joint, body and spring

KINDS = ("turning", "sliding", "fixed")
_GROUND = "#e6e6e6"
_DOWN, _ACROSS = np.array([0.0, -1.0]), np.array([1.0, 0.0])
_TURN = np.linspace(0.0, 4.5 * np.pi, 60)
_SPIRAL = (0.05 + 0.08 * _TURN / _TURN[-1]) * np.array([np.cos(_TURN), np.sin(_TURN)])
_SPIRAL = _SPIRAL.T


def draw_links(
    drawing: Drawing, poses: DrawnPoses, pose: int, colour: str, scale: float = 1.0
) -> None:
    """Lines of one pose; thicker sections are drawn thicker, a taper in eight pieces."""
    from matplotlib.collections import LineCollection

    pieces: list[Floats] = []
    widths: list[float] = []
    for points, (start, end) in zip(poses.lines[pose], line_widths(poses), strict=True):
        flat = drawing.view.flat(points)
        if len(flat) < 2 or not np.ptp(flat, axis=0).any():
            continue
        own, count = np.linspace(0.0, 1.0, len(flat)), 1 if start == end else 8
        for low, high in pairwise(np.linspace(0.0, 1.0, count + 1)):
            at = np.linspace(low, high, 1 + max(1, len(flat) // count)) if count > 1 else own
            pieces.append(np.column_stack([np.interp(at, own, column) for column in flat.T]))
            widths.append(start + (end - start) * 0.5 * (low + high))
    drawing.axes.add_collection(
        LineCollection(
            pieces, colors=colour, linewidths=scale * drawing.grain * np.array(widths),
            capstyle="round", joinstyle="round", zorder=2.0, clip_on=False,
        ),
        autolim=False,
    )  # fmt: skip


def line_widths(poses: DrawnPoses) -> list[tuple[float, float]]:
    """Start and end width of each line in points, by the root of its section's size.

    From 1.3, the thinnest line that can be, to 4.2; 2.6 of lines without a section.
    """
    largest = max((size for pair in poses.sizes for size in pair), default=0.0)

    def width(size: float) -> float:
        return 1.3 + 2.9 * (size / largest) ** 0.5 if size > 0.0 else 2.6

    return [(width(a), width(b)) for a, b in poses.sizes or ((0.0, 0.0),) * len(poses.lines[0])]


def draw_ground(drawing: Drawing, joints: Sequence[DrawnJoint]) -> None:
    """Feet of the joints on the ground, and the way of those that slide in all poses."""
    for joint in (joint for joint in joints if joint.grounded):
        places = drawing.view.flat(joint.places)
        along = drawing.heading(joint.axes[0])
        across = np.array([-along[1], along[0]])
        if joint.kind == "turning":
            foot = np.array([(0.0, 0.0), (-0.08, -0.14), (0.08, -0.14)])
            drawing.area(drawing.symbol(places[0], foot), GREY, _GROUND)
            _hatched(drawing, drawing.symbol(places[0], 0.14 * _DOWN), _ACROSS, _DOWN, 0.14)
        elif joint.kind == "sliding":
            # a hatched line beside all places, somewhat longer than their way
            behind, way = across if across[1] < 0.0 else -across, (places - places[0]) @ along
            middle = places[0] + 0.5 * (way.min() + way.max()) * along
            half = 0.5 * float(np.ptp(way)) / (drawing.per_inch * drawing.grain) + 0.2
            _hatched(drawing, drawing.symbol(middle, 0.09 * behind), along, behind, half)
        else:
            _hatched(drawing, places[0], across, -along, 0.13)


def _hatched(drawing: Drawing, at: Floats, along: Floats, behind: Floats, half: float) -> None:
    """A line through ``at``, ``half`` inches to both sides, with short strokes behind it."""
    feet = np.linspace(-0.76, 1.0, round(2.0 * half / 0.055))[:, None] * half * along
    gap = np.full_like(feet, np.nan)
    strokes = np.stack([feet, feet + 0.06 * behind - 0.05 * along, gap], axis=1).reshape(-1, 2)
    shape = np.vstack([-half * along, half * along, gap[:1], strokes])
    drawing.line(drawing.symbol(at, shape), GREY, 0.8)


def draw_joints(
    drawing: Drawing, joints: Sequence[DrawnJoint], pose: int, colour: str, kinds: Sequence[str]
) -> None:
    """A ring where it turns, a box where it slides, a square where it is fixed.

    With a dot inside if a coordinate moves it. Only those of ``kinds`` are drawn.
    """
    shown = [joint for joint in joints if joint.kind in kinds]
    places = [drawing.view.flat(joint.places[pose]) for joint in shown]
    rings = [at for joint, at in zip(shown, places, strict=True) if joint.kind == "turning"]
    if rings:
        drawing.dots(np.array(rings), 5.6, colour, "white")
    for joint, at in zip(shown, places, strict=True):
        along = drawing.heading(joint.axes[pose])
        if joint.kind == "sliding":
            drawing.area(drawing.symbol(at, _box(along, 0.09, 0.055)), colour, "white")
        elif joint.kind == "fixed" and not joint.grounded:
            drawing.area(drawing.symbol(at, _box(along, 0.028, 0.028)), colour, colour)
    driven = [at for joint, at in zip(shown, places, strict=True) if joint.driven]
    if driven:
        drawing.dots(np.array(driven), 1.6, colour, colour)


def _box(along: Floats, half: float, tall: float) -> Floats:
    across = np.array([-along[1], along[0]])
    signs = ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0))
    return np.array([a * half * along + b * tall * across for a, b in signs])


def draw_bodies(drawing: Drawing, bodies: Sequence[DrawnBody], pose: int, colour: str) -> None:
    """Dots, their diameter by the cube root of the mass; a ring without mass."""
    for body, diameter in zip(bodies, diameters(bodies), strict=True):
        at = drawing.view.flat(body.places[[pose]])
        drawing.dots(at, diameter, colour, colour if body.mass > 0.0 else "white")


def diameters(bodies: Sequence[DrawnBody]) -> list[float]:
    """Diameter of each body's dot in points."""
    heaviest = max((body.mass for body in bodies), default=0.0)
    if heaviest <= 0.0:
        return [8.0] * len(bodies)
    return [6.0 + 6.0 * (max(body.mass, 0.0) / heaviest) ** (1.0 / 3.0) for body in bodies]


def draw_springs(drawing: Drawing, springs: Sequence[DrawnSpring], pose: int, colour: str) -> None:
    """A zigzag between its ends or to the ground, a spiral where it only resists rotation."""
    for spring in springs:
        start, end = drawing.view.flat(np.stack([spring.starts[pose], spring.ends[pose]]))
        if spring.grounded and not spring.turning:
            end = drawing.symbol(start, np.array([0.16, -0.3]))
            _hatched(drawing, end, _ACROSS, _DOWN, 0.09)
        inches = (end - start) / (drawing.per_inch * drawing.grain)
        coiled = spring.turning or float(np.linalg.norm(inches)) < 0.05
        drawing.line(drawing.symbol(start, _SPIRAL if coiled else _zigzag(inches)), colour, 1.1)


def _zigzag(along: Floats) -> Floats:
    across = 0.05 * np.array([-along[1], along[0]]) / np.linalg.norm(along)
    at = np.concatenate([[0.0, 0.2], np.linspace(0.25, 0.75, 6), [0.8, 1.0]])
    side = np.array([0.0, 0.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 0.0, 0.0])
    return np.asarray(at[:, None] * along + side[:, None] * across)


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


def poses(results: RunResults) -> FigurePlan:
    """The mechanism at samples of the trajectory, and the path of its tip."""
    links = ", ".join(results.poses.link_names)
    return FigurePlan(
        "mechanism",
        "Mechanism",
        f"The links ({links}) in {len(results.poses.lines)} poses, and the path of the tip.",
        f"Line drawing of the mechanism with links {links} in several poses.",
        partial(draw_poses, results),
    )


def draw_poses(results: RunResults) -> Figure:
    """Links as lines, coloured by the time of the pose."""
    shown, held = results.poses, extent(results.poses)
    spatial, colours = held.view.spatial, _colours(len(shown.lines))
    title = f"{short(results.title, 70)}: poses along the trajectory"
    figure = style.new_figure(title, 4.0, layout=None)
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
    draw_ground(drawing, shown.joints)
    for pose, colour in enumerate(colours):
        draw_springs(drawing, shown.springs, pose, GREY)
        draw_links(drawing, shown, pose, colour, scale=0.8)
        draw_joints(drawing, shown.joints, pose, colour, KINDS)
    for at, (body, size) in enumerate(zip(shown.bodies, diameters(shown.bodies), strict=True)):
        colour = _BODIES[at % len(_BODIES)]
        drawing.dots(drawing.view.flat(body.places), 0.7 * size, colour, colour)
    grounded = [joint for joint in shown.joints if joint.grounded]
    draw_joints(drawing, grounded, 0, BLACK, ("turning",))
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
    for at, (colour, time) in enumerate(zip(colours, shown.time_s, strict=True)):
        whose = f"{short(shown.of[at], 12)} " if shown.of else ""
        entries.append(Line2D([], [], color=colour, linewidth=2.6, label=f"{whose}at {time:.3g} s"))
    return list(entries)
