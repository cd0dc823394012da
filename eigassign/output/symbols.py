"""Lines, joints, bodies and springs of a mechanism on a canvas, each by one symbol."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.path import Path
from numpy.typing import NDArray

from eigassign.output.ink import GREY, Stroke, rgb
from eigassign.output.view import Canvas
from eigassign.study.pictures import BodyMark, JointMark, Poses, SpringMark

Floats = NDArray[np.float64]
WHITE = (1.0, 1.0, 1.0)
KINDS = ("turning", "sliding", "fixed")
_GROUND = (0.9, 0.9, 0.9)
_WIDTHS = (1.3, 4.2)  # points: of the thinnest lines that can be, and of the thickest line
_PLAIN = 2.6  # points: of lines without a section
_PIECE = 4  # points of a tapered line that are drawn with one width


def draw_lines(canvas: Canvas, poses: Poses, pose: int, colour: str, scale: float = 1.0) -> None:
    """All links of one pose; thicker sections are drawn thicker, a taper as one."""
    widths = line_widths(poses)
    for points, width in zip(poses.lines[pose], widths, strict=True):
        placed = canvas.place(points)
        for piece, at in _pieces(placed, width):
            canvas.sheet.line(piece, Stroke(colour, scale * canvas.grain * at))


def line_widths(poses: Poses) -> list[tuple[float, float]]:
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


def draw_ground(canvas: Canvas, joints: Sequence[JointMark]) -> None:
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
    canvas: Canvas, joints: Sequence[JointMark], pose: int, colour: str, kinds: Sequence[str]
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


def draw_bodies(canvas: Canvas, bodies: Sequence[BodyMark], pose: int, colour: str) -> None:
    """Dots whose volume tells the mass; a ring for none."""
    for body, diameter in zip(bodies, diameters(bodies), strict=True):
        (at,) = canvas.place(body.places[pose][None])
        fill = rgb(colour) if body.mass > 0.0 else WHITE
        canvas.sheet.dot((at[0], at[1]), diameter * canvas.grain, fill, colour)


def diameters(bodies: Sequence[BodyMark]) -> list[float]:
    """In points."""
    heaviest = max((body.mass for body in bodies), default=0.0)
    if heaviest <= 0.0:
        return [8.0] * len(bodies)
    return [6.0 + 6.0 * (max(body.mass, 0.0) / heaviest) ** (1.0 / 3.0) for body in bodies]


def draw_springs(canvas: Canvas, springs: Sequence[SpringMark], pose: int, colour: str) -> None:
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
