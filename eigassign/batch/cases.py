"""The life of a case of a batch, and who knows what of it.

    to do → in flight → done
                      → an error, which is to do for the next command

A case is done where its own record says so: `outcome.json` in its folder tells how it ended, and
run.json vouches for that and for every other file of the folder by its hash. The record is that of
the case as it is now if it has its key: what the file says, its values, the version. A case without
a folder, since it has no answer or the batch has columns, has its line of manifest.jsonl for a
record, which ends with a hash of itself.

manifest.jsonl is the index of these records: the summaries are made of it. So it is compared with
the records when a batch takes up a folder (`take_up`), and may be cut, edited or deleted before:
what it lacks is added to it, what it says against a record is withdrawn.

There are no other states, and none of these comes from a clock. One batch at a time is at work in a
folder (`alone_in`).
"""

from __future__ import annotations

import contextlib
import itertools
import os
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from eigassign.batch.manifest import (
    LINES,
    Header,
    InOrder,
    Line,
    Manifest,
    line_of,
    read_header,
    write_header,
)
from eigassign.batch.plan import BatchPlan, Variant
from eigassign.batch.work import CaseOptions, outcome_of
from eigassign.errors import StorageError
from eigassign.files import CASE, read_bytes
from eigassign.output.batch.files import digest, write_files
from eigassign.output.batch.outcome import OUTCOME, CaseOutcome, from_line, to_line
from eigassign.output.store.atomic import lock, replace_synced
from eigassign.output.store.run_record import is_whole, read_record, relative_path

GONE = -1  # index of an outcome of a case that the plan has no more
REPORT = "report.html"


@dataclass(frozen=True)
class Batch:
    """A plan, the folder of its results, and how each case is run."""

    plan: BatchPlan
    folder: Path
    options: CaseOptions

    @cached_property
    def header(self) -> Header:
        """The content of batch.json."""
        folder = Path(os.path.realpath(self.folder))
        files = tuple(relative_path(Path(f.path), folder) for f in self.plan.files)
        keys = tuple(dict.fromkeys(key for f in self.plan.files for key in f.variants.keys))
        plan, count = self.plan.digest, len(self.plan)
        return Header(plan, count, files, keys, self.options.columns)

    def is_done(self, found: Line | CaseOutcome) -> bool:
        """True where a case that ended so is not to be tried again.

        Errors are, and what is done without the report that it shall have.
        """
        if found.status == "error":
            return False
        if not (self.options.redraw and self.options.draws(found.status) and found.run_folder):
            return True
        return (self.folder / found.run_folder / REPORT).exists()


# --- Records and the index


def recorded(place: Path) -> CaseOutcome | None:
    """The outcome of the case of this folder; None where its record or a file of it is damaged."""
    record = read_record(place)
    if record is None or OUTCOME not in record.files or not is_whole(place, record):
        return None
    try:
        return from_line(read_bytes(place / OUTCOME, CASE))
    except (OSError, StorageError):
        return None


def _differences(batch: Batch, rows: Mapping[int, CaseOutcome]) -> Iterator[CaseOutcome]:
    """Yield how a case ended where the index, ``rows``, does not say what its record does.

    What the index says without a record, and what has a damaged one, is an error.
    """
    folder = batch.folder
    there = set(os.listdir(folder)) if folder.is_dir() else set()
    for index in batch.header.indices() if there else ():
        row = rows.get(index)
        case = batch.plan[index] if row is None else row
        listed = row.run_folder if row is not None else None
        for name in filter(None, dict.fromkeys((listed, case.name))):
            found = recorded(folder / name) if name in there or name == listed else None
            if found is not None and found.key == case.key:
                now = replace(found, index=index, name=case.name, path=case.path, run_folder=name)
                break
        else:
            place = folder / case.name
            is_of_a_case = os.path.lexists(place / OUTCOME)
            if listed is None and not (is_of_a_case and recorded(place) is None):
                continue
            now = outcome_of(case, "error", message="its files were changed or lost since its run")
        if now != row:
            yield now


# --- Taking up a folder


@contextlib.contextmanager
def alone_in(folder: Path) -> Iterator[None]:
    """Hold the lock of a batch's folder, which the system lets go of when its holder dies.

    Raises StorageError where another batch is at work there.
    """
    with lock(folder) as held:
        if held is False:
            raise StorageError(
                f"another batch is running in {folder}: wait for it, or use another --out"
            )
        yield


def take_up(batch: Batch) -> None:
    """Make the folder one of this batch, whose index says what the records of its cases do.

    Outcomes of cases that the plan has no more are kept: it may have them again. So are damaged
    folders of cases, under another name. Raises StorageError where the folder holds another batch,
    which ``force`` moves aside.
    """
    before = read_header(batch.folder)
    if before != batch.header:
        _adopt(batch, before)
    if batch.header.columns:
        return
    manifest = Manifest(batch.folder, batch.header.plan)
    rows = {line.index: line.outcome for line in manifest.news()}
    for row in _differences(batch, rows):
        place = batch.folder / row.name
        found = recorded(place) if row.status == "error" and os.path.lexists(place) else row
        if found is None or found.name != row.name:  # else it is whole, and may be replaced
            aside = _free(batch.folder, row.name)
            os.rename(place, aside)
            row = replace(row, message=f"{row.message}; they are kept as {aside.name}")
        manifest.append(row)


