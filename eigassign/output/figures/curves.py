"""The figures that are curves over one variable: coordinates, approximation, assignment, modes.

Each function plans one figure, the next one draws it. Panels stand one above the other over a
common abscissa; frequencies in Hz, errors in % of the frequency in Hz.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from eigassign.output.figures import style
from eigassign.output.figures.style import FigurePlan, labelled, legend_above, short
from eigassign.output.formats import percent
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

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Floats = NDArray[np.float64]
Look = dict[str, Any]  # colour, width and dashes of a line

EXACT: Look = {"color": style.GREY, "linewidth": 3.2}
TAYLOR: Look = {"color": style.VERMILLION, "linewidth": 1.4}
LINEARISED: Look = {"color": style.BLUE, "linewidth": 1.4, "linestyle": style.DASHED}
TARGET: Look = {"color": style.BLACK, "linewidth": 1.6, "linestyle": style.DOTTED}
INITIAL: Look = {"color": style.ORANGE, "linewidth": 1.8, "linestyle": style.DASH_DOTTED}
ONE_SHOT: Look = {"color": style.PURPLE, "linewidth": 0.9}
OPTIMAL: Look = {"color": style.SKY, "linewidth": 3.2}
PREDICTED: Look = {"color": style.BLUE, "linewidth": 1.3, "linestyle": style.DASHED}
POINT: Look = {"color": style.GREY, "linewidth": 0.9, "linestyle": (0, (3.0, 3.0))}
SEEN = 1e-6  # % by which limits are missed: less is round-off
_TALL = 2.9  # inches of a panel that stands alone
_ERROR_DECADES = 5  # of an error axis: what is smaller is as good as nothing

# --- Panels


def stacked(title: str, x_label: str, heights: Sequence[float]) -> tuple[Figure, list[Axes]]:
    """A figure of panels with these heights in inches, one below the other."""
    figure = style.new_figure(title, sum(heights) + 0.15 * len(heights) + 1.1)
    axes = figure.subplots(
        len(heights), 1, sharex=True, squeeze=False, gridspec_kw={"height_ratios": heights}
    )
    axes[-1, 0].set_xlabel(x_label)
    figure.align_ylabels()
    return figure, list(axes[:, 0])


def plot(axes: Axes, x: Floats, curves: Sequence[tuple[Floats, Look]], label: str) -> None:
    """Curves over ``x`` on a linear scale; a single point is a dot."""
    for y, look in curves:
        axes.plot(x, y, **look, marker="o" if x.size == 1 else "")
    low, high = style.bounds([y for y, _ in curves])
    margin = 0.05 * (high - low)
    axes.set(ylabel=label, ylim=(low - margin, high + margin))
    axes.yaxis.set_offset_position("right")  # a power of ten, away from the legend


def plot_logarithmic(
    axes: Axes, x: Floats, curves: Sequence[tuple[Floats, Look]], label: str
) -> None:
    """Curves >= 0 over ``x`` on a logarithmic scale; the lowest label says ≤ if values are cut."""
    low, high = style.decades([y for y, _ in curves], _ERROR_DECADES)
    for y, look in curves:
        axes.plot(x, np.maximum(y, low), **look, marker="o" if x.size == 1 else "")
    cut = any(bool(np.any(y < low)) for y, _ in curves)
    style.logarithmic(axes, "y", (low, high), cut=cut)
    axes.set_ylabel(label)


# --- Coordinates


def coordinates(results: RunResults) -> FigurePlan:
    """q(t)."""
    names = ", ".join(results.q_names)
    return FigurePlan(
        f"coordinates{_suffix(results)}",
        f"Coordinates{_where(results)}",
        f"The coordinates {names} along {results.along} of {results.time_s.size} samples.",
        f"Curves of {names} over time.",
        partial(draw_coordinates, results),
    )


def draw_coordinates(results: RunResults) -> Figure:
    """q(t), one panel for each unit."""
    units = list(dict.fromkeys(results.q_units))
    heights = [2.6 if len(units) == 1 else 1.8] * len(units)
    figure, panels = stacked(f"Coordinates along {results.along}", "time [s]", heights)
    lines = []
    for axes, unit in zip(panels, units, strict=True):
        own = [i for i, each in enumerate(results.q_units) if each == unit]
        looks = [{**style.series(i), "label": short(results.q_names[i])} for i in own]
        curves = [(results.q[:, i], look) for i, look in zip(own, looks, strict=True)]
        quantity = {"rad": "joint angle", "m": "joint stroke"}.get(unit, "coordinate")
        plot(axes, results.time_s, curves, labelled(quantity, unit))
        lines += axes.get_lines()
    legend_above(panels[0], lines)
    return figure


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
        partial(draw_comparison, title, "time [s]", results.time_s, study, comparison),
    )


def worst_errors(comparison: Comparison) -> str:
    """The sentence of a caption."""
    return (
        f"Worst error {percent(comparison.worst_taylor)} for the full expansion, "
        f"{percent(comparison.worst_linearised)} for the partially linearised one."
    )


def draw_over_one(study: ModeStudy, over: DesignMap, around: Floats) -> Figure:
    """The same over one parameter, the expansion point marked."""
    name = short(over.names[0])
    title = f"Mode {study.mode}: expansion against exact over {name}"
    x_label = labelled(name, over.units[0])
    return draw_comparison(title, x_label, over.axes[0], study, over.values, around)


def draw_comparison(
    title: str,
    x_label: str,
    x: Floats,
    study: ModeStudy,
    comparison: Comparison,
    points: Floats | Sequence[float] = (),
) -> Figure:
    """Frequency above, magnitude of the relative errors below; ``points`` are upright lines."""
    figure, (above, below) = stacked(title, x_label, (1.9, 1.35))
    taylor, linearised = comparison.worst_taylor, comparison.worst_linearised
    taylor_label = f"Taylor, order {study.order} (worst {percent(taylor)})"
    linearised_label = f"linearised in y (worst {percent(linearised)})"
    frequencies: list[tuple[Floats, Look]] = [
        (comparison.exact_hz, {**EXACT, "label": "exact"}),
        (comparison.taylor_hz, {**TAYLOR, "label": taylor_label}),
        (comparison.linearised_hz, {**LINEARISED, "label": linearised_label}),
    ]
    plot(above, x, frequencies, "frequency [Hz]")
    errors = [
        (100.0 * np.abs(comparison.taylor_error), TAYLOR),
        (100.0 * np.abs(comparison.linearised_error), LINEARISED),
    ]
    plot_logarithmic(below, x, errors, "|error| [%]")
    handles = list(above.get_lines())
    for at in (float(at) for at in points if x.min() <= at <= x.max()):
        below.axvline(at, **POINT)
        handles.append(above.axvline(at, **POINT, label="expansion point"))
    legend_above(above, handles)
    return figure


# --- The assignment (the paper's Figure 4) and the next modes (its Figure 5)


def assignment(results: RunResults, target: TargetStudy) -> FigurePlan:
    """A target in time: frequencies before and after, and their distance or what is forbidden."""
    wanted = target.kind == "frequency"
    modes = "_".join(map(str, target.modes)) or "all"
    if target.followed is not None:
        modes = f"like_{target.mode}"
    kind = "assignment" if wanted else target.kind
    heading = (
        f"{_capital(target.curve_name)}: initial, optimal and target frequency{_where(results)}"
    )
    what = "distance to the target" if wanted else "violation"
    alt = f"Frequency of {target.curve_name} over time before and after, with its target."
    return FigurePlan(
        f"{kind}_mode_{modes}{_suffix(results)}",
        heading if wanted else f"{_capital(target.label)}{_where(results)}",
        f"Worst {what} {percent(target.error.initial.max_relative)} before and "
        f"{percent(target.error.exact.max_relative)} after.",
        alt if wanted else f"{_capital(target.label)}: frequencies over time before and after.",
        partial(draw_assignment if wanted else draw_limit, results, target),
    )


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]


def draw_assignment(results: RunResults, target: TargetStudy) -> Figure:
    """Frequencies above, f/f_target − 1 below; the one shot where it is not the answer itself."""
    title = f"{_capital(target.curve_name)}: assigned frequency{_where(results)}"
    figure, (above, below) = stacked(title, "time [s]", (2.0, 1.35))
    curves = _curves(results, target)
    time_s = results.time_s[target.rows]
    frequencies: list[tuple[Floats, Look]] = [
        (target.target_hz, {**TARGET, "label": "target", "zorder": 3.0})
    ]
    plot(above, time_s, [*frequencies, *curves], "frequency [Hz]")
    off = [
        (100.0 * (hz / target.target_hz - 1.0), {k: v for k, v in look.items() if k != "label"})
        for hz, look in curves
    ]
    zero = np.zeros(time_s.size)
    zero_line: Look = {"color": style.BLACK, "linewidth": 0.8}
    plot(below, time_s, [(zero, zero_line), *off], "off target [%]")
    legend_above(above, above.get_lines())
    return figure


def _curves(results: RunResults, target: TargetStudy) -> list[tuple[Floats, Look]]:
    """The frequencies of a target before and after, each named with its worst error."""
    row, error = results.assignment, target.error
    beside = row is not None and row.method != "one_shot"
    stages = [
        (target.initial_hz, INITIAL, "initial", error.initial),
        (target.exact_hz, OPTIMAL, "optimal, exact", error.exact),
        (target.predicted_hz, PREDICTED, "optimal, predicted", error.predicted),
        (target.one_shot_hz if beside else None, ONE_SHOT, "one shot", error.one_shot),
    ]
    return [
        (hz, {**look, "label": f"{name} ({_reached(target, e)})"})
        for hz, look, name, e in stages
        if hz is not None and e
    ]


def _reached(target: TargetStudy, error: ErrorRow) -> str:
    if target.kind != "frequency" and error.max_relative == 0.0:
        return "met"
    return f"worst {percent(error.max_relative)}"


def draw_limit(results: RunResults, target: TargetStudy) -> Figure:
    """What is forbidden, shaded, and the frequencies of a limit, a gap, or all modes by a band."""
    title = f"{_capital(target.label)}{_where(results)}"
    figure, (axes,) = stacked(title, "time [s]", (_TALL,))
    time_s = results.time_s[target.rows]
    near = target.near
    curves = _curves(results, target) if near is None else _before_and_after(near)
    edges = [hz for hz in (target.lower_hz, target.upper_hz) if np.isfinite(hz).all()]
    label = "distance of the modes [Hz]" if target.kind == "gap" else "frequency [Hz]"
    edge: Look = {"color": style.VERMILLION, "linewidth": 1.0}
    plot(axes, time_s, [*((hz, edge) for hz in edges), *curves], label)
    low, high = axes.get_ylim()
    if target.kind == "keep_out":
        bottom, top = target.lower_hz, target.upper_hz
    elif target.kind == "at_most":
        bottom, top = target.upper_hz, np.full(time_s.size, high)
    else:
        bottom, top = np.full(time_s.size, low), target.lower_hz
    shade = axes.fill_between(
        time_s, bottom, top, color=style.VERMILLION, alpha=0.15, linewidth=0.0, label="forbidden"
    )
    if near is None:
        legend_above(axes, [shade, *axes.get_lines()[len(edges) :]])
    else:
        _name_modes(axes, near)
        legend_above(axes, [shade, *_legend_of_modes()])
    return figure


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
        partial(draw_progress, results, row),
    )


def draw_progress(results: RunResults, row: AssignmentRow) -> Figure:
    """√F of least squares, F of the worst case, in %, from the initial design on.

    Steps that were given up are hollow.
    Without a wanted frequency F is no error, and is drawn as it is. Where limits were missed on the
    way, what is left of that stands below: it comes first, so that F may rise while it falls.
    """
    values = np.array([row.objective_initial, *(step.objective for step in row.steps)])
    number, taken = np.arange(1.0, values.size), np.array([step.taken for step in row.steps])
    limits = [t.error.initial.max_relative for t in results.targets if t.kind != "frequency"]
    violations = [max(limits, default=0.0), *(step.violation for step in row.steps)]
    missed = 100.0 * np.array(violations)
    heights = (2.2, 1.2) if (missed > SEEN).any() else (2.4,)
    figure, panels = stacked("Progress of the sequential method", "step", heights)
    axes = panels[0]
    kind = "rms" if row.objective == "least_squares" else "worst"
    hidden: Look = {"linestyle": "none"}
    at = np.append(0.0, number)
    error = results.error if any(t.kind == "frequency" for t in results.targets) else None
    if error is None:
        plot(axes, at, [(values, hidden)], "objective")
    else:
        values = 100.0 * (np.sqrt(np.maximum(values, 0.0)) if kind == "rms" else np.abs(values))
        uneven = any(t.weight != 1.0 for t in results.targets if t.kind == "frequency")
        weighted = "weighted " if uneven else ""
        plot_logarithmic(axes, at, [(values, hidden)], f"{weighted}{kind} error [%]")
    handles = _steps(axes, number, values, taken)
    if error is not None and error.one_shot is not None:
        handles.append(axes.axhline(100.0 * _one_shot(results, kind), **ONE_SHOT, label="one shot"))
    axes.set_xlim(-0.5, values.size - 0.5)
    axes.set_xticks(range(0, values.size, max(1, values.size // 10)))
    for below in panels[1:]:
        plot_logarithmic(below, at, [(missed, hidden)], "limits missed [%]")
        _steps(below, number, missed, taken)
    legend_above(axes, handles)
    return figure


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


def _steps(axes: Axes, number: Floats, values: Floats, taken: NDArray[np.bool_]) -> list[Any]:
    """The initial design, then a dot a step, hollow where it was given up.

    What is below the axis stands on its edge.
    """
    low = axes.get_ylim()[0]
    handles: list[Any] = axes.plot(
        0.0, max(values[0], low), linestyle="none", marker="s", color=style.BLACK, label="initial",
        clip_on=False,
    )  # fmt: skip
    values = values[1:]
    for own, fill, label in ((taken, style.BLUE, "taken"), (~taken, "none", "given up")):
        if own.any():
            handles += axes.plot(
                number[own], np.maximum(values[own], low), linestyle="none", marker="o",
                markerfacecolor=fill, color=style.BLUE, label=label, clip_on=False,
            )  # fmt: skip
    return handles


def other_modes(results: RunResults, others: OtherModes) -> FigurePlan:
    """The modes that were not assigned, before and after."""
    modes = ", ".join(map(str, others.modes))
    return FigurePlan(
        f"other_modes{_suffix(results)}",
        f"Next modes{_where(results)}",
        f"Exact frequencies of modes {modes}, which were not assigned, before and after.",
        f"Frequencies of modes {modes} over time before and after.",
        partial(draw_other_modes, results, others),
    )


def draw_other_modes(results: RunResults, others: OtherModes) -> Figure:
    """One colour a mode: dashed before, solid after, its number at the end of its curve."""
    title = f"Next modes before and after, exact{_where(results)}"
    figure, (axes,) = stacked(title, "time [s]", (_TALL,))
    plot(axes, results.time_s, _before_and_after(others), "frequency [Hz]")
    _name_modes(axes, others)
    legend_above(axes, _legend_of_modes())
    return figure


_BEFORE: Look = {"linewidth": 1.3, "linestyle": style.DASHED}
_AFTER: Look = {"linewidth": 1.8}


def _colour(k: int) -> str:
    colours = [one for one in style.SERIES if one != style.VERMILLION]  # what is forbidden
    return colours[k % len(colours)]


def _before_and_after(shown: OtherModes) -> list[tuple[Floats, Look]]:
    both = ((shown.initial_hz, _BEFORE), (shown.optimal_hz, _AFTER))
    modes = range(len(shown.modes))
    return [(hz[:, k], {**look, "color": _colour(k)}) for k in modes for hz, look in both]


def _name_modes(axes: Axes, shown: OtherModes) -> None:
    """The number of each mode at the end of its curve."""
    low, high = axes.get_ylim()
    ends, apart = shown.optimal_hz[-1], 0.15 * (high - low) / _TALL
    order = np.argsort(ends)
    for k, place in zip(order, spread(ends[order], apart), strict=True):
        axes.annotate(
            f"mode {shown.modes[k]}", (1.0, place), (6.0, 0.0), color=_colour(k), va="center",
            xycoords=("axes fraction", "data"), textcoords="offset points",
        )  # fmt: skip


def _legend_of_modes() -> list[Any]:
    from matplotlib.lines import Line2D

    return [
        Line2D([], [], color=style.BLACK, **_BEFORE, label="initial design"),
        Line2D([], [], color=style.BLACK, **_AFTER, label="optimal design"),
    ]


def spread(wanted: Floats | Sequence[float], gap: float) -> list[float]:
    """Ascending places nearest to the ascending ``wanted`` ones with ``gap`` between them."""
    clusters: list[tuple[float, int]] = []  # mean place, how many
    for place in wanted:
        mean, count = float(place), 1
        while clusters and clusters[-1][0] + gap * (clusters[-1][1] + count) / 2.0 > mean:
            other, size = clusters.pop()
            mean, count = (other * size + mean * count) / (size + count), size + count
        clusters.append((mean, count))
    return [mean + gap * (i - (count - 1) / 2.0) for mean, count in clusters for i in range(count)]
