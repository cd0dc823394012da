"""Files that a case names: where they are, whether they may be read, and whether they can be.

A case may come from somebody else. So the files that it names lie below its own folder, links
followed, unless whoever runs it says otherwise; and what is no file of a sensible size is refused
before anything is read of it.
"""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from eigassign.case.reader import Finding, KeyPath, Tree, at, text
from eigassign.case.rules.lookups import curves, links, trajectories
from eigassign.files import MATRIX, TABLE, objection, printable

_SPARE = ("measurements", "sweep")


class NamedFile(NamedTuple):
    """A file that the case names: its key, absolute path and largest size in bytes.

    ``spare``: of all commands that run a case only one needs it, `update` or `batch`.
    """

    path: KeyPath
    file: str
    limit: int
    spare: bool


def named_files(tree: Tree, folder: Path) -> list[NamedFile]:
    """Files that the case names; relative paths start in ``folder``."""
    tables = [(path, body, "file") for path, body in trajectories(tree) if at(body, "tip") is None]
    tables += [(path, body, "file") for path, body in curves(tree)]
    tables += [((key,), at(tree, key), "file") for key in _SPARE]
    matrices = [
        (path, body, key)
        for _, path, body in links(tree, "superelement")
        for key in ("stiffness", "mass")
    ]
    found = []
    for group, limit in ((tables, TABLE), (matrices, MATRIX)):
        for path, body, key in group:
            if (file := text(body, key)) is not None:
                place = os.path.abspath(folder / file)
                found.append(NamedFile((*path, key), place, limit, path[0] in _SPARE))
    return found


def not_allowed(named: Sequence[NamedFile], folder: Path) -> Iterator[Finding]:
    """Files that do not lie below ``folder``."""
    root = os.path.realpath(folder)
    for each in named:
        if "\0" in each.file:  # no file has such a name: see `unreadable`
            continue
        place = os.path.realpath(each.file)
        if not Path(place).is_relative_to(root):
            yield (
                each.path,
                f"{printable(each.file)} lies outside the folder of the case file: put it there, "
                "or add --allow-outside to the command (in Python allow_outside=True)",
            )


def unreadable(named: Sequence[NamedFile]) -> Iterator[Finding]:
    """Files that are not there, no files, or too large."""
    for each in named:
        if (reason := objection(each.file, each.limit)) is not None:
            yield each.path, f"no such file: {printable(each.file)} ({reason})"
