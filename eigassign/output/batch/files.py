"""All files of a batch in one pass over its rows, so that memory does not grow with them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TextIO

from eigassign.output.batch.columns import Columns, write_csv
from eigassign.output.batch.index import Index
from eigassign.output.batch.junit import Junit
from eigassign.output.batch.outcome import from_line
from eigassign.output.batch.summary import SummaryCsv, SummaryJson
from eigassign.output.storage import replace_synced, replacing

NAMES = ("summary.csv", "summary.json", "junit.xml", "index.html", "columns.h5", "columns.csv")


def write_files(
    folder: Path,
    lines: Iterable[str],
    total: int,
    keys: Sequence[str] = (),
    columns: bool = False,
) -> None:
    """Write what is made of the ``total`` rows of a batch, each file whole or not at all.

    ``lines`` are the rows as `to_line` writes them, ``keys`` those of the sweep; with ``columns``
    there are columns.h5 and columns.csv too.
    """
    with ExitStack() as stack:

        def opened(name: str) -> TextIO:
            made = stack.enter_context(replacing(folder / name))
            return stack.enter_context(open(made, "w", encoding="utf-8", newline=""))

        summary, plain = (
            SummaryCsv(opened("summary.csv"), keys),
            SummaryJson(opened("summary.json")),
        )
        junit, index = Junit(opened("junit.xml")), Index()
        stored = stack.enter_context(replacing(folder / "columns.h5")) if columns else None
        columnar = None if stored is None else Columns(stored, total)
        for line in lines:
            row = from_line(line)
            summary.add(row)
            plain.add(row, line)
            output = f"run folder: {row.run_folder}" if row.run_folder else ""
            junit.add(row.name, row.path, row.seconds, row.status, row.message, output)
            index.add(row)
            if columnar is not None:
                columnar.add(row)
        plain.end()
        junit.end()
        if stored is not None and columnar is not None:
            columnar.end()
            write_csv(stored, opened("columns.csv"))
    replace_synced(folder / "index.html", index.page(folder, folder.resolve().name, keys))
