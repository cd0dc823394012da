"""Where the tip has to be and how its link is turned: paths, attitudes, both with their times.

A path runs through waypoints in the plane or in space as piecewise cubics: a polyline, or a
not-a-knot cubic spline. Its parameter is the cumulative chord length, scaled to 0 ≤ s ≤ 1.

The orientation follows the same parameter s: kept, or one per waypoint. On a straight path the link
turns at a constant rate about a fixed axis from each waypoint to the next; on a spline its angle is
the same cubic spline (planar), or its angular acceleration is continuous (spatial, SciPy's
RotationSpline).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import perm
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.errors import MechanismError, UsageError

Floats = NDArray[np.float64]

WAYPOINTS = "trajectory.waypoints"  # key path in the case file
_SMOOTH = 1e-9  # of the slope: a change of direction nobody sees
_ROUND_OFF = 1e-12  # of the whole: how far outside a parameter is still taken for its end


@dataclass(frozen=True)
class Curve:
    """f(s) = Σ_k c_k (s − s_i)^k on s_i ≤ s ≤ s_{i+1}, with d components: paths, laws, motions."""

    knots: Floats  # (m,) ascending
    coefficients: Floats  # (k, m - 1, d), ascending powers

    def __post_init__(self) -> None:
        for array in (self.knots, self.coefficients):
            array.setflags(write=False)

    def value(self, s: ArrayLike, order: int = 0) -> Floats:
        """f or a derivative of it (n, d) at s (n,), from the right where it jumps.

        Raises UsageError outside the knots: a curve never extrapolates.
        """
        at = np.atleast_1d(np.asarray(s, dtype=np.float64))
        first, last = self.knots[[0, -1]]
        slack = _ROUND_OFF * (last - first)
        if not np.all((at >= first - slack) & (at <= last + slack)):
            raise UsageError(f"a curve is defined for {first:g} <= s <= {last:g} only")
        at = np.clip(at, first, last)
        piece = np.searchsorted(self.knots, at, side="right") - 1
        piece = np.minimum(piece, len(self.knots) - 2)  # the end belongs to the last piece
        return self._sum(piece, (at - self.knots[piece])[:, None], order)

    def corners(self, order: int = 1) -> Floats:
        """The inner knots at which a derivative jumps, by more than round-off."""
        inner = np.arange(len(self.knots) - 2)
        ahead = self._sum(inner, np.diff(self.knots)[inner, None], order)
        behind = self._sum(inner + 1, np.zeros((len(inner), 1)), order)
        size = perm(order, order) * np.abs(self.coefficients[order]).max()
        return np.asarray(self.knots[1:-1][np.abs(behind - ahead).max(axis=1) > _SMOOTH * size])

    def _sum(self, piece: NDArray[np.intp], t: Floats, order: int) -> Floats:
        total = np.zeros((len(piece), self.coefficients.shape[2]))
        for k in range(len(self.coefficients) - 1, order - 1, -1):
            total = total * t + perm(k, order) * self.coefficients[k, piece]
        return total


def through(knots: Floats, values: Floats, kind: str) -> Curve:
    """The curve with ``values`` (m, d) at ``knots`` (m,): straight pieces, or a "spline".

    The spline is twice continuously differentiable, with not-a-knot ends (the third derivative is
    continuous at the second and at the last but one knot); the parabola through three values, the
    line through two.
    """
    if kind == "spline":
        from scipy.interpolate import CubicSpline  # takes 0.1 s, which only splines wait for

        return Curve(knots, CubicSpline(knots, values).c[::-1].copy())
    chords = np.diff(values, axis=0) / np.diff(knots)[:, None]
    return Curve(knots, np.stack([values[:-1], chords]))


def tip_path(waypoints: ArrayLike, kind: str) -> Curve:
    """The path `through` the waypoints (m, d), in m, over 0 ≤ s ≤ 1, its cumulative chord length.

    Raises MechanismError if two consecutive ones of the at least two waypoints coincide.
    """
    points = np.array(waypoints, dtype=np.float64)
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    length = float(chords.sum())
    # 1e-12 of the length is round-off of coordinates, no distance anybody means
    for i in np.flatnonzero(chords <= 1e-12 * length):
        message = f"the same point as the one before it, {points[i].tolist()}; drop one of them"
        raise MechanismError(f"{WAYPOINTS}[{i + 1}]", message)
    knots = np.concatenate([[0.0], np.cumsum(chords)]) / length
    knots[-1] = 1.0
    return through(knots, points, kind)


# --- attitude


@dataclass(frozen=True)
class Attitude:
    """The rotation of the tip's link to the world, R(s) on 0 ≤ s ≤ 1."""

    key: str  # of the case file: angle or orientation
    rotation: Callable[[Floats], Floats]  # s (n,) -> (n, 3, 3)
    # s (n,) and 1 or 2 -> ω in the world, rad per unit of s, or dω/ds, (n, 3)
    spin: Callable[[Floats, int], Floats]
    corners: Floats  # s at which ω jumps


