"""The stages of a run, announced and timed; its folder, and the log in it.

A stage that lasts says every few seconds how far it is, in a line of progress that begins with two
spaces: how many of its pieces are done where they are counted, else for how long it has been going.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from threading import Event, Thread
from time import perf_counter
from types import MappingProxyType
from typing import Any

from eigassign._version import __version__
from eigassign.case.case_file import CaseFile
from eigassign.errors import UsageError
from eigassign.files import folder_name, printable
from eigassign.output.documents import to_json
from eigassign.output.result_files import sample_files
from eigassign.output.store.run_folder import run_folder
from eigassign.study.results import RunResults


def silent(_line: str) -> None:
    """No progress is shown."""


class Stages:
    """A stopwatch with a lap for each stage; ``timing_s`` holds them in the order they ran.

    The first line of progress comes after ``first_s``, each further one after twice as long as the
    one before, 10 s at most.
    """

    def __init__(self, progress: Callable[[str], None], first_s: float = 2.0) -> None:
        self.timing_s: dict[str, float] = {}
        self._progress, self._first_s = progress, first_s
        self._begun = perf_counter()
        self._counted = ""

    @contextmanager
    def __call__(self, name: str, announcement: str, at_once: bool = True) -> Iterator[None]:
        """Announce the stage, run the body, and add what it took to the stage ``name``.

        Not ``at_once``: announced with the first line of progress, if it lasts so long.
        """
        if at_once:
            self._progress(announcement)
        self._counted = ""
        start, over, late = perf_counter(), Event(), "" if at_once else announcement
        clock = Thread(target=self._tell, args=(start, over, late), daemon=True)
        if self._progress is not silent:
            clock.start()
        try:
            yield
        finally:
            over.set()
        self.timing_s[name] = self.timing_s.get(name, 0.0) + perf_counter() - start

    def advance(self, done: int, of: int) -> None:
        """Count the pieces of the stage that are done."""
        self._counted = f"{done} of {of}"

    def _tell(self, start: float, over: Event, late: str) -> None:
        pause = self._first_s
        while not over.wait(pause):
            pause = min(2.0 * pause, 10.0)
            if late:
                self._progress(late)
                late = ""
            self._progress(f"  {self._counted or f'{perf_counter() - start:.0f} s'}")

    @property
    def total_s(self) -> float:
        """Seconds since the first stage was to begin."""
        return perf_counter() - self._begun


@dataclass(frozen=True)
class RunFolder:
    """A run folder being filled; it appears at ``path`` when the run has succeeded."""

    path: Path
    hidden: Path

    def write(
        self,
        results: RunResults,
        formats: Sequence[str],
        kind: str,
        extra: Mapping[str, bytes] | None = None,
    ) -> None:
        """Results, report of this kind, figures in these formats; log; ``extra`` by name."""
        files = {"log.txt": log_text(results).encode(), **(extra or {})}
        if formats or kind != "none":
            from eigassign.output.reports.page import write_run

            write_run(results, self.hidden, formats, kind)
        else:  # without what draws
            files |= {**sample_files(results), "results.json": to_json(results)}
        for name, data in files.items():
            (self.hidden / name).write_bytes(data)


@contextmanager
def new_run_folder(
    file: CaseFile,
    out: Path | None,
    force: bool,
    suffix: str = "",
    key: str | None = None,
    outcome: Mapping[str, Any] = MappingProxyType({}),
) -> Iterator[RunFolder]:
    """Yield the folder to fill: ``out``, or results/<stem of the case file><suffix>.

    It has the case already, as case.yaml. ``key`` (default: of the bytes of the case and of the
    files it names) and ``outcome``, as it is at the end, stand in run.json.

    Raises StorageError on entry already where the folder may not be replaced, UsageError where the
    file has no stem.
    """
    if out is None and not file.path.stem.strip("."):
        message = f"{file.path} has no name before its ending: say where the run goes, --out DIR"
        raise UsageError(message)
    usual = Path("results", folder_name(file.path.stem + suffix))
    target = usual if out is None else Path(out)
    if key is None:
        said = json.dumps([__version__, file.sha256, dict(file.files)])
        key = hashlib.sha256(said.encode()).hexdigest()
    with run_folder(target, case_path=file.path, key=key, outcome=outcome, force=force) as hidden:
        (hidden / "case.yaml").write_text(file.resolved(), encoding="utf-8")
        yield RunFolder(target, hidden)


def log_text(results: RunResults) -> str:
    """Lines of what was run, chosen, warned of and found, and how long it took."""
    lines = [
        f"eigassign {results.version}",
        f"case      {results.case.name}: {results.case.title}",
        f"sha256    {results.case.sha256}",
        *(f"sha256    {digest} {name}" for name, digest in results.case.files.items()),
        *(f"note      {note}" for note in results.notes),
        *(f"warning   {warning}" for warning in results.warnings),
        *([f"verdict   {found.verdict}: {found.reason}"] if (found := results.assignment) else []),
        *(f"time      {stage}: {1e3 * spent:.2f} ms" for stage, spent in results.timing_s.items()),
    ]
    return "".join(f"{printable(line)}\n" for line in lines)
