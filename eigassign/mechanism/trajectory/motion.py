"""q, q̇ and q̈ at any time of a trajectory, exactly; timing laws s(τ).

Point to point, q(t) runs between joint coordinates, each segment by the same timing law.

    points           q = q_k + s(τ) Δq,           q̇ = s'(τ) Δq/T,   q̈ = s''(τ) Δq/T²
    sampled          the not-a-knot cubic spline through the samples
    path of a tip    u̇ = W(u) ṗ,   ü = (∂W/∂u · u̇) ṗ + W(u) p̈,   p(t) = path(s(t/T))

u holds the coordinates and the passive freedoms of loops, p the position and the turning of the
tip; W(u) = J⁺ closes the loops.

Shapes: n times, m points, n_q coordinates, n_z entries of a state u. SI units, angles in rad.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from eigassign.arrays import Floats
from eigassign.mechanism.inverse_kinematics.chain import Course, Curve, through
from eigassign.mechanism.inverse_kinematics.follow import (
    Followed,
    PathOfDesign,
    at_parameters,
    behind,
)
from eigassign.mechanism.inverse_kinematics.solver import TipProblem

# --- timing laws s(τ) on 0 ≤ τ ≤ 1

_THIRDS = [[0.0, 0.25, 0.75], [0.0, 1.5, 1.5], [2.25, 0.0, -2.25]]
_LAWS: dict[str, tuple[list[float], list[list[float]]]] = {  # knots and coefficients
    "linear": ([0.0, 1.0], [[0.0], [1.0]]),
    "cubic": ([0.0, 1.0], [[0.0], [0.0], [3.0], [-2.0]]),
    "quintic": ([0.0, 1.0], [[0.0], [0.0], [0.0], [10.0], [-15.0], [6.0]]),
    "trapezoidal": ([0.0, 1 / 3, 2 / 3, 1.0], _THIRDS),
}


def timing_law(name: str) -> Curve:
    """The law called ``name``: linear s = τ, cubic 3τ² − 2τ³, quintic 10τ³ − 15τ⁴ + 6τ⁵, or
    trapezoidal: 9τ²/4 for a third of the time, then 1/4 + 3(τ − 1/3)/2, then braking alike.

    All but linear start and stop at rest, quintic also without acceleration.
    """
    knots, coefficients = (np.array(each) for each in _LAWS[name])
    return Curve(knots, coefficients[..., None])


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


class Moving(NamedTuple):
    """q, q̇ and q̈, (n, n_q) each."""

    q: Floats
    rate: Floats
    acceleration: Floats


@dataclass(frozen=True, eq=False)
class Motion:
    """q(t) as a curve, the same for every design; `TipMotion` differs."""

    curve: Curve  # of q (n_q,) in rad or m over the time in s
    breaks_s: Floats  # times inside it at which q̇ or q̈ jumps, (k,) ascending

    def moving(self, time_s: Floats, _y: Floats | None = None) -> Moving:
        """At times (n,) within the motion and a design y (n_y,), the initial one if None."""
        time_s = np.clip(time_s, *self.curve.knots[[0, -1]])
        return Moving(*(self.curve.value(time_s, order) for order in range(3)))

    def poses(self, time_s: Floats, y: Floats | None = None) -> Floats:
        """q (n, n_q) alone."""
        return self.moving(time_s, y).q

    def lasting(self, share: float) -> Motion | TipMotion:
        """The same path in ``share`` times its time."""
        c = self.curve.coefficients
        c = c / share ** np.arange(len(c))[:, None, None]
        return Motion(Curve(share * self.curve.knots, c), share * self.breaks_s)

    def joined(self, loads: Floats) -> Motion | TipMotion:
        """With ``loads`` (n_loads,), which neither time nor design change, behind q."""
        c = np.pad(self.curve.coefficients, [(0, 0), (0, 0), (0, len(loads))])
        c[0, :, c.shape[2] - len(loads) :] = loads
        return Motion(Curve(self.curve.knots, c), self.breaks_s)


def point_motion(points: Floats, reached_s: Floats, law: Curve) -> Motion:
    """From point to point (m, n_q), reached at these times, each move by the same timing law."""
    took, c = np.diff(reached_s)[:, None], law.coefficients
    knots = (reached_s[:-1, None] + took * law.knots[:-1]).ravel()
    shares = c[:, None, :, 0] / took ** np.arange(len(c))[:, None, None]
    moves = np.diff(points, axis=0)
    pieces = shares.reshape(len(c), -1, 1) * np.repeat(moves, c.shape[1], axis=0)
    pieces[0] += np.repeat(points[:-1], c.shape[1], axis=0)
    return Motion(Curve(np.append(knots, reached_s[-1]), pieces), knots[1:])


def sampled_motion(time_s: Floats, q: Floats) -> Motion:
    """The not-a-knot cubic spline through samples q (n, n_q); a lone sample is at rest."""
    if len(time_s) == 1:
        return Motion(Curve(time_s + np.arange(2.0), q[None].copy()), np.zeros(0))
    c = through(time_s, q, "spline").coefficients.copy()
    # what q rounded to 1e-16 leaves of second differences where the velocity does not change
    step = np.diff(time_s)[:, None]
    least = 4e-15 * np.abs(q).max(axis=0) / step.min() ** 2
    if len(c) > 2:  # two samples are on a line
        bends = np.maximum(2.0 * np.abs(c[2]), np.abs(2.0 * c[2] + 6.0 * c[3] * step))
        c[2:][:, bends <= least] = 0.0
    return Motion(Curve(time_s, c), np.zeros(0))


def known_motion(time_s: Floats, known: Moving) -> Motion:
    """The quintics through q, q̇ and q̈ (n, n_q) at times (n,), as of commands that were shaped.

    A time that is given twice is a break: first what is before it, then what is behind.
    """
    own = np.flatnonzero(np.diff(time_s) > 0.0)
    h = np.diff(time_s)[own, None]
    (q, v, a), (q_end, v_end, a_end) = ([each[own + side] for each in known] for side in (0, 1))
    D = q_end - q - (v + 0.5 * a * h) * h
    E, F = (v_end - v - a * h) * h, 0.5 * (a_end - a) * h**2
    third = (10.0 * D - 4.0 * E + F) / h**3
    fourth = (-15.0 * D + 7.0 * E - 2.0 * F) / h**4
    fifth = (6.0 * D - 3.0 * E + F) / h**5
    knots = np.append(time_s[own], time_s[-1])
    twice = time_s[1:][np.diff(time_s) == 0.0]
    return Motion(Curve(knots, np.array([q, v, 0.5 * a, third, fourth, fifth])), twice)


# --- along a path of the tip


@dataclass(frozen=True, eq=False)
class TipMotion:
    """The motion of a tip along its path, as it was followed, by a timing law over its duration.

    With ``loads`` (n_loads,), which neither time nor design change, behind q.
    """

    followed: Followed
    course: Course  # with the samples of the trajectory
    law: Curve
    follows_design: bool
    loads: Floats = field(default_factory=lambda: np.zeros(0))

    @property
    def duration_s(self) -> float:
        """From the first sample, at 0 s, to the last."""
        return float(self.course.time_s[-1])

    @property
    def breaks_s(self) -> Floats:
        """Where the path or the law has a corner, or a jump of its curvature."""
        of_path = [self.when(each) for each in self.course.corners()]
        return np.asarray(np.union1d(of_path, self.law.knots[1:-1]) * self.duration_s)

    def when(self, s: float) -> float:
        """τ at which the law has come to s, by bisection; s(τ) does not fall."""
        low, high = 0.0, 1.0
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self.law.value(middle)[0, 0] < s else (low, middle)
        return high

    def course_at(self, time_s: Floats) -> Course:
        """The course with other instants (n,)."""
        tau = np.clip(time_s / self.duration_s, 0.0, 1.0)
        s = np.clip(self.law.value(tau)[:, 0], 0.0, 1.0)
        return self.course._replace(s=s, time_s=time_s)

    def tip(self, time_s: Floats) -> Floats:
        """Where the tip is at the initial design, (n, 2 or 3) in m."""
        u = at_parameters(self.followed, self.course_at(time_s))
        return self.followed.problem.evaluate(u).point

    def of_design(self, time_s: Floats) -> PathOfDesign | None:
        """How q at times (n,) follows the design, where that moves the tip."""
        return self._path(self.course_at(time_s)) if self.follows_design else None

    def lasting(self, share: float) -> TipMotion:
        """The same path in ``share`` times its time."""
        return replace(self, course=self.course._replace(time_s=share * self.course.time_s))

    def joined(self, loads: Floats) -> TipMotion:
        """With ``loads`` (n_loads,) behind q."""
        return replace(self, loads=loads)

    def poses(self, time_s: Floats, y: Floats | None = None) -> Floats:
        """q (n, n_q) alone."""
        ik, u = self._states(self.course_at(time_s), y)
        return behind(ik.coordinates(u), self.loads)

    def moving(self, time_s: Floats, y: Floats | None = None) -> Moving:
        """q, q̇ and q̈ at times (n,) and design y (n_y,), the initial one if None.

        Raises TrajectoryError where the tip cannot follow its path with that design.
        """
        course, T = self.course_at(time_s), self.duration_s
        tau = np.clip(time_s / T, 0.0, 1.0)
        ds, dds = self.law.value(tau, 1) / T, self.law.value(tau, 2) / T**2
        ik, u = self._states(course, y)
        first, second = (ik.task(course, course.s, order) for order in (1, 2))
        task, push = first * ds, second * ds**2 + first * dds
        u_rate = ik.moved(u, task)
        # W is analytic: a rate along the imaginary axis gives its derivative exactly
        turning = ik.moved(u + 1e-20j * u_rate, task).imag * 1e20
        u_push = turning + ik.moved(u, push)
        q, rate, push = (ik.coordinates(each) for each in (u, u_rate, u_push))
        still = np.zeros_like(self.loads)
        return Moving(behind(q, self.loads), behind(rate, still), behind(push, still))

    def _path(self, course: Course) -> PathOfDesign:
        u = at_parameters(self.followed, course)
        return PathOfDesign(course, self.followed.problem, u, self.loads)

    def _states(self, course: Course, y: Floats | None) -> tuple[TipProblem, Floats]:
        """The problem at design y, and the states u (n, n_z) along a course."""
        path = self._path(course)
        if y is None or not self.follows_design:
            return path.problem, path.u
        return path.problem_at(y), path.states(y)
