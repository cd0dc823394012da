"""The figures that are curves over time: coordinates, what was asked before and after, the search.

Each function plans one figure. Panels stand one above the other over a common abscissa; frequencies
in Hz, errors in % of the frequency in Hz.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.requirements.requirement import Requirement
from eigassign.case.units import handy_unit
from eigassign.facts import capital, number, percent
from eigassign.output.figures import graph
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
    series,
    short,
)
from eigassign.study.results import AssignmentRow, OtherModes, RunResults, TargetStudy

Floats = NDArray[np.float64]

TARGET = Look(graph.BLACK, 1.6, "dotted")
INITIAL = Look(graph.ORANGE, 1.8, "dash-dotted")
ONE_SHOT = Look(graph.PURPLE, 0.9)
OPTIMAL = Look(graph.SKY, 3.2)
PREDICTED = Look(graph.BLUE, 1.3, "dashed")
LEVEL = Look(graph.BLACK, 0.8)
EDGE = Look(graph.VERMILLION, 1.0)
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
    names, units = ", ".join(results.q_names), list(dict.fromkeys(results.q_units))
    panels = []
    for unit in units:
        own = [i for i, each in enumerate(results.q_units) if each == unit]
        curves = (Curve(results.q[:, i], series(i), short(results.q_names[i])) for i in own)
        quantity = {"rad": "joint angle", "m": "joint stroke"}.get(unit, "coordinate")
        height = 2.6 if len(units) == 1 else 1.8
        panels.append(Panel(labelled(quantity, unit), tuple(curves), height))
    title = f"Coordinates along {results.along}"
    return FigurePlan(
        f"coordinates{suffix(results)}",
        f"Coordinates{where(results)}",
        f"{names} along {results.along}, {results.time_s.size} samples.",
        f"Curves of {names} over time.",
        Graph(title, "time [s]", results.time_s, tuple(panels)),
    )


def drives(results: RunResults) -> FigurePlan:
    """What each drive exerts before and after, with its limit, one panel for each coordinate."""
    panels = []
    for row in results.drives:
        curves = (Curve(row.initial_curve, _BEFORE), Curve(row.optimal_curve, _AFTER))
        edges = [] if row.limit is None else [row.limit, -row.limit]
        edges = [e for e in edges if any((e * curve.y).max() > 0.0 for curve in curves)]
        label = labelled(short(row.name, 12), row.unit)
        marks: tuple[Mark, ...] = (*(Rule(edge, EDGE) for edge in edges), *curves)
        panels.append(Panel(label, marks, 1.3, holds=(np.array([0.0, *edges]),)))
    key = (*BEFORE_AND_AFTER, *((("limit", EDGE),) * any(row.limit for row in results.drives)))
    panels[0] = replace(panels[0], key=key)
    names, title = ", ".join(row.name for row in results.drives), "What the drives carry"
    return FigurePlan(
        f"drives{suffix(results)}",
        f"{title}{where(results)}",
        f"Torques and forces of {names} along {results.along}, of {results.drives[0].of}.",
        f"Torques and forces of {names} over time before and after.",
        Graph(f"{title}{where(results)}", "time [s]", results.time_s, tuple(panels)),
    )


def statics(results: RunResults) -> FigurePlan:
    """Stiffness, compliance or sag before and after, with its limit, one panel for each target."""
    panels = []
    for k, row in enumerate(results.statics, 1):
        unit, size = handy_unit(row.unit, row.limit)
        pairs = ((row.initial_curve, _BEFORE), (row.optimal_curve, _AFTER))
        edge = np.array([row.limit / size])
        curves = (Curve(curve / size, series) for curve, series in pairs)
        label = labelled(f"{k}: {row.name.partition(' ')[0]}", unit)
        panels.append(Panel(label, (Rule(float(edge[0]), EDGE), *curves), 1.6, holds=(edge,)))
    panels[0] = replace(panels[0], key=(*BEFORE_AND_AFTER, ("limit", EDGE)))
    title = "What gives way at rest"
    names = ", ".join(f"{k}: {row.name}" for k, row in enumerate(results.statics, 1))
    return FigurePlan(
        f"statics{suffix(results)}",
        f"{title}{where(results)}",
        f"{capital(names)}, along {results.along}; the drives hold.",
        f"{capital(names)} over time before and after.",
        Graph(f"{title}{where(results)}", "time [s]", results.time_s, tuple(panels)),
    )


# --- Everything that was asked for, before and after


def overview(results: RunResults, spectrum: OtherModes) -> FigurePlan:
    """The modes up to the one above the highest asked for, with targets, limits and bands."""
    wanted = [t for t in results.targets if t.asked.is_goal]
    limits = [t.asked for t in results.targets if not t.asked.is_goal and not t.asked.is_aim]
    limits = [asked for asked in limits if len(asked.terms) < 2]
    modes = sorted(before_and_after(spectrum), key=lambda curve: bool(curve.end))  # after on top
    time_s = results.time_s
    low, high = graph.bounds([curve.y for curve in modes])
    asked = [mark for one in limits for mark in _asked(one, time_s[one.rows], 0.05 * (high - low))]
    targets = (Curve(t.target_hz, TARGET, capital(t.label), time_s[t.asked.rows]) for t in wanted)
    marks: tuple[Mark, ...] = (*asked, *modes, *targets)
    panels = [Panel("frequency [Hz]", marks, 2.8, key=BEFORE_AND_AFTER)]
    if wanted:
        off = [curve for target in wanted for curve in _off_target(results, target)]
        panels.append(Panel("off target [%]", (Rule(0.0, LEVEL), *off), 1.4, holds=(np.zeros(1),)))
    heading = f"Frequencies before and after{where(results)}"
    return FigurePlan(
        f"frequencies{suffix(results)}",
        heading,
        f"Exact frequencies of mode{'s' if len(spectrum.modes) > 1 else ''} "
        f"{', '.join(map(str, spectrum.modes))} along {results.along}, before and after, with all "
        "that was asked for.",
        "Frequencies over time before and after, with targets, limits and bands.",
        Graph(heading, "time [s]", time_s, tuple(panels)),
    )


def _asked(asked: Requirement, x: Floats, width: float) -> Iterator[Mark]:
    """A band; of a limit a strip on its wrong side in its mode's colour, for others may lie there.

    ``width`` is that of the strip in Hz.
    """
    low, high = asked.forbidden_hz
    if low is not None and high is not None:
        yield Shade(low, high, graph.VERMILLION, asked.label, x=x)
        return
    edge, colour = asked.hz, mode_colour(asked.mode)
    low, high = (edge - width, edge) if low is None else (edge, edge + width)
    yield Shade(low, high, colour, asked.label, 0.25, x)
    yield Curve(edge, Look(colour, 1.0, "fine"), x=x)


def _off_target(results: RunResults, target: TargetStudy) -> Iterator[Curve]:
    """f/f_target − 1 before and after, in the colour of the mode."""
    asked = target.asked
    colour = mode_colour(asked.mode)
    stages = ((target.initial_hz, _BEFORE, ""), (target.exact_hz, _AFTER, asked.curve_name))
    for hz, look, end in stages:
        off = 100.0 * (hz / target.target_hz - 1.0)
        x = results.time_s[asked.rows]
        yield Curve(off, replace(look, colour=colour), x=x, end=end)


def other_modes(results: RunResults, others: OtherModes) -> FigurePlan:
    """The modes of which no frequency is wanted, before and after (the paper's Figure 5)."""
    modes = ", ".join(map(str, others.modes))
    panel = Panel("frequency [Hz]", before_and_after(others), 2.9, key=BEFORE_AND_AFTER)
    title = f"Other modes before and after, exact{where(results)}"
    return FigurePlan(
        f"other_modes{suffix(results)}",
        f"Other modes{where(results)}",
        f"Exact frequencies before and after of modes {modes}, for which no frequency was asked.",
        f"Frequencies of modes {modes} over time before and after.",
        Graph(title, "time [s]", results.time_s, (panel,)),
    )


def mode_colour(mode: int) -> str:
    """The colour of a mode, the same in all figures."""
    return _MODES[(mode - 1) % len(_MODES)]


def before_and_after(shown: OtherModes) -> tuple[Curve, ...]:
    """One colour a mode: dashed before, solid after, its number at the end of its curve."""
    found = []
    for k, mode in enumerate(shown.modes):
        before, after = (replace(look, colour=mode_colour(mode)) for look in (_BEFORE, _AFTER))
        found.append(Curve(shown.initial_hz[:, k], before))
        found.append(Curve(shown.optimal_hz[:, k], after, end=f"mode {mode}"))
    return tuple(found)


# --- One target (the paper's Figure 4)


def assignment(results: RunResults, target: TargetStudy) -> FigurePlan:
    """A target in time: frequencies before and after, and their distance or what is forbidden."""
    asked = target.asked
    modes = "_".join(map(str, asked.modes)) or "all"
    if asked.followed:
        modes = f"like_{asked.mode}"
    place, name, label = where(results), capital(asked.curve_name), capital(asked.label)
    if asked.is_goal:
        kind, what = "assignment", "distance to the target"
        heading = f"{name}: initial, optimal and target frequency"
        alt = f"Frequency of {asked.curve_name} over time before and after, with its target."
        title, panels = f"{name}: assigned frequency", _assigned(results, target)
    else:
        kind, what, heading, title = asked.kind, "violation", label, label
        alt = f"{label}: frequencies over time before and after."
        panels = (_limited(results, target),)
    said = f"Worst {what} {percent(target.error.initial.max_relative)} before and "
    said += f"{percent(target.error.exact.max_relative)} after."
    if asked.is_aim:
        before, after = (number(hz.min()) for hz in (target.initial_hz, target.exact_hz))
        said = f"{before} Hz before and {after} Hz after at least, at the samples."
    return FigurePlan(
        f"{kind}_mode_{modes}{suffix(results)}",
        f"{heading}{place}",
        said,
        alt,
        Graph(f"{title}{place}", "time [s]", results.time_s[asked.rows], panels),
    )


def _assigned(results: RunResults, target: TargetStudy) -> tuple[Panel, ...]:
    """Frequencies above, f/f_target − 1 below."""
    curves = _curves(results, target)
    off = (Curve(100.0 * (curve.y / target.target_hz - 1.0), curve.look) for curve in curves)
    return (
        Panel("frequency [Hz]", (Curve(target.target_hz, TARGET, "target"), *curves), 2.0),
        Panel("off target [%]", (Rule(0.0, LEVEL), *off), 1.35, holds=(np.zeros(1),)),
    )


def _curves(results: RunResults, target: TargetStudy) -> tuple[Curve, ...]:
    """The frequencies of a target before and after, each named with its worst error.

    The one shot is shown where it is not the answer itself.
    """
    row, error = results.assignment, target.error
    beside = row is not None and row.method != "one_shot"
    stages = [
        (target.initial_hz, INITIAL, "initial", error.initial),
        (target.exact_hz, OPTIMAL, "optimal, exact", error.exact),
        (target.predicted_hz, PREDICTED, "optimal, predicted", error.predicted),
        (target.one_shot_hz if beside else None, ONE_SHOT, "one shot", error.one_shot),
    ]
    found = []
    for hz, look, name, e in stages:
        if hz is not None and e:
            met = not target.asked.is_goal and e.max_relative == 0.0
            worst = "met" if met else f"worst {percent(e.max_relative)}"
            worst = f"at least {number(hz.min())} Hz" if target.asked.is_aim else worst
            found.append(Curve(hz, look, f"{name} ({worst})"))
    return tuple(found)


def _limited(results: RunResults, target: TargetStudy) -> Panel:
    """Frequencies of a limit, a gap, or all modes by a band; the forbidden ones are shaded."""
    asked, near = target.asked, target.near
    curves = _curves(results, target) if near is None else before_and_after(near)
    low, high = asked.forbidden_hz
    marks: tuple[Mark, ...] = (
        *(() if asked.is_aim else (Shade(low, high, graph.VERMILLION, "forbidden"),)),
        *(Curve(hz, EDGE) for hz in (low, high) if hz is not None),
        *curves,
    )
    key = () if near is None else BEFORE_AND_AFTER
    return Panel(f"{asked.axis} [Hz]", marks, 2.9, key=key)


# --- The steps of the sequential method


def progress(results: RunResults, row: AssignmentRow) -> FigurePlan:
    """√F of least squares, F of the worst case, in %, from the initial design on.

    Steps that were given up are hollow. Without a wanted frequency F is no error, and is drawn as
    it is. Where limits were missed on the way, what is left of that stands below: it comes first,
    so that F may rise while it falls.
    """
    values = np.array([row.objective_initial, *(step.objective for step in row.steps)])
    taken = np.array([step.taken for step in row.steps])
    limits = [t.error.initial.max_relative for t in results.targets if not t.asked.is_goal]
    violations = [max(limits, default=0.0), *(step.violation for step in row.steps)]
    missed = 100.0 * np.array(violations)
    several = bool((missed > 1e-6).any())  # %; less is round-off
    kind = "rms" if row.objective == "least_squares" else "worst"
    wanted = [t for t in results.targets if t.asked.is_goal]
    error = results.error if wanted else None
    label = "objective"
    if error is not None:
        values = 100.0 * (np.sqrt(np.maximum(values, 0.0)) if kind == "rms" else np.abs(values))
        uneven = any(t.asked.weight != 1.0 for t in wanted)
        label = f"{'weighted ' if uneven else ''}{kind} error [%]"
    marks: list[Mark] = [*_steps(values, taken, named=True)]
    if error is not None and error.one_shot is not None:
        marks.append(Rule(100.0 * _one_shot_error(wanted, kind), ONE_SHOT, "one shot"))
    height = 2.2 if several else 2.4
    panels = [Panel(label, tuple(marks), height, logarithmic=error is not None)]
    if several:
        below = tuple(_steps(missed, taken, named=False))
        panels.append(Panel("limits missed [%]", below, 1.2, logarithmic=True))
    return FigurePlan(
        "progress",
        "Progress of the sequential method",
        f"Exact objective of every design tried from the best start: {len(row.steps)} steps, "
        f"{taken.sum()} of them taken; {row.optimality.words}.",
        "The objective against the number of the step.",
        Graph(
            title="Progress of the sequential method",
            x_label="step",
            x=np.arange(values.size, dtype=np.float64),
            panels=tuple(panels),
            x_limits=(-0.5, values.size - 0.5),
            counted=True,
        ),
    )


def _one_shot_error(wanted: list[TargetStudy], kind: str) -> float:
    """Rms or worst error of the one shot, weighted as the objective is."""
    own = [
        (t.asked.weight, t.asked.weight * t.weight_s, t.error.one_shot)
        for t in wanted
        if t.error.one_shot is not None
    ]
    if kind == "worst":
        return max(weight * error.max_relative for weight, _, error in own)
    total = sum(share for _, share, _ in own)
    return float(np.sqrt(sum(share * e.rms_relative**2 for _, share, e in own) / total))


def _steps(values: Floats, taken: NDArray[np.bool_], named: bool) -> Iterator[Curve]:
    """The initial design, then a dot a step, hollow where it was given up."""
    number = np.arange(1.0, values.size)
    start, step = Look(graph.BLACK, 0.0, marker="s"), Look(graph.BLUE, 0.0, marker="o")
    yield Curve(values[:1], start, "initial" if named else "", np.zeros(1))
    for own, look, label in (
        (taken, step, "taken"),
        (~taken, replace(step, filled=False), "given up"),
    ):
        if own.any():
            yield Curve(values[1:][own], look, label if named else "", number[own])
