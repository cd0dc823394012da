"""What of a batch is done: a folder is set up or taken up again, its cases are given out and kept.

A result is current where its key is that of the case now, and whole where its line is in the
manifest and its folder beside it; which folders there are is asked once, and in none is looked.
"""

from __future__ import annotations

import contextlib
import itertools
import os
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from eigassign.batch.lock import FolderLock
from eigassign.batch.manifest import LINES, Header, InOrder, Manifest, read_header, write_header
from eigassign.batch.plan import BatchPlan, Variant
from eigassign.batch.work import CaseOptions
from eigassign.errors import StorageError
from eigassign.files import quoted
from eigassign.output.batch.files import are_current, write_files
from eigassign.output.batch.outcome import CaseOutcome, to_line
from eigassign.output.store.atomic import replace_synced
from eigassign.output.store.run_record import relative_path

GONE = -1  # index of an outcome of a case that the plan has no more
REPORT = "report.html"


@dataclass(frozen=True)
class Batch:
    """A plan, the folder of its results, and how each case is run."""

    plan: BatchPlan
    folder: Path
    options: CaseOptions
    shard: tuple[int, int] = (1, 1)  # (i, n): the cases with index % n == i − 1

    @property
    def header(self) -> Header:
        """The content of batch.json."""
        folder = Path(os.path.realpath(self.folder))
        files = tuple(relative_path(Path(f.path), folder) for f in self.plan.files)
        keys = tuple(dict.fromkeys(key for f in self.plan.files for key in f.keys))
        plan, count = self.plan.digest, len(self.plan)
        return Header(plan, count, self.shard, files, keys, self.options.columns)


def set_up(batch: Batch) -> None:
    """Make the folder one of this batch; what it holds of the batch as it was before is kept.

    So are outcomes of cases that the plan has no more: it may have them again. Raises StorageError
    where the folder holds another batch, which ``force`` moves aside, or another shard of this one.
    """
    folder, header = batch.folder, batch.header
    before = read_header(folder)
    if before == header:
        return
    kept, others = _current(batch)
    foreign = before is not None and not kept and not set(before.files) & set(header.files)
    if before is not None and not batch.options.force:
        if before.plan == header.plan and any(found.index >= 0 for found in others):
            i, n = before.shard
            raise StorageError(
                f"{folder} holds shard {i}/{n} of this batch: give each shard a folder of its own "
                "with --out"
            )
        if foreign:
            raise StorageError(
                f"{folder} holds another batch (of {', '.join(before.files[:3])}); it was left "
                "alone. Choose another folder with --out, or use --force to move its list aside"
            )
    if foreign:
        names = (folder / f"{LINES}.{k}" for k in itertools.count(1))
        with contextlib.suppress(FileNotFoundError):
            os.rename(folder / LINES, next(name for name in names if not name.exists()))
        others = []
    rows = [*(replace(found, index=GONE) for found in others), *kept]
    replace_synced(folder / LINES, "".join(f"{to_line(found)}\n" for found in rows).encode())
    write_header(folder, header)


def _current(batch: Batch) -> tuple[list[CaseOutcome], list[CaseOutcome]]:
    """The outcomes in the folder that are those of cases of the plan as they are now.

    And those of cases that are not in the plan.
    """
    known, kept = {found.name: found for found in Manifest(batch.folder).news()}, []
    for index in batch.header.indices() if known else ():
        variant = batch.plan[index]
        found = known.pop(variant.name, None)
        if found is not None and found.key == variant.key:
            kept.append(replace(found, index=index, path=variant.path))
    return kept, [*known.values()]


def outcomes_in(batch: Batch) -> Iterator[CaseOutcome]:
    """The whole and current outcomes that the folder holds; nothing is locked or changed."""
    if read_header(batch.folder) == batch.header:
        return _whole(batch, Manifest(batch.folder).news())
    return _whole(batch, _current(batch)[0])


def _whole(batch: Batch, outcomes: Iterable[CaseOutcome]) -> Iterator[CaseOutcome]:
    """Yield those that are not to be tried again, as errors are, and have all they are to leave."""
    folders, indices = None, batch.header.indices()
    for found in outcomes:
        if folders is None:
            folders = set(os.listdir(batch.folder))
        if found.status != "error" and found.index in indices and _is_whole(batch, found, folders):
            yield found


def _is_whole(batch: Batch, found: CaseOutcome, folders: Collection[str]) -> bool:
    """True where it has its folder, of ``folders`` or in a shard, and the report it shall have."""
    options, name = batch.options, found.run_folder
    if options.columns or (found.status == "failed" and not name):
        return True  # without an answer there is no folder
    if name is None or not (name in folders or ("/" in name and (batch.folder / name).is_dir())):
        return False
    wanted = options.redraw and options.draws(found.status)
    return not wanted or (batch.folder / name / REPORT).exists()


class Progress:
    """Which cases of a batch are done, in this process or another one.

    ``ends`` counts how they ended. A case that ended in an error before is not done: it is tried
    again.
    """

    def __init__(self, batch: Batch, lock: FolderLock) -> None:
        self._plan, self._indices, self._lock = batch.plan, batch.header.indices(), lock
        self._ends = [""] * len(self._indices)
        self._manifest = Manifest(batch.folder, lock.line)
        self.ends: Counter[str] = Counter()
        for found in _whole(batch, self._manifest.news()):
            self._note(found)

    @property
    def total(self) -> int:
        """Number of cases."""
        return len(self._indices)

    @property
    def done(self) -> int:
        """Number of cases that are done."""
        return self.ends.total()

    def tasks(self, size: Callable[[], int]) -> Iterator[Sequence[Variant]]:
        """Yield what is neither done nor in flight elsewhere, ``size()`` cases at a time."""
        task: list[Variant] = []
        for k, index in enumerate(self._indices):
            if self._ends[k] or not self._lock.claim(index):
                continue
            self.refresh()
            if self._ends[k]:
                self._lock.release(index)
                continue
            task.append(self._plan[index])
            if len(task) >= size():
                yield task
                task = []
        if task:
            yield task

    def refresh(self) -> None:
        """Take note of what other processes have done."""
        for found in self._manifest.news():
            self._note(found)

    def keep(self, found: CaseOutcome) -> None:
        """Write down how a case ended, and let go of it."""
        self._manifest.append(found)
        self._note(found)
        self._lock.release(found.index)

    def _note(self, found: CaseOutcome) -> None:
        if found.index in self._indices:
            k = self._indices.index(found.index)
            if before := self._ends[k]:
                self.ends[before] -= 1
            self._ends[k] = found.status
            self.ends[found.status] += 1


def summarise(folder: Path, header: Header, *, anew: bool = False) -> None:
    """Make the summaries from the lines of the manifest, in the order of the plan.

    Those that are as new as the manifest stay, unless all are to be made ``anew``.
    """
    if not anew and are_current(folder, header.columns, folder / LINES):
        return
    lines = InOrder(folder, header.indices())
    try:
        write_files(folder, lines, len(lines), header.keys, header.columns)
    except OSError as error:
        raise StorageError(
            f"{folder}: the summaries cannot be written: {error.strerror}; "
            f"eigassign merge {quoted(folder)} makes them anew"
        ) from error
