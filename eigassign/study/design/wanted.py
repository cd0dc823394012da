"""What the targets of a case ask for, at the samples of its trajectories.

A requirement is at all samples, those of one trajectory, or a part of it (`Wanted.rows`). There the
frequency of its mode shall be between ``lower_hz`` and ``upper_hz``: both are the same where a
frequency is wanted, and one is missing (infinite) for a limit. A band to keep out of is between
them; a gap is ``lower_hz`` wide at least.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.assignment import sample_target, trapezoidal_weights
from eigassign.assignment.checks import frozen
from eigassign.case import (
    CaseFile,
    Choices,
    FollowedMode,
    FrequencyFile,
    FrequencyProfile,
    GapTarget,
    Harmonic,
    KeepOutTarget,
    Requirement,
)
from eigassign.case.table import Column, read_table
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

    @property
    def hz(self) -> Floats:
        """The wanted frequency (n,)."""
        return self.lower_hz

    @property
    def mode(self) -> int:
        """The mode, the lower one of a gap."""
        return self.requirement.modes[0]

    @property
    def weight(self) -> float:
        """What its errors are multiplied by."""
        return self.requirement.target.weight


def target_frequencies(file: CaseFile, path: Trajectories) -> tuple[Wanted, ...]:
    """What each of `CaseFile.requirements` asks for, in their order.

    Raises CaseError where a profile ends before a trajectory does, a part of a trajectory has no
    sample, or a file cannot be read.
    """
    return tuple(_wanted(file, each, path) for each in file.requirements)


def time_weights(path: Trajectories) -> Floats:
    """ω (n_t,) in s of the integral over every trajectory for itself, by the trapezoidal rule."""
    return path.weights(trapezoidal_weights)


def _wanted(file: CaseFile, requirement: Requirement, path: Trajectories) -> Wanted:
    rows = _rows(file, requirement, path)
    n, target, place = rows.stop - rows.start, requirement.target, requirement.place
    lowest, highest = frozen(np.full(n, -np.inf)), frozen(np.full(n, np.inf))
    if isinstance(target, GapTarget):
        lower = np.full(n, target.gap.at_least)
        return Wanted(requirement, rows, frozen(lower), highest)
    if isinstance(target, KeepOutTarget):
        if not isinstance(target.keep_out, Harmonic):
            low, high = target.keep_out
            return Wanted(requirement, rows, frozen(np.full(n, low)), frozen(np.full(n, high)))
        band = target.keep_out
        middle = band.harmonic * _sampled(file, band.of, f"{place}.keep_out.of", rows, path)
        below, above = (frozen(middle * (1.0 + side)) for side in (-band.margin, band.margin))
        return Wanted(requirement, rows, below, above)
    hz = _sampled(file, target.curve, f"{place}.{target.kind}", rows, path)
    return Wanted(
        requirement,
        rows,
        lowest if target.kind == "at_most" else hz,
        highest if target.kind == "at_least" else hz,
    )


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
        columns = [Column(name, (DIMENSIONS[name],)) for name in ("time", "frequency")]
        with located(file):
            numbers = read_table(Path(curve.file), f"{key}.file", columns).numbers
        return numbers["frequency"], numbers["time"]
    return float(curve), None


# --- Modes that are named by their shape


def named_pose(file: CaseFile, followed: FollowedMode, path: Trajectories) -> tuple[Floats, Floats]:
    """q (n_q,) and y (n_y,) at which mode `like` has the shape to follow.

    Between samples of a trajectory q is linear in time. What `design` does not name is as in the
    file, and so is what trajectories set where the pose is given by its coordinates.
    """
    pose, y = followed.at, initial_design(file)
    if pose.time is None:
        q = np.append(np.array(pose.q), written_loads(file))
    else:
        rows = path.rows_of(pose.trajectory)
        time_s, own = path.time_s[rows], path.q[rows]
        q = np.array([np.interp(pose.time, time_s, own[:, i]) for i in range(own.shape[1])])
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
    return frozen(q), frozen(y)
