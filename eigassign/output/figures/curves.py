"""The figures that are curves over one variable: coordinates, approximation, assignment, modes.

Each function plans one figure or describes it. Panels stand one above the other over a common
abscissa; frequencies in Hz, errors in % of the frequency in Hz.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

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
from eigassign.output.formats import capital, percent
from eigassign.study.results import (
    AssignmentRow,
    Comparison,
    DesignMap,
    ErrorRow,
    ModeStudy,
    OtherModes,
    RunResults,
    TargetStudy,
)

Floats = NDArray[np.float64]

EXACT = Look(graph.GREY, 3.2)
TAYLOR = Look(graph.VERMILLION, 1.4)
LINEARISED = Look(graph.BLUE, 1.4, "dashed")
TARGET = Look(graph.BLACK, 1.6, "dotted")
INITIAL = Look(graph.ORANGE, 1.8, "dash-dotted")
ONE_SHOT = Look(graph.PURPLE, 0.9)
OPTIMAL = Look(graph.SKY, 3.2)
PREDICTED = Look(graph.BLUE, 1.3, "dashed")
POINT = Look(graph.GREY, 0.9, "fine")
LEVEL = Look(graph.BLACK, 0.8)
EDGE = Look(graph.VERMILLION, 1.0)
SEEN = 1e-6  # % by which limits are missed: less is round-off
_TALL = 2.9  # inches of a panel that stands alone

# --- Coordinates


def coordinates(results: RunResults) -> FigurePlan:
    """q(t)."""
    names = ", ".join(results.q_names)
    return FigurePlan(
        f"coordinates{_suffix(results)}",
        f"Coordinates{_where(results)}",
        f"{names} along {results.along}, {results.time_s.size} samples.",
        f"Curves of {names} over time.",
        _coordinates(results),
    )


def _coordinates(results: RunResults) -> Graph:
    """One panel for each unit."""
    units = list(dict.fromkeys(results.q_units))
    height = 2.6 if len(units) == 1 else 1.8
    panels = []
    for unit in units:
        own = [i for i, each in enumerate(results.q_units) if each == unit]
        curves = (Curve(results.q[:, i], series(i), short(results.q_names[i])) for i in own)
        quantity = {"rad": "joint angle", "m": "joint stroke"}.get(unit, "coordinate")
        panels.append(Panel(labelled(quantity, unit), tuple(curves), height))
    title = f"Coordinates along {results.along}"
    return Graph(title, "time [s]", results.time_s, tuple(panels))


def _suffix(results: RunResults) -> str:
    """What tells the files of several trajectories apart."""
    return f"_{results.only}" if results.only is not None else ""


def _where(results: RunResults) -> str:
    """The same for headings and titles."""
    return f", {results.along}" if results.only is not None else ""


# --- Expansion against exact frequencies (the paper's Figure 3)


def over_time(results: RunResults, study: ModeStudy, comparison: Comparison) -> FigurePlan:
    """Exact, Taylor and linearised frequency along the trajectory, and both errors."""
    title = f"Mode {study.mode}: expansion against exact along {results.along}, initial design"
    return FigurePlan(
        f"approximation_mode_{study.mode}_time{_suffix(results)}",
        f"Mode {study.mode}: expansion along {results.along}",
        "Exact, Taylor and linearised frequency at the initial design. " + worst_errors(comparison),
        f"Frequency of mode {study.mode} over time and the errors of both expansions.",
        _compared(title, "time [s]", results.time_s, study, comparison),
    )


def worst_errors(comparison: Comparison) -> str:
    """The sentence of a caption."""
    return (
        f"Worst error {percent(comparison.worst_taylor)} for the full expansion, "
        f"{percent(comparison.worst_linearised)} for the partially linearised one."
    )


def over_one(study: ModeStudy, over: DesignMap, around: Floats) -> Graph:
    """The same over one parameter, the expansion point marked."""
    name = short(over.names[0])
    title = f"Mode {study.mode}: expansion against exact over {name}"
    x_label = labelled(name, over.units[0])
    return _compared(title, x_label, over.axes[0], study, over.values, around)


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


# --- Everything that was asked for, before and after


def overview(results: RunResults, spectrum: OtherModes) -> FigurePlan:
    """All modes up to the one above the highest asked for, with targets, limits and bands."""
    wanted = [t for t in results.targets if t.kind == "frequency"]
    limits = [t for t in results.targets if t.kind not in ("frequency", "gap")]
    modes = sorted(before_and_after(spectrum), key=lambda curve: bool(curve.end))  # after on top
    time_s = results.time_s
    low, high = graph.bounds([curve.y for curve in modes])
    asked = [mark for t in limits for mark in _asked(t, time_s[t.rows], 0.05 * (high - low))]
    targets = (Curve(t.target_hz, TARGET, capital(t.label), time_s[t.rows]) for t in wanted)
    marks: tuple[Mark, ...] = (*asked, *modes, *targets)
    panels = [Panel("frequency [Hz]", marks, 2.8, key=BEFORE_AND_AFTER)]
    if wanted:
        off = [curve for target in wanted for curve in _off_target(results, target)]
        panels.append(Panel("off target [%]", (Rule(0.0, LEVEL), *off), 1.4, holds=(np.zeros(1),)))
    heading = f"Frequencies before and after{_where(results)}"
    return FigurePlan(
        f"frequencies{_suffix(results)}",
        heading,
        f"Exact frequencies of mode{'s' if len(spectrum.modes) > 1 else ''} "
        f"{', '.join(map(str, spectrum.modes))} along {results.along}, before and after, with all "
        "that was asked for.",
        "Frequencies over time before and after, with targets, limits and bands.",
        Graph(heading, "time [s]", time_s, tuple(panels)),
    )


def _asked(target: TargetStudy, x: Floats, width: float) -> Iterator[Mark]:
    """A band; of a limit a strip on its wrong side in its mode's colour, for others may lie there.

    ``width`` is that of the strip in Hz.
    """
    if target.kind == "keep_out":
        yield replace(forbidden(target, target.label), x=x)
        return
    upper, colour = target.kind == "at_most", mode_colour(target.mode)
    edge = target.upper_hz if upper else target.lower_hz
    low, high = (edge, edge + width) if upper else (edge - width, edge)
    yield Shade(low, high, colour, target.label, 0.25, x)
    yield Curve(edge, Look(colour, 1.0, "fine"), x=x)


def _off_target(results: RunResults, target: TargetStudy) -> Iterator[Curve]:
    """f/f_target − 1 before and after, in the colour of the mode."""
    colour = mode_colour(target.mode)
    stages = ((target.initial_hz, _BEFORE, ""), (target.exact_hz, _AFTER, target.curve_name))
    for hz, look, end in stages:
        off = 100.0 * (hz / target.target_hz - 1.0)
        x = results.time_s[target.rows]
        yield Curve(off, replace(look, colour=colour), x=x, end=end)


# --- The assignment (the paper's Figure 4) and the next modes (its Figure 5)


def assignment(results: RunResults, target: TargetStudy) -> FigurePlan:
    """A target in time: frequencies before and after, and their distance or what is forbidden."""
    wanted = target.kind == "frequency"
    modes = "_".join(map(str, target.modes)) or "all"
    if target.followed is not None:
        modes = f"like_{target.mode}"
    kind = "assignment" if wanted else target.kind
    heading = (
        f"{capital(target.curve_name)}: initial, optimal and target frequency{_where(results)}"
    )
    what = "distance to the target" if wanted else "violation"
    alt = f"Frequency of {target.curve_name} over time before and after, with its target."
    return FigurePlan(
        f"{kind}_mode_{modes}{_suffix(results)}",
        heading if wanted else f"{capital(target.label)}{_where(results)}",
        f"Worst {what} {percent(target.error.initial.max_relative)} before and "
        f"{percent(target.error.exact.max_relative)} after.",
        alt if wanted else f"{capital(target.label)}: frequencies over time before and after.",
        (_assigned if wanted else _limited)(results, target),
    )


def _assigned(results: RunResults, target: TargetStudy) -> Graph:
    """Frequencies above, f/f_target − 1 below; the one shot where it is not the answer itself."""
    curves = _curves(results, target)
    off = (Curve(100.0 * (curve.y / target.target_hz - 1.0), curve.look) for curve in curves)
    panels = (
        Panel("frequency [Hz]", (Curve(target.target_hz, TARGET, "target"), *curves), 2.0),
        Panel("off target [%]", (Rule(0.0, LEVEL), *off), 1.35, holds=(np.zeros(1),)),
    )
    title = f"{capital(target.curve_name)}: assigned frequency{_where(results)}"
    return Graph(title, "time [s]", results.time_s[target.rows], panels)


def _curves(results: RunResults, target: TargetStudy) -> tuple[Curve, ...]:
    """The frequencies of a target before and after, each named with its worst error."""
    row, error = results.assignment, target.error
    beside = row is not None and row.method != "one_shot"
    stages = [
        (target.initial_hz, INITIAL, "initial", error.initial),
        (target.exact_hz, OPTIMAL, "optimal, exact", error.exact),
        (target.predicted_hz, PREDICTED, "optimal, predicted", error.predicted),
        (target.one_shot_hz if beside else None, ONE_SHOT, "one shot", error.one_shot),
    ]
    return tuple(
        Curve(hz, look, f"{name} ({_reached(target, e)})")
        for hz, look, name, e in stages
        if hz is not None and e
    )


def _reached(target: TargetStudy, error: ErrorRow) -> str:
    if target.kind != "frequency" and error.max_relative == 0.0:
        return "met"
    return f"worst {percent(error.max_relative)}"


def _limited(results: RunResults, target: TargetStudy) -> Graph:
    """What is forbidden, shaded, and the frequencies of a limit, a gap, or all modes by a band."""
    near = target.near
    curves = _curves(results, target) if near is None else before_and_after(near)
    edges = [hz for hz in (target.lower_hz, target.upper_hz) if np.isfinite(hz).all()]
    marks: tuple[Mark, ...] = (
        forbidden(target, "forbidden"),
        *(Curve(hz, EDGE) for hz in edges),
        *curves,
    )
    label = "distance of the modes [Hz]" if target.kind == "gap" else "frequency [Hz]"
    panel = Panel(label, marks, _TALL, key=() if near is None else BEFORE_AND_AFTER)
    title = f"{capital(target.label)}{_where(results)}"
    return Graph(title, "time [s]", results.time_s[target.rows], (panel,))


def forbidden(target: TargetStudy, label: str) -> Shade:
    """What a limit or band keeps frequencies out of."""
    low, high = {
        "at_most": (target.upper_hz, None),
        "keep_out": (target.lower_hz, target.upper_hz),
    }.get(target.kind, (None, target.lower_hz))
    return Shade(low, high, graph.VERMILLION, label)


# --- The steps of the sequential method


def progress(results: RunResults, row: AssignmentRow) -> FigurePlan:
    """The objective after every step, with the one shot's beside it."""
    taken = sum(step.taken for step in row.steps)
    return FigurePlan(
        "progress",
        "Progress of the sequential method",
        f"Exact objective of every design tried from the best start: {len(row.steps)} steps, "
        f"{taken} of them taken; {row.optimality.words}.",
        "The objective against the number of the step.",
        _progress(results, row),
    )


