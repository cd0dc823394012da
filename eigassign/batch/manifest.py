"""What a batch remembers while it runs: batch.json, and a line of manifest.jsonl for each result.

A line is written as its case finishes, in one piece, behind all others; so whoever is killed, and
when, nothing before is lost. A line without an end, of a kill or a full disk, is none; it is cut
off before the next is written. Of several lines of one case the last one counts.
"""

from __future__ import annotations

import contextlib
import io
import json
import re
from array import array
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from dataclasses import asdict, dataclass
from pathlib import Path

from eigassign._version import __version__
from eigassign.errors import StorageError, UsageError
from eigassign.files import STORED, read_bytes
from eigassign.output.batch.outcome import CaseOutcome, from_line, to_line
from eigassign.output.store.atomic import replace_synced

HEADER, LINES = "batch.json", "manifest.jsonl"
FORMAT = 1  # of batch.json: others are refused
_BEGIN = re.compile(rb'\{"index": ([0-9]{1,20}),')  # of a line


@dataclass(frozen=True)
class Header:
    """batch.json: which plan the folder is of. All variants in it were found to be valid."""

    plan: str  # its digest
    cases: int  # of the whole plan
    shard: tuple[int, int]  # (i, n): cases of the plan with index % n == i − 1
    files: tuple[str, ...]  # the case files, as seen from the folder
    keys: tuple[str, ...] = ()  # that its variants have values of
    columns: bool = False  # the cases have no folders
    version: str = __version__
    format: int = FORMAT

    def indices(self) -> range:
        """Indices of the cases that are this folder's."""
        i, n = self.shard
        return range(i - 1, self.cases, n)


def read_header(folder: Path) -> Header | None:
    """The header of a batch folder; None where there is none.

    Raises UsageError where it is damaged or of another format.
    """
    try:
        found = json.loads(read_bytes(folder / HEADER, STORED))
        if found["format"] != FORMAT:
            raise UsageError(f"{folder / HEADER} is of another version of eigassign: use --out")
        found = {**found, "shard": tuple(found["shard"])}
        found |= {name: tuple(found[name]) for name in ("files", "keys")}
        header = Header(**found)
        if header.indices().start < 0:
            raise ValueError("shards are counted from 1")
        return header
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:
        raise StorageError(f"{folder / HEADER}: cannot be read: {error.strerror}") from error
    except (ValueError, LookupError, TypeError) as error:
        raise UsageError(f"{folder / HEADER} is damaged: move it aside, or use --out") from error


def write_header(folder: Path, header: Header) -> None:
    """Replace batch.json in one step."""
    replace_synced(folder / HEADER, (json.dumps(asdict(header), indent=2) + "\n").encode())


class Manifest:
    """The lines of manifest.jsonl, a `CaseOutcome` each: read as they are added, and written."""

    def __init__(
        self,
        folder: Path,
        appending: Callable[[], AbstractContextManager[object]] = contextlib.nullcontext,
    ) -> None:
        """``appending``: entered while a line is written, where several processes write."""
        self.path = folder / LINES
        self._appending = appending
        self._read = 0  # bytes that were read

    def news(self) -> Iterator[CaseOutcome]:
        """The outcomes that were added since this was last asked for, by whomever."""
        for _, line in self.lines():
            try:
                outcome = from_line(line)
            except StorageError:  # somebody edited the file
                continue
            yield outcome

    def lines(self) -> Iterator[tuple[int, bytes]]:
        """Yield where each line begins, and the line; one without an end is left for later."""
        try:
            with open(self.path, "rb") as file:
                file.seek(self._read)
                for line in file:
                    if line.endswith(b"\n"):
                        start, self._read = self._read, self._read + len(line)
                        yield start, line
        except FileNotFoundError:
            return

    def append(self, outcome: CaseOutcome) -> None:
        """Write a line behind all others; raises StorageError where it cannot be written whole."""
        line = to_line(outcome).encode() + b"\n"
        try:
            with self._appending(), open(self.path, "ab+", buffering=0) as file:
                end = _cut(file)
                if file.write(line) != len(line):
                    file.truncate(end)
                    raise StorageError(f"{self.path}: no space for another line")
        except OSError as error:
            raise StorageError(f"{self.path}: cannot be written: {error.strerror}") from error


def _index(line: bytes) -> int:
    """The index that a whole line begins with, and −1 of anything else."""
    begin = _BEGIN.match(line)
    return int(begin[1]) if begin and line.isascii() and line.endswith(b"}\n") else -1


def _cut(file: io.FileIO) -> int:
    """Cut off a last line without an end; the length of the file."""
    size = end = file.seek(0, io.SEEK_END)
    while end:
        begin = file.seek(max(0, end - 4096))
        last = file.read(end - begin).rfind(b"\n")
        end = begin + last + 1
        if last >= 0:
            break
    if end < size:
        file.truncate(end)
    return end


class InOrder:
    """The line of each case that has one, the last it has, in the order of ``indices``.

    The file is gone through once for where each line is, and then read line by line: memory is
    8 bytes a case.
    """

    def __init__(self, folder: Path, indices: range) -> None:
        self._path, places = folder / LINES, array("q", [-1]) * len(indices)
        for start, line in Manifest(folder).lines():
            if (index := _index(line)) in indices:
                places[indices.index(index)] = start
        self._places = array("q", (place for place in places if place >= 0))

    def __len__(self) -> int:
        return len(self._places)

    def __iter__(self) -> Iterator[str]:
        if self._places:
            with open(self._path, "rb", buffering=1 << 20) as file:  # nearly in order
                for place in self._places:
                    if file.tell() != place:
                        file.seek(place)
                    yield file.readline().decode()
