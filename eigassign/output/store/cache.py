"""A folder of results that need not be computed again, one HDF5 file per content key.

First what a cache file is: 512 bytes of header, which HDF5 skips as its user block, and then
plain HDF5:

    eigassign-cache 1 | key=<sha256> | sha256=<of all bytes after the header> | complete | zeros

The hash is checked before HDF5 parses anything, so no damaged byte reaches the library. Then the
folder: a hit is bit for bit what was stored. A file that is not exactly what its writer finished
is renamed to ``*.damaged`` with a warning, and the caller computes anew. A folder that cannot be
read or written costs one warning, never the run.
"""

from __future__ import annotations

import errno
import hashlib
import io
import logging
import os
import re
import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import EigassignError, StorageError, UsageError
from eigassign.files import STORED, read_bytes
from eigassign.output.store.atomic import replace_synced, sweep_files

# --- A file: its key, its bytes, and how they are checked

Array = NDArray[Any]
Part = Array | np.generic | bool | int | float | complex | str | bytes | None | Sequence["Part"]

SCHEMA = 1  # raise it when the layout of the file or the encoding of the key changes
HEADER_BYTES = 512  # the least user block of HDF5
MARKER = "complete"
_NAME = re.compile(r"[A-Za-z0-9_]+\Z")
_KINDS = {"b": (1,), "i": (1, 2, 4, 8), "u": (1, 2, 4, 8), "f": (2, 4, 8), "c": (8, 16)}


class DamagedError(EigassignError):
    """The bytes are not what a finished writer left; the message says how they differ."""


def key(parts: Part, *, algorithm: str = "") -> str:
    """SHA-256, 64 hex digits, of ``parts`` in canonical bytes, ``algorithm`` and the schema.

    Every part is written as type tag, length, content, so no two different inputs share bytes.
    Arrays count by dtype, shape and all their values (little-endian, C order), never by ``repr``.
    Raises UsageError for anything that has no canonical bytes (sets, dicts, objects).
    """
    digest = hashlib.sha256()
    digest.update(_encode(("eigassign", SCHEMA, algorithm)))
    digest.update(_encode(parts))
    return digest.hexdigest()


def _encode(part: object) -> bytes:
    tag, content = _content(part)
    return tag + struct.pack("<Q", len(content)) + content


def _content(part: object) -> tuple[bytes, bytes]:
    match part:
        case None:
            return b"n", b""
        case bool() | np.bool_():
            return b"b", bytes([bool(part)])
        case int() | np.integer():
            return b"i", str(int(part)).encode()
        case float() | np.floating():
            return b"f", struct.pack("<d", float(part))
        case complex() | np.complexfloating():
            return b"c", struct.pack("<dd", part.real, part.imag)
        case str():
            return b"s", part.encode("utf-8", "surrogatepass")
        case bytes():
            return b"y", part
        case np.ndarray():
            _require_plain("a cache key", part)
            little = part.astype(part.dtype.newbyteorder("<"), copy=False)
            return b"a", _encode((little.dtype.str, part.shape)) + little.tobytes(order="C")
        case tuple() | list():
            return b"t", b"".join(map(_encode, part))
    raise UsageError(f"a cache key cannot be made from a {type(part).__name__}")


def _require_plain(name: str, array: Array) -> None:
    if array.dtype.itemsize not in _KINDS.get(array.dtype.kind, ()):
        raise UsageError(f"{name}: arrays of dtype {array.dtype} cannot be stored")


def pack(entry_key: str, arrays: Mapping[str, Array], meta: Mapping[str, str]) -> bytes:
    """The whole file for ``arrays`` and ``meta``; the same input gives the same bytes."""
    import h5py

    body = io.BytesIO()
    with h5py.File(body, "w", userblock_size=HEADER_BYTES) as file:
        for name in sorted(arrays):
            _write_array(file, name, np.asarray(arrays[name]))
        file.create_group("meta").attrs.update({name: meta[name] for name in sorted(meta)})
        file.attrs["datasets"] = len(arrays)
        file.attrs[MARKER] = True
    content = body.getbuffer()[HEADER_BYTES:]
    return b"".join((header(entry_key, content), content))


def _write_array(file: Any, name: str, array: Array) -> None:
    if not _NAME.match(name) or name == "meta":
        raise UsageError(f"{name!r} cannot name a stored array: use letters, digits and _")
    _require_plain(name, array)
    checked = array.ndim > 0 and array.size > 0  # HDF5 filters need chunks, chunks need extent
    file.create_dataset(name, data=array, **({"fletcher32": True} if checked else {}))


def header(entry_key: str, content: bytes | memoryview) -> bytes:
    """The first 512 bytes of a file with this content under this key."""
    digest = hashlib.sha256(content).hexdigest()
    text = f"eigassign-cache {SCHEMA}\nkey={entry_key}\nsha256={digest}\n{MARKER}\n"
    return text.encode().ljust(HEADER_BYTES, b"\0")


def unpack(entry_key: str, data: bytes) -> tuple[dict[str, Array], dict[str, str]]:
    """Arrays (read-only) and meta of a file made by :func:`pack`.

    Raises DamagedError when any byte differs from what was written under ``entry_key``.
    """
    view = memoryview(data)
    if len(data) <= HEADER_BYTES:
        raise DamagedError(f"only {len(data)} bytes long")
    if view[:HEADER_BYTES] != header(entry_key, view[HEADER_BYTES:]):
        raise DamagedError("its content does not have the hash that its header promises")
    try:
        return _read(data)
    except DamagedError:
        raise
    except Exception as error:  # anything may come of HDF5 that somebody else made
        raise DamagedError(f"HDF5 cannot read it ({type(error).__name__})") from error


