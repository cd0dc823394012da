"""Points over two logarithmic axes with a front through the best of them, legend beside them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.path import Path
from numpy.typing import NDArray

from eigassign.output.frame import Frame, axis_label, draw_frame, label_width, titled_sheet
from eigassign.output.ink import (
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
from eigassign.output.lettering import text_width
from eigassign.output.ticks import Scale, power_of_ten

Floats = NDArray[np.float64]
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
