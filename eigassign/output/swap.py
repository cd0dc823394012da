"""Putting one folder in the place of another, and knowing whether its owner still lives."""

from __future__ import annotations

import contextlib
import ctypes
import errno
import os
import sys
from collections.abc import Iterator
from pathlib import Path

from eigassign.errors import StorageError

_RENAME_EXCHANGE = 2
_AT_FDCWD = -100
_ATTEMPTS = 20


def put_in_place(new: Path, target: Path) -> Path | None:
    """Make ``new`` be ``target``; where something was there, return where that is now.

    One atomic exchange where the system has it (Linux); else two renames, undone if the second
    fails. Raises StorageError when other writers keep getting in between, OSError otherwise.
    """
    for _ in range(_ATTEMPTS):
        try:
            if not os.path.lexists(target):
                os.rename(new, target)
                return None
            if _exchange(new, target):
                return new
            return _rename_twice(new, target)
        except OSError as error:
            if error.errno not in (errno.ENOENT, errno.ENOTEMPTY, errno.EEXIST, errno.ENOTDIR):
                raise
            if not new.exists():
                raise
    raise StorageError(f"{target} is being written by another run; try again")


def _exchange(first: Path, second: Path) -> bool:
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
