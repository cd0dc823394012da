"""A table in a CSV file: a header `time [ms], q1 [deg], mode`, then one line a row.

Columns may stand in any order; SI units are meant where none is written. Columns with other names
are ignored with a note. Blank lines and lines that begin with `#` are skipped. Semicolons or tabs
may stand between the cells instead of commas; decimals then take a point or, in the whole file, a
comma, as spreadsheets of many countries write them.
"""

from __future__ import annotations

import csv
import io
import itertools
import math
import re
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import NamedTuple

from eigassign.case.reader import NUMBER, listed, shown, suggestion, unknown
from eigassign.case.units import (
    DIMENSIONS,
    ONE,
    TWO_TURNS,
    UNITS,
    Dimension,
    QuantityError,
    Unit,
    parse_unit,
    require_size,
)
from eigassign.errors import MechanismError, StorageError
from eigassign.files import TABLE, objection, read_bytes

_HEADER_CELL = re.compile(r"([^\[\]]*?)\s*(?:\[\s*([^\[\]]*?)\s*\])?")
_UNIT_BEHIND = re.compile(r"(.+?)(?:\s*\(\s*([^()]+?)\s*\)|[_ ]([^\W\d_]+))")  # (deg), or _deg
_SEPARATOR_LINE = re.compile(r"sep=([;,\t])", re.IGNORECASE)  # a spreadsheet's hint to itself
_POINT = re.compile(r"\d\.\d")
MOST = 1_000_000  # rows: what 100 MB hold, the limit of a table


class CsvColumn(NamedTuple):
    """A column to be read: numbers of one of these dimensions, or words where it has none.

    The first dimension is meant where the header gives no unit. ``written`` is what the header
    calls it, `name` or `name [unit]`, where that is something else. Where the table has the column
    ``instead``, this one may be missing.
    """

    name: str
    dimensions: tuple[Dimension, ...] = ()
    optional: bool = False
    written: str = ""
    instead: str = ""


class CsvTable(NamedTuple):
    """Columns by their name, the line each row stands in, and what was passed over."""

    file: str
    lines: tuple[int, ...]  # (n,) counted from 1
    numbers: Mapping[str, tuple[float, ...]]  # (n,) in SI units
    words: Mapping[str, tuple[str, ...]]
    dimensions: Mapping[str, Dimension]  # which one each column of numbers has
    notes: tuple[str, ...]

    def where(self, k: int) -> str:
        """``file:line`` of row k."""
        return f"{self.file}:{self.lines[k]}"


class _Heading(NamedTuple):
    """A column in the header; the unit of its numbers, None for words."""

    name: str
    place: int
    unit: Unit | None = None
    dimension: Dimension | None = None
    bare: bool = False  # the header gives no unit


def read_table(
    file: Path,
    key: str,
    columns: Sequence[CsvColumn],
    row_error: Callable[[str, str, int], MechanismError] = lambda key, text, _: MechanismError(
        key, text
    ),
    known: Collection[str] = (),
) -> CsvTable:
    """The ``columns`` of a CSV file; ``known`` others are ignored without a note.

    ``key`` of the case names the file. Raises MechanismError at ``key`` if the file cannot be read
    or has a wrong header, and ``row_error(key, message, row)`` for a row that does not hold what
    the header promises; both name the line.
    """
    rows = _rows(file, key)
    line, header = next(rows, (1, []))
    if not header:
        raise MechanismError(key, f"{file.name}: is empty; a header and rows are expected")
    try:
        names, found = _headings(header, columns)
    except ValueError as error:
        for row in (header, next(rows, (0, []))[1]):
            words = " ".join(row).replace(",", ".").split()
            if words and 2 * len([*filter(NUMBER.fullmatch, words)]) >= len(words):
                raise MechanismError(key, f"{file.name}:{line}: {error}") from error
        wanted = ", ".join(column.name for column in columns if not column.optional)
        message = f"{file.name}:{line}: expected a header with {wanted}, and numbers below it"
        raise MechanismError(key, message) from None  # what the file says is not for a message
    lines, values = [], list[list[float | str]]([] for _ in found)
    clocks = [column.place for column in found if column.dimension == DIMENSIONS["time"]]
    first: datetime | None = None
    for k, (number, row) in enumerate(rows):
        try:
            if k >= MOST:
                raise ValueError(f"more than {MOST} rows")
            for place in clocks:  # times of day count from the first one
                if (at := _instant(row[place : place + 1])) is not None:
                    first = first or at
                    row[place] = str((at - first).total_seconds())
            read = _values(row, found, len(header))
            for column, value in zip(values, read, strict=True):
                column.append(value)
        except ValueError as error:
            raise row_error(key, f"{file.name}:{number}: {error}", k) from error
        lines.append(number)
    both = list(zip(found, values, strict=True))
    used = {column.place for column in found}
    passed_over = [n for i, n in enumerate(names) if i not in used and n not in known]
    extra = listed(name or "(no name)" for name in passed_over)
    return CsvTable(
        file=file.name,
        lines=tuple(lines),
        numbers={c.name: tuple(map(float, v)) for c, v in both if c.unit},
        words={c.name: tuple(map(str, v)) for c, v in both if not c.unit},
        dimensions={c.name: c.dimension for c in found if c.dimension},
        notes=(f"{file.name}: ignored the columns {extra}",) if passed_over else (),
    )


