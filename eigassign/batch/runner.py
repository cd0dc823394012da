"""A batch: every case of a plan once, whoever is killed meanwhile.

    plan → what is not done yet → check of variants → a task for each case → summaries of all

Where tasks run is `workers.Workers`; each is `work.run_case`. Workers write the folders of their
cases, this process writes the summaries.

The folder of a case is its record: run.json in it holds the key of the case, how it ended, and one
hash of that and of all other files. A case is done where its folder is whole and has the key that
the case has now: what its file says, its values, the version. So nothing is lost or done twice,
whoever is killed, and what was cut, edited or deleted is done again. A case that ended in an error
leaves no record.
"""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path

from eigassign.batch.plan import BatchPlan, Variant
from eigassign.batch.work import CaseOptions, faults_of, outcome_of, run_case
from eigassign.batch.workers import Workers, run_all
from eigassign.errors import CaseError, Problem, StorageError
from eigassign.output.batch.index import write_files
from eigassign.output.batch.summary import CaseOutcome, from_plain
from eigassign.output.store.atomic import lock
from eigassign.output.store.run_folder import MARKER, is_whole, read_record, settle_killed
from eigassign.pipeline.stages import Stages, silent

_SHOWN = 10  # problems of variants
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


def run(
    batch: Batch,
    workers: Workers,
    on_start: Callable[[int, int], None],
    on_outcome: Callable[[CaseOutcome], None],
    say: Callable[[str], None] = silent,
) -> list[CaseOutcome]:
    """Run what is not done yet, and write the summaries; the rows of all cases.

    ``on_start`` hears how many cases there are and are done, ``on_outcome`` of each that is run.
    After an interrupt the summaries have what there is. Raises CaseError, before anything is
    written, where a variant is no valid case, and StorageError where another batch is at work in
    the folder or nothing can be written there.
    """
    folder = batch.folder
    if folder.exists() and not folder.is_dir():
        raise StorageError(f"{folder} is a file: choose a folder with --out")
    if (folder / MARKER).exists():
        raise StorageError(f"{folder} is the folder of a run: choose another one with --out")
    with contextlib.ExitStack() as held:
        if is_there := folder.is_dir():
            held.enter_context(alone_in(folder))
            settle_killed(folder)
        rows = done(batch)
        todo = require_valid(batch, rows, say)
        if not is_there:
            folder.mkdir(parents=True, exist_ok=True)
            held.enter_context(alone_in(folder))
        on_start(len(batch.plan), len(rows))
        stages = Stages(say)

        def keep(_variant: Variant, found: CaseOutcome) -> None:
            rows[found.index] = found
            on_outcome(found)
            stages.advance(sum(index in rows for index in todo), len(todo))

        def lose(variant: Variant) -> None:
            message = "the process that ran it was killed, perhaps because memory ran out"
            keep(variant, outcome_of(variant, "error", message=message))

        work, tasks = partial(run_case, options=batch.options), (batch.plan[k] for k in todo)
        try:
            with stages("cases", "optimizing"):
                stages.advance(0, len(todo) or 1)
                run_all(workers, tasks, work, keep, lose)
        finally:
            told = summarise(batch, rows)
    return told


def require_valid(batch: Batch, rows: Rows, say: Callable[[str], None] = silent) -> list[int]:
    """The cases that are not in ``rows``; raises CaseError where a variant is no valid case.

    A check takes 1 to 3 ms, a hundredth of a run at most: no processes are made for it.
    """
    plan, stages = batch.plan, Stages(say)
    todo = [index for index in range(len(plan)) if index not in rows]
    variants = [index for index in todo if plan.whose(index)[0].variants.keys]
    if not (total := len(variants)):
        return todo
    wrong, first = 0, list[Problem]()
    with stages("check", f"checking {total} variant{'s' if total > 1 else ''}"):
        for checked, index in enumerate(variants, 1):
            faults = faults_of(plan, index, batch.options)
            wrong, first = wrong + bool(faults), [*first, *faults][:_SHOWN]
            stages.advance(checked, total)
    if wrong:
        many = f"{wrong} of {total} variants are not valid: nothing was run"
        raise CaseError((*first, Problem(plan.files[0].path, 0, 0, "", many)))
    return todo
