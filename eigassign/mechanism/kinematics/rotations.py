"""Rotations and rigid transformations on scalars that may be numbers or expressions.

Rotations of numbers alone, of which there may be many, are SciPy's (`scipy.spatial.transform`).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from eigassign.series.expression import Scalar, cos, is_constant, sin

Objects = NDArray[np.object_]
Floats = NDArray[np.float64]
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


def scaled(a: Objects, factor: Scalar) -> Objects:
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
