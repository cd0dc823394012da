"""Choices and sections that stand in a CSV file, put where those of the case file would stand.

A file has a line for each: its name in the first column, whatever that is called, its values in
columns named by their paths, of sections by their keys, with units in the header, and a column
`price` if each has one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from eigassign.case.reader import Finding, Tree, dotted, items
from eigassign.case.rules.files import NamedFile
from eigassign.case.rules.properties import NoPropertyError, known_property, property_at
from eigassign.case.schema.design import PRICE
from eigassign.case.suggestions import unknown
from eigassign.case.table import CsvColumn, read_table, read_words
from eigassign.case.units import PLAIN
from eigassign.errors import MechanismError


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
