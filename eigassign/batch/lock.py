"""One lock file a folder: who is at work there, and at which of its cases.

Its single bytes are locked (``fcntl.lockf``), so that the system lets go of them with the process
that holds them, however that ends:

    byte 0      who is at work: held alone while the folder is set up, then shared
    byte 1      a line of the manifest is being written
    byte 2      the summaries are being written
    byte 3 + k  case k is in flight

Windows and some network file systems have no such locks. There one batch at a time is on its word.
"""

from __future__ import annotations

import contextlib
import os
import socket
import time
from collections.abc import Iterator
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

from eigassign.errors import StorageError

NAME = ".lock"
_PRESENCE, _LINE, _SUMMARIES, _CASES = range(4)


class FolderLock:
    """The lock of a batch folder, held by this process; see `folder_lock`."""

    def __init__(self, folder: Path, descriptor: int) -> None:
        self._folder, self._file = folder, descriptor
        self._fcntl: Any = None
        with contextlib.suppress(ImportError):
            import fcntl

            self._fcntl = fcntl

    def enter(self, join: bool) -> bool:
        """True where this process is the first at work here, and alone until `share`.

        With ``join`` it waits until the first one has set up the folder; else raises StorageError
        where anybody is at work.
        """
        if not (first := self._try(_PRESENCE)):
            if not join:
                os.lseek(self._file, 0, os.SEEK_SET)
                others = os.read(self._file, 1000).decode(errors="replace").splitlines()
                message = f"another batch is running in {self._folder} ({', '.join(others)}): wait"
                raise StorageError(f"{message} for it, use another --out, or help it with --join")
            while not self._try(_PRESENCE, shared=True):
                time.sleep(0.1)
        else:
            os.ftruncate(self._file, 0)
        os.lseek(self._file, 0, os.SEEK_END)
        os.write(self._file, f"process {os.getpid()} on {socket.gethostname()}\n".encode())
        return first

    def share(self) -> None:
        """The folder is set up: others may join."""
        self._try(_PRESENCE, shared=True)

    def claim(self, case: int) -> bool:
        """Take a case; False where another process has it in flight."""
        return self._try(_CASES + case)

    def release(self, case: int) -> None:
        """Let go of a case."""
        self._unlock(_CASES + case)

    def line(self) -> AbstractContextManager[None]:
        """Held while a line of the manifest is written."""
        return self._alone(_LINE)

    def summaries(self) -> AbstractContextManager[None]:
        """Held while the summaries are written."""
        return self._alone(_SUMMARIES)

    @contextlib.contextmanager
    def _alone(self, byte: int) -> Iterator[None]:
        """Wait until no other process holds it."""
        if self._fcntl is not None:
            with contextlib.suppress(OSError):
                self._fcntl.lockf(self._file, self._fcntl.LOCK_EX, 1, byte)
        try:
            yield
        finally:
            self._unlock(byte)

    def _try(self, byte: int, shared: bool = False) -> bool:
        if self._fcntl is None:
            return True
        kind = self._fcntl.LOCK_SH if shared else self._fcntl.LOCK_EX
        try:
            self._fcntl.lockf(self._file, kind | self._fcntl.LOCK_NB, 1, byte)
        except (BlockingIOError, PermissionError):  # the systems differ in which
            return False
        except OSError:  # a file system without locks
            return True
        return True

    def _unlock(self, byte: int) -> None:
        if self._fcntl is not None:
            with contextlib.suppress(OSError):
                self._fcntl.lockf(self._file, self._fcntl.LOCK_UN, 1, byte)


@contextlib.contextmanager
def folder_lock(folder: Path) -> Iterator[FolderLock]:
    """The lock of a batch folder, which is there; nothing is locked before `FolderLock.enter`."""
    try:
        descriptor = os.open(folder / NAME, os.O_RDWR | os.O_CREAT, 0o666)
    except OSError as error:
        raise StorageError(f"{folder / NAME}: cannot be opened: {error.strerror}") from error
    try:
        yield FolderLock(folder, descriptor)
    finally:
        os.close(descriptor)
