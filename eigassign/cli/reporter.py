"""What every command writes: stages, warnings and the log on stderr, JSON on stdout."""

from __future__ import annotations

import io
import json
import logging
import re
import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, TextIO

import click

from eigassign.errors import Problem
from eigassign.files import plain, printable
from eigassign.process import say

# --- stderr while a command works

_PLACE = re.compile(r"(.+?:\d+:\d+: )(.+)", re.DOTALL)  # of a problem that is text already


@dataclass(frozen=True)
class Reporter:
    """Writes to stderr. ``level`` 0: errors only; 1: warnings and stages; 2, 3: more of the log."""

    level: int = 1

    def stage(self, line: str) -> None:
        """Progress of long work; of a line that begins with blanks a terminal shows the last."""
        if self.level > 0:
            say([line], passing=line.startswith(" "))

    def warn(self, warnings: Iterable[Problem | str]) -> None:
        """``file:line:column: warning: path: message``, or without a place."""
        for warning in dict.fromkeys(map(str, warnings)) if self.level > 0 else ():
            located = _PLACE.fullmatch(warning)
            place, message = located.groups() if located else ("", warning)
            say([f"{place}warning: {message}"])

    def error(self, line: str) -> None:
        """Why the exit code will not be 0."""
        say([f"eigassign: {line}"])

    def stream(self) -> TextIO:
        """The stream of progress bars: stderr, or nowhere."""
        return sys.stderr if self.level > 0 and sys.stderr is not None else io.StringIO()


@contextmanager
def reporting(how: Mapping[str, Any]) -> Iterator[Reporter]:
    """A reporter of the level that ``--quiet`` and ``-v`` ask for; the package's log on stderr."""
    level = 0 if how["quiet"] else 1 + how["verbose"]
    handler = _Handler()
    ours = logging.getLogger("eigassign")
    before = ours.level
    ours.addHandler(handler)
    ours.setLevel((logging.ERROR, logging.WARNING, logging.INFO, logging.DEBUG)[min(level, 3)])
    try:
        yield Reporter(level)
    finally:
        ours.removeHandler(handler)
        ours.setLevel(before)


class _Handler(logging.Handler):
    """``warning: text``, as all else on stderr."""

    def emit(self, record: logging.LogRecord) -> None:
        say([f"{record.levelname.lower()}: {self.format(record)}"])


# --- stdout


def show(*lines: str) -> None:
    """Lines on stdout, without raw escapes and ends of lines of a name in them."""
    for line in lines:
        click.echo(printable(line))


# --- JSON on stdout, in ASCII, which every terminal shows


def print_json(value: object, indent: int | None = None) -> None:
    """`plain` values on stdout, as JSON."""
    click.echo(json.dumps(plain(value), indent=indent, allow_nan=False))