def _progress(results: RunResults, row: AssignmentRow) -> Graph:
    """√F of least squares, F of the worst case, in %, from the initial design on.

    Steps that were given up are hollow.
    Without a wanted frequency F is no error, and is drawn as it is. Where limits were missed on the
    way, what is left of that stands below: it comes first, so that F may rise while it falls.
    """
    values = np.array([row.objective_initial, *(step.objective for step in row.steps)])
    taken = np.array([step.taken for step in row.steps])
    limits = [t.error.initial.max_relative for t in results.targets if t.kind != "frequency"]
    violations = [max(limits, default=0.0), *(step.violation for step in row.steps)]
    missed = 100.0 * np.array(violations)
    several = bool((missed > SEEN).any())
    kind = "rms" if row.objective == "least_squares" else "worst"
    error = results.error if any(t.kind == "frequency" for t in results.targets) else None
    label = "objective"
    if error is not None:
        values = 100.0 * (np.sqrt(np.maximum(values, 0.0)) if kind == "rms" else np.abs(values))
        uneven = any(t.weight != 1.0 for t in results.targets if t.kind == "frequency")
        label = f"{'weighted ' if uneven else ''}{kind} error [%]"
    marks: list[Mark] = list(_steps(values, taken, named=True))
    if error is not None and error.one_shot is not None:
        marks.append(Rule(100.0 * _one_shot(results, kind), ONE_SHOT, "one shot"))
    height = 2.2 if several else 2.4
    panels = [Panel(label, tuple(marks), height, logarithmic=error is not None)]
    if several:
        below = tuple(_steps(missed, taken, named=False))
        panels.append(Panel("limits missed [%]", below, 1.2, logarithmic=True))
    return Graph(
        title="Progress of the sequential method",
        x_label="step",
        x=np.arange(values.size, dtype=np.float64),
        panels=tuple(panels),
        x_limits=(-0.5, values.size - 0.5),
        counted=True,
    )


