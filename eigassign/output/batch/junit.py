"""junit.xml as CI servers read it, written row by row."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import TextIO

from eigassign.errors import StorageError
from eigassign.output.store.atomic import replacing

_NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_PLAIN = re.compile(r"[\w .,:;/%=+()\[\]-]*", re.ASCII)
_MARKUP = re.compile('[&<>"\t\n\r]')
_HEADER = 320  # characters: its text, and twice four counts of up to 20 digits
SUITE = "eigassign"
_NONE: dict[str, float] = {"tests": 0, "failures": 0, "errors": 0, "time": 0.0}


class Junit:
    """Test cases of one suite, a line each; missed tolerances and unsolvable cases are failures.

    How many there are stands in the first line, and is written there at the `end`.
    """

    def __init__(self, file: TextIO) -> None:
        self._file, self.totals = file, _NONE.copy()
        file.write(" " * _HEADER + "\n")

    def add(
        self, name: str, path: str, seconds: float, status: str, message: str, output: str = ""
    ) -> None:
        """One case: ``status`` is ok, error, or the kind of failure."""
        line = f'<testcase name="{_escaped(name)}" classname="{SUITE}" '
        line += f'file="{_escaped(path)}" time="{seconds:.3f}">'
        self.totals["tests"] += 1
        self.totals["time"] += seconds
        if status != "ok":
            tag = "error" if status == "error" else "failure"
            self.totals[f"{tag}s"] += 1
            first = _escaped((message.splitlines() or [status])[0])
            line += (
                f'<{tag} type="{_escaped(status)}" message="{first}">{_escaped(message)}</{tag}>'
            )
        if output:
            line += f"<system-out>{_escaped(output)}</system-out>"
        self._file.write(f"{line}</testcase>\n")

    def end(self) -> None:
        """Close the suite, and write the counts at the beginning."""
        self._file.write("</testsuite></testsuites>\n")
        told = {k: f"{v:.3f}" if k == "time" else v for k, v in self.totals.items()}
        counts = f'name="{SUITE}" ' + " ".join(f'{k}="{v}"' for k, v in told.items())
        header = f'<?xml version="1.0" encoding="utf-8"?><testsuites {counts}><testsuite {counts} '
        self._file.seek(0)
        self._file.write((header + 'skipped="0"').ljust(_HEADER - 1) + ">")


def write_junit(path: Path, tests: Iterable[tuple[str, str, float, str, str]]) -> None:
    """A file of all ``tests``: name, path, seconds, status and message of each.

    Raises StorageError where it cannot be written.
    """
    try:
        with replacing(path) as made, open(made, "w", encoding="utf-8") as file:
            suite = Junit(file)
            for test in tests:
                suite.add(*test)
            suite.end()
    except OSError as error:
        raise StorageError(f"{path}: cannot be written: {error.strerror}") from error


def _escaped(text: str) -> str:
    """``text`` as content or attribute, on one line.

    Characters that XML cannot hold are shown as ``\\x1b``.
    """
    if _PLAIN.fullmatch(text):
        return text
    shown = _NOT_XML.sub(lambda found: found.group().encode("unicode_escape").decode(), text)
    return _MARKUP.sub(lambda found: f"&#{ord(found.group())};", shown)
