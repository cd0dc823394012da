"""The figures that are curves: joints, approximation, assignment, other modes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from eigassign.output import ink
from eigassign.output.chart import Band, Curve, chart
from eigassign.output.formats import percent
from eigassign.output.frame import Entry
from eigassign.output.ink import Sheet, Stroke, short
from eigassign.study.findings import (
    Comparison,
    DesignMap,
    Findings,
    ModeStudy,
    OtherModes,
    TargetStudy,
)

Floats = NDArray[np.float64]

EXACT = Stroke(ink.GREY, 3.2)
TAYLOR = Stroke(ink.VERMILLION, 1.4)
LINEARISED = Stroke(ink.BLUE, 1.4, (5.0, 1.8))
TARGET = Stroke(ink.BLACK, 1.6, (1.4, 1.4))
INITIAL = Stroke(ink.ORANGE, 1.8, (6.0, 1.5, 1.4, 1.5))
OPTIMAL = Stroke(ink.SKY, 3.2)
PREDICTED = Stroke(ink.BLUE, 1.3, (5.0, 1.8))


def joints(findings: Findings) -> Sheet:
    """q(t), one panel for each unit."""
    units = tuple(dict.fromkeys(findings.q_units))
    strokes = [ink.series_stroke(i) for i in range(len(findings.q_names))]
    bands = [
        Band(
            {"rad": "joint angle", "m": "joint stroke"}.get(unit, "coordinate"),
            unit,
            tuple(
                Curve(findings.q[:, i], strokes[i])
                for i, own in enumerate(findings.q_units)
                if own == unit
            ),
            2.6 if len(units) == 1 else 1.8,
        )
        for unit in units
    ]
    entries = [Entry(short(n), s) for n, s in zip(findings.q_names, strokes, strict=True)]
    return chart(f"Coordinates along {findings.along}", _time(findings), bands, entries)


def _time(findings: Findings) -> tuple[str, str, Floats]:
    return ("time", "s", findings.time_s)


def _where(findings: Findings) -> str:
    """Said in a title where there are several trajectories."""
    return f", {findings.along}" if findings.only is not None else ""


def over_time(findings: Findings, study: ModeStudy, comparison: Comparison) -> Sheet:
    """Exact, Taylor and linearised frequency along the trajectory, and both errors."""
    title = f"Mode {study.mode}: expansion against exact along {findings.along}, initial design"
    bands = comparison_bands(comparison)
    return chart(title, _time(findings), bands, comparison_entries(study, comparison))


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


def assignment(findings: Findings, target: TargetStudy) -> Sheet:
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
        f"Mode {target.mode}: assigned frequency{_where(findings)}", _time(findings), bands, entries
    )


def others(findings: Findings, modes: OtherModes) -> Sheet:
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
        f"Next modes before and after, exact{_where(findings)}", _time(findings), [band], entries
    )
