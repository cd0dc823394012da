"""A run folder is written whole or not at all, and never at the cost of something else.

A run is written into a hidden sibling folder, synced, and exchanged with the earlier one in a
single rename. What may give way to it:

- nothing there, or an empty folder;
- a finished run of the same case file: it is replaced, and if somebody added files of their own
  to it, it is kept beside the new one as ``<name>.1``;
- anything else only with ``force``, and then it is kept as ``<name>.1`` too: nothing that a run
  did not write is ever deleted.
"""

from __future__ import annotations

import contextlib
import json
import logging
import os
import re
import shutil
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType

from eigassign.errors import StorageError
from eigassign.files import CASE, read_bytes
from eigassign.output.storage import (
    put_in_place,
    sync_path,
    sync_tree,
    temporary_name,
    try_lock,
    write_synced,
)

_log = logging.getLogger(__name__)
MARKER = "run.json"  # written last: a folder that has it was finished
_MARKER_SCHEMA = 1
_YOUNG_S = 60.0  # a temporary folder this fresh may not have been locked yet by its owner


@dataclass(frozen=True)
class RunOf:
    """The case of a run; ``case_path`` is relative to the folder, so that both may move."""

    case_path: str
    case_sha256: str
    case_files: Mapping[str, str] = field(default_factory=dict)  # SHA-256 of what the case names

    def is_same_case(self, other: RunOf) -> bool:
        """Same file (perhaps edited since), or same content (perhaps moved since).

        The content is that of the case file and of every file it names.
        """
        if self.case_path == other.case_path:
            return True
        return (self.case_sha256, self.case_files) == (other.case_sha256, other.case_files)


@contextlib.contextmanager
def run_folder(
    target: Path,
    *,
    case_path: Path,
    case_sha256: str,
    case_files: Mapping[str, str] = MappingProxyType({}),
    force: bool = False,
) -> Iterator[Path]:
    """Yield an empty hidden folder to fill; on a clean exit it becomes ``target``.

    Any exception, interrupt or full disk inside leaves ``target`` as it was. Of two writers of
    one target the last one wins whole. Raises StorageError where ``target`` may not be replaced
    (checked on entry already) or cannot be written.
    """
    target = Path(os.path.realpath(target))
    run = RunOf(_relative(case_path, target), case_sha256, dict(case_files))
    with _storage_errors(target):
        require_replaceable(target, run, force=force, case_path=case_path)
        made = _make_parents(target.parent)
        _remove_leftovers(target)
        folder = target.with_name(temporary_name(target.name))
        folder.mkdir()
        try:
            with try_lock(folder):
                yield folder
                _publish(folder, target, run, force=force)
        finally:
            shutil.rmtree(folder, ignore_errors=True)
            _remove_empty(made)


