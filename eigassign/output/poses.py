"""The mechanism drawn in several poses with its tip path (Figures 1 and 2)."""

from __future__ import annotations

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
    short,
)
from eigassign.output.lettering import text_width
from eigassign.output.symbols import (
    KINDS,
    diameters,
    draw_ground,
    draw_joints,
    draw_lines,
    draw_springs,
)
from eigassign.output.ticks import Scale, between
from eigassign.output.view import Canvas, Extent, draw_bearings, extent
from eigassign.study.findings import Findings
from eigassign.study.pictures import Poses

_TALL_IN = (2.0, 4.8)
_FOOT_IN = {False: 0.5, True: 0.8}  # in a plane, in space
_ROOM = 1.12  # of the axes, relative to what they hold
_TIP = Stroke(VERMILLION, 1.8)
_BODIES = (BLUE, GREEN, PURPLE, SKY)
_BODY_KEYS = 6


def mechanism(findings: Findings) -> Sheet:
    """Links as lines, the pose's time told by its colour; see `symbols` for joints and bodies."""
    poses = findings.poses
    held = extent(poses)
    entries = _entries(poses)
    canvas, frame = _sheet(
        held, entries, f"{short(findings.title, 70)}: poses along the trajectory"
    )
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


def _entries(poses: Poses) -> list[Entry]:
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
