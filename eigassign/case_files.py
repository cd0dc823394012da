"""Which case files are meant by files and folders, and a name for the run of each."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from pathlib import Path

from eigassign.errors import StorageError, UsageError


def default_cases() -> list[Path]:
    """The case files of ./cases itself; UsageError where there is none."""
    folder = Path("cases")
    found = sorted(p for p in folder.glob("*.y*ml") if p.suffix in (".yaml", ".yml"))
    if not found:
        raise UsageError("cases: no such file or folder, or no case files in it; name some")
    return found


def cases_in(paths: Sequence[Path]) -> list[Path]:
    """`find_cases`; UsageError where a path does not exist or there is no case at all."""
    for path in paths:
        if not path.exists():
            raise UsageError(f"{path}: no such file or folder")
    if not (found := find_cases(paths)):
        raise UsageError(f"no case files (*.yaml, *.yml) in {', '.join(map(str, paths))}")
    return found


def find_cases(paths: Sequence[Path]) -> list[Path]:
    """Case files named, and all ``*.yaml``, ``*.yml`` in the folders named, each file once.

    Hidden folders and run folders (they hold a resolved case) are passed over. Raises StorageError
    for a folder that cannot be read.
    """
    found = [each for path in paths for each in (_in(path) if path.is_dir() else [path])]
    first = {os.path.realpath(path): path for path in reversed(found)}
    return [path for path in found if first.pop(os.path.realpath(path), None)]


def _in(folder: Path) -> Iterator[Path]:
    from eigassign.output.run_folder import MARKER

    for root, folders, files in os.walk(folder, onerror=_unreadable):
        if MARKER in files:
            folders.clear()
            continue
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        for name in sorted(files):
            if name.endswith((".yaml", ".yml")) and not name.startswith("."):
                yield Path(root, name)


def _unreadable(error: OSError) -> None:
    raise StorageError(f"{error.filename}: cannot be read: {error.strerror}") from error


def folder_names(cases: Sequence[Path]) -> list[str]:
    """The files' stems; where two would collide, the path that tells them apart joins in."""
    stems = [case.stem for case in cases]
    clashing = {
        s.casefold() for s in stems if [t.casefold() for t in stems].count(s.casefold()) > 1
    }
    root = Path(os.path.commonpath([os.path.abspath(case.parent) for case in cases] or ["."]))
    taken = {"summary.csv", "junit.xml"}
    names = []
    for case, stem in zip(cases, stems, strict=True):
        parts = Path(os.path.abspath(case)).relative_to(root).with_suffix("").parts
        name = _free("-".join(parts) if stem.casefold() in clashing else stem, taken)
        taken.add(name.casefold())
        names.append(name)
    return names


def _free(name: str, taken: set[str]) -> str:
    candidates = [name, *(f"{name}-{k}" for k in range(2, len(taken) + 3))]
    return next(each for each in candidates if each.casefold() not in taken)
