"""Files and folders that are written whole or not at all, whatever happens in between.

Bytes are on disk before anything points at them; one folder takes another's place in a single
step; the lock on a folder is held while its writer lives, and needs no file.
"""

from __future__ import annotations

import contextlib
import ctypes
import errno
import os
import secrets
import sys
from collections.abc import Iterator
from pathlib import Path

from eigassign.errors import StorageError

# --- Bytes


def write_synced(path: Path, data: bytes) -> None:
    """Create ``path`` (which must not exist) with ``data`` and wait until it is on disk."""
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0)
    descriptor = os.open(path, flags, 0o666)  # 0o666 and not mkstemp's 0o600: umask decides
    with os.fdopen(descriptor, "wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())


def sync_path(path: Path) -> None:
    """Wait until a file or folder is on disk; folders of file systems that cannot are skipped."""
    try:
        descriptor = os.open(path, os.O_RDONLY)
    except PermissionError:  # Windows opens no folders
        return
    try:
        with contextlib.suppress(OSError):
            os.fsync(descriptor)
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

    A temporary file in the same folder is filled, synced and renamed over ``path``.
    """
    temporary = path.with_name(temporary_name(path.name))
    try:
        write_synced(temporary, data)
        os.replace(temporary, path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
    sync_path(path.parent)


def temporary_name(name: str) -> str:
    """Hidden sibling name that no other writer uses."""
    return f".{name}.{os.getpid()}-{secrets.token_hex(4)}.tmp"


# --- Folders

_RENAME_EXCHANGE = 2
_AT_FDCWD = -100
_ATTEMPTS = 20


def put_in_place(new: Path, target: Path) -> Path | None:
    """Move ``new`` to ``target``; returns where what was there is now, None if nothing was.

    One atomic exchange where the system has it (Linux); else two renames, undone if the second
    fails. Raises StorageError when other writers keep getting in between, OSError otherwise.
    """
    for _ in range(_ATTEMPTS):
        try:
            if not os.path.lexists(target):
                os.rename(new, target)
                return None
            if exchange(new, target):
                return new
            return _rename_twice(new, target)
        except OSError as error:
            if error.errno not in (errno.ENOENT, errno.ENOTEMPTY, errno.EEXIST, errno.ENOTDIR):
                raise
            if not new.exists():
                raise
    raise StorageError(f"{target} is being written by another run; try again")


def exchange(first: Path, second: Path) -> bool:
    """Swap two paths in one step; False where the system or the file system cannot."""
    if not sys.platform.startswith("linux"):
        return False
    rename = getattr(ctypes.CDLL(None, use_errno=True), "renameat2", None)
    if rename is None:
        return False
    paths = (_AT_FDCWD, os.fsencode(first), _AT_FDCWD, os.fsencode(second))
    if rename(*paths, _RENAME_EXCHANGE) == 0:
        return True
    code = ctypes.get_errno()
    if code in (errno.EINVAL, errno.ENOSYS, errno.ENOTSUP, errno.EPERM):
        return False
    raise OSError(code, os.strerror(code), str(second))


def _rename_twice(new: Path, target: Path) -> Path:
    old = new.with_name(new.name.removesuffix(".tmp") + "-old.tmp")
    os.rename(target, old)
    try:
        os.rename(new, target)
    except BaseException:
        os.rename(old, target)
        raise
    return old


@contextlib.contextmanager
def try_lock(folder: Path) -> Iterator[bool]:
    """Hold the lock of ``folder`` if nobody else does; yields whether it is held.

    The system lets go of it when its holder dies, however it dies. Where folders cannot be
    locked (Windows, some network file systems) it is never held.
    """
    try:
        import fcntl

        descriptor = os.open(folder, os.O_RDONLY)
    except (ImportError, OSError):
        yield False
        return
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            held = True
        except OSError:
            held = False
        yield held
    finally:
        os.close(descriptor)
