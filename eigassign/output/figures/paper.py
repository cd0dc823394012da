"""Descriptions drawn with matplotlib, and all figures of a plan as files."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from eigassign.output.figures import graph, style
from eigassign.output.figures.graph import (
    BLACK,
    Bars,
    Curve,
    FigurePlan,
    Graph,
    Look,
    Maps,
    Panel,
    Rule,
    Shade,
    short,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]
_DASHES: dict[str, Any] = {
    "solid": "solid",
    "dashed": (0, (5.0, 1.8)),
    "dotted": (0, (1.4, 1.4)),
    "dash-dotted": (0, (6.0, 1.5, 1.4, 1.5)),
    "fine": (0, (3.0, 3.0)),
}


def render(
    plans: Sequence[FigurePlan], formats: Sequence[str] = style.FORMATS[:1]
) -> dict[str, bytes]:
    """Files of each figure in each format of `FORMATS` asked for, by name."""
    files: dict[str, bytes] = {}
    if not plans or not formats:
        return files
    with style.applied():
        for plan in plans:
            figure = _drawn_plan(plan)
            for kind in formats:
                files[f"{plan.name}.{kind}"] = style.encoded(figure, kind)
    return files


def draw(plan: FigurePlan) -> Figure:
    """The figure of a plan, in `STYLE`."""
    with style.applied():
        return _drawn_plan(plan)


def _drawn_plan(plan: FigurePlan) -> Figure:
    shown = plan.shows
    if isinstance(shown, Graph):
        return _graph(shown)
    if isinstance(shown, Bars):
        return _bars(shown)
    return _maps(shown) if isinstance(shown, Maps) else shown()


# --- Graphs


def _graph(shown: Graph) -> Figure:
    heights = [panel.height for panel in shown.panels]
    tall = sum(heights) + 0.15 * len(heights) + 1.1
    if shown.beside:
        entries = sum(bool(mark.label) for panel in shown.panels for mark in panel.marks)
        tall = max(4.9, 0.2 * (entries + 3) + 0.4)  # inches; 0.2 a line of the legend
    figure = style.new_figure(shown.title, tall)
    found = figure.subplots(
        len(heights), 1, sharex=True, squeeze=False, gridspec_kw={"height_ratios": heights}
    )
    panels = list(found[:, 0])
    panels[-1].set_xlabel(shown.x_label)
    figure.align_ylabels()
    for axes, panel in zip(panels, shown.panels, strict=True):
        _ordinate(axes, panel)
    if shown.x_limits is not None:
        panels[0].set_xlim(shown.x_limits)
    if shown.x_logarithmic:
        own = [curve.x for panel in shown.panels for curve in panel.curves if curve.x is not None]
        _logarithmic(panels[0], "x", graph.decades(own))
    if shown.counted:
        low, high = panels[0].get_xlim()
        panels[0].set_xticks(range(int(np.ceil(low)), int(high) + 1, max(1, int(high - low) // 10)))
    handles: list[tuple[str, Any]] = []
    for axes, panel in zip(panels, shown.panels, strict=True):
        handles += _drawn(axes, panel, shown)
    if shown.beside:
        _key_beside(figure, handles)
    elif handles:
        style.legend_above(panels[0], [handle for _, handle in handles])
    return figure


def _ordinate(axes: Axes, panel: Panel) -> None:
    axes.set_ylabel(panel.label)
    if panel.logarithmic:
        _logarithmic(axes, "y", panel.limits, cut=panel.cut)
        return
    axes.set_ylim(panel.limits)
    if panel.names:
        axes.set_yticks(-np.arange(len(panel.names)), [short(name) for name in panel.names])
    axes.yaxis.set_offset_position("right")  # a power of ten, away from the legend


def _drawn(axes: Axes, panel: Panel, shown: Graph) -> list[tuple[str, Any]]:
    """Draw all marks; the entries of the legend with their groups."""
    from matplotlib.lines import Line2D

    entries: list[tuple[str, Any]] = []
    for at, mark in enumerate(panel.marks):
        above = 2.0 + 1e-3 * at
        group = ""
        if isinstance(mark, Curve):
            handle, group = _curve(axes, panel, mark, shown.x, above), mark.group
        elif isinstance(mark, Shade):
            handle = _shade(axes, panel, mark, shown.x)
        else:
            handle = _rule(axes, mark)
        if mark.label:
            entries.append((group, handle))
    for name, place, colour in panel.ends():
        axes.annotate(
            name, (1.0, place), (6.0, 0.0), color=colour, va="center",
            xycoords=("axes fraction", "data"), textcoords="offset points",
        )  # fmt: skip
    return entries + [("", Line2D([], [], **_line(look), label=name)) for name, look in panel.key]


def _line(look: Look) -> dict[str, Any]:
    """The look in matplotlib's words."""
    return {
        "color": look.colour,
        "linewidth": look.width,
        "linestyle": _DASHES[look.dash] if look.width else "none",
        "marker": look.marker,
        "markersize": look.size,
        "markerfacecolor": look.colour if look.filled else "white",
        "markeredgewidth": 0.8,
    }


def _curve(axes: Axes, panel: Panel, curve: Curve, x: Floats, above: float) -> Any:
    """A single point of a line is a dot."""
    at, look = x if curve.x is None else curve.x, _line(curve.look)
    if at.size == 1 and not curve.look.marker:
        look["marker"] = "o"
    return axes.plot(
        at, panel.shown(curve), **look, label=short(curve.label, 60), zorder=above,
        clip_on=not curve.look.marker,
    )[0]  # fmt: skip


