"""The figures of a run: approximation, and which of all there are."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from eigassign.facts import percent
from eigassign.output.figures import curves, graph, mechanism
from eigassign.output.figures.curves import suffix
from eigassign.output.figures.graph import Curve, FigurePlan, Graph, Look, Panel
from eigassign.output.figures.moves import move_figures
from eigassign.output.figures.responses import response_figures
from eigassign.study.results import WEIGHED, Comparison, ModeStudy, RunResults, along_each

EXACT = Look(graph.GREY, 3.2)
TAYLOR = Look(graph.VERMILLION, 1.4)
LINEARISED = Look(graph.BLUE, 1.4, "dashed")


def over_time(results: RunResults, study: ModeStudy, comparison: Comparison) -> FigurePlan:
    """Exact, Taylor and linearised frequency along the trajectory, and the magnitudes of errors."""
    title = f"Mode {study.mode}: expansion against exact along {results.along}, initial design"
    taylor, linearised = map(percent, comparison.worst.values())
    frequencies = (
        Curve(comparison.exact_hz, EXACT, "exact"),
        Curve(comparison.taylor_hz, TAYLOR, f"Taylor, order {study.order} (worst {taylor})"),
        Curve(comparison.linearised_hz, LINEARISED, f"linearised in y (worst {linearised})"),
    )
    errors = tuple(
        Curve(100.0 * np.where(np.isfinite(error), np.abs(error), np.nan), look)
        for error, look in zip(comparison.errors.values(), (TAYLOR, LINEARISED), strict=True)
    )
    panels = (
        Panel("frequency [Hz]", frequencies, 1.9),
        Panel("|error| [%]", errors, 1.35, logarithmic=True),
    )
    return FigurePlan(
        f"approximation_mode_{study.mode}_time{suffix(results)}",
        f"Mode {study.mode}: expansion along {results.along}",
        "Exact, Taylor and linearised frequency at the initial design. Worst error "
        f"{taylor} for the full expansion, {linearised} for the partially linearised one.",
        f"Frequency of mode {study.mode} over time and the errors of both expansions.",
        Graph(title, "time [s]", results.time_s, panels),
    )


def run_figures(results: RunResults) -> tuple[FigurePlan, ...]:
    """Figures of what was asked, the mechanism, responses, the motion, how exact."""
    return tuple(_figures(results))


def _figures(results: RunResults) -> Iterator[FigurePlan]:
    each = along_each(results)
    for one in each:
        if one.spectrum and one.time_s.size:
            yield curves.overview(one, one.spectrum)
    yield from (curves.campbell(one) for one in each if one.orders and one.spectrum)
    if any(results.poses.lines):
        yield mechanism.poses(results.case.title, results.poses)
    # else 0.15 s that nobody asked for
    asked = any(d.of == WEIGHED or d.limit is not None for d in results.drives)
    yield from (curves.exerted(one, "statics") for one in each if one.statics)
    yield from response_figures(results)
    yield from move_figures(results)
    yield from (curves.exerted(one, "drives") for one in each if asked)
    yield from (curves.coordinates(one) for one in each if one.q.size)
    for k, study in enumerate(results.studies):
        for one in each:
            comparison = one.studies[k].over_time
            if comparison is not None and comparison.exact_hz.size:
                yield over_time(one, study, comparison)
