"""Files that the case names.

A case may come from somebody else. So the files that it names lie below its own folder, links
followed, unless whoever runs it says otherwise; and what is no file of a sensible size is refused
before anything is read of it.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from functools import reduce
from pathlib import Path
from typing import NamedTuple

from eigassign.case.reader import Finding, KeyPath, Tree, at
from eigassign.case.rules.properties import walk
from eigassign.files import MATRIX, MESH, TABLE, objection, printable

_SPARE = ("measurements", "sweep")
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


def named_files(tree: Tree, folder: Path) -> list[NamedFile]:
    """Files that the case names; relative paths start in ``folder``."""
    found = []
    for path, name in walk(tree):
        if isinstance(name, str) and (limit := _limit(tree, path)):
            file, variable = os.path.abspath(folder / name), ""
            if path[-1] in ("stiffness", "mass"):
                file, variable = split_variable(file)
            found.append(NamedFile(path, file, limit, path[0] in _SPARE, variable))
    return found


def _limit(tree: Tree, path: KeyPath) -> float:
    """How large a file named there may be; 0 where none is. Of tip paths a `file` is too much."""
    match path:
        case ("mechanism", "links", str(link), key, *_):
            keys = {"superelement": ("stiffness", "mass", "file", "nodes_file"), "solid": ("mesh",)}
            kind = str(at(tree, "mechanism", "links", link, "type"))
            return (MESH if key == "mesh" else MATRIX) * (key in keys.get(kind, ()))
        case ("trajectory", *inner, "file"):
            motion = reduce(lambda node, key: node[key], inner, tree["trajectory"])
            return TABLE * ("tip" not in motion)
        case ("targets" | "measurements" | "sweep", *_, "file"):
            return TABLE
    return 0


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
