"""What of a batch is done: the folder of a case is its record.

run.json in it holds the key of the case, how it ended, and one hash of that and of all other files.
A case is done where its folder is whole and has the key that the case has now: what its file says,
its values, the version. So nothing is lost or done twice, whoever is killed, and what was cut,
edited or deleted is done again. A case that ended in an error leaves no record.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from eigassign.batch.plan import BatchPlan, Variant
from eigassign.batch.work import CaseOptions
from eigassign.errors import StorageError
from eigassign.output.batch.index import write_files
from eigassign.output.batch.outcome import CaseOutcome, from_plain
from eigassign.output.store.atomic import lock
from eigassign.output.store.run_record import is_whole, read_record

Rows = dict[int, CaseOutcome]  # by index of the case


@dataclass(frozen=True)
class Batch:
    """A plan, the folder of its results, and how each case is run."""

    plan: BatchPlan
    folder: Path
    options: CaseOptions

    @cached_property
    def keys(self) -> tuple[str, ...]:
        """All that variants have values of."""
        return tuple(dict.fromkeys(key for f in self.plan.files for key in f.variants.keys))


def done(batch: Batch) -> Rows:
    """How each case ended that is not to be run again."""
    there = set(os.listdir(batch.folder)) if batch.folder.is_dir() else set()
    every = (batch.plan[index] for index in range(len(batch.plan) if there else 0))
    found = (_recorded(batch, variant) for variant in every if variant.name in there)
    return {row.index: row for row in found if row is not None}


def _recorded(batch: Batch, variant: Variant) -> CaseOutcome | None:
    """How the case ended by its folder; None where it is to run, for the report it lacks too."""
    place, options = batch.folder / variant.name, batch.options
    record = read_record(place)
    if record is None or record.run.key != variant.key or not is_whole(place, record):
        return None
    try:
        row = from_plain(record.outcome)
    except (ValueError, TypeError):
        return None
    drawn = row.run_folder and options.redraw and options.draws(row.status)
    if drawn and not (place / "report.html").exists():
        return None
    where = row.run_folder and variant.name
    return replace(row, index=variant.index, name=variant.name, path=variant.path, run_folder=where)


@contextlib.contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """Hold the lock of a batch's folder, which the system lets go of when its holder dies.

    Raises StorageError where another batch is at work there, or nothing can be written.
    """
    if not os.access(folder, os.W_OK | os.X_OK):
        raise StorageError(f"{folder} cannot be written to: choose another folder with --out")
    with lock(folder) as held:
        if held is False:
            raise StorageError(
                f"another batch is running in {folder}: wait for it, or use another --out"
            )
        yield


def summarise(batch: Batch, rows: Rows) -> list[CaseOutcome]:
    """Write the summaries of what there is; the rows in the order of the plan."""
    told = [rows[index] for index in sorted(rows)]
    try:
        write_files(batch.folder, told, batch.keys)
    except OSError as error:
        raise StorageError(
            f"{batch.folder}: the summaries cannot be written: {error.strerror}; "
            "the same command writes them again"
        ) from error
    return told
