"""Path → CaseFile: read, put into SI, check against the schema and itself; or every problem.

The files that a case names: matrices of superelements, samples of a trajectory.
"""

from __future__ import annotations

import hashlib
import os
import stat
from collections.abc import Iterable
from itertools import islice
from pathlib import Path

from eigassign.case.case_file import CaseFile
from eigassign.case.reader import MAX_BYTES, Finding, Source, read_yaml
from eigassign.case.rules.consistency import inconsistent, too_many
from eigassign.case.rules.plausibility import implausible
from eigassign.case.rules.properties import bounds_hold_no_impossible_section
from eigassign.case.rules.values import completed
from eigassign.case.schema.document import Document, validated
from eigassign.case.schema.trajectory import named_trajectories
from eigassign.errors import CaseError, Problem, StorageError, UsageError

# --- Path → CaseFile: read, put into SI, check against the schema and itself; or every problem

MOST_PROBLEMS = 100  # shown; of each kind of check twice as many are looked at


def load(path: str | Path) -> CaseFile:
    """The case file at ``path``.

    Raises CaseError with every problem of the file, UsageError if ``path`` is not a file, and
    StorageError if it cannot be read.
    """
    return parse(_bytes_of(Path(path)), Path(path))


def parse(data: bytes, path: str | Path) -> CaseFile:
    """The case file with content ``data``; ``path`` names it and anchors relative paths in it."""
    source = _read(data, Path(path))
    if crowded := [source.problem(*finding) for finding in too_many(source.tree)]:
        raise CaseError(tuple(crowded))
    document, schema_findings = validated(completed(source.tree, Path(path).parent))
    findings = [*islice(inconsistent(source.tree), 2 * MOST_PROBLEMS), *schema_findings]
    if document is not None:
        findings += bounds_hold_no_impossible_section(document.mechanism, document.design)
    problems = _unique([*source.problems, *(source.problem(*f) for f in findings)])
    if problems or document is None:
        raise CaseError(_capped(problems))
    return _case_file(document, source, data, Path(path))


def _read(data: bytes, path: Path) -> Source:
    try:
        return read_yaml(data, str(path))
    except CaseError as error:
        raise CaseError(_capped(list(error.problems))) from None


def _case_file(document: Document, source: Source, data: bytes, path: Path) -> CaseFile:
    content = {name: getattr(document, name) for name in Document.model_fields}
    warnings = _located(implausible(document), source)
    digest = hashlib.sha256(data).hexdigest()
    files = attached(document, path.parent)
    named = {"path": path, "sha256": digest, "files": files}
    return CaseFile(**content, **named, warnings=warnings, marks=source.marks)  # type: ignore[arg-type]


def _located(findings: Iterable[Finding], source: Source) -> tuple[Problem, ...]:
    problems = [source.problem(*finding) for finding in findings]
    return tuple(sorted(problems, key=lambda p: (p.line, p.column, p.path)))


def _unique(problems: list[Problem]) -> list[Problem]:
    return list(dict.fromkeys(problems))


def _capped(problems: list[Problem]) -> tuple[Problem, ...]:
    if len(problems) <= MOST_PROBLEMS:
        return tuple(problems)
    first = sorted(problems, key=lambda p: (p.line, p.column))[:MOST_PROBLEMS]
    last = first[-1]
    more = "… and more problems; mend these first"
    return (*first, Problem(last.file, last.line, last.column + 1, "", more))


def _bytes_of(path: Path) -> bytes:
    try:
        if not stat.S_ISREG(os.stat(path).st_mode):
            what = "a folder" if path.is_dir() else "not a regular file"
            raise UsageError(f"{path}: expected a case file, but it is {what}")
        with open(path, "rb") as file:
            return file.read(MAX_BYTES + 1)
    except (FileNotFoundError, NotADirectoryError, ValueError):
        raise UsageError(f"{path}: no such case file") from None
    except OSError as error:
        raise StorageError(f"{path}: cannot be read: {error.strerror}") from error


# --- The files that a case names: matrices of superelements, samples of a trajectory

CHUNK = 1 << 20


def attached(document: Document, folder: Path) -> dict[str, str]:
    """SHA-256 of each, by its name as seen from the case's folder.

    Raises StorageError for a file that cannot be read.
    """
    paths = [path for _, _, path in named_trajectories(document.trajectory)]
    named: list[object] = [getattr(path, "file", None) for path in paths]
    for link in document.mechanism.links.values():
        if link.type == "superelement":
            named += [link.stiffness, link.mass]
    return {_seen_from(folder, str(file)): _digest(str(file)) for file in named if file is not None}


def _seen_from(folder: Path, file: str) -> str:
    try:
        return Path(os.path.relpath(file, folder)).as_posix()
    except ValueError:  # another drive
        return Path(file).as_posix()


def _digest(file: str) -> str:
    digest = hashlib.sha256()
    try:
        with open(file, "rb") as stream:
            while piece := stream.read(CHUNK):
                digest.update(piece)
    except OSError as error:
        raise StorageError(f"{file}: cannot be read: {error.strerror}") from error
    return digest.hexdigest()
