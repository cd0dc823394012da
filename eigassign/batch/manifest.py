"""The index of a batch: batch.json says which plan it is of, manifest.jsonl how each case ended.

A line is written as its case ends, in one piece, behind all others; so whoever is killed, and when,
nothing before is lost; it is on disk within a second, which is what a power cut may cost. It ends
with a hash of itself and of the plan: what was cut or edited, and what is of another batch, is no
line. Of several lines of one case the last one counts.
"""

from __future__ import annotations

import errno
import hashlib
import io
import json
import re
import sys
import threading
from array import array
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from eigassign._version import __version__
from eigassign.case.schema.sweep import MOST
from eigassign.errors import StorageError, UsageError
from eigassign.files import CASE, TABLE, json_value, name_of, opened, read_bytes
from eigassign.output.batch.outcome import CaseOutcome, from_line, status_of, to_line
from eigassign.output.store.atomic import replace_synced, sync_path

HEADER, LINES = "batch.json", "manifest.jsonl"
FORMAT = 1  # of batch.json: others are refused
_SYNC_S = 1.0  # a sync takes some ms of a disk, a case of columns 25 ms


@dataclass(frozen=True)
class Header:
    """batch.json: which plan the folder is of. All variants in it were found to be valid."""

    plan: str  # its digest
    cases: int  # of the plan
    files: tuple[str, ...]  # the case files, as seen from the folder
    keys: tuple[str, ...] = ()  # that its variants have values of
    columns: bool = False  # the cases have no folders
    version: str = __version__
    format: int = FORMAT
    summarised: str = field(default="", compare=False)  # `digest` of the summaries

    def indices(self) -> range:
        """Indices of the cases."""
        return range(self.cases)


def read_header(folder: Path) -> Header | None:
    """The header of a batch folder; None where there is none.

    Raises UsageError where it is damaged or of another format.
    """
    try:
        found = json_value(read_bytes(folder / HEADER, TABLE))
        if found["format"] != FORMAT:
            raise UsageError(f"{folder / HEADER} is of another version: use another --out")
        lists = {name: found[name] for name in ("files", "keys")}
        header = Header(**{**found, **{name: tuple(given) for name, given in lists.items()}})
        texts = (header.plan, header.version, header.summarised)
        kinds = [header.columns], (header.cases,), lists.values()
        whole = [{*map(type, each)} for each in kinds] == [{bool}, {int}, {list}]
        right = whole and 0 <= header.cases <= MOST * len(header.files)
        names = {*map(type, (*texts, *header.files, *header.keys))} == {str}
        if not (right and names and header.plan.isascii() and all(map(name_of, header.files))):
            raise ValueError("no header of a batch")
        return header
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:
        raise StorageError(f"{folder / HEADER}: cannot be read: {error.strerror}") from error
    except (ValueError, LookupError, TypeError) as error:
        raise UsageError(f"{folder / HEADER} is damaged: use another --out") from error


def write_header(folder: Path, header: Header) -> None:
    """Replace batch.json in one step."""
    replace_synced(folder / HEADER, (json.dumps(asdict(header), indent=2) + "\n").encode())


# --- Lines

_DIGITS = 16  # of the hash of a line
_TAIL = len(f', "seal": "{_DIGITS * "0"}"}}\n')
_INDEX = re.compile(r'\{"index": (-?[0-9]{1,18}),')  # of a row


def line_of(row: str, plan: str) -> str:
    """The line of a row, which is written as `to_line` writes it, of this plan."""
    seal = hashlib.sha256(f"{plan}{row}".encode()).hexdigest()[:_DIGITS]
    return f'{row[:-1]}, "seal": "{seal}"}}\n'


@dataclass(frozen=True, slots=True)
class Line:
    """A whole line of the manifest: of which file, where it begins, its bytes, and its row."""

    path: Path
    start: int
    line: bytes
    row: str
    index: int

    @property
    def seal(self) -> int:
        """Its hash."""
        return int(self.line[-_TAIL:].split(b'"')[3], 16)

    @property
    def status(self) -> str:
        """The status of its case."""
        return status_of(self.row)

    @property
    def run_folder(self) -> str | None:
        """The folder of its case."""
        return self.outcome.run_folder

    @property
    def outcome(self) -> CaseOutcome:
        """The row, read."""
        return from_line(self.row, self.path.parent)


