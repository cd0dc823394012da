"""Results on stdout: plain when piped, and in any locale."""

from __future__ import annotations

import os
import shutil
import sys
import textwrap
import unicodedata
from collections.abc import Iterable, Iterator, Sequence
from itertools import zip_longest

from eigassign.files import printable
from eigassign.output.tables import Table, headline, helps, run_tables, tone_of
from eigassign.study.results import RunResults

_GAP = 2  # blanks between two columns of a table
_COLOURS = {
    "32": {"good", "reached", "met", "ok", "checked", "fitted", "done"},  # green
    "33": {"fair", "improved", "unfinished", "over tolerance"},  # yellow
    "31": {  # red
        *("bad", "unreachable", "infeasible", "do not use", "violated", "failed", "no", "error"),
        *("poor_fit", "not_identified", "no answer"),
    },
}


def width(endless: int = 100_000) -> int:
    """Columns: those of COLUMNS, else of the terminal; without either lines have no end."""
    return shutil.get_terminal_size((endless, 0)).columns


def wrapped(lines: Iterable[str], room: int) -> list[str]:
    """Lines that end between words; what is continued is indented further than its beginning."""
    text = []
    for line in lines:
        indent = " " * (len(line) - len(line.lstrip()) + 2)
        text += _words(line, room, indent) if len(line) > room else [line]
    return text


def _words(line: str, room: int, indent: str = "", fold: bool = False) -> list[str]:
    """Lines of whole words, or where ``fold`` of pieces of those that are longer than the room."""
    return textwrap.wrap(
        line, room, subsequent_indent=indent, break_on_hyphens=False, break_long_words=fold
    )


def print_assignment(results: RunResults, *, verbose: bool = False) -> None:
    """The verdict, the design, what was asked, what would help; ``verbose``: every table."""
    if (line := headline(results)) is not None:
        print_verdict(line, tone_of(results))
    brief = not verbose and results.assignment is not None
    print_tables(run_tables(results, brief))
    if lines := [*helps(results)]:
        _write([_styled("What would help", "1"), *wrapped(lines, width())])


def print_verdict(line: str, verdict: str = "") -> None:
    """The first sentence of a result, in the colour of its verdict, or of what it begins with."""
    colour = _colour(verdict or line.partition(":")[0])
    _write(_styled(text, colour) for text in _words(printable(line), width()))


def print_tables(shown: Iterable[Table]) -> None:
    """Tables of finished text, one below the other.

    Where a table is wider than the terminal, text goes on in the next line, and columns that still
    find no room follow in a table below, behind the first.
    """
    room = width()
    for table in shown:
        lines = [_styled(printable(table.title), "1")] if table.title else []
        lines += _drawn(table, room)
        _write([*lines, *_words(printable(table.caption), room)])


def _write(lines: Iterable[str]) -> None:
    """Lines and an empty one; what the character set of stdout lacks is ``?``, not an error."""
    text = "".join(f"{line.rstrip()}\n" for line in (*lines, ""))
    encoding = sys.stdout.encoding or "utf-8"
    sys.stdout.write(text.encode(encoding, "replace").decode(encoding))


def _styled(text: str, style: str) -> str:
    """The text in a style of a terminal that shows colours; not where NO_COLOR is set."""
    dull = os.environ.get("NO_COLOR") or os.environ.get("TERM") == "dumb"
    shows = sys.stdout.isatty() and not dull
    return f"\x1b[{style}m{text}\x1b[0m" if style and shows else text


def _drawn(table: Table, room: int) -> Iterator[str]:
    """A table in lines: columns in groups that fit, each behind those that name rows."""
    rows = [[printable(cell) for cell in row] for row in table.rows]
    cells = [[row[k] for row in rows] for k in range(len(table.columns))]
    longest = [max(map(_size, column), default=1) for column in cells]
    full = [max(wide, _size(head)) for wide, head in zip(longest, table.columns, strict=True)]
    least: list[int] = []
    for narrow in (room // 3, room // 2):
        least = [
            max(wide if number else min(wide, narrow), *map(_size, header.split()), 1)
            for header, wide, number in zip(table.columns, longest, table.numeric, strict=True)
        ]
        if sum(least) + _GAP * (len(least) - 1) <= room:
            break
    names = [0] if len(set(cells[0] if cells else ())) == len(rows) else [0, 1]
    groups = [names[: len(cells)]] if cells else []
    for k in range(len(names), len(cells)):
        together = [*groups[-1], k]
        fits = sum(least[j] + _GAP for j in together) - _GAP <= room
        if fits or groups[-1] == names:
            groups[-1] = together
        else:
            groups.append([*names, k])
    for group in groups:
        left, wide = room + _GAP - sum(least[k] + _GAP for k in group), {k: least[k] for k in group}
        for k in sorted(group, key=lambda k: table.numeric[k]):  # texts first
            more = min(left, full[k] - least[k])
            wide[k], left = wide[k] + more, left - more
        yield from _row([table.columns[k] for k in group], group, wide, table.numeric, "1")
        yield "─" * (sum(wide.values()) + _GAP * (len(wide) - 1))
        for row in rows:
            yield from _row([row[k] for k in group], group, wide, table.numeric, "")


def _row(
    row: Sequence[str], group: Sequence[int], wide: dict[int, int], numeric: Sequence[bool],
    style: str,
) -> Iterator[str]:  # fmt: skip
    """The lines of a row; numbers stand to the right of their column, but for the first one."""
    texts = [_words(cell, wide[k], fold=True) for cell, k in zip(row, group, strict=True)]
    for line in zip_longest(*texts, fillvalue=""):
        parts = []
        for cell, text, k in zip(row, line, group, strict=True):
            blanks = " " * (wide[k] - _size(text))
            shown = _styled(text, style or _colour(cell)) if text else ""
            parts.append(f"{blanks}{shown}" if k and numeric[k] else f"{shown}{blanks}")
        yield (" " * _GAP).join(parts)


def _size(text: str) -> int:
    """Columns of a terminal that a text takes."""
    return len(text) + sum(unicodedata.east_asian_width(c) in "WF" for c in text)


def _colour(cell: str) -> str:
    """The colour of a verdict; nothing else has one."""
    word = cell.lower()
    if word.startswith("violated by"):
        return "31"
    return next((colour for colour, words in _COLOURS.items() if word in words), "")
