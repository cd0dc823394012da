"""`eigassign chart`: one case from its file to the folder of its chart."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from eigassign._version import __version__
from eigassign.chart.comparison import Request, compare_methods, spread_rows
from eigassign.chart.designs import chart_designs
from eigassign.chart.effort import Effort
from eigassign.chart.mesh import chart_meshes, meshes
from eigassign.chart.results import Chart
from eigassign.chart.timing import machine
from eigassign.errors import AccuracyError
from eigassign.output.reports.chart import write_chart
from eigassign.pipeline.run import Options, prepare
from eigassign.pipeline.run_files import new_run_folder
from eigassign.pipeline.stages import Stages
from eigassign.study.accuracy import truncation_notes
from eigassign.study.built_case import Case, load_case
from eigassign.study.scene import Scene

POSES = 5  # of the trajectory, on which meshes are compared


@dataclass(frozen=True)
class Charted:
    """A finished chart, and its folder."""

    folder: Path
    chart: Chart


def chart(path: str | Path, options: Options, effort: Effort, request: Request) -> Charted:
    """`chart_case`, and its folder: chart.json, report.html, figures, case.yaml."""
    case = load_case(path, options.allow_outside)
    with new_run_folder(case.file, options.out, options.force) as folder:
        made = chart_case(case, options, effort, request)
        options.progress("writing the chart")
        write_chart(made, folder.hidden, options.figures, options.report)
        (folder.hidden / "case.yaml").write_text(case.file.resolved(), encoding="utf-8")
    return Charted(folder.path, made)


def chart_case(case: Case, options: Options, effort: Effort, request: Request) -> Chart:
    """Time against accuracy of every method on this case; nothing written.

    Raises CaseError where the case has no trajectory, or nothing that changes a frequency.
    """
    stages, progress = Stages(options.progress), options.progress
    with case.located():
        scene = _prepared(case, stages)
        modes, poses = scene.expansions.modes, scene.path.q
        with stages("methods", "charting methods"):
            compared = compare_methods(scene, effort, request, progress)
        with stages("mesh", "charting meshes"):
            x = scene.model.x(poses[spread_rows(len(poses), POSES)], scene.initial)
            listed = list(meshes(case.settled, effort.factors))
            mesh = chart_meshes(listed, x, modes, effort.most_dof, effort.patience)
        with stages("designs", "charting ways to a design"):
            solve_s = min(p.online.median_s for p in compared.points if p.family == "exact")
            designs, design_notes = chart_designs(scene, effort, solve_s, progress)
    return Chart(
        title=case.file.title,
        case_name=case.file.path.stem,
        case_sha256=case.file.sha256,
        reference=case.file.reference,
        version=__version__,
        quick=effort.quick,
        machine=machine(),
        asked=compared.asked,
        points=compared.points,
        skipped=compared.skipped,
        fronts=compared.fronts,
        advice=compared.advice,
        mesh=mesh,
        designs=designs,
        notes=(
            *compared.notes,
            *truncation_notes(scene),
            *design_notes,
            *skipped_notes(compared.skipped),
        ),
        warnings=scene.warnings,
        seconds=stages.total_s,
    )


def _prepared(case: Case, stages: Stages) -> Scene:
    """The scene; of the usual order where ``auto`` refuses, which the chart then says."""
    try:
        return prepare(case, stages, None)
    except AccuracyError:
        if case.file.expansion.order != "auto":
            raise
        return prepare(case, stages, None, order=int(type(case.file.expansion)().order))


def skipped_notes(skipped: Sequence[tuple[str, str]]) -> Iterator[str]:
    """Each reason once, with the methods (name, reason) that it kept from an answer.

    Reasons that differ by the number in front count as one: ``"3 solves for …"``.
    """
    groups: dict[str, list[tuple[str, str]]] = {}
    for name, why in skipped:
        groups.setdefault(why.lstrip("0123456789"), []).append((name, why))
    for rest, group in groups.items():
        names, whys = [name for name, _ in group], {why for _, why in group}
        why = whys.pop() if len(whys) == 1 else f"that many{rest}"
        yield f"{', '.join(names)} {'has' if len(names) == 1 else 'have'} no answer: {why}"
