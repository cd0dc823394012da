"""Where the tip has to be and how its link is turned: paths, attitudes, and both with their times.

A path runs through waypoints in the plane or in space as piecewise cubics: a polyline, or a
not-a-knot cubic spline. Its parameter is the cumulative chord length, scaled to 0 ≤ s ≤ 1.

The orientation follows the same parameter s: kept, or one per waypoint. On a straight path the link
turns at a constant rate about a fixed axis from each waypoint to the next; on a spline its angle is
the same cubic spline (planar), or its angular acceleration is continuous (spatial, SciPy's
RotationSpline).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.errors import MechanismError, UsageError

Floats = NDArray[np.float64]

WAYPOINTS = "trajectory.waypoints"  # key path in the case file
_SMOOTH = 1e-9  # of the slope: a change of direction nobody sees
_ROUND_OFF = 1e-12  # how far outside [0, 1] a parameter is still taken for its end


@dataclass(frozen=True)
class TipPath:
    """p(s) = Σ_k c_k (s − s_i)^k on s_i ≤ s ≤ s_{i+1}, for m waypoints in d = 2 or 3 dimensions."""

    knots: Floats  # (m,) s at the waypoints, from 0 to 1
    coefficients: Floats  # (4, m - 1, d) in m, ascending powers
    chord_length: float = 0.0  # m, over all waypoints

    def point(self, s: ArrayLike) -> Floats:
        """Points on the path in m, (n, d) for s of shape (n,); UsageError outside [0, 1]."""
        i, t = self._locate(s)
        c0, c1, c2, c3 = self.coefficients
        return np.asarray(c0[i] + t * (c1[i] + t * (c2[i] + t * c3[i])))

    def derivative(self, s: ArrayLike, order: Literal[1, 2] = 1) -> Floats:
        """dp/ds or d²p/ds² in m, (n, d), from the right at a corner; UsageError outside [0, 1]."""
        i, t = self._locate(s)
        _, c1, c2, c3 = self.coefficients
        if order == 2:
            return np.asarray(2.0 * c2[i] + t * 6.0 * c3[i])
        return np.asarray(c1[i] + t * (2.0 * c2[i] + t * 3.0 * c3[i]))

    def corners(self) -> Floats:
        """Parameters s strictly inside (0, 1) at which dp/ds jumps, by more than round-off."""
        _, c1, c2, c3 = self.coefficients
        h = np.diff(self.knots)[:, None]
        jump = c1[1:] - (c1 + 2.0 * h * c2 + 3.0 * h**2 * c3)[:-1]
        sharp = np.abs(jump).max(axis=1) > _SMOOTH * np.abs(c1).max()
        return np.asarray(self.knots[1:-1][sharp])

    def _locate(self, s: ArrayLike) -> tuple[NDArray[np.intp], Floats]:
        """Piece i and s − s_i (as a column) of each parameter; a path never extrapolates."""
        asked = np.atleast_1d(np.asarray(s, dtype=np.float64))
        if not np.all((asked >= -_ROUND_OFF) & (asked <= 1.0 + _ROUND_OFF)):
            raise UsageError("a path is defined for 0 <= s <= 1 only")
        inside = np.clip(asked, 0.0, 1.0)
        piece = np.searchsorted(self.knots, inside, side="right") - 1
        piece = np.minimum(piece, len(self.knots) - 2)  # the end belongs to the last piece
        return piece, (inside - self.knots[piece])[:, None]


def straight(waypoints: ArrayLike) -> TipPath:
    """Polyline through the waypoints (m, d), in m, parameterised by arc length.

    Raises MechanismError if two consecutive ones of the at least two waypoints coincide.
    """
    points, knots, length = _measure(waypoints)
    return replace(polyline(knots, points), chord_length=length)


def polyline(knots: Floats, values: Floats) -> TipPath:
    """The piecewise linear curve with ``values`` (m, d) at ``knots`` (m,)."""
    chords = np.diff(values, axis=0) / np.diff(knots)[:, None]
    zero = np.zeros_like(chords)
    return _path(knots, np.stack([values[:-1], chords, zero, zero]))


def spline(waypoints: ArrayLike) -> TipPath:
    """Cubic spline through the waypoints (m, d), in m, parameterised by cumulative chord length.

    Twice continuously differentiable, with not-a-knot ends (the third derivative is continuous at
    the second and at the last but one waypoint); the parabola through three waypoints, the line
    through two. Raises the same errors as `straight`.
    """
    points, knots, length = _measure(waypoints)
    return replace(smooth(knots, points), chord_length=length)


def smooth(knots: Floats, values: Floats) -> TipPath:
    """The not-a-knot cubic spline with ``values`` (m, d) at ``knots`` (m,)."""
    from scipy.interpolate import CubicSpline  # takes 0.1 s, which only splines need to wait for

    return _path(knots, CubicSpline(knots, values).c[::-1].copy())


def _path(knots: Floats, coefficients: Floats) -> TipPath:
    knots.setflags(write=False)
    coefficients.setflags(write=False)
    return TipPath(knots, coefficients)


def _measure(waypoints: ArrayLike) -> tuple[Floats, Floats, float]:
    """Points (m, d), knots s (m,) and the chord length in m."""
    points = np.array(waypoints, dtype=np.float64)
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    length = float(chords.sum())
    # 1e-12 of the length is round-off of coordinates, no distance anybody means
    for i in np.flatnonzero(chords <= 1e-12 * length):
        message = f"the same point as the one before it, {points[i].tolist()}; drop one of them"
        raise MechanismError(f"{WAYPOINTS}[{i + 1}]", message)
    knots = np.concatenate([[0.0], np.cumsum(chords)]) / length
    knots[-1] = 1.0
    return points, knots, length


# --- attitude


@dataclass(frozen=True)
class Attitude:
    """The rotation of the tip's link to the world, R(s) on 0 ≤ s ≤ 1."""

    key: str  # of the case file: angle or orientation
    rotation: Callable[[Floats], Floats]  # s (n,) -> (n, 3, 3)
    rate: Callable[[Floats], Floats]  # s (n,) -> ω in the world, rad per unit of s, (n, 3)
    push: Callable[[Floats], Floats]  # s (n,) -> dω/ds in the world, (n, 3)
    corners: Floats  # s at which the rate jumps


