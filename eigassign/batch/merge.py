"""One batch of its shards, which ran anywhere; and the summaries of what a batch has so far."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, count, islice, zip_longest
from pathlib import Path

from eigassign.batch.cases import recorded, summarise
from eigassign.batch.lock import folder_lock
from eigassign.batch.manifest import LINES, Header, InOrder, line_of, read_header
from eigassign.errors import UsageError
from eigassign.output.batch.outcome import from_line, to_line
from eigassign.output.store.atomic import replacing
from eigassign.output.store.run_record import relative_path


@dataclass(frozen=True)
class _Shard:
    folder: Path
    header: Header
    rows: InOrder

    def lost(self) -> list[str]:
        """The cases whose record does not say what the index does; see `cases`."""
        if self.header.columns:
            return []
        every = (from_line(text, self.folder) for text in self.rows)
        listed = ((row, row.run_folder) for row in every if row.run_folder is not None)
        found = ((row, recorded(self.folder / place)) for row, place in listed)
        return [row.name for row, now in found if now is None or now.key != row.key]


def merge_shards(out: Path, folders: Sequence[Path]) -> InOrder:
    """Make ``out`` the batch of the shards in ``folders``; its rows.

    The folders of cases stay where they are. Without ``folders`` the summaries of the batch in
    ``out`` are made anew. Raises UsageError, with all that is wrong, where a shard is missing, not
    finished, there twice, or of another batch, and where files of a case were lost.
    """
    shards = []
    for folder in folders or (out,):
        if (found := read_header(folder)) is None:
            raise UsageError(f"{folder} is not the folder of a batch: it has no batch.json")
        shards.append(_Shard(folder, found, InOrder(folder, found)))
    if not folders:
        if lost := shards[0].lost():
            some = ", ".join(lost[:5]) + (", …" if len(lost) > 5 else "")
            message = f"files of {some} were changed or lost: run the batch again"
            raise UsageError(f"{out}: {message}")
        with folder_lock(out) as lock:
            return summarise(out, shards[0].header, anew=True, alone=lock.summaries)
    one, place = shards[0], Path(os.path.realpath(out))
    files = tuple(relative_path(one.folder / file, place) for file in one.header.files)
    header = replace(one.header, shard=(1, 1), files=files)
    problems, before = [*_problems(shards)], read_header(out)
    if before is not None and (before.plan, before.shard) != (header.plan, header.shard):
        problems.append(f"{out} holds another batch, or one of the shards: choose another folder")
    if problems:
        raise UsageError(f"the shards cannot be merged: {'; '.join(problems)}")
    shards.sort(key=lambda shard: shard.header.shard)
    out.mkdir(parents=True, exist_ok=True)
    with replacing(out / LINES) as made, open(made, "w", encoding="utf-8") as file:
        parts = [shard.rows if header.columns else _seen_from(place, shard) for shard in shards]
        rows_in_turn = filter(None, chain.from_iterable(zip_longest(*parts)))
        file.writelines(line_of(row, header.plan) for row in rows_in_turn)
    return summarise(out, header, anew=True)


def _problems(shards: Sequence[_Shard]) -> Iterator[str]:
    """Yield what is wrong with the shards."""
    first = shards[0]
    n = first.header.shard[1]
    found: dict[int, Path] = {}
    for shard in shards:
        header, (i, parts) = shard.header, shard.header.shard
        alike = (header.plan, parts, header.version, header.columns)
        if alike != (first.header.plan, n, first.header.version, first.header.columns):
            yield f"{shard.folder} is a shard of another batch than {first.folder}"
        elif i in found:
            yield f"{shard.folder} and {found[i]} are the same shard, {i}/{n}"
        elif (done := len(shard.rows) - len(shard.lost())) < (all_of_it := len(header.indices())):
            yield f"{shard.folder}, shard {i}/{n}, is not finished: {done} of {all_of_it} cases"
        found.setdefault(i, shard.folder)
    if missing := n - sum(i <= n for i in found):
        missed = islice((str(i) for i in count(1) if i not in found), min(missing, 10))
        more = f" and {missing - 10} more" if missing > 10 else ""
        yield f"missing of {n} shards: {', '.join(missed)}{more}"


def _seen_from(place: Path, shard: _Shard) -> Iterator[str]:
    """Yield the rows of a shard, in which the folders of cases are named from ``place``."""
    for text in shard.rows:
        row = from_line(text)
        if row.run_folder is not None:
            there = relative_path(shard.folder / row.run_folder, place)
            text = to_line(replace(row, run_folder=there))
        yield text
