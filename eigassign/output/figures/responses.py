"""Responses: the dynamic stiffness over time and frequency, and the least of the way."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from eigassign.output.figures import graph
from eigassign.output.figures.curves import BEFORE_AND_AFTER
from eigassign.output.figures.graph import Curve, FigurePlan, Graph, Heat, Look, Panel, Shade
from eigassign.study.results import ResponseRow, RunResults

MICRO = 1e6  # N/m of 1 N/µm


def response_figures(results: RunResults) -> Iterator[FigurePlan]:
    """Of each response the least along the path by frequency, and a map of each trajectory."""
    for k, row in enumerate(results.responses, 1):
        yield _least(row, k)
        for part in results.trajectories:
            end = f"_{part.name}" if len(results.trajectories) > 1 else ""
            hz, time_s = row.frequency_hz, results.time_s[part.rows]
            level = np.log10(np.maximum(row.stiffness[part.rows].T, 1.0) / MICRO)
            heat = Heat(hz, level, "log₁₀ of N/µm")
            panel = Panel("frequency [Hz]", (heat,), 3.2, within=(hz[0], hz[-1]))
            title = f"Over time: {row.name}"
            yield FigurePlan(
                f"response_{k}_map{end}",
                title,
                f"1/|H| over time and frequency along {part.name!r}: dark where it gives way.",
                "A map of the dynamic stiffness over time and frequency.",
                Graph(title, "time [s]", time_s, (panel,)),
                "responses",
            )


def _least(row: ResponseRow, k: int) -> FigurePlan:
    """The least dynamic stiffness and the least real part by frequency, and what is free."""
    free = [
        Shade(None, None, graph.GREEN, "" if n else "free speeds", x=np.array(ends))
        for n, one in enumerate(row.free)
        for ends in [[one.lowest * one.teeth / 60.0, one.highest * one.teeth / 60.0]]
    ]
    before, after = (look for _, look in BEFORE_AND_AFTER)
    curves = [Curve(row.stiffness.min(axis=0) / MICRO, after, "least along the path")]
    if row.initial is not None:
        curves.append(Curve(row.initial / MICRO, before, "initial design"))
    real = Curve(row.least_real * MICRO, Look(graph.BLUE), "least real part")
    panels = (
        Panel("stiffness [N/µm]", (*free, *curves), 2.4, logarithmic=True),
        Panel("Re H [µm/N]", (real,), 1.5, holds=(np.zeros(1),)),
    )
    title = f"Dynamic stiffness, {row.name}"
    return FigurePlan(
        f"response_{k}",
        title,
        "The least 1/|H| of all samples by frequency, and the least real part of H, which limits "
        "the depth of a stable cut." + " Green: no tooth passing meets a mode." * bool(free),
        "Dynamic stiffness and the real part of the response by frequency.",
        Graph(title, "frequency [Hz]", row.frequency_hz, panels),
        "responses",
    )
