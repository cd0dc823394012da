"""Sampled paths, cut where they turn sharply: no polynomial goes round a corner.

At sample i the step to the next one may hold a corner: the direction before it and the one after
differ by J_i; of a smooth path that is its curvature, as the steps around show it, times the length
between the middles of both.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.errors import UsageError
from eigassign.mechanism.trajectory.trajectory import Trajectories
from eigassign.modal.arguments import samples

Floats = NDArray[np.float64]
STILL = 1e-9  # rad or m: what moves less stands still, what is off by less lies on the path
LEAST_TURN = 1e-5  # rad: less is no corner
SHARP = 4.0  # times the turn that the curvature around explains
LEAST_SAMPLES = 4  # of a stretch
MOST_PARTS = 32


def read_path(
    q: ArrayLike | Trajectories | Sequence[Floats], directions: Floats, n_q: int
) -> tuple[tuple[slice, ...], tuple[Floats, ...]]:
    """Stretches without corners (n_t, n_q), and which of all samples each has.

    ``q`` is one path, samples (n_t, n_q) or a pose (n_q,), or several in turn; ``directions``
    (n_w, n_x) are the combinations of x = (q, y) on which anything depends. Raises UsageError for
    samples of wrong shapes, or none.
    """
    joints, n_y = moving_joints(directions, n_q), directions.shape[1] - n_q
    stretches: list[Floats] = []
    rows: list[slice] = []
    start = 0
    for each in _several(q):
        path = samples(each, np.zeros(n_y), n_q, n_y)[:, :n_q]
        if not len(path):
            raise UsageError("a trajectory without samples is no region: give at least one pose")
        for own in smooth_parts(path @ joints.T):
            stretches.append(path[own])
            rows.append(slice(start + own.start, start + own.stop))
        start += len(path)
    return tuple(rows), tuple(stretches)


def _several(q: Any) -> list[Any]:
    if isinstance(q, Trajectories):
        return [part.trajectory.q for part in q.parts]
    several = isinstance(q, list | tuple) and all(np.ndim(each) == 2 for each in q)
    return list(q) if several and len(q) else [q]


def moving_joints(directions: Floats, n_q: int) -> Floats:
    """The joint coordinates that matter, (n_s, n_q)."""
    return np.asarray(directions[(directions[:, :n_q] != 0.0).any(axis=1), :n_q])


def along_chord(reach: Floats) -> tuple[Floats, Floats, bool]:
    """Each of s − s_0 (n_t, n_s) as a part of the way to the farthest, that, and if all lie there.

    So they do on a straight path, in whatever order it is travelled.
    """
    far = reach[np.argmax(np.square(reach).sum(axis=1))]
    parts = reach @ far / max(float(far @ far), 1e-300)
    return parts, far, bool(np.abs(reach - np.outer(parts, far)).max(initial=0.0) <= STILL)


def smooth_parts(s: Floats) -> tuple[slice, ...]:
    """Samples s (n_t, n_s) between corners, in order and without a gap; one slice if none is.

    A path with more corners than samples could show, as a noisy one, is left whole.
    """
    moving = np.flatnonzero(np.append(True, np.linalg.norm(np.diff(s, axis=0), axis=1) > STILL))
    if len(moving) < 4 or along_chord(s - s[0])[2]:
        return (slice(0, len(s)),)
    bounds = [0]
    for end in moving[_corners(s[moving]) + 1].tolist():  # the first sample after each
        if end - bounds[-1] >= LEAST_SAMPLES and len(s) - end >= LEAST_SAMPLES:
            bounds.append(end)
    if len(bounds) > min(MOST_PARTS, len(s) // (2 * LEAST_SAMPLES)):
        return (slice(0, len(s)),)
    return tuple(slice(a, b) for a, b in itertools.pairwise([*bounds, len(s)]))


def _corners(s: Floats) -> NDArray[np.intp]:
    """Rows i of s (n, n_s) with a corner at i or on the way to i + 1, each corner once."""
    steps = np.diff(s, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    t = steps / lengths[:, None]
    turn, span = _turns(t, lengths, 1)
    curvature = np.concatenate([[np.nan], turn / span, [np.nan]])  # between steps i − 1 and i
    turn, span = _turns(t, lengths, 2)
    n = len(turn)
    around = np.fmax(curvature[:n], curvature[3 : n + 3]) if n > 1 else np.zeros(n)
    sharp = np.flatnonzero(turn > np.maximum(SHARP * around * span, LEAST_TURN))
    groups = np.split(sharp, np.flatnonzero(np.diff(sharp) > 1) + 1)
    return np.array([g[np.argmax(turn[g])] + 1 for g in groups if len(g)], dtype=np.intp)


def _turns(t: Floats, lengths: Floats, apart: int) -> tuple[Floats, Floats]:
    """Angle between directions so many steps apart, and the path between their middles."""
    turn = 2.0 * np.arcsin(np.minimum(0.5 * np.linalg.norm(t[apart:] - t[:-apart], axis=1), 1.0))
    middles = np.cumsum(lengths) - 0.5 * lengths
    return turn, middles[apart:] - middles[:-apart]
