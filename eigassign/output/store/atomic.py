"""Files and folders that are written whole or not at all, whatever happens in between.

Bytes are on disk before anything points at them; one folder takes another's place in a single
step. What is being written has a hidden name beside its target and is locked: once its writer is
dead, however it died, the lock is free, and the next start sweeps it. No lock needs a file.
"""

from __future__ import annotations

import contextlib
import ctypes
import errno
import hashlib
import os
import re
import secrets
import shutil
import socket
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from eigassign.errors import StorageError

# --- Bytes


def write_synced(path: Path, data: bytes) -> None:
    """Write ``data`` to ``path`` and wait until it is on disk."""
    with open(path, "wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())


def sync_path(path: Path) -> None:
    """Wait until a file or folder is on disk; folders of file systems that cannot are skipped."""
    folder = path.is_dir()
    try:
        descriptor = os.open(path, os.O_RDONLY if folder else os.O_RDWR)
    except PermissionError:  # Windows opens no folders
        return
    try:
        os.fsync(descriptor)
    except OSError:
        if not folder:
            raise
    finally:
        os.close(descriptor)


def sync_tree(folder: Path) -> None:
    """Wait until every file and folder below ``folder``, and itself, is on disk."""
    for root, _, files in os.walk(folder):
        for name in files:
            sync_path(Path(root, name))
        sync_path(Path(root))


def replace_synced(path: Path, data: bytes) -> None:
    """Replace the content of ``path`` by ``data`` in one step, whoever else writes it.

    A temporary file in the same folder is filled, synced and renamed over ``path``; what killed
    writers of the same ``path`` left there goes.
    """
    with replacing(path) as made:
        made.write_bytes(data)


@contextlib.contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """A file to fill, which takes the place of ``path`` at the end as `replace_synced` does it."""
    if "\0" in str(path):  # a ValueError of Python's
        raise OSError(errno.EINVAL, "a null character in its name")
    sweep_files(path.parent, path.name.__eq__)
    with temporary(path, lambda made: made.touch(exist_ok=False)) as made:
        yield made
        sync_path(made)
        os.replace(made, path)
    sync_path(path.parent)


# --- What is being written, and what killed writers left

_TOKEN = r"(?P<token>\d+-(?P<machine>[0-9a-f]{4})?[0-9a-f]{8})"
_HIDDEN = re.compile(rf"\.(?P<name>.+)\.{_TOKEN}(\.[a-z0-9]+)+", re.DOTALL)
_HERE = hashlib.sha256(socket.gethostname().encode()).hexdigest()[:4]


@contextlib.contextmanager
def temporary(target: Path, make: Callable[[Path], None]) -> Iterator[Path]:
    """A file or folder that ``make`` makes beside ``target``, locked; what is left of it goes."""
    while True:
        token = f"{os.getpid()}-{_HERE}{secrets.token_hex(4)}"
        made = target.with_name(f".{target.name}.{token}.tmp")
        try:
            make(made)
            with lock(made, wait=True):
                if os.path.lexists(made):  # else a sweep came between its making and its lock
                    yield made
                    return
        finally:
            remove(made)


def token_of(hidden: Path) -> str:
    """The part of a hidden name that only its writer uses."""
    found = _HIDDEN.fullmatch(hidden.name)
    return found["token"] if found else ""


def remove(path: Path) -> None:
    """Delete a file or a folder with all that is in it, as far as that is possible."""
    with contextlib.suppress(OSError):
        path.unlink()
    shutil.rmtree(path, ignore_errors=True)


def abandoned(folder: Path) -> Iterator[tuple[Path, Path]]:
    """Hidden names of dead writers in ``folder``, locked while looked at, each with its target.

    Some network file systems have locks that other machines do not see: what is of one of these
    is dead after a week.
    """
    with contextlib.suppress(OSError):
        names = [name for name in os.listdir(folder) if name.startswith(".")]
        for path, found in ((folder / name, _HIDDEN.fullmatch(name)) for name in sorted(names)):
            if found:
                with lock(path) as held:
                    is_ours = held and found["machine"] in (None, _HERE)
                    if is_ours or (held is not False and _is_long_dead(path)):
                        yield path, folder / found["name"]


def sweep_files(folder: Path, names: Callable[[str], bool]) -> int:
    """Delete what dead writers of files with such names left in ``folder``; how many."""
    count = 0
    for path, target in abandoned(folder):
        if names(target.name) and not path.is_dir():
            remove(path)
            count += 1
    return count


def _is_long_dead(path: Path) -> bool:
    """True after a week without a change: no run takes so long."""
    try:
        return time.time() - path.lstat().st_mtime > 7 * 86400.0
    except OSError:
        return False


@contextlib.contextmanager
def lock(path: Path, wait: bool = False) -> Iterator[bool | None]:
    """Hold the lock of a file or folder: yields whether it is held, None if it cannot be locked.

    The system lets go of it when its holder dies. Windows and some network file systems have no
    such locks.
    """
    try:
        import fcntl

        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK)  # waits for no pipe
    except (ImportError, OSError):
        yield None
        return
    try:
        held: bool | None = True
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        except BlockingIOError:
            held = False
        except OSError:
            held = None
        yield held
    finally:
        os.close(descriptor)


# --- Folders

_ATTEMPTS = 20  # to get between other writers: of two that go on and on, one waits a few


def put_in_place(new: Path, target: Path) -> None:
    """Move ``new`` to ``target``; what was there has a hidden name with its token then.

    One atomic exchange where the system has it (Linux); else two renames, and who finds nothing at
    ``target`` puts back what was there. Raises StorageError when other writers keep getting in
    between, OSError otherwise.
    """
    for attempt in range(_ATTEMPTS):
        try:
            if not os.path.lexists(target):
                os.rename(new, target)
            elif not exchange(new, target):
                os.rename(target, new.with_suffix(f".old{attempt}"))
                os.rename(new, target)
            return
        except OSError as error:
            if error.errno not in (errno.ENOENT, errno.ENOTEMPTY, errno.EEXIST, errno.ENOTDIR):
                raise
            if not new.exists():
                raise
    raise StorageError(f"{target} is being written by another run; try again")


def names_of(new: Path) -> list[Path]:
    """The hidden names there are of what was to be put in place as ``new``."""
    suffixes = (".tmp", ".new", *(f".old{attempt}" for attempt in range(_ATTEMPTS)))
    return [path for path in map(new.with_suffix, suffixes) if os.path.lexists(path)]


def exchange(first: Path, second: Path) -> bool:
    """Swap two paths in one step; False where the system or the file system cannot."""
    if not sys.platform.startswith("linux"):
        return False
    rename = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if rename is None:
        return False
    here, swap = -100, 2  # AT_FDCWD and RENAME_EXCHANGE of <fcntl.h> and <linux/fs.h>
    if rename(here, os.fsencode(first), here, os.fsencode(second), swap) == 0:
        return True
    code = ctypes.get_errno()
    if code in (errno.EINVAL, errno.ENOSYS, errno.ENOTSUP, errno.EPERM):
        return False
    raise OSError(code, os.strerror(code), str(second))
