"""The trajectory q(t) of a case: joint samples, a CSV file, points, or a path of the tip.

Several trajectories may be studied together. Their samples are stacked, but nothing is
differentiated, integrated or drawn from the end of one into the start of the next.

q, q̇ and q̈ are known at any time (`motion`). Where the velocity jumps (straight tip paths, points
joined by linear timing) there is a blow and no acceleration.

Shapes: n samples in time, n_q coordinates. SI units, angles in rad.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from types import MappingProxyType
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.arrays import Floats, Ints
from eigassign.brief import Brief
from eigassign.case.schema.trajectory import (
    FileTrajectory,
    PointTrajectory,
    SampledTrajectory,
    TipTrajectory,
)
from eigassign.case.table import CsvColumn, read_table, renamed
from eigassign.case.units import DIMENSIONS, handy
from eigassign.errors import MechanismError, TrajectoryError, UsageError
from eigassign.mechanism.inverse_kinematics.chain import (
    Course,
    TipChain,
    planar_attitude,
    spatial_attitude,
    tip_path,
)
from eigassign.mechanism.inverse_kinematics.follow import behind, follow, path_of_design
from eigassign.mechanism.trajectory.motion import (
    BESIDE,
    Motion,
    OfDesign,
    TipMotion,
    point_motion,
    sampled_motion,
    shared_times,
    timing_law,
)

TIME = "time"
TIP_COLUMNS = ("tip x", "tip y", "tip z")
_KEY = "trajectory.file"
_KINDS = {"rad": "angle", "m": "length"}
# Steps of a motion at least, where what drives exert is known: of 12 random paths of a tip its peak
# is missed by up to 6e-4, which what is looked at between them mends (`study.design.clearance`).
FINELY = 200


@dataclass(frozen=True, repr=False)
class Trajectory(Brief):
    """Where the mechanism is when, at the initial design.

    ``sampled`` is the trajectory without the instants that were put between its samples. Where a
    design has its duration, the same path takes another time.
    """

    time_s: Floats  # (n,) strictly increasing; one alone is a pose at rest
    q: Floats  # (n, n_q) in rad or m
    notes: tuple[str, ...] = ()  # what a reader should know: choices made, columns ignored
    known: Motion | TipMotion | None = None  # None where it is known at its samples only
    sampled: Trajectory | None = None
    stretch: tuple[int, float] | None = None  # which entry of y is its duration, and that here

    def __post_init__(self) -> None:
        for array in (self.time_s, self.q):
            array.setflags(write=False)

    @cached_property
    def motion(self) -> Motion | TipMotion:
        """q, q̇ and q̈ at any time: as it is known, else the spline through the samples."""
        return self.known or sampled_motion(self.time_s, self.q)

    @cached_property
    def tip(self) -> Floats | None:
        """Where the tip is (n, 2 or 3) in m, for every design; None without its path."""
        path = self.known
        return _stacked([path.tip(self.time_s)]) if isinstance(path, TipMotion) else None

    @cached_property
    def of_design(self) -> OfDesign | None:
        """How q follows the design; None where it does not."""
        return self.known.of_design(self.time_s) if isinstance(self.known, TipMotion) else None

    def at(self, y: Floats) -> tuple[Floats, Floats]:
        """q (n, n_q) and dq/dy (n, n_q, n_y) at design y (n_y,), SI; slopes 0 where q is given."""
        if self.of_design is None:
            return self.q, np.zeros((*self.q.shape, len(y)))
        return self.of_design(y)

    def joined(self, loads: Floats) -> Trajectory:
        """It with ``loads`` (n_loads,), which neither time nor design change, behind q."""
        known = self.known and self.known.joined(loads)
        return replace(self, q=behind(self.q, loads), known=known)

    def lasting(self, y: Floats) -> Trajectory:
        """The same path in the time that a design y (n_y,) has for it."""
        if self.stretch is None:
            return self
        k, duration = self.stretch
        share, given = float(y[k]) / duration, self.sampled and self.sampled.lasting(y)
        known, stretch = self.motion.lasting(share), (k, float(y[k]))
        time_s = share * self.time_s
        return replace(self, time_s=time_s, known=known, sampled=given, stretch=stretch)

    def chosen(self, samples: Ints) -> Trajectory:
        """Some of the samples only, given by ascending numbers."""
        some = self.time_s[samples], self.q[samples]
        return Trajectory(*some, self.notes, self.motion, stretch=self.stretch)

    @property
    def given(self) -> Trajectory:
        """The trajectory with its own samples only, without instants between them."""
        return self.sampled or self

    @property
    def inserted(self) -> NDArray[np.bool_]:
        """True (n,) for each instant between the samples."""
        return ~np.isin(self.time_s, self.given.time_s)

    def with_instants(self, times_s: ArrayLike) -> Trajectory:
        """The trajectory with instants between its samples."""
        time_s = np.union1d(self.time_s, times_s)
        if len(time_s) == len(self.time_s):
            return self
        q = self.motion.poses(time_s)
        q[np.isin(time_s, self.time_s)] = self.q
        return Trajectory(time_s, q, self.notes, self.motion, self.given, self.stretch)


def coordinate_columns(q_names: Sequence[str], q_units: Sequence[str] = ()) -> list[CsvColumn]:
    """One for each coordinate; ``q_units`` are "rad" or "m", all rad if empty."""
    units = q_units or ["rad"] * len(q_names)
    return [
        CsvColumn(name, (DIMENSIONS[_KINDS[unit]],))
        for name, unit in zip(q_names, units, strict=True)
    ]


def read_samples(
    file: Path,
    q_names: Sequence[str],
    q_units: Sequence[str] = (),
    written: Mapping[str, str] = MappingProxyType({}),
    rate_hz: float | None = None,
) -> Trajectory:
    """Samples of the coordinates ``q_names`` from a CSV file, in SI units.

    ``q_units`` are "rad" or "m", all rad if empty; ``written`` what the header calls columns; with
    ``rate_hz`` there is none of time. s and rad (m for strokes) are meant where no unit is written;
    see `eigassign.case.table`. The columns of the tip that runs write (`tip x
    [m]`, …) are passed over without a note.

    Raises MechanismError if the file cannot be read, has a wrong header or too few samples, and
    TrajectoryError for a line that does not hold one finite number a column, or goes back in time;
    both name the line.
    """
    clock = [] if rate_hz else [CsvColumn(TIME, (DIMENSIONS["time"],))]
    columns = [*clock, *coordinate_columns(q_names, q_units)]
    columns = renamed(columns, written, _KEY)
    table = read_table(file, _KEY, columns, TrajectoryError, TIP_COLUMNS)
    if len(table.lines) < 2:
        message = f"{file.name}: {len(table.lines)} samples; at least two are needed"
        raise MechanismError(_KEY, message)
    q = np.column_stack([table.numbers[name] for name in q_names])
    time_s = np.array(table.numbers.get(TIME, ()))
    if rate_hz:
        time_s = np.arange(len(q)) / rate_hz
    for k in np.flatnonzero(np.diff(time_s) <= 0.0).tolist():
        before, after = time_s[k : k + 2]
        message = f"time must increase, and goes from {before:g} s to {after:g} s"
        raise TrajectoryError(_KEY, f"{table.where(k + 1)}: {message}", k + 1)
    return Trajectory(time_s, q, (*table.notes, *_jumps(q, q_names, q_units)))


def build_trajectory(
    spec: SampledTrajectory | FileTrajectory | PointTrajectory | TipTrajectory,
    q_names: Sequence[str],
    tip_chain: Callable[[str, bool], TipChain],
    q_units: Sequence[str] = (),
    moved: Callable[[str, bool], bool] = lambda _node, _oriented: False,
) -> Trajectory:
    """The trajectory that a case asks for, in the coordinates ``q_names``.

    ``tip_chain(node, oriented)`` gives the chain of a tip path's node, with its turning if
    oriented, and is called for nothing else; ``q_units`` are "rad" or "m" for each coordinate, all
    rad if empty. Where ``moved`` says that the design moves the tip's node (oriented or not), the
    coordinates of a tip path follow the design. What the rules of a case say of ``spec`` holds.
    Raises MechanismError for what else is wrong as a whole, TrajectoryError for one sample.
    """
    if isinstance(spec, TipTrajectory):
        return _from_tip_path(spec, tip_chain, moved)
    if isinstance(spec, FileTrajectory):
        return read_samples(Path(spec.file), q_names, q_units, spec.columns, spec.rate)
    if isinstance(spec, PointTrajectory):
        return _from_points(spec)
    return _from_samples(spec, q_names, q_units)


def _from_tip_path(
    spec: TipTrajectory,
    tip_chain: Callable[[str, bool], TipChain],
    moved: Callable[[str, bool], bool],
) -> Trajectory:
    """q(t) with tip(q(t)) = p(s(t/T)), turned as asked for, at equal steps in time."""
    path, attitude = tip_path(spec.waypoints, spec.path), None
    if spec.angle is not None:
        attitude = planar_attitude(path, spec.angle, spec.path)
    elif spec.orientation is not None:
        attitude = spatial_attitude(path, spec.orientation, spec.path)
    chain = tip_chain(spec.tip, attitude is not None)
    tau = np.linspace(0.0, 1.0, spec.samples)
    law = timing_law(spec.timing)
    s = law.value(tau)[:, 0]
    s = np.maximum.accumulate(np.clip(s, 0.0, 1.0))  # round-off at the ends
    course = Course(path, s, spec.duration * tau, attitude)
    followed = follow(chain, course, spec.branch, spec.start)
    follows, notes = moved(spec.tip, attitude is not None), followed.notes
    if follows:
        said = path_of_design(followed, course).said
        notes = (*notes, f"{said}; q is written for the initial design")
    motion = TipMotion(followed, course, law, follows)
    return Trajectory(course.time_s, followed.q, notes, motion)


def _from_samples(
    spec: SampledTrajectory, q_names: Sequence[str], q_units: Sequence[str]
) -> Trajectory:
    """Samples given in the case: times as given, or at equal steps over the duration from 0."""
    q = np.array(spec.q, dtype=np.float64)
    time_s = np.linspace(0.0, spec.duration or 1.0, len(q))
    if spec.time is not None:
        time_s = np.array(spec.time, dtype=np.float64)
    notes = () if len(q) == 1 else _jumps(q, q_names, q_units)
    return Trajectory(time_s, q, notes)


def _from_points(spec: PointTrajectory) -> Trajectory:
    """Point to point, in equal steps of time."""
    points = np.array(spec.points, dtype=np.float64)
    if spec.times is None:
        reached = shared_times(points, spec.duration or 1.0)
        said: tuple[str, ...] = (
            f"the points are reached at {', '.join(f'{t:.6g}' for t in reached)} s: time shared in "
            "proportion to the largest move of a coordinate relative to its range",
        )
    else:
        reached, said = np.array(spec.times, dtype=np.float64), ()
    motion = point_motion(points, reached, timing_law(spec.timing))
    time_s = np.linspace(reached[0], reached[-1], spec.samples)
    return Trajectory(time_s, motion.poses(time_s), said if len(points) > 2 else (), motion)


def _jumps(q: Floats, q_names: Sequence[str], q_units: Sequence[str]) -> tuple[str, ...]:
    """A note for each angle that moves by more than half a turn from sample to sample."""
    steps, units = np.abs(np.diff(q, axis=0)), q_units or ["rad"] * len(q_names)
    return tuple(
        f"{name} jumps by {handy(own[k], unit)} from sample {k} to {k + 1}; is it cut at 360 deg?"
        for own, name, unit in zip(steps.T, q_names, units, strict=True)
        if unit == "rad" and own[k := int(own.argmax())] > np.pi
    )


# --- several trajectories


class NamedTrajectory(NamedTuple):
    """One of several trajectories; ``weight`` is what each of its seconds counts beside others."""

    name: str
    trajectory: Trajectory
    weight: float = 1.0


@dataclass(frozen=True, repr=False)
class Trajectories(Brief):
    """At least one trajectory; n samples in all, those of the first one first.

    The time of each begins where its own does, so ``time_s`` need not increase from one to the
    next; ``rows`` says which samples are whose. ``origin`` is what some samples were chosen from.
    """

    parts: tuple[NamedTrajectory, ...]
    origin: Trajectories | None = None

    def __post_init__(self) -> None:
        if not self.parts:
            raise UsageError("trajectories: none given")

    @cached_property
    def time_s(self) -> Floats:
        """(n,) in s."""
        return _stacked([part.trajectory.time_s for part in self.parts])

    @cached_property
    def q(self) -> Floats:
        """(n, n_q) in rad or m, at the initial design."""
        return _stacked([part.trajectory.q for part in self.parts])

    @property
    def whole(self) -> Trajectories:
        """The trajectories with all samples, where these are some of them."""
        return self if self.origin is None else self.origin

    @property
    def follows_design(self) -> bool:
        """True where q depends on the design: along a path of a tip that the design moves."""
        return any(part.trajectory.of_design is not None for part in self.parts)

    def in_design(self, slopes: Floats, of_design: Floats) -> Floats:
        """Slopes (n, m, n_y) in y alone of those in (q, y), with dq/dy ``of_design`` from `at`."""
        by_q, by_y = np.split(slopes, [self.q.shape[1]], axis=2)
        return by_y + by_q @ of_design if self.follows_design else by_y

    def at(self, y: Floats) -> tuple[Floats, Floats]:
        """q (n, n_q) and dq/dy (n, n_q, n_y) at design y (n_y,), SI.

        Raises TrajectoryError where that design cannot follow a path of its tip.
        """
        found = []
        for part in self.parts:
            try:
                found.append(part.trajectory.at(y))
            except TrajectoryError as error:
                if not self.several:
                    raise
                message = f"trajectory {part.name!r}: {error.message}"
                raise TrajectoryError(error.path, message, error.sample) from None
        return _stacked([q for q, _ in found]), _stacked([slopes for _, slopes in found])

    def lasting(self, y: Floats) -> Trajectories:
        """Each in the time that a design y (n_y,) has for it."""
        parts = (p._replace(trajectory=p.trajectory.lasting(y)) for p in self.parts)
        return Trajectories(tuple(parts), self.origin and self.origin.lasting(y))

    def pose(self, time_s: float, name: str | None, y: Floats | None = None) -> Floats:
        """q (n_q,) at any time of one trajectory, the first if None, at design y or the initial."""
        part = next(part for part in self.parts if name in (None, part.name))
        return np.array(part.trajectory.motion.poses(np.array([time_s]), y)[0])

    def between(self, rows: slice, y: Floats) -> Callable[[Floats], Floats]:
        """q (n, n_q) at places along some rows of one trajectory, at design y (n_y,).

        Place 1.5 is midway in time between the second row and the third. The poses raise
        TrajectoryError with a place where that design cannot follow a path of its tip.
        """
        part, own = self._at(rows.start)
        time_s, known = self.time_s[rows], part.trajectory.at(y)[0]
        known = known[rows.start - own.start : rows.stop - own.start]

        def poses(at: Floats) -> Floats:
            try:
                q = part.trajectory.motion.poses(np.interp(at, np.arange(len(time_s)), time_s), y)
            except TrajectoryError as lost:
                k = lost.sample
                raise TrajectoryError(lost.path, lost.message, k, float(at[k])) from None
            on = at == np.rint(at)
            q[on] = known[at[on].astype(int)]
            return q

        return poses

    @cached_property
    def tip(self) -> Floats | None:
        """(n, 2 or 3) in m; None unless every trajectory is a path of the tip."""
        tips = [part.trajectory.tip for part in self.parts]
        given = [tip for tip in tips if tip is not None]
        return _stacked(given) if len(given) == len(tips) else None

    @property
    def notes(self) -> tuple[str, ...]:
        """The notes of every trajectory, with its name where there are several."""
        return tuple(
            f"trajectory {part.name!r}: {note}" if self.several else note
            for part in self.parts
            for note in part.trajectory.notes
        )

    @property
    def several(self) -> bool:
        """True where there is more than one, so that a sample needs more than its number."""
        return len(self.parts) > 1

    @cached_property
    def rows(self) -> tuple[slice, ...]:
        """The samples of each trajectory."""
        ends = np.cumsum([0, *(len(part.trajectory.time_s) for part in self.parts)])
        return tuple(slice(int(a), int(b)) for a, b in pairwise(ends))

    def rows_of(self, name: str | None) -> slice:
        """The samples of the trajectory of that name, or all; UsageError for an unknown one."""
        if name is None:
            return slice(0, len(self.time_s))
        for part, rows in zip(self.parts, self.rows, strict=True):
            if part.name == name:
                return rows
        raise UsageError(f"trajectory: there is none called {name!r}")

    def sample(self, k: int) -> str:
        """Sample k of all, in words: its place in its own trajectory, counted from 0."""
        part, rows = self._at(k)
        inserted = part.trajectory.inserted[: k - rows.start + 1]
        own = int((~inserted).sum()) - 1
        said = (
            f"an instant between samples {own} and {own + 1}" if inserted[-1] else f"sample {own}"
        )
        return f"{said} of trajectory {part.name!r}" if self.several else said

    def where(self, k: int) -> str:
        """The sample in words with its time."""
        return f"{self.sample(k)} (t = {self.time_s[k]:.4g} s)"

    def name_of(self, k: int) -> str:
        """The name of the trajectory that sample k of all belongs to."""
        return self._at(k)[0].name

    def _at(self, k: int) -> tuple[NamedTrajectory, slice]:
        pairs = zip(self.parts, self.rows, strict=True)
        return next(pair for pair in pairs if pair[1].start <= k < pair[1].stop)

    def spread(self, count: int) -> Ints:
        """Numbers of about ``count`` samples: of each trajectory its share, with both its ends."""
        n = len(self.time_s)
        chosen = []
        for rows in self.rows:
            own = rows.stop - rows.start
            share = min(own, max(2, round(count * own / n)))
            ends = np.linspace(rows.start, rows.stop - 1, share)
            chosen.append(np.unique(ends.round().astype(np.intp)))
        return np.concatenate(chosen)

    @cached_property
    def inserted(self) -> NDArray[np.bool_]:
        """True (n,) for each instant between the samples of its trajectory."""
        return np.concatenate([part.trajectory.inserted for part in self.parts])

    def with_instants(self, times_s: Sequence[ArrayLike]) -> Trajectories:
        """The trajectories with instants between their samples, at these of its times."""
        return Trajectories(
            tuple(
                part._replace(trajectory=part.trajectory.with_instants(times))
                for part, times in zip(self.parts, times_s, strict=True)
            )
        )

    @cached_property
    def finely(self) -> Trajectories:
        """The trajectories, each divided evenly into `FINELY` steps at least."""
        between = []
        for time_s in (part.trajectory.time_s for part in self.parts):
            pieces = -(-FINELY // max(len(time_s) - 1, 1))
            shares = np.arange(1, pieces) / pieces
            between.append((time_s[:-1, None] + np.diff(time_s)[:, None] * shares).ravel())
        return self.with_instants(between)

    def chosen(self, samples: Sequence[int] | Ints) -> Trajectories:
        """Some of the samples only, given by ascending numbers; no part that has none of them."""
        kept = np.asarray(samples, dtype=np.intp)
        parts = []
        for part, rows in zip(self.parts, self.rows, strict=True):
            own = kept[(kept >= rows.start) & (kept < rows.stop)] - rows.start
            if len(own):
                parts.append(part._replace(trajectory=part.trajectory.chosen(own)))
        return Trajectories(tuple(parts), self.whole)


def _stacked(arrays: Sequence[Floats]) -> Floats:
    stacked = arrays[0] if len(arrays) == 1 else np.concatenate(arrays)
    stacked.setflags(write=False)
    return stacked


# --- rates q̇ and q̈


class Rates(NamedTuple):
    """q, q̇ and q̈ (m, n_q) at ``samples`` (m,); a sample on a corner stands there for both sides."""

    samples: Ints
    q: Floats
    rate: Floats
    acceleration: Floats


def rates(trajectory: Trajectory, y: Floats | None = None) -> Rates:
    """q, q̇ and q̈ at every sample and instant, at design y (n_y,), the initial one if None.

    Where q̇ or q̈ jumps they are taken `BESIDE` the jump, before and behind it.
    """
    time_s, motion = trajectory.time_s, trajectory.motion
    beside, n = BESIDE * float(np.ptp(time_s)), len(time_s)
    apart = np.abs(time_s[:, None] - motion.breaks_s).min(axis=1, initial=np.inf)
    inside = (time_s > time_s[0]) & (time_s < time_s[-1])
    sides = 1 + ((apart <= beside) & inside)
    samples = np.repeat(np.arange(n), sides)
    first = np.append(True, np.diff(samples) > 0)
    aside = np.where(first, -2.0, 2.0) * (sides[samples] - 1) * beside
    found = motion.moving(time_s[samples] + aside, y)
    if y is None:
        found = found._replace(q=trajectory.q[samples])
    return Rates(samples, *found)


def rates_at(trajectory: Trajectory, y: Floats, slopes: bool = True) -> tuple[Rates, Rates]:
    """`rates` at design y (n_y,), and the slopes of q, q̇ and q̈ in y, each (m, n_q, n_y), or 0.

    Those along paths that follow the design are differences, of steps that move q by 1e-4, central
    ones where the tip can follow its path on both sides.
    """
    found = rates(trajectory, None if trajectory.of_design is None else y)
    by_y = np.zeros((3, *found.q.shape, len(y)))
    if slopes and trajectory.of_design is not None:
        by_design = np.abs(trajectory.at(y)[1]).max(axis=(0, 1))
        for j in np.flatnonzero(by_design):
            step, sides = np.eye(len(y))[j] * 1e-4 / by_design[j], dict[int, Rates]()
            for side in (1, -1):
                with suppress(TrajectoryError):  # beyond what the tip reaches
                    sides[side] = rates(trajectory, y + side * step)
            pairs = zip(sides.get(1, found)[1:], sides.get(-1, found)[1:], strict=True)
            by_y[..., j] = [(a - b) / (max(len(sides), 1) * step[j]) for a, b in pairs]
    if trajectory.stretch is not None:
        k, duration = trajectory.stretch
        share = duration / y[k]
        rate, push = share * found.rate, share**2 * found.acceleration
        found = found._replace(rate=rate, acceleration=push)
        by_y *= np.array([1.0, share, share**2])[:, None, None, None]
        by_y[1, ..., k], by_y[2, ..., k] = -rate / y[k], -2.0 * push / y[k]
    return found, Rates(found.samples, *by_y)
