"""`eigassign chart`: one case from its file to the folder of its chart."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from eigassign.chart.comparison import chart_meshes, compare_methods
from eigassign.chart.designs import chart_designs
from eigassign.chart.question import Effort
from eigassign.chart.results import Chart, Request
from eigassign.errors import AccuracyError
from eigassign.output.reports.chart import write_chart
from eigassign.pipeline.run import Options, prepare
from eigassign.pipeline.run_files import new_run_folder
from eigassign.pipeline.stages import Stages
from eigassign.study.accuracy import truncation_notes
from eigassign.study.built_case import BuiltCase, load_case


def chart(
    path: str | Path, options: Options, effort: Effort, request: Request
) -> tuple[Path, Chart]:
    """`chart_case`, and its folder: chart.json, report.html, figures, case.yaml."""
    case = load_case(path, options.allow_outside)
    with new_run_folder(case.file, options.out, options.force, "_chart") as folder:
        made = chart_case(case, options, effort, request)
        options.progress("writing the chart")
        write_chart(made, folder.hidden, options.figures, options.report)
    return folder.path, made


def chart_case(case: BuiltCase, options: Options, effort: Effort, request: Request) -> Chart:
    """Time against accuracy of every method on this case; nothing written.

    Raises CaseError where the case has no trajectory, or nothing that changes a frequency.
    """
    stages, progress = Stages(options.progress), options.progress
    with case.located():
        try:
            scene = prepare(case, stages, None)
        except AccuracyError:  # `auto` refuses, which the chart then says of the usual order
            if case.file.expansion.order != "auto":
                raise
            usual = type(case.file.expansion)().order
            scene = prepare(case, stages, None, order=int(usual))
        with stages("methods", "charting methods"):
            made = compare_methods(scene, effort, request, progress)
        with stages("mesh", "charting meshes"):
            poses = scene.path.q[scene.path.spread(5)]
            x = scene.model.x(poses, scene.initial)
            mesh = chart_meshes(case.settled, x, scene.expansions.modes, effort)
        with stages("designs", "charting ways to a design"):
            solve_s = min(p.online.median_s for p in made.points if p.family == "exact")
            designs, notes = chart_designs(scene, effort, solve_s, progress)
    notes = (*made.notes, *truncation_notes(scene), *notes)
    return replace(made, mesh=mesh, designs=designs, notes=notes, seconds=stages.total_s)
