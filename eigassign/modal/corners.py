"""Where a sampled path turns sharply: no frequency along it is smooth there.

At sample i the step to the next one may hold a corner. The direction before it and the one after
differ by J_i; of a smooth path that is its curvature, as the steps around show it, times the
length between the middles of both.
"""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from eigassign.modal.line import STILL

Floats = NDArray[np.float64]
LEAST_TURN = 1e-5  # rad: less is no corner
SHARP = 4.0  # times the turn that the curvature around explains
LEAST_SAMPLES = 4  # of a part
MOST_PARTS = 32


def smooth_parts(s: Floats) -> tuple[slice, ...]:
    """Samples s (n_t, n_s) between corners, in order and without a gap; one slice if none is.

    A path with more corners than samples could show, as a noisy one, is left whole.
    """
    moving = np.flatnonzero(np.append(True, np.linalg.norm(np.diff(s, axis=0), axis=1) > STILL))
    whole = (slice(0, len(s)),)
    if len(moving) < 4 or _straight(s):
        return whole
    ends = moving[_corners(s[moving]) + 1]  # the first sample after each
    bounds = np.concatenate([[0], _apart(ends, len(s)), [len(s)]])
    if len(bounds) - 1 > min(MOST_PARTS, len(s) // (2 * LEAST_SAMPLES)):
        return whole
    return tuple(slice(a, b) for a, b in itertools.pairwise(bounds.tolist()))


def _straight(s: Floats) -> bool:
    """Whether all samples lie on one line, whatever their order."""
    reach = s - s[0]
    far = reach[np.argmax(np.square(reach).sum(axis=1))]
    along = reach @ far / max(float(far @ far), 1e-300)
    return bool(np.abs(reach - np.outer(along, far)).max() <= STILL)


def _corners(s: Floats) -> NDArray[np.intp]:
    """Rows i of s (n, n_s) with a corner at i or on the way to i + 1, each corner once."""
    steps = np.diff(s, axis=0)
    lengths = np.linalg.norm(steps, axis=1)
    t = steps / lengths[:, None]
    across, span = _turns(t, lengths, 2)
    explained = SHARP * _curvature(t, lengths) * span
    return _peaks(across, np.maximum(explained, LEAST_TURN))


def _turns(t: Floats, lengths: Floats, apart: int) -> tuple[Floats, Floats]:
    """Angle between directions so many steps apart, and the path between their middles."""
    turn = 2.0 * np.arcsin(np.minimum(0.5 * np.linalg.norm(t[apart:] - t[:-apart], axis=1), 1.0))
    middles = np.cumsum(lengths) - 0.5 * lengths
    return turn, middles[apart:] - middles[:-apart]


def _curvature(t: Floats, lengths: Floats) -> Floats:
    """Of what lies around each pair of directions two steps apart: the larger of both sides."""
    turn, span = _turns(t, lengths, 1)
    rate = np.concatenate([[np.nan], turn / span, [np.nan]])  # between steps i − 1 and i
    n = len(t) - 2
    return np.fmax(rate[:n], rate[3 : n + 3]) if n > 1 else np.zeros(n)


def _peaks(turn: Floats, least: Floats) -> NDArray[np.intp]:
    """Rows + 1 of turns over ``least``, of neighbours only the largest."""
    sharp = np.flatnonzero(turn > least)
    groups = np.split(sharp, np.flatnonzero(np.diff(sharp) > 1) + 1)
    return np.array([g[np.argmax(turn[g])] + 1 for g in groups if len(g)], dtype=np.intp)


def _apart(ends: NDArray[np.intp], n: int) -> NDArray[np.intp]:
    """Of corners those that leave every part enough samples."""
    kept = [0]
    for end in ends.tolist():
        if end - kept[-1] >= LEAST_SAMPLES and n - end >= LEAST_SAMPLES:
            kept.append(end)
    return np.array(kept[1:], dtype=np.intp)
