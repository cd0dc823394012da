"""The figures that are curves: joints, approximation, assignment, other modes.

Curves over one variable in stacked panels: most figures of the report are this.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.output.figures import ink
from eigassign.output.figures.frame import (
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
from eigassign.output.figures.ink import BLACK, GREY, LINE_IN, Box, Sheet, Stroke, short
from eigassign.output.figures.lettering import text_width
from eigassign.output.figures.ticks import Scale, linear, logarithmic
from eigassign.output.formats import percent
from eigassign.study.results import (
    Comparison,
    DesignMap,
    ModeStudy,
    OtherModes,
    RunResults,
    TargetStudy,
)

# --- The figures that are curves: joints, approximation, assignment, other modes

Floats = NDArray[np.float64]

EXACT = Stroke(ink.GREY, 3.2)
TAYLOR = Stroke(ink.VERMILLION, 1.4)
LINEARISED = Stroke(ink.BLUE, 1.4, (5.0, 1.8))
TARGET = Stroke(ink.BLACK, 1.6, (1.4, 1.4))
INITIAL = Stroke(ink.ORANGE, 1.8, (6.0, 1.5, 1.4, 1.5))
OPTIMAL = Stroke(ink.SKY, 3.2)
PREDICTED = Stroke(ink.BLUE, 1.3, (5.0, 1.8))


def joints(results: RunResults) -> Sheet:
    """q(t), one panel for each unit."""
    units = tuple(dict.fromkeys(results.q_units))
    strokes = [ink.series_stroke(i) for i in range(len(results.q_names))]
    bands = [
        Band(
            {"rad": "joint angle", "m": "joint stroke"}.get(unit, "coordinate"),
            unit,
            tuple(
                Curve(results.q[:, i], strokes[i])
                for i, own in enumerate(results.q_units)
                if own == unit
            ),
            2.6 if len(units) == 1 else 1.8,
        )
        for unit in units
    ]
    entries = [Entry(short(n), s) for n, s in zip(results.q_names, strokes, strict=True)]
    return chart(f"Coordinates along {results.along}", _time(results), bands, entries)


def _time(results: RunResults) -> tuple[str, str, Floats]:
    return ("time", "s", results.time_s)


def _where(results: RunResults) -> str:
    """Said in a title where there are several trajectories."""
    return f", {results.along}" if results.only is not None else ""


def over_time(results: RunResults, study: ModeStudy, comparison: Comparison) -> Sheet:
    """Exact, Taylor and linearised frequency along the trajectory, and both errors."""
    title = f"Mode {study.mode}: expansion against exact along {results.along}, initial design"
    bands = comparison_bands(comparison)
    return chart(title, _time(results), bands, comparison_entries(study, comparison))


def over_one(study: ModeStudy, over: DesignMap, around: Floats) -> Sheet:
    """The same over one parameter, the expansion point marked."""
    (label,) = over.names
    title = f"Mode {study.mode}: expansion against exact over {short(label)}"
    x = (short(label), over.units[0], over.axes[0])
    bands = comparison_bands(over.values)
    entries = comparison_entries(study, over.values)
    inside = [float(v) for v in around if over.axes[0].min() <= v <= over.axes[0].max()]
    if inside:
        entries.append(Entry("expansion point", Stroke(ink.GREY, 0.9, (2.0, 2.0))))
    return chart(title, x, bands, entries, marks=inside)


def comparison_bands(comparison: Comparison) -> list[Band]:
    """Frequency above, magnitude of the relative errors below."""
    frequency = (
        Curve(comparison.exact_hz, EXACT),
        Curve(comparison.taylor_hz, TAYLOR),
        Curve(comparison.linearised_hz, LINEARISED),
    )
    errors = (
        Curve(100.0 * np.abs(comparison.taylor_error), TAYLOR),
        Curve(100.0 * np.abs(comparison.linearised_error), LINEARISED),
    )
    return [
        Band("frequency", "Hz", frequency, 1.9),
        Band("|error|", "%", errors, 1.35, logarithmic=True),
    ]


def comparison_entries(study: ModeStudy, comparison: Comparison) -> list[Entry]:
    """What the three curves are and how far off they get."""
    taylor, linearised = comparison.worst_taylor, comparison.worst_linearised
    return [
        Entry("exact", EXACT),
        Entry(f"Taylor, order {study.order} (worst {percent(taylor)})", TAYLOR),
        Entry(f"linearised in y (worst {percent(linearised)})", LINEARISED),
    ]


def assignment(results: RunResults, target: TargetStudy) -> Sheet:
    """Target, original and optimal frequency in time, and their distance to the target."""
    curves = (
        (target.initial_hz, INITIAL),
        (target.exact_hz, OPTIMAL),
        (target.predicted_hz, PREDICTED),
    )
    frequency = (*(Curve(hz, stroke) for hz, stroke in curves), Curve(target.target_hz, TARGET))
    errors = tuple(Curve(100.0 * (hz / target.target_hz - 1.0), stroke) for hz, stroke in curves)
    entries = [
        Entry("target", TARGET),
        Entry(f"original (worst {percent(target.initial.max_relative)})", INITIAL),
        Entry(f"optimal, exact (worst {percent(target.exact.max_relative)})", OPTIMAL),
        Entry(f"optimal, predicted (worst {percent(target.predicted.max_relative)})", PREDICTED),
    ]
    bands = [
        Band("frequency", "Hz", frequency, 2.0),
        Band("off target", "%", errors, 1.35, zero_line=True),
    ]
    return chart(
        f"Mode {target.mode}: assigned frequency{_where(results)}", _time(results), bands, entries
    )


def others(results: RunResults, modes: OtherModes) -> Sheet:
    """The modes that were not assigned, before and after."""
    curves = []
    for column, mode in enumerate(modes.modes):
        colour = ink.SERIES[column % len(ink.SERIES)]
        before = Stroke(colour, 1.3, (5.0, 1.8))
        curves.append(Curve(modes.initial_hz[:, column], before))
        curves.append(Curve(modes.optimal_hz[:, column], Stroke(colour, 1.8), f"mode {mode}"))
    band = Band("frequency", "Hz", tuple(curves), 2.9)
    entries = [
        Entry("original design", Stroke(ink.BLACK, 1.3, (5.0, 1.8))),
        Entry("optimal design", Stroke(ink.BLACK, 1.8)),
    ]
    return chart(
        f"Next modes before and after, exact{_where(results)}", _time(results), [band], entries
    )


# --- Curves over one variable in stacked panels: most figures of the report are this

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
