"""Files that the case names.

A case may come from somebody else. So the files that it names lie below its own folder, links
followed, unless whoever runs it says otherwise; and what is no file of a sensible size is refused
before anything is read of it.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from eigassign.case.reader import (
    Finding,
    KeyPath,
    Tree,
    at,
)
from eigassign.files import MATRIX, MESH, TABLE, objection, printable

_SPARE = ("measurements", "sweep")
_MATRIX = ("stiffness", "mass")  # keys that may name a matrix in a file
_VARIABLE = re.compile(r"(.*\.\w+):([A-Za-z]\w{0,62})", re.DOTALL)
_SUPERELEMENT = ("mechanism", "links", "*superelement")
_PLACES: tuple[tuple[KeyPath, int], ...] = (  # where files are named, and how large they may be
    (("trajectory", "file"), TABLE),
    (("trajectory", "*", "file"), TABLE),
    (("targets", "*", "*", "file"), TABLE),
    (("targets", "*", "keep_out", "of", "file"), TABLE),
    (("measurements", "file"), TABLE),
    (("sweep", "file"), TABLE),
    *(((*_SUPERELEMENT, key), MATRIX) for key in (*_MATRIX, "file", "nodes_file")),
    ((*_SUPERELEMENT, "nodes_file", "*"), MATRIX),
    (("mechanism", "links", "*solid", "mesh"), MESH),
)


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
    for place, limit in _PLACES:
        for path, name in _at(tree, place):
            if isinstance(name, str):
                file, variable = os.path.abspath(folder / name), ""
                if path[-1] in _MATRIX:
                    file, variable = split_variable(file)
                found.append(NamedFile(path, file, limit, path[0] in _SPARE, variable))
    return found


def _at(node: object, place: KeyPath, path: KeyPath = ()) -> Iterator[tuple[KeyPath, object]]:
    """Key path and content of what stands at a ``place``: * is any key or entry, *solid any solid.

    Of a trajectory with a tip, `file` is a key too many.
    """
    if not place:
        yield path, node
        return
    known: dict[str | int, object] = dict(node) if isinstance(node, Mapping) else {}
    known |= dict(enumerate(node)) if isinstance(node, tuple) else {}
    star, _, kind = str(place[0]).partition("*")
    for key, inner in known.items():
        if (key == place[0] and "tip" not in known) or (
            not star and (not kind or at(inner, "type") == kind)
        ):
            yield from _at(inner, place[1:], (*path, key))


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
