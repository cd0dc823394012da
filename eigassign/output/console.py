"""Results on stdout, progress on stderr: plain when piped, and in any locale."""

from __future__ import annotations

import contextlib
import io
import math
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import TextIO

from rich import box
from rich.console import Console
from rich.table import Table as RichTable
from rich.text import Text

from eigassign.output import tables as summary
from eigassign.output.formats import number
from eigassign.study.results import RunResults, ValidationRow

_ENDLESS = 100_000  # columns: off a terminal nothing is wrapped or cut


def print_table(
    title: str,
    columns: Sequence[str],
    rows: Sequence[Sequence[str]],
    *,
    caption: str = "",
    stream: TextIO | None = None,
) -> None:
    """A table of finished text; none of it is read as markup, and no cell is cut."""
    out = sys.stdout if stream is None else stream
    table = RichTable(box=box.SIMPLE_HEAD if _speaks_unicode(out) else box.ASCII2, pad_edge=False)
    for at, column in enumerate(columns):
        right = at > 0 and all(_is_number(row[at]) for row in rows)
        table.add_column(Text(column), justify="right" if right else "left", overflow="fold")
    for row in rows:
        table.add_row(*(Text(_printable(cell)) for cell in row))
    _print(out, [Text(_printable(title), style="bold")] if title else [], table, caption)


def _print(out: TextIO, heading: list[Text], table: RichTable, caption: str) -> None:
    terminal = out.isatty()
    text = io.StringIO()
    console = Console(
        file=text,
        force_terminal=terminal,
        width=None if terminal else _ENDLESS,
        color_system="auto" if terminal else None,
        markup=False,
        highlight=False,
        emoji=False,
    )
    for line in heading:
        console.print(line, soft_wrap=True)
    console.print(table)
    if caption:
        console.print(Text(_printable(caption)), soft_wrap=True)
    lines = [line.rstrip() for line in text.getvalue().splitlines()]
    write_text(out, "\n".join(line for line in lines if line) + "\n\n")


def write_text(out: TextIO, text: str) -> None:
    """Write ``text``; what the stream's encoding lacks becomes ``?`` instead of an error."""
    encoding = out.encoding or "utf-8"
    out.write(text.encode(encoding, "replace").decode(encoding))


def _speaks_unicode(out: TextIO) -> bool:
    return (out.encoding or "utf-8").lower().replace("-", "").startswith("utf")


def _printable(text: str) -> str:
    """Without control characters, so that no file name can move the cursor."""
    return "".join(c if c.isprintable() else " " for c in text)


def _is_number(text: str) -> bool:
    try:
        float(text.removesuffix("ms").rstrip("s% "))
    except ValueError:
        return False
    return True


def print_assignment(results: RunResults, *, stream: TextIO | None = None) -> None:
    """The verdict, then design, distances, limits, approximation and the solver's certificate."""
    if (line := summary.headline(results)) is not None:
        write_text(sys.stdout if stream is None else stream, _printable(line) + "\n\n")
    print_tables((t for t in summary.tables(results) if t.title != "Timing"), stream=stream)


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
    q: Sequence[tuple[str, float]] = (),
    y: Sequence[tuple[str, float]] = (),
    truncation: Sequence[float] | None = None,
    stream: TextIO | None = None,
) -> None:
    """Elastic modes in Hz from 1 upwards, where they were evaluated, and the rigid modes left out.

    ``q`` and ``y`` are (name, value) pairs in SI; ``truncation`` is how much reduced links raise
    each frequency at most, relative.
    """
    where = ", ".join(f"{name} = {number(value)}" for name, value in (*q, *y))
    caption = f"{rigid_modes} rigid-body mode{'s' if rigid_modes != 1 else ''} not counted."
    rows: list[tuple[str, ...]] = [
        (str(mode), f"{hz:.10g}") for mode, hz in enumerate(frequencies_hz, start=1)
    ]
    columns: tuple[str, ...] = ("mode", "frequency [Hz]")
    if truncation is not None:
        columns = (*columns, "too high by at most")
        rows = [(*row, _bounded(e)) for row, e in zip(rows, truncation, strict=True)]
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
    terminal, done = out.isatty(), 0

    def advance(what: str = "") -> None:
        nonlocal done
        done += 1
        line = _printable(f"{label} {done}/{total} {what}".rstrip())
        write_text(out, f"\r\x1b[2K{line[:78]}" if terminal else f"{line}\n")
        out.flush()

    try:
        yield advance
    finally:
        if terminal and done:
            write_text(out, "\r\x1b[2K")
            out.flush()
