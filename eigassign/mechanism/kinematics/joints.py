"""The joints: how a follower stands and moves relative to its base, written on any scalar.

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

from eigassign.mechanism.kinematics.rotations import Objects, carried, multiply, rotation
from eigassign.series.expression import Scalar

Floats = NDArray[np.float64]
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
            return JointMotion(_eye(), _scaled(a, values[0]), _columns((a, 0 * a)))
        case "cylindrical":
            a = sliding_axis(joint)
            columns = _columns((a, 0 * a), (0 * a, a))
            return JointMotion(rotation(a, values[1]), _scaled(a, values[0]), columns)
        case "screw":
            a, pitch = sliding_axis(joint), joint.lead / (2.0 * math.pi)
            travel = _scaled(a, values[0] * pitch)
            return JointMotion(rotation(a, values[0]), travel, _columns((pitch * a, a)))
        case "carriage":
            return JointMotion(_eye(), none, _columns((X, 0 * X)))
        case "nut":
            turn = 2.0 * math.pi / joint.lead
            return JointMotion(rotation(X, values[0] * turn), none, _columns((X, turn * X)))
        case "universal":
            return _universal(joint, values)
        case "spherical":
            return _spherical(values)
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


def _universal(joint: Any, values: Sequence[Scalar]) -> JointMotion:
    """Rot(a, c1) Rot(b, c2): ω = Rot(b, c2)ᵀ a ċ1 + b ċ2."""
    a, b = (unit(axis, None) for axis in joint.axes)
    first, second = rotation(a, values[0]), rotation(b, values[1])
    A = np.zeros((6, 2), dtype=object)
    A[3:, 0], A[3:, 1] = multiply(second.T, a), b
    return JointMotion(multiply(first, second), np.zeros(3, dtype=object), A)


def _spherical(values: Sequence[Scalar]) -> JointMotion:
    """Rx(c1) Ry(c2) Rz(c3): successive rotations about the follower's own axes."""
    x, y, z = (rotation(axis, c) for axis, c in zip((X, Y, Z), values, strict=True))
    A = np.zeros((6, 3), dtype=object)
    A[3:, 0] = multiply(multiply(y, z).T, X)
    A[3:, 1] = multiply(z.T, Y)
    A[3:, 2] = Z
    return JointMotion(multiply(x, multiply(y, z)), np.zeros(3, dtype=object), A)


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


def _scaled(axis: Floats, value: Scalar) -> Objects:
    return np.array([value * float(c) for c in axis], dtype=object)


def _columns(*twists: tuple[Floats, Floats]) -> Objects:
    return np.array([np.concatenate(t) for t in twists]).T.astype(object)
