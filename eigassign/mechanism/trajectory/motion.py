"""q, q̇ and q̈ at any time of a trajectory, exactly; timing laws s(τ); samples from CSV files.

s and rad (m for strokes) are meant where no unit is written; see `eigassign.case.table`. The
columns of the tip that runs write (`tip x [m]`, …) are passed over without a note.

Point to point, q(t) runs between joint coordinates, each segment by the same timing law.

    points           q = q_k + s(τ) Δq,           q̇ = s'(τ) Δq/T,   q̈ = s''(τ) Δq/T²
    sampled          the not-a-knot cubic spline through the samples, from corner to corner
    path of a tip    u̇ = W(u) ṗ,   ü = (∂W/∂u · u̇) ṗ + W(u) p̈,   p(t) = path(s(t/T))

u holds the coordinates and the passive freedoms of loops, p the position and the turning of the
tip; W(u) = J⁺ closes the loops and takes the least motion where there is a choice. ∂W/∂u · u̇ is
its derivative along u̇, by differences of fourth order in u, in which W is analytic.

Shapes: n times, m points, n_q coordinates, n_z entries of a state u. SI units, angles in rad.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from types import MappingProxyType
from typing import Literal, NamedTuple

import numpy as np
from numpy.polynomial import polynomial
from numpy.typing import ArrayLike, NDArray

from eigassign.case.table import CsvColumn, CsvTable, read_table
from eigassign.case.units import DIMENSIONS
from eigassign.errors import MechanismError, TrajectoryError, UsageError
from eigassign.mechanism.inverse_kinematics.chain import reduced
from eigassign.mechanism.inverse_kinematics.follow import Followed, at_parameters
from eigassign.mechanism.inverse_kinematics.redesign import PathOfDesign
from eigassign.mechanism.inverse_kinematics.solver import TipProblem, moved
from eigassign.mechanism.inverse_kinematics.tip_path import Course, TipPath, smooth

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


@dataclass(frozen=True)
class TimingLaw:
    """Polynomials s(τ) = Σ c_k (τ − τ_i)^k on τ_i ≤ τ ≤ τ_{i+1}, from s(0) = 0 to s(1) = 1.

    Defined on 0 ≤ τ ≤ 1 only; ``ends`` are the τ_{i+1} of all pieces but the last.
    """

    name: str
    pieces: tuple[tuple[float, ...], ...]  # c_0, c_1, ... of each
    ends: tuple[float, ...] = ()

    def position(self, tau: ArrayLike) -> Floats:
        """s(τ), dimensionless, same shape as ``tau``; UsageError outside [0, 1]."""
        return self._derivative(0, tau)

    def velocity(self, tau: ArrayLike) -> Floats:
        """ds/dτ, dimensionless (divide by the duration for 1/s); UsageError outside [0, 1]."""
        return self._derivative(1, tau)

    def acceleration(self, tau: ArrayLike) -> Floats:
        """d²s/dτ² (divide by the duration squared for 1/s²), from the right where it jumps."""
        return self._derivative(2, tau)

    def _derivative(self, order: int, tau: ArrayLike) -> Floats:
        relative_time = np.asarray(tau, dtype=np.float64)
        if not np.all((relative_time >= 0.0) & (relative_time <= 1.0)):
            raise UsageError(f"the {self.name} timing law is defined for 0 <= tau <= 1 only")
        value = np.zeros_like(relative_time)
        for start, piece in zip((0.0, *self.ends), self.pieces, strict=True):
            own = polynomial.polyval(relative_time - start, polynomial.polyder(piece, order))
            value = np.where(relative_time >= start, own, value)
        return value


POLYNOMIALS: Mapping[str, TimingLaw] = MappingProxyType(
    {
        "linear": TimingLaw("linear", ((0.0, 1.0),)),
        "cubic": TimingLaw("cubic", ((0.0, 0.0, 3.0, -2.0),)),
        "quintic": TimingLaw("quintic", ((0.0, 0.0, 0.0, 10.0, -15.0, 6.0),)),
    }
)


def trapezoidal(share: float) -> TimingLaw:
    """Constant acceleration for the ``share`` a of the time, constant velocity, and braking for a.

    s = v τ²/(2a), then v (τ − a/2), then 1 − v (1 − τ)²/(2a), at the peak velocity v = 1/(1 − a).
    UsageError unless 0 < a ≤ 1/2.
    """
    if not 0.0 < share <= 0.5:
        raise UsageError(f"the share of time spent accelerating must be in (0, 0.5], got {share:g}")
    v, a = 1.0 / (1.0 - share), share
    ramp = 0.5 * v * a  # covered while accelerating, and while braking
    pieces = ((0.0, 0.0, 0.5 * v / a), (ramp, v), (1.0 - ramp, v, -0.5 * v / a))
    return TimingLaw("trapezoidal", pieces, (a, 1.0 - a))


def timing_law(name: str, acceleration_share: float = 1.0 / 3.0) -> TimingLaw:
    """The law called ``name``: linear s = τ, cubic 3τ² − 2τ³, quintic 10τ³ − 15τ⁴ + 6τ⁵, or
    trapezoidal with the share of its time that it accelerates.

    All but linear start and stop at rest, quintic also without acceleration. UsageError for other
    names.
    """
    if name == "trapezoidal":
        return trapezoidal(acceleration_share)
    if name not in POLYNOMIALS:
        known = ", ".join((*POLYNOMIALS, "trapezoidal"))
        raise UsageError(f"unknown timing law {name!r}; there are {known}")
    return POLYNOMIALS[name]


# --- point to point


def shared_times(points: Floats, duration: float) -> Floats:
    """When each point (m, n_q) is reached, (m,) in s from 0 to ``duration``.

    The time of a segment is in proportion to the largest move of a coordinate, each relative to the
    range R_i which that coordinate has over all points: T_k ∝ max_i |q_{k+1,i} − q_{k,i}| / R_i. So
    radians and metres need no common measure.
    """
    extent = np.ptp(points, axis=0)
    moves = np.abs(np.diff(points, axis=0)) / np.where(extent > 0.0, extent, 1.0)
    share = moves.max(axis=1)
    reached = np.asarray(np.concatenate([[0.0], np.cumsum(share)]) * (duration / share.sum()))
    reached[-1] = duration
    return reached


OfDesign = Callable[[Floats], tuple[Floats, Floats]]  # y (n_y,) -> q (n, n_q), dq/dy (n, n_q, n_y)
BESIDE = 1e-9  # of the duration: a break is looked at this much before and behind it
SOLUTIONS = 400  # between which the spline is off the path by some 1e-9 of its length
_STEP = 1e-3  # of u: differences of fourth order err by its fourth power, round-off is 1e-13


class Moving(NamedTuple):
    """q, q̇ and q̈, (n, n_q) each."""

    q: Floats
    rate: Floats
    acceleration: Floats


class Motion:
    """q(t) of given coordinates, the same for every design; `TipMotion` and `Loaded` differ."""

    @property
    def breaks_s(self) -> Floats:
        """Times inside it at which q̇ or q̈ jumps, (k,) ascending."""
        raise NotImplementedError

    def moving(self, time_s: Floats, y: Floats | None = None) -> Moving:
        """At times (n,) within the motion and a design y (n_y,), the initial one if None."""
        raise NotImplementedError

    def poses(self, time_s: Floats, y: Floats | None = None) -> Floats:
        """q (n, n_q) alone."""
        return self.moving(time_s, y).q

    def tip(self, _time_s: Floats) -> Floats | None:
        """Where the tip is at the initial design, (n, 2 or 3) in m; None without its path."""
        return None

    def of_design(self, _time_s: Floats) -> OfDesign | None:
        """How q at times (n,) follows the design; None where it does not."""
        return None


# --- points, and samples


@dataclass(frozen=True, eq=False)
class PointMotion(Motion):
    """From point to point (m, n_q), reached at these times, each move by the same timing law."""

    points: Floats
    reached_s: Floats
    law: TimingLaw

    @property
    def breaks_s(self) -> Floats:
        """Where the law's own pieces meet, and the points between."""
        ends = np.array([0.0, *self.law.ends])
        times = self.reached_s[:-1, None] + np.diff(self.reached_s)[:, None] * ends
        return np.asarray(times.ravel()[1:])

    def moving(self, time_s: Floats, y: Floats | None = None) -> Moving:
        """q, q̇ and q̈ at times (n,), the same for every design."""
        k = np.searchsorted(self.reached_s, time_s, side="right") - 1
        k = np.clip(k, 0, len(self.points) - 2)
        took = np.diff(self.reached_s)[k]
        tau = np.clip((time_s - self.reached_s[k]) / took, 0.0, 1.0)
        way = (self.points[k + 1] - self.points[k]) / took[:, None]
        s, rate, push = (
            each[:, None]
            for each in (self.law.position(tau), self.law.velocity(tau), self.law.acceleration(tau))
        )
        # this form gives both ends exactly
        q = (1.0 - s) * self.points[k] + s * self.points[k + 1]
        return Moving(q, rate * way, push * way / took[:, None])


