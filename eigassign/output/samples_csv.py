"""trajectory.csv, as `trajectory: {file: …}` reads it, and frequencies.csv: every sample of a run.

Numbers are written as ``repr`` writes them, so that they read back to the last bit; a number that
an expansion could not give is left empty.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from eigassign.mechanism.trajectory_file import TIME, TIP_COLUMNS
from eigassign.study.findings import Findings, TargetStudy, TrajectoryRow

Floats = NDArray[np.float64]
Column = tuple[str, Sequence[object]]  # heading, one entry a sample


def sample_files(findings: Findings) -> dict[str, bytes]:
    """The CSV files of a run by name; none without a trajectory."""
    if not findings.trajectories:
        return {}
    several = len(findings.trajectories) > 1
    files = {
        f"trajectory_{row.name}.csv" if several else "trajectory.csv": trajectory_csv(findings, row)
        for row in findings.trajectories
    }
    return {**files, "frequencies.csv": frequencies_csv(findings)}


def trajectory_csv(findings: Findings, row: TrajectoryRow) -> bytes:
    """Time, coordinates and, where the case gives its path, the tip of one trajectory; SI."""
    columns = [*_motion(findings, row.rows)]
    if row.tip is not None:
        names = TIP_COLUMNS[: row.tip.shape[1]]
        places = zip(names, row.tip.T, strict=True)
        columns += [(f"{name} [m]", place.tolist()) for name, place in places]
    return _text(columns)


def frequencies_csv(findings: Findings) -> bytes:
    """Every sample with its frequencies in Hz: of targets, or without any of the expanded modes.

    Of several trajectories one below the other, the first column naming them.
    """
    everything = slice(0, findings.time_s.size)
    columns: list[Column] = []
    if len(findings.trajectories) > 1:
        columns.append(("trajectory", trajectory_names(findings)))
    columns += _motion(findings, everything)
    return _text([*columns, *(_assigned(findings) if findings.targets else _expanded(findings))])


def trajectory_names(findings: Findings, rows: slice = slice(None)) -> list[str]:
    """Which trajectory each sample belongs to."""
    names = [
        row.name for row in findings.trajectories for _ in range(row.rows.start, row.rows.stop)
    ]
    return names[rows]


def _motion(findings: Findings, rows: slice) -> Iterator[Column]:
    yield f"{TIME} [s]", findings.time_s[rows].tolist()
    for i, (name, unit) in enumerate(zip(findings.q_names, findings.q_units, strict=True)):
        yield f"{name} [{unit}]", findings.q[rows, i].tolist()


def _assigned(findings: Findings) -> Iterator[Column]:
    """One group of columns a mode, whichever trajectories its targets hold on."""
    for mode in dict.fromkeys(target.mode for target in findings.targets):
        own = [target for target in findings.targets if target.mode == mode]
        for kind in ("target", "initial", "predicted", "exact"):
            yield f"mode {mode} {kind} [Hz]", _scattered(own, kind, findings.time_s.size)


def _scattered(targets: Sequence[TargetStudy], kind: str, n: int) -> list[float]:
    values = np.full(n, np.nan)
    for target in targets:
        values[target.rows] = getattr(target, f"{kind}_hz")
    return [float(value) for value in values]


def _expanded(findings: Findings) -> Iterator[Column]:
    """At the initial design, with what both expansions make of it."""
    for study in findings.studies:
        if study.over_time is not None:
            for kind in ("exact", "taylor", "linearised"):
                hz = getattr(study.over_time, f"{kind}_hz")
                yield f"mode {study.mode} {kind} [Hz]", hz.tolist()


def _text(columns: Sequence[Column]) -> bytes:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([heading for heading, _ in columns])
    writer.writerows(
        [_cell(value) for value in row] for row in zip(*(v for _, v in columns), strict=True)
    )
    return text.getvalue().encode()


def _cell(value: object) -> str:
    if isinstance(value, float):
        return repr(value) if math.isfinite(value) else ""
    return str(value)
