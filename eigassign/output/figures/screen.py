"""Descriptions written for a browser: the data and layout of Plotly figures, as plain numbers.

Colours of paper and ink are left to the page, which knows whether it is dark.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.arrays import Floats
from eigassign.output.figures import graph, mechanism, scene
from eigassign.output.figures.graph import Curve, Graph, Heat, Look, Panel, Rule, Shade, short
from eigassign.output.figures.scene import Part, Shape
from eigassign.study.results import Motion

Json = dict[str, Any]
_LEGEND = 70  # letters of a legend in one line
_ROOM = 118  # pixels for the legend, the abscissa and its label, by their fonts in Plotly
_DASHES = {
    "solid": "solid",
    "dashed": "dash",
    "dotted": "dot",
    "dash-dotted": "dashdot",
    "fine": "4px,4px",
}
_MARKERS = {"o": "circle", "s": "square"}


def _numbers(values: Iterable[float]) -> list[float | None]:
    """Seven digits are more than a screen shows; JSON has no other numbers than finite ones."""
    found = (float(f"{value:.7g}") for value in values)
    return [value if np.isfinite(value) else None for value in found]


def _plotted(*ys: Floats, most: int = 600) -> NDArray[np.intp]:
    """Samples that are plotted: all, or of many stretches those where a ``y`` is at its ends."""
    every = np.arange(len(ys[0]))
    if every.size <= most:
        return every
    ends = [0, every[-1]]
    for part in np.array_split(every, (most - 2) // (2 * len(ys))):
        for y in ys:
            missing = np.isnan(y[part])
            ends.append(part[np.argmin(np.where(missing, np.inf, y[part]))])
            ends.append(part[np.argmax(np.where(missing, -np.inf, y[part]))])
    return np.unique(ends)


# --- Graphs


def screen_figure(shown: Graph) -> Json:
    """``data`` and ``layout`` of a graph on screen."""
    heights = np.array([panel.height for panel in shown.panels])
    gap = 0.07  # between panels
    free = 1.0 - gap * (len(heights) - 1)
    tops = 1.0 - np.cumsum([0.0, *(free * heights / heights.sum() + gap)[:-1]])
    data: list[Json] = []
    shapes: list[Json] = []
    notes, every = list[Json](), list[Json]()
    layout: Json = {"shapes": shapes, "annotations": notes, "hovermode": "closest"}
    if not shown.x_logarithmic:
        layout["hovermode"] = "x unified"
    names = {c.look: c.label for panel in shown.panels for c in panel.curves if c.label}
    for k, (panel, top) in enumerate(zip(shown.panels, tops, strict=True)):
        bottom = top - free * panel.height / heights.sum()
        axis = f"y{k + 1}" if k else "y"
        layout[f"yaxis{k + 1}" if k else "yaxis"] = {
            **_ordinate(panel), "domain": [round(max(bottom, 0.0), 4), round(top, 4)],
        }  # fmt: skip
        for mark in panel.marks:
            if isinstance(mark, Curve):
                data.append(_curve(mark, panel, shown, axis, names))
            elif isinstance(mark, Shade):
                data.append(_shade(mark, panel, shown.x, axis))
            elif isinstance(mark, Heat):
                data.append(_heat(mark, shown.x, axis))
            else:
                shapes.append(_rule(mark, axis))
                notes += _note(mark, axis)
        data += [_key(name, look) for name, look in panel.key]
        notes += _ends(panel, axis)
        every += _ends(replace(panel, within=None), axis)
    last = f"y{len(heights)}" if len(heights) > 1 else "y"
    if shown.clock is not None:
        layout["meta"] = {"clock": shown.clock, "whole": _whole(shown), "ends": every}
    layout["xaxis"] = {"title": {"text": shown.x_label}, "anchor": last, **_abscissa(shown)}
    if across := _unit(shown.x_label):
        layout["xaxis"]["unifiedhovertitle"] = {"text": f"%{{x}} {across}"}
    named = [*(mark.label for panel in shown.panels for mark in panel.marks if mark.label)]
    named += [name for panel in shown.panels for name, _ in panel.key]
    rows = len(named) if sum(map(len, named)) > _LEGEND else 1  # long ones below each other
    tall = 78.0 * (heights.sum() + 0.15 * len(heights)) + _ROOM + 19.0 * (rows - 1)  # an inch is 78
    return {"data": data, "layout": {**layout, "height": round(tall)}}


def _ends(panel: Panel, axis: str) -> list[Json]:
    return [
        {"text": name, "x": 1.0, "xref": "paper", "xanchor": "left", "xshift": 6, "y": at,
         "yref": axis, "showarrow": False, "font": {"color": colour}}
        for name, at, colour in panel.ends()
    ]  # fmt: skip


def _whole(shown: Graph) -> dict[str, list[float | None]]:
    """The ends of ordinates that show all curves, of those that show a part."""
    return {
        f"yaxis{k + 1}" if k else "yaxis": _numbers(panel.whole)
        for k, panel in enumerate(shown.panels)
        if panel.within is not None
    }


def _abscissa(shown: Graph) -> Json:
    if shown.x_logarithmic:
        own = [c.x for panel in shown.panels for c in panel.curves if c.x is not None]
        return _decades(shown.x_limits or graph.decades(own))
    if shown.x_limits is not None:
        return {"range": _numbers(shown.x_limits)}
    low, high = (shown.x.min(), shown.x.max()) if shown.x.size else (0.0, 1.0)
    return {"range": _numbers((low, high))} if high > low else {}


def _ordinate(panel: Panel) -> Json:
    title: Json = {"title": {"text": panel.label, "standoff": 8}}
    if panel.logarithmic:
        return title | _decades(panel.limits, panel.cut)
    if panel.names:
        title |= {
            "tickvals": [-k for k in range(len(panel.names))],
            "ticktext": [short(name) for name in panel.names],
            "zeroline": False,
        }
    return title | {"range": _numbers(panel.limits)}


def _decades(limits: tuple[float, float], cut: bool = False) -> Json:
    """The lowest label says ≤ where values are cut."""
    low, high = (round(np.log10(limit)) for limit in limits)
    step = max(1, (high - low) // 8)
    ticks = list(range(low, high + 1, step))
    text = [("≤" if cut and at == low else "") + graph.power(10.0**at) for at in ticks]
    values = [float(f"1e{at}") for at in ticks]
    return {"type": "log", "range": [low, high], "tickvals": values, "ticktext": text}


def _line(look: Look) -> Json:
    return {"color": look.colour, "width": look.width * 1.25, "dash": _DASHES[look.dash]}


def _curve(curve: Curve, panel: Panel, shown: Graph, axis: str, names: dict[Look, str]) -> Json:
    """Curves of one look, in several panels, are hidden and shown together."""
    x, y = shown.x if curve.x is None else curve.x, panel.shown(curve)
    plotted = _plotted(y)
    look = curve.look
    name = short(curve.hover or curve.label or curve.end or names.get(look, ""), 60)
    up, across = _unit(panel.label), _unit(shown.x_label)
    point = f"%{{y:.3~g}} {up} at %{{x:.3~g}} {across}".rstrip()
    named = "%{hovertext}" + f"<br>{point}" * (not panel.names) + "<extra></extra>"
    single = x.size == 1 and not look.marker
    drawn = (("lines", look.width), ("markers", look.marker), ("text", curve.marks))
    parts = [part for part, there in drawn if there]
    marker = {
        "symbol": _MARKERS.get(look.marker, "circle") + ("" if look.filled else "-open"),
        "size": look.size * 1.3,
        "color": look.colour,
    }
    return {
        "type": "scatter",
        "mode": "markers" if single else "+".join(parts),
        "x": _numbers(x[plotted]) or [None],  # the legend leaves out what has no points
        "y": _numbers(y[plotted]) or [None],
        "yaxis": axis,
        "name": name,
        "legendgroup": name,
        "showlegend": bool(curve.label),
        "line": _line(look),
        **({"marker": marker} if look.marker or single else {}),
        "cliponaxis": panel.within is not None or not look.marker,
        "hovertemplate": point if shown.x_logarithmic else f"%{{y:.4~g}} {up}".rstrip(),
        **({"hovertext": list(curve.names), "hovertemplate": named} if curve.names else {}),
        **({"text": list(curve.marks), "textposition": "top right"} if curve.marks else {}),
        **({} if name else {"hoverinfo": "skip", "hovertemplate": None}),
    }


def _unit(label: str) -> str:
    """``Hz`` of ``frequency [Hz]``."""
    return label.rpartition("[")[2].partition("]")[0] if "[" in label else ""


def _key(name: str, look: Look) -> Json:
    return {
        "type": "scatter", "mode": "lines", "x": [None], "y": [None], "name": name,
        "line": _line(look), "hoverinfo": "skip",
    }  # fmt: skip


def _heat(heat: Heat, x: Floats, axis: str) -> Json:
    rows, columns = (np.unique(np.linspace(0, n - 1, 200).astype(int)) for n in heat.z.shape)
    values = [_numbers(row) for row in heat.z[rows][:, columns]]
    return {
        "type": "heatmap", "x": _numbers(x[columns]), "y": _numbers(heat.y[rows]), "z": values,
        "yaxis": axis, "colorscale": "Viridis", "colorbar": {"title": {"text": heat.key}},
    }  # fmt: skip


def _shade(shade: Shade, panel: Panel, x: Floats, axis: str) -> Json:
    x = x if shade.x is None else shade.x
    low, high = panel.edges(shade, x)
    plotted = _plotted(low, high)
    x, low, high = x[plotted], low[plotted], high[plotted]
    red, green, blue = (int(shade.colour[k : k + 2], 16) for k in (1, 3, 5))
    return {
        "type": "scatter", "mode": "lines", "fill": "toself", "line": {"width": 0},
        "x": _numbers([*x, *x[::-1]]), "y": _numbers([*low, *high[::-1]]), "yaxis": axis,
        "fillcolor": f"rgba({red},{green},{blue},{shade.opacity})", "hoverinfo": "skip",
        "name": short(shade.label, 60), "showlegend": bool(shade.label),
        "meta": [shade.low is not None, shade.high is not None],  # edges of its own
    }  # fmt: skip


def _rule(rule: Rule, axis: str) -> Json:
    (at,) = _numbers((rule.at,))
    across: Json = {"xref": "paper", "x0": 0, "x1": 1, "yref": axis, "y0": at, "y1": at}
    up: Json = {"yref": f"{axis} domain", "y0": 0, "y1": 1, "xref": "x", "x0": at, "x1": at}
    named = {"name": short(rule.label, 60), "showlegend": True} if rule.label else {}
    return {"type": "line", "line": _line(rule.look), **(up if rule.upright else across), **named}


def _note(rule: Rule, axis: str) -> Iterator[Json]:
    if rule.note:
        at = float(np.log10(rule.at))  # only logarithmic panels have such rules
        yield {
            "text": short(rule.note, 60), "x": 1.0, "xref": "paper", "xanchor": "right", "y": at,
            "yref": axis, "yanchor": "bottom", "showarrow": False,
        }  # fmt: skip


# --- The mechanism in motion


def moving(shown: Motion) -> Json:
    """What the page draws of one trajectory: the parts of the scene, their places, and modes.

    Of all parts together: ``rest`` are places in each pose, direction by direction, ``axes`` those
    that parts lie along, and ``motion`` what each mode adds at its largest. ``at`` says which of
    these places are a part's own, ``axis`` which of the axes.
    """
    parts = scene.parts(shown.rest)
    held = mechanism.extent(shown.rest, [mechanism.points_of(m.deformed) for m in shown.modes])
    n = len(shown.rest.lines)
    rest, axes = _places(parts, n), [part.axes for part in parts if part.axes is not None]
    ends = np.cumsum([0, *(part.places.shape[1] for part in parts)]).tolist()
    own = iter(range(len(axes)))
    still = np.repeat([part.role == "ground" for part in parts], np.diff(ends))[:, None]
    return {
        "trajectory": shown.trajectory,
        "time": _numbers(shown.rest.time_s),
        "view": held.directions.tolist(),
        "middle": _numbers(held.middle),
        "size": _numbers(held.size),
        "thick": held.thick,
        "symbol": [scene.SYMBOL_IN, scene.LARGEST],
        "hair": [mechanism.THINNEST, mechanism.CASING],
        "words": scene.scale_words(shown.rest),
        "parts": [
            {
                "kind": part.kind,
                "role": part.role,
                "name": short(part.name),
                "at": [start, end],
                "ends": _numbers(part.ends),
                "axis": None if part.axes is None else next(own),
                "shapes": [_shape(shape) for shape in part.shapes],
            }
            for part, start, end in zip(parts, ends, ends[1:], strict=False)
        ],
        "rest": [_columns(one) for one in rest],
        "axes": [_columns(np.array([a[min(k, len(a) - 1)] for a in axes])) for k in range(n)]
        if axes
        else [],
        "tip": None if shown.rest.tip_path is None else _columns(shown.rest.tip_path),
        "modes": [
            {
                "name": mode.name,
                "hz": _numbers(mode.hz),
                "motion": [
                    _columns(np.where(still, 0.0, there - here))
                    for there, here in zip(
                        _places(scene.parts(mode.deformed), n), rest, strict=True
                    )
                ],
            }
            for mode in shown.modes
        ],
    }


def _places(parts: Sequence[Part], count: int) -> list[Floats]:
    """The places of all parts in each of ``count`` poses, one below the other."""
    return [
        np.concatenate([part.places[min(k, len(part.places) - 1)] for part in parts])
        for k in range(count)
    ]


def _shape(shape: Shape) -> Json:
    points = [[None if np.isnan(v) else round(float(v), 4) for v in row] for row in shape.points]
    return {"points": points, "fill": shape.fill, "width": shape.width, "dot": shape.dot}


def _columns(points: Floats) -> list[list[float | None]]:
    """Places in m, direction by direction, to 10 µm of a mechanism of metres."""
    scale = float(np.nanmax(np.abs(points), initial=0.0)) or 1.0
    digits = max(0, 5 - int(np.floor(np.log10(scale))))
    return [
        [None if np.isnan(value) else round(float(value), digits) for value in column]
        for column in points.T
    ]
