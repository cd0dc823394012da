"""Exact frequency and the errors of both expansions over two parameters (Figure 3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from contourpy import FillType, contour_generator
from matplotlib.path import Path
from numpy.typing import NDArray

from eigassign.output.figures.frame import (
    TITLE_IN,
    WIDTH_IN,
    Frame,
    axis_label,
    draw_frame,
    label_width,
    titled_sheet,
)
from eigassign.output.figures.ink import BLACK, LINE_IN, Box, Sheet, ramp, rectangle, short
from eigassign.output.figures.ticks import Scale, levels, linear
from eigassign.output.formats import percent
from eigassign.study.results import DesignMap, ModeStudy

Floats = NDArray[np.float64]
_MAP_IN = 1.75
_FOOT_IN = 0.72
_BAR_IN = 0.12
_BETWEEN_IN = 0.16
_NOTHING = np.array([0.0, 1e-10])  # percent: an error map never zooms in on less
_WHITE = (1.0, 1.0, 1.0)


@dataclass(frozen=True)
class _Map:
    heading: tuple[str, str]
    values: Floats  # (n_1, n_2)
    bands: Scale


def over_two(study: ModeStudy, over: DesignMap, around: Floats) -> Sheet:
    """Three maps side by side, the expansion point marked on each."""
    maps = _maps(study, over)
    x, y = (linear([over.axes[i]], count=count, margin=0.0) for i, count in enumerate((4, 5)))
    left = 0.28 + label_width(y)
    bars = [_BAR_IN + 0.08 + label_width(m.bands) + _BETWEEN_IN for m in maps]
    width = (WIDTH_IN - left - sum(bars)) / len(maps)
    height = TITLE_IN + 2.0 * LINE_IN + 0.06 + _MAP_IN + _FOOT_IN
    names = " and ".join(short(n, 30) for n in over.names)
    sheet = titled_sheet(height, f"Mode {study.mode}: expansion against exact over {names}")
    at = left
    for number, (one, room) in enumerate(zip(maps, bars, strict=True)):
        shown = y if number == 0 else _unlabelled(y)
        frame = Frame((at, _FOOT_IN, width, _MAP_IN), x, shown)
        _draw_map(sheet, frame, one, over.axes)
        _draw_point(sheet, frame, around)
        text = axis_label(short(over.names[0], 20), x.unit(over.units[0]))
        sheet.text(at + width / 2.0, _FOOT_IN - 0.33, text, align="center")
        at += width + room
    label = axis_label(short(over.names[1], 20), y.unit(over.units[1]))
    sheet.text(0.14, _FOOT_IN + _MAP_IN / 2.0, label, upright=True)
    sheet.dot((left + 0.05, 0.12), 5.5, _WHITE, BLACK)
    sheet.text(left + 0.15, 0.12, "expansion point")
    return sheet


def _maps(study: ModeStudy, over: DesignMap) -> tuple[_Map, ...]:
    values = over.values
    taylor, linearised = (
        100.0 * np.abs(error) for error in (values.taylor_error, values.linearised_error)
    )
    exact = levels([values.exact_hz])
    return (
        _Map(("exact", f"frequency [{exact.unit('Hz')}]"), values.exact_hz, exact),
        _error_map(f"Taylor, order {study.order}", taylor, values.worst_taylor),
        _error_map("linearised in y", linearised, values.worst_linearised),
    )


def _error_map(heading: str, error: Floats, worst: float) -> _Map:
    bands = levels([error, _NOTHING], count=8)
    below = f"|error| [{bands.unit('%')}], worst {percent(worst)}"
    return _Map((heading, below), error, bands)


def _unlabelled(scale: Scale) -> Scale:
    labels = ("",) * len(scale.labels)
    return Scale(scale.low, scale.high, scale.positions, labels, scale.exponent)


def _draw_map(sheet: Sheet, frame: Frame, one: _Map, axes: tuple[Floats, ...]) -> None:
    left, bottom, width, height = frame.box
    top = bottom + height + 0.06
    sheet.text(left, top + 1.5 * LINE_IN, one.heading[0], bold=True)
    sheet.text(left, top + 0.5 * LINE_IN, one.heading[1], points=8.0)
    places = frame.place(axes[0], np.zeros(axes[0].size))[:, 0]
    heights = frame.place(np.zeros(axes[1].size), axes[1])[:, 1]
    known = np.ma.masked_invalid(one.values.T)
    contours = contour_generator(places, heights, known, fill_type=FillType.OuterCode)
    edges = one.bands.positions
    beyond = edges[1] - edges[0]  # a value on an outermost level belongs to its band
    for number, low in enumerate((edges[0] - beyond, *edges[1:-1])):  # to the top: no seams
        colour = _band_colour(number, len(edges) - 1)
        for points, codes in zip(*contours.filled(low, edges[-1] + beyond), strict=True):
            sheet.area(Path(points, codes), colour)
    draw_frame(sheet, frame, grid=False)
    _draw_bar(sheet, (left + width + 0.08, bottom, _BAR_IN, height), one.bands)


def _band_colour(number: int, count: int) -> tuple[float, float, float]:
    return ramp((number + 0.5) / count)


def _draw_bar(sheet: Sheet, box: Box, bands: Scale) -> None:
    left, bottom, width, height = box
    count = len(bands.positions) - 1
    for number in range(count):
        piece = (left, bottom + number * height / count, width, height / count)
        sheet.area(rectangle(piece), _band_colour(number, count))
    every = 1 + len(bands.labels) // 7
    for number, label in list(enumerate(bands.labels))[::every]:
        sheet.text(left + width + 0.05, bottom + number * height / count, label, points=8.0)


def _draw_point(sheet: Sheet, frame: Frame, around: Floats) -> None:
    """The expansion point, where it lies on the map."""
    if around.size != 2:
        return
    ((x, y),) = frame.place(around[:1], around[1:])
    left, bottom, width, height = frame.box
    if left <= x <= left + width and bottom <= y <= bottom + height:
        sheet.dot((x, y), 5.5, _WHITE, BLACK)
