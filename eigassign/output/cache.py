"""A folder of results that need not be computed again, one HDF5 file per content key.

A hit is bit for bit what was stored. A file that is not exactly what its writer finished is
renamed to ``*.damaged`` with a warning, and the caller computes anew. A folder that cannot be
read or written costs one warning, never the run.
"""

from __future__ import annotations

import logging
import os
import sys
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from eigassign.errors import StorageError
from eigassign.output.cache_format import Array, DamagedError, Part, key, pack, unpack
from eigassign.output.files import replace_synced

__all__ = ["Cache", "CacheEntry", "DamagedError", "Part", "default_directory", "key"]

_log = logging.getLogger(__name__)
_SUFFIX = ".h5"
_DAMAGED = ".damaged"
_STALE_S = 3600.0  # a temporary file this old belongs to a writer that was killed


@dataclass(frozen=True)
class CacheEntry:
    """One file of the cache; ``intact`` says whether its content could be believed."""

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
    xdg = Path(os.environ.get("XDG_CACHE_HOME", ""))
    if xdg.is_absolute():
        return xdg / "eigassign"
    try:
        return _platform_cache() / "eigassign"
    except RuntimeError:  # no home folder known
        return None


def _platform_cache() -> Path:
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
    return Path.home() / ("Library/Caches" if sys.platform == "darwin" else ".cache")


class Cache:
    """Arrays by content key in ``directory``; ``Cache(None)`` holds nothing and keeps nothing."""

    def __init__(self, directory: Path | None) -> None:
        self.directory = directory
        self._warned = False

    def load(self, entry_key: str) -> dict[str, Array] | None:
        """The arrays stored under ``entry_key``, read-only; None if there are none to believe."""
        if self.directory is None:
            return None
        path = self.directory / f"{entry_key}{_SUFFIX}"
        try:
            return unpack(entry_key, path.read_bytes())[0]
        except FileNotFoundError:
            return None
        except DamagedError as error:
            self._set_aside(path, error)
        except OSError as error:
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
        """Every file of the cache, oldest first, each read and checked; touches none of them."""
        found = [entry for path in self._files(f"*{_SUFFIX}") for entry in _read_entry(path)]
        return tuple(sorted(found, key=lambda entry: (entry.modified_s, entry.key)))

    def clear(self) -> int:
        """Delete all entries, damaged ones and leftovers of killed writers; how many went.

        Raises StorageError when one cannot be deleted.
        """
        leftovers = [path for path in self._files(f".*{_SUFFIX}.*.tmp") if _is_stale(path)]
        damaged = self._files(f"*{_SUFFIX}{_DAMAGED}")
        doomed = [*self._files(f"*{_SUFFIX}"), *damaged, *leftovers]
        for path in doomed:
            try:
                path.unlink(missing_ok=True)
            except OSError as error:
                raise StorageError(f"cannot delete {path}: {error.strerror}") from error
        return len(doomed)

    def _files(self, pattern: str) -> list[Path]:
        if self.directory is None:
            return []
        return [p for p in sorted(self.directory.glob(pattern)) if _is_ours(p.name)]

    def _set_aside(self, path: Path, error: DamagedError) -> None:
        aside = path.with_name(path.name + _DAMAGED)
        _log.warning("damaged cache file %s: %s; set aside and computed anew", path, error)
        try:
            os.replace(path, aside)
        except OSError as problem:
            self._warn(f"the damaged cache file cannot be set aside ({problem})")

    def _warn(self, message: str) -> None:
        if not self._warned:
            _log.warning("%s", message)
        self._warned = True


def _is_ours(name: str) -> bool:
    stem = name.lstrip(".").split(".")[0]
    return len(stem) == 64 and set(stem) <= set("0123456789abcdef")


def _is_stale(path: Path) -> bool:
    try:
        return time.time() - path.stat().st_mtime > _STALE_S
    except OSError:
        return False


def _read_entry(path: Path) -> Iterator[CacheEntry]:
    try:
        status = path.stat()
        data = path.read_bytes()
    except OSError:  # gone since it was listed, or not ours to read
        return
    try:
        meta, intact = unpack(path.stem, data)[1], True
    except DamagedError:
        meta, intact = {}, False
    yield CacheEntry(path.stem, path, status.st_size, status.st_mtime, meta, intact)
