"""Expansion against exact frequencies over time and over entries of q or y (the paper's Figure 3).

Frequency above, errors below; over one of two entries the worst of all values of the other.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from eigassign.case.units import handy_unit
from eigassign.facts import percent
from eigassign.output.figures import graph
from eigassign.output.figures.curves import suffix
from eigassign.output.figures.graph import (
    Curve,
    FigurePlan,
    Graph,
    Look,
    Mark,
    Panel,
    Rule,
    Shade,
    labelled,
    short,
)
from eigassign.study.results import Comparison, DesignMap, ModeStudy, RunResults

Floats = NDArray[np.float64]
EXACT = Look(graph.GREY, 3.2)
TAYLOR = Look(graph.VERMILLION, 1.4)
LINEARISED = Look(graph.BLUE, 1.4, "dashed")
POINT = Look(graph.GREY, 0.9, "fine")


def over_time(results: RunResults, study: ModeStudy, comparison: Comparison) -> FigurePlan:
    """Exact, Taylor and linearised frequency along the trajectory, and both errors."""
    title = f"Mode {study.mode}: expansion against exact along {results.along}, initial design"
    return FigurePlan(
        f"approximation_mode_{study.mode}_time{suffix(results)}",
        f"Mode {study.mode}: expansion along {results.along}",
        f"Exact, Taylor and linearised frequency at the initial design. {_errors(comparison)}",
        f"Frequency of mode {study.mode} over time and the errors of both expansions.",
        _compared(title, "time [s]", results.time_s, study, comparison),
    )


def over_entries(
    study: ModeStudy, over: DesignMap | None, x0: Floats, names: Sequence[str], kind: str
) -> Iterator[FigurePlan]:
    """A figure for each entry of ``over``, if there is something on it.

    ``x0`` is the expansion point in the coordinates ``names``; ``kind`` ends the files' names.
    """
    if over is None or not over.axes or min(axis.size for axis in over.axes) < 2:
        return
    for k, (name, unit, axis) in enumerate(zip(over.names, over.units, over.axes, strict=True)):
        unit, size = handy_unit(unit, axis[0], axis[-1])
        point = [x0[names.index(name)] / size] if name in names else []
        title = f"Mode {study.mode}: expansion against exact over {short(name)}"
        other = "".join(f", worst over {short(n)}" for n in over.names if n != name)
        yield FigurePlan(
            f"approximation_mode_{study.mode}_{kind}{'' if k == 0 else f'_{k + 1}'}",
            f"Mode {study.mode}: expansion over {name}",
            f"All else at the expansion point{other}. {_errors(over.values)}",
            f"Exact frequency of mode {study.mode} and expansion errors over {name}{other}.",
            _compared(
                title, labelled(short(name), unit), axis / size, study, over.values, point, k
            ),
        )


def _errors(comparison: Comparison) -> str:
    """The sentence of a caption."""
    return (
        f"Worst error {percent(comparison.worst_taylor)} for the full expansion, "
        f"{percent(comparison.worst_linearised)} for the partially linearised one."
    )


def _compared(
    title: str,
    x_label: str,
    x: Floats,
    study: ModeStudy,
    comparison: Comparison,
    points: Sequence[float] = (),
    along: int = 0,
) -> Graph:
    """Frequency above, magnitude of the relative errors below; ``points`` are upright lines.

    ``x`` is the axis ``along`` of the comparison; of another one the range and the worst.
    """
    exact, *both = (
        np.moveaxis(values, along, 0).reshape(x.size, -1)
        for values in (comparison.exact_hz, comparison.taylor_error, comparison.linearised_error)
    )
    taylor_label = f"Taylor, order {study.order} (worst {percent(comparison.worst_taylor)})"
    linearised_label = f"linearised in y (worst {percent(comparison.worst_linearised)})"
    uprights = [float(at) for at in points if x.min() <= at <= x.max()]
    single = exact.shape[1] == 1
    frequencies: tuple[Mark, ...] = (
        (
            Curve(comparison.exact_hz, EXACT, "exact"),
            Curve(comparison.taylor_hz, TAYLOR, taylor_label),
            Curve(comparison.linearised_hz, LINEARISED, linearised_label),
        )
        if single
        else (
            Shade(*_range(exact), EXACT.colour, "exact", 0.5),
            *(Curve(edge, replace(EXACT, width=1.2)) for edge in _range(exact)),
        )
    )
    labels = ("", "") if single else (taylor_label, linearised_label)
    errors: tuple[Mark, ...] = tuple(
        Curve(100.0 * _range(np.abs(error))[1], look, label)
        for error, look, label in zip(both, (TAYLOR, LINEARISED), labels, strict=True)
    )
    panels = (
        Panel(
            "frequency [Hz]",
            (*frequencies, *(Rule(at, POINT, "expansion point", upright=True) for at in uprights)),
            1.9,
        ),
        Panel(
            "|error| [%]",
            (*errors, *(Rule(at, POINT, upright=True) for at in uprights)),
            1.35,
            logarithmic=True,
        ),
    )
    return Graph(title, x_label, x, panels)


def _range(values: Floats) -> tuple[Floats, Floats]:
    """The lowest and highest finite value of each row, NaN where there is none."""
    none = ~np.isfinite(values).any(axis=1)
    low, high = (
        np.nanmin(values, axis=1, initial=np.inf),
        np.nanmax(values, axis=1, initial=-np.inf),
    )
    return np.where(none, np.nan, low), np.where(none, np.nan, high)
