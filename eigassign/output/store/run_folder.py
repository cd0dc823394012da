"""A run folder is written whole or not at all, and never at the cost of something else.

run.json is written last, so a folder that has it was finished. Its hash is one of all that it says
and of the content of all files that it lists: it tells whether anybody has changed them since.

A run is written into a hidden folder beside its target, synced, and exchanged with what is there in
a single step. What may give way to it:

- nothing there, or an empty folder;
- a finished run of the same case file, which is as it was written: it is deleted;
- a finished run of the same case file of which somebody edited, added or deleted a file: it is kept
  beside the new one as ``<name>.1``;
- anything else only with ``force``, and then it is kept as ``<name>.1`` too: nothing that a run
  did not write is ever deleted.

A run that Ctrl-C ended with the best design so far goes to ``<name>.unfinished`` by the same rules,
whatever is there is moved aside as with ``force``: it never takes the place of a finished run.

The hidden names, of a writer with the token ``<pid>-<8 hex digits>``:

    .<name>.<token>.tmp    being written, or being deleted: nobody misses it
    .<name>.<token>.new    the finished run, until it is exchanged; then what was at the target
    .<name>.<token>.old0   what was at the target, where two renames take the place of the exchange

`_settle` deletes them, keeps them aside or puts them back: at the end of a run, or after a kill at
the start of the next run in the same parent folder.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import json
import logging
import os
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import eigassign.output.store.atomic as atomic
from eigassign._version import __version__
from eigassign.errors import StorageError
from eigassign.files import CASE, MATRIX, json_value, name_of, pieces, read_bytes, seen_from

MARKER = "run.json"
UNFINISHED = "unfinished"  # in the outcome of such a run, and the end of its folder's name
_HOW = "Choose another folder with --out, or use --force to move it aside"
_SCHEMA = 3  # of run.json: of earlier ones no file is vouched for


class RunOf(NamedTuple):
    """The case of a run; ``case_path`` is relative to the folder, so that both may move.

    ``key`` is a hash of all that the numbers of the run come from.
    """

    case_path: str
    key: str

    def is_same_case(self, other: RunOf) -> bool:
        """Same file (perhaps edited since), or same content (perhaps moved since)."""
        return self.case_path == other.case_path or self.key == other.key


class RunRecord(NamedTuple):
    """What run.json says: ``token`` tells this run from every other one, ``outcome`` how it ended.

    ``content`` is all of it but its hash, ``seal``.
    """

    run: RunOf
    token: str
    files: Sequence[str]  # all but run.json
    outcome: Any
    content: Mapping[str, Any]
    seal: str


def write_record(folder: Path, run: RunOf, token: str, outcome: Mapping[str, Any]) -> None:
    """Mark ``folder`` finished, with all that is in it."""
    content = {
        "eigassign_run": _SCHEMA,
        "eigassign_version": __version__,
        "token": token,
        **run._asdict(),
        "outcome": dict(outcome),
        "files": sorted(_contents(folder)),
    }
    sealed = {**content, "sha256": _seal(folder, content)}
    text = json.dumps(sealed, indent=2, allow_nan=False)
    atomic.write_synced(folder / MARKER, f"{text}\n".encode())


def _seal(folder: Path, content: Mapping[str, Any]) -> str:
    """SHA-256 of ``content`` and its files; raises OSError for links and for over a gigabyte."""
    found = hashlib.sha256(json.dumps(content).encode())
    for name in content["files"]:
        if (folder / name).is_symlink():
            raise OSError(errno.ELOOP, os.strerror(errno.ELOOP), name)
        own = hashlib.sha256()
        for piece in pieces(folder / name, MATRIX):
            own.update(piece)
        found.update(own.hexdigest().encode())
    return found.hexdigest()


def read_record(folder: Path) -> RunRecord | None:
    """The record of a finished run; None where there is none that can be read."""
    try:
        content = json_value(read_bytes(folder / MARKER, CASE))
        run = RunOf(name_of(content["case_path"]), str(content.get("key")))
        seal, token = content.pop("sha256", ""), str(content.get("token"))
        files = [*map(name_of, content["files"])]
        seal = str(seal) if content["eigassign_run"] == _SCHEMA else ""
        return RunRecord(run, token, files, content.get("outcome"), content, seal)
    except (OSError, ValueError, LookupError, TypeError, AttributeError):
        return None


def is_whole(folder: Path, record: RunRecord) -> bool:
    """True where every file of the run is there as it was written, whatever else there is."""
    try:
        return record.seal != "" and _seal(folder, record.content) == record.seal
    except OSError:
        return False


def is_untouched(folder: Path) -> bool:
    """True where there is a finished run, as it was written: no file edited, added or deleted."""
    record = read_record(folder)
    if record is None or _contents(folder) != {*record.files, MARKER}:
        return False
    return is_whole(folder, record)


def _contents(folder: Path) -> set[str]:
    """Paths of all files, links and empty folders below ``folder``."""
    found = set()
    for root, folders, files in os.walk(folder):
        below = Path(root).relative_to(folder)
        links = [name for name in folders if Path(root, name).is_symlink()]
        found |= {(below / name).as_posix() for name in (*files, *links)}
        if not folders and not files and below.parts:
            found.add(below.as_posix())
    return found


_log = logging.getLogger(__name__)


@contextlib.contextmanager
def run_folder(
    target: Path,
    *,
    case_path: Path,
    key: str,
    outcome: Mapping[str, Any] = MappingProxyType({}),
    force: bool = False,
) -> Iterator[Path]:
    """Yield an empty hidden folder to fill; on a clean exit it becomes ``target``.

    ``key`` and ``outcome``, as it is at the exit, stand in run.json; one with `UNFINISHED` becomes
    `unfinished_beside` ``target``.
    Any exception, interrupt or full disk inside leaves ``target`` as it was. Of two writers of
    one target the last one wins whole. Raises StorageError where ``target`` may not be replaced
    (checked on entry already) or cannot be written.
    """
    target = Path(os.path.realpath(target))
    run = RunOf(seen_from(target, os.path.realpath(case_path)), key)
    with _storage_errors(target):
        settle_killed(target.parent)
        require_replaceable(target, run, force=force, case_path=case_path)
        made = [path for path in (target.parent, *target.parent.parents) if not path.exists()]
        target.parent.mkdir(parents=True, exist_ok=True)
        try:
            with atomic.temporary(target, Path.mkdir) as folder:
                yield folder
                write_record(folder, run, atomic.token_of(folder), outcome)
                if outcome.get(UNFINISHED):
                    target, force = unfinished_beside(target), True
                _publish(folder, target, run, force=force)
        finally:
            for parent in made:  # of a run that failed they are empty
                with contextlib.suppress(OSError):
                    parent.rmdir()


def unfinished_beside(target: Path) -> Path:
    """Where an unfinished run of ``target`` goes."""
    return target.with_name(f"{target.name}.{UNFINISHED}")


def settle_killed(folder: Path) -> None:
    """Delete, keep aside or put back what killed runs left in ``folder``."""
    for hidden, target in atomic.abandoned(folder):
        if hidden.is_dir() or hidden.suffix != ".tmp":
            _settle(hidden, target)


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
    keep = {"the working folder": Path.cwd(), "the case file": Path(os.path.realpath(case_path))}
    for name, path in keep.items():
        if target == path or target in path.parents:
            raise StorageError(f"{target} holds {name} and cannot become a run folder; use --out")
    reason = _objection(target, run)
    if reason and not force:
        raise StorageError(f"{target} {reason}; it was left alone. {_HOW}")


def _objection(target: Path, run: RunOf) -> str | None:
    """Why what is at ``target`` may not be replaced unasked; None if it may."""
    if not os.path.lexists(target):
        return None
    if not target.is_dir():
        return "is a file, not a folder"
    if (record := read_record(target)) is None:
        return "is not a run folder of eigassign" if any(target.iterdir()) else None
    if not record.run.is_same_case(run):
        return f"holds a run of another case ({record.run.case_path})"
    return None


def put_page(page: Path, data: bytes, *, force: bool) -> None:
    """Write a page beside runs, in place of an earlier one; what is no page of ours stays.

    With ``force`` it is moved aside. Raises StorageError, also for a place inside a run folder.
    """
    folder, ours = Path(os.path.realpath(page.parent)), b'<meta name="generator" content="eigassign'
    if any(map(read_record, (folder, *folder.parents))):
        raise StorageError(f"{folder} is a run folder or in one; choose another with --out")
    page.parent.mkdir(parents=True, exist_ok=True)
    if os.path.lexists(page) and not (page.is_file() and ours in read_bytes(page, MATRIX)):
        if not force:
            raise StorageError(f"{page} is no page of eigassign; it was left alone. {_HOW}")
        os.rename(page, _free_sibling(page))
    atomic.replace_synced(page, data)


def _publish(folder: Path, target: Path, run: RunOf, *, force: bool) -> None:
    """Exchange the finished ``folder`` with ``target``."""
    atomic.sync_tree(folder)
    if (reason := _objection(target, run)) and not force:
        raise StorageError(f"{target} {reason}: it appeared during this run and was left alone")
    new = target.with_name(f".{target.name}.{atomic.token_of(folder)}.new")
    try:
        os.rename(folder, new)
        atomic.put_in_place(new, target)
        atomic.sync_path(target.parent)
    finally:
        with contextlib.ExitStack() as rest:  # whatever becomes of one of them
            for hidden in atomic.names_of(new):
                rest.callback(_settle, hidden, target)


def _settle(hidden: Path, target: Path) -> None:
    """Delete an unpublished or replaced run, else put back or aside; by renames: two may race."""
    with contextlib.suppress(FileNotFoundError):
        if hidden.suffix != ".tmp":
            record = read_record(hidden)
            published = record is None or record.token != atomic.token_of(hidden)
            if published and not os.path.lexists(target):
                os.rename(hidden, target)
                return
            if published and not _is_replaced(hidden, target):
                aside = _free_sibling(target)
                try:
                    os.rename(hidden, aside)
                except FileNotFoundError:
                    raise
                except OSError as error:
                    kept = f"what was in {target} before is kept in {hidden}, until the next run"
                    raise StorageError(f"{kept}: {error.strerror}") from error
                _log.warning("kept what was in %s before as %s", target, aside)
                return
            doomed = hidden.with_name(f"{hidden.name}.tmp")
            os.rename(hidden, doomed)
            hidden = doomed
        atomic.remove(hidden)


def _is_replaced(old: Path, target: Path) -> bool:
    """Whether ``target`` has a run of the case of ``old``, which is empty or as it was written."""
    if not old.is_dir():
        return False
    record, new = read_record(old), read_record(target)
    if record is None:
        return not any(old.iterdir())
    return new is not None and new.run.is_same_case(record.run) and is_untouched(old)


def _free_sibling(target: Path) -> Path:
    number = 1
    while os.path.lexists(aside := target.with_name(f"{target.name}.{number}")):
        number += 1
    return aside
