"""Moves: the error of a node over time, and what is left of it by motion time."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from eigassign.output.figures import graph
from eigassign.output.figures.curves import BEFORE_AND_AFTER, LEVEL
from eigassign.output.figures.graph import Curve, FigurePlan, Graph, Look, Panel, Rule
from eigassign.study.results import MoveRow, RunResults

MILLI = 1e3  # mm of 1 m
_LIMIT = Look(graph.GREY, 1.0, "dashed")


def move_figures(results: RunResults) -> Iterator[FigurePlan]:
    """Of each move the lobes over the motion time, and the error over time."""
    for k, row in enumerate(results.moves, 1):
        yield _lobes(row, k)
        yield _error(row, k)


def _lobes(row: MoveRow, k: int) -> FigurePlan:
    """What is left after the stop by motion time, before and after, with the limit."""
    before, after = (look for _, look in BEFORE_AND_AFTER)
    here = Curve(np.full(1, MILLI * row.residual), Look(graph.BLACK, 0.0, marker="o"),
                 f"{row.duration:.4g} s", np.full(1, row.duration))  # fmt: skip
    panel = Panel(
        "left [mm]",
        (
            Rule(MILLI * row.limit, _LIMIT),
            Curve(MILLI * row.lobes_before, before, "initial design"),
            Curve(MILLI * row.lobes, after, "this design"),
            here,
        ),
        2.6,
        logarithmic=True,
        decades=4,
    )
    title = f"By motion time: {row.name}"
    return FigurePlan(
        f"lobes_{k}",
        title,
        "The largest way after the stop for other motion times along the same path. Residuals have "
        "lobes: a slower motion may leave more. Dashed: the limit.",
        "Residual vibration over the motion time, on a logarithmic axis.",
        Graph(title, "motion time [s]", row.times, (panel,)),
        "moves",
    )


def _error(row: MoveRow, k: int) -> FigurePlan:
    """How far the node is from where it should be, and the stop."""
    after = BEFORE_AND_AFTER[1][1]
    error, stop = MILLI * row.error, np.full(2, row.duration)
    ends = np.array([min(0.0, error.min()), error.max()])
    panel = Panel(
        "error [mm]",
        (Rule(0.0, LEVEL), Curve(error, after), Curve(ends, _LIMIT, "stop", stop)),
        2.2,
    )
    title = f"Over time: {row.name}"
    return FigurePlan(
        f"move_{k}",
        title,
        "How far the node is from where rigid links and drives would have it; from the stop on it "
        "vibrates freely.",
        "Error of the node over time.",
        Graph(title, "time [s]", row.time_s, (panel,)),
        "moves",
    )
