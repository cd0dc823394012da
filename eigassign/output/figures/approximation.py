"""Expansion against exact frequencies over time: frequency above, errors below."""

from __future__ import annotations

import numpy as np

from eigassign.facts import percent
from eigassign.output.figures import graph
from eigassign.output.figures.curves import suffix
from eigassign.output.figures.graph import Curve, FigurePlan, Graph, Look, Panel
from eigassign.study.results import Comparison, ModeStudy, RunResults

EXACT = Look(graph.GREY, 3.2)
TAYLOR = Look(graph.VERMILLION, 1.4)
LINEARISED = Look(graph.BLUE, 1.4, "dashed")


def over_time(results: RunResults, study: ModeStudy, comparison: Comparison) -> FigurePlan:
    """Exact, Taylor and linearised frequency along the trajectory, and the magnitudes of errors."""
    title = f"Mode {study.mode}: expansion against exact along {results.along}, initial design"
    taylor, linearised = percent(comparison.worst_taylor), percent(comparison.worst_linearised)
    frequencies = (
        Curve(comparison.exact_hz, EXACT, "exact"),
        Curve(comparison.taylor_hz, TAYLOR, f"Taylor, order {study.order} (worst {taylor})"),
        Curve(comparison.linearised_hz, LINEARISED, f"linearised in y (worst {linearised})"),
    )
    errors = tuple(
        Curve(100.0 * np.where(np.isfinite(error), np.abs(error), np.nan), look)
        for error, look in (
            (comparison.taylor_error, TAYLOR),
            (comparison.linearised_error, LINEARISED),
        )
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
