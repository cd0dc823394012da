"""index.html of a batch: its rows to sort and to filter, with a picture where a case has one."""

from __future__ import annotations

import os
import re
from collections import Counter
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

from eigassign._version import __version__
from eigassign.facts import fact, number
from eigassign.output.batch.columns import quantity
from eigassign.output.batch.outcome import CaseOutcome, from_line
from eigassign.output.pages import TEMPLATES, inside, page_of

_STATUS = {"ok": "good", "tolerance": "fair", "failed": "bad", "error": "bad"}  # and its tone
_TAIL = re.compile(r"(?<![^.])(?:[0-9]*[^.0-9][^.]*(?:\.[0-9]+)*\.)?[^.]*$")  # in linear time


class Index:
    """The rows that the page shows; those that are not ok are the first to find a place.

    At most ``most``: a browser takes a second to sort so many.
    """

    def __init__(self, most: int = 10_000) -> None:
        self._most = most
        self._good: list[str] = []
        self._bad: list[str] = []
        self._counts = Counter[str]()

    def add(self, status: str, line: str) -> None:
        """Keep the line of a row while there is a place for it."""
        self._counts[status] += 1
        lines = self._good if status == "ok" else self._bad
        if len(lines) < self._most:
            lines.append(line)

    def page(self, folder: Path, title: str, keys: Sequence[str] = ()) -> bytes:
        """The page of the batch in ``folder``; ``keys`` are those of its sweep."""
        lines = [*self._bad, *self._good][: self._most]
        rows = sorted(map(from_line, lines), key=lambda row: row.index)
        columns = _columns(rows, keys)
        data = {
            "columns": [name for name, _ in columns],
            "rows": [[_links(row, folder), *(cell(row) for _, cell in columns)] for row in rows],
        }
        return page_of(
            "batch.html.j2",
            title=title,
            total=self._counts.total(),
            shown=len(rows),
            counts=[(s, tone, self._counts[s]) for s, tone in _STATUS.items() if self._counts[s]],
            version=__version__,
            data=inside(data),
            script=(TEMPLATES / "batch.js").read_text("utf-8"),
        )


Cell = tuple[str, float | None] | str  # as it is shown, and the number to sort it by


def _columns(
    rows: Sequence[CaseOutcome], keys: Sequence[str]
) -> list[tuple[str, Callable[[CaseOutcome], Cell]]]:
    """Name and cell of each column in a row; columns without a cell are left out."""
    designs = dict.fromkeys(name for row in rows for name, _ in row.design)
    # keys by their last two names, and numbers between them, where that tells them apart
    tails = {key: _TAIL.findall(key)[0] for key in keys}
    several = {tail for tail, n in Counter(tails.values()).items() if n > 1}
    short = {key if tail in several else tail: key for key, tail in tails.items()}
    found: list[tuple[str, Callable[[CaseOutcome], Cell]]] = [
        _fact("name"),
        *((n, lambda row, key=key: _value(row.values.get(key))) for n, key in short.items()),
        *map(_fact, ("status", "verdict", "initial_max_relative", "exact_max_relative", "message")),
        *((n, lambda row, n=n: _cell(dict(row.design).get(n), number)) for n in designs),
        _fact("seconds"),
    ]
    kept = ("case", "status")
    return [
        (name, cell)
        for name, cell in found
        if name in kept
        or any(shown if isinstance(shown, str) else shown[0] for shown in map(cell, rows))
    ]


def _value(value: Any) -> Cell:
    if value is None:
        return ""
    amount = quantity(value) if isinstance(value, (int, float, str)) else None
    return str(value) if amount is None else (str(value), amount)


def _fact(name: str) -> tuple[str, Callable[[CaseOutcome], Cell]]:
    one = fact(CaseOutcome, name)
    return one.heading, lambda row: _cell(getattr(row, name), one.text)


def _cell(value: float | str | None, words: Callable[[Any], str]) -> Cell:
    if value is None or isinstance(value, str):
        return ("", None) if value is None else words(value)
    return words(value), value


def _links(row: CaseOutcome, folder: Path) -> list[str]:
    """The page or else the numbers of a case, and its picture; empty where there is none."""
    if row.run_folder is None:
        return []
    place = Path(row.run_folder)
    wanted = (("report.html", "results.json"), ("figures/frequencies.png",))
    there = (next((f for f in names if (folder / place / f).exists()), None) for names in wanted)
    return ["" if name is None else quote(os.fsencode((place / name).as_posix())) for name in there]
