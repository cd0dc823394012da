"""summary.csv, and the same on the console."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path

from eigassign.files import printable
from eigassign.output.batch.outcome import CaseOutcome
from eigassign.output.formats import percent
from eigassign.output.storage import replace_synced
from eigassign.output.tables import Table

COLUMNS = (
    "name", "status", "seconds", "initial_max_relative", "predicted_max_relative",
    "exact_max_relative", "design", "message", "path", "run_folder",
)  # fmt: skip
_FORMULA = ("=", "+", "-", "@", "\t", "\r")  # spreadsheets run a cell that starts so


def batch_table(outcomes: Sequence[CaseOutcome]) -> Table:
    """One line a case: name, status, seconds, worst exact error if there is one, message."""
    rows = []
    for one in outcomes:
        worst = "" if one.exact_max_relative is None else percent(one.exact_max_relative)
        rows.append((one.name, one.status, f"{one.seconds:.2f} s", worst, one.message))
    return Table("Batch", ("case", "status", "time", "worst error", "message"), tuple(rows))


def write_summary(path: Path, outcomes: Sequence[CaseOutcome]) -> None:
    """summary.csv: one line a case, numbers as ``repr`` writes them."""
    replace_synced(path, summary_csv(outcomes).encode())


def summary_csv(outcomes: Sequence[CaseOutcome]) -> str:
    """The text of summary.csv."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    for outcome in outcomes:
        writer.writerow([_cell(outcome, column) for column in COLUMNS])
    return text.getvalue()


def _cell(outcome: CaseOutcome, column: str) -> str:
    value = getattr(outcome, column)
    if column == "design":
        value = "; ".join(f"{name}={amount!r}" for name, amount in outcome.design)
    if value is None:
        return ""
    if isinstance(value, float):
        return repr(value)
    text = printable(" ".join(str(value).split("\n")))
    return "'" + text if text.startswith(_FORMULA) else text
