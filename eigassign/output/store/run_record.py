"""run.json: of which case a run is, and that it is finished and as its run wrote it.

It is written last, so a folder that has it was finished. Its hash is one of all that it says and of
the content of all files that it lists: by it is known whether anybody has changed them since.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from eigassign._version import __version__
from eigassign.files import CASE, MATRIX, json_value, name_of, pieces, read_bytes, seen_from
from eigassign.output.store.atomic import write_synced

MARKER = "run.json"
_SCHEMA = 3  # of run.json: of earlier ones no file is vouched for


@dataclass(frozen=True)
class RunOf:
    """The case of a run; ``case_path`` is relative to the folder, so that both may move.

    ``key`` is a hash of all that the numbers of the run come from.
    """

    case_path: str
    key: str

    def is_same_case(self, other: RunOf) -> bool:
        """Same file (perhaps edited since), or same content (perhaps moved since)."""
        return self.case_path == other.case_path or self.key == other.key


@dataclass(frozen=True)
class RunRecord:
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
        **vars(run),
        "outcome": dict(outcome),
        "files": sorted(_contents(folder)),
    }
    sealed = {**content, "sha256": _seal(folder, content)}
    write_synced(folder / MARKER, (json.dumps(sealed, indent=2, allow_nan=False) + "\n").encode())


def _seal(folder: Path, content: Mapping[str, Any]) -> str:
    """SHA-256 of ``content`` and of the files that it lists.

    Raises OSError where one of them is no file, or a link, or larger than a gigabyte.
    """
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


def relative_path(path: Path, folder: Path) -> str:
    """`seen_from`, links of ``path`` followed."""
    return seen_from(folder, os.path.realpath(path))


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