class Manifest:
    """The lines of manifest.jsonl that are of one plan: read as they are added, and written."""

    def __init__(self, folder: Path, plan: str) -> None:
        self.path = folder / LINES
        self._plan = plan
        self._syncing: threading.Timer | None = None  # of the first line that may not be on disk
        self._failed: OSError | None = None  # why it could not be
        self._read = 0  # bytes that were read

    def news(self) -> Iterator[Line]:
        """Yield the lines that were added since this was last asked for, by whomever.

        One without an end is left for later. Raises StorageError where there is something else than
        a file of lines.
        """
        try:
            with opened(self.path) as raw, io.BufferedReader(raw) as file:
                file.seek(self._read)
                while line := file.readline(CASE):
                    if not line.endswith(b"\n"):
                        if len(line) == CASE:
                            raise OSError(errno.EFBIG, f"a line of more than {CASE / 1e6:g} MB")
                        return
                    start, self._read = self._read, self._read + len(line)
                    if (found := self._opened(start, line)) is not None:
                        yield found
        except FileNotFoundError:
            return
        except OSError as error:
            raise StorageError(f"{self.path}: cannot be read: {error.strerror}") from error

    def _opened(self, start: int, line: bytes) -> Line | None:
        """The line with these bytes; None where somebody else has written them."""
        if not line.isascii():
            return None
        text = line.decode()
        row = f"{text[:-_TAIL]}}}"
        begin = _INDEX.match(row)
        if begin is None or line_of(row, self._plan) != text:
            return None
        return Line(self.path, start, line, row, int(begin[1]))

    def append(self, outcome: CaseOutcome) -> None:
        """Write a line behind all others; raises StorageError where it cannot be written whole.

        A last line without an end, of a kill or a full disk, is cut off before.
        """
        line = line_of(to_line(outcome), self._plan).encode()
        try:
            with open(self.path, "ab+", buffering=0) as file:
                end = _cut(file)
                if file.write(line) != len(line):
                    file.truncate(end)
                    raise StorageError(f"{self.path}: no space for another line")
            if self._syncing is None:
                self._syncing = threading.Timer(_SYNC_S, self._sync)
                self._syncing.daemon = True
                self._syncing.start()
            if self._failed is not None:
                raise self._failed
        except OSError as error:
            raise StorageError(f"{self.path}: cannot be written: {error.strerror}") from error

    def sync(self) -> None:
        """Wait until all lines are on disk; raises StorageError where they cannot be."""
        if self._syncing is not None:
            self._syncing.cancel()
        self._sync()
        if self._failed is not None:
            why = self._failed.strerror
            raise StorageError(f"{self.path}: cannot be written: {why}") from self._failed

    def _sync(self) -> None:
        """Wait until all lines are on disk; `_failed` says why they are not."""
        self._syncing = None  # before: a line that comes meanwhile may not be on disk
        try:
            sync_path(self.path)
        except FileNotFoundError:
            return
        except OSError as error:
            self._failed = error


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
    """The row of each case that has one, as the last of its lines says, in the order of the plan.

    The file is gone through once for where each line is, and then read line by line: memory is 32
    bytes a line, however many cases the header speaks of. ``digest`` tells these rows from all
    others, ``ends`` counts how they ended.
    """

    def __init__(self, folder: Path, header: Header) -> None:
        self._path, indices = folder / LINES, header.indices()
        numbers, places, seals, ends = array("q"), array("q"), array("Q"), list[str]()
        for line in Manifest(folder, header.plan).news():
            if line.index in indices:
                numbers.append(line.index)
                places.append(line.start)
                seals.append(line.seal)
                ends.append(sys.intern(line.status))
        known, back = np.unique(numbers[::-1], return_index=True)
        last = len(numbers) - 1 - back  # the line of each case, in the order of the plan
        self._places = np.array(places)[last]
        said = known.tobytes() + np.array(seals)[last].tobytes()
        self.digest = hashlib.sha256(said).hexdigest()
        self.ends = Counter(ends[k] for k in last)

    def __len__(self) -> int:
        return len(self._places)

    def __iter__(self) -> Iterator[str]:
        if len(self):
            with open(self._path, "rb", buffering=1 << 20) as file:  # nearly in order
                for place in self._places:
                    if file.tell() != place:
                        file.seek(place)
                    yield f"{file.readline().decode()[:-_TAIL]}}}"
