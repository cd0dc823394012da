"""All files of a batch in one pass over its rows, so that memory does not grow with them."""

from __future__ import annotations

import hashlib
import json
from collections import Counter
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TextIO

from eigassign._version import __version__
from eigassign.files import MATRIX, file_digest
from eigassign.output.batch.columns import Columns
from eigassign.output.batch.index import Index
from eigassign.output.batch.junit import Junit
from eigassign.output.batch.outcome import CaseOutcome, from_line
from eigassign.output.batch.summary import FORMAT
from eigassign.output.store.atomic import replace_synced, replacing

_ALWAYS = ("summary.csv", "summary.json", "junit.xml", "index.html")
_COLUMNS = ("columns.h5", "columns.csv")  # the latter of versions up to 0.3.0
NAMES = (*_ALWAYS, *_COLUMNS)


def digest(folder: Path, rows: str) -> str:
    """SHA-256 of what the files in ``folder`` say and of the rows that they are of.

    Of files that are larger than a gigabyte their sizes count.
    """
    paths = [folder / name for name in NAMES]
    files = [(path.is_file() and path.stat().st_size, file_digest(path, MATRIX)) for path in paths]
    return hashlib.sha256(f"{rows}{files}".encode()).hexdigest()


def write_files(
    folder: Path,
    lines: Iterable[str],
    total: int,
    keys: Sequence[str] = (),
    columns: bool = False,
) -> None:
    """Write what is made of the ``total`` rows of a batch, each file whole or not at all.

    ``lines`` are the rows as `to_line` writes them, ``keys`` those of the sweep; with ``columns``
    there is columns.h5 too, and else none that is left from before.
    """
    with ExitStack() as stack:
        plain, ends = _opened(stack, folder / "summary.json"), Counter[str]()
        plain.write(f'{{"format": {FORMAT}, "version": {json.dumps(__version__)}, "cases": [\n')
        junit, index = Junit(_opened(stack, folder / "junit.xml")), Index()
        stored = stack.enter_context(replacing(folder / "columns.h5")) if columns else None
        columnar = Columns(stored, total)
        for line in map(str.rstrip, lines):
            row = from_line(line, folder)
            plain.write(f"{', ' if ends else '  '}{line}\n")
            ends[row.status] += 1
            _test(junit, row)
            index.add(row, line)
            columnar.add(row)
        plain.write(f'], "counts": {json.dumps(dict(sorted(ends.items())))}}}\n')
        junit.end()
        columnar.end(_opened(stack, folder / "summary.csv"))
    for name in _COLUMNS[columns:]:  # of the batch as it was before
        (folder / name).unlink(missing_ok=True)
    replace_synced(folder / "index.html", index.page(folder, folder.resolve().name, keys))


def write_moves(folder: Path, rows: Iterable[tuple[CaseOutcome, Sequence[str]]]) -> None:
    """junit.xml in which what has moved of a row is a failure too."""
    with ExitStack() as stack:
        junit = Junit(_opened(stack, folder / "junit.xml"))
        for row, moves in rows:
            _test(junit, row, moves)
        junit.end()


def _test(junit: Junit, row: CaseOutcome, moves: Sequence[str] = ()) -> None:
    output = f"run folder: {row.run_folder}" if row.run_folder else ""
    status = "moved" if moves and row.status == "ok" else row.status
    message = "\n".join(filter(None, (row.message, *moves)))
    junit.add(row.name, row.path, row.seconds, status, message, output)


def _opened(stack: ExitStack, path: Path) -> TextIO:
    """A file that takes the place of ``path`` when the stack is left without an error."""
    made = stack.enter_context(replacing(path))
    return stack.enter_context(open(made, "w", encoding="utf-8", newline=""))
