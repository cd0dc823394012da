"""Expansion against exact over entries of q or y: maps over two, curves over one (Figure 3)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from eigassign.output.figures import style
from eigassign.output.figures.curves import draw_over_one, worst_errors
from eigassign.output.figures.style import FigurePlan, labelled, short
from eigassign.output.formats import percent
from eigassign.study.results import DesignMap, ModeStudy

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]
_POINT: dict[str, Any] = {
    "markersize": 5.5,
    "markerfacecolor": "white",
    "markeredgecolor": style.BLACK,
    "label": "expansion point",
}
_NOTHING = np.array([0.0, 1e-10])  # percent: an error map never zooms in on less


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
    point = np.array([x0[names.index(n)] for n in over.names if n in names])
    shown = " and ".join(over.names)
    draw = draw_over_one if len(over.axes) == 1 else draw_over_two
    yield FigurePlan(
        f"approximation_mode_{study.mode}_{kind}",
        f"Mode {study.mode}: expansion over {shown}",
        f"All else at the expansion point. {worst_errors(over.values)}",
        f"Exact frequency of mode {study.mode} and expansion errors over {shown}.",
        partial(draw, study, over, point),
    )


def draw_over_two(study: ModeStudy, over: DesignMap, point: Floats) -> Figure:
    """Exact frequency and both errors side by side, the expansion point marked on each."""
    values, names = over.values, " and ".join(short(n, 30) for n in over.names)
    figure = style.new_figure(f"Mode {study.mode}: expansion against exact over {names}", 3.2)
    panels = figure.subplots(1, 3, sharex=True, sharey=True)
    errors = (100.0 * np.abs(e) for e in (values.taylor_error, values.linearised_error))
    headings = (
        "exact\nfrequency [Hz]",
        f"Taylor, order {study.order}\n|error| [%], worst {percent(values.worst_taylor)}",
        f"linearised in y\n|error| [%], worst {percent(values.worst_linearised)}",
    )
    x_label, y_label = (labelled(short(over.names[i], 20), over.units[i]) for i in (0, 1))
    shown = (values.exact_hz, *errors)
    for axes, heading, numbers in zip(panels, headings, shown, strict=True):
        held = style.bounds([numbers] if axes is panels[0] else [numbers, _NOTHING])
        filled_contours(figure, axes, over.axes, numbers, held)
        axes.set_title(heading)
        axes.set_xlabel(x_label, loc="left")  # a power of ten stands at the right
        if point.size == 2:
            (dot,) = axes.plot(*point, "o", **_POINT)
        axes.set(xlim=over.axes[0][[0, -1]], ylim=over.axes[1][[0, -1]])
    panels[0].set_ylabel(y_label)
    panels[0].locator_params(axis="x", nbins=3)
    panels[0].ticklabel_format(scilimits=(-2, 4))
    if point.size == 2:
        figure.legend(handles=[dot], loc="outside lower left")
    return figure


def filled_contours(
    figure: Figure,
    axes: Axes,
    grids: Sequence[Floats],
    values: Floats,
    held: tuple[float, float],
) -> None:
    """Bands between round levels that enclose ``held``, with a bar that names the levels."""
    from matplotlib.ticker import MaxNLocator

    low, high = held
    levels = MaxNLocator(7, steps=[1, 2, 2.5, 5, 10]).tick_values(low, high)
    bands = axes.contourf(*grids, np.ma.masked_invalid(values.T), levels=levels)
    axes.grid(visible=False)
    bar = figure.colorbar(bands, ax=axes, aspect=14, pad=0.03, format="{x:g}")
    bar.outline.set_visible(False)
    bar.ax.tick_params(length=0.0, labelsize=style.SMALL_PT)
