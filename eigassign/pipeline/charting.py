"""Speed against accuracy of every method, on one case or side by side on several."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from eigassign.chart.comparison import compare_methods
from eigassign.chart.question import Effort
from eigassign.chart.results import ACCURACY, Chart, Matrix, advised, build_matrix
from eigassign.errors import EigassignError, UsageError
from eigassign.output.reports.chart import write_chart
from eigassign.output.store.run_folder import run_folder
from eigassign.pipeline.run import Options
from eigassign.pipeline.stages import Stages, new_run_folder
from eigassign.study.built_case import BuiltCase, load_case


def chart(
    path: str | Path, options: Options, effort: Effort, accuracy: float | None = None
) -> tuple[Path, Chart]:
    """`chart_case`, and its folder: chart.json, report.html, figures, case.yaml."""
    case = load_case(path, options.allow_outside)
    with new_run_folder(case.file, options.out, options.force, "_chart") as folder:
        made = chart_case(case, options, effort, accuracy)
        options.progress("writing the chart")
        write_chart(made, folder.hidden, options.figures, options.report)
    return folder.path, made


def chart_case(
    case: BuiltCase, options: Options, effort: Effort, accuracy: float | None = None
) -> Chart:
    """Speed against accuracy on this case, and what to write; nothing written.

    ``accuracy`` is what is wanted of a frequency: else what the case asks of its expansion, or 1 %.
    Raises CaseError for what cannot be modelled.
    """
    stages = Stages(options.progress)
    with case.located(), stages("methods", "charting methods"):
        asked = case.file.expansion
        given = asked.accuracy if "accuracy" in asked.model_fields_set else ACCURACY
        made = compare_methods(case, effort, accuracy or given, stages.tell)
    return replace(advised(made), seconds=stages.total_s)


def chart_cases(
    paths: Sequence[Path], options: Options, effort: Effort, accuracy: float | None = None
) -> tuple[Path, Matrix]:
    """Scenes × methods in one folder: matrix.json, report.html.

    A case that cannot be charted is told with the reason, and does not stop the others.
    """
    target, wanted = options.out or Path("results", "charts"), accuracy or ACCURACY
    stages, charts, refused = Stages(options.progress), dict[str, Chart](), dict[str, str]()
    common = Path(os.path.commonpath([path.absolute().parent for path in paths]))
    with run_folder(target, case_path=common, key="charts", force=options.force) as hidden:
        for k, path in enumerate(paths, 1):
            name = str(path) if path.stem in {*charts, *refused} else path.stem
            with stages(name, f"{name} ({k} of {len(paths)})"):
                try:
                    case = load_case(path, options.allow_outside)
                    with case.located():
                        charts[name] = advised(compare_methods(case, effort, wanted, stages.tell))
                except EigassignError as error:
                    refused[name] = str(error)
        if not charts:
            raise UsageError("none of the cases can be charted: " + next(iter(refused.values())))
        made = build_matrix(charts, refused, wanted, stages.total_s)
        write_chart(made, hidden, options.figures, options.report)
    return target, made
