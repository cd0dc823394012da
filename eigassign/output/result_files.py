"""Every sample of a run as CSV.

trajectory.csv is what `trajectory: {file: …}` reads. Units are those of the case file, else SI.
Numbers are written as ``repr`` writes them, so that in SI they read back to the last bit; one that
an expansion could not give is left empty.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Sequence
from itertools import count, repeat, zip_longest

import numpy as np

from eigassign.arrays import Floats
from eigassign.case.units import handy_unit
from eigassign.mechanism.trajectory.trajectory import TIME, TIP_COLUMNS
from eigassign.output.store.cache import hdf5
from eigassign.study.results import RunResults, StaticRow, TargetStudy, TrajectoryRow

Column = tuple[str, Sequence[object]]  # heading, one entry a sample


def sample_files(results: RunResults) -> dict[str, bytes]:
    """The CSV files of a run by name; none without a trajectory."""
    if not results.trajectories:
        return {}
    several = len(results.trajectories) > 1
    files = {
        f"trajectory_{row.name}.csv" if several else "trajectory.csv": trajectory_csv(results, row)
        for row in results.trajectories
    }
    files["frequencies.csv"] = csv_text(frequency_columns(results))
    files |= _response_files(results)
    if results.moves:
        every = [
            (name, a, t)
            for row in results.moves
            for name, *own in row.impulses
            for a, t in zip(*own, strict=True)
        ]
        headings = "shaper", "amplitude", "time [s]"
        columns = zip(*every, strict=True) if every else ((), (), ())
        files["shapers.csv"] = csv_text([*zip(headings, columns, strict=True)])
        files["shapers.txt"] = "\n".join(row.lines for row in results.moves).encode()
        for k, row in enumerate(results.moves, start=1):
            if row.command is not None:
                times, q = row.command
                turned = map(_column, results.q_names, results.q_units, q.T)
                files[f"zv_over_time_{k}.csv"] = csv_text(
                    [(f"{TIME} [s]", times.tolist()), *turned]
                )
    for name, rows in {"drives.csv": results.drives, "statics.csv": results.statics}.items():
        if rows:
            files[name] = csv_text([*_samples(results), *_both(rows)])
    return files


def trajectory_csv(results: RunResults, row: TrajectoryRow) -> bytes:
    """Time, coordinates and, where the case gives its path, the tip of one trajectory."""
    columns = [*_motion(results, row.rows)]
    if row.tip is not None:
        names = TIP_COLUMNS[: row.tip.shape[1]]
        columns += map(_column, names, repeat(row.tip_unit), row.tip.T)
    return csv_text(columns)


def frequency_columns(results: RunResults) -> list[Column]:
    """Every sample with its frequencies in Hz: of targets, and of the expanded modes."""
    if not results.targets:
        return [*_samples(results), *_expanded(results)]
    return [*_samples(results), *_assigned(results), *_others(results)]


def _response_files(results: RunResults) -> dict[str, bytes]:
    """modes.csv: a row a sample and mode; response.csv: a row a frequency; H in response.h5."""
    if not results.responses:
        return {}
    last = max(results.responses, key=lambda row: row.modes_hz.shape[1])
    n, r = last.modes_hz.shape
    heads = ("",) if len(last.ratios) < 2 else (" least", " most")
    own: dict[str, Floats] = {"frequency [Hz]": last.modes_hz}
    own |= {f"damping ratio{e} [1]": z for e, z in zip(heads, last.ratios, strict=True)}
    with np.errstate(divide="ignore"):
        for place, constant in zip(last.places, np.moveaxis(last.constants, 2, 0), strict=True):
            own[f"{place} constant [1/sqrt(kg)]"] = constant
            own[f"{place} modal mass [kg]"] = mass = 1.0 / constant**2
            own[f"{place} modal stiffness [N/m]"] = mass * (2.0 * np.pi * last.modes_hz) ** 2
    modes: list[Column] = [(h, [v for v in one for _ in range(r)]) for h, one in _samples(results)]
    modes += [("mode", [*range(1, r + 1)] * n), ("tracked", last.tracked.ravel().tolist())]
    modes += [(head, values.ravel().tolist()) for head, values in own.items()]
    table, arrays = dict[str, Floats](), {"time_s": results.time_s, "q": results.q}
    for k, one in enumerate(results.responses, 1):
        table[f"{one.name} frequency [Hz]"] = one.frequency_hz
        table[f"{one.name} least dynamic stiffness [N/m]"] = one.stiffness.min(axis=0)
        table[f"{one.name} least real part [m/N]"] = one.least_real
        if one.initial is not None:
            table[f"{one.name} least dynamic stiffness, initial [N/m]"] = one.initial
        arrays |= {f"{k}/{key}": getattr(one, key) for key in ("frequency_hz", "response")}
    named = {str(k): one.name for k, one in enumerate(results.responses, 1)}
    rows = zip_longest(*table.values(), fillvalue=math.nan)
    columns = zip(table, map(list, zip(*rows, strict=True)), strict=True)
    files = {"modes.csv": csv_text(modes), "response.csv": csv_text([*columns])}
    return files | {"response.h5": hdf5(arrays, named)}


def _samples(results: RunResults) -> Iterator[Column]:
    if len(results.trajectories) > 1:
        yield "trajectory", [row.name for row in results.trajectories for _ in range(row.samples)]
    yield from _motion(results, slice(0, results.time_s.size))


def _both(rows: Sequence[StaticRow]) -> Iterator[Column]:
    """What drives exert, or stiffnesses, compliances and sags, before and after."""
    for row in rows:
        for when, curve in (("initial", row.initial_curve), ("exact", row.optimal_curve)):
            yield _column(f"{row.name}{row.quantity} {when}", row.unit, curve)


def _column(name: str, unit: str, values: Floats) -> Column:
    """The values, SI, in what their unit is answered in, else in SI."""
    answered, size = handy_unit(unit)
    return f"{name} [{answered}]", (values / size).tolist()


def _motion(results: RunResults, rows: slice) -> Iterator[Column]:
    yield f"{TIME} [s]", results.time_s[rows].tolist()
    yield from map(_column, results.q_names, results.q_units, results.q[rows].T)


def _assigned(results: RunResults) -> Iterator[Column]:
    """A group of columns a mode, limit or band, each sample once; asked twice, another one."""
    groups: dict[str, list[TargetStudy]] = {}
    for target in results.targets:
        name = target.asked.curve_name if target.asked.is_goal else target.label
        names = (f"{name} ({k})" if k > 1 else name for k in count(1))
        rows = target.asked.rows
        free = (
            name
            for name in names
            if all(
                own.asked.rows.stop <= rows.start or rows.stop <= own.asked.rows.start
                for own in groups.get(name, ())
            )
        )
        groups.setdefault(next(free), []).append(target)
    for name, targets in groups.items():
        for kind, curves in _curves(targets).items():
            values = np.full(results.time_s.size, np.nan)
            for target, hz in zip(targets, curves, strict=True):
                if hz is not None:
                    values[target.asked.rows] = hz
            yield f"{name} {kind} [Hz]", values.tolist()


def _curves(targets: Sequence[TargetStudy]) -> dict[str, list[Floats | None]]:
    """The edges, and the modes before and after, of each target; by what they are called."""
    found: dict[str, list[Floats | None]] = {
        name: [getattr(one.frequencies, f"{name.replace(' ', '_')}_hz") for one in targets]
        for name in targets[0].asked.columns
    }
    near = [{row.mode: row for row in one.near or ()} for one in targets]
    for mode in sorted(set().union(*near)):
        rows = [own.get(mode) for own in near]
        found[f"mode {mode} initial"] = [None if row is None else row.initial_hz for row in rows]
        found[f"mode {mode} exact"] = [None if row is None else row.optimal_hz for row in rows]
    return found


def _others(results: RunResults) -> Iterator[Column]:
    """Expanded modes that no target names, before and after (the paper's Figure 5)."""
    expanded = {study.mode for study in results.studies}
    for row in results.other_modes:
        if row.mode in expanded:
            yield f"mode {row.mode} initial [Hz]", row.initial_hz.tolist()
            yield f"mode {row.mode} exact [Hz]", row.optimal_hz.tolist()


def _expanded(results: RunResults) -> Iterator[Column]:
    """Exact frequencies at the initial design, and those of both expansions."""
    for study in results.studies:
        if study.over_time is not None:
            for kind in ("exact", "taylor", "linearised"):
                hz = getattr(study.over_time, f"{kind}_hz")
                yield f"mode {study.mode} {kind} [Hz]", hz.tolist()


def csv_text(columns: Sequence[Column]) -> bytes:
    """A heading and its numbers in each column; what is not finite is left empty."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([heading for heading, _ in columns])
    for row in zip(*(values for _, values in columns), strict=True):
        gaps = (isinstance(value, float) and not math.isfinite(value) for value in row)
        writer.writerow(["" if gap else value for gap, value in zip(gaps, row, strict=True)])
    return text.getvalue().encode()
