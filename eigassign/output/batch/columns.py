"""A column for every number of a batch: columns.h5, and summary.csv, which is made of it.

``/name``, ``/status`` and what else every case has as text or number, (n,) each; ``/values/KEY``
what a sweep set, in SI units, as ``KEY (text)`` what is no number; ``/design/NAME`` the optimum;
``/frequencies/NAME/lowest_hz``, ``mean_hz`` and ``highest_hz`` of each target. NaN where there is
no number. A column's attribute ``unit`` is its SI unit. Rows are in the order of the batch, and a
few thousand at a time are held.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Iterable, Iterator
from functools import lru_cache
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from eigassign._version import __version__
from eigassign.case.units import QuantityError, read_quantity
from eigassign.files import printable
from eigassign.output.batch.outcome import NUMBERS, CaseOutcome

FORMAT = 1  # of columns.h5
ROWS = 8192  # held at a time, and in a chunk of the file: 64 kB of numbers
_LONGEST = 1000  # characters of a name: HDF5 has some 64 kB for each
_TEXTS = ("name", "status", "verdict", "message", "path", "run_folder")
_FORMULA = ("=", "+", "-", "@", "\t", "\r")  # spreadsheets run a cell that starts so


class Columns:
    """columns.h5, row by row, of which ``rows`` are held at a time; without a path in memory."""

    def __init__(self, path: Path | None, total: int, rows: int = ROWS) -> None:
        import h5py

        how: dict[str, Any] = {"locking": False}
        how = how if path is not None else {"driver": "core", "backing_store": False}
        self._most, self._names = rows, list[str]()
        self._file, self._total, self._start = h5py.File(path or "columns.h5", "w", **how), total, 0
        self._rows: list[CaseOutcome] = []
        self._file.attrs.update({"format": FORMAT, "version": __version__, "cases": total})

    def add(self, row: CaseOutcome) -> None:
        """Keep it, and write what there is once it is enough."""
        self._rows.append(row)
        if len(self._rows) == self._most:
            self._flush()

    def end(self, file: TextIO | None = None) -> None:
        """Write the rest, all of it as CSV into ``file``, and close the file of columns."""
        self._flush()
        if file is not None:
            self._write_csv(file)
        self._file.close()

    def _write_csv(self, file: TextIO) -> None:
        """Each column under its path and unit, without ``values/``; numbers as ``repr`` has them.

        What is text in every row needs no mark of it.
        """
        place = {name: k for k, name in enumerate(_ORDER)}
        names = sorted(self._names, key=lambda name: place[name.partition("/")[0]])
        heads = []
        for name in names:
            bare, unit = name.removesuffix(" (text)"), self._file[name].attrs.get("unit")
            head = (name if bare in self._names else bare).removeprefix("values/")
            heads.append(cell(f"{head} [{unit}]" if unit else head))
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(heads)
        for start in range(0, self._total, ROWS):
            parts = [
                [cell(text) for text in column.asstr()[start : start + ROWS]]
                if _is_text(column)
                else ["" if v != v else v for v in column[start : start + ROWS].tolist()]
                for column in map(self._file.get, names)
            ]
            writer.writerows(zip(*parts, strict=True))

    def _flush(self) -> None:
        for name in (*_TEXTS, "seconds", *NUMBERS) if self._rows or not self._total else ():
            self._write(name, [getattr(row, name) for row in self._rows], name in _TEXTS)
        units = {name: unit for row in self._rows for name, unit in row.units.items()}
        units = {_level(name): unit for name, unit in units.items()}
        for group, cells in _GROUPS.items():
            every = [dict(cells(row)) for row in self._rows]
            for name in dict.fromkeys(name for row in every for name in row):
                self._write(f"{group}/{name}", [row.get(name) for row in every])
                if unit := units.get(name):
                    self._file[f"{group}/{name}"].attrs["unit"] = unit
        self._start += len(self._rows)
        self._rows = []

    def _write(self, name: str, cells: list[Any], text: bool = False) -> None:
        """The cells of the rows held, of a column that is made where it is new."""
        if name not in self._file:
            self._create(name, text or any(isinstance(cell, str) for cell in cells))
            self._names.append(name)
        column = self._file[name]
        made = [*map(_text, cells)] if _is_text(column) else np.array(cells, np.float64)
        column[self._start : self._start + len(cells)] = made

    def _create(self, name: str, text: bool) -> None:
        import h5py

        kind, empty = (h5py.string_dtype(), None) if text else (np.float64, np.nan)
        chunks = (min(ROWS, self._total),) if self._total else None
        self._file.create_dataset(name, (self._total,), kind, fillvalue=empty, chunks=chunks)


def _is_text(column: Any) -> bool:
    return bool(column.dtype.kind == "O")


def _values(row: CaseOutcome) -> Iterator[tuple[str, float | str]]:
    for key, value in row.values.items():
        number = quantity(value) if isinstance(value, (int, float, str)) else None
        name = _level(key)
        if number is not None:
            yield name, number
        else:
            yield f"{name} (text)", value if isinstance(value, str) else json.dumps(value)


@lru_cache(maxsize=ROWS, typed=True)
def quantity(value: float | str) -> float | None:
    """``value`` in SI units; None where it is no number."""
    try:
        return read_quantity(value, None)
    except QuantityError:
        return None


def _text(cell: str | None) -> bytes:
    """UTF-8, in which what HDF5 cannot hold is written out as Python does it."""
    return (cell or "").replace("\0", r"\x00").encode(errors="backslashreplace")


@lru_cache  # of some columns, in every row
def _level(name: str) -> str:
    """``name`` as one level of a path in the file, which HDF5 can hold."""
    return (printable(name)[:_LONGEST] if name.strip(".") else repr(name)).replace("/", "|")


_GROUPS: dict[str, Callable[[CaseOutcome], Iterable[tuple[str, Any]]]] = {
    "values": _values,
    "design": lambda row: ((_level(name), value) for name, value in row.design),
    "frequencies": lambda row: (
        (f"{_level(name)}/{what}", value)
        for name, *hz in row.frequencies
        for what, value in zip(("lowest_hz", "mean_hz", "highest_hz"), hz, strict=True)
    ),
}
_ORDER = (  # in the CSV
    *("name", "values", "status", "verdict", "seconds", *NUMBERS, "design", "frequencies"),
    *("message", "path", "run_folder"),
)


def cell(text: str) -> str:
    """The text as a cell that stays on its line, and that no spreadsheet takes for a formula."""
    if not text.isprintable():
        text = printable(" ".join(text.split("\n")))
    return "'" + text if text.startswith(_FORMULA) else text
