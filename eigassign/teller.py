"""What a command says on stderr while it works: stages, warnings, the log."""

from __future__ import annotations

import io
import logging
import re
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TextIO

from eigassign.errors import Problem
from eigassign.failures import say

_PLACE = re.compile(r"(.+?:\d+:\d+: )(.+)", re.DOTALL)  # of a problem that is text already


@dataclass(frozen=True)
class Teller:
    """Writes to stderr. ``level`` 0: errors only; 1: warnings and stages; 2, 3: more of the log."""

    level: int = 1

    def stage(self, line: str) -> None:
        """Progress of long work."""
        if self.level > 0:
            say([line])

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
        """Where progress bars may go: stderr, or nowhere."""
        return sys.stderr if self.level > 0 and sys.stderr is not None else io.StringIO()


@contextmanager
def telling(verbose: int, quiet: bool) -> Iterator[Teller]:
    """A teller, with the log of this package on stderr meanwhile."""
    level = 0 if quiet else 1 + verbose
    handler = logging.StreamHandler(sys.stderr)
    handler.setFormatter(_Formatter())
    ours = logging.getLogger("eigassign")
    before = ours.level
    ours.addHandler(handler)
    ours.setLevel((logging.ERROR, logging.WARNING, logging.INFO, logging.DEBUG)[min(level, 3)])
    try:
        yield Teller(level)
    finally:
        ours.removeHandler(handler)
        ours.setLevel(before)


class _Formatter(logging.Formatter):
    """``warning: text``, as all else on stderr."""

    def format(self, record: logging.LogRecord) -> str:
        return f"{record.levelname.lower()}: {super().format(record)}"