def _one_shot(results: RunResults, kind: str) -> float:
    """Its rms or worst error, weighted as the objective is."""
    own = [
        (t.weight, t.weight * t.weight_s, t.error.one_shot)
        for t in results.targets
        if t.kind == "frequency" and t.error.one_shot is not None
    ]
    if kind == "worst":
        return max(weight * error.max_relative for weight, _, error in own)
    total = sum(share for _, share, _ in own)
    return float(np.sqrt(sum(share * e.rms_relative**2 for _, share, e in own) / total))


def _steps(values: Floats, taken: NDArray[np.bool_], named: bool) -> list[Curve]:
    """The initial design, then a dot a step, hollow where it was given up."""
    number = np.arange(1.0, values.size)
    found = [Curve(values[:1], _START, "initial" if named else "", np.zeros(1))]
    for own, look, label in ((taken, _TAKEN, "taken"), (~taken, _GIVEN_UP, "given up")):
        if own.any():
            found.append(Curve(values[1:][own], look, label if named else "", number[own]))
    return found


_START = Look(graph.BLACK, 0.0, marker="s")
_TAKEN = Look(graph.BLUE, 0.0, marker="o")
_GIVEN_UP = replace(_TAKEN, filled=False)

# --- Other modes


def other_modes(results: RunResults, others: OtherModes) -> FigurePlan:
    """The modes of which no frequency is wanted, before and after."""
    modes = ", ".join(map(str, others.modes))
    panel = Panel("frequency [Hz]", before_and_after(others), _TALL, key=BEFORE_AND_AFTER)
    title = f"Other modes before and after, exact{_where(results)}"
    return FigurePlan(
        f"other_modes{_suffix(results)}",
        f"Other modes{_where(results)}",
        f"Exact frequencies before and after of modes {modes}, for which no frequency was asked.",
        f"Frequencies of modes {modes} over time before and after.",
        Graph(title, "time [s]", results.time_s, (panel,)),
    )


_BEFORE, _AFTER = Look(graph.BLACK, 1.3, "dashed"), Look(graph.BLACK, 1.8)
BEFORE_AND_AFTER = (("initial design", _BEFORE), ("optimal design", _AFTER))
_MODES = tuple(one for one in graph.SERIES if one != graph.VERMILLION)  # what is forbidden


def mode_colour(mode: int) -> str:
    """The same in all figures."""
    return _MODES[(mode - 1) % len(_MODES)]


def before_and_after(shown: OtherModes) -> tuple[Curve, ...]:
    """One colour a mode: dashed before, solid after, its number at the end of its curve."""
    found = []
    for k, mode in enumerate(shown.modes):
        colour = mode_colour(mode)
        before, after = (replace(look, colour=colour) for look in (_BEFORE, _AFTER))
        found.append(Curve(shown.initial_hz[:, k], before))
        found.append(Curve(shown.optimal_hz[:, k], after, end=f"mode {mode}"))
    return tuple(found)
