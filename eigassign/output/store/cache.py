"""A folder of results that need not be computed again, one file of arrays per content key.

A hit is bit for bit what was stored. A file that is not exactly what its writer finished is renamed
to ``*.damaged`` with a warning, and the caller computes anew. A folder that cannot be read or
written costs one warning, never the run.
"""

from __future__ import annotations

import contextlib
import errno
import logging
import math
import os
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from eigassign.errors import StorageError, UsageError
from eigassign.files import CACHE, at_home, raised
from eigassign.hdf5 import Array, DamagedError, get, pack
from eigassign.output.store.atomic import replace_synced, sweep_files

VARIABLE = "EIGASSIGN_CACHE"
WORTH_S = 0.1  # of work: reading a file and making its key take 5 ms, writing it 10 ms and a sync
_RULES = {"always": 0.0, "auto": WORTH_S, "never": None}
_log = logging.getLogger(__name__)
_SUFFIX = ".h5"
_DAMAGED = ".damaged"


@dataclass(frozen=True)
class CacheEntry:
    """One file of the cache; ``intact``: its content has the hash that it begins with."""

    key: str
    path: Path
    size_bytes: int
    modified_s: float  # seconds since 1970
    meta: Mapping[str, str]
    intact: bool


def default_directory() -> Path | None:
    """``EIGASSIGN_CACHE_DIR``, else the platform's cache folder; None where there is no home.

    Raises UsageError where the variable names the home folder of nobody.
    """
    if chosen := os.environ.get("EIGASSIGN_CACHE_DIR"):
        return at_home(chosen, "EIGASSIGN_CACHE_DIR")
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
    """Arrays by content key in ``directory``, for what takes ``least_s`` or more to compute."""

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
            return get(path, key).arrays
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

    def store(self, key: str, arrays: Mapping[str, Array], meta: Mapping[str, str]) -> None:
        """Keep ``arrays`` under ``key``; ``meta`` is for people who list the cache.

        The first time the oldest files go where all of them are over the limit. Raises UsageError
        for arrays or names that cannot be stored, never for a full disk.
        """
        try:
            self.directory.mkdir(parents=True, exist_ok=True)
            replace_synced(self.directory / f"{key}{_SUFFIX}", pack(key, arrays, meta))
            if not self._trimmed:
                self._trimmed = True
                self._trim()
        except OSError as error:
            self._warn(f"the cache cannot be written ({error}); going on without it")

    def entries(self) -> tuple[CacheEntry, ...]:
        """Files of the cache, oldest first, each read and checked; none of them is changed."""
        paths = [path for *_, path in self._by_age() if path.suffix == _SUFFIX]
        found = [entry for path in paths for entry in _read_entry(path)]
        return tuple(sorted(found, key=lambda entry: (entry.modified_s, entry.key)))

    def clear(self, older_than_s: float = -math.inf) -> int:
        """Delete entries of that age, damaged ones too, and temporary files of killed writers.

        Returns how many. Raises StorageError when one cannot be deleted.
        """
        swept, latest = sweep_files(self.directory, _is_ours), time.time() - older_than_s
        files = [path for modified_s, _, path in self._by_age() if modified_s <= latest]
        for path in files:
            try:
                path.unlink(missing_ok=True)
            except OSError as error:
                raise StorageError(f"cannot delete {path}: {error.strerror}") from error
        return len(files) + swept

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
                if _is_ours(file.name) and file.name.endswith((_SUFFIX, _DAMAGED)):
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


def _read_entry(path: Path) -> Iterator[CacheEntry]:
    try:
        status = path.lstat()
        meta, intact = get(path, path.stem).words, True
    except FileNotFoundError:  # gone since it was listed
        return
    except (DamagedError, OSError):
        meta, intact = {}, False
    yield CacheEntry(path.stem, path, status.st_size, status.st_mtime, meta, intact)
