"""The measurements of a case, each at its pose, in SI units.

A measurement is made at q, or at a time of a trajectory: there q is linear between samples. The
trajectory is that of the design as the file writes it, for that is what the drives were told.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike

from eigassign.arrays import Floats
from eigassign.assignment.program import frozen
from eigassign.case.case_file import CaseFile
from eigassign.case.reader import shown, unknown
from eigassign.case.schema.design import Tolerance
from eigassign.case.schema.study import MOST_MEASUREMENTS, Measurement, MeasurementFile
from eigassign.case.table import CsvColumn, CsvTable, read_table, renamed
from eigassign.case.units import DIMENSIONS
from eigassign.errors import CaseError, MechanismError
from eigassign.mechanism.trajectory.trajectory import TIME, coordinate_columns
from eigassign.study.built_case import BuiltCase

_KEY = "measurements.file"
MODES_AROUND = 4  # of the model, more than twice as many as there are frequencies at a pose


@dataclass(frozen=True)
class PosedMeasurement:
    """One measured frequency and where it was measured."""

    label: str  # where it is written: "arm.csv:3", "measurements[2]"
    time_s: float | None
    trajectory: str | None
    q: Floats  # (n_q,) in rad or m
    mode: int  # 0 until it is paired
    hz: float  # of a range its middle
    deviation_hz: float  # standard; of a range half its width
    is_range: bool = False
    paired_hz: float | None = None  # of the model as it is written, if the mode was told by that


def read_measurements(case: BuiltCase) -> tuple[tuple[PosedMeasurement, ...], tuple[str, ...]]:
    """All measurements in the order given, and notes on what was ignored.

    Raises CaseError for a file that cannot be read or holds what is no measurement (with its line),
    for a time outside the trajectory, for a trajectory that cannot be followed, and for ranges
    beside others.
    """
    given = case.file.measurements or ()
    if isinstance(given, MeasurementFile):
        with case.located():
            found, notes = _from_file(case, given)
            return _paired(case, found), notes
    posed = tuple(_posed(case, f"measurements[{k}]", each) for k, each in enumerate(given))
    for k, one in enumerate(posed):
        if one.is_range != posed[0].is_range:
            message = "ranges and frequencies with a deviation do not go together: give one kind"
            raise CaseError((case.file.problem(f"measurements[{k}].frequency", message),))
    return _paired(case, posed), ()


def _paired(case: BuiltCase, given: tuple[PosedMeasurement, ...]) -> tuple[PosedMeasurement, ...]:
    """With the modes of those that name none: nearest in frequency, no two of a pose alike."""
    from scipy.optimize import linear_sum_assignment

    found, y0 = list(given), case.initial_design
    for q in {one.q.tobytes(): one.q for one in given if not one.mode}.values():
        rows = [k for k, one in enumerate(given) if one.q.tobytes() == q.tobytes()]
        taken, rows = {given[k].mode for k in rows}, [k for k in rows if not given[k].mode]
        count = min(len(case.model().pencil.elastic), MODES_AROUND + 2 * len(rows) + max(taken))
        hz = case.model().frequencies(q, y0, count)[0]
        left = [mode for mode in range(1, count + 1) if mode not in taken]
        if len(left) < len(rows):
            has = f"{len(rows)} frequencies at one pose, of which the model has {len(left)} modes"
            what = f"{has}: give its links more elements, or leave some out"
            raise MechanismError("measurements", f"{given[rows[0]].label}: {what}")
        ratios = [[hz[mode - 1] / given[k].hz for mode in left] for k in rows]
        wide = np.log(ratios) ** 2  # squares keep the order of those that are as far off
        for i, j in zip(*linear_sum_assignment(wide), strict=True):
            written_hz = float(hz[left[j] - 1])
            found[rows[i]] = replace(given[rows[i]], mode=left[j], paired_hz=written_hz)
    return tuple(found)


def _posed(case: BuiltCase, label: str, given: Measurement, where: str = "") -> PosedMeasurement:
    """A measurement at its pose; ``where`` begins what is said of one in a table."""
    with case.located():
        if given.time is None:
            q = _with_loads(case.file, given.q or (), given.trajectory)
        else:
            path, key = case.trajectory, _KEY if where else f"{label}.time"
            time_s = path.time_s[path.rows_of(given.trajectory)]
            slack = 1e-9 * float(np.ptp(time_s))
            if not time_s[0] - slack <= given.time <= time_s[-1] + slack:
                lasts = f"the trajectory lasts from {time_s[0]:g} to {time_s[-1]:g} s"
                raise MechanismError(key, f"{where}{given.time:g} s is outside: {lasts}")
            q = path.pose(given.time, given.trajectory)
    ends, of = given.frequency, given.deviation
    if is_range := isinstance(ends, tuple):
        hz, deviation = 0.5 * (ends[0] + ends[1]), 0.5 * (ends[1] - ends[0])
    else:
        hz, deviation = float(ends), of.deviation(ends) if of else 0.0
    own = given.trajectory, frozen(q), given.mode or 0, hz, deviation, is_range
    return PosedMeasurement(label, given.time, *own)


def _with_loads(file: CaseFile, coordinates: ArrayLike, name: str | None) -> Floats:
    """q of a pose: loads as the trajectory of that name sets them, without one as written."""
    names = [each for _, each, _ in file.trajectories]
    loads = [
        load.written if name is None else load.along[names.index(name)]
        for load in file.loads.values()
    ]
    return np.append(np.asarray(coordinates, dtype=np.float64), loads)


# --- From a CSV file


def _from_file(
    case: BuiltCase, given: MeasurementFile
) -> tuple[tuple[PosedMeasurement, ...], tuple[str, ...]]:
    file, hz = case.file, DIMENSIONS["frequency"]
    names = list(file.coordinates)
    columns = [
        CsvColumn(TIME, (DIMENSIONS["time"],), optional=True),
        CsvColumn("trajectory", optional=True),
        CsvColumn("mode", (DIMENSIONS["fraction"],), optional=True),
        CsvColumn("frequency", (hz,), instead="lower"),
        CsvColumn(
            "deviation", (hz, DIMENSIONS["fraction"]), given.deviation is not None, "", "lower"
        ),
        *(CsvColumn(name, (hz,), optional=True) for name in ("lower", "upper")),
        *(
            CsvColumn(column.name, column.dimensions, optional=True)
            for column in coordinate_columns(names, file.coordinate_units)
        ),
    ]
    table = read_table(Path(given.file), _KEY, renamed(columns, given.columns, _KEY))
    if not 0 < len(table.lines) <= MOST_MEASUREMENTS:
        some = f"more than {MOST_MEASUREMENTS}" if table.lines else "no"
        raise MechanismError(_KEY, f"{table.file}: {some} measurements")
    own = {"frequency", "deviation", "lower", "upper"} & table.numbers.keys()
    if own & {"lower", "upper"} and (own != {"lower", "upper"} or given.deviation is not None):
        expected = "of ranges give lower and upper alone, without frequency and deviation"
        raise MechanismError(_KEY, f"{table.file}: {expected}")
    with_q = [name for name in names if name in table.numbers]
    if len(with_q) != (0 if TIME in table.numbers else len(names)):
        expected = f"either the column {TIME}, or one for each coordinate ({', '.join(names)})"
        raise MechanismError(_KEY, f"{table.file}: expected {expected}")
    return tuple(_rows(case, table, given.deviation, names)), table.notes


def _rows(
    case: BuiltCase, table: CsvTable, default: Tolerance | None, names: list[str]
) -> Iterator[PosedMeasurement]:
    known = [name for _, name, _ in case.file.trajectories]
    for k in range(len(table.lines)):
        where, deviation = f"{table.where(k)}: ", default
        row = {name: column[k] for name, column in table.numbers.items()}
        least = "lower" if "lower" in row else "frequency"
        low, high, mode = row[least], row.get("upper", np.inf), row.get("mode", 1.0)
        if not low < high:
            raise MechanismError(_KEY, f"{where}lower {low:g} is not below upper {high:g}")
        if not (mode.is_integer() and 1 <= mode <= 1000):
            raise MechanismError(_KEY, f"{where}column mode: {mode:g} is not a mode (1, 2, …)")
        if not low > 0.0:
            raise MechanismError(_KEY, f"{where}column {least}: must be > 0 Hz, got {low:g}")
        named = table.words["trajectory"][k] if "trajectory" in table.words else ""
        if named and named not in known:
            raise MechanismError(_KEY, where + unknown("trajectory", named, known))
        if TIME in row and not known:
            raise MechanismError(_KEY, f"{where}there is no trajectory: give q")
        if TIME in row and not named and len(known) > 1:
            message = f"which trajectory? Give a column trajectory ({', '.join(known)})"
            raise MechanismError(_KEY, where + message)
        if "deviation" in row:
            if not row["deviation"] > 0.0:
                said = f"must be > 0, got {shown(row['deviation'])}"
                raise MechanismError(_KEY, f"{where}column deviation: {said}")
            deviation = Tolerance(row["deviation"], not table.dimensions["deviation"].si)
        given = Measurement.model_construct(
            time=row.get(TIME),
            q=None if TIME in row else tuple(row[name] for name in names),
            trajectory=named or None,
            mode=int(mode) if "mode" in row else None,
            frequency=(low, high) if least == "lower" else low,
            deviation=deviation,
        )
        yield _posed(case, table.where(k), given, where)
