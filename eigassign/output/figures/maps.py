"""Expansion against exact over entries of q or y: maps over two, curves over one (Figure 3)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from eigassign.case.units import handy_unit
from eigassign.output.figures.curves import over_one, worst_errors
from eigassign.output.figures.graph import Field, FigurePlan, Maps, labelled, short
from eigassign.output.formats import percent
from eigassign.study.results import DesignMap, ModeStudy

Floats = NDArray[np.float64]
_NOTHING = (0.0, 1e-10)  # percent: an error map never zooms in on less


def approximation(
    study: ModeStudy,
    over: DesignMap | None,
    x0: Floats,
    names: Sequence[str],
    kind: str,
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
    describe = over_one if len(over.axes) == 1 else over_two
    yield FigurePlan(
        f"approximation_mode_{study.mode}_{kind}",
        f"Mode {study.mode}: expansion over {shown}",
        f"All else at the expansion point. {worst_errors(over.values)}",
        f"Exact frequency of mode {study.mode} and expansion errors over {shown}.",
        describe(study, over, point),
    )


def over_two(study: ModeStudy, over: DesignMap, point: Floats) -> Maps:
    """Exact frequency and both errors side by side, the expansion point marked on each."""
    values, names = over.values, " and ".join(short(n, 30) for n in over.names)
    taylor, linearised = (100.0 * np.abs(e) for e in (values.taylor_error, values.linearised_error))
    headings = (
        (f"Taylor, order {study.order}", f"|error| [%], worst {percent(values.worst_taylor)}"),
        ("linearised in y", f"|error| [%], worst {percent(values.worst_linearised)}"),
    )
    return Maps(
        title=f"Mode {study.mode}: expansion against exact over {names}",
        labels=(_axis(over, 0), _axis(over, 1)),
        axes=(over.axes[0], over.axes[1]),
        fields=(
            Field(("exact", "frequency [Hz]"), values.exact_hz),
            Field(headings[0], taylor, _NOTHING),
            Field(headings[1], linearised, _NOTHING),
        ),
        point=point if point.size == 2 else None,
        point_label="expansion point",
    )


def _axis(over: DesignMap, k: int) -> str:
    return labelled(short(over.names[k], 20), over.units[k])
