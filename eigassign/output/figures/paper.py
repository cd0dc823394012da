"""Descriptions drawn with matplotlib, and all figures of a plan as files."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from eigassign.output.figures import graph, style
from eigassign.output.figures.graph import (
    Curve,
    FigurePlan,
    Graph,
    Look,
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
    return _graph(shown) if isinstance(shown, Graph) else shown()


# --- Graphs

LEFT, RIGHT, BOTTOM, GAP = 0.8, 0.15, 0.55, 0.15  # inches around the panels, and between them
ROW, LETTER = 0.18, 0.075  # inches of a line of the legend, and of a letter


def _graph(shown: Graph) -> Figure:
    heights = [panel.height for panel in shown.panels]
    labels = [mark.label for panel in shown.panels for mark in panel.marks if mark.label]
    labels += [name for panel in shown.panels for name, _ in panel.key]
    rows = 0 if shown.beside else -(-len(labels) // style.columns(labels))
    above = 0.4 + ROW * rows  # with the title
    tall = above + sum(heights) + GAP * (len(heights) - 1) + BOTTOM
    if shown.beside:
        tall = max(tall, 0.8 + ROW * (len(labels) + 3))
    figure = style.new_figure(shown.title, tall)
    panels = _placed(figure, shown, tall - above)
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
        _key_beside(figure, panels, handles)
    elif handles:
        panels[0].legend(
            handles=[handle for _, handle in handles], loc="lower left", bbox_to_anchor=(0.0, 1.0),
            ncols=style.columns(labels),
        )  # fmt: skip
    return figure


def _placed(figure: Figure, shown: Graph, top: float) -> list[Axes]:
    """Axes one below the other from ``top`` inches, with room for names at their sides."""
    width, tall = figure.get_size_inches()
    names = [short(name) for panel in shown.panels for name in panel.names]
    ends = [curve.end for panel in shown.panels for curve in panel.curves]
    left = max(LEFT, 0.2 + LETTER * max(map(len, names), default=0))
    wide = width - left - RIGHT - LETTER * max(map(len, ends), default=0)
    found: list[Axes] = []
    for panel in shown.panels:
        box = (left / width, (top - panel.height) / tall, wide / width, panel.height / tall)
        axes = figure.add_axes(box, sharex=found[0] if found else None)
        axes.yaxis.set_label_coords((0.2 - left) / wide, 0.5)
        axes.tick_params(labelbottom=panel is shown.panels[-1])
        found.append(axes)
        top -= panel.height + GAP
    found[-1].set_xlabel(shown.x_label)
    found[-1].xaxis.set_label_coords(0.5, -0.37 / shown.panels[-1].height)
    return found


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


def _key_beside(figure: Figure, panels: Sequence[Axes], handles: Sequence[tuple[str, Any]]) -> None:
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
    width, tall = figure.get_size_inches()
    at = (1.0 - 0.05 / width, 1.0 - 0.35 / tall)
    key = figure.legend(handles=entries, loc="upper right", bbox_to_anchor=at, handlelength=1.6)
    for place in bold:
        key.get_texts()[place].set_fontweight("bold")
    end = key.get_window_extent().x0 / figure.bbox.width - 0.1 / width
    for axes in panels:
        box = axes.get_position()
        axes.set_position((box.x0, box.y0, end - box.x0, box.height))


def _logarithmic(axes: Axes, which: str, limits: tuple[float, float], *, cut: bool = False) -> None:
    """Make axis ``which`` logarithmic; ``cut``: the lowest label says ≤, for values below it."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    axes.set(**{f"{which}scale": "log", f"{which}lim": limits})
    axis = axes.xaxis if which == "x" else axes.yaxis
    axis.set_major_locator(LogLocator(numticks=9))
    axis.set_minor_locator(LogLocator(subs=(2.0, 5.0)))  # all eight take a tenth of the time
    axis.set_minor_formatter(NullFormatter())
    low = limits[0] * (1.0 + 1e-9)
    axis.set_major_formatter(
        FuncFormatter(lambda at, _: ("≤" if cut and at <= low else "") + graph.power(at))
    )
