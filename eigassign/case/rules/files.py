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
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from eigassign.case.reader import (
    Finding,
    KeyPath,
    Tree,
    at,
    dotted,
    items,
    listed,
    suggestion,
    unknown,
)
from eigassign.case.rules.properties import NoPropertyError, property_at, quantities
from eigassign.case.schema.design import PRICE
from eigassign.case.schema.document import validated
from eigassign.case.schema.links import SHAPES
from eigassign.case.schema.parts import Quantity
from eigassign.case.table import CsvColumn, read_table, read_words
from eigassign.case.units import PLAIN
from eigassign.errors import MechanismError
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
    (("mechanism", "sections", "*", "file"), TABLE),
    (("design", "*", "choices", "file"), TABLE),  # with what sections are by then
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


def with_listed(tree: Tree, named: Sequence[NamedFile], folder: Path) -> tuple[Tree, list[Finding]]:
    """``tree`` with the sections and choices that ``named`` files list, in SI; what is wrong there.

    A file that cannot be read lists nothing, nor do choices of a mechanism of wrong form.
    """
    findings: list[Finding] = []
    for each in named:
        file, key = Path(each.file), dotted(each.path)
        try:
            match each.path:
                case ("mechanism", "sections", str(name), "file"):
                    own = dict(items(tree, "mechanism", "sections", name))
                    profile = str(own.get("name"))
                    read = dict(_lines(file, key, partial(_of_section, name, own.get("shape"))))
                    if profile not in read:
                        message = unknown("profile", profile, read)
                        findings.append(((*each.path[:-1], "name"), message))
                        continue
                    lines = own | {k: v for k, v in read[profile].items() if k != PRICE}
                    tree = _put(
                        tree,
                        each.path[:3],
                        {k: lines[k] for k in lines if k not in ("file", "name")},
                    )
                case ("design", str(name), "choices", "file"):
                    document, _ = validated({**tree, "design": {}, "targets": ()}, folder)
                    if document is not None:
                        asked = partial(property_at, document)
                        tree = _put(tree, each.path[:3], dict(_lines(file, key, asked)))
        except MechanismError as error:
            findings.append((each.path, error.message))
    return tree, findings


def _of_section(name: str, shape: object, key: str) -> Quantity:
    model = SHAPES.get(shape if isinstance(shape, str) else "bare")
    known = quantities(model) if model else {}
    if key not in known:
        message = f"sections.{name} has no property {key!r}{suggestion(key, known)}"
        raise NoPropertyError(f"{message}; can vary: {listed(known)}")
    return known[key]


def _put(tree: Any, place: KeyPath, value: object) -> Any:
    """``tree`` with ``value`` at ``place``."""
    if not place:
        return value
    first, *rest = place
    return {**tree, first: _put(tree[first], tuple(rest), value)}


def _lines(
    file: Path, key: str, quantity: Callable[[str], Quantity]
) -> Iterator[tuple[str, Mapping[str, float]]]:
    """Yield the values of each line by its name, of columns that are each a ``quantity``.

    Raises MechanismError at ``key``.
    """
    header = read_words(file, key)[0][1]
    name, *paths = (cell.partition("[")[0].strip() for cell in header)
    columns = []
    for cell, path in zip(header, (name, *paths), strict=True):
        try:
            asked = None if path == PRICE else quantity(path)
        except NoPropertyError as error:
            if path == name:
                columns.append(CsvColumn(name))
                continue
            raise MechanismError(key, f"{file.name}: column {path}: {error}") from None
        if path == name:
            message = f"{file.name}: the first column names the choices: put one before {name}"
            raise MechanismError(key, message)
        if path == PRICE != cell:
            message = f"{file.name}: column {cell}: prices are plain numbers: call it {PRICE}"
            raise MechanismError(key, message)
        columns.append(CsvColumn(path, ((asked and asked.dimension) or PLAIN,)))
    table = read_table(file, key, columns)
    lines: dict[str, str] = {}
    for k, choice in enumerate(table.words[name]):
        if choice in lines:
            message = f"{table.where(k)}: {choice!r} is listed already, in {lines[choice]}"
            raise MechanismError(key, message)
        lines[choice] = table.where(k)
        yield choice, {path: table.numbers[path][k] for path in paths}
