"""What a batch runs, in order: case files, the variants of each, and a name and a key for each.

    files and folders → cases_in → plan_of → BatchPlan: Variant 0, 1, 2, …

A key is the SHA-256 of all that the numbers of a case come from: what its file and the files it
names say, its own values, and the version. So a result is known again wherever it stands.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
from bisect import bisect_right
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import accumulate
from pathlib import Path

from eigassign._version import __version__
from eigassign.batch.variants import AS_IT_STANDS, OPTION, Variants, variants_of
from eigassign.case.case_file import Unchecked, read
from eigassign.case.reader import NUMBER, dotted, key_path, short_keys
from eigassign.case.schema.study import text_of
from eigassign.errors import EigassignError, Problem, StorageError, UsageError
from eigassign.files import MATRIX, file_digest, folder_name, once
from eigassign.modal.expansion import ALGORITHM
from eigassign.output.batch.index import NAMES
from eigassign.output.store.run_folder import MARKER

STUDY = "cheap"  # of what an answer means; see pipeline.run.Options


@dataclass(frozen=True)
class Variant:
    """One case of a batch: a case file, with these values in place of its own."""

    index: int
    name: str  # of its folder
    path: str  # of the case file
    values: Mapping[str, object]  # by dotted key
    key: str


@dataclass(frozen=True)
class PlannedFile:
    """A case file of a batch."""

    path: str
    name: str
    content: str  # SHA-256 of what it says, of the version and of what else changes numbers
    variants: Variants = AS_IT_STANDS
    prefix: str = ""  # of the names of variants
    is_set: bool = False  # the variants are from --set

    def variant(self, k: int, index: int) -> Variant:
        """Its k-th variant, which is the ``index``-th of the batch."""
        values = self.variants[k]
        key = key_of(self.content, values, Path(self.path).parent)
        name = self.prefix + self._named(values) if values else self.name
        return Variant(index, name, self.path, values, key)

    def _named(self, values: Mapping[str, object]) -> str:
        """``mass=100g,frequency=180Hz``; what does not say all ends with digits of a hash of it."""
        texts = {key: text_of(value) for key, value in values.items()}
        exact = ",".join(f"{self._short[key]}={text}" for key, text in texts.items())
        rounded = NUMBER.sub(_six_digits, exact) if _LONG.search(exact) else exact
        is_alone = not any(text in self._twins[key] for key, text in texts.items())
        return folder_name(exact, _UNSAFE.sub("_", rounded), is_alone)

    @cached_property
    def _short(self) -> Mapping[str, str]:
        return short_keys(self.variants.keys)

    @cached_property
    def _twins(self) -> Mapping[str, set[str]]:
        """Values of a key that differ by case alone, as folders on macOS and Windows cannot."""
        found = {}
        for key, column in zip(self.variants.keys, self.variants.columns, strict=True):
            texts = {text_of(value) for value in column if not isinstance(value, (int, float))}
            counts = Counter(map(str.casefold, texts))
            found[key] = {text for text in texts if counts[text.casefold()] > 1}
        return found


@dataclass(frozen=True)
class BatchPlan:
    """The cases of a batch in order: ``plan[k]`` is made when it is asked for."""

    files: tuple[PlannedFile, ...]

    def __len__(self) -> int:
        return self._ends[-1]

    def __getitem__(self, index: int) -> Variant:
        if not 0 <= index < len(self):
            raise IndexError(index)
        file, k = self.whose(index)
        return file.variant(k, index)

    def whose(self, index: int) -> tuple[PlannedFile, int]:
        """The case file of a variant, and which of its variants it is."""
        n = bisect_right(self._ends, index) - 1
        return self.files[n], index - self._ends[n]

    @cached_property
    def _ends(self) -> tuple[int, ...]:
        return tuple(accumulate((len(file.variants) for file in self.files), initial=0))

    @property
    def is_swept(self) -> bool:
        """True where a case file has variants."""
        return any(file.variants.keys for file in self.files)


def plan_of(cases: Sequence[Path], settings: Sequence[str] = ()) -> BatchPlan:
    """The plan of these case files, each with what ``--set`` says (``settings``), else its sweep.

    A case file that cannot be read is a case of its own, which will fail. Raises CaseError for a
    wrong sweep.
    """
    names = folder_names(cases)
    several = len(cases) > 1
    named = zip(cases, names, strict=True)
    return BatchPlan(tuple(_planned(case, name, settings, several) for case, name in named))


def _planned(case: Path, name: str, settings: Sequence[str], several: bool) -> PlannedFile:
    try:
        written = read(case)
    except EigassignError as error:
        if settings:
            raise
        return PlannedFile(str(case), name, _hash([str(error)]))
    variants = variants_of(written.source, case.parent, settings)
    prefix = f"{name}," if several else ""
    return PlannedFile(str(case), name, content_of(written), variants, prefix, bool(settings))


def content_of(case: Unchecked) -> str:
    """SHA-256 of what a case file says, and of what else makes its numbers."""
    return _hash([__version__, ALGORITHM, STUDY, case.content()])


def key_of(content: str, values: Mapping[str, object], folder: Path) -> str:
    """Key of the variant of a case in ``folder`` with this `content_of`; files count by content."""
    digests = map(_digest, (folder / text for text in _texts(values)))
    return _hash([content, values, [*filter(None, digests)]])


def _hash(parts: list[object]) -> str:
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()


def _texts(value: object) -> Iterator[str]:
    """Yield all text in a value, which may be the name of a file."""
    if isinstance(value, str):
        yield value
    elif isinstance(value, (Mapping, tuple)):
        for inner in value.values() if isinstance(value, Mapping) else value:
            yield from _texts(inner)


_digest = once(partial(file_digest, limit=MATRIX), 100)


def variant_problem(plan: BatchPlan, index: int, problem: Problem) -> Problem:
    """A problem of a variant at the place where the value at fault was given, else at its own."""
    variant, (file, k) = plan[index], plan.whose(index)
    message = f"{variant.name}: {problem.message}"
    source, variants = read(file.path).source, file.variants
    paths = {key: dotted(key_path(source.tree, key)) for key in variant.values}
    key = next((key for key, path in paths.items() if problem.path.startswith(path)), None)
    if key is None:
        return Problem(problem.file, problem.line, problem.column, problem.path, message)
    if file.is_set:
        return Problem(OPTION, 0, 0, key, message)
    if variants.file:
        return Problem(variants.file, variants.lines[k], 1, key, message)
    return source.problem(("sweep", "parameters", key), message)


# --- Names of variants

_LONG = re.compile(r"[0-9.]{7}")  # what may have more digits than a name has
_UNSAFE = re.compile(r"[^\w.,=+-]")


def _six_digits(number: re.Match[str]) -> str:
    """A number with at most so many."""
    digits = re.sub(r"[eE].*|[-+.]", "", number.group())
    return number.group() if len(digits) <= 6 else f"{float(number.group()):.6g}"


# --- Which case files are meant by files and folders, and a name for the run of each


def cases_in(paths: Sequence[Path]) -> list[Path]:
    """Case files named, and all ``*.yaml``, ``*.yml`` in the folders named, each file once.

    Without ``paths`` those of ./cases itself. Hidden folders and run folders (they hold a resolved
    case) are passed over. Raises UsageError where a path does not exist or there is no case at all,
    StorageError for a folder that cannot be read.
    """
    if not paths:
        paths = sorted(p for p in Path("cases").glob("*.y*ml") if p.suffix in (".yaml", ".yml"))
        if not paths:
            raise UsageError("there are no case files in ./cases: name the cases")
    for path in paths:
        if not path.exists():
            raise UsageError(f"{path}: no such file or folder")
    found = [each for path in paths for each in (_cases_below(path) if path.is_dir() else [path])]
    if not found:
        raise UsageError(f"no case files (*.yaml, *.yml) in {', '.join(map(str, paths))}")
    first = {os.path.realpath(path): path for path in reversed(found)}
    return [path for path in found if first.pop(os.path.realpath(path), None)]


def _cases_below(folder: Path) -> Iterator[Path]:
    def refuse(error: OSError) -> None:
        raise StorageError(f"{error.filename}: cannot be read: {error.strerror}") from error

    for root, folders, files in os.walk(folder, onerror=refuse):
        if MARKER in files:
            folders.clear()
            continue
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        for name in sorted(files):
            if name.endswith((".yaml", ".yml")) and not name.startswith("."):
                yield Path(root, name)


def folder_names(cases: Sequence[Path]) -> list[str]:
    """The files' stems; where two would collide, the path that tells them apart joins in.

    Each is one that every file system allows.
    """
    counts = Counter(case.stem.casefold() for case in cases)
    root = Path(os.path.commonpath([os.path.abspath(case.parent) for case in cases] or ["."]))
    taken = set(NAMES)
    names = []
    for case in cases:
        parts = Path(os.path.abspath(case)).relative_to(root).with_suffix("").parts
        stem = folder_name("-".join(parts) if counts[case.stem.casefold()] > 1 else case.stem)
        free = (stem, *(f"{stem}-{k}" for k in range(2, len(taken) + 3)))
        names.append(next(name for name in free if name.casefold() not in taken))
        taken.add(names[-1].casefold())
    return names
