"""The figures that are curves over time: coordinates, what was asked before and after.

Each function plans one figure. Panels stand one above the other over a common abscissa; frequencies
in Hz, errors in % of the frequency in Hz.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from eigassign.arrays import Floats
from eigassign.case.units import handy_unit
from eigassign.facts import capital
from eigassign.output.figures import graph
from eigassign.output.figures.graph import Curve, FigurePlan, Graph, Look, Mark, Panel, Rule, Shade
from eigassign.study.results import ModeRow, RunResults, StaticRow, TargetStudy

TARGET = Look(graph.BLACK, 1.6, "dotted")
LEVEL = Look(graph.BLACK, 0.8)
EDGE = Look(graph.VERMILLION, 1.0)
_MEETS = Look(graph.VERMILLION, 4.0, marker="o")
_BEFORE, _AFTER = Look(graph.BLACK, 1.3, "dashed"), Look(graph.BLACK, 1.8)
BEFORE_AND_AFTER = (("initial design", _BEFORE), ("optimal design", _AFTER))
_MODES = tuple(one for one in graph.SERIES if one != graph.VERMILLION)  # what is forbidden


def suffix(results: RunResults) -> str:
    """The end of a file's name, which tells several trajectories apart."""
    return f"_{results.only}" if results.only is not None else ""


def where(results: RunResults) -> str:
    """The end of a heading or title, which tells several trajectories apart."""
    return f", {results.along}" if results.only is not None else ""


def coordinates(results: RunResults) -> FigurePlan:
    """q(t), one panel for each unit."""
    names, panels = ", ".join(results.q_names), []
    each = [(unit, *handy_unit(unit)) for unit in results.q_units]
    units = list(dict.fromkeys(each))
    for unit, said, size in units:
        own = [i for i, other in enumerate(each) if other == (unit, said, size)]
        curves = (
            Curve(results.q[:, i] / size, graph.series(i), graph.short(results.q_names[i]))
            for i in own
        )
        quantity = {"rad": "joint angle", "m": "joint stroke"}.get(unit, "coordinate")
        height = 2.6 if len(units) == 1 else 1.8
        panels.append(Panel(graph.labelled(quantity, said), tuple(curves), height))
    title = f"Coordinates along {results.along}"
    return FigurePlan(
        f"coordinates{suffix(results)}",
        f"Coordinates{where(results)}",
        f"{names} along {results.along}, {results.time_s.size} samples.",
        f"Curves of {names} over time.",
        _over_time(title, results, panels),
        "motion",
    )


def exerted(results: RunResults, name: str) -> FigurePlan:
    """What each of the ``drives`` exerts, or how far the nodes of ``statics`` give way."""
    drives, panels = name == "drives", list[Panel]()
    rows: Sequence[StaticRow] = results.drives if drives else results.statics
    for k, row in enumerate(rows, 1):
        unit, size = row.handy
        values = [curve / size for curve in (row.initial_curve, row.optimal_curve)]
        edges = [] if row.limit is None else [row.limit / size, -row.limit / size]
        edges = [edge for edge in edges if any((edge * v > 0.0).any() for v in values)]
        label = graph.short(row.name, 12) if drives else f"{k}: {row.name.partition(' of ')[0]}"
        looks = ((_BEFORE, "before"), (_AFTER, "after"))
        curves = (Curve(v, look, hover=when) for v, (look, when) in zip(values, looks, strict=True))
        marks: tuple[Mark, ...] = (*(Rule(edge, EDGE) for edge in edges), *curves)
        holds = (np.array([0.0, *edges]),)
        panels.append(Panel(graph.labelled(label, unit), marks, 1.3, holds=holds))
    limited = any(row.limit for row in rows)
    panels[0] = replace(panels[0], key=(*BEFORE_AND_AFTER, *((("limit", EDGE),) * limited)))
    if drives:
        title, section = "What the drives carry", "motion"
        what = f"Torques and forces of {', '.join(row.name for row in rows)}"
        more = f"of {results.drives[0].of}"
    else:
        title, section, more = "How far nodes give way", "requirements", "the drives hold"
        what = capital(", ".join(f"{k}: {row.name}" for k, row in enumerate(rows, 1)))
    heading = f"{title}{where(results)}"
    return FigurePlan(
        f"{name}{suffix(results)}",
        heading,
        f"{what} along {results.along}, {more}.",
        f"{what} over time before and after.",
        _over_time(heading, results, panels),
        section,
    )


