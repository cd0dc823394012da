"""Rotations and the joints: how a follower stands and moves relative to its base, on any scalar.

Rotations of numbers alone, of which there may be many, are SciPy's (`scipy.spatial.transform`).

A joint with k freedoms c gives the rotation R(c) from follower to base axes, the translation d(c)
in base axes, and the motion subspace A(c) (6, k): the twist (v, ω) of the follower relative to the
base per ċ, at the joint and in the follower's axes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eigassign.arrays import Floats
from eigassign.series.expression import Scalar, cos, is_constant, sin

Objects = NDArray[np.object_]
ROUND_OFF = 1e-15  # of an entry of a rotation: a few units in the last place of 1
DOFS = {"planar": (0, 1, 5), "spatial": (0, 1, 2, 3, 4, 5)}  # of a motion (v, ω): x, y, z each
# entries (i, j) of [a]×: which component of a, and its sign
CROSS = ((0, 1, 2, -1.0), (0, 2, 1, 1.0), (1, 0, 2, 1.0), (1, 2, 0, -1.0), (2, 0, 1, -1.0),
         (2, 1, 0, 1.0))  # fmt: skip


def vector(values: Sequence[Scalar]) -> Objects:
    """Three components; a planar vector gets z = 0."""
    padded = [*values, 0.0, 0.0, 0.0][:3]
    return np.array(padded, dtype=object)


def rotation(axis: Floats, angle: Scalar) -> Objects:
    """Rotation by ``angle`` rad about the unit ``axis``: I cos + (1 − cos) aaᵀ + sin [a]×."""
    c, s = cos(angle), sin(angle)
    outer, cross, eye = np.outer(axis, axis), skew(axis), np.eye(3)
    R = np.zeros((3, 3), dtype=object)
    for i in range(3):
        for j in range(3):
            constant = float(outer[i, j])
            R[i, j] = c * float(eye[i, j] - constant) + s * float(cross[i, j]) + constant
    return R


def mounting(angles: Sequence[Scalar] | Objects) -> Objects:
    """R = Rz(rz) Ry(ry) Rx(rx) for (rx, ry, rz) in rad, as joints and springs are turned.

    Quarter turns are without round-off, which would make functions of (q, y) of what depends on
    none, such as the weight along a vertical axis.
    """
    x, y, z = (_whole(rotation(axis, a)) for axis, a in zip(np.eye(3), angles, strict=True))
    return _whole(multiply(z, multiply(y, x)))


def _whole(R: Objects) -> Objects:
    """R with −1, 0 and 1 for the numbers that are so but for round-off."""
    near = R.ravel().tolist()
    for k, value in enumerate(near):
        if is_constant(value) and abs(value - round(value)) < ROUND_OFF:
            near[k] = float(round(value))
    return np.array(near, dtype=object).reshape(3, 3)


def skew(a: Sequence[Scalar] | Objects | Floats) -> NDArray[np.object_]:
    """[a]× with [a]× b = a × b."""
    x, y, z = a
    return np.array([[0.0, z * -1.0, y], [z, 0.0, x * -1.0], [y * -1.0, x, 0.0]], dtype=object)


def cross(a: Objects, b: Objects) -> Objects:
    """a × b, for a (3,) or columns (3, n)."""
    if a.ndim == 2:
        b = b[:, None] if b.ndim == 1 else b
    x = a[1] * b[2] - a[2] * b[1]
    y = a[2] * b[0] - a[0] * b[2]
    z = a[0] * b[1] - a[1] * b[0]
    return np.array([x, y, z], dtype=object)


def multiply(a: Objects | Floats, b: Objects | Floats) -> Objects:
    """Product of matrices of scalars, skipping plain zeros (most entries of these)."""
    columns = b[:, None] if b.ndim == 1 else b
    others = [[(j, x) for j, x in enumerate(row) if some(x)] for row in columns.tolist()]
    rows = [_combined(row, others, columns.shape[1]) for row in a.tolist()]
    out = np.array(rows, dtype=object).reshape(len(rows), columns.shape[1])
    return out[:, 0] if b.ndim == 1 else out


def _combined(
    factors: list[Scalar], rows: list[list[tuple[int, Scalar]]], size: int
) -> list[Scalar]:
    """Σ factor × row over rows of (place, value), plain zeros left out."""
    total: list[Scalar] = [0] * size
    for factor, row in zip(factors, rows, strict=True):
        if row and some(factor):
            for j, value in row:
                total[j] = total[j] + factor * value
    return total


def scaled(a: Objects | Floats, factor: Scalar) -> Objects:
    """A vector times a scalar."""
    return np.array([value * factor for value in a.tolist()], dtype=object)


def present(a: Objects | Floats) -> NDArray[np.bool_]:
    """Mask of the entries that are not the plain number zero."""
    return np.array([some(value) for value in a.ravel().tolist()], dtype=bool).reshape(a.shape)


def some(value: Scalar) -> bool:
    """True where it is not the plain number zero."""
    return not isinstance(value, (float, int)) or value != 0.0


def carried(R: Objects | Floats, lever: Objects) -> Objects:
    """(6, 6) map of a motion (v, ω) of a base point to a point at ``lever`` (base axes), turned.

    v_f = Rᵀ (v + ω × lever), ω_f = Rᵀ ω, with R from follower to base axes.
    """
    out = np.zeros((6, 6), dtype=object)
    out[:3, :3] = R.T
    out[3:, 3:] = R.T
    if present(lever).any():
        out[:3, 3:] = multiply(R.T.astype(object), skew(lever) * -1.0)
    return out


X, Y, Z = np.eye(3)


class JointMotion(NamedTuple):
    """R (3, 3), d (3,) and A (6, k); see the module."""

    rotation: Objects
    translation: Objects
    freedoms: Objects


def joint_motion(joint: Any, values: Sequence[Scalar]) -> JointMotion:
    """Relative motion of one joint of the case at the values of its freedoms (rad, m)."""
    none = np.zeros(3, dtype=object)
    match joint.type:
        case "revolute":
            a = unit(getattr(joint, "axis", None), Z)
            return JointMotion(rotation(a, values[0]), none, _columns((0 * a, a)))
        case "prismatic":
            a = sliding_axis(joint)
            return JointMotion(_eye(), scaled(a, values[0]), _columns((a, 0 * a)))
        case "cylindrical":
            a = sliding_axis(joint)
            columns = _columns((a, 0 * a), (0 * a, a))
            return JointMotion(rotation(a, values[1]), scaled(a, values[0]), columns)
        case "screw":
            a, pitch = sliding_axis(joint), joint.lead / (2.0 * math.pi)
            travel = scaled(a, values[0] * pitch)
            return JointMotion(rotation(a, values[0]), travel, _columns((pitch * a, a)))
        case "carriage":
            return JointMotion(_eye(), none, _columns((X, 0 * X)))
        case "nut":
            turn = 2.0 * math.pi / joint.lead
            return JointMotion(rotation(X, values[0] * turn), none, _columns((X, turn * X)))
        case "universal":
            return _successive([unit(axis, None) for axis in joint.axes], values)
        case "spherical":
            return _successive([X, Y, Z], values)
        case "fixed":
            return JointMotion(_eye(), none, np.zeros((6, 0), dtype=object))
    raise NotImplementedError(f"no motion is defined for joints of type {joint.type!r}")


def turned(motion: JointMotion) -> JointMotion:
    """The base's motion relative to the follower: Rᵀ, −Rᵀ d, and −X⁻¹ A in the base's axes.

    X carries a motion from base to follower, X⁻¹ = carried(Rᵀ, −Rᵀ d).
    """
    back = motion.rotation.T
    lever = multiply(back, motion.translation) * -1.0
    return JointMotion(back, lever, multiply(carried(back, lever), motion.freedoms) * -1.0)


def _successive(axes: Sequence[Floats], values: Sequence[Scalar]) -> JointMotion:
    """R = R_1 R_2 …, R_k = Rot(a_k, c_k): ω = Σ (R_{k+1} R_{k+2} …)ᵀ a_k ċ_k."""
    R, A = _eye(), np.zeros((6, len(axes)), dtype=object)
    for k, axis in reversed([*enumerate(axes)]):
        A[3:, k] = multiply(R.T, axis)
        R = multiply(rotation(axis, values[k]), R)
    return JointMotion(R, np.zeros(3, dtype=object), A)


def sliding_axis(joint: Any) -> Floats:
    """Unit vector along which a prismatic, cylindrical or screw joint slides, in its own axes."""
    return unit(joint.axis, X if joint.type == "prismatic" else Z)


def unit(axis: Sequence[float] | None, default: Floats | None) -> Floats:
    """The axis as a unit vector of three components."""
    if axis is None:
        assert default is not None
        return default
    a = np.array([*axis, 0.0][:3], dtype=np.float64)
    return np.asarray(a / np.linalg.norm(a))


def _eye() -> Objects:
    return np.eye(3).astype(object)


def _columns(*twists: tuple[Floats, Floats]) -> Objects:
    return np.array([np.concatenate(t) for t in twists]).T.astype(object)
