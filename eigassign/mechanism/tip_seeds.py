"""First guesses for inverse kinematics: states spread over all that a chain can do.

Shapes: n_q coordinates, n_z = n_q + n_p entries of a state.
"""

from __future__ import annotations

import numpy as np

from eigassign.mechanism.course import Course
from eigassign.mechanism.tip_chain import Floats, TipChain, reduced

_CLOSED = 1e-9  # of the path's size: gaps of loops that are closed
_TURNS_OF_A_SCREW = 500.0  # rad: as far as first guesses go


def first_guesses(
    chain: TipChain, course: Course, rows: tuple[int, ...], limits: Floats, near: Floats | None
) -> tuple[Floats, Floats]:
    """States z (n_seeds, n_z) with closed loops, and their J (n_seeds, d + r, n_q), not scaled."""
    q = _spread(chain, course, rows, limits, near)
    if near is None:
        return q, reduced(chain.look(q), chain.n_q).J
    z = np.hstack([q, np.broadcast_to(near[chain.n_q :], (len(q), len(near) - chain.n_q))])
    z = _closed(chain, np.vstack([near, z]), course.size)
    return z, reduced(chain.look(z), chain.n_q).J


def _spread(
    chain: TipChain, course: Course, rows: tuple[int, ...], limits: Floats, near: Floats | None
) -> Floats:
    """Evenly spread q (n_seeds, n_q): a Kronecker sequence over all that the branch allows."""
    matrix, offset = chain.relative_map
    n_j = chain.n_q
    middle = matrix @ (np.zeros(n_j) if near is None else near[:n_j]) + offset
    low, width = _ranges(chain, course, middle)
    low[list(rows)], width[list(rows)] = limits.T
    turns = chain.of_kind("turn")[:n_j]
    width = np.where(turns, np.minimum(width, 2.0 * np.pi), width)
    count = min(128, 8 * 2**n_j)
    strides = _harmonious(n_j) ** -np.arange(1.0, n_j + 1.0)
    fractions = np.mod(0.5 + np.arange(count)[:, None] * strides, 1.0)
    return np.asarray((low + width * fractions - offset) @ np.linalg.pinv(matrix).T)


def _ranges(chain: TipChain, course: Course, middle: Floats) -> tuple[Floats, Floats]:
    """Low end and width (n_q,) of each joint: a turn, or as far as the path and the tip may be."""
    n_q = chain.n_q
    low, width = np.zeros(n_q), np.full(n_q, 2.0 * np.pi)
    far = chain.kinds[:n_q]
    if set(far) == {"turn"}:
        return low, width
    state = np.zeros((1, len(chain.kinds)))
    seen = chain.look(state)
    reach = course.size + float(np.linalg.norm(seen.point))
    pitch = np.abs(seen.jacobian[0, : seen.point.shape[1], :n_q]).max(axis=0)
    turns = np.clip(reach / np.maximum(pitch, 1e-12), 2.0 * np.pi, _TURNS_OF_A_SCREW)
    half = np.where(chain.of_kind("slide")[:n_q], reach, turns)
    free = ~chain.of_kind("turn")[:n_q]
    return np.where(free, middle - half, low), np.where(free, 2.0 * half, width)


def _closed(chain: TipChain, z: Floats, size: float) -> Floats:
    """Those of the states whose loops close by moving the passive freedoms alone."""
    n_q = chain.n_q
    if len(chain.kinds) == n_q:
        return z
    z = z.copy()
    for _ in range(20):
        step = reduced(chain.look(z), n_q).closing
        z[:, n_q:] += np.clip(step, -0.5, 0.5)
    good = np.abs(chain.look(z).gap).max(axis=1) <= _CLOSED * max(size, 1.0)
    good[0] = True  # the pose at which the loops are known to close
    return np.asarray(z[good])


def _harmonious(n: int) -> float:
    """The root > 1 of x^(n+1) = x + 1: the golden ratio for n = 1 and its kin above."""
    x = 1.5
    for _ in range(60):  # contracts by at least 2 a step
        x = (1.0 + x) ** (1.0 / (n + 1.0))
    return float(x)
