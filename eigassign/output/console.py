"""Results on stdout, progress on stderr: plain when piped, and in any locale."""

from __future__ import annotations

import contextlib
import io
import re
import shutil
import sys
import textwrap
from collections.abc import Callable, Iterable, Iterator
from typing import TextIO

from rich import box
from rich.cells import cell_len
from rich.console import Console
from rich.table import Table as Drawn
from rich.text import Text

from eigassign import process
from eigassign.files import printable
from eigassign.output.tables import Table, headline, run_tables
from eigassign.study.results import RunResults

_GAP = 2  # columns that rich leaves between two columns of a table
_COLOURS = {
    "green": {"reached", "met", "ok", "checked", "fitted", "done"},
    "yellow": {"improved", "unfinished", "over tolerance"},
    "red": {
        *("unreachable", "infeasible", "do not use", "violated", "failed", "no", "error"),
        *("poor_fit", "not_identified", "no answer"),
    },
}


def width() -> int:
    """Columns: those of COLUMNS, else of the terminal; without either lines have no end."""
    return shutil.get_terminal_size((100_000, 0)).columns


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


_FORMULA = re.compile(r"(```.*?```|`[^`]*`)|(\$\$.+?\$\$)|\$[^$]+\$", re.DOTALL)  # or code


def markdown(text: str, out: TextIO) -> str:
    """A page of the manual as ``out`` shows it, in lines of at most 100 columns.

    Formulas stay TeX as it is written.
    """
    console = _console(out, min(width(), 100))
    from rich.markdown import Markdown  # takes 0.15 s, and only the manual needs it

    console.print(Markdown(_FORMULA.sub(_as_code, text), hyperlinks=False))
    return _written(console)


def _as_code(found: re.Match[str]) -> str:
    code, displayed = found.groups()
    return code or (f"```\n{displayed}\n```" if displayed else f"`{found[0]}`")


def print_assignment(results: RunResults, *, stream: TextIO | None = None) -> None:
    """The verdict, then design, distances, limits, approximation and the solver's certificate."""
    if (line := headline(results)) is not None:
        print_verdict(line, stream=stream)
    print_tables((t for t in run_tables(results) if t.title != "Timing"), stream=stream)


def print_verdict(line: str, verdict: str = "", *, stream: TextIO | None = None) -> None:
    """The first sentence of a result, in the colour of its verdict, or of what it begins with."""
    out = sys.stdout if stream is None else stream
    console = _console(out, width())
    _paragraph(console, line, _colour(verdict or line.partition(":")[0]))
    out.write(f"{_written(console)}\n")


def print_tables(shown: Iterable[Table], *, stream: TextIO | None = None) -> None:
    """Tables of finished text, one below the other; none of it is read as markup.

    Where a table is wider than the terminal, text goes on in the next line, and columns that still
    find no room follow in a table below, behind the first.
    """
    out = sys.stdout if stream is None else stream
    for table in shown:
        console = _console(out, width())
        if table.title:
            console.print(Text(printable(table.title), style="bold"), soft_wrap=True)
        for part in _parts(table, console.width):
            console.print(part)
        if table.caption:
            _paragraph(console, table.caption)
        out.write(f"{_written(console)}\n")


def _parts(table: Table, room: int) -> Iterator[Drawn]:
    """The columns of a table in groups that fit side by side, each behind those that name the rows.

    The first column names the rows, or the first two where it alone does not tell them apart.
    Numbers are always whole; text may be narrowed to a third of the room, or, where that does not
    bring all columns side by side, to half of it.
    """
    rows = [[printable(cell) for cell in row] for row in table.rows]
    cells = [[row[k] for row in rows] for k in range(len(table.columns))]
    longest = [max(map(cell_len, column), default=1) for column in cells]
    least: list[int] = []
    for narrow in (room // 3, room // 2):
        least = [
            max(wide if number else min(wide, narrow), *map(cell_len, header.split()), 1)
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
    full = [max(wide, cell_len(h)) for wide, h in zip(longest, table.columns, strict=True)]
    for group in groups:
        # of what texts leave, headings of numbers are given what they need, one after the other
        drawn = Drawn(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False, collapse_padding=True)
        left = room + _GAP - sum((least if table.numeric[k] else full)[k] + _GAP for k in group)
        for k in group:
            whole = table.numeric[k] and full[k] - least[k] <= left
            left -= whole * (full[k] - least[k])
            drawn.add_column(
                Text(table.columns[k]),
                justify="right" if k and table.numeric[k] else "left",
                width=(full if whole else least)[k] if table.numeric[k] else None,
                overflow="fold",
            )
        for row in rows:
            drawn.add_row(*(Text(row[k], style=_colour(row[k])) for k in group))
        yield drawn


def _console(out: TextIO, columns: int) -> Console:
    """A console of rich that writes into memory as ``out`` would show it: colours, character set.

    What its character set lacks becomes ``?`` instead of an error.
    """
    colours = process.shows_colours(out)
    return Console(
        file=io.TextIOWrapper(io.BytesIO(), out.encoding or "utf-8", "replace", newline="\n"),
        force_terminal=colours,
        width=columns,
        color_system="standard" if colours else None,
        markup=False,
        highlight=False,
        emoji=False,
    )


def _written(console: Console) -> str:
    """The text in the console, without blanks at the ends of lines."""
    console.file.seek(0)
    return "".join(f"{line.rstrip()}\n" for line in console.file)


def _paragraph(console: Console, text: str, style: str = "") -> None:
    """Lines that end between words only; a word longer than the line is left to the terminal."""
    console.print(Text(printable(text), style=style, overflow="ignore"), crop=False)


def _colour(cell: str) -> str:
    """The colour of a verdict; nothing else has one."""
    word = cell.lower()
    if word.startswith("violated by"):
        return "red"
    return next((colour for colour, words in _COLOURS.items() if word in words), "")


@contextlib.contextmanager
def progress(
    label: str, total: int, *, stream: TextIO | None = None
) -> Iterator[Callable[[str], None]]:
    """Count long work on stderr: yields ``advance(what)``, to be called once a finished piece.

    On a terminal one line is rewritten; elsewhere every piece gets a line of its own.
    """
    out = sys.stderr if stream is None else stream
    encoding, rewrites, done = out.encoding or "utf-8", out.isatty(), 0

    def advance(what: str = "") -> None:
        nonlocal done
        done += 1
        line = printable(f"{label} {done}/{total} {what}".rstrip())
        line = line.encode(encoding, "replace").decode(encoding)
        out.write(f"\r\x1b[2K{line[: min(width(), 80) - 1]}" if rewrites else f"{line}\n")
        out.flush()

    try:
        yield advance
    finally:
        if rewrites and done:
            out.write("\r\x1b[2K")
            out.flush()
