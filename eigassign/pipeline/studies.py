"""Measured frequencies to the parameters that explain them; time against accuracy of methods."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from eigassign.brief import cut
from eigassign.files import UPDATED
from eigassign.output.figures.graph import FigurePlan
from eigassign.output.reports.notebook import Pictured, html
from eigassign.output.reports.update import update_figures, update_tables, write_update
from eigassign.pipeline.run import DEFAULT, Options
from eigassign.pipeline.stages import Stages, new_run_folder
from eigassign.study.built_case import BuiltCase, load_case
from eigassign.study.updating.fit import (
    UpdateResults,
    collect_update,
    solve_update,
    update_problem,
)
from eigassign.study.updating.updated import updated_case


@dataclass(frozen=True, repr=False)
class Updated(Pictured):
    """A finished update: what it found, the case with the values found, and its folder if any."""

    results: UpdateResults
    case: BuiltCase
    folder: Path | None = None

    def __repr__(self) -> str:
        return cut(f"<Updated: {self.results.headline}>")

    def _repr_html_(self) -> str:
        return html([self.results.headline], update_tables(self.results), self.plan())

    def plans(self) -> dict[str, FigurePlan]:
        """The figures of the report: measurements, parameters."""
        return {plan.name: plan for plan in update_figures(self.results)}

    @property
    def design(self) -> dict[str, float]:
        """The updated parameters by name, SI."""
        return self.results.design

    @property
    def intervals(self) -> dict[str, tuple[float, float]]:
        """Their 95 % intervals, SI."""
        return self.results.intervals


def update(path: str | Path, options: Options) -> Updated:
    """`update_case`, and its folder: results.json, report.html, figures, case and updated case.

    Raises StorageError before anything is computed where the folder may not be replaced.
    """
    case = load_case(path, options.allow_outside)
    with new_run_folder(case.file, options.out, options.force, "_update") as folder:
        found = update_case(case, options)
        options.progress("writing the report")
        write_update(found.results, folder.hidden, options.figures, options.report)
        updated = found.case.file.resolved()
        (folder.hidden / UPDATED).write_text(updated, encoding="utf-8")
    return replace(found, folder=folder.path)


def update_case(case: BuiltCase, options: Options = DEFAULT) -> Updated:
    """The parameters that explain the measurements, and the case with them; nothing written.

    Raises CaseError for what the case lacks and for wrong measurements.
    """
    stages = Stages(options.progress)
    with stages("model", "assembling K and M"):
        case.model()
    with stages("measurements", "reading the measurements"):
        problem = update_problem(case)
    with case.located():
        with stages("fit", "fitting the parameters, and their intervals"):
            found = solve_update(problem)
        with stages("checks", "checking mesh and neighbouring modes"):
            results = collect_update(problem, found, stages.timing_s)
    return Updated(results, updated_case(case, results))
