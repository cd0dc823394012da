"""How the tip's link is turned along its path: one orientation that is kept, or one per waypoint.

Between waypoints the orientation follows the same parameter s as the position. On a straight path
the link turns at a constant rate about a fixed axis from each waypoint to the next; on a spline its
angle is the same cubic spline (planar), or its angular acceleration is continuous (spatial, SciPy's
RotationSpline).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from eigassign.errors import MechanismError
from eigassign.mechanism.paths import Floats, Path, polyline, smooth
from eigassign.mechanism.turning import euler_rotation, exponential, logarithm

_SAME_TURN = 1e-9  # rad: two orientations that do not differ
_AMBIGUOUS = 1e-6  # rad from half a turn: which way round cannot be told
_SMOOTH = 1e-9  # of the largest rate: a change of it nobody sees


@dataclass(frozen=True)
class Attitude:
    """The rotation of the tip's link to the world, R(s) on 0 ≤ s ≤ 1."""

    key: str  # of the case file: angle or orientation
    rotation: Callable[[Floats], Floats]  # s (n,) -> (n, 3, 3)
    rate: Callable[[Floats], Floats]  # s (n,) -> ω in the world, rad per unit of s, (n, 3)
    corners: Floats  # s at which the rate jumps


def planar_attitude(path: Path, angle: ArrayLike, kind: str) -> Attitude:
    """Angle θ(s) in rad, from one value that is kept or one per waypoint, full turns counted."""
    knots = path.knots
    values = np.broadcast_to(np.asarray(angle, dtype=np.float64), knots.shape)[:, None]
    if not np.isfinite(values).all():
        raise MechanismError("trajectory.angle", "is not finite")
    course = smooth(knots, values) if kind == "spline" else polyline(knots, values)
    axis = np.array([0.0, 0.0, 1.0])
    return Attitude(
        "angle",
        lambda s: exponential(course.point(s) * axis),
        lambda s: course.derivative(s) * axis,
        course.corners(),
    )


def spatial_attitude(path: Path, orientation: ArrayLike, kind: str) -> Attitude:
    """Rotation from one triple (rx, ry, rz) that is kept or one per waypoint, R = Rz Ry Rx.

    From one waypoint to the next it turns the shorter way. Raises MechanismError where that is half
    a turn, so that there is no shorter way.
    """
    knots = path.knots
    angles = np.broadcast_to(np.asarray(orientation, dtype=np.float64), (len(knots), 3))
    if not np.isfinite(angles).all():
        raise MechanismError("trajectory.orientation", "is not finite")
    R = euler_rotation(angles)
    steps = logarithm(R[1:] @ np.swapaxes(R[:-1], 1, 2))
    size = np.linalg.norm(steps, axis=1)
    for k in np.flatnonzero(size > np.pi - _AMBIGUOUS):
        message = "half a turn from the one before it: say which way by a waypoint in between"
        raise MechanismError(f"trajectory.orientation[{k + 1}]", message)
    if kind == "spline" and len(knots) > 2 and size.max() > _SAME_TURN:
        return _splined(knots, R)
    return _slerped(knots, R, steps / np.diff(knots)[:, None])


def _slerped(knots: Floats, R: Floats, rates: Floats) -> Attitude:
    """R(s) = exp(ω_i (s − s_i)) R_i."""

    def piece(s: Floats) -> tuple[np.ndarray, Floats]:
        s = np.atleast_1d(s)
        i = np.clip(np.searchsorted(knots, s, side="right") - 1, 0, len(knots) - 2)
        return i, (s - knots[i])[:, None]

    def rotation(s: Floats) -> Floats:
        i, t = piece(s)
        return np.asarray(exponential(t * rates[i]) @ R[i])

    jumps = np.abs(np.diff(rates, axis=0)).max(axis=1)
    sharp = jumps > _SMOOTH * max(float(np.abs(rates).max()), 1.0)
    return Attitude("orientation", rotation, lambda s: rates[piece(s)[0]], knots[1:-1][sharp])


def _splined(knots: Floats, R: Floats) -> Attitude:
    from scipy.spatial.transform import Rotation, RotationSpline

    spline = RotationSpline(knots, Rotation.from_matrix(R))

    def rotation(s: Floats) -> Floats:
        return np.asarray(spline(np.atleast_1d(s)).as_matrix())

    def rate(s: Floats) -> Floats:
        own = spline(np.atleast_1d(s), 1)  # in the axes of the turned link
        return np.asarray(np.einsum("nij,nj->ni", rotation(s), own))

    return Attitude("orientation", rotation, rate, np.zeros(0))