def _free(folder: Path, name: str) -> Path:
    """The first of ``name.1``, ``name.2`` … that is not there."""
    names = (folder / f"{name}.{k}" for k in itertools.count(1))
    return next(path for path in names if not os.path.lexists(path))


def _adopt(batch: Batch, before: Header | None) -> None:
    """Write the index of this batch in place of that of the one ``before``."""
    folder, header = batch.folder, batch.header
    kept, others = _current(batch, before)
    foreign = before is not None and not kept and not set(before.files) & set(header.files)
    if before is not None and foreign:
        if not batch.options.force:
            raise StorageError(
                f"{folder} holds another batch (of {', '.join(before.files[:3])}), which is left "
                "alone. Choose another folder with --out, or use --force to move its list aside"
            )
        with contextlib.suppress(FileNotFoundError):
            os.rename(folder / LINES, _free(folder, LINES))
        others = []
    rows = [*(replace(found, index=GONE) for found in others), *kept]
    lines = "".join(line_of(to_line(found), header.plan) for found in rows)
    replace_synced(folder / LINES, lines.encode())
    write_header(folder, header)


def _current(batch: Batch, before: Header | None) -> tuple[list[CaseOutcome], list[CaseOutcome]]:
    """The outcomes in the index that are those of cases of the plan as they are now.

    And those of cases that are not in the plan.
    """
    plan = batch.header.plan  # of the index already, if this was killed before it was done
    plans = dict.fromkeys((plan, plan if before is None else before.plan))
    lines = (line for each in plans for line in Manifest(batch.folder, each).news())
    known, kept = {found.name: found for found in (line.outcome for line in lines)}, []
    for index in batch.header.indices() if known else ():
        variant = batch.plan[index]
        found = known.pop(variant.name, None)
        if found is not None and found.key == variant.key:
            kept.append(replace(found, index=index, path=variant.path))
    return kept, [*known.values()]


def seconds_of_done(batch: Batch) -> dict[int, float]:
    """Seconds that each case took, by index, which is done; nothing is locked or changed."""
    before, rows = read_header(batch.folder), list[CaseOutcome]()
    lines = Manifest(batch.folder, batch.header.plan).news()
    found: Iterable[CaseOutcome] = (line.outcome for line in lines)
    if before != batch.header:
        found = _current(batch, before)[0]
    if not batch.header.columns:
        rows = [*found]
        found = itertools.chain(rows, _differences(batch, {row.index: row for row in rows}))
    seconds = {row.index: row.seconds if batch.is_done(row) else None for row in found}
    wanted = batch.header.indices()
    return {k: spent for k, spent in seconds.items() if spent is not None and k in wanted}


class Progress:
    """Which cases of a batch are done.

    ``ends`` counts how they ended. A case that ended in an error before is not done.
    """

    def __init__(self, batch: Batch) -> None:
        self._plan, self._indices = batch.plan, batch.header.indices()
        self._ends = [""] * len(self._indices)
        self._manifest = Manifest(batch.folder, batch.header.plan)
        self.ends: Counter[str] = Counter()
        for line in self._manifest.news():
            self._note(line.index, line.status if batch.is_done(line) else "")

    @property
    def total(self) -> int:
        """Number of cases."""
        return len(self._indices)

    @property
    def done(self) -> int:
        """Number of cases that are done."""
        return self.ends.total()

    def tasks(self, size: Callable[[], int]) -> Iterator[Sequence[Variant]]:
        """Yield what is not done, ``size()`` cases at a time."""
        task: list[Variant] = []
        for index in self._indices:
            if self._ends[index]:
                continue
            task.append(self._plan[index])
            if len(task) >= size():
                yield task
                task = []
        if task:
            yield task

    def keep(self, found: CaseOutcome) -> None:
        """Write down how a case ended."""
        self._manifest.append(found)
        self._note(found.index, found.status)

    def sync(self) -> None:
        """Wait until all that was written down is on disk."""
        self._manifest.sync()

    def _note(self, index: int, status: str) -> None:
        """Take note of how a case ended; of "" that it is to do."""
        if index in self._indices:
            if before := self._ends[index]:
                self.ends[before] -= 1
            if status:
                self.ends[status] += 1
            self._ends[index] = status


# --- Summaries


def summarise(folder: Path, header: Header) -> InOrder:
    """Make the summaries from the rows of the index, in the order of the plan; the rows.

    Those that were made from the same rows, and are as they were made, stay; batch.json has a hash
    of both.
    """
    rows = InOrder(folder, header)
    before = read_header(folder)
    if before is not None and before.summarised == digest(folder, rows.digest):
        return rows
    try:
        write_files(folder, rows, len(rows), header.keys, header.columns)
        write_header(folder, replace(header, summarised=digest(folder, rows.digest)))
    except OSError as error:
        raise StorageError(
            f"{folder}: the summaries cannot be written: {error.strerror}; "
            "the same command writes them again"
        ) from error
    return rows
