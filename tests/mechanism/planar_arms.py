"""Planar serial arms in closed form, written down without the code under test."""

import numpy as np

from eigassign.mechanism import TipChain, TipEvaluation

NAMES = ("shoulder", "elbow", "wrist", "j4", "j5", "j6")


def serial_arm(*lengths: float, absolute: bool = True, oriented: bool = False) -> TipChain:
    """Links of the given lengths; q are absolute link angles, or angles between the links."""
    L, n = np.array(lengths), len(lengths)
    to_absolute = np.eye(n) if absolute else np.tril(np.ones((n, n)))

    def evaluate(q: np.ndarray) -> TipEvaluation:
        a = q @ to_absolute.T
        c, s = np.cos(a), np.sin(a)
        J = [(-s * L) @ to_absolute, (c * L) @ to_absolute]
        R = None
        if oriented:
            R = np.zeros((len(q), 3, 3))
            R[:, 0, 0] = R[:, 1, 1] = c[:, -1]
            R[:, 1, 0], R[:, 0, 1], R[:, 2, 2] = s[:, -1], -s[:, -1], 1.0
            J.append(np.broadcast_to(to_absolute[-1], q.shape))
        return open_chain_tip(np.stack([c @ L, s @ L], axis=1), np.stack(J, axis=1), R)

    relative = np.eye(n) - np.eye(n, k=-1) if absolute else np.eye(n)
    turned_by = (2,) if oriented else ()
    return TipChain(evaluate, NAMES[:n], (relative, np.zeros(n)), ("turn",) * n, turned_by)


def open_chain_tip(point: np.ndarray, J: np.ndarray, R: np.ndarray | None = None) -> TipEvaluation:
    """What a chain without loops shows."""
    n = len(point)
    return TipEvaluation(point, R, J, np.zeros((n, 0)), np.zeros((n, 0, J.shape[2])))


def two_link_angles(points: np.ndarray, l1: float, l2: float, sign: float) -> np.ndarray:
    """Shoulder and relative elbow angle by the law of cosines, elbow of the given sign."""
    x, y = points.T
    elbow = sign * np.arccos((x**2 + y**2 - l1**2 - l2**2) / (2 * l1 * l2))
    shoulder = np.arctan2(y, x) - np.arctan2(l2 * np.sin(elbow), l1 + l2 * np.cos(elbow))
    return np.stack([shoulder, elbow], axis=1)