def renamed(columns: Sequence[CsvColumn], written: Mapping[str, str], key: str) -> list[CsvColumn]:
    """The columns, with what the header calls some; raises MechanismError for others at ``key``."""
    known = [column.name for column in columns]
    for name in written:
        if name not in known:
            raise MechanismError(key, f"columns: {unknown('column', name, known)}")
    return [column._replace(written=written.get(column.name, "")) for column in columns]


def read_words(file: Path, key: str) -> list[tuple[int, list[str]]]:
    """Line and cells of every row of a CSV file as they are written, the header first.

    Raises MechanismError at ``key`` if the file cannot be read, has no row below its header, or one
    of another length.
    """
    rows = list(itertools.islice(_rows(file, key), MOST + 2))
    if not 2 <= len(rows) <= MOST + 1:
        many = f"more than {MOST} rows" if rows[2:] else "a header and rows are expected"
        raise MechanismError(key, f"{file.name}: {many}")
    for line, cells in rows:
        if len(cells) != len(rows[0][1]) or not all(cells):
            filled = sum(map(bool, cells))
            message = f"{file.name}:{line}: {filled} values for {len(rows[0][1])} columns"
            raise MechanismError(key, message)
    return rows


def _rows(file: Path, key: str) -> Iterator[tuple[int, list[str]]]:
    """Line number and cells of every line that says something; decimals take a point."""
    text = _text(file, key)
    lines = io.StringIO(text, newline="")
    told = (line for line in lines if line.strip() and not line.lstrip().startswith("#"))
    first = next(told, "")
    hint = _SEPARATOR_LINE.fullmatch(first.strip())
    between = hint.group(1) if hint else next((c for c in ",;\t" if c in first), ",")
    comma = between != "," and not _POINT.search(text)
    lines.seek(0)
    reader = csv.reader(lines, delimiter=between, skipinitialspace=between != "\t", strict=True)
    width = None  # of the header: a separator may end every row
    try:
        for row in reader:
            cells = [cell.strip() for cell in row]
            while len(cells) > (width or 1) and not cells[-1]:
                cells.pop()
            if any(cells) and not cells[0].startswith("#") and cells[0].lower() != "sep=":
                width = len(cells) if width is None else width
                yield reader.line_num, [*map(_with_point, cells)] if comma else cells
    except csv.Error as error:
        message = f"{file.name}:{reader.line_num}: {error}: between separators stands one number"
        raise MechanismError(key, f"{message}, or one name; close every quote") from error


def _instant(cells: Sequence[str]) -> datetime | None:
    """The date and time of a cell in ISO 8601, or the time of a day."""
    try:
        if cells and cells[0].count(":") == 2 and "-" not in cells[0]:
            return datetime.fromisoformat(f"2000-01-01 {cells[0]}")
        return datetime.fromisoformat(cells[0]) if cells and ":" in cells[0] else None
    except ValueError:
        return None


def _with_point(cell: str) -> str:
    number = cell.replace(",", ".", 1)
    return number if NUMBER.fullmatch(number) else cell


def _text(file: Path, key: str) -> str:
    try:
        text = read_bytes(file, TABLE).decode("utf-8-sig")
    except OSError as error:
        why = f"{file}: cannot be read: {error.strerror}"
        if objection(file, TABLE) is None:  # another name would not help
            raise StorageError(why) from error
        raise MechanismError(key, why) from error
    except UnicodeDecodeError as error:
        raise MechanismError(key, f"{file.name}: is not a text file in UTF-8") from error
    if "\0" in text:
        raise MechanismError(key, f"{file.name}: is not a text file (it contains zero bytes)")
    return text


