"""What the targets of a case ask for, at the samples of its trajectories.

A requirement is at all samples, those of one trajectory, or a part of it (`Wanted.rows`). There the
frequency of its mode shall be between ``lower_hz`` and ``upper_hz``: both are the same where a
frequency is wanted, and one is missing (infinite) for a limit. A band to keep out of is between
them; a gap is ``lower_hz`` wide at least.

Modes are numbered from 1; those followed by their shape −1, −2, …: the last of them named is −1.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.assignment.checks import frozen
from eigassign.assignment.targets import sample_target, trapezoidal_weights
from eigassign.case.case_file import CaseFile
from eigassign.case.schema.design import Choices
from eigassign.case.schema.targets import (
    FollowedMode,
    FrequencyFile,
    FrequencyProfile,
    GapTarget,
    Harmonic,
    KeepOutTarget,
    Requirement,
)
from eigassign.case.table import CsvColumn, read_table
from eigassign.case.units import DIMENSIONS
from eigassign.errors import CaseError, UsageError
from eigassign.mechanism.kinematics.parameters import initial_design, written_loads
from eigassign.mechanism.trajectory.trajectory import Trajectories
from eigassign.study.build import located

Floats = NDArray[np.float64]
_Curve = float | FrequencyProfile | FrequencyFile


@dataclass(frozen=True)
class Wanted:
    """One requirement at those ``rows`` of all samples where it holds; (n,) in Hz."""

    requirement: Requirement
    rows: slice
    lower_hz: Floats
    upper_hz: Floats
    mode: int  # the lower one of a gap, the first named one of a band

    @property
    def hz(self) -> Floats:
        """The wanted frequency (n,)."""
        return self.lower_hz

    @property
    def weight(self) -> float:
        """The factor of its errors."""
        return self.requirement.target.weight


def target_frequencies(file: CaseFile, path: Trajectories) -> tuple[Wanted, ...]:
    """What each of `CaseFile.requirements` asks for, in their order.

    Raises CaseError where a profile ends before a trajectory does, a part of a trajectory has no
    sample, or a file cannot be read.
    """
    return tuple(_wanted(file, each, path) for each in file.requirements)


def followed_modes(file: CaseFile) -> tuple[FollowedMode, ...]:
    """The modes that targets follow by their shape, each once, in the order of the file."""
    named = (each.followed for each in file.requirements if each.followed is not None)
    return tuple(dict.fromkeys(named))


def time_weights(path: Trajectories) -> Floats:
    """ω (n_t,) in s of the integral over every trajectory for itself, by the trapezoidal rule."""
    return path.weights(trapezoidal_weights)


def _wanted(file: CaseFile, requirement: Requirement, path: Trajectories) -> Wanted:
    rows = _rows(file, requirement, path)
    lower, upper = _edges(file, requirement, rows, path)
    mode = requirement.modes[0] if requirement.modes else 1
    if requirement.followed is not None:
        followed = followed_modes(file)
        mode = followed.index(requirement.followed) - len(followed)
    return Wanted(requirement, rows, frozen(lower), frozen(upper), mode)


def _edges(
    file: CaseFile, requirement: Requirement, rows: slice, path: Trajectories
) -> tuple[Floats, Floats]:
    """`Wanted.lower_hz` and `Wanted.upper_hz`."""
    n, target, place = rows.stop - rows.start, requirement.target, requirement.place
    lowest, highest = np.full(n, -np.inf), np.full(n, np.inf)
    if isinstance(target, GapTarget):
        return np.full(n, target.gap.at_least), highest
    if isinstance(target, KeepOutTarget):
        if not isinstance(target.keep_out, Harmonic):
            low, high = target.keep_out
            return np.full(n, low), np.full(n, high)
        band = target.keep_out
        middle = band.harmonic * _sampled(file, band.of, f"{place}.keep_out.of", rows, path)
        return middle * (1.0 - band.margin), middle * (1.0 + band.margin)
    hz = _sampled(file, target.curve, f"{place}.{target.kind}", rows, path)
    return lowest if target.kind == "at_most" else hz, highest if target.kind == "at_least" else hz


def _rows(file: CaseFile, requirement: Requirement, path: Trajectories) -> slice:
    target = requirement.target
    rows = path.rows_of(target.trajectory)
    if target.during is None:
        return rows
    time_s, (first, last) = path.time_s[rows], target.during
    slack = 1e-9 * float(np.ptp(time_s))  # rounding of a time grid, far below a step
    inside = np.flatnonzero((time_s >= first - slack) & (time_s <= last + slack))
    if not len(inside):
        message = f"no sample of the trajectory is between {first:g} and {last:g} s"
        raise CaseError((file.problem(f"{requirement.place}.during", message),))
    return slice(rows.start + int(inside[0]), rows.start + int(inside[-1]) + 1)


def _sampled(file: CaseFile, curve: _Curve, key: str, rows: slice, path: Trajectories) -> Floats:
    """The frequency (n,) in Hz at ``rows``, each trajectory by its own time."""
    knots = _knots(file, curve, key)
    found = []
    for part, own in zip(path.parts, path.rows, strict=True):
        first, last = max(own.start, rows.start), min(own.stop, rows.stop)
        if first >= last:
            continue
        try:
            found.append(sample_target(path.time_s[first:last], *knots))
        except UsageError as error:
            which = f" (trajectory {part.name!r})" if path.several else ""
            raise CaseError((file.problem(key, f"{error}{which}"),)) from error
    return frozen(np.concatenate(found))


def _knots(file: CaseFile, curve: _Curve, key: str) -> tuple[ArrayLike, ArrayLike | None]:
    """Frequency in Hz, and the times in s that it is given at."""
    if isinstance(curve, FrequencyProfile):
        return curve.frequency, curve.time
    if isinstance(curve, FrequencyFile):
        columns = [CsvColumn(name, (DIMENSIONS[name],)) for name in ("time", "frequency")]
        with located(file):
            numbers = read_table(Path(curve.file), f"{key}.file", columns).numbers
        return numbers["frequency"], numbers["time"]
    return float(curve), None


# --- Modes that are named by their shape


def named_design(file: CaseFile, followed: FollowedMode) -> Floats:
    """y (n_y,) at which mode `like` has the shape to follow; what it leaves out as in the file."""
    y = initial_design(file)
    start = 0
    for name, entry in file.design.entries.items():
        given = followed.design.get(name)
        columns = slice(start, start + (len(entry.properties) if isinstance(entry, Choices) else 1))
        if isinstance(entry, Choices):
            if isinstance(given, str):
                y[columns] = [entry.choices[given][p] for p in entry.properties]
        elif given is not None:
            y[columns] = given
        start = columns.stop
    return frozen(y)


def named_pose(file: CaseFile, followed: FollowedMode, path: Trajectories, y: Floats) -> Floats:
    """q (n_q,) at which it has that shape, of design y where coordinates follow the design.

    Between samples of the whole trajectory q is linear in time. What trajectories set is as in the
    file where the pose is given by its coordinates.
    """
    pose = followed.at
    if pose.time is None:
        return frozen(np.append(np.array(pose.q), written_loads(file)))
    rows = path.whole.rows_of(pose.trajectory)
    time_s, own = path.whole.time_s[rows], path.whole.at(y)[0][rows]
    return frozen(np.array([np.interp(pose.time, time_s, column) for column in own.T]))
