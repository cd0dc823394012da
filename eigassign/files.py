"""Reading files that anybody may have put there: what one is and how large, before a byte counts.

A path may be a pipe that nobody writes to, a device without an end, a link to itself, or a file of
a terabyte without a block on the disk. Everything that opens a file named by the user, by a case or
found on disk does it here. What is too large is refused with the limit and the way to raise it: all
limits are multiplied by the environment variable ``EIGASSIGN_LIMITS``.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import io
import json
import math
import os
import re
import shlex
import stat
from collections.abc import Callable, Iterator, Mapping
from dataclasses import fields, is_dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

from eigassign.errors import UsageError

T = TypeVar("T")
VARIABLE = "EIGASSIGN_LIMITS"
UPDATED = "updated.yaml"  # in the folder of an update
CASE = 10_000_000  # bytes of a case file
TABLE = 100_000_000  # of a CSV file: far more than anybody's table, less than memory
MATRIX = 1_000_000_000  # of a matrix of a superelement
MESH = 200_000_000  # of a mesh of a solid: 10⁵ elements take some 20 MB
VALUES = 8_000_000  # of JSON: up to 80 bytes of memory each, whatever stands there
CACHE = 1_000_000_000  # of the cache: 30 000 files, which a run that stores lists in 0.4 s
_DEVICE = re.compile(r"(con|prn|aux|nul|com\d|lpt\d)(\..*)?", re.IGNORECASE)
_PIECE = 1 << 20  # bytes: hashing them takes longer than asking for them
_KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFIFO: "a pipe",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}


def raised(limit: float) -> float:
    """``limit``, times EIGASSIGN_LIMITS where that is set. Raises UsageError if it is no number."""
    given = os.environ.get(VARIABLE, "1")
    try:
        factor = float(given)
    except ValueError:
        factor = math.nan
    if not 0.0 < factor < math.inf:
        raise UsageError(f"{VARIABLE} = {given!r}: expected a number > 0 that multiplies limits")
    return limit * factor


def how_to_raise(size: float, limit: float) -> str:
    """``EIGASSIGN_LIMITS=20 allows it``: what lets ``size`` pass where ``limit`` is the rule."""
    return f"the environment variable {VARIABLE}={math.ceil(size / limit)} allows it"


def read_bytes(path: str | Path, limit: int) -> bytes:
    """The content of a regular file of at most ``limit`` bytes; raises as `pieces` does."""
    return b"".join(pieces(path, limit))


def file_digest(path: str | Path, limit: int) -> str | None:
    """SHA-256 of a regular file of at most ``limit`` bytes; None where there is none."""
    found = hashlib.sha256()
    try:
        for piece in pieces(path, limit):
            found.update(piece)
    except (OSError, ValueError):
        return None
    return found.hexdigest()


def once(read: Callable[[str | Path], T], most: int) -> Callable[[str | Path], T]:
    """``read``, once as long as the file stays the same, of the last ``most`` files."""
    known = lru_cache(most)(lambda path, *_: read(path))

    def kept(path: str | Path) -> T:
        try:
            status = os.stat(path)
        except (OSError, ValueError):
            return read(path)
        return known(path, status.st_mtime_ns, status.st_size)

    return kept


def seen_from(folder: Path, path: str | Path) -> str:
    """``path`` as seen from ``folder``, or from the root on another drive."""
    try:
        return Path(os.path.relpath(path, folder)).as_posix()
    except ValueError:
        return Path(path).as_posix()


def json_value(text: str | bytes) -> Any:
    """The value that JSON of anybody says; raises ValueError for everything else.

    That is NaN, infinities and numbers beyond all floats too, and brackets that are nested deeper
    than can be read. Raises OSError for more values than `VALUES`.
    """
    text = text if isinstance(text, str) else text.decode()
    if len(text) > VALUES and (n := sum(map(text.count, ",:[{"))) > raised(VALUES):
        raise OSError(errno.EFBIG, f"too many values; {how_to_raise(n, VALUES)}")
    try:
        return _JSON.decode(text)
    except RecursionError:
        raise ValueError("nested too deep") from None


def name_of(text: str) -> str:
    """``text`` if a file may have this name; raises ValueError or TypeError else."""
    if b"\0" in os.fsencode(text):
        raise ValueError("a null character in its name")
    return text


def folder_name(exact: str, shown: str | None = None, is_alone: bool = True) -> str:
    """A name that every file system allows, of a folder of what ``exact`` says.

    It is ``shown`` where that says all, and nothing else has it but for the case of letters
    (``is_alone``); otherwise what can be shown of it, and digits of a hash of ``exact``. Not
    allowed is what cannot be printed, the devices of Windows, blanks and points at the end, which
    Windows drops, and more than 100 bytes: systems allow 255, and the name of a variant has two of
    these, hidden ones 30 more.
    """
    text = exact if shown is None else shown
    plain = "".join(c if c.isprintable() else "_" for c in text)
    plain = f"_{plain}" if _DEVICE.fullmatch(plain) else plain
    short = plain.encode()[:100].decode(errors="ignore").rstrip(" .")
    if short == exact and is_alone:
        return exact
    digest = hashlib.sha256(exact.encode(errors="surrogatepass")).hexdigest()
    return f"{short}~{digest[:10]}"


def _number(text: str) -> float:
    """The number; raises ValueError where no float is as large."""
    if not math.isfinite(value := float(text)):
        raise ValueError(f"{text:.20} is no number")
    return int(text) if text.lstrip("-").isdecimal() else value


_JSON = json.JSONDecoder(parse_float=_number, parse_int=_number, parse_constant=_number)


def plain(value: object) -> Any:
    """Dataclasses, mappings, sequences, arrays and paths as JSON has them.

    A number that is not finite is null.
    """
    if hasattr(value, "tolist"):  # NumPy's arrays and scalars, without importing NumPy
        value = value.tolist()
    if is_dataclass(value):
        value = {field.name: getattr(value, field.name) for field in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): plain(inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(inner) for inner in value]
    if isinstance(value, Path):
        return str(value)
    return None if isinstance(value, float) and not math.isfinite(value) else value


def objection(path: str | Path, limit: int) -> str | None:
    """Why `read_bytes` would refuse, as far as can be told without opening; None if nothing."""
    try:
        status = os.stat(path)
        _require_regular(status)
        _require_small(status.st_size, limit)
    except (OSError, ValueError) as error:
        return getattr(error, "strerror", None) or str(error)
    return None


def printable(text: str) -> str:
    """One line of text with control characters written out, so that no name can move a cursor."""
    return "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text)


def quoted(path: str | Path) -> str:
    """``path`` as a shell takes it, on one line and without control characters."""
    text = f"./{path}" if str(path).startswith("-") else str(path)
    if text.isprintable():
        return shlex.quote(text)
    escaped = "".join(f"\\{c}" if c in "\\'" else printable(c) for c in text)
    return f"$'{escaped}'"


def pieces(path: str | Path, limit: int) -> Iterator[bytes]:
    """The content of a regular file of at most ``limit`` bytes, a megabyte at a time.

    Raises OSError, as `opened` does, for everything else; a file that grows while it is read is
    refused as well.
    """
    with opened(path) as file:
        _require_small(os.fstat(file.fileno()).st_size, limit)
        size = 0
        while part := file.read(_PIECE):
            size += len(part)
            _require_small(size, limit)
            yield part


@contextlib.contextmanager
def opened(path: str | Path) -> Iterator[io.FileIO]:
    """A regular file to be read, without a buffer.

    Raises OSError, whose ``strerror`` says what is wrong, for everything else. Opening waits for
    nobody.
    """
    try:
        _require_regular(os.stat(path))  # opening a device may already do something
    except ValueError as error:  # a null character
        raise OSError(errno.EINVAL, str(error)) from None
    flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_NOCTTY", 0)
    descriptor = os.open(path, flags | getattr(os, "O_BINARY", 0))
    with open(descriptor, "rb", buffering=0) as file:
        _require_regular(os.fstat(descriptor))
        yield file


def _require_regular(status: os.stat_result) -> None:
    if not stat.S_ISREG(status.st_mode):
        kind = _KINDS.get(stat.S_IFMT(status.st_mode), "something else")
        raise OSError(errno.EINVAL, f"it is {kind}, not a file")


def _require_small(size: int, limit: int) -> None:
    if size > raised(limit):
        most = f"{raised(limit) / 1e6:g} MB at most"
        raise OSError(errno.EFBIG, f"too large, {most}; {how_to_raise(size, limit)}")
