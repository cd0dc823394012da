"""The files that a case names: matrices of superelements, samples of a trajectory, a chart."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

from eigassign.case.document import Document
from eigassign.case.trajectory_list import named_trajectories
from eigassign.errors import StorageError

CHUNK = 1 << 20


def attached(document: Document, folder: Path) -> dict[str, str]:
    """SHA-256 of each, by its name as seen from the case's folder.

    Raises StorageError for a file that cannot be read.
    """
    paths = [path for _, _, path in named_trajectories(document.trajectory)]
    named: list[object] = [getattr(path, "file", None) for path in paths]
    named.append(document.expansion.chart)
    for link in document.mechanism.links.values():
        if link.type == "superelement":
            named += [link.stiffness, link.mass]
    return {_seen_from(folder, str(file)): _digest(str(file)) for file in named if file is not None}


def _seen_from(folder: Path, file: str) -> str:
    try:
        return Path(os.path.relpath(file, folder)).as_posix()
    except ValueError:  # another drive
        return Path(file).as_posix()


def _digest(file: str) -> str:
    digest = hashlib.sha256()
    try:
        with open(file, "rb") as stream:
            while piece := stream.read(CHUNK):
                digest.update(piece)
    except OSError as error:
        raise StorageError(f"{file}: cannot be read: {error.strerror}") from error
    return digest.hexdigest()