@dataclass(frozen=True, eq=False)
class SampledMotion(Motion):
    """The cubic spline through samples q (n, n_q), one for each part between known corners."""

    time_s: Floats
    q: Floats
    corners_s: tuple[float, ...] = ()

    @property
    def breaks_s(self) -> Floats:
        """The corners."""
        return np.array(self.corners_s)

    @cached_property
    def parts(self) -> list[tuple[float, float, TipPath]]:
        """From when to when, and the spline over its share of that."""
        cuts = [self.time_s[0], *self.corners_s, self.time_s[-1]]
        near, found = BESIDE * float(np.ptp(self.time_s)), []
        for start, end in pairwise(cuts):
            own = (self.time_s >= start - near) & (self.time_s <= end + near)
            if own.sum() > 1:
                times = self.time_s[own]
                share = (times - times[0]) / (times[-1] - times[0])
                found.append((float(times[0]), float(times[-1]), smooth(share, self.q[own])))
        return found

    def moving(self, time_s: Floats, y: Floats | None = None) -> Moving:
        """q, q̇ and q̈ at times (n,), the same for every design; a lone sample is at rest."""
        shape = len(time_s), self.q.shape[1]
        q, rate, push = np.broadcast_to(self.q[0], shape).copy(), np.zeros(shape), np.zeros(shape)
        starts = [start for start, _, _ in self.parts]
        for k, (start, end, spline) in enumerate(self.parts):
            last = np.inf if k + 1 == len(starts) else starts[k + 1]
            own = (time_s < last) & ((time_s >= start) | (k == 0))
            took = end - start
            share = np.clip((time_s[own] - start) / took, 0.0, 1.0)
            q[own], rate[own] = spline.point(share), spline.derivative(share) / took
            push[own] = spline.derivative(share, 2) / took**2
        # what q rounded to 1e-16 leaves of second differences where the velocity does not change
        step = np.diff(self.time_s).min(initial=np.inf)
        push[np.abs(push) <= 4e-15 * np.abs(self.q).max(axis=0) / step**2] = 0.0
        return Moving(q, rate, push)


