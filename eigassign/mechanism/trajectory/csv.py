"""Joint samples from a CSV file: a header `time [ms], q1 [deg], q2`, then one line a sample.

s and rad (m for strokes) are meant where no unit is written; see `eigassign.case.table`. The
columns of the tip that runs write (`tip x [m]`, …) are passed over without a note.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from eigassign.case.table import CsvColumn, CsvTable, read_table
from eigassign.case.units import DIMENSIONS
from eigassign.errors import MechanismError, TrajectoryError

Floats = NDArray[np.float64]
_KEY = "trajectory.file"
TIME = "time"
TIP_COLUMNS = ("tip x", "tip y", "tip z")
_KINDS = {"rad": "angle", "m": "length"}


@dataclass(frozen=True)
class SampleTable:
    """Samples as a file gives them, in SI units."""

    time_s: Floats  # (n,)
    q: Floats  # (n, n_q) in rad or m
    table: CsvTable

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes on what was ignored."""
        return self.table.notes

    def where(self, k: int) -> str:
        """``file:line`` of sample k."""
        return self.table.where(k)


def coordinate_columns(q_names: Sequence[str], q_units: Sequence[str] = ()) -> list[CsvColumn]:
    """One for each coordinate; ``q_units`` are "rad" or "m", all rad if empty."""
    units = q_units or ["rad"] * len(q_names)
    return [
        CsvColumn(name, (DIMENSIONS[_KINDS[unit]],))
        for name, unit in zip(q_names, units, strict=True)
    ]


def read_samples(file: Path, q_names: Sequence[str], q_units: Sequence[str] = ()) -> SampleTable:
    """Samples of the coordinates ``q_names`` from a CSV file, in SI units.

    ``q_units`` are those of the coordinates, "rad" or "m"; all rad if empty.

    Raises MechanismError if the file cannot be read, has a wrong header or too few samples, and
    TrajectoryError for a line that does not hold one finite number a column; both name the line.
    """
    columns = [CsvColumn(TIME, (DIMENSIONS["time"],)), *coordinate_columns(q_names, q_units)]
    table = read_table(file, _KEY, columns, TrajectoryError, TIP_COLUMNS)
    if len(table.lines) < 2:
        message = f"{file.name}: {len(table.lines)} samples; at least two are needed"
        raise MechanismError(_KEY, message)
    values = np.column_stack([table.numbers[column.name] for column in columns])
    return SampleTable(values[:, 0].copy(), np.ascontiguousarray(values[:, 1:]), table)