def _over_time(title: str, results: RunResults, panels: Sequence[Panel]) -> Graph:
    return Graph(title, "time [s]", results.time_s, tuple(panels), clock=results.only or "")


# --- What was asked for, before and after (the paper's Figures 4 and 5)

ROOM = 0.3  # of what a panel has to hold, or of a band: so much is shown beside it
APART = 0.5  # of both together: what lies farther apart has panels of its own, of which there are
MOST_PANELS = 3  # at most
FAR = 0.5  # of a limit that is kept: as far from it nothing is seen in one panel with it


def overview(results: RunResults, spectrum: Sequence[ModeRow]) -> FigurePlan:
    """Targets, limits and bands with the modes around them; what lies far apart in own panels."""
    groups, time_s = _groups(results, spectrum), results.time_s
    x, shown = results.between.get(results.trajectories[0].name, (None, spectrum))
    modes = sorted(before_and_after(shown, x), key=lambda one: bool(one.end))  # after on top
    if x is not None:  # the samples that the answer is judged at
        looks = (Look(mode_colour(row.mode), 0.0, marker="o", size=3.0) for row in spectrum)
        modes += [Curve(r.optimal_hz, look) for r, look in zip(spectrum, looks, strict=True)]
    height = {1: 2.9, 2: 1.9}.get(len(groups), 1.5)
    panels = []
    for own, (low, high) in groups:
        asked = (mark for one in own for mark in _asked(one, time_s, 0.04 * (high - low)))
        marks = (*asked, *modes)
        panels.append(Panel("frequency [Hz]", marks, height, within=(low, high)))
    for gap in (target for target in results.targets if len(target.asked.terms) > 1):
        panels.append(_distance(gap, time_s))
    wanted = [target for target in results.targets if target.asked.is_goal]
    if wanted:
        off = [curve for target in wanted for curve in _off_target(results, target)]
        panels.append(Panel("off target [%]", (Rule(0.0, LEVEL), *off), 1.3, holds=(np.zeros(1),)))
    panels[0] = replace(panels[0], key=BEFORE_AND_AFTER)
    heading = f"Frequencies before and after{where(results)}"
    beyond = [t.label for t in results.targets if len(t.asked.terms) < 2 and _is_far(t)]
    left_out = f" Kept from afar, outside the axis: {', '.join(beyond)}." if beyond else ""
    return FigurePlan(
        f"frequencies{suffix(results)}",
        heading,
        f"Frequencies along {results.along}, solved exactly, and what was asked for.{left_out}",
        "Frequencies over time before and after, with targets, limits and bands.",
        _over_time(heading, results, panels),
        "answer",
    )


def _groups(
    results: RunResults, spectrum: Sequence[ModeRow]
) -> list[tuple[list[TargetStudy], tuple[float, float]]]:
    """What is asked of frequencies, in groups of like ones, and the ends of each group's panel."""
    asked = [target for target in results.targets if len(target.asked.terms) < 2]
    held = sorted(((_range(t, spectrum), [t]) for t in asked), key=lambda each: each[0])
    if not held:
        held = [(graph.bounds([spectrum[0].initial_hz, spectrum[0].optimal_hz]), [])]
    while len(held) > 1:
        gaps = [b[0][0] - a[0][1] for a, b in pairwise(held)]
        k = int(np.argmin(gaps))
        (low, _), (_, high) = held[k][0], held[k + 1][0]
        if gaps[k] > APART * (high - low) and len(held) <= MOST_PANELS:
            break
        top = max(high, held[k][0][1])
        held[k : k + 2] = [((low, top), [*held[k][1], *held[k + 1][1]])]
    ends = ((low, high, 0.05 * (high - low)) for (low, high), _ in held)
    shown = ((low - margin, high + margin) for low, high, margin in ends)
    return [(own, each) for (_, own), each in zip(held, shown, strict=True)]


