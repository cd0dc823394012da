"""A run folder is written whole or not at all, and never at the cost of something else.

A run is written into a hidden folder beside its target, synced, and exchanged with what is there in
a single step. What may give way to it:

- nothing there, or an empty folder;
- a finished run of the same case file, which is as it was written: it is deleted;
- a finished run of the same case file of which somebody edited, added or deleted a file: it is kept
  beside the new one as ``<name>.1``;
- anything else only with ``force``, and then it is kept as ``<name>.1`` too: nothing that a run
  did not write is ever deleted.

The hidden names, of a writer with the token ``<pid>-<8 hex digits>``:

    .<name>.<token>.tmp    being written, or being deleted: nobody misses it
    .<name>.<token>.new    the finished run, until it is exchanged; then what was at the target
    .<name>.<token>.old0   what was at the target, where two renames take the place of the exchange

`_settle` deletes them, keeps them aside or puts them back: at the end of a run, or after a kill at
the start of the next run in the same parent folder.
"""

from __future__ import annotations

import contextlib
import logging
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from eigassign.errors import StorageError
from eigassign.output.store.atomic import (
    abandoned,
    names_of,
    put_in_place,
    remove,
    sync_path,
    sync_tree,
    temporary,
    token_of,
)
from eigassign.output.store.run_record import (
    RunOf,
    is_untouched,
    read_record,
    relative_path,
    write_record,
)

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

    ``key`` and ``outcome``, as it is at the exit, stand in run.json; see `run_record`.
    Any exception, interrupt or full disk inside leaves ``target`` as it was. Of two writers of
    one target the last one wins whole. Raises StorageError where ``target`` may not be replaced
    (checked on entry already) or cannot be written.
    """
    target = Path(os.path.realpath(target))
    run = RunOf(relative_path(case_path, target), key)
    with _storage_errors(target):
        settle_killed(target.parent)
        require_replaceable(target, run, force=force, case_path=case_path)
        made = [path for path in (target.parent, *target.parent.parents) if not path.exists()]
        target.parent.mkdir(parents=True, exist_ok=True)
        try:
            with temporary(target, Path.mkdir) as folder:
                yield folder
                write_record(folder, run, token_of(folder), outcome)
                _publish(folder, target, run, force=force)
        finally:
            for parent in made:  # of a run that failed they are empty
                with contextlib.suppress(OSError):
                    parent.rmdir()


def settle_killed(folder: Path) -> None:
    """Delete, keep aside or put back what killed runs left in ``folder``."""
    for hidden, target in abandoned(folder):
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
    if (record := read_record(target)) is None:
        return "is not a run folder of eigassign" if any(target.iterdir()) else None
    if not record.run.is_same_case(run):
        return f"holds a run of another case ({record.run.case_path})"
    return None


def _publish(folder: Path, target: Path, run: RunOf, *, force: bool) -> None:
    """Exchange the finished ``folder`` with ``target``."""
    sync_tree(folder)
    if (reason := _objection(target, run)) and not force:
        raise StorageError(f"{target} {reason}: it appeared during this run and was left alone")
    new = folder.with_suffix(".new")
    try:
        os.rename(folder, new)
        put_in_place(new, target)
        sync_path(target.parent)
    finally:
        with contextlib.ExitStack() as rest:  # whatever becomes of one of them
            for hidden in names_of(new):
                rest.callback(_settle, hidden, target)


def _settle(hidden: Path, target: Path) -> None:
    """Delete a run that was never published or has been replaced; else put back or keep aside.

    Two processes may settle the same at once: each step is a rename, which one of them makes.
    """
    with contextlib.suppress(FileNotFoundError):
        if hidden.suffix != ".tmp":
            record = read_record(hidden)
            published = record is None or record.token != token_of(hidden)
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
        remove(hidden)


def _is_replaced(old: Path, target: Path) -> bool:
    """Whether ``target`` has a run of the case of ``old``, and nobody changed anything in ``old``.

    An empty folder can always be replaced.
    """
    if not old.is_dir():
        return False
    record, new = read_record(old), read_record(target)
    if record is None:
        return not any(old.iterdir())
    return new is not None and new.run.is_same_case(record.run) and is_untouched(old)


def _free_sibling(target: Path) -> Path:
    number = 1
    while os.path.lexists(target.with_name(f"{target.name}.{number}")):
        number += 1
    return target.with_name(f"{target.name}.{number}")
