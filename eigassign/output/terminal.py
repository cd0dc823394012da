"""Tables that fit a terminal: which columns stand side by side, and how wide each is.

A column is at least as wide as the words of its header and its longest cell, text up to `NARROW`
only; numbers are always whole. Columns of a table that do not fit side by side even so are divided
into groups that do, each behind the columns that name the rows, and their text may be as wide as
half of the room. What room is left goes to the columns that lack some.
"""

from __future__ import annotations

import os
import shutil
import textwrap
from collections.abc import Iterable, Sequence
from typing import TextIO

from rich.cells import cell_len, set_cell_size

ENDLESS = 100_000  # columns: off a terminal nothing is wrapped or shortened
NARROW = 24  # columns: longer cells take several lines before columns are divided into groups
GAP = 2  # columns between two columns of a table

Span = tuple[int, int]  # least and widest width of a column
Group = tuple[tuple[int, int], ...]  # columns that stand side by side: which, and how wide


def width(out: TextIO) -> int:
    """Columns: those of COLUMNS, else of the terminal; without either there is no end."""
    asked = os.environ.get("COLUMNS", "")
    if asked.isdecimal() and int(asked) > 0:
        return int(asked)
    return shutil.get_terminal_size().columns if out.isatty() else ENDLESS


def wrapped(lines: Iterable[str], room: int) -> list[str]:
    """Lines that end between words; what is continued is indented further than its beginning."""
    text = []
    for line in lines:
        indent = " " * (len(line) - len(line.lstrip()) + 2)
        wrapper = textwrap.TextWrapper(
            room, subsequent_indent=indent, break_on_hyphens=False, break_long_words=False
        )
        text += wrapper.wrap(line) if len(line) > room else [line]
    return text


def groups(headers: Sequence[str], cells: Sequence[Sequence[str]], room: int) -> tuple[Group, ...]:
    """The columns of a table in groups that fit into ``room`` columns; ``cells`` are by column.

    The first column names the rows, or the first two where it alone does not tell them apart.
    """
    for narrow in (min(NARROW, room // 3 - GAP), room // 2 - GAP):
        spans = [_span(h, column, max(narrow, 1)) for h, column in zip(headers, cells, strict=True)]
        if sum(least + GAP for least, _ in spans) - GAP <= room:
            break
    rows = list(zip(*cells[:1], strict=True))
    names = [0] if len(set(rows)) == len(rows) else [0, 1][: len(spans)]
    found = [list(names)]
    for k in range(len(names), len(spans)):
        taken = sum(spans[j][0] + GAP for j in found[-1])
        if len(found[-1]) > len(names) and taken + spans[k][0] > room:
            found.append(list(names))
        found[-1].append(k)
    return tuple(
        tuple(zip(group, _widths([spans[k] for k in group], room), strict=True)) for group in found
    )


def _span(header: str, cells: Sequence[str], narrow: int) -> Span:
    longest = max((cell_len(cell) for cell in cells), default=1)
    words = max((cell_len(word) for word in header.split()), default=1)
    whole = longest if are_numbers(cells) else min(longest, narrow)
    return max(whole, min(words, narrow)), max(longest, cell_len(header))


def _widths(spans: Sequence[Span], room: int) -> list[int]:
    """The widest of each column, or of what each lacks the same share."""
    left = room - GAP * (len(spans) - 1) - sum(least for least, _ in spans)
    lacking = sum(widest - least for least, widest in spans)
    if left >= lacking:
        return [widest for _, widest in spans]
    return [least + max(left, 0) * (widest - least) // lacking for least, widest in spans]


def are_numbers(cells: Sequence[str]) -> bool:
    """Whether they are, but for those that are empty."""
    filled = [cell for cell in cells if cell]
    try:
        for cell in filled:
            float(cell.removesuffix("ms").rstrip("s% "))
    except ValueError:
        return False
    return bool(filled)


def fitted(text: str, room: int, unicode: bool = True) -> str:
    """``text`` with each word that is wider than ``room`` columns shortened in its middle."""
    return " ".join(shortened(word, room, unicode) for word in text.split(" "))


def shortened(word: str, room: int, unicode: bool = True) -> str:
    """``word`` in at most ``room`` columns: its beginning, an ellipsis and its end."""
    if cell_len(word) <= room:
        return word
    mark = "…" if unicode else "..."
    kept = max(room - len(mark), 0)
    head = set_cell_size(word, kept // 2)
    tail = set_cell_size(word[::-1], kept - kept // 2)[::-1]
    return f"{head}{mark}{tail}"[: max(room, 1)]
