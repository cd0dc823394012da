"""Figures on paper: graphs drawn with matplotlib, in one style, as files of several formats.

Figures are drawn through matplotlib's `Figure` and `Axes` on an Agg canvas; pyplot and its global
state are never used. matplotlib is imported only where a figure is made: a run without figures
does not load it. The user's own settings change nothing, and the same findings give the same bytes.
"""

from __future__ import annotations

import contextlib
import io
import warnings
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from eigassign.arrays import Floats
from eigassign.output.figures import graph

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

FORMATS = ("png", "svg", "pdf")
_DASHES: dict[str, Any] = {
    "solid": "solid",
    "dashed": (0, (5.0, 1.8)),
    "dotted": (0, (1.4, 1.4)),
    "dash-dotted": (0, (6.0, 1.5, 1.4, 1.5)),
    "fine": (0, (3.0, 3.0)),
}
STYLE: dict[str, Any] = {
    "axes.axisbelow": True,
    "axes.edgecolor": graph.GREY,
    "axes.formatter.useoffset": False,  # a number on an axis is the number itself
    "axes.grid": True,
    "axes.labelcolor": graph.BLACK,
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.xmargin": 0.0,
    "figure.dpi": 110.0,
    "figure.titlesize": 10.0,
    "figure.titleweight": "bold",
    "font.family": ["DejaVu Sans"],  # comes with matplotlib: the same everywhere
    "font.size": 9.0,
    "grid.color": "#e3e3e3",
    "legend.borderaxespad": 0.2,
    "legend.columnspacing": 1.6,
    "legend.frameon": False,
    "legend.handlelength": 2.6,
    "legend.labelspacing": 0.35,
    "lines.solid_capstyle": "round",
    "patch.linewidth": 0.8,
    "svg.hashsalt": "eigassign",  # else the names inside an SVG are random
    "text.color": graph.BLACK,
    "text.parse_math": False,  # names of the user's may hold any character
    "xtick.color": graph.GREY,
    "xtick.labelcolor": graph.BLACK,
    "ytick.color": graph.GREY,
    "ytick.labelcolor": graph.BLACK,
}
# the date, and who wrote the file, in the words of each format
_METADATA: dict[str, dict[str, str | None]] = {
    "png": {"Software": None},
    "svg": {"Date": None},
    "pdf": {"CreationDate": None},
}


def render(
    plans: Sequence[graph.FigurePlan], formats: Sequence[str] = FORMATS[:1]
) -> dict[str, bytes]:
    """Files of each figure in each format of `FORMATS` asked for, by name."""
    if not plans or not formats:
        return {}
    with applied():
        drawn = [(plan.name, _graph(plan.shows)) for plan in plans]
        return {f"{name}.{kind}": encoded(one, kind) for name, one in drawn for kind in formats}


def draw(plan: graph.FigurePlan) -> Figure:
    """The figure of a plan, in `STYLE`."""
    with applied():
        return _graph(plan.shows)


def encoded(figure: Figure, kind: str) -> bytes:
    """The figure as a file of one of `FORMATS`, without date: the same bytes every time."""
    data = io.BytesIO()
    figure.savefig(data, format=kind, metadata=_METADATA[kind])
    return data.getvalue()


@contextlib.contextmanager
def applied() -> Iterator[None]:
    """Draw with `STYLE` over matplotlib's defaults, whatever the user's own settings are."""
    import matplotlib

    settings: Any = dict(matplotlib.rcParamsDefault)
    settings = {k: v for k, v in settings.items() if not k.startswith("backend")} | STYLE
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", category=matplotlib.MatplotlibDeprecationWarning)
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        with matplotlib.rc_context(settings):
            yield


# --- Graphs

BOTTOM, GAP = 0.55, 0.15  # inches below the panels, and between them
ROW, LETTER = 0.18, 0.075  # inches of a line of the legend, and of a letter