def _shade(axes: Axes, panel: Panel, shade: Shade, x: Floats) -> Any:
    x = x if shade.x is None else shade.x
    low, high = panel.edges(shade, x)
    return axes.fill_between(
        x, low, high, color=shade.colour, alpha=shade.opacity, linewidth=0.0,
        label=short(shade.label, 60),
    )  # fmt: skip


def _rule(axes: Axes, rule: Rule) -> Any:
    look = {key: value for key, value in _line(rule.look).items() if not key.startswith("marker")}
    line = (axes.axvline if rule.upright else axes.axhline)(rule.at, **look, label=rule.label)
    if rule.note:
        axes.annotate(
            short(rule.note, 60), (0.0, rule.at), (4.0, 2.0), textcoords="offset points",
            va="bottom", xycoords=("axes fraction", "data"), size=style.SMALL_PT,
        )  # fmt: skip
    return line


def _key_beside(figure: Figure, handles: Sequence[tuple[str, Any]]) -> None:
    """A legend to the right, its groups headed by their names where there are several.

    What lies on top comes first.
    """
    from matplotlib.lines import Line2D

    groups = dict.fromkeys(group for group, _ in handles if group)
    entries: list[Any] = []
    bold: list[int] = []
    for group in [*reversed(groups), ""]:
        own = [handle for of, handle in handles if of == group]
        if group and len(groups) > 1:
            bold.append(len(entries))
            entries.append(Line2D([], [], linestyle="none", label=group))
        entries += own
    key = figure.legend(handles=entries, loc="outside right upper", handlelength=1.6)
    for place in bold:
        key.get_texts()[place].set_fontweight("bold")


def _logarithmic(axes: Axes, which: str, limits: tuple[float, float], *, cut: bool = False) -> None:
    """Make axis ``which`` logarithmic; ``cut``: the lowest label says ≤, for values below it."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axes.set(**{f"{which}scale": "log", f"{which}lim": limits})
    axis = axes.xaxis if which == "x" else axes.yaxis
    axis.set_major_locator(LogLocator(numticks=9))
    axis.set_minor_formatter(NullFormatter())
    low = limits[0] * (1.0 + 1e-9)
    axis.set_major_formatter(
        FuncFormatter(lambda at, _: ("≤" if cut and at <= low else "") + graph.power(at))
    )


# --- Bars


def _bars(shown: Bars) -> Figure:
    """A group of bars a name, one colour a group of them."""
    height = float(np.clip(0.16 * len(shown.names) * (len(shown.groups) + 1), 1.2, 6.0))
    figure = style.new_figure(shown.title, height + 1.25)
    axes = figure.subplots()
    axes.set_xlabel(shown.label)
    width = 0.8 / len(shown.groups)
    for k, group in enumerate(shown.groups):
        there = np.isfinite(group.mean)
        at = np.flatnonzero(there) + (k + 0.5) * width - 0.4
        look: dict[str, Any] = {"color": group.colour, "label": short(group.label, 60)}
        axes.barh(at, group.mean[there], 0.85 * width, **look)
        axes.hlines(at, group.mean[there], group.most[there], color=BLACK, linewidth=0.8)
    axes.axvline(0.0, color=BLACK, linewidth=0.8)
    axes.set_yticks(range(len(shown.names)), [short(name) for name in shown.names])
    axes.set_ylim(len(shown.names) - 0.5, -0.5)
    axes.margins(x=0.05)
    style.legend_above(axes, axes.get_legend_handles_labels()[0])
    return figure


# --- Maps


def _maps(shown: Maps) -> Figure:
    figure = style.new_figure(shown.title, 3.2)
    panels = figure.subplots(1, len(shown.fields), sharex=True, sharey=True)
    for axes, field in zip(panels, shown.fields, strict=True):
        held = graph.bounds([field.values, np.array(field.holds)])
        _contours(figure, axes, shown.axes, field.values, held)
        axes.set_title("\n".join(field.heading))
        axes.set_xlabel(shown.labels[0], loc="left")  # a power of ten stands at the right
        if shown.point is not None:
            (dot,) = axes.plot(
                *shown.point, "o", markersize=5.5, markerfacecolor="white", markeredgecolor=BLACK,
                label=shown.point_label,
            )  # fmt: skip
        axes.set(xlim=shown.axes[0][[0, -1]], ylim=shown.axes[1][[0, -1]])
    panels[0].set_ylabel(shown.labels[1])
    panels[0].locator_params(axis="x", nbins=3)
    panels[0].ticklabel_format(scilimits=(-2, 4))
    if shown.point is not None:
        figure.legend(handles=[dot], loc="outside lower left")
    return figure


def _contours(
    figure: Figure, axes: Axes, grids: Sequence[Floats], values: Floats, held: tuple[float, float]
) -> None:
    """Bands between round levels that enclose ``held``, with a bar that names the levels."""
    from matplotlib.ticker import MaxNLocator

    levels = MaxNLocator(7, steps=[1, 2, 2.5, 5, 10]).tick_values(*held)
    bands = axes.contourf(*grids, np.ma.masked_invalid(values.T), levels=levels)
    axes.grid(visible=False)
    bar = figure.colorbar(bands, ax=axes, aspect=14, pad=0.03, format="{x:g}")
    bar.outline.set_visible(False)
    bar.ax.tick_params(length=0.0, labelsize=style.SMALL_PT)
