"""summary.json, written row by row, and the same on the console."""

from __future__ import annotations

import json
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, TextIO

from eigassign._version import __version__
from eigassign.facts import Fact
from eigassign.output.batch.outcome import CaseOutcome
from eigassign.output.tables import Table, facts_table

FORMAT = 1  # of summary.json
_HASH = re.compile("~[0-9a-f]{10}$")  # of the name of a variant


@dataclass(frozen=True)
class SummaryDocument:
    """The cases in their order, and how many ended how."""

    format: int
    version: Annotated[str, Fact("of eigassign")]
    cases: Sequence[CaseOutcome]
    counts: Annotated[Mapping[str, int], Fact("by status")]


def batch_table(outcomes: Sequence[CaseOutcome]) -> Table:
    """One line a case: its name, verdict, worst exact error if there is one, time, message."""
    rows = [replace(o, name=n) for o, n in zip(outcomes, bare_names(outcomes), strict=True)]
    return facts_table("Batch", rows, "name word exact_max_relative seconds message")


def bare_names(outcomes: Sequence[CaseOutcome]) -> list[str]:
    """The names of cases, of variants without a hash where they are told apart without."""
    bare = [_HASH.sub("", row.name) if row.values else row.name for row in outcomes]
    many = Counter(bare)
    pairs = zip(outcomes, bare, strict=True)
    return [name if many[name] == 1 else row.name for row, name in pairs]


def said(counts: Counter[str]) -> str:
    """``58 ok, 2 error``."""
    order = ("ok", "tolerance", "failed", "error")
    return ", ".join(f"{counts[status]} {status}" for status in order if counts[status])


class SummaryJson:
    """The rows as the manifest has them, then how many there are of each status."""

    def __init__(self, file: TextIO) -> None:
        self._file, self._counts = file, Counter[str]()
        file.write(f'{{"format": {FORMAT}, "version": {json.dumps(__version__)}, "cases": [\n')

    def add(self, status: str, line: str) -> None:
        """Write the line of a row."""
        self._file.write(f"{', ' if self._counts else '  '}{line}\n")
        self._counts[status] += 1

    def end(self) -> None:
        """Write the counts."""
        self._file.write(f'], "counts": {json.dumps(dict(sorted(self._counts.items())))}}}\n')
