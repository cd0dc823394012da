"""The charts of the paper's arm, a spatial arm of six joints, scenes of 10⁴ and 5 · 10⁴ dof.

What `eigassign chart` writes goes to ``results/chart_<case>/``; here are its fronts and advice as
Markdown. Then the figures of fronts and the table of who holds the fronts are made anew.
The last two are charted with less of everything, since exact solves take long there: what is left
out is said in their notes.
"""

from __future__ import annotations

import common  # first: settles the threads

# isort: split
import shutil
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import chart_cases
import fronts

from eigassign.api import load_case
from eigassign.chart.comparison import Request
from eigassign.chart.effort import QUICK, Effort
from eigassign.output.reports.chart import tables, write_chart
from eigassign.output.tables import Table
from eigassign.pipeline import chart as charting
from eigassign.pipeline.run import Options

WHOLE = Effort()
LARGE = replace(
    QUICK,
    quick=False,
    orders=(1, 2, 3, 4, 6, 8),
    half_orders=(1, 2, 3),
    expansion_points=(1,),
    accuracies=WHOLE.accuracies,
    reference_s=20.0,
    training_s=30.0,
    searched_s=60.0,
    objectives=100,
)
CASES = {
    "two_link": (chart_cases.paper, WHOLE),
    "arm_6r": (chart_cases.six, WHOLE),
    "large": (chart_cases.large, LARGE),
    "larger": (chart_cases.larger, LARGE),
}


def main(names: list[str]) -> None:
    for name in names or list(CASES):
        text, effort = CASES[name]
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"{name}.yaml"
            path.write_text(text(), encoding="utf-8")
            chart = charting.chart_case(
                load_case(path), Options(use_cache=False, progress=_say), effort, Request()
            )
        chart = replace(chart, warnings=())
        target = common.RESULTS / f"chart_{name}"
        shutil.rmtree(target, ignore_errors=True)
        target.mkdir(parents=True)
        write_chart(chart, target)
        (target / "report.html").unlink()  # the same figures again, in base64
        parts = [f"# {chart.title}", *(_markdown(table) for table in tables(chart))]
        parts += ["\n".join(f"- {note}" for note in chart.notes)]
        (target / "README.md").write_text("\n\n".join(parts) + "\n", encoding="utf-8")
    fronts.write_figures()
    print(fronts.write_shares())


def _say(line: str) -> None:
    print(line, file=sys.stderr)


def _markdown(table: Table) -> str:
    rows = [table.columns, tuple("---" for _ in table.columns), *table.rows]
    lines = ["| " + " | ".join(cell.replace("|", "/") for cell in row) + " |" for row in rows]
    caption = [table.caption, ""] if table.caption else []
    return "\n".join([f"## {table.title}", "", *caption, *lines])


if __name__ == "__main__":
    main(sys.argv[1:])
