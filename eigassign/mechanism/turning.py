"""Rotations as arrays of numbers, batched: the exponential and the logarithm of SO(3).

Shapes: n rotations (n, 3, 3), n rotation vectors (n, 3) in rad.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
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
