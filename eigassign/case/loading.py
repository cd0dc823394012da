"""Path → CaseFile, or all problems of the file at once.

    bytes → reader → tree → values in SI → schema → document → CaseFile
                       └→ rules

The schema and the rules both look at the whole file, so that nobody mends a file twice.
"""

from __future__ import annotations

import hashlib
import os
import stat
from collections.abc import Sequence
from itertools import islice
from pathlib import Path

from eigassign.case.case_file import CaseFile
from eigassign.case.reader import MAX_BYTES, Source, read_yaml
from eigassign.case.rules.consistency import inconsistent, too_many
from eigassign.case.rules.plausibility import implausible
from eigassign.case.rules.properties import (
    bounds_hold_no_impossible_section,
    load_cases_have_possible_sections,
    starts_outside,
)
from eigassign.case.rules.values import completed
from eigassign.case.schema.document import Document, validated
from eigassign.case.schema.measurements import MeasurementFile
from eigassign.case.schema.targets import FrequencyFile
from eigassign.case.schema.trajectory import FileTrajectory, named_trajectories
from eigassign.errors import CaseError, Problem, StorageError, UsageError

MOST_PROBLEMS = 100  # shown; of each kind of check twice as many are looked at


def load(path: str | Path) -> CaseFile:
    """The case file at ``path``.

    Raises CaseError with every problem of the file, UsageError if ``path`` is not a file, and
    StorageError if it cannot be read.
    """
    path = Path(path)
    try:
        if not stat.S_ISREG(os.stat(path).st_mode):
            what = "a folder" if path.is_dir() else "not a regular file"
            raise UsageError(f"{path}: expected a case file, but it is {what}")
        with open(path, "rb") as file:
            data = file.read(MAX_BYTES + 1)
    except (FileNotFoundError, NotADirectoryError, ValueError):
        raise UsageError(f"{path}: no such case file") from None
    except OSError as error:
        raise StorageError(f"{path}: cannot be read: {error.strerror}") from error
    return parse(data, path)


def parse(data: bytes, path: str | Path) -> CaseFile:
    """The case file with content ``data``; ``path`` names it and anchors relative paths in it."""
    path = Path(path)
    try:
        source = read_yaml(data, str(path))
    except CaseError as error:
        raise CaseError(_first(error.problems)) from None
    if crowded := [source.problem(*finding) for finding in too_many(source.tree)]:
        raise CaseError(tuple(crowded))
    document, schema_findings = validated(completed(source.tree, path.parent))
    findings = [*islice(inconsistent(source.tree), 2 * MOST_PROBLEMS), *schema_findings]
    if document is not None:
        parts, motions = (document.mechanism, document.design), document.trajectory
        findings += bounds_hold_no_impossible_section(*parts)
        findings += load_cases_have_possible_sections(*parts, named_trajectories(motions))
    problems = [*source.problems, *(source.problem(*finding) for finding in findings)]
    if problems or document is None:
        raise CaseError(_first(list(dict.fromkeys(problems))))
    return _case_file(document, source, data, path)


def _first(problems: Sequence[Problem]) -> tuple[Problem, ...]:
    """The first hundred of them, in the order of the file."""
    if len(problems) <= MOST_PROBLEMS:
        return tuple(problems)
    first = sorted(problems, key=lambda p: (p.line, p.column))[:MOST_PROBLEMS]
    last = first[-1]
    more = "… and more problems; mend these first"
    return (*first, Problem(last.file, last.line, last.column + 1, "", more))


def _case_file(document: Document, source: Source, data: bytes, path: Path) -> CaseFile:
    content = {name: getattr(document, name) for name in Document.model_fields}
    doubts = [*implausible(document), *starts_outside(source.tree, document.design)]
    warnings = [source.problem(*finding) for finding in doubts]
    return CaseFile(
        **content,
        path=path,
        sha256=hashlib.sha256(data).hexdigest(),
        warnings=tuple(sorted(warnings, key=lambda p: (p.line, p.column, p.path))),
        marks=source.marks,
        files=attached(document, path.parent),
    )


def attached(document: Document, folder: Path) -> dict[str, str]:
    """SHA-256 of each file that the case names, by its name as seen from the case's folder.

    Raises StorageError for a file that cannot be read.
    """
    motions = [motion for _, _, motion in named_trajectories(document.trajectory)]
    named = [motion.file for motion in motions if isinstance(motion, FileTrajectory)]
    curves = [curve for target in document.targets for _, curve in target.frequencies]
    named += [curve.file for curve in curves if isinstance(curve, FrequencyFile)]
    if isinstance(document.measurements, MeasurementFile):
        named.append(document.measurements.file)
    for link in document.mechanism.links.values():
        if link.type == "superelement":
            named += [link.stiffness, link.mass]
    return {_seen_from(folder, file): _digest(file) for file in named}


def _seen_from(folder: Path, file: str) -> str:
    try:
        return Path(os.path.relpath(file, folder)).as_posix()
    except ValueError:  # another drive
        return Path(file).as_posix()


def _digest(file: str) -> str:
    try:
        with open(file, "rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        raise StorageError(f"{file}: cannot be read: {error.strerror}") from error
