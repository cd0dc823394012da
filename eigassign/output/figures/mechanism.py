"""The mechanism drawn in several poses with its tip path (Figures 1 and 2).

Lines, joints, bodies and springs of a mechanism on a canvas, each by one symbol.

From places in a plane or in space to places on a sheet, at one scale in all directions.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from matplotlib.path import Path
from numpy.typing import NDArray

from eigassign.output.figures.frame import (
    TITLE_IN,
    WIDTH_IN,
    Entry,
    Frame,
    axis_label,
    draw_entry,
    draw_frame,
    label_width,
    titled_sheet,
)
from eigassign.output.figures.ink import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    LINE_IN,
    PURPLE,
    SKY,
    VERMILLION,
    Box,
    Sheet,
    Stroke,
    ramp,
    rgb,
    short,
)
from eigassign.output.figures.lettering import text_width
from eigassign.output.figures.ticks import Scale, between, power_of_ten
from eigassign.study.results import DrawnBody, DrawnJoint, DrawnPoses, DrawnSpring, RunResults

# --- The mechanism drawn in several poses with its tip path (Figures 1 and 2)

_TALL_IN = (2.0, 4.8)
_FOOT_IN = {False: 0.5, True: 0.8}  # in a plane, in space
_ROOM = 1.12  # of the axes, relative to what they hold
_TIP = Stroke(VERMILLION, 1.8)
_BODIES = (BLUE, GREEN, PURPLE, SKY)
_BODY_KEYS = 6


def mechanism(results: RunResults) -> Sheet:
    """Links as lines, the pose's time told by its colour; see `symbols` for joints and bodies."""
    poses = results.poses
    held = extent(poses)
    entries = _entries(poses)
    canvas, frame = _sheet(held, entries, f"{short(results.title, 70)}: poses along the trajectory")
    sheet = canvas.sheet
    if frame is None:
        draw_bearings(canvas, 0.1, 0.1)
    else:
        draw_frame(sheet, frame)
    if poses.tip_path is not None:
        sheet.line(canvas.place(poses.tip_path), _TIP)
    draw_ground(canvas, poses.joints)
    for pose in range(len(poses.lines)):
        colour = _colour(pose, len(poses.lines))
        draw_springs(canvas, poses.springs, pose, GREY)
        draw_lines(canvas, poses, pose, colour, scale=0.8)
        draw_joints(canvas, poses.joints, pose, colour, KINDS)
    for at, (body, diameter) in enumerate(zip(poses.bodies, diameters(poses.bodies), strict=True)):
        stroke = Stroke(_BODIES[at % len(_BODIES)], dot=0.7 * diameter)
        for place in canvas.place(body.places):
            sheet.line(place[None], stroke)
    grounded = [joint for joint in poses.joints if joint.grounded]
    draw_joints(canvas, grounded, 0, BLACK, ("turning",))
    return sheet


def _entries(poses: DrawnPoses) -> list[Entry]:
    entries = [Entry("tip path", _TIP)] if poses.tip_path is not None else []
    for at, body in enumerate(poses.bodies[:_BODY_KEYS]):
        entries.append(Entry(short(body.name, 22), Stroke(_BODIES[at % len(_BODIES)], dot=7.0)))
    for at, time in enumerate(poses.time_s):
        whose = f"{short(poses.of[at], 12)} " if poses.of else ""
        stroke = Stroke(_colour(at, len(poses.lines)), 2.6)
        entries.append(Entry(f"{whose}at {time:.3g} s", stroke))
    return entries


def _colour(at: int, count: int) -> str:
    red, green, blue = (round(255 * part) for part in ramp(0.9 * at / max(count - 1, 1)))
    return f"#{red:02x}{green:02x}{blue:02x}"


def _sheet(held: Extent, entries: list[Entry], title: str) -> tuple[Canvas, Frame | None]:
    """A sheet with title and key; its canvas, and in a plane the axes around it."""
    key = max((text_width(entry.label) for entry in entries), default=0.0) + 0.65
    x, y, across, up = held.box
    foot = _FOOT_IN[held.view.spatial]
    edge = 0.2
    if not held.view.spatial:
        edge = 0.28 + label_width(_scale(y, _ROOM * up, 5.0))
    width = WIDTH_IN - edge - key
    tall = min(max(width * up / across, _TALL_IN[0]), _TALL_IN[1])
    sheet = titled_sheet(foot + tall + TITLE_IN + 0.06, title)
    box = (edge, foot, width, tall)
    inner = (edge + 0.5 * (1 - 1 / _ROOM) * width, foot + 0.5 * (1 - 1 / _ROOM) * tall)
    canvas = held.on(sheet, (*inner, width / _ROOM, tall / _ROOM))
    for at, entry in enumerate(entries):
        draw_entry(sheet, entry, edge + width + 0.15, foot + tall - (at + 0.5) * LINE_IN)
    if held.view.spatial:
        return canvas, None
    frame = Frame(
        box, _scale(x, canvas.per_inch * width, width), _scale(y, canvas.per_inch * tall, tall)
    )
    sheet.text(edge + width / 2.0, 0.14, axis_label("x", frame.x.unit("m")), align="center")
    sheet.text(0.14, foot + tall / 2.0, axis_label("y", frame.y.unit("m")), upright=True)
    return canvas, frame


