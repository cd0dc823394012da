"""Choices that stand in a CSV file, put where those of the case file would stand.

A file has a line for each: its name in the first column, whatever that is called, its values in
columns named by their paths, with units in the header, and a column `price` if each has one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from eigassign.case.reader import Finding, Tree, dotted, items
from eigassign.case.rules.files import NamedFile
from eigassign.case.rules.properties import NoPropertyError, known_property, property_at
from eigassign.case.schema.design import PRICE
from eigassign.case.table import CsvColumn, read_table, read_words
from eigassign.case.units import PLAIN
from eigassign.errors import MechanismError


def with_listed_choices(tree: Tree, named: Sequence[NamedFile]) -> tuple[Tree, list[Finding]]:
    """``tree`` with the content of those ``named`` files that list choices, in SI; what is wrong.

    A file that cannot be read lists nothing.
    """
    findings: list[Finding] = []
    for each in named:
        match each.path:
            case ("design", str(name), "choices", "file"):
                try:
                    read = dict(_choices(tree, Path(each.file), dotted(each.path)))
                except MechanismError as error:
                    findings.append((each.path, error.message))
                    continue
                design = dict(items(tree, "design"))
                entry = {**dict(items(design, name)), "choices": read}
                tree = {**tree, "design": {**design, name: entry}}
    return tree, findings


def _choices(tree: Tree, file: Path, key: str) -> Iterator[tuple[str, Mapping[str, float]]]:
    """Yield each choice by its name. Raises MechanismError at ``key``."""
    header = read_words(file, key)[0][1]
    name, *paths = (cell.partition("[")[0].strip() for cell in header)
    if name == PRICE or known_property(tree, name):
        message = f"{file.name}: the first column names the choices: put one before {name}"
        raise MechanismError(key, message)
    for cell, path in zip(header[1:], paths, strict=True):
        if path == PRICE != cell:
            message = f"{file.name}: column {cell}: prices are plain numbers: call it {PRICE}"
            raise MechanismError(key, message)
    columns = [CsvColumn(name)]
    for path in paths:
        try:
            asked = None if path == PRICE else property_at(tree, path)
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