def _graph(shown: graph.Graph) -> Figure:
    """Placed in inches: matplotlib's own layouts measure all letters twice, a third of the time."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    heights = [panel.height for panel in shown.panels]
    labels = [mark.label for panel in shown.panels for mark in panel.marks if mark.label]
    labels += [name for panel in shown.panels for name, _ in panel.key]
    rows = 0 if shown.beside else -(-len(labels) // _columns(labels))
    above = 0.4 + ROW * rows  # with the title
    tall = above + sum(heights) + GAP * (len(heights) - 1) + BOTTOM
    if shown.beside:
        tall = max(tall, 0.8 + ROW * len(labels))
    figure = Figure((graph.WIDTH, tall))
    FigureCanvasAgg(figure)
    place = {"x": 0.1 / graph.WIDTH, "y": 1.0 - 0.1 / tall, "ha": "left", "va": "top"}
    figure.suptitle(graph.short(shown.title, 88), **place)  # more letters seldom fit
    panels = _placed(figure, shown, tall - above)
    if shown.x_limits is not None:
        panels[0].set_xlim(shown.x_limits)
    if shown.x_logarithmic:
        own = [curve.x for panel in shown.panels for curve in panel.curves if curve.x is not None]
        _logarithmic(panels[0], "x", shown.x_limits or graph.decades(own))
    handles: list[Any] = []
    for axes, panel in zip(panels, shown.panels, strict=True):
        _ordinate(axes, panel)
        handles += _drawn(axes, panel, shown)
    if shown.beside:
        at = (1.0 - 0.05 / graph.WIDTH, 1.0 - 0.35 / tall)
        key = figure.legend(handles=handles[::-1], loc="upper right", bbox_to_anchor=at)
        end = key.get_window_extent().x0 / figure.bbox.width - 0.1 / graph.WIDTH
        for axes in panels:
            box = axes.get_position()
            axes.set_position((box.x0, box.y0, end - box.x0, box.height))
    elif handles:
        panels[0].legend(
            handles=handles, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=_columns(labels)
        )
    return figure


def _placed(figure: Figure, shown: graph.Graph, top: float) -> list[Axes]:
    """Axes one below the other from ``top`` inches, with room for names at their sides."""
    width, tall = figure.get_size_inches()
    names = [graph.short(name) for panel in shown.panels for name in panel.names]
    ends = [c.end for panel in shown.panels for c in panel.curves if not shown.sheet]
    left = max(graph.LEFT, 0.2 + LETTER * max(map(len, names), default=0))
    wide = width - left - graph.RIGHT - LETTER * max(map(len, ends), default=0)
    found: list[Axes] = []
    for panel in shown.panels:
        box = (left / width, (top - panel.height) / tall, wide / width, panel.height / tall)
        axes = figure.add_axes(box, sharex=found[0] if found else None)
        axes.yaxis.set_label_coords((0.2 - left) / wide, 0.5)
        axes.tick_params(labelbottom=panel is shown.panels[-1])
        found.append(axes)
        top -= panel.height + GAP
    found[-1].set_xlabel(shown.x_label)
    below = 0.12 if shown.sheet == "bare" else 0.37  # of ticks and their numbers
    found[-1].xaxis.set_label_coords(0.5, -below / shown.panels[-1].height)
    if shown.sheet:
        axes.set_aspect("equal")
    if shown.sheet == "bare":
        axes.set(xticks=(), yticks=())
        axes.spines[:].set_visible(False)
    return found


def _ordinate(axes: Axes, panel: graph.Panel) -> None:
    axes.set_ylabel(panel.label)
    if panel.logarithmic:
        _logarithmic(axes, "y", panel.limits, cut=panel.cut)
        return
    axes.set_ylim(panel.limits)
    if panel.names:
        axes.set_yticks(-np.arange(len(panel.names)), [graph.short(name) for name in panel.names])
    axes.yaxis.set_offset_position("right")  # a power of ten, away from the legend


def _drawn(axes: Axes, panel: graph.Panel, shown: graph.Graph) -> list[Any]:
    """Draw all marks; the entries of the legend."""
    from matplotlib.lines import Line2D

    entries = [Line2D([], [], **_line(look), label=name) for name, look in panel.key]
    for at, mark in enumerate(panel.marks):
        if isinstance(mark, graph.Curve):
            handle = _curve(axes, panel, mark, shown, 2.0 + 1e-3 * at)
        elif isinstance(mark, graph.Shade):
            handle = _shade(axes, panel, mark, shown.x)
        elif isinstance(mark, graph.Heat):
            drawn = axes.pcolormesh(shown.x, mark.y, mark.z, shading="nearest", rasterized=True)
            axes.figure.colorbar(drawn, ax=axes, label=mark.key, pad=0.02)
        else:
            handle = _rule(axes, mark)
        if mark.label:
            entries.append(handle)
    for name, place, colour in () if shown.sheet else panel.ends():
        axes.annotate(
            name, (1.0, place), (6.0, 0.0), color=colour, va="center",
            xycoords=("axes fraction", "data"), textcoords="offset points",
        )  # fmt: skip
    return entries


def _line(look: graph.Look) -> dict[str, Any]:
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


def _curve(
    axes: Axes, panel: graph.Panel, curve: graph.Curve, shown: graph.Graph, above: float
) -> Any:
    """A single point of a line is a dot."""
    at, look = shown.x if curve.x is None else curve.x, _line(curve.look)
    if at.size == 1 and not curve.look.marker:
        look["marker"] = "o"
    for text, x, y in zip(curve.marks, at, panel.shown(curve), strict=False):
        how: dict[str, Any] = {"color": curve.look.colour, "size": 7.0}
        axes.annotate(text, (x, y), (3.0, 3.0), textcoords="offset points", **how)
    if curve.look.area:
        axes.fill(at, curve.y, color=curve.look.area, zorder=above, clip_on=False)
    if shown.sheet and curve.end:
        axes.annotate(curve.end, (at[-1], curve.y[-1]), (3.0, 0.0), textcoords="offset points")
    return axes.plot(
        at, panel.shown(curve), **look, label=graph.short(curve.label, 60), zorder=above,
        clip_on=(panel.within is not None or not curve.look.marker) and not shown.sheet,
    )[0]  # fmt: skip


def _shade(axes: Axes, panel: graph.Panel, shade: graph.Shade, x: Floats) -> Any:
    x = x if shade.x is None else shade.x
    low, high = panel.edges(shade, x)
    return axes.fill_between(
        x, low, high, color=shade.colour, alpha=shade.opacity, linewidth=0.0,
        label=graph.short(shade.label, 60),
    )  # fmt: skip


def _rule(axes: Axes, rule: graph.Rule) -> Any:
    look = {key: value for key, value in _line(rule.look).items() if not key.startswith("marker")}
    line = (axes.axvline if rule.upright else axes.axhline)(rule.at, **look, label=rule.label)
    if rule.note:
        axes.annotate(
            graph.short(rule.note, 60), (1.0, rule.at), (-4.0, 2.0), textcoords="offset points",
            ha="right", va="bottom", xycoords=("axes fraction", "data"), size=8.0,
        )  # fmt: skip
    return line


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


def _columns(labels: Sequence[str]) -> int:
    """As many columns of a legend above its axes as fit."""
    for count in range(len(labels), 1, -1):  # matplotlib fills one after the other
        parts = np.array_split([len(label) for label in labels], count)
        if sum(max(part) + 8 for part in parts) <= 92:  # characters
            return count
    return 1