def _scale(middle: float, size: float, inches: float) -> Scale:
    low, high = middle - size / 2.0, middle + size / 2.0
    return between(low, high, count=max(3, round(1.6 * inches)))


# --- Lines, joints, bodies and springs of a mechanism on a canvas, each by one symbol

Floats = NDArray[np.float64]
WHITE = (1.0, 1.0, 1.0)
KINDS = ("turning", "sliding", "fixed")
_GROUND = (0.9, 0.9, 0.9)
_WIDTHS = (1.3, 4.2)  # points: of the thinnest lines that can be, and of the thickest line
_PLAIN = 2.6  # points: of lines without a section
_PIECE = 4  # points of a tapered line that are drawn with one width


def draw_lines(
    canvas: Canvas, poses: DrawnPoses, pose: int, colour: str, scale: float = 1.0
) -> None:
    """All links of one pose; thicker sections are drawn thicker, a taper as one."""
    widths = line_widths(poses)
    for points, width in zip(poses.lines[pose], widths, strict=True):
        placed = canvas.place(points)
        for piece, at in _pieces(placed, width):
            canvas.sheet.line(piece, Stroke(colour, scale * canvas.grain * at))


def line_widths(poses: DrawnPoses) -> list[tuple[float, float]]:
    """Start and end width of each line in points, by the root of its section's size."""
    largest = max((size for pair in poses.sizes for size in pair), default=0.0)
    if largest == 0.0:
        return [(_PLAIN, _PLAIN)] * len(poses.lines[0])
    return [(_width(a / largest), _width(b / largest)) for a, b in poses.sizes]


def _width(share: float) -> float:
    low, high = _WIDTHS
    return low + (high - low) * share**0.5 if share > 0.0 else _PLAIN


def _pieces(placed: Floats, width: tuple[float, float]) -> list[tuple[Floats, float]]:
    if len(placed) < 2 or not np.ptp(placed, axis=0).any():
        return []
    start, end = width
    if start == end:
        return [(placed, start)]
    if len(placed) == 2:
        placed = np.linspace(placed[0], placed[1], 4 * _PIECE + 1)
    n = len(placed) - 1
    cuts = range(0, n, _PIECE)
    return [
        (placed[k : k + _PIECE + 1], start + (end - start) * (k + 0.5 * _PIECE) / n) for k in cuts
    ]


def draw_ground(canvas: Canvas, joints: Sequence[DrawnJoint]) -> None:
    """What the joints on the ground stand on, and the way of those that slide in all poses."""
    for joint in joints:
        if joint.grounded:
            places = canvas.place(joint.places)
            along = canvas.heading(joint.axes[0])
            across = np.array([-along[1], along[0]])
            if joint.kind == "turning":
                _foot(canvas, places[0])
            elif joint.kind == "sliding":
                _guide(canvas, places, along, across if across[1] < 0.0 else -across)
            else:
                _hatched(canvas, places[0], across, -along, 0.13)


def _guide(canvas: Canvas, places: Floats, along: Floats, behind: Floats) -> None:
    """A hatched line beside all places, somewhat longer than their way."""
    way = (places - places[0]) @ along
    middle = places[0] + 0.5 * (way.min() + way.max()) * along
    half = 0.5 * float(np.ptp(way)) / canvas.grain + 0.2
    _hatched(canvas, middle + 0.09 * canvas.grain * behind, along, behind, half)


def _foot(canvas: Canvas, at: Floats) -> None:
    g = canvas.grain
    corners = at + g * np.array([(0.0, 0.0), (-0.08, -0.14), (0.08, -0.14), (0.0, 0.0)])
    canvas.sheet.area(Path(corners), _GROUND, GREY)
    across, down = np.array([1.0, 0.0]), np.array([0.0, -1.0])
    _hatched(canvas, at + 0.14 * g * down, across, down, 0.14)


def _hatched(canvas: Canvas, at: Floats, along: Floats, behind: Floats, half: float) -> None:
    """A line through ``at`` with short strokes behind it."""
    g = canvas.grain
    ends = np.array([at - half * g * along, at + half * g * along])
    count = round(2.0 * half / 0.055)
    feet = ends[0] + np.linspace(0.12, 1.0, count)[:, None] * (ends[1] - ends[0])
    strokes = [np.array([foot, foot + g * (0.06 * behind - 0.05 * along)]) for foot in feet]
    canvas.sheet.segments([ends, *strokes], Stroke(GREY, 0.8))