def _range(target: TargetStudy, spectrum: Sequence[ModeRow]) -> tuple[float, float]:
    """The frequencies that a panel has to hold of a target: its edges, and modes beside them."""
    asked = target.asked
    low, high = asked.forbidden_hz
    if not asked.terms:  # a band: the nearest mode, and all that are near
        edges = [edge for edge in (low, high) if edge is not None]
        bottom, top = graph.bounds(edges)
        room = ROOM * top
        every = [hz for row in spectrum for hz in (row.initial_hz, row.optimal_hz)]
        near = np.array(every)[:, asked.rows]
        after = np.array([row.optimal_hz[asked.rows] for row in spectrum])
        k = int(np.maximum(bottom - after, after - top).min(axis=1).argmin())
        nearest = [np.array(every)[2 * k : 2 * k + 2, asked.rows]]
        near = near[(near > bottom - room) & (near < top + room)]
        return graph.bounds([*edges, near, *nearest])
    own = [target.initial_hz, target.exact_hz]
    if not _is_far(target):
        own += [target.asked.hz] if asked.is_goal else [e for e in (low, high) if e is not None]
    bottom, top = graph.bounds(own)
    room = ROOM * (top - bottom)
    return max(bottom - room, 0.0), top + room


def _is_far(target: TargetStudy) -> bool:
    """True of a limit that is kept with so much room that no panel shows both."""
    if target.asked.is_goal or target.asked.is_aim or not target.asked.terms:
        return False
    edge, curves = target.asked.hz, (target.initial_hz, target.exact_hz)
    return all(float(np.abs(curve / edge - 1.0).min()) > FAR for curve in curves)


def _asked(target: TargetStudy, time_s: Floats, width: float) -> Iterator[Mark]:
    """A wanted frequency; a band; of a limit a strip on its wrong side in its mode's colour."""
    asked, x = target.asked, time_s[target.asked.rows]
    low, high = asked.forbidden_hz
    colour = mode_colour(asked.mode)
    if asked.is_goal:
        yield Curve(target.asked.hz, TARGET, target.label, x)
    elif low is not None and high is not None:
        yield Shade(low, high, graph.VERMILLION, asked.label, x=x)
    elif not asked.is_aim:
        low, high = (asked.hz - width, asked.hz) if low is None else (asked.hz, asked.hz + width)
        yield Shade(low, high, colour, asked.label, 0.25, x)
        yield Curve(asked.hz, Look(colour, 1.0, "fine"), x=x)
    if asked.followed and asked.terms:
        yield Curve(target.initial_hz, replace(_BEFORE, colour=graph.BLACK), x=x)
        yield Curve(target.exact_hz, replace(_AFTER, width=2.6), x=x, end=asked.curve_name)


def _distance(target: TargetStudy, time_s: Floats) -> Panel:
    """A distance of modes before and after, and what is too little."""
    asked, x = target.asked, time_s[target.asked.rows]
    low, high = asked.forbidden_hz
    marks: tuple[Mark, ...] = (
        Shade(low, high, graph.VERMILLION, asked.label, x=x),
        *(Curve(edge, EDGE, x=x) for edge in (low, high) if edge is not None),
        Curve(target.initial_hz, _BEFORE, x=x),
        Curve(target.exact_hz, _AFTER, x=x),
    )
    return Panel("distance of the modes [Hz]", marks, 1.4)


def _off_target(results: RunResults, target: TargetStudy) -> Iterator[Curve]:
    """f/f_target − 1 before and after, in the colour of the mode."""
    asked = target.asked
    colour = mode_colour(asked.mode)
    name = asked.curve_name
    x, wanted, both = results.time_s[asked.rows], asked.hz, (target.initial_hz, target.exact_hz)
    fine, modes = results.between.get(results.trajectories[0].name, (x, ()))
    if modes and asked.mode and not asked.followed:
        within = (fine >= x[0]) & (fine <= x[-1])
        both = (modes[asked.mode - 1].initial_hz[within], modes[asked.mode - 1].optimal_hz[within])
        x, wanted = fine[within], np.interp(fine[within], x, wanted)
    for hz, look, end in zip(both, (_BEFORE, _AFTER), ("", name), strict=True):
        off = 100.0 * (hz / wanted - 1.0)
        hover = f"{name}, initial design" * (not end)
        yield Curve(off, replace(look, colour=colour), x=x, end=end, hover=hover)


