"""One batch of its shards, which ran anywhere; and the summaries of what a batch has so far."""

from __future__ import annotations

import os
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain, zip_longest
from pathlib import Path

from eigassign.batch.manifest import LINES, Header, InOrder, read_header, write_header
from eigassign.batch.progress import summarise
from eigassign.errors import UsageError
from eigassign.output.batch.files import write_files
from eigassign.output.batch.outcome import from_line, status_of, to_line
from eigassign.output.store.atomic import replacing
from eigassign.output.store.run_record import relative_path


@dataclass(frozen=True)
class _Shard:
    folder: Path
    header: Header
    lines: InOrder


def merge_shards(out: Path, folders: Sequence[Path]) -> Counter[str]:
    """Make ``out`` the batch of the shards in ``folders``; how many cases ended in which way.

    The folders of cases stay where they are. Without ``folders`` the summaries of the batch in
    ``out`` are made anew. Raises UsageError, with all that is wrong, where a shard is missing, not
    finished, there twice, or of another batch.
    """
    if not folders:
        summarise(out, _header(out), anew=True)
        return Counter(map(status_of, InOrder(out, _header(out).indices())))
    shards = [
        _Shard(folder, header, InOrder(folder, header.indices()))
        for folder in folders
        for header in [_header(folder)]
    ]
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
        parts = [shard.lines if header.columns else _seen_from(place, shard) for shard in shards]
        file.writelines(chain.from_iterable(zip_longest(*parts, fillvalue="")))
    with open(out / LINES, encoding="utf-8") as lines:
        write_files(out, lines, header.cases, header.keys, header.columns)
    write_header(out, header)
    with open(out / LINES, encoding="utf-8") as lines:
        return Counter(map(status_of, lines))


def _header(folder: Path) -> Header:
    if (header := read_header(folder)) is None:
        raise UsageError(f"{folder}: no folder of a batch, there is no batch.json")
    return header


def _problems(shards: Sequence[_Shard]) -> Iterator[str]:
    """Yield what is wrong with the shards."""
    first = shards[0]
    n = first.header.shard[1]
    found: dict[int, Path] = {}
    for shard in shards:
        header, (i, count) = shard.header, shard.header.shard
        alike = (header.plan, count, header.version, header.columns)
        if alike != (first.header.plan, n, first.header.version, first.header.columns):
            yield f"{shard.folder} is a shard of another batch than {first.folder}"
        elif i in found:
            yield f"{shard.folder} and {found[i]} are the same shard, {i}/{n}"
        elif (done := len(shard.lines)) < (all_of_it := len(header.indices())):
            yield f"{shard.folder}, shard {i}/{n}, is not finished: {done} of {all_of_it} cases"
        found.setdefault(i, shard.folder)
    missing = [i for i in range(1, n + 1) if i not in found]
    if missing:
        some = ", ".join(map(str, missing[:10]))
        more = f" and {len(missing) - 10} more" if len(missing) > 10 else ""
        yield f"missing of {n} shards: {some}{more}"


def _seen_from(place: Path, shard: _Shard) -> Iterator[str]:
    """Yield the lines of a shard, in which the folders of cases are named from ``place``."""
    for line in shard.lines:
        row = from_line(line)
        if row.run_folder is not None:
            there = relative_path(shard.folder / row.run_folder, place)
            line = to_line(replace(row, run_folder=there)) + "\n"
        yield line