def draw_joints(
    canvas: Canvas, joints: Sequence[DrawnJoint], pose: int, colour: str, kinds: Sequence[str]
) -> None:
    """A ring where it turns, a box where it slides, a square where it is fixed.

    With a dot inside if a coordinate moves it. Only those of ``kinds`` are drawn.
    """
    for joint in (joint for joint in joints if joint.kind in kinds):
        (at,) = canvas.place(joint.places[pose][None])
        g = canvas.grain
        if joint.kind == "turning":
            canvas.sheet.dot((at[0], at[1]), 5.6 * g, WHITE, colour)
        elif joint.kind == "sliding":
            box = _box(at, canvas.heading(joint.axes[pose]), 0.09 * g, 0.055 * g)
            canvas.sheet.area(Path(box), WHITE, colour)
        elif not joint.grounded:
            along = canvas.heading(joint.axes[pose])
            canvas.sheet.area(Path(_box(at, along, 0.028 * g, 0.028 * g)), rgb(colour), colour)
        if joint.driven:
            canvas.sheet.dot((at[0], at[1]), 2.2 * g, rgb(colour))


def _box(at: Floats, along: Floats, half: float, tall: float) -> Floats:
    across = np.array([-along[1], along[0]])
    signs = ((-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0))
    return np.array([at + a * half * along + b * tall * across for a, b in signs])


def draw_bodies(canvas: Canvas, bodies: Sequence[DrawnBody], pose: int, colour: str) -> None:
    """Dots whose volume tells the mass; a ring for none."""
    for body, diameter in zip(bodies, diameters(bodies), strict=True):
        (at,) = canvas.place(body.places[pose][None])
        fill = rgb(colour) if body.mass > 0.0 else WHITE
        canvas.sheet.dot((at[0], at[1]), diameter * canvas.grain, fill, colour)


def diameters(bodies: Sequence[DrawnBody]) -> list[float]:
    """In points."""
    heaviest = max((body.mass for body in bodies), default=0.0)
    if heaviest <= 0.0:
        return [8.0] * len(bodies)
    return [6.0 + 6.0 * (max(body.mass, 0.0) / heaviest) ** (1.0 / 3.0) for body in bodies]


def draw_springs(canvas: Canvas, springs: Sequence[DrawnSpring], pose: int, colour: str) -> None:
    """A zigzag between its ends or to the ground, a spiral where it only resists rotation."""
    for spring in springs:
        start, end = canvas.place(np.stack([spring.starts[pose], spring.ends[pose]]))
        g, stroke = canvas.grain, Stroke(colour, 1.1)
        if spring.grounded and not spring.turning:
            end = start + g * np.array([0.16, -0.3])
            _hatched(canvas, end, np.array([1.0, 0.0]), np.array([0.0, -1.0]), 0.09)
        if spring.turning or np.linalg.norm(end - start) < 0.05:
            canvas.sheet.line(start + g * _spiral(), stroke)
        else:
            canvas.sheet.line(_zigzag(start, end, 0.05 * g), stroke)


def _spiral() -> Floats:
    turn = np.linspace(0.0, 4.5 * np.pi, 60)
    radius = 0.05 + 0.08 * turn / turn[-1]
    return np.column_stack([radius * np.cos(turn), radius * np.sin(turn)])


def _zigzag(start: Floats, end: Floats, tall: float) -> Floats:
    along = end - start
    across = np.array([-along[1], along[0]]) / np.linalg.norm(along)
    at = np.concatenate([[0.0, 0.2], np.linspace(0.25, 0.75, 6), [0.8, 1.0]])
    side = np.array([0.0, 0.0, 1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 0.0, 0.0])
    return np.asarray(start + at[:, None] * along + tall * side[:, None] * across)


# --- From places in a plane or in space to places on a sheet, at one scale in all directions

ELEVATION = np.radians(22.0)
AZIMUTHS = np.radians([-60.0, -30.0, -120.0])  # of the viewer
_ENOUGH = 0.7  # of the area seen from the best side
_THIN = Stroke(GREY, 1.0)


@dataclass(frozen=True)
class View:
    """A parallel projection: rows are the sheet's directions across and up, in world axes."""

    directions: Floats  # (2, d)

    def flat(self, points: Floats) -> Floats:
        """(…, d) → (…, 2) in the same unit."""
        return np.asarray(points @ self.directions.T)

    @property
    def spatial(self) -> bool:
        """Whether it is a view of space."""
        return bool(self.directions.shape[1] == 3)


def view_of(points: Floats) -> View:
    """A plane as it is; space from above, from the first side that hides little."""
    if points.shape[1] == 2:
        return View(np.eye(2))
    views = [View(_axonometry(azimuth)) for azimuth in AZIMUTHS]
    seen = [_seen(view.flat(points)) for view in views]
    return next(v for v, area in zip(views, seen, strict=True) if area >= _ENOUGH * max(seen))