def campbell(results: RunResults) -> FigurePlan:
    """Where the modes lie along the trajectory, over speed, with the orders that targets name.

    Order h excites h n/60 Hz at n rpm; it meets a mode at speeds between 60/h times its ends.
    """
    speeds = sorted({60.0 * hz for _, hz, _ in results.orders})
    rpm, marks, meets = np.array([0.0, 1.3 * speeds[-1]]), list[Mark](), list[Mark]()
    orders = {f"order {h:g}": h / 60.0 for h, *_ in sorted(results.orders)}
    points = [h * hz for h, hz, _ in results.orders]
    tops = (float(row.optimal_hz.max()) for row in results.spectrum)
    above = min((hz for hz in tops if hz > max(points)), default=0.0)  # the next mode is in view
    top = 1.1 * max(rpm[1] * max(orders.values()), above)
    wanted = {m for one in results.targets if one.asked.is_goal for m in one.numbers}
    for h, margin in sorted({(h, margin) for h, _, margin in results.orders if margin}):
        edges = [h / 60.0 * (1.0 + side) * rpm for side in (-margin, margin)]
        words = f"order {h:g} ± {100 * margin:g} %"
        marks.append(Shade(edges[0], edges[1], graph.VERMILLION, words, x=rpm))
    for row in results.spectrum:
        low, high = float(row.optimal_hz.min()), float(row.optimal_hz.max())
        if low < top:
            name, look = f"mode {row.mode}", Look(mode_colour(row.mode))
            marks.append(Shade(np.full(2, low), np.full(2, high), look.colour, opacity=0.3, x=rpm))
            marks += [Curve(np.full(2, hz), look, name * (hz == low), rpm) for hz in (low, high)]
            for order, per_rpm in orders.items():
                ends, words = np.array([low, high]).clip(0.0, per_rpm * rpm[1]), f"{order}, {name}"
                if ends[0] == low and not (order == "order 1" and row.mode in wanted):
                    meets.append(Curve(ends, _MEETS, x=ends / per_rpm, hover=words))
    marks += [*meets, *(Curve(h * rpm, LEVEL, x=rpm, end=order) for order, h in orders.items())]
    marks += [Rule(n, TARGET, f"{float(f'{n:.6g}'):.12g} rpm", upright=True) for n in speeds]
    key = (("an order meets a mode", _MEETS),)
    heading = f"Orders of the speed{where(results)}"
    panel = Panel("frequency [Hz]", tuple(marks), 2.9, within=(0.0, top), key=key * bool(meets))
    return FigurePlan(
        f"orders{suffix(results)}",
        heading,
        f"The answer's modes along {results.along}, from lowest to highest, and what orders of a "
        "speed excite.",
        "Frequencies over speed, with lines of orders.",
        Graph(heading, "speed [rpm]", np.zeros(0), (panel,), (0.0, float(rpm[1]))),
        "requirements",
    )


def mode_colour(mode: int) -> str:
    """The colour of a mode, the same in all figures."""
    return _MODES[(mode - 1) % len(_MODES)]


def before_and_after(shown: Sequence[ModeRow], x: Floats | None) -> Iterator[Curve]:
    """Yield one colour a mode: dashed before, solid after, its number at the end of its curve."""
    for row in shown:
        before, after = (replace(look, colour=mode_colour(row.mode)) for look in (_BEFORE, _AFTER))
        name = f"mode {row.mode}"
        yield Curve(row.initial_hz, before, x=x, hover=f"{name}, initial design")
        yield Curve(row.optimal_hz, after, x=x, end=name)
