"""The mechanism drawn in several poses with its tip path (Figures 1 and 2)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from matplotlib.path import Path
from numpy.typing import NDArray

from eigassign.output.frame import (
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
from eigassign.output.ink import (
    BLACK,
    BLUE,
    GREEN,
    GREY,
    LINE_IN,
    PURPLE,
    SKY,
    VERMILLION,
    Sheet,
    Stroke,
    ramp,
    rectangle,
    short,
)
from eigassign.output.lettering import text_width
from eigassign.output.ticks import Scale, between, bounds
from eigassign.study.findings import Findings, Poses

Floats = NDArray[np.float64]
_TALL_IN = (2.0, 4.8)
_FOOT_IN = 0.5
_TIP = Stroke(VERMILLION, 1.8)
_BODIES = (BLUE, GREEN, PURPLE, SKY)
_BODY_KEYS = 6
_WHITE = (1.0, 1.0, 1.0)
_AXONOMETRY = np.array([[0.866, 0.35], [-0.5, 0.606], [0.0, 0.714]])


def mechanism(findings: Findings) -> Sheet:
    """Links as lines, joints as rings, bodies as dots, the pose's time told by its colour."""
    poses = findings.poses
    entries = _entries(poses)
    key = max((text_width(entry.label) for entry in entries), default=0.0) + 0.65
    frame, height = _frame(poses, key)
    sheet = titled_sheet(height, f"{short(findings.title, 70)}: poses along the trajectory")
    draw_frame(sheet, frame)
    if poses.tip_path is not None:
        sheet.line(_place(frame, poses.tip_path), _TIP)
    for at, lines in enumerate(poses.lines):
        _draw_pose(sheet, frame, lines, _pose_stroke(at, len(poses.lines)))
    _draw_ground(sheet, frame, poses)
    for at, (_, places) in enumerate(poses.bodies):
        for x, y in _place(frame, places):
            sheet.line(np.array([(x, y)]), _body_stroke(at))
    _draw_surroundings(sheet, frame, entries, spatial=_is_spatial(poses))
    return sheet


def _entries(poses: Poses) -> list[Entry]:
    entries = [Entry("tip path", _TIP)] if poses.tip_path is not None else []
    for at, (text, _) in enumerate(poses.bodies[:_BODY_KEYS]):
        entries.append(Entry(short(text, 22), _body_stroke(at)))
    for at, time in enumerate(poses.time_s):
        whose = f"{short(poses.of[at], 12)} " if poses.of else ""
        entries.append(Entry(f"{whose}at {time:.3g} s", _pose_stroke(at, len(poses.lines))))
    return entries


def _pose_stroke(at: int, count: int) -> Stroke:
    red, green, blue = ramp(0.9 * at / max(count - 1, 1))
    return Stroke(f"#{round(255 * red):02x}{round(255 * green):02x}{round(255 * blue):02x}", 2.6)


def _body_stroke(at: int) -> Stroke:
    return Stroke(_BODIES[at % len(_BODIES)], dot=7.0)


def _is_spatial(poses: Poses) -> bool:
    return any(points.shape[1] == 3 for lines in poses.lines for points in lines)


def _flat(points: Floats) -> Floats:
    """Points in the plane as they are, points in space seen from above a corner."""
    return points if points.shape[1] == 2 else np.asarray(points @ _AXONOMETRY)


def _place(frame: Frame, points: Floats) -> Floats:
    flat = _flat(points)
    return frame.place(flat[:, 0], flat[:, 1])


def _points(poses: Poses) -> Iterator[Floats]:
    for lines in poses.lines:
        yield from map(_flat, lines)
    for _, places in poses.bodies:
        yield _flat(places)
    if poses.tip_path is not None:
        yield _flat(poses.tip_path)


def _frame(poses: Poses, key: float) -> tuple[Frame, float]:
    """Axes with one scale both ways that hold everything, and the height of the sheet."""
    points = list(_points(poses))
    (left, right), (low, high) = (bounds([p[:, i] for p in points]) for i in (0, 1))
    across, up = right - left, high - low
    margin = 0.06 * max(across, up) or 0.5
    across, up = across + 2.0 * margin, up + 2.0 * margin
    edge = 0.28 + label_width(_scale(low - margin, low - margin + up, 5.0))
    width = WIDTH_IN - edge - key
    tall = min(max(width * up / across, _TALL_IN[0]), _TALL_IN[1])
    per_inch = max(across / width, up / tall)
    x = _scale(*_centred((left + right) / 2.0, per_inch * width), width)
    y = _scale(*_centred((low + high) / 2.0, per_inch * tall), tall)
    return Frame((edge, _FOOT_IN, width, tall), x, y), _FOOT_IN + tall + TITLE_IN + 0.06


def _centred(middle: float, size: float) -> tuple[float, float]:
    return middle - size / 2.0, middle + size / 2.0


def _scale(low: float, high: float, inches: float) -> Scale:
    return between(low, high, count=max(3, round(1.6 * inches)))


def _draw_pose(sheet: Sheet, frame: Frame, lines: tuple[Floats, ...], stroke: Stroke) -> None:
    placed = [_place(frame, points) for points in lines]
    for points in placed:
        sheet.line(points, stroke)
    for points in placed:
        sheet.dot((points[0, 0], points[0, 1]), 4.5, _WHITE, stroke.colour)


def _draw_ground(sheet: Sheet, frame: Frame, poses: Poses) -> None:
    """A foot under every link that starts at the same place in all poses."""
    for starts in zip(*[[points[0] for points in lines] for lines in poses.lines], strict=True):
        if all(np.array_equal(start, starts[0]) for start in starts):
            ((x, y),) = _place(frame, starts[0][None, :])
            corners = [(x, y), (x - 0.09, y - 0.15), (x + 0.09, y - 0.15), (x, y)]
            sheet.area(Path(corners), (0.75, 0.75, 0.75), GREY)
            sheet.area(rectangle((x - 0.14, y - 0.18, 0.28, 0.03)), (0.45, 0.45, 0.45))
            sheet.dot((x, y), 4.5, _WHITE, BLACK)


def _draw_surroundings(sheet: Sheet, frame: Frame, entries: list[Entry], *, spatial: bool) -> None:
    left, bottom, width, height = frame.box
    for at, entry in enumerate(entries):
        draw_entry(sheet, entry, left + width + 0.15, bottom + height - (at + 0.5) * LINE_IN)
    across, up = ("seen from above", "seen from above") if spatial else ("x", "y")
    sheet.text(left + width / 2.0, 0.14, axis_label(across, frame.x.unit("m")), align="center")
    sheet.text(0.14, bottom + height / 2.0, axis_label(up, frame.y.unit("m")), upright=True)