def planar_attitude(path: Curve, angle: ArrayLike, kind: str) -> Attitude:
    """Angle θ(s) in rad, from one value that is kept or one per waypoint, full turns counted."""
    from scipy.spatial.transform import Rotation

    knots, axis = path.knots, np.array([0.0, 0.0, 1.0])
    values = np.broadcast_to(np.asarray(angle, dtype=np.float64), knots.shape)[:, None]
    theta = through(knots, values, kind)
    return Attitude(
        "angle",
        lambda s: np.asarray(Rotation.from_rotvec(theta.value(s) * axis).as_matrix()),
        lambda s, order: theta.value(s, order) * axis,
        theta.corners(),
    )


def spatial_attitude(path: Curve, orientation: ArrayLike, kind: str) -> Attitude:
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
    steps[size <= 1e-9] = 0.0  # orientations within 1e-9 rad do not differ
    # ω_i of R = exp(ω_i (s − s_i)) R_i
    steady = Curve(knots, (steps / np.diff(knots)[:, None])[None])
    turning: Any = Slerp(knots, R)

    def spin(s: Floats, order: int) -> Floats:
        return steady.value(s, order - 1)

    def smooth_spin(s: Floats, order: int) -> Floats:
        turned = turning(np.atleast_1d(s))  # rates are in the axes of the turned link
        return np.asarray(turned.apply(turning(np.atleast_1d(s), order)))

    def rotation(s: Floats) -> Floats:  # within [0, 1] but for round-off
        return np.asarray(turning(np.clip(np.atleast_1d(s), 0.0, 1.0)).as_matrix())

    if kind == "spline" and len(knots) > 2 and steps.any():
        turning = RotationSpline(knots, R)
        return Attitude("orientation", rotation, smooth_spin, np.zeros(0))
    return Attitude("orientation", rotation, spin, steady.corners(0))


# --- path, attitude and times together


@dataclass(frozen=True)
class TipTarget:
    """The target of n tips: ``point`` (n, d) in m, and ``rotation`` (n, 3, 3) where asked for."""

    point: Floats
    rotation: Floats | None = None


@dataclass(frozen=True)
class Course:
    """Sample k is due at path parameter ``s[k]`` and time ``time_s[k]``."""

    path: Curve
    s: Floats  # (n,) not decreasing, from 0 to 1
    time_s: Floats  # (n,)
    attitude: Attitude | None = None

    def target(self, s: Floats) -> TipTarget:
        """The target at parameters s (n,)."""
        rotation = None if self.attitude is None else self.attitude.rotation(np.atleast_1d(s))
        return TipTarget(self.path.value(s), rotation)

    def rates(self, s: ArrayLike, order: int = 1) -> tuple[Floats, Floats]:
        """dp/ds (n, d) in m and ω (n, 3) in rad, per unit of s, from the right at a corner.

        Of ``order`` 2 their derivatives d²p/ds² and dω/ds.
        """
        at = np.atleast_1d(np.asarray(s, dtype=np.float64))
        still = np.zeros((len(at), 3))
        spin = still if self.attitude is None else self.attitude.spin(at, order)
        return self.path.value(at, order), spin

    def corners(self) -> Floats:
        """Parameters inside (0, 1) at which either rate jumps."""
        turns = np.zeros(0) if self.attitude is None else self.attitude.corners
        return np.union1d(self.path.corners(), turns)

    @property
    def size(self) -> float:
        """m: how far from the origin, or how long, the path is."""
        points = self.path.value(self.path.knots)
        length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
        return max(length, float(np.linalg.norm(points, axis=1).max()))

    def label(self, k: int) -> str:
        """Sample, time and point in words."""
        point = ", ".join(f"{x:.6g}" for x in self.path.value(self.s[k])[0])
        return f"sample {k} (t = {self.time_s[k]:.6g} s, point ({point}) m)"