def _axonometry(azimuth: float) -> Floats:
    """What a viewer far away at this azimuth, above the x-y plane, sees with z upright."""
    c, s = np.cos(azimuth), np.sin(azimuth)
    low, high = np.sin(ELEVATION), np.cos(ELEVATION)
    return np.array([[-s, c, 0.0], [-low * c, -low * s, high]])


def _seen(flat: Floats) -> float:
    """About the area that points take on the sheet; what is nearly a line counts by its length."""
    long, short = np.linalg.svd(flat - flat.mean(axis=0), compute_uv=False)
    return float(long * max(short, 0.2 * long))


def points_of(poses: DrawnPoses) -> Floats:
    """Everything that a drawing of these poses has to hold, (n, d)."""
    parts = [line for lines in poses.lines for line in lines]
    parts += [body.places for body in poses.bodies]
    parts += [joint.places for joint in poses.joints]
    parts += [] if poses.tip_path is None else [poses.tip_path]
    every = np.concatenate(parts)
    return every[np.isfinite(every).all(axis=1)]


@dataclass(frozen=True)
class Canvas:
    """A sheet on which places are drawn; ``grain`` is the size of symbols, 1 in a full figure."""

    sheet: Sheet
    view: View
    middle: tuple[float, float]  # of the drawing, in the view's m
    centre: tuple[float, float]  # on the sheet, inches
    per_inch: float  # m
    grain: float = 1.0

    def place(self, points: Floats) -> Floats:
        """Points (n, 2) on the sheet in inches."""
        return (self.view.flat(points) - self.middle) / self.per_inch + self.centre

    def heading(self, direction: Floats) -> Floats:
        """Unit vector on the sheet of a direction; across where it points at the viewer."""
        flat = self.view.flat(direction)
        length = float(np.linalg.norm(flat))
        return flat / length if length > 0.05 * np.linalg.norm(direction) else np.array([1.0, 0.0])


@dataclass(frozen=True)
class Extent:
    """The box in the view that holds some points."""

    view: View
    points: Floats

    @cached_property
    def box(self) -> tuple[float, float, float, float]:
        """Middle across and up, width and height, in m; never without width and height both."""
        flat = self.view.flat(self.points)
        low, high = flat.min(axis=0), flat.max(axis=0)
        across, up = map(float, high - low)
        some = max(across, up) or 1.0
        x, y = map(float, 0.5 * (low + high))
        return x, y, max(across, 0.02 * some), max(up, 0.02 * some)

    def per_inch(self, width: float, height: float) -> float:
        """The scale, m per inch, at which it fits into ``width`` by ``height`` inches."""
        return max(self.box[2] / width, self.box[3] / height)

    def on(self, sheet: Sheet, box: Box, grain: float = 1.0) -> Canvas:
        """A canvas that shows it in the middle of ``box``."""
        left, bottom, width, height = box
        centre = (left + width / 2.0, bottom + height / 2.0)
        scale = self.per_inch(width, height)
        return Canvas(sheet, self.view, self.box[:2], centre, scale, grain)


def extent(poses: DrawnPoses, others: Iterable[Floats] = ()) -> Extent:
    """The extent of these poses and other points in the view that suits the poses."""
    shown = points_of(poses)
    return Extent(view_of(shown), np.concatenate([shown, *others]))


def draw_bearings(canvas: Canvas, left: float, bottom: float) -> None:
    """The axes' directions, and a bar of round length as scale, from (left, bottom) inches."""
    size = 0.3 * canvas.grain
    inset = (0.2, 0.24) if canvas.view.spatial else (0.08, 0.12)
    origin = np.add((left, bottom), inset)
    for axis, name in zip(np.eye(canvas.view.directions.shape[1]), "xyz", strict=False):
        end = origin + size * canvas.view.flat(axis)
        canvas.sheet.line(np.array([origin, end]), _THIN)
        x, y = end + 0.09 * canvas.heading(axis)
        canvas.sheet.text(x, y, name, align="center", points=8.0, colour=BLACK)
    _draw_scale(canvas, left + 0.75, bottom + 0.12)


def _draw_scale(canvas: Canvas, left: float, y: float) -> None:
    length = round_length(canvas.per_inch)
    right = left + length / canvas.per_inch
    ends = [np.array([(x, y - 0.03), (x, y + 0.03)]) for x in (left, right)]
    canvas.sheet.segments([np.array([(left, y), (right, y)]), *ends], Stroke(BLACK, 1.0))
    canvas.sheet.text(right + 0.08, y, length_label(length), points=8.0)


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
    return f"{length / 10.0**exponent:.0f}·{power_of_ten(int(exponent))} m"
