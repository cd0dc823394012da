"""Results on stdout, progress on stderr: plain when piped, and in any locale."""

from __future__ import annotations

import contextlib
import io
import math
import sys
import textwrap
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TextIO

from rich import box
from rich.console import Console
from rich.markdown import Markdown
from rich.table import Table as RichTable
from rich.text import Text

from eigassign import process
from eigassign.files import printable
from eigassign.output import tables as summary
from eigassign.output import terminal
from eigassign.study.results import RunResults, ValidationRow

_PAGE = 100  # columns: longer lines are hard to read
_COLOURS = {
    "green": {"reached", "met", "ok", "proved", "fitted"},
    "yellow": {"improved", "unfinished"},
    "red": {
        "unreachable",
        "infeasible",
        "do not use",
        "violated",
        "failed",
        "no",
        "error",
        "poor_fit",
        "not_identified",
    },
}


def print_table(
    title: str,
    columns: Sequence[str],
    rows: Sequence[Sequence[str]],
    *,
    caption: str = "",
    stream: TextIO | None = None,
) -> None:
    """A table of finished text; none of it is read as markup.

    Where it is wider than the terminal, lines end between words, long words (paths) are shortened
    in the middle, and columns that still find no room follow in a table below, behind the first.
    """
    out = sys.stdout if stream is None else stream
    width, unicode = terminal.width(out), _speaks_unicode(out)
    cells = [[printable(cell) for cell in row] for row in rows]
    every = [[row[k] for row in cells] for k in range(len(columns))]
    console, text = _console(out, width)
    if title:
        console.print(Text(printable(title), style="bold"), soft_wrap=True)
    for group in terminal.groups(columns, every, width) if columns else ():
        table = RichTable(
            box=box.SIMPLE_HEAD if unicode else box.ASCII2,
            show_edge=False,
            pad_edge=False,
            collapse_padding=True,
        )
        for k, room in group:
            right = k > 0 and terminal.are_numbers(every[k])
            header = terminal.fitted(columns[k], room, unicode)
            table.add_column(Text(header), justify="right" if right else "left", width=room)
        for row in cells:
            fitted = (terminal.fitted(row[k], room, unicode) for k, room in group)
            table.add_row(*(Text(cell, style=_colour(cell)) for cell in fitted))
        console.print(table)
    _write_paragraph(console, caption)
    lines = [line.rstrip() for line in text.getvalue().splitlines()]
    write_text(out, "\n".join(line for line in lines if line) + "\n\n")


def _console(out: TextIO, width: int) -> tuple[Console, io.StringIO]:
    """A console of rich that writes into a text, in colours where ``out`` shows them."""
    text, colours = io.StringIO(), process.shows_colours(out)
    console = Console(
        file=text,
        force_terminal=colours,
        width=width,
        color_system="standard" if colours else None,
        markup=False,
        highlight=False,
        emoji=False,
    )
    return console, text


def _write_paragraph(console: Console, text: str, style: str = "") -> None:
    """Lines that end between words only; a word longer than the line is left to the terminal."""
    for line in textwrap.wrap(
        printable(text), console.width, break_long_words=False, break_on_hyphens=False
    ):
        console.print(Text(line, style=style), soft_wrap=True)


def _colour(cell: str) -> str:
    """Of a verdict; nothing else has one."""
    word = cell.lower()
    if word.startswith("violated by"):
        return "red"
    return next((colour for colour, words in _COLOURS.items() if word in words), "")


def write_text(out: TextIO, text: str) -> None:
    """Write ``text``; what the stream's encoding lacks becomes ``?`` instead of an error."""
    encoding = out.encoding or "utf-8"
    out.write(text.encode(encoding, "replace").decode(encoding))


def _speaks_unicode(out: TextIO) -> bool:
    return (out.encoding or "utf-8").lower().replace("-", "").startswith("utf")


def print_assignment(results: RunResults, *, stream: TextIO | None = None) -> None:
    """The verdict, then design, distances, limits, approximation and the solver's certificate."""
    if (line := summary.headline(results)) is not None:
        print_verdict(line, stream=stream)
    print_tables((t for t in summary.tables(results) if t.title != "Timing"), stream=stream)


def print_verdict(line: str, verdict: str = "", *, stream: TextIO | None = None) -> None:
    """The first sentence of a result, in the colour of its verdict, or of what it begins with."""
    out = sys.stdout if stream is None else stream
    console, text = _console(out, terminal.width(out))
    _write_paragraph(console, line, _colour(verdict or line.partition(":")[0]))
    write_text(out, text.getvalue() + "\n")


def markdown(text: str, out: TextIO) -> str:
    """A page of the manual as ``out`` shows it."""
    console, made = _console(out, min(terminal.width(out), _PAGE))
    console.print(Markdown(text, hyperlinks=False))
    return made.getvalue()


def print_validation(rows: Sequence[ValidationRow], *, stream: TextIO | None = None) -> None:
    """Both expansions against exact, one line a mode and place."""
    print_tables([summary.validation(tuple(rows))], stream=stream)


def print_tables(tables: Iterable[summary.Table], *, stream: TextIO | None = None) -> None:
    """Tables of a run, a chart or a batch, one below the other."""
    for table in tables:
        print_table(table.title, table.columns, table.rows, caption=table.caption, stream=stream)


def print_modes(
    frequencies_hz: Sequence[float],
    *,
    rigid_modes: int,
    where: str = "",
    discretisation: Sequence[float] | None = None,
    truncation: Sequence[float] | None = None,
    note: str = "",
    stream: TextIO | None = None,
) -> None:
    """Elastic modes in Hz from 1 upwards, where they were evaluated, and the rigid modes left out.

    ``where`` is the pose and design in words; ``discretisation`` and ``truncation`` are how much
    mesh and reduced links raise each frequency at most, relative; ``note`` is said below.
    """
    caption = f"{rigid_modes} rigid-body mode{'s' if rigid_modes != 1 else ''} not counted."
    caption += f" {note[:1].upper()}{note[1:]}." if note else ""
    rows: list[tuple[str, ...]] = [
        (str(mode), f"{hz:.10g}") for mode, hz in enumerate(frequencies_hz, start=1)
    ]
    columns: tuple[str, ...] = ("mode", "frequency [Hz]")
    for cause, errors in (("mesh", discretisation), ("reduced links", truncation)):
        if errors is not None:
            columns = (*columns, f"{cause}: too high by at most")
            rows = [(*row, _bounded(e)) for row, e in zip(rows, errors, strict=True)]
    title = f"Modes at {where}" if where else "Modes"
    print_table(title, columns, rows, caption=caption, stream=stream)


def _bounded(error: float) -> str:
    return f"{100 * error:.2g} %" if math.isfinite(error) else "cannot be bounded"


@contextlib.contextmanager
def progress(
    label: str, total: int, *, stream: TextIO | None = None
) -> Iterator[Callable[[str], None]]:
    """Count long work on stderr: yields ``advance(what)``, to be called once a finished piece.

    On a terminal one line is rewritten; elsewhere every piece gets a line of its own.
    """
    out = sys.stderr if stream is None else stream
    rewrites, done = out.isatty(), 0

    def advance(what: str = "") -> None:
        nonlocal done
        done += 1
        line = printable(f"{label} {done}/{total} {what}".rstrip())
        write_text(
            out, f"\r\x1b[2K{line[: min(terminal.width(out), 80) - 1]}" if rewrites else f"{line}\n"
        )
        out.flush()

    try:
        yield advance
    finally:
        if rewrites and done:
            write_text(out, "\r\x1b[2K")
            out.flush()