def _make_parents(folder: Path) -> list[Path]:
    """Create a folder with what is missing above it; the created ones, deepest first."""
    missing = [path for path in (folder, *folder.parents) if not path.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    return missing


def _remove_empty(folders: list[Path]) -> None:
    """Remove the folders that were made for a run that failed, if they are empty."""
    for folder in folders:
        with contextlib.suppress(OSError):
            folder.rmdir()


@contextlib.contextmanager
def _storage_errors(target: Path) -> Iterator[None]:
    try:
        yield
    except BrokenPipeError:  # whoever reads our output went away: not this folder's trouble
        raise
    except OSError as error:
        reason = error.strerror or str(error)
        raise StorageError(f"cannot write the run folder {target}: {reason}") from error


def require_replaceable(target: Path, run: RunOf, *, force: bool, case_path: Path) -> None:
    """Raise StorageError unless a run of this case may be put at ``target``."""
    if os.path.ismount(target):
        raise StorageError(f"{target} is a mount point; choose a folder inside it with --out")
    _require_apart(target, case_path)
    reason = _objection(target, run)
    if reason and not force:
        raise StorageError(
            f"{target} {reason}; it was left alone. Choose another folder with --out, "
            f"or use --force to move it aside"
        )


def _require_apart(target: Path, case_path: Path) -> None:
    keep = {"the working folder": Path.cwd(), "the case file": Path(os.path.realpath(case_path))}
    for name, path in keep.items():
        if target == path or target in path.parents:
            raise StorageError(f"{target} holds {name} and cannot become a run folder; use --out")


def _objection(target: Path, run: RunOf) -> str | None:
    """Why what is at ``target`` may not be replaced unasked; None if it may."""
    if not os.path.lexists(target):
        return None
    if not target.is_dir():
        return "is a file, not a folder"
    if (marker := _read_marker(target)) is None:
        return "is not a run folder of eigassign" if any(target.iterdir()) else None
    if not marker.run.is_same_case(run):
        return f"holds a run of another case ({marker.run.case_path})"
    return None


@dataclass(frozen=True)
class _Marker:
    run: RunOf
    files: frozenset[str]


def _read_marker(folder: Path) -> _Marker | None:
    try:
        found = json.loads(read_bytes(folder / MARKER, CASE))
        named = {str(k): str(v) for k, v in found.get("case_files", {}).items()}
        run = RunOf(str(found["case_path"]), str(found["case_sha256"]), named)
        return _Marker(run, frozenset(found["files"]))
    except (OSError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        return None


def _publish(folder: Path, target: Path, run: RunOf, *, force: bool) -> None:
    """Mark ``folder`` finished and swap it with ``target``."""
    _write_marker(folder, run)
    sync_tree(folder)
    _require_still_ours(target, run, force=force)
    with _kept_aside(target, run):
        old = put_in_place(folder, target)
    if old is not None:
        _dispose(old, target, run, force=force)
    sync_path(target.parent)


def _require_still_ours(target: Path, run: RunOf, *, force: bool) -> None:
    reason = _objection(target, run)
    if reason and not force:
        raise StorageError(f"{target} {reason}: it appeared during this run and was left alone")


@contextlib.contextmanager
def _kept_aside(target: Path, run: RunOf) -> Iterator[None]:
    """Move files that no run wrote out of the way first, so that no step can delete them."""
    if not _is_worth_keeping(target, run):
        yield
        return
    aside = _free_sibling(target)
    os.rename(target, aside)
    try:
        yield
    except BaseException:
        if not os.path.lexists(target):
            os.rename(aside, target)
        raise
    _log.warning("kept what was in %s before as %s", target, aside)


def _is_worth_keeping(path: Path, run: RunOf) -> bool:
    """Foreign, of another case, or with files that its run did not list."""
    if _objection(path, run):
        return True
    marker = _read_marker(path)
    return marker is not None and bool(_files(path) - marker.files)


def _write_marker(folder: Path, run: RunOf) -> None:
    content = {
        "eigassign_run": _MARKER_SCHEMA,
        "case_path": run.case_path,
        "case_sha256": run.case_sha256,
        "case_files": dict(run.case_files),
        "files": sorted(_files(folder) | {MARKER}),
    }
    write_synced(folder / MARKER, (json.dumps(content, indent=2) + "\n").encode())


def _files(folder: Path) -> set[str]:
    return {p.relative_to(folder).as_posix() for p in folder.rglob("*") if not p.is_dir()}


def _dispose(old: Path, target: Path, run: RunOf, *, force: bool) -> None:
    """Delete the earlier run just swapped out; put back what came there a moment ago."""
    reason = _objection(old, run)
    if reason and not force:
        newest = put_in_place(old, target)
        if newest is not None:
            shutil.rmtree(newest, ignore_errors=True)
        _require_still_ours(target, run, force=force)
    if reason:
        os.rename(old, _free_sibling(target))
    else:
        shutil.rmtree(old, ignore_errors=True)


def _free_sibling(target: Path) -> Path:
    number = 1
    while os.path.lexists(target.with_name(f"{target.name}.{number}")):
        number += 1
    return target.with_name(f"{target.name}.{number}")


def _remove_leftovers(target: Path) -> None:
    """Remove temporary folders of killed runs: nobody holds their lock any more.

    What `put_in_place` had moved away to make room (``-old``) comes back if its place is empty.
    """
    pattern = re.compile(rf"\.{re.escape(target.name)}\.\d+-[0-9a-f]{{8}}(-old)?\.tmp")
    for leftover in filter(lambda path: pattern.fullmatch(path.name), target.parent.iterdir()):
        with contextlib.suppress(OSError):
            if not leftover.is_dir() or time.time() - leftover.stat().st_mtime < _YOUNG_S:
                continue
            with try_lock(leftover) as ours:
                if leftover.name.endswith("-old.tmp") and not os.path.lexists(target):
                    os.rename(leftover, target)
                elif ours:
                    shutil.rmtree(leftover, ignore_errors=True)


def _relative(case_path: Path, target: Path) -> str:
    case = os.path.realpath(case_path)
    try:
        return Path(os.path.relpath(case, target)).as_posix()
    except ValueError:  # another drive
        return Path(case).as_posix()