def planar_attitude(path: TipPath, angle: ArrayLike, kind: str) -> Attitude:
    """Angle θ(s) in rad, from one value that is kept or one per waypoint, full turns counted."""
    from scipy.spatial.transform import Rotation

    knots = path.knots
    values = np.broadcast_to(np.asarray(angle, dtype=np.float64), knots.shape)[:, None]
    theta = smooth(knots, values) if kind == "spline" else polyline(knots, values)
    axis = np.array([0.0, 0.0, 1.0])
    return Attitude(
        "angle",
        lambda s: np.asarray(Rotation.from_rotvec(theta.point(s) * axis).as_matrix()),
        lambda s: theta.derivative(s) * axis,
        lambda s: theta.derivative(s, 2) * axis,
        theta.corners(),
    )


def spatial_attitude(path: TipPath, orientation: ArrayLike, kind: str) -> Attitude:
    """Rotation from one triple (rx, ry, rz) that is kept or one per waypoint, R = Rz Ry Rx.

    From one waypoint to the next it turns the shorter way. Raises MechanismError where that is half
    a turn, so that there is no shorter way.
    """
    from scipy.spatial.transform import Rotation, RotationSpline, Slerp

    knots = path.knots
    angles = np.broadcast_to(np.asarray(orientation, dtype=np.float64), (len(knots), 3))
    R = Rotation.from_euler("xyz", angles)
    steps = (R[1:] * R[:-1].inv()).as_rotvec()
    size = np.linalg.norm(steps, axis=1)
    # within 1e-6 rad of half a turn the way round cannot be told
    for k in np.flatnonzero(size > np.pi - 1e-6):
        message = "half a turn from the one before it: say which way by a waypoint in between"
        raise MechanismError(f"trajectory.orientation[{k + 1}]", message)
    # orientations within 1e-9 rad do not differ
    if kind == "spline" and len(knots) > 2 and size.max() > 1e-9:
        spline = RotationSpline(knots, R)

        def spin(s: Floats, order: Literal[1, 2]) -> Floats:
            turned = spline(np.atleast_1d(s))  # rates are in the axes of the turned link
            return np.asarray(turned.apply(spline(np.atleast_1d(s), order)))

        rate, push = partial(spin, order=1), partial(spin, order=2)
        return Attitude("orientation", lambda s: _matrices(spline, s), rate, push, np.zeros(0))
    slerp, rates = Slerp(knots, R), steps / np.diff(knots)[:, None]  # R(s) = exp(ω_i (s − s_i)) R_i
    jumps = np.abs(np.diff(rates, axis=0)).max(axis=1)
    sharp = jumps > _SMOOTH * max(float(np.abs(rates).max()), 1.0)

    def steady(s: Floats) -> Floats:
        piece = np.searchsorted(knots, np.atleast_1d(s), side="right") - 1
        return np.asarray(rates[np.clip(piece, 0, len(rates) - 1)])

    return Attitude(
        "orientation",
        lambda s: _matrices(slerp, s),
        steady,
        lambda s: np.zeros((len(np.atleast_1d(s)), 3)),
        knots[1:-1][sharp],
    )