def _read(data: bytes) -> tuple[dict[str, Array], dict[str, str]]:
    import h5py

    with h5py.File(io.BytesIO(data), "r") as file:
        names = [name for name in file if name != "meta"]
        if not file.attrs.get(MARKER, False) or file.attrs["datasets"] != len(names):
            raise DamagedError("it was never completed")
        arrays = {name: _array(file, name, len(data)) for name in names}
        notes = file["meta"].attrs.items()
        meta = {name: text for name, text in notes if isinstance(text, str)}
    for array in arrays.values():
        array.setflags(write=False)
    return arrays, meta


def _array(file: Any, name: str, size: int) -> Array:
    """A dataset whose bytes are all in the file of ``size`` bytes, as `pack` writes them: HDF5 can
    also point to other files, and claim any shape without a byte behind it."""
    import h5py

    link = file.get(name, getlink=True)
    found = file[name] if isinstance(link, h5py.HardLink) else None
    if (
        not isinstance(found, h5py.Dataset)
        or found.external
        or found.is_virtual
        or found.dtype.itemsize not in _KINDS.get(found.dtype.kind, ())
        or prod(found.shape) * found.dtype.itemsize > size
    ):
        raise DamagedError("it holds something that was never stored")
    return np.asarray(found[()])


# --- The folder

_log = logging.getLogger(__name__)
_SUFFIX = ".h5"
_DAMAGED = ".damaged"


@dataclass(frozen=True)
class CacheEntry:
    """One file of the cache; ``intact``: its content has the hash that its header gives."""

    key: str
    path: Path
    size_bytes: int
    modified_s: float  # seconds since 1970
    meta: Mapping[str, str]
    intact: bool


def default_directory() -> Path | None:
    """``EIGASSIGN_CACHE_DIR``, else the platform's cache folder; None where there is no home."""
    if chosen := os.environ.get("EIGASSIGN_CACHE_DIR"):
        return Path(chosen).expanduser()
    from platformdirs import user_cache_path

    try:
        return user_cache_path("eigassign", appauthor=False, opinion=False)
    except RuntimeError:  # no home folder known
        return None


class Cache:
    """Arrays by content key in ``directory``; ``Cache(None)`` stores nothing."""

    def __init__(self, directory: Path | None) -> None:
        self.directory = directory
        self._warned = False
        self._swept = False

    def load(self, entry_key: str) -> dict[str, Array] | None:
        """The arrays stored under ``entry_key``, read-only; None if missing or damaged."""
        if self.directory is None:
            return None
        if not self._swept:
            self._swept = True
            sweep_files(self.directory, _is_ours)
        path = self.directory / f"{entry_key}{_SUFFIX}"
        try:
            return unpack(entry_key, read_bytes(path, STORED))[0]
        except FileNotFoundError:
            return None
        except DamagedError as error:
            self._set_aside(path, str(error))
        except OSError as error:
            if error.errno in (errno.EINVAL, errno.EFBIG, errno.ELOOP):
                self._set_aside(path, str(error.strerror))
                return None
            self._warn(f"the cache cannot be read ({error}); computing without it")
        return None

    def store(self, entry_key: str, arrays: Mapping[str, Array], meta: Mapping[str, str]) -> None:
        """Keep ``arrays`` under ``entry_key``; ``meta`` is for people who list the cache.

        Raises UsageError for arrays or names that cannot be stored, never for a full disk.
        """
        if self.directory is None:
            return
        data = pack(entry_key, arrays, meta)
        try:
            self.directory.mkdir(parents=True, exist_ok=True)
            replace_synced(self.directory / f"{entry_key}{_SUFFIX}", data)
        except OSError as error:
            self._warn(f"the cache cannot be written ({error}); going on without it")

    def entries(self) -> tuple[CacheEntry, ...]:
        """Files of the cache, oldest first, each read and checked; none of them is changed."""
        found = [entry for path in self._files(f"*{_SUFFIX}") for entry in _read_entry(path)]
        return tuple(sorted(found, key=lambda entry: (entry.modified_s, entry.key)))

    def clear(self) -> int:
        """Delete all entries, damaged ones and temporary files of killed writers; returns how many.

        Raises StorageError when one cannot be deleted.
        """
        swept = 0 if self.directory is None else sweep_files(self.directory, _is_ours)
        files = [*self._files(f"*{_SUFFIX}"), *self._files(f"*{_SUFFIX}{_DAMAGED}")]
        for path in files:
            try:
                path.unlink(missing_ok=True)
            except OSError as error:
                raise StorageError(f"cannot delete {path}: {error.strerror}") from error
        return len(files) + swept

    def _files(self, pattern: str) -> list[Path]:
        if self.directory is None:
            return []
        return [p for p in sorted(self.directory.glob(pattern)) if _is_ours(p.name)]

    def _set_aside(self, path: Path, error: str) -> None:
        aside = path.with_name(path.name + _DAMAGED)
        try:
            os.replace(path, aside)
            done = "set aside and computed anew"
        except OSError as problem:
            done = f"it cannot be set aside ({problem.strerror}); computed anew"
        _log.warning("damaged cache file %s: %s; %s", path, error, done)

    def _warn(self, message: str) -> None:
        if not self._warned:
            _log.warning("%s", message)
        self._warned = True


def _is_ours(name: str) -> bool:
    stem = name.split(".")[0]
    return len(stem) == 64 and set(stem) <= set("0123456789abcdef")


def _read_entry(path: Path) -> Iterator[CacheEntry]:
    try:
        status = path.lstat()
        meta, intact = unpack(path.stem, read_bytes(path, STORED))[1], True
    except FileNotFoundError:  # gone since it was listed
        return
    except (DamagedError, OSError):
        meta, intact = {}, False
    yield CacheEntry(path.stem, path, status.st_size, status.st_mtime, meta, intact)
