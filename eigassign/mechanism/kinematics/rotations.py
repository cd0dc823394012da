"""Rotations and rigid transformations on scalars that may be numbers or expressions.

Rotations as arrays of numbers, batched: the exponential and the logarithm of SO(3).

Shapes: n rotations (n, 3, 3), n rotation vectors (n, 3) in rad.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from eigassign.series.expression import Expression, Scalar, cos, sin

# --- Rotations and rigid transformations on scalars that may be numbers or expressions

Objects = NDArray[np.object_]
Floats = NDArray[np.float64]


def vector(values: Sequence[Scalar]) -> Objects:
    """Three components; a planar vector gets z = 0."""
    padded = [*values, 0.0, 0.0][:3]
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


def euler(angles: Sequence[float]) -> Floats:
    """R = Rz(rz) Ry(ry) Rx(rx) for (rx, ry, rz) in rad."""
    x, y, z = (rotation(axis, a) for axis, a in zip(np.eye(3), angles, strict=True))
    return np.asarray(multiply(z, multiply(y, x)), dtype=np.float64)


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


def present(a: Objects | Floats) -> NDArray[np.bool_]:
    """Which entries are not the plain number zero."""
    return np.array([some(value) for value in a.ravel().tolist()], dtype=bool).reshape(a.shape)


def some(value: Scalar) -> bool:
    """Whether it is not the plain number zero."""
    return isinstance(value, Expression) or value != 0.0


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


# --- Rotations as arrays of numbers, batched: the exponential and the logarithm of SO(3)

_SMALL = 1e-4  # rad: below, the series to second order is exact to 1e-17
_HALF_TURN = 1e-6  # of sin θ: nearer to half a turn the axis is read off the symmetric part


def exponential(v: Floats) -> Floats:
    """R = 1 + sin θ [a]× + (1 − cos θ) [a]×² for rotation vectors v = θ a (Rodrigues)."""
    theta = np.linalg.norm(v, axis=-1)[..., None, None]
    safe = np.where(theta > _SMALL, theta, 1.0)
    first = np.where(theta > _SMALL, np.sin(safe) / safe, 1.0 - theta**2 / 6.0)
    half = np.sin(0.5 * safe) / safe
    second = np.where(theta > _SMALL, 2.0 * half**2, 0.5 - theta**2 / 24.0)
    V = _skew(v)
    return np.asarray(np.eye(3) + first * V + second * (V @ V))


def logarithm(R: Floats) -> Floats:
    """The rotation vector of R with |v| ≤ π; at half a turn one of the two."""
    odd = 0.5 * np.stack(
        [R[..., 2, 1] - R[..., 1, 2], R[..., 0, 2] - R[..., 2, 0], R[..., 1, 0] - R[..., 0, 1]],
        axis=-1,
    )  # sin θ a
    sine = np.linalg.norm(odd, axis=-1)
    cosine = 0.5 * (np.trace(R, axis1=-2, axis2=-1) - 1.0)
    theta = np.arctan2(sine, cosine)
    safe = np.where(sine > _HALF_TURN, sine, 1.0)
    factor = np.where(sine > _HALF_TURN, theta / safe, 1.0 + theta**2 / 6.0)
    v = factor[..., None] * odd
    flat = (sine <= _HALF_TURN) & (cosine < 0.0)
    if np.any(flat):
        v = np.where(flat[..., None], theta[..., None] * _axis(R), v)
    return np.asarray(v)


def euler_rotation(angles: Floats) -> Floats:
    """R = Rz(rz) Ry(ry) Rx(rx) for angles (n, 3) = (rx, ry, rz) in rad."""
    x, y, z = (exponential(angles[:, [i]] * np.eye(3)[i]) for i in range(3))
    return np.asarray(z @ y @ x)


def _skew(v: Floats) -> Floats:
    out = np.zeros((*v.shape[:-1], 3, 3))
    out[..., 2, 1], out[..., 0, 2], out[..., 1, 0] = v[..., 0], v[..., 1], v[..., 2]
    return out - np.swapaxes(out, -1, -2)


def _axis(R: Floats) -> Floats:
    """The unit axis a of half a turn, where R + 1 = 2 a aᵀ, to the sign."""
    outer = 0.5 * (R + np.swapaxes(R, -1, -2)) + np.eye(3)
    largest = np.argmax(np.einsum("...ii->...i", outer), axis=-1)
    column = np.take_along_axis(outer, largest[..., None, None], axis=-1)[..., 0]
    return np.asarray(column / np.maximum(np.linalg.norm(column, axis=-1, keepdims=True), 1e-300))
