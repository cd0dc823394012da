"""summary.json, and the same on the console."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated

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
