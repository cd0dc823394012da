"""Files that a case names: where they are, whether they may be read, and whether they can be.

A case may come from somebody else. So the files that it names lie below its own folder, links
followed, unless whoever runs it says otherwise; and what is no file of a sensible size is refused
before anything is read of it.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

from eigassign.case.reader import Finding, KeyPath, Tree, at, entries, items
from eigassign.case.rules.lookups import curves, design_entries, links, trajectories
from eigassign.files import MATRIX, MESH, TABLE, objection, printable

_SPARE = ("measurements", "sweep")
_MATRIX = ("stiffness", "mass")  # keys that may name a matrix in a file
_VARIABLE = re.compile(r"(.*\.\w+):([A-Za-z]\w{0,62})", re.DOTALL)


class NamedFile(NamedTuple):
    """A file that the case names: its key, absolute path and largest size in bytes.

    ``spare``: of all commands that run a case only one needs it, `update` or `batch`.
    ``variable``: the matrix in it that is meant, where the case names one.
    """

    path: KeyPath
    file: str
    limit: int
    spare: bool
    variable: str = ""

    @property
    def value(self) -> str:
        """What the case would write with an absolute path."""
        return f"{self.file}:{self.variable}" if self.variable else self.file


def named_files(tree: Tree, folder: Path) -> list[NamedFile]:
    """Files that the case names; relative paths start in ``folder``."""
    tables = [(path, body, "file") for path, body in trajectories(tree) if at(body, "tip") is None]
    tables += [(path, body, "file") for path, body in curves(tree)]
    tables += [((key,), at(tree, key), "file") for key in _SPARE]
    lists = ((name, at(body, "choices")) for name, body in design_entries(tree))
    tables += [(("design", name, "choices"), body, "file") for name, body in lists]
    sections = items(tree, "mechanism", "sections")
    tables += [(("mechanism", "sections", name), body, "file") for name, body in sections]
    matrices = [
        (path, body, key)
        for _, path, body in links(tree, "superelement")
        for key in (*_MATRIX, "file", "nodes_file")
    ]
    meshes = [(path, body, "mesh") for _, path, body in links(tree, "solid")]
    found = []
    for group, limit in ((tables, TABLE), (matrices, MATRIX), (meshes, MESH)):
        for path, body, key in group:
            listed = enumerate(entries(body, key))
            given = [((*path, key), at(body, key)), *(((*path, key, k), f) for k, f in listed)]
            for place, name in given:
                if isinstance(name, str):
                    file, variable = os.path.abspath(folder / name), ""
                    if key in _MATRIX:
                        file, variable = split_variable(file)
                    found.append(NamedFile(place, file, limit, path[0] in _SPARE, variable))
    return found


def split_variable(name: str) -> tuple[str, str]:
    """``parts.mat:K`` as the file and the name of a matrix in it, "" where there is none."""
    found = _VARIABLE.fullmatch(name)
    return (found.group(1), found.group(2)) if found else (name, "")


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
