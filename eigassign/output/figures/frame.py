"""What surrounds the data: axes with their ticks, labels and grid, and legends beside them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.output.figures.ink import (
    BLACK,
    EM_IN,
    GREY,
    GRID,
    LINE_IN,
    Box,
    Sheet,
    Stroke,
    short,
)
from eigassign.output.figures.lettering import FONT_PT, text_width
from eigassign.output.figures.ticks import Scale

Floats = NDArray[np.float64]

WIDTH_IN = 8.0
TITLE_IN = 0.36
_HANDLE_IN = 0.34
_TICK_IN = 0.045
_GRID = Stroke(GRID, 0.8)
_SPINE = Stroke(GREY, 0.8)


@dataclass(frozen=True)
class Frame:
    """Axes at ``box`` inches with a scale each way."""

    box: Box
    x: Scale
    y: Scale

    def place(self, x: Floats, y: Floats) -> Floats:
        """Points (n, 2) on the sheet, inches, of data points."""
        left, bottom, width, height = self.box
        return np.column_stack(
            (left + width * self.x.fraction(x), bottom + height * self.y.fraction(y))
        )


@dataclass(frozen=True)
class Entry:
    """One item of a legend."""

    label: str
    stroke: Stroke


def titled_sheet(height: float, title: str) -> Sheet:
    """A sheet of the common width with its title on top."""
    sheet = Sheet(WIDTH_IN, height)
    points, length = FONT_PT + 1.0, 110
    while text_width(short(title, length), points, bold=True) > WIDTH_IN - 0.2:
        length -= 5
    sheet.text(0.1, height - 0.18, short(title, length), bold=True, points=points)
    return sheet


def draw_frame(sheet: Sheet, frame: Frame, *, x_labels: bool = True, grid: bool = True) -> None:
    """Grid, axis lines, ticks and their labels."""
    left, bottom, width, height = frame.box
    across = left + width * frame.x.fraction(np.array(frame.x.positions))
    up = bottom + height * frame.y.fraction(np.array(frame.y.positions))
    if grid:
        lines = [np.array([(x, bottom), (x, bottom + height)]) for x in across]
        lines += [np.array([(left, y), (left + width, y)]) for y in up]
        sheet.segments(lines, _GRID)
    ticks = [np.array([(x, bottom - _TICK_IN), (x, bottom)]) for x in across]
    ticks += [np.array([(left - _TICK_IN, y), (left, y)]) for y in up]
    axes = np.array([(left, bottom + height), (left, bottom), (left + width, bottom)])
    sheet.segments([*ticks, axes], _SPINE)
    if x_labels:
        for x, label in zip(across, frame.x.labels, strict=True):
            sheet.text(x, bottom - 0.13, label, align="center")
    for y, label in zip(up, frame.y.labels, strict=True):
        sheet.text(left - 0.08, y, label, align="right")


def axis_label(quantity: str, unit: str) -> str:
    """``frequency [Hz]``."""
    return f"{quantity} [{unit}]" if unit else quantity


def label_width(scale: Scale) -> float:
    """Room that the tick labels of a vertical axis need, inches."""
    return max(map(text_width, scale.labels), default=0.0) + 0.1


def key_rows(entries: Sequence[Entry], width: float) -> tuple[tuple[Entry, ...], ...]:
    """Legend entries broken into rows no wider than ``width`` inches."""
    rows: list[list[Entry]] = []
    free = 0.0
    for entry in entries:
        needed = _entry_width(entry)
        if not rows or needed > free:
            rows.append([])
            free = width
        rows[-1].append(entry)
        free -= needed
    return tuple(map(tuple, rows))


def _entry_width(entry: Entry) -> float:
    return _HANDLE_IN + text_width(entry.label) + 2.2 * EM_IN


def draw_key(sheet: Sheet, rows: Sequence[Sequence[Entry]], left: float, top: float) -> None:
    """A legend that hides nothing: rows of handle and label downwards from (left, top)."""
    for number, row in enumerate(rows):
        middle, at = top - (number + 0.5) * LINE_IN, left
        for entry in row:
            draw_entry(sheet, entry, at, middle)
            at += _entry_width(entry)


def draw_entry(sheet: Sheet, entry: Entry, left: float, middle: float) -> None:
    """Handle and label of one legend entry."""
    if entry.stroke.dot:
        centre = np.array([(left + _HANDLE_IN / 2.0, middle)])
        sheet.line(centre, entry.stroke)
    else:
        sheet.line(np.array([(left, middle), (left + _HANDLE_IN, middle)]), entry.stroke)
    sheet.text(left + _HANDLE_IN + 0.08, middle, entry.label, colour=BLACK)
