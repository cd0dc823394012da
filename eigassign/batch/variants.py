"""Variants of a case: the same file with other values of some keys, as `sweep` or ``--set`` says.

    tree with its sweep → Variants: keys, and the values of each variant

A key is a dotted path into the file: `mechanism.bodies.tool.mass`, `targets.0.frequency`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

from eigassign.case.case_file import key_objection
from eigassign.case.reader import Finding, Source, Tree, key_path, read_yaml, resolve
from eigassign.case.schema.document import validated_part
from eigassign.case.schema.study import MOST, Range, Sweep, text_of
from eigassign.case.table import read_words
from eigassign.errors import CaseError, MechanismError, Problem

# --- The values of each variant


@dataclass(frozen=True)
class Variants:
    """The variants of one case in order: a value of each key for each of them.

    ``columns`` has the values of each key: the k-th ones belong ``together``, or every combination
    of them is a variant, the last key changing fastest.
    """

    keys: tuple[str, ...]
    columns: tuple[tuple[Any, ...], ...]
    together: bool = False
    file: str = ""  # the CSV file they are from, a line of ``lines`` for each
    lines: tuple[int, ...] = ()

    def __len__(self) -> int:
        return len(self.columns[0]) if self.together else math.prod(map(len, self.columns))

    def __getitem__(self, index: int) -> dict[str, object]:
        """The values of one variant by key."""
        if self.together:
            row = [column[index] for column in self.columns]
        else:
            row = []
            for column in reversed(self.columns):
                index, k = divmod(index, len(column))
                row.insert(0, column[k])
        return dict(zip(self.keys, row, strict=True))


AS_IT_STANDS = Variants((), ())  # one, without values


def variants_of(source: Source, folder: Path, settings: Sequence[str] = ()) -> Variants:
    """The variants that ``settings`` say, else the `sweep` of the case, else the case as it stands.

    ``folder`` is that of the case file, ``settings`` are as written behind ``--set``. Raises
    CaseError for a wrong sweep, and for a key that no case could have.
    """
    given = {"parameters": _set(settings)} if settings else source.tree.get("sweep")
    if given is None:
        return AS_IT_STANDS
    sweep, findings = validated_part(Sweep, given, None, "sweep")
    if sweep is not None:
        try:
            found = _spread(sweep, folder)
            findings = [*_wrong_keys(source.tree, folder, found)]
            findings = findings or [*_overlaps(source.tree, found), *_repeated(found)]
        except MechanismError as error:
            findings = [(tuple(error.path.split(".")), error.message)]
    if findings:
        problems = [source.problem(*finding) for finding in findings]
        if settings:
            paths = (problem.path.removeprefix("sweep.parameters.") for problem in problems)
            given_as = zip(paths, problems, strict=True)
            problems = [Problem(OPTION, 0, 0, path, problem.message) for path, problem in given_as]
        raise CaseError(tuple(problems))
    return found


def _spread(sweep: Sweep, folder: Path) -> Variants:
    if sweep.file is not None:
        file = folder / sweep.file
        (_, keys), *rows = read_words(file, "sweep.file")
        cells = zip(*(map(resolve, row) for _, row in rows), strict=True)
        lines = tuple(line for line, _ in rows)
        return Variants(tuple(keys), tuple(cells), True, file.name, lines)
    bodies = sweep.parameters or {}
    columns = (body.values if isinstance(body, Range) else body for body in bodies.values())
    found = Variants(tuple(bodies), tuple(columns), sweep.sample == "list")
    if len(found) > MOST:
        raise MechanismError("sweep.parameters", f"{len(found)} variants: at most {MOST}")
    return found


def _wrong_keys(tree: Tree, folder: Path, variants: Variants) -> Iterator[Finding]:
    """Keys that the file does not have, and that it could not have either."""
    for key, value in variants[0].items():
        if (why := key_objection(tree, folder, key, value)) is not None:
            if variants.file:
                yield ("sweep", "file"), f"{variants.file}:1: column {key}: {why}"
            else:
                yield ("sweep", "parameters", key), why


def _overlaps(tree: Tree, variants: Variants) -> Iterator[Finding]:
    """Keys whose values do not last, since a later key stands in the same place or around it."""
    paths = {key: key_path(tree, key) for key in variants.keys}
    for k, (key, path) in enumerate(paths.items()):
        later = variants.keys[k + 1 :]
        other = next((o for o in later if path[: len(paths[o])] == paths[o]), None)
        if other is not None:
            what = "is the same key" if paths[other] == path else "overwrites it: write that first"
            place = ("sweep", "file") if variants.file else ("sweep", "parameters", key)
            yield place, f"{other!r} {what}"


def _repeated(variants: Variants) -> Iterator[Finding]:
    """The first variant whose values are those of one before; a grid has none."""
    seen: dict[tuple[str, ...], int] = {}
    for k, row in enumerate(zip(*variants.columns, strict=True) if variants.together else ()):
        if (first := seen.setdefault(tuple(map(text_of, row)), k)) != k:
            if variants.file:
                line, before = variants.lines[k], variants.lines[first]
                yield ("sweep", "file"), f"{variants.file}:{line}: has the values of line {before}"
            else:
                why = f"variant {k + 1} has the values of variant {first + 1}"
                yield ("sweep", "parameters"), why
            return


# --- What --set says

OPTION = "--set"
_RANGE = re.compile(r"(?P<min>[^,]+?)\s*\.\.\s*(?P<max>[^,]+?)(?:\s*:\s*(?P<count>[0-9]+))?")


def _set(settings: Sequence[str]) -> dict[str, object]:
    """``KEY=V1,V2`` and ``KEY=MIN..MAX:COUNT`` as `parameters` of a sweep."""
    found: dict[str, object] = {}
    for setting in settings:
        key, equals, values = (part.strip() for part in setting.partition("="))
        if not equals or not key or not values:
            _refuse(setting, "expected KEY=VALUE,VALUE or KEY=MIN..MAX:COUNT")
        if key in found:
            _refuse(key, "is given twice: write all values behind one --set")
        found[key] = _values(key, values)
    return found


def _values(key: str, values: str) -> object:
    if span := _RANGE.fullmatch(values):
        if span["count"] is None:
            _refuse(key, f"the number of values is missing: {values}:5 means five, with both ends")
        ends = {"min": resolve(span["min"]), "max": resolve(span["max"])}
        return {**ends, "count": int(span["count"])}
    try:
        return read_yaml(f"values: [{values}]".encode(), OPTION).tree["values"]
    except CaseError as error:
        _refuse(key, error.problems[0].message)


def _refuse(key: str, message: str) -> NoReturn:
    raise CaseError((Problem(OPTION, 0, 0, key, message),))
