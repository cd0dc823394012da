"""Curves over one variable in stacked panels: most figures of the report are this."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.output.frame import (
    TITLE_IN,
    WIDTH_IN,
    Entry,
    Frame,
    axis_label,
    draw_frame,
    draw_key,
    key_rows,
    label_width,
    titled_sheet,
)
from eigassign.output.ink import BLACK, GREY, LINE_IN, Box, Sheet, Stroke
from eigassign.output.lettering import text_width
from eigassign.output.ticks import Scale, linear, logarithmic

Floats = NDArray[np.float64]
_GAP_IN = 0.16
_FOOT_IN = 0.5
_ZERO = Stroke(BLACK, 0.8)
_MARK = Stroke(GREY, 0.9, (3.0, 3.0))


@dataclass(frozen=True)
class Curve:
    """One line of a panel; ``end_label`` is written at its right end instead of in a legend."""

    y: Floats
    stroke: Stroke
    end_label: str = ""


@dataclass(frozen=True)
class Band:
    """One panel of the stack: curves over the common x, on a linear or logarithmic scale."""

    quantity: str
    unit: str
    curves: tuple[Curve, ...]
    height: float
    logarithmic: bool = False
    zero_line: bool = False


def chart(
    title: str,
    x: tuple[str, str, Floats],
    bands: Sequence[Band],
    entries: Sequence[Entry] = (),
    marks: Sequence[float] = (),
) -> Sheet:
    """Panels over x = (quantity, unit, values), legend above; ``marks`` are upright lines."""
    scales = [_scale(band) for band in bands]
    x_scale = linear([x[2]], count=9, margin=0.0 if x[2].size > 1 else 0.5)
    left = 0.28 + max(label_width(scale) for scale in scales)
    width = WIDTH_IN - left - 0.22 - max(_end_width(band) for band in bands)
    rows = key_rows(entries, WIDTH_IN - left)
    top = TITLE_IN + len(rows) * LINE_IN + (0.08 if rows else 0.0)
    height = top + sum(band.height + _GAP_IN for band in bands) - _GAP_IN + _FOOT_IN
    sheet = titled_sheet(height, title)
    draw_key(sheet, rows, left, height - TITLE_IN)
    below = height - top
    for band, scale in zip(bands, scales, strict=True):
        below -= band.height
        frame = Frame((left, below, width, band.height), x_scale, scale)
        draw_frame(sheet, frame, x_labels=band is bands[-1])
        _draw_marks(sheet, frame, marks, zero_line=band.zero_line)
        _draw_curves(sheet, frame, band, x[2])
        below -= _GAP_IN
    x_text = axis_label(x[0], x_scale.unit(x[1]))
    sheet.text(left + width / 2.0, 0.14, x_text, align="center")
    return sheet


def _scale(band: Band) -> Scale:
    values = [curve.y for curve in band.curves]
    if band.logarithmic:
        return logarithmic(values)
    count = max(4, round(3.0 * band.height))
    return linear([*values, np.zeros(1)] if band.zero_line else values, count=count)


def _end_width(band: Band) -> float:
    return max(text_width(curve.end_label) for curve in band.curves)


def _draw_marks(sheet: Sheet, frame: Frame, marks: Sequence[float], *, zero_line: bool) -> None:
    left, bottom, width, height = frame.box
    for at in left + width * frame.x.fraction(np.array(marks, dtype=float)):
        sheet.line(np.array([(at, bottom), (at, bottom + height)]), _MARK)
    if zero_line:
        at = bottom + height * float(frame.y.fraction(np.zeros(1))[0])
        sheet.line(np.array([(left, at), (left + width, at)]), _ZERO)


def _draw_curves(sheet: Sheet, frame: Frame, band: Band, x: Floats) -> None:
    left, bottom, width, height = frame.box
    clip: Box = (left - 0.05, bottom - 0.02, width + 0.1, height + 0.04)
    for curve in band.curves:
        sheet.line(frame.place(x, curve.y), curve.stroke, clip)
    text = axis_label(band.quantity, frame.y.unit(band.unit))
    sheet.text(0.14, bottom + height / 2.0, text, upright=True)
    named = sorted((c for c in band.curves if c.end_label), key=lambda c: float(c.y[-1]))
    ends = [float(frame.place(x[-1:], curve.y[-1:])[0, 1]) for curve in named]
    for curve, at in zip(named, spread(ends, 0.85 * LINE_IN), strict=True):
        sheet.text(left + width + 0.08, at, curve.end_label, colour=curve.stroke.colour)


def spread(wanted: Sequence[float], gap: float) -> list[float]:
    """Ascending places nearest to the ascending ``wanted`` ones with ``gap`` between them."""
    clusters: list[tuple[float, int]] = []  # mean place, how many
    for place in wanted:
        mean, count = place, 1
        while clusters and clusters[-1][0] + gap * (clusters[-1][1] + count) / 2.0 > mean:
            other, size = clusters.pop()
            mean, count = (other * size + mean * count) / (size + count), size + count
        clusters.append((mean, count))
    return [mean + gap * (i - (count - 1) / 2.0) for mean, count in clusters for i in range(count)]
