"""All files of a batch beside the folders of its cases, each written whole or not at all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from eigassign.output.batch.index import index_page
from eigassign.output.batch.outcome import CaseOutcome
from eigassign.output.batch.summary import Test, summary_csv, summary_json, write_junit
from eigassign.output.store.atomic import replace_synced

NAMES = ("summary.csv", "summary.json", "junit.xml", "index.html")


def write_files(folder: Path, rows: Sequence[CaseOutcome], keys: Sequence[str] = ()) -> None:
    """Write what is made of the rows of a batch; ``keys`` are those of its sweep.

    Raises OSError.
    """
    replace_synced(folder / "summary.csv", summary_csv(rows).encode())
    replace_synced(folder / "summary.json", summary_json(rows).encode())
    replace_synced(folder / "index.html", index_page(rows, folder, keys))
    write_tests(folder, rows, {})


def write_tests(
    folder: Path, rows: Sequence[CaseOutcome], moves: Mapping[str, Sequence[str]]
) -> None:
    """junit.xml, in which what has moved of a case, by its name, is a failure too."""
    write_junit(folder / "junit.xml", (_test(row, moves.get(row.name, ())) for row in rows))


def _test(row: CaseOutcome, moves: Sequence[str]) -> Test:
    output = f"run folder: {row.run_folder}" if row.run_folder else ""
    status = "moved" if moves and row.status == "ok" else row.status
    message = "\n".join(filter(None, (row.message, *moves)))
    return row.name, row.path, row.seconds, status, message, output