def _headings(
    header: Sequence[str], columns: Sequence[CsvColumn]
) -> tuple[list[str], list[_Heading]]:
    """Names of a header of `name` or `name [unit]`, and ``columns`` there; raises ValueError."""
    names, units = list[str](), list[str]()
    for cell in header:
        if (match := _HEADER_CELL.fullmatch(cell)) is None:
            raise ValueError(f"column {shown(cell)} must read `name` or `name [unit]`")
        names.append(match.group(1))
        units.append(match.group(2) or "")
    found, lacking = [], list[CsvColumn]()
    for column in columns:
        if (match := _HEADER_CELL.fullmatch(column.written or column.name)) is None:
            raise ValueError(f"column {shown(column.written)} must read `name` or `name [unit]`")
        name, unit_written = match.groups()
        if not unit_written and (column.written or name not in names):
            name, unit_written = _behind(name, names, column) or (name, unit_written)
        if name not in names and (column.optional or column.instead) and not column.written:
            lacking += [column] * (not column.optional)
            continue
        if names.count(name) != 1:
            raise ValueError(_miscounted(column._replace(name=name), names))
        index = names.index(name)
        unit = _unit(column, unit_written or units[index]) if column.dimensions else ()
        found.append(_Heading(column.name, index, *unit))
    for column in lacking:
        if all(one.name != column.instead for one in found):
            raise ValueError(_miscounted(column, names))
    return names, found


def _behind(name: str, names: Sequence[str], column: CsvColumn) -> tuple[str, str | None] | None:
    """The name in the header and the unit that stands behind it, as ``name (deg)`` or ``x_deg``."""
    for own in (other for other in names if other == name or other.startswith(f"{name} (")):
        match = _UNIT_BEHIND.fullmatch(own)
        written = match and (match.group(2) or (match.group(3) if column.written else ""))
        try:
            unit = parse_unit(written) if written else None
        except QuantityError:
            continue
        if unit and any(unit.exponents == each.exponents for each in column.dimensions):
            return own, written
    return None


def _unit(column: CsvColumn, written: str) -> tuple[Unit, Dimension, bool]:
    """The unit of a column, its dimension, and whether the header gives no unit."""
    first = column.dimensions[0]
    try:
        unit = parse_unit(written or first.si, first) if written or first.si else ONE
    except QuantityError as error:
        raise ValueError(f"column {column.name}: {error}") from error
    for dimension in column.dimensions:
        if unit.exponents == dimension.exponents:
            return unit, dimension, not written
    kinds = " or ".join(map(str, column.dimensions))
    raise ValueError(f"column {column.name}: [{written}] is no unit of {kinds}")


def _miscounted(column: CsvColumn, known: Sequence[str]) -> str:
    name = column.name
    if name in known:
        return f"column {name} appears {known.count(name)} times"
    message = f"no column {name}; the columns are {listed(known)}"
    if all(NUMBER.fullmatch(other) for other in known):
        such = "time [s],q1 [deg]" if name == "time" else name
        return f"{message}; the first line must be a header, such as {such}"
    if len(known) == 1 and " " in known[0]:
        return f"{message}; columns are separated by commas, semicolons or tabs"
    begins = re.compile(rf"{re.escape(name)}(?![^\W_])", re.IGNORECASE)  # time (s), time_s, TIME
    near = next(filter(begins.match, known), None)
    if near is None:
        return f"{message}{suggestion(name, known)}"
    unit = next((f" [{each.si}]" for each in column.dimensions[:1] if each.si), "")
    if (match := _UNIT_BEHIND.fullmatch(near)) and (match.group(2) or match.group(3)) in UNITS:
        unit = f" [{match.group(2) or match.group(3)}]"
    return f"{message}; if it is {shown(near)}, call it {name + unit}"


def _values(row: list[str], columns: Sequence[_Heading], n: int) -> Iterator[float | str]:
    """One row in SI units; raises ValueError with what is wrong with it."""
    if len(row) != n:
        comma = " (decimals take a point)" if len(row) > n else ""
        raise ValueError(f"{len(row)} values for {n} columns{comma}")
    for column in columns:
        cell = row[column.place]
        if column.unit is None:
            yield cell
            continue
        value = float(cell) if NUMBER.fullmatch(cell) else math.nan
        if not math.isfinite(value):
            mixed = "; decimals take a comma or a point, not both" if "," in cell else ""
            if ":" in cell:
                mixed = "; a time of day is written as 2026-03-01 12:00:00.5 or 12:00:00.5"
            raise ValueError(f"column {column.name}: {shown(cell)} is not a finite number{mixed}")
        si = column.unit.to_si(value)
        try:
            require_size(si, column.dimension, cell)
        except QuantityError as error:
            raise ValueError(f"column {column.name}: {error}") from None
        if column.bare and column.dimension == DIMENSIONS["angle"] and abs(si) > TWO_TURNS:
            raise ValueError(
                f"column {column.name}: {cell} rad is more than two turns, and the header gives no "
                f"unit: write {column.name} [deg], or {column.name} [rad] if that is meant"
            )
        yield si
