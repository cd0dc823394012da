"""A folder of results that need not be computed again, one file of arrays per content key.

A hit is bit for bit what was stored. A file that is not exactly what its writer finished is renamed
to ``*.damaged`` with a warning, and the caller computes anew. A folder that cannot be read or
written costs one warning, never the run.
"""

from __future__ import annotations

import errno
import logging
import os
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from eigassign.errors import StorageError, UsageError
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
    """``EIGASSIGN_CACHE_DIR``, else the platform's cache folder; None where there is no home."""
    if chosen := os.environ.get("EIGASSIGN_CACHE_DIR"):
        return Path(chosen).expanduser()
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

        Raises UsageError for arrays or names that cannot be stored, never for a full disk.
        """
        try:
            self.directory.mkdir(parents=True, exist_ok=True)
            replace_synced(self.directory / f"{key}{_SUFFIX}", pack(key, arrays, meta))
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
        swept = sweep_files(self.directory, _is_ours)
        files = [*self._files(f"*{_SUFFIX}"), *self._files(f"*{_SUFFIX}{_DAMAGED}")]
        for path in files:
            try:
                path.unlink(missing_ok=True)
            except OSError as error:
                raise StorageError(f"cannot delete {path}: {error.strerror}") from error
        return len(files) + swept

    def _files(self, pattern: str) -> list[Path]:
        return [p for p in sorted(self.directory.glob(pattern)) if _is_ours(p.name)]

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
