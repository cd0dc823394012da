"""Joint samples from a CSV file: a header `time [ms], q1 [deg], q2`, then one line a sample.

Columns may stand in any order; s and rad (m for strokes) are meant where no unit is written.
Columns with other names are ignored with a note, those of the tip that runs write (`tip x [m]`, …)
without. Blank lines and lines that begin with `#` are
skipped.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from eigassign.case.suggestions import listed, shown, suggestion
from eigassign.case.units import DIMENSIONS, Dimension, QuantityError, Unit, parse_unit
from eigassign.errors import MechanismError, TrajectoryError

Floats = NDArray[np.float64]
_KEY = "trajectory.file"
TIME = "time"
TIP_COLUMNS = ("tip x", "tip y", "tip z")  # written by runs; passed over without a note
_KINDS = {"rad": "angle", "m": "length"}
_HEADER_CELL = re.compile(r"([^\[\]]*?)\s*(?:\[\s*([^\[\]]*?)\s*\])?")
_NUMBER = re.compile(r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?")
_LARGEST = 100_000_000  # bytes: far more than anybody's trajectory, less than memory
_MOST = 1_000_000  # samples


@dataclass(frozen=True)
class SampleTable:
    """Samples as a file gives them, in SI units, and the line each stands in."""

    time_s: Floats  # (n,)
    q: Floats  # (n, n_q) in rad or m
    file: str
    lines: tuple[int, ...]  # (n,) counted from 1
    notes: tuple[str, ...]

    def where(self, k: int) -> str:
        """``file:line`` of sample k."""
        return f"{self.file}:{self.lines[k]}"


@dataclass(frozen=True)
class _Column:
    name: str
    index: int
    unit: Unit


def read_samples(file: Path, q_names: Sequence[str], q_units: Sequence[str] = ()) -> SampleTable:
    """Samples of the coordinates ``q_names`` from a CSV file, in SI units.

    ``q_units`` are those of the coordinates, "rad" or "m"; all rad if empty.

    Raises MechanismError if the file cannot be read, has a wrong header or too few samples, and
    TrajectoryError for a line that does not hold one finite number a column; both name the line.
    """
    rows = _rows(_text(file), file.name)
    line, header = next(rows, (1, []))
    if not header:
        raise MechanismError(_KEY, f"{file.name}: is empty; a header and samples are expected")
    where = f"{file.name}:{line}"
    names = [_split(cell, where) for cell in header]
    kinds = ["time", *(_KINDS[unit] for unit in q_units or ["rad"] * len(q_names))]
    wanted = zip((TIME, *q_names), kinds, strict=True)
    columns = [_column(name, names, where, DIMENSIONS[kind]) for name, kind in wanted]
    lines, values = [], []
    for k, (number, row) in enumerate(rows):
        values.append(_values(row, columns, len(header), f"{file.name}:{number}", k))
        lines.append(number)
    if len(values) < 2:
        raise MechanismError(_KEY, f"{file.name}: {len(values)} samples; at least two are needed")
    table = np.array(values)
    notes = _ignored(names, columns, file.name)
    return SampleTable(
        np.ascontiguousarray(table[:, 0]),
        np.ascontiguousarray(table[:, 1:]),
        file.name,
        tuple(lines),
        notes,
    )


def _text(file: Path) -> str:
    try:
        if file.stat().st_size > _LARGEST:
            raise MechanismError(_KEY, f"{file.name}: larger than {_LARGEST // 10**6} MB")
        text = file.read_bytes().decode("utf-8-sig")
    except OSError as error:
        raise MechanismError(_KEY, f"{file}: cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise MechanismError(_KEY, f"{file.name}: is not a text file in UTF-8") from error
    if "\0" in text:
        raise MechanismError(_KEY, f"{file.name}: is not a text file (it contains zero bytes)")
    return text


def _rows(text: str, name: str) -> Iterator[tuple[int, list[str]]]:
    """Line number and cells of every line that says something."""
    reader = csv.reader(io.StringIO(text, newline=""), skipinitialspace=True, strict=True)
    try:
        for row in reader:
            cells = [cell.strip() for cell in row]
            if any(cells) and not cells[0].startswith("#"):
                yield reader.line_num, cells
    except csv.Error as error:
        raise MechanismError(_KEY, f"{name}:{reader.line_num}: {error}") from error


def _split(cell: str, where: str) -> tuple[str, str]:
    """``"q1 [deg]"`` → ``("q1", "deg")``."""
    match = _HEADER_CELL.fullmatch(cell)
    if match is None:
        raise MechanismError(
            _KEY, f"{where}: column {shown(cell)} must read `name` or `name [unit]`"
        )
    return match.group(1), match.group(2) or ""


def _column(
    name: str, names: Sequence[tuple[str, str]], where: str, dimension: Dimension
) -> _Column:
    """The one column called ``name``, with its unit."""
    known = [other for other, _ in names]
    if known.count(name) != 1:
        raise MechanismError(_KEY, f"{where}: {_miscounted(name, known)}")
    index = known.index(name)
    try:
        unit = parse_unit(names[index][1] or dimension.si, dimension)
    except QuantityError as error:
        raise MechanismError(_KEY, f"{where}: column {name}: {error}") from error
    if unit.exponents != dimension.exponents:
        message = f"{where}: column {name}: [{names[index][1]}] is no unit of {dimension}"
        raise MechanismError(_KEY, message)
    return _Column(name, index, unit)


def _miscounted(name: str, known: Sequence[str]) -> str:
    if name in known:
        return f"column {name} appears {known.count(name)} times"
    hint = suggestion(name, known)
    if len(known) == 1 and re.search(r"[;\t ]", known[0]):
        hint = "; columns are separated by commas"
    return f"no column {name}; the columns are {listed(known)}{hint}"


def _values(row: list[str], columns: list[_Column], n: int, where: str, k: int) -> list[float]:
    """One sample in SI units: time, then q."""
    if k >= _MOST:
        raise TrajectoryError(_KEY, f"{where}: more than {_MOST} samples", k)
    if len(row) != n:
        raise TrajectoryError(_KEY, f"{where}: {len(row)} values for {n} columns", k)
    return [column.unit.to_si(_number(row[column.index], column, where, k)) for column in columns]


def _number(cell: str, column: _Column, where: str, k: int) -> float:
    value = float(cell) if _NUMBER.fullmatch(cell) else math.nan
    if not math.isfinite(value):
        message = f"{where}: column {column.name}: {shown(cell)} is not a finite number"
        raise TrajectoryError(_KEY, message, k)
    return value


def _ignored(
    names: Sequence[tuple[str, str]], columns: Sequence[_Column], file: str
) -> tuple[str, ...]:
    used = {column.index for column in columns}
    extra = [
        name or "(no name)"
        for i, (name, _) in enumerate(names)
        if i not in used and name not in TIP_COLUMNS
    ]
    return (f"{file}: ignored the columns {listed(extra)}",) if extra else ()
