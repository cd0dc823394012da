"""summary.csv and summary.json, written row by row, and the same on the console."""

from __future__ import annotations

import csv
import json
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, TextIO

from eigassign._version import __version__
from eigassign.facts import Fact
from eigassign.files import printable
from eigassign.output.batch.outcome import CaseOutcome
from eigassign.output.tables import Table, facts_table

FORMAT = 1  # of summary.json
COLUMNS = (
    "name", "status", "verdict", "seconds", "initial_max_relative", "predicted_max_relative",
    "exact_max_relative", "design", "message", "path", "run_folder",
)  # fmt: skip
_FORMULA = ("=", "+", "-", "@", "\t", "\r")  # spreadsheets run a cell that starts so


@dataclass(frozen=True)
class SummaryDocument:
    """The cases in their order, and how many ended how."""

    format: int
    version: Annotated[str, Fact("of eigassign")]
    cases: Sequence[CaseOutcome]
    counts: Annotated[Mapping[str, int], Fact("by status")]


def batch_table(outcomes: Sequence[CaseOutcome]) -> Table:
    """One line a case: name, status, seconds, worst exact error if there is one, message."""
    return facts_table("Batch", outcomes, "name status seconds exact_max_relative message")


def said(counts: Counter[str]) -> str:
    """``58 ok, 2 error``."""
    order = ("ok", "tolerance", "failed", "error")
    return ", ".join(f"{counts[status]} {status}" for status in order if counts[status])


class SummaryCsv:
    """One line a case, numbers as ``repr`` writes them; a column for every swept key too."""

    def __init__(self, file: TextIO, keys: Sequence[str] = ()) -> None:
        self._writer, self._keys = csv.writer(file, lineterminator="\n"), tuple(keys)
        self._writer.writerow((COLUMNS[0], *map(cell, self._keys), *COLUMNS[1:]))

    def add(self, row: CaseOutcome) -> None:
        """Write one line."""
        design = "; ".join([f"{name}={amount!r}" for name, amount in row.design])
        values = {**vars(row), "design": design}
        first, *others = (cell(values[name]) for name in COLUMNS)
        swept = (cell(row.values.get(key)) for key in self._keys)
        self._writer.writerow((first, *swept, *others))  # floats as repr writes them, None as ""


def cell(value: object) -> object:
    """The value as a cell that stays on its line, and that no spreadsheet takes for a formula."""
    if value is None or isinstance(value, (bool, int, float)):
        return value
    text = value if isinstance(value, str) else json.dumps(value)
    if not text.isprintable():
        text = printable(" ".join(text.split("\n")))
    return "'" + text if text.startswith(_FORMULA) else text


class SummaryJson:
    """The rows as the manifest has them, then how many there are of each status."""

    def __init__(self, file: TextIO) -> None:
        self._file, self._counts = file, Counter[str]()
        file.write(f'{{"format": {FORMAT}, "version": {json.dumps(__version__)}, "cases": [\n')

    def add(self, status: str, line: str) -> None:
        """Write the line of a row."""
        self._file.write(f"{', ' if self._counts else '  '}{line}\n")
        self._counts[status] += 1

    def end(self) -> None:
        """Write the counts."""
        self._file.write(f'], "counts": {json.dumps(dict(sorted(self._counts.items())))}}}\n')
