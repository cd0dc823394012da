"""Files that the case names, and choices listed in a file.

A case may come from somebody else. So the files that it names lie below its own folder, links
followed, unless whoever runs it says otherwise; and what is no file of a sensible size is refused
before anything is read of it.

A file has a line for each: its name in the first column, whatever that is called, its values in
columns named by their paths, of sections by their keys, with units in the header, and a column
`price` if each has one.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from eigassign.case.reader import Finding, KeyPath, Tree, at, dotted, entries, items
from eigassign.case.rules.lookups import curves, design_entries, links, trajectories
from eigassign.case.rules.properties import NoPropertyError, known_property, property_at
from eigassign.case.schema.design import PRICE
from eigassign.case.suggestions import unknown
from eigassign.case.table import CsvColumn, read_table, read_words
from eigassign.case.units import PLAIN
from eigassign.errors import MechanismError
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


def with_listed_choices(tree: Tree, named: Sequence[NamedFile]) -> tuple[Tree, list[Finding]]:
    """``tree`` with the content of those ``named`` files that list choices, in SI; what is wrong.

    A file that cannot be read lists nothing.
    """
    findings: list[Finding] = []
    for each in named:
        place = [str(key) for key in each.path[:-1]]
        match each.path:
            case ("design", _, "choices", "file"):
                owner = ""
            case ("mechanism", "sections", str(name), "file"):
                owner = f"sections.{name}."
            case _:
                continue
        try:
            read: Mapping[str, Any] = dict(
                _choices(tree, Path(each.file), dotted(each.path), owner)
            )
        except MechanismError as error:
            findings.append((each.path, error.message))
            continue
        if owner:
            own = dict(items(tree, *place))
            del own["file"]
            profile = str(own.pop("name", None))
            if profile not in read:
                findings.append(((*place, "name"), unknown("profile", profile, read)))
                continue
            read = own | {key: value for key, value in read[profile].items() if key != PRICE}
        tree = _put(tree, place, read)
    return tree, findings


def _put(tree: Tree, place: Sequence[str], value: object) -> Tree:
    """``tree`` with ``value`` at ``place``."""
    first, *rest = place
    inner = {**dict(items(tree, first))}
    return {**tree, first: _put(inner, rest, value) if rest else value}


def _choices(
    tree: Tree, file: Path, key: str, owner: str = ""
) -> Iterator[tuple[str, Mapping[str, float]]]:
    """Yield each choice by its name, of ``owner``. Raises MechanismError at ``key``."""
    header = read_words(file, key)[0][1]
    name, *paths = (cell.partition("[")[0].strip() for cell in header)
    if name == PRICE or known_property(tree, name):
        message = f"{file.name}: the first column names the choices: put one before {name}"
        raise MechanismError(key, message)
    for cell, path in zip(header[1:], paths, strict=True):
        if path == PRICE != cell:
            message = f"{file.name}: column {cell}: prices are plain numbers: call it {PRICE}"
            raise MechanismError(key, message)
    if owner:  # which has them from here
        place = ["mechanism", *owner.split(".")[:-1]]
        tree = _put(tree, place, dict(items(tree, *place)) | dict.fromkeys(paths, 1.0))
    columns = [CsvColumn(name)]
    for path in paths:
        try:
            asked = None if path == PRICE else property_at(tree, owner + path)
        except NoPropertyError as error:
            raise MechanismError(key, f"{file.name}: column {path}: {error}") from None
        dimension = None if asked is None else asked.dimension
        columns.append(CsvColumn(path, (dimension or PLAIN,)))
    table = read_table(file, key, columns)
    lines: dict[str, str] = {}
    for k, choice in enumerate(table.words[name]):
        if choice in lines:
            message = f"{table.where(k)}: {choice!r} is listed already, in {lines[choice]}"
            raise MechanismError(key, message)
        lines[choice] = table.where(k)
        yield choice, {path: table.numbers[path][k] for path in paths}
