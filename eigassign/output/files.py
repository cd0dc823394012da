"""Writing bytes so that they are on disk before anything points at them."""

from __future__ import annotations

import contextlib
import os
import secrets
from pathlib import Path


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
    """Make ``path`` hold ``data``, whole or not at all, whoever else writes it.

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
