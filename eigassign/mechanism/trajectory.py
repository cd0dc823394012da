"""The trajectory q(t) of a case: joint samples, a CSV file of them, or a path of the tip.

Shapes: n samples in time, n_q coordinates. SI units, angles in rad.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.case import FileTrajectory, PointTrajectory, SampledTrajectory, TipTrajectory
from eigassign.errors import MechanismError, TrajectoryError
from eigassign.mechanism.attitudes import planar_attitude, spatial_attitude
from eigassign.mechanism.course import Course
from eigassign.mechanism.inverse_kinematics import follow
from eigassign.mechanism.paths import WAYPOINTS, Path, spline, straight
from eigassign.mechanism.point_to_point import point_to_point, shared_times
from eigassign.mechanism.timing import timing_law
from eigassign.mechanism.tip_chain import TipChain
from eigassign.mechanism.trajectory_file import read_samples

_BACKWARDS = "time must increase, and goes from {:g} s to {:g} s"
_PATHS: dict[str, Callable[[ArrayLike], Path]] = {"spline": spline, "straight": straight}

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Trajectory:
    """Where the mechanism is when. ``tip`` is None unless the case gives a path of the tip."""

    time_s: Floats  # (n,) strictly increasing, n >= 2
    q: Floats  # (n, n_q) in rad or m
    tip: Floats | None  # (n, 2 or 3) in m
    notes: tuple[str, ...] = ()  # what a reader should know: choices made, columns ignored
    corners_s: tuple[float, ...] = ()  # times in between at which it is known that q̇ may jump

    def __post_init__(self) -> None:
        for array in (self.time_s, self.q, self.tip):
            if array is not None:
                array.setflags(write=False)


def build_trajectory(
    spec: SampledTrajectory | FileTrajectory | PointTrajectory | TipTrajectory,
    q_names: Sequence[str],
    tip_chain: Callable[[str, bool], TipChain],
    folder: FilePath = FilePath(),
    q_units: Sequence[str] = (),
) -> Trajectory:
    """The trajectory that a case asks for, in the coordinates ``q_names``.

    ``tip_chain(node, oriented)`` gives the chain of a tip path's node, its turning looked at if
    oriented, and is called for nothing else;
    ``folder`` is what the name of a CSV file is relative to; ``q_units`` are "rad" or "m" for each
    coordinate, all rad if empty. Raises MechanismError for what is
    wrong as a whole, TrajectoryError for what is wrong with one sample.
    """
    if isinstance(spec, TipTrajectory):
        return _from_tip_path(spec, q_names, tip_chain)
    if isinstance(spec, FileTrajectory):
        return _from_file(spec, q_names, q_units, folder)
    if isinstance(spec, PointTrajectory):
        return _from_points(spec, q_names)
    return _from_samples(spec, q_names, q_units)


def _from_tip_path(
    spec: TipTrajectory, q_names: Sequence[str], tip_chain: Callable[[str, bool], TipChain]
) -> Trajectory:
    """q(t) with tip(q(t)) = p(s(t/T)), turned as asked for, at equal steps in time."""
    path, attitude = _PATHS[spec.path](spec.waypoints), None
    if spec.angle is not None:
        attitude = planar_attitude(path, spec.angle, spec.path)
    elif spec.orientation is not None:
        attitude = spatial_attitude(path, spec.orientation, spec.path)
    chain = tip_chain(spec.tip, attitude is not None)
    _check_dimension(chain, path)
    tau = np.linspace(0.0, 1.0, spec.samples)
    s = timing_law(spec.timing, spec.acceleration_share).position(tau)
    s = np.maximum.accumulate(np.clip(s, 0.0, 1.0))  # round-off at the ends
    course = Course(path, s, spec.duration * tau, attitude)
    followed = follow(chain, course, spec.branch, spec.start)
    corners = np.interp(course.corners(), course.s, course.time_s)
    return Trajectory(
        course.time_s, followed.q, followed.tip, followed.notes, tuple(corners.tolist())
    )


def _check_dimension(chain: TipChain, path: Path) -> None:
    d = chain.look(np.zeros((1, len(chain.kinds)))).point.shape[1]
    if path.coefficients.shape[2] != d:
        raise MechanismError(WAYPOINTS, f"the tip moves in {d} dimensions: give {d} coordinates")


def _from_file(
    spec: FileTrajectory, q_names: Sequence[str], q_units: Sequence[str], folder: FilePath
) -> Trajectory:
    table = read_samples(folder / spec.file, q_names, q_units)
    for k in _not_later(table.time_s):
        message = f"{table.where(k)}: {_BACKWARDS.format(*table.time_s[k - 1 : k + 1])}"
        raise TrajectoryError("trajectory.file", message, k)
    notes = (*table.notes, *_jumps(table.q, q_names, q_units))
    return Trajectory(table.time_s, table.q, None, notes)


def _from_samples(
    spec: SampledTrajectory, q_names: Sequence[str], q_units: Sequence[str]
) -> Trajectory:
    """Samples given in the case: times as given, or at equal steps over the duration from 0."""
    q = _checked_rows(spec.q, q_names, "q", "sample")
    if spec.time is None:
        time_s = np.linspace(0.0, spec.duration or 1.0, len(q))
    else:
        time_s = _checked_time(spec.time, len(q), "time", "sample")
    return Trajectory(time_s, q, None, _jumps(q, q_names, q_units))


def _from_points(spec: PointTrajectory, q_names: Sequence[str]) -> Trajectory:
    """Point to point, in equal steps of time."""
    points = _checked_rows(spec.points, q_names, "points", "point")
    if spec.times is None:
        reached = shared_times(points, spec.duration or 1.0)
        said: tuple[str, ...] = (
            f"the points are reached at {', '.join(f'{t:.6g}' for t in reached)} s: time shared in "
            "proportion to the largest move of a coordinate relative to its range",
        )
    else:
        reached, said = _checked_time(spec.times, len(points), "times", "point"), ()
    law = timing_law(spec.timing, spec.acceleration_share)
    motion = point_to_point(points, reached, law, spec.samples)
    corners = tuple(reached[1:-1].tolist()) if spec.timing == "linear" else ()  # elsewhere at rest
    return Trajectory(motion.time_s, motion.q, None, said if len(points) > 2 else (), corners)


def _checked_rows(
    rows: Sequence[Sequence[float]], q_names: Sequence[str], key: str, what: str
) -> Floats:
    """Rows of finite coordinates (n, n_q), at least two."""
    for k, row in enumerate(rows):
        path = f"trajectory.{key}[{k}]"
        if len(row) != len(q_names):
            message = f"{what} {k} has {len(row)} values for the coordinates {', '.join(q_names)}"
            raise TrajectoryError(path, message, k)
        if not np.isfinite(row).all():
            raise TrajectoryError(path, f"{what} {k} is not finite", k)
    if len(rows) < 2:
        raise MechanismError(f"trajectory.{key}", f"a trajectory needs at least two {what}s")
    return np.array(rows, dtype=np.float64)


def _checked_time(time: Sequence[float], n: int, key: str, what: str) -> Floats:
    time_s = np.array(time, dtype=np.float64)
    if len(time_s) != n:
        raise MechanismError(f"trajectory.{key}", f"{len(time_s)} times for {n} {what}s")
    for k in _not_later(time_s):
        message = f"{what} {k}: {_BACKWARDS.format(*time_s[k - 1 : k + 1])}"
        raise TrajectoryError(f"trajectory.{key}[{k}]", message, k)
    return time_s


def _not_later(time_s: Floats) -> list[int]:
    """Samples that do not come after the one before them (NaN comes after nothing)."""
    return [int(k) + 1 for k in np.flatnonzero(~(np.diff(time_s) > 0.0))]


def _jumps(q: Floats, q_names: Sequence[str], q_units: Sequence[str]) -> tuple[str, ...]:
    """A note for each angle that moves by more than half a turn from sample to sample."""
    steps = np.abs(np.diff(q, axis=0))
    return tuple(
        f"{name} jumps by {steps[k, i]:.3g} rad from sample {k} to {k + 1}; is it cut at 360 deg?"
        for i, (name, unit) in enumerate(
            zip(q_names, q_units or ["rad"] * len(q_names), strict=True)
        )
        if unit == "rad" and steps[k := int(np.argmax(steps[:, i])), i] > np.pi
    )