# --- along a path of the tip


@dataclass(frozen=True, eq=False)
class TipMotion(Motion):
    """The motion of a tip along its path, as it was followed, by a timing law over its duration."""

    followed: Followed
    course: Course  # with the samples of the trajectory
    law: TimingLaw
    follows_design: bool

    @property
    def duration_s(self) -> float:
        """From the first sample, at 0 s, to the last."""
        return float(self.course.time_s[-1])

    @property
    def breaks_s(self) -> Floats:
        """Where the path or the law has a corner, or a jump of its curvature."""
        s = self.course.corners()
        of_path = np.array([self.when(each) for each in s]) * self.duration_s
        return np.union1d(of_path, np.array(self.law.ends) * self.duration_s)

    def when(self, s: float) -> float:
        """τ at which the law has come to s, by bisection; s(τ) does not fall."""
        low, high = 0.0, 1.0
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self.law.position(middle) < s else (low, middle)
        return high

    def course_at(self, time_s: Floats) -> Course:
        """The course with other instants (n,)."""
        tau = np.clip(time_s / self.duration_s, 0.0, 1.0)
        s = np.clip(self.law.position(tau), 0.0, 1.0)
        return replace(self.course, s=s, time_s=time_s)

    def tip(self, time_s: Floats) -> Floats:
        """On the path."""
        course = self.course_at(time_s)
        return self.followed.problem.evaluate(at_parameters(self.followed, course)).point

    def of_design(self, time_s: Floats) -> PathOfDesign | None:
        """How q at times (n,) follows the design, where that moves the tip."""
        if not self.follows_design:
            return None
        course = self.course_at(time_s)
        return PathOfDesign(course, self.followed.problem, at_parameters(self.followed, course))

    def poses(self, time_s: Floats, y: Floats | None = None) -> Floats:
        """q (n, n_q) alone."""
        if self.has_choice:
            return self.moving(time_s, y).q
        return self._states(time_s, y)[1]

    def moving(self, time_s: Floats, y: Floats | None = None) -> Moving:
        """q, q̇ and q̈ at times (n,) and design y (n_y,), the initial one if None.

        Where the tip leaves a choice they are those of the spline, in s, through `SOLUTIONS` poses.
        Raises TrajectoryError where the tip cannot follow its path with that design.
        """
        ds, dds, course = *self._speed(time_s), self.course_at(time_s)
        if self.has_choice:
            s = np.union1d(np.linspace(0.0, 1.0, SOLUTIONS), self.course.corners())
            q = self._states(s, y, replace(self.course, s=s, time_s=s))[1]
            found = SampledMotion(s, q, tuple(self.course.corners())).moving(course.s)
            push = found.acceleration * ds**2 + found.rate * dds
            return Moving(found.q, found.rate * ds, push)
        ik, q, u = self._states(time_s, y)
        rates = self._rates(ik, course, u, ds, dds)
        return Moving(q, *(np.array((each * ik.scale)[:, : ik.n_q]) for each in rates))

    @property
    def has_choice(self) -> bool:
        """True where the tip fixes fewer directions than there are coordinates."""
        return self.followed.problem.rank < self.followed.problem.n_q

    def _states(
        self, time_s: Floats, y: Floats | None, course: Course | None = None
    ) -> tuple[TipProblem, Floats, Floats]:
        """The problem at design y, q (n, n_q) and the states u (n, n_z), at times or a course."""
        course = self.course_at(time_s) if course is None else course
        u, ik = at_parameters(self.followed, course), self.followed.problem
        if y is not None and self.follows_design:
            path = PathOfDesign(course, ik, u)
            u, ik = path.states(y), path.problem_at(y)
        return ik, np.array((u * ik.scale)[:, : ik.n_q]), u

    def _speed(self, time_s: Floats) -> tuple[Floats, Floats]:
        """ṡ and s̈ (n, 1), in 1/s and 1/s²."""
        tau, T = np.clip(time_s / self.duration_s, 0.0, 1.0), self.duration_s
        return self.law.velocity(tau)[:, None] / T, self.law.acceleration(tau)[:, None] / T**2

    def _rates(
        self, ik: TipProblem, course: Course, u: Floats, ds: Floats, dds: Floats
    ) -> tuple[Floats, Floats]:
        """u̇ and ü (n, n_z); see the module."""
        first, second = self._task(ik, course, 1), self._task(ik, course, 2)
        rate, push = first * ds, second * ds**2 + first * dds

        def along(state: Floats, task: Floats) -> Floats:
            return moved(reduced(ik.evaluate(state), ik.n_q), task, ik.rank)

        u_rate = along(u, rate)
        size = np.abs(u_rate).max(axis=1, initial=0.0, keepdims=True)
        h = _STEP / np.where(size > 0.0, size, 1.0)
        at = {k: along(u + k * h * u_rate, rate) for k in (-2, -1, 1, 2)}
        turning = (8.0 * (at[1] - at[-1]) - (at[2] - at[-2])) / (12.0 * h)
        return u_rate, turning + along(u, push)

    def _task(self, ik: TipProblem, course: Course, order: Literal[1, 2]) -> Floats:
        """dp/ds or d²p/ds² (n, m): the point in m, the turning times the lever."""
        velocity, spin = course.rates(course.s, order)
        return np.hstack([velocity, ik.lever * spin[:, list(ik.chain.turned_by)]])


