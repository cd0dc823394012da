"""Planar serial arms in closed form, written down without the code under test."""

from __future__ import annotations

import numpy as np

from eigassign.mechanism.tip_chain import TipChain


def serial_arm(*lengths: float, absolute: bool = True) -> TipChain:
    """Links of the given lengths; q are absolute link angles, or angles between the links."""
    L, n = np.array(lengths), len(lengths)
    to_absolute = np.eye(n) if absolute else np.tril(np.ones((n, n)))

    def position(q: np.ndarray) -> np.ndarray:
        a = q @ to_absolute.T
        return np.stack([np.cos(a) @ L, np.sin(a) @ L], axis=1)

    def jacobian(q: np.ndarray) -> np.ndarray:
        a = q @ to_absolute.T
        return np.stack([(-np.sin(a) * L) @ to_absolute, (np.cos(a) * L) @ to_absolute], axis=1)

    relative = np.eye(n) - np.eye(n, k=-1) if absolute else np.eye(n)
    names = ("shoulder", "elbow", "wrist", "j4", "j5", "j6")[:n]
    return TipChain(position, jacobian, names, (relative, np.zeros(n)))


def two_link_angles(points: np.ndarray, l1: float, l2: float, sign: float) -> np.ndarray:
    """Shoulder and relative elbow angle by the law of cosines, elbow of the given sign."""
    x, y = points.T
    elbow = sign * np.arccos((x**2 + y**2 - l1**2 - l2**2) / (2 * l1 * l2))
    shoulder = np.arctan2(y, x) - np.arctan2(l2 * np.sin(elbow), l1 + l2 * np.cos(elbow))
    return np.stack([shoulder, elbow], axis=1)
