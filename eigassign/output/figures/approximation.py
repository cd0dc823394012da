"""Expansion against exact frequencies over time and over entries of q or y (the paper's Figure 3).

Over two entries there are maps, else curves: frequency above, errors below.
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
    Field,
    FigurePlan,
    Graph,
    Look,
    Maps,
    Mark,
    Panel,
    Rule,
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
    """The figure over ``over``, if there is something on it.

    ``x0`` is the expansion point in the coordinates ``names``; ``kind`` ends the file's name.
    """
    if over is None or not over.axes or min(axis.size for axis in over.axes) < 2:
        return
    shown_in = [
        handy_unit(unit, axis[0], axis[-1])
        for unit, axis in zip(over.units, over.axes, strict=True)
    ]
    sizes = {name: size for name, (_, size) in zip(over.names, shown_in, strict=True)}
    point = np.array([x0[names.index(n)] / sizes[n] for n in over.names if n in names])
    over = replace(
        over,
        units=tuple(unit for unit, _ in shown_in),
        axes=tuple(a / size for a, size in zip(over.axes, sizes.values(), strict=True)),
    )
    shown = " and ".join(over.names)
    describe = _over_one if len(over.axes) == 1 else _over_two
    yield FigurePlan(
        f"approximation_mode_{study.mode}_{kind}",
        f"Mode {study.mode}: expansion over {shown}",
        f"All else at the expansion point. {_errors(over.values)}",
        f"Exact frequency of mode {study.mode} and expansion errors over {shown}.",
        describe(study, over, point),
    )


def _errors(comparison: Comparison) -> str:
    """The sentence of a caption."""
    return (
        f"Worst error {percent(comparison.worst_taylor)} for the full expansion, "
        f"{percent(comparison.worst_linearised)} for the partially linearised one."
    )


def _over_one(study: ModeStudy, over: DesignMap, point: Floats) -> Graph:
    """Curves over one entry, the expansion point marked."""
    name = short(over.names[0])
    title = f"Mode {study.mode}: expansion against exact over {name}"
    x_label = labelled(name, over.units[0])
    return _compared(title, x_label, over.axes[0], study, over.values, point)


def _compared(
    title: str,
    x_label: str,
    x: Floats,
    study: ModeStudy,
    comparison: Comparison,
    points: Floats | Sequence[float] = (),
) -> Graph:
    """Frequency above, magnitude of the relative errors below; ``points`` are upright lines."""
    taylor, linearised = comparison.worst_taylor, comparison.worst_linearised
    taylor_label = f"Taylor, order {study.order} (worst {percent(taylor)})"
    linearised_label = f"linearised in y (worst {percent(linearised)})"
    uprights = [float(at) for at in points if x.min() <= at <= x.max()]
    frequencies: tuple[Mark, ...] = (
        Curve(comparison.exact_hz, EXACT, "exact"),
        Curve(comparison.taylor_hz, TAYLOR, taylor_label),
        Curve(comparison.linearised_hz, LINEARISED, linearised_label),
        *(Rule(at, POINT, "expansion point", upright=True) for at in uprights),
    )
    errors: tuple[Mark, ...] = (
        Curve(100.0 * np.abs(comparison.taylor_error), TAYLOR),
        Curve(100.0 * np.abs(comparison.linearised_error), LINEARISED),
        *(Rule(at, POINT, upright=True) for at in uprights),
    )
    panels = (
        Panel("frequency [Hz]", frequencies, 1.9),
        Panel("|error| [%]", errors, 1.35, logarithmic=True),
    )
    return Graph(title, x_label, x, panels)


def _over_two(study: ModeStudy, over: DesignMap, point: Floats) -> Maps:
    """Exact frequency and both errors side by side, the expansion point marked on each."""
    values, names = over.values, " and ".join(short(n, 30) for n in over.names)
    found = (
        (f"Taylor, order {study.order}", values.taylor_error, values.worst_taylor),
        ("linearised in y", values.linearised_error, values.worst_linearised),
    )
    x_label, y_label = (labelled(short(over.names[k], 20), over.units[k]) for k in (0, 1))
    return Maps(
        title=f"Mode {study.mode}: expansion against exact over {names}",
        labels=(x_label, y_label),
        axes=(over.axes[0], over.axes[1]),
        fields=(
            Field(("exact", "frequency [Hz]"), values.exact_hz),
            *(
                Field(
                    (what, f"|error| [%], worst {percent(worst)}"),
                    100.0 * np.abs(error),
                    holds=(0.0, 1e-10),  # %: a map never zooms in on less
                )
                for what, error, worst in found
            ),
        ),
        point=point if point.size == 2 else None,
        point_label="expansion point",
    )