# --- with more behind q


@dataclass(frozen=True, eq=False)
class Loaded(Motion):
    """A motion with ``loads`` (n_loads,), which neither time nor design change, behind q."""

    motion: Motion
    loads: Floats

    @property
    def breaks_s(self) -> Floats:
        """Those of the motion."""
        return self.motion.breaks_s

    def behind(self, q: Floats) -> Floats:
        """The loads behind coordinates q (n, n_q)."""
        return np.hstack([q, np.broadcast_to(self.loads, (len(q), len(self.loads)))])

    def poses(self, time_s: Floats, y: Floats | None = None) -> Floats:
        """q (n, n_q) alone, with the loads."""
        return self.behind(self.motion.poses(time_s, y))

    def tip(self, time_s: Floats) -> Floats | None:
        """That of the motion."""
        return self.motion.tip(time_s)

    def of_design(self, time_s: Floats) -> OfDesign | None:
        """With slopes of the loads, which are 0."""
        own = self.motion.of_design(time_s)
        if own is None:
            return None

        def loaded(y: Floats) -> tuple[Floats, Floats]:
            q, slopes = own(y)
            return self.behind(q), np.pad(slopes, [(0, 0), (0, len(self.loads)), (0, 0)])

        return loaded

    def moving(self, time_s: Floats, y: Floats | None = None) -> Moving:
        """q with the loads behind, which do not move."""
        q, *rates = self.motion.moving(time_s, y)
        still = [(0, 0), (0, len(self.loads))]
        return Moving(self.behind(q), *(np.pad(each, still) for each in rates))
