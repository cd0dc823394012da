"""`eigassign chart`: one case from its file to the folder of its chart."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from eigassign._version import __version__
from eigassign.case import CaseFile
from eigassign.chart.designs import chart_designs
from eigassign.chart.effort import QUICK, Effort
from eigassign.chart.mesh import Mesh, mesh_axis
from eigassign.chart.results import Chart, DesignRun, MeshRow
from eigassign.chart.study import Compared, Wish, compare_methods, spread_rows
from eigassign.chart.timing import machine
from eigassign.errors import AccuracyError
from eigassign.modal.model import Model
from eigassign.output.chart_report import write_chart
from eigassign.pipeline.run import Options, prepare
from eigassign.pipeline.run_files import new_run_folder
from eigassign.pipeline.stages import Stages
from eigassign.study.accuracy import truncation_notes
from eigassign.study.built_case import Case, load_case
from eigassign.study.scene import Scene

POSES = 5  # of the trajectory, on which meshes are compared
_THOROUGH = Effort()


@dataclass(frozen=True)
class Charted:
    """A finished chart, and its folder if it was written."""

    folder: Path | None
    chart: Chart


def chart(
    path: str | Path, options: Options, quick: bool = False, wish: Wish | None = None
) -> Charted:
    """`chart_case`, and its folder: chart.json, report.html, figures, case.yaml."""
    case = load_case(path)
    with new_run_folder(case.file, options.out, options.force) as folder:
        made = chart_case(case, options, QUICK if quick else _THOROUGH, wish or Wish())
        options.progress("writing the chart")
        write_chart(made, folder.hidden, options.figures)
        (folder.hidden / "case.yaml").write_text(case.file.resolved(), encoding="utf-8")
    return Charted(folder.path, made)


def chart_case(case: Case, options: Options, effort: Effort, wish: Wish) -> Chart:
    """Time against accuracy of every method on this case; nothing written.

    Raises CaseError where the case has no trajectory, or nothing that changes a frequency.
    """
    stages = Stages(options.progress)
    with case.located():
        scene = _prepared(case, stages)
        _ = scene.path
        with stages("methods", "charting methods"):
            compared = compare_methods(scene, effort, wish, options.progress)
        with stages("mesh", "charting meshes"):
            mesh = _mesh(case, scene, effort)
        with stages("designs", "charting ways to a design"):
            solve_s = min(p.online.median_s for p in compared.points if p.family == "exact")
            designs, remarks = chart_designs(scene, effort, solve_s, options.progress)
    return _chart(scene, effort, compared, mesh, designs, remarks, stages.total_s)


def _prepared(case: Case, stages: Stages) -> Scene:
    """The scene; of the usual order where ``auto`` refuses, which the chart then says."""
    try:
        return prepare(case, stages, None)
    except AccuracyError:
        if case.file.expansion.order != "auto":
            raise
        return prepare(case, stages, None, order=int(type(case.file.expansion)().order))


def _chart(
    scene: Scene,
    effort: Effort,
    compared: Compared,
    mesh: tuple[MeshRow, ...],
    designs: tuple[DesignRun, ...],
    remarks: Sequence[str],
    seconds: float,
) -> Chart:
    file = scene.file
    return Chart(
        title=file.title,
        case_name=file.path.stem,
        case_sha256=file.sha256,
        reference=file.reference,
        version=__version__,
        quick=effort.brief,
        machine=machine(),
        asked=compared.asked,
        points=compared.points,
        skipped=compared.skipped,
        fronts=compared.fronts,
        advice=compared.advice,
        mesh=mesh,
        designs=designs,
        notes=(
            *(a.words for a in compared.advice),
            *compared.notes,
            *truncation_notes(scene),
            *remarks,
            *_unanswered(compared.skipped),
        ),
        warnings=scene.warnings,
        seconds=seconds,
    )


def _unanswered(skipped: Sequence[tuple[str, str]]) -> Iterator[str]:
    """Each reason once, with the methods (name, reason) that it kept from an answer."""
    methods: dict[str, list[str]] = {}
    for name, why in skipped:
        methods.setdefault(why, []).append(name)
    for why, names in methods.items():
        verb = "has" if len(names) == 1 else "have"
        yield f"{', '.join(names)} {verb} no answer: {why}"


def _mesh(case: Case, scene: Scene, effort: Effort) -> tuple[MeshRow, ...]:
    """Meshes at a few poses of the trajectory, with the initial design."""
    rows = spread_rows(len(scene.path.q), POSES)
    x = scene.model.x(scene.path.q[rows], scene.initial)
    meshes = list(_meshes(case, effort.factors))
    return mesh_axis(
        meshes, np.asarray(x), scene.expansions.modes, effort.most_dof, effort.patience
    )


def _meshes(case: Case, factors: Sequence[float]) -> Iterator[Mesh]:
    """The case with so many times the elements; a link keeps at least one."""
    seen: set[tuple[int, ...]] = set()
    settled = case.settled  # or every mesh would choose its own elements and reduction anew
    for factor in sorted(factors):
        file, counts = refined(settled, factor)
        if counts and counts not in seen:
            seen.add(counts)
            yield Mesh(factor, sum(counts), partial(_model, file))


def _model(file: CaseFile) -> Model:
    return Case(file).model()


def refined(file: CaseFile, factor: float) -> tuple[CaseFile, tuple[int, ...]]:
    """The same case with ``factor`` times the elements in every beam, and their numbers.

    Every number of elements must be given or settled (`Case.settled`).
    """
    counts: list[int] = []

    def scaled(part: Any) -> Any:
        if hasattr(part, "elements"):
            counts.append(max(1, round(part.elements * factor)))
            return part.model_copy(update={"elements": counts[-1]})
        if hasattr(part, "beams"):
            beams = {name: scaled(beam) for name, beam in part.beams.items()}
            return part.model_copy(update={"beams": beams})
        return part

    links = {name: scaled(link) for name, link in file.mechanism.links.items()}
    mechanism = file.mechanism.model_copy(update={"links": links})
    return replace(file, mechanism=mechanism), tuple(counts)
