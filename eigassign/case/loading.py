"""Path → CaseFile, or all problems of the file at once.

    bytes or mapping → reader → tree → schema → document → rules → CaseFile

The schema looks at the form of the whole file, the rules at what its parts have in common once the
form is right. Each tells all that it finds at once.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice
from pathlib import Path
from typing import Any

from eigassign.case.case_file import CaseFile
from eigassign.case.reader import Source, read_mapping, read_yaml
from eigassign.case.rules.consistency import inconsistent, keys_have_values, too_many
from eigassign.case.rules.files import (
    NamedFile,
    named_files,
    not_allowed,
    unreadable,
    with_listed,
)
from eigassign.case.rules.plausibility import implausible
from eigassign.case.rules.properties import starts_outside, with_value
from eigassign.case.rules.values import followed_designs
from eigassign.case.schema.document import Document, validated
from eigassign.case.schema.parts import FrozenDict
from eigassign.case.values import with_values
from eigassign.errors import CaseError, Problem, StorageError, UsageError
from eigassign.files import CASE, file_digest, objection, read_bytes, seen_from

NO_VALUES: Mapping[str, object] = FrozenDict()
MOST_PROBLEMS = 100  # shown; of each kind of check twice as many are looked at


@dataclass(frozen=True)
class Unchecked:
    """A case file as it is written: its bytes, and the tree in them."""

    path: Path
    data: bytes
    source: Source

    @property
    def sha256(self) -> str:
        """SHA-256 of its bytes."""
        return hashlib.sha256(self.data).hexdigest()

    @cached_property
    def _without_sweep(self) -> tuple[Mapping[str, Any], str]:
        """The tree without its `sweep`, and the same as text."""
        tree = {key: body for key, body in self.source.tree.items() if key != "sweep"}
        return tree, json.dumps(tree)

    def content(self) -> str:
        """SHA-256 of what it says, its `sweep` apart, and of every file it names.

        Comments, the form of its lines, and places of files count for nothing.
        """
        tree, said = self._without_sweep
        digests = _digests(named_files(tree, self.path.parent), self.path.parent)
        return hashlib.sha256(" ".join([said, *digests.values()]).encode()).hexdigest()


def load(path: str | Path, allow_outside: bool = False) -> CaseFile:
    """The case file at ``path``; ``allow_outside``: it may name files outside its folder.

    Raises CaseError with every problem of the file, UsageError if ``path`` is not a file or one too
    large, and StorageError if it cannot be read.
    """
    return checked(read(path), allow_outside)


def parse(data: bytes, path: str | Path, allow_outside: bool = False) -> CaseFile:
    """The case file with content ``data``; ``path`` names it and anchors relative paths in it."""
    return checked(_parsed(data, Path(path)), allow_outside)


def read(path: str | Path) -> Unchecked:
    """The case file at ``path`` before its keys are looked at; raises as `load` does."""
    path = Path(path)
    try:
        data = read_bytes(path, CASE)
    except (FileNotFoundError, NotADirectoryError, ValueError):
        meant = f"; did you mean {path}.yaml?" if os.path.isfile(f"{path}.yaml") else ""
        raise UsageError(f"{path}: no such case file{meant}") from None
    except OSError as error:
        if error.errno in (errno.EINVAL, errno.EFBIG):
            raise UsageError(f"{path}: expected a case file: {error.strerror}") from None
        raise StorageError(f"{path}: cannot be read: {error.strerror}") from error
    return _parsed(data, path)


_DEGREES = re.compile(rb"\d\s*(deg\b|\xc2\xb0|\\u00b0)")  # as YAML has them, and JSON


def _parsed(data: bytes, path: Path) -> Unchecked:
    try:
        return Unchecked(path, data, read_yaml(data, str(path)))
    except CaseError as error:
        raise CaseError(_first(error.problems)) from None


def from_mapping(
    given: Mapping[str, Any], path: str | Path = "case", allow_outside: bool = False
) -> CaseFile:
    """The case with the content ``given`` in place of a file.

    Values are as in a file, ``"30 mm"`` or 0.03; ``path`` names it and anchors relative paths.
    Raises CaseError with every problem, by its key.
    """
    source = read_mapping(given, str(path))
    written = Unchecked(Path(path), json.dumps(source.tree).encode(), source)
    return checked(written, allow_outside)


def checked(
    written: Unchecked, allow_outside: bool = False, values: Mapping[str, object] = NO_VALUES
) -> CaseFile:
    """The case with these ``values`` in place of its own, by dotted key; raises CaseError.

    Each key is in the file, or may be: see `values.objection`.
    """
    source, path = written.source, written.path
    if values:
        source = replace(source, tree=with_values(source.tree, values))
    if crowded := [source.problem(*finding) for finding in too_many(source.tree)]:
        raise CaseError(tuple(crowded))
    named = named_files(source.tree, path.parent)
    bad = [] if allow_outside else [*not_allowed(named, path.parent)]
    bad = bad or [*unreadable([each for each in named if not each.spare])]
    unread = {place for place, _ in bad}
    tree, more = with_listed(source.tree, [n for n in named if n.path not in unread], path.parent)
    unread |= {place for place, _ in more} | {n.path for n in named if n.path[0] == "design"}
    document, schema_findings = validated(tree, path.parent)
    empty = {place[:3] for place in unread if "sections" in place}  # which a file would have filled
    findings = [*bad, *more]
    for place, why in (*islice(keys_have_values(tree), 2 * MOST_PROBLEMS), *schema_findings):
        if place not in unread and place[:3] not in empty:
            findings.append((place, why))
    if document is not None and not findings:
        findings = [*islice(inconsistent(document), 2 * MOST_PROBLEMS)]
    problems = [*source.problems, *(source.problem(*finding) for finding in findings)]
    if problems or document is None:
        raise CaseError(_first(list(dict.fromkeys(problems))))
    for place, value in [*followed_designs(document)]:
        document = with_value(document, place, value)
    return _case_file(document, source, written, values, named)


def _first(problems: Sequence[Problem]) -> tuple[Problem, ...]:
    """The first hundred of them, in the order of the file."""
    if len(problems) <= MOST_PROBLEMS:
        return tuple(problems)
    first = sorted(problems, key=lambda p: (p.line, p.column))[:MOST_PROBLEMS]
    last = first[-1]
    more = "… and more problems; mend these first"
    return (*first, Problem(last.file, last.line, last.column + 1, "", more))


def _case_file(
    document: Document,
    source: Source,
    written: Unchecked,
    values: Mapping[str, object],
    named: Sequence[NamedFile],
) -> CaseFile:
    path = written.path
    content = {name: getattr(document, name) for name in Document.model_fields}
    doubts = [*implausible(document), *starts_outside(document)]
    doubts += unreadable([each for each in named if each.spare])
    warnings = [source.problem(*finding) for finding in doubts]
    return CaseFile(
        **content,
        path=path,
        sha256=written.sha256,
        warnings=tuple(sorted(warnings, key=lambda p: (p.line, p.column, p.path))),
        marks=source.marks,
        files=_digests(named, path.parent),
        variant=values,
        in_degrees=_in_degrees(source, written.data),
    )


def _in_degrees(source: Source, data: bytes) -> bool:
    """True of a case that writes angles so: its point of expansion, or any other."""
    expansion = source.tree.get("expansion")
    q = expansion.get("q") if isinstance(expansion, Mapping) else None
    bare = isinstance(q, tuple) and any(not isinstance(each, str) and each for each in q)
    return not bare and _DEGREES.search(data) is not None


def _digests(named: Sequence[NamedFile], folder: Path) -> dict[str, str]:
    """SHA-256 of each file that is there, by its name as seen from ``folder``.

    Raises StorageError for one that is there and cannot be read.
    """
    digests = {}
    for each in named:
        if (sha := file_digest(each.file, each.limit)) is not None:
            digests[seen_from(folder, each.file)] = sha
        elif objection(each.file, each.limit) is None:
            raise StorageError(f"{each.file}: cannot be read: no permission, or the disk fails")
    return digests
