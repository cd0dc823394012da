"""A folder of results that need not be computed again, one HDF5 file per content key.

    eigassign-stored 4 <SHA-256 of the key and of all that follows the user block>
    zeros up to 512 bytes: the user block, which HDF5 skips
    HDF5: each array a contiguous dataset

A hit is bit for bit what was stored. A file that is not exactly what its writer finished is renamed
to ``*.damaged`` with a warning, and the caller computes anew. A folder that cannot be read or
written costs one warning, never the run. The hash tells damage; it is no signature.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import io
import json
import logging
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import EigassignError, UsageError
from eigassign.files import CACHE, raised, read_bytes
from eigassign.output.store.atomic import replace_synced, sweep_files

Array = NDArray[Any]

VARIABLE = "EIGASSIGN_CACHE"
WORTH_S = 0.1  # of work: making a key and reading a file take 5 ms, writing it 10 ms and a sync
_RULES = {"always": 0.0, "auto": WORTH_S, "never": None}
_log = logging.getLogger(__name__)
_SUFFIX = ".h5"
_DAMAGED = ".damaged"
_START = b"eigassign-stored 4 "
BLOCK = 512  # bytes: the least user block of HDF5


class DamagedError(EigassignError):
    """The bytes are not what a finished writer left; the message says how they differ."""


def default_directory() -> Path | None:
    """``EIGASSIGN_CACHE_DIR``, else the platform's cache folder; None where there is no home.

    Raises UsageError where the variable names the home folder of nobody.
    """
    if chosen := os.environ.get("EIGASSIGN_CACHE_DIR"):
        try:
            return Path(chosen).expanduser()
        except RuntimeError:
            message = f"EIGASSIGN_CACHE_DIR: there is no home folder for {chosen!r}"
            raise UsageError(message) from None
    from platformdirs import user_cache_path

    try:
        return user_cache_path("eigassign", appauthor=False, opinion=False)
    except RuntimeError:  # no home folder known
        return None


def least_work() -> float | None:
    """What is worth a place in a cache, in seconds of work, by ``EIGASSIGN_CACHE``; None: nothing.

    Raises UsageError where that is none of always, auto and never.
    """
    given = os.environ.get(VARIABLE, "auto")
    if given not in _RULES:
        raise UsageError(f"{VARIABLE} = {given!r}: expected one of {', '.join(_RULES)}")
    return _RULES[given]


class Cache:
    """Arrays by content key in ``directory``, for what took ``least_s`` or more to compute."""

    def __init__(self, directory: Path, least_s: float = 0.0) -> None:
        self.directory, self.least_s = directory, least_s
        self._warned = False
        self._swept = False
        self._trimmed = False

    def load(self, key: str) -> dict[str, Array] | None:
        """The arrays stored under ``key``, read-only; None if missing or damaged."""
        if not self._swept:
            self._swept = True
            sweep_files(self.directory, _is_ours)
        path = self.directory / f"{key}{_SUFFIX}"
        try:
            return _unpack(key, read_bytes(path, CACHE))
        except FileNotFoundError:
            return None
        except DamagedError as error:
            self._set_aside(path, str(error))
        except OSError as error:
            if error.errno in (errno.EINVAL, errno.EFBIG, errno.ELOOP):
                self._set_aside(path, str(error.strerror))
            else:
                self._warn(f"the cache cannot be read ({error}); computing without it")
        return None

    def store(self, key: str, arrays: Mapping[str, Array]) -> None:
        """Keep ``arrays`` under ``key``; the first time the oldest files go, if it is too full.

        Raises UsageError for arrays of objects, never for a full disk.
        """
        try:
            self.directory.mkdir(parents=True, exist_ok=True)
            replace_synced(self.directory / f"{key}{_SUFFIX}", _packed(key, arrays))
            if not self._trimmed:
                self._trimmed = True
                self._trim()
        except OSError as error:
            self._warn(f"the cache cannot be written ({error}); going on without it")

    def _trim(self) -> None:
        """Delete the oldest files until all are within the limit; another process may, too."""
        files = self._by_age()
        over = sum(size for _, size, _ in files) - raised(CACHE)
        for _, size, path in files[:-1]:  # one that is larger alone is of use still
            if over > 0:
                path.unlink(missing_ok=True)
                over -= size

    def _by_age(self) -> list[tuple[float, int, Path]]:
        """When each file was written, its bytes and its path, the oldest first; none is opened."""
        found = []
        with contextlib.suppress(OSError), os.scandir(self.directory) as files:
            for file in files:
                if _is_ours(file.name):
                    with contextlib.suppress(OSError):  # gone since it was listed
                        status = file.stat(follow_symlinks=False)
                        found.append((status.st_mtime, status.st_size, Path(file.path)))
        return sorted(found)

    def _set_aside(self, path: Path, error: str) -> None:
        try:
            os.replace(path, path.with_name(path.name + _DAMAGED))
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


# --- The bytes of a file, and the key of what it holds


def content_key(arrays: Mapping[str, Array], algorithm: str) -> str:
    """SHA-256, 64 hex digits, of ``algorithm`` and of names, dtypes, shapes and values of arrays.

    Values count in little-endian bytes and C order, whatever the memory looks like.
    """
    little = {name: a.astype(a.dtype.newbyteorder("<")) for name, a in sorted(arrays.items())}
    layout = {name: [array.dtype.str, array.shape] for name, array in little.items()}
    digest = hashlib.sha256(json.dumps([algorithm, layout]).encode())
    for array in little.values():
        digest.update(array.tobytes())
    return digest.hexdigest()


def hdf5(arrays: Mapping[str, Array], words: Mapping[str, str], block: int = 0) -> bytes:
    """HDF5 with a dataset for each array, and any ``words`` as attributes of the group ``meta``.

    ``block`` bytes at its beginning are left to the caller.
    """
    import h5py

    body = io.BytesIO()
    with h5py.File(body, "w", userblock_size=block) as file:
        for name, array in arrays.items():
            file[name] = array
        if words:
            file.create_group("meta").attrs.update(words)
    return body.getvalue()


def _packed(key: str, arrays: Mapping[str, Array]) -> bytes:
    try:
        body = memoryview(hdf5(arrays, {}, BLOCK))[BLOCK:]
    except (TypeError, ValueError) as error:
        raise UsageError(f"these arrays cannot be stored: {error}") from error
    return _sealed(key, body) + body


def _sealed(key: str, body: memoryview) -> bytes:
    """The user block of a file."""
    digest = hashlib.sha256(key.encode())
    digest.update(body)
    return (_START + digest.hexdigest().encode() + b"\n").ljust(BLOCK, b"\0")


def _unpack(key: str, data: bytes) -> dict[str, Array]:
    """What `_packed` made a file of, read-only; raises DamagedError where any byte differs."""
    import h5py

    if data[:BLOCK] != _sealed(key, memoryview(data)[BLOCK:]):
        raise DamagedError("its content does not have the hash that it begins with")
    arrays = {}
    try:
        with h5py.File(io.BytesIO(data), "r") as file:
            for name in file:
                link, stored = file.get(name, getlink=True), file[name]
                # no filter, link or other file: what is read is in these bytes, and no more
                own = isinstance(link, h5py.HardLink) and isinstance(stored, h5py.Dataset)
                own = own and not (stored.chunks or stored.external or stored.is_virtual)
                if not own or stored.nbytes > len(data):
                    raise DamagedError(f"{name} was never stored so")
                arrays[name] = np.array(stored[()])
    except (ValueError, LookupError, OSError, RuntimeError, TypeError) as error:
        raise DamagedError(f"it was never stored ({type(error).__name__})") from error
    for array in arrays.values():
        array.setflags(write=False)
    return arrays
