"""Error against time and against the size of the box, of every method: the paper's arm.

What `eigassign chart` writes goes to ``results/chart_<case>/``; its tables are there as Markdown.
That one is made as with ``--quick``; with names of `CASES`, these are charted with all sizes, which
takes a minute or two for the arms.
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

from eigassign import load_case
from eigassign.chart import QUICK, Effort
from eigassign.output import Table, chart_tables, write_chart
from eigassign.pipeline import Options, chart_case

CASES = {
    "two_link": lambda: (common.CASES / "two_link.yaml").read_text(encoding="utf-8"),
    "arm_6r": chart_cases.six,
    "large": chart_cases.large,
}


def main(names: list[str]) -> None:
    effort = Effort() if names else QUICK
    for name in names or ["two_link"]:
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / f"{name}.yaml"
            path.write_text(CASES[name](), encoding="utf-8")
            options = Options(use_cache=False, progress=lambda line: print(line, file=sys.stderr))
            chart = chart_case(load_case(path), options, effort)
        machine = common.machine()  # before the results of an earlier run are changed
        target = common.RESULTS / f"chart_{name}"
        shutil.rmtree(target, ignore_errors=True)
        target.mkdir(parents=True)
        write_chart(replace(chart, warnings=()), target, kind="none")
        tables = [table for table in chart_tables(chart) if table.title != "All boxes"]  # long
        parts = [f"# {chart.title}", *map(_markdown, tables)]
        parts.append("\n".join(f"- {note}" for note in (*chart.notes, machine)))
        text = "\n\n".join(parts) + "\n"
        (target / "README.md").write_text(text, encoding="utf-8")


def _markdown(table: Table) -> str:
    rows = [table.columns, tuple("---" for _ in table.columns), *table.rows]
    lines = ["| " + " | ".join(cell.replace("|", "/") for cell in row) + " |" for row in rows]
    caption = [table.caption, ""] if table.caption else []
    return "\n".join([f"## {table.title}", "", *caption, *lines])


if __name__ == "__main__":
    main(sys.argv[1:])