def _matrices(turning: Callable[[Floats], Any], s: Floats) -> Floats:
    """R (n, 3, 3) at parameters s (n,) within [0, 1] but for round-off."""
    return np.asarray(turning(np.clip(np.atleast_1d(s), 0.0, 1.0)).as_matrix())


# --- path, attitude and times together


@dataclass(frozen=True)
class TipTarget:
    """The target of n tips: ``point`` (n, d) in m, and ``rotation`` (n, 3, 3) where asked for."""

    point: Floats
    rotation: Floats | None = None


@dataclass(frozen=True)
class Course:
    """Sample k is due at path parameter ``s[k]`` and time ``time_s[k]``."""

    path: TipPath
    s: Floats  # (n,) not decreasing, from 0 to 1
    time_s: Floats  # (n,)
    attitude: Attitude | None = None

    def target(self, s: Floats) -> TipTarget:
        """The target at parameters s (n,)."""
        rotation = None if self.attitude is None else self.attitude.rotation(np.atleast_1d(s))
        return TipTarget(self.path.point(s), rotation)

    def rates(self, s: ArrayLike, order: Literal[1, 2] = 1) -> tuple[Floats, Floats]:
        """dp/ds (n, d) in m and ω (n, 3) in rad, per unit of s, from the right at a corner.

        Of ``order`` 2 their derivatives d²p/ds² and dω/ds.
        """
        at = np.atleast_1d(np.asarray(s, dtype=np.float64))
        if self.attitude is None:
            return self.path.derivative(at, order), np.zeros((len(at), 3))
        turning = self.attitude.rate if order == 1 else self.attitude.push
        return self.path.derivative(at, order), turning(at)

    def corners(self) -> Floats:
        """Parameters inside (0, 1) at which either rate jumps."""
        turns = np.zeros(0) if self.attitude is None else self.attitude.corners
        return np.union1d(self.path.corners(), turns)

    @property
    def size(self) -> float:
        """m: how far from the origin, or how long, the path is."""
        points = self.path.point(self.path.knots)
        return max(self.path.chord_length, float(np.linalg.norm(points, axis=1).max()))

    def label(self, k: int) -> str:
        """Sample, time and point in words."""
        point = ", ".join(f"{x:.6g}" for x in self.path.point(self.s[k])[0])
        return f"sample {k} (t = {self.time_s[k]:.6g} s, point ({point}) m)"
