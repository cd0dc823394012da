"""A path as stretches without corners: no polynomial goes round one, nor from path to path.

A corner is where the direction in joint space turns at once: by more than `TURN`, and `ABRUPT`
times as much as it does from sample to sample elsewhere. Where there are more than `MOST_CORNERS`
of them the samples are rough as such, and the path is left in one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.errors import UsageError
from eigassign.mechanism.trajectories import Trajectories
from eigassign.modal.line import STILL
from eigassign.modal.region import joints_of, path_samples

Floats = NDArray[np.float64]
TURN = np.radians(5.0)
ABRUPT = 8.0
STRAIGHT = 1e-6  # rad: what turns by less is round-off
MOST_CORNERS = 12
SHORTEST = 4  # samples of a stretch


@dataclass(frozen=True, eq=False)
class Path:
    """Samples (n, n_q) of each stretch, which of all samples they are, and its length."""

    parts: tuple[Floats, ...]
    rows: tuple[slice, ...]
    lengths: tuple[float, ...]

    def shares(self, solves: int, least: int) -> list[int]:
        """How many of ``solves`` each stretch has: as it is long, and ``least`` at least."""
        n = len(self.parts)
        if n == 1:
            return [solves]
        if solves < least * n:
            raise UsageError(
                f"{solves} solves for {n} stretches between corners: at least {least * n} are "
                "needed to tell an error"
            )
        counts, lengths = np.full(n, least), np.array(self.lengths)
        for _ in range(solves - least * n):
            counts[np.argmax(lengths / counts)] += 1
        return [int(count) for count in counts]


def stretches(q: ArrayLike | Trajectories | Sequence[Floats], directions: Floats, n_q: int) -> Path:
    """Of one path, samples (n_t, n_q) or a pose (n_q,), or of several one after the other."""
    n_y = directions.shape[1] - n_q
    paths = [path_samples(each, n_q, n_y) for each in _several(q)]
    found = [_known(p.tobytes(), p.shape, directions.tobytes(), directions.shape) for p in paths]
    if len(found) == 1:
        return found[0]
    starts = np.cumsum([0, *map(len, paths)])
    rows = (
        slice(int(start) + own.start, int(start) + own.stop)
        for start, path in zip(starts, found, strict=False)
        for own in path.rows
    )
    parts = (part for path in found for part in path.parts)
    return Path(tuple(parts), tuple(rows), tuple(n for path in found for n in path.lengths))


def _several(q: Any) -> list[ArrayLike]:
    if isinstance(q, Trajectories):
        return [part.trajectory.q for part in q.parts]
    several = isinstance(q, list | tuple) and all(np.ndim(each) == 2 for each in q)
    return list(q) if several and len(q) else [q]


@lru_cache(maxsize=64)
def _known(path: bytes, shape: tuple[int, int], combinations: bytes, of: tuple[int, int]) -> Path:
    """Made once for all designs."""
    q, directions = np.ndarray(shape, buffer=path), np.ndarray(of, buffer=combinations)
    if not np.isfinite(q).all():
        raise UsageError("q must be finite")
    s = q @ joints_of(directions, shape[1]).T
    cuts = [0, *_corners(s), len(q)]
    rows = tuple(slice(a, b) for a, b in pairwise(cuts))
    lengths = tuple(float(np.linalg.norm(np.diff(s[own], axis=0), axis=1).sum()) for own in rows)
    return Path(tuple(q[own] for own in rows), rows, lengths)


def _corners(s: Floats) -> list[int]:
    """The first sample after each corner of s (n_t, n_s)."""
    if s.shape[1] < 2:  # on a line: it may go back and forth
        return []
    step = np.diff(s, axis=0)
    size = np.linalg.norm(step, axis=1)
    moving = np.flatnonzero(size > STILL)
    if len(moving) < 2 * SHORTEST:
        return []
    unit = step[moving] / size[moving, None]
    turn = 2.0 * np.arcsin(np.clip(0.5 * np.linalg.norm(np.diff(unit, axis=0), axis=1), 0.0, 1.0))
    usual = ABRUPT * float(np.median(turn))
    sharp = np.flatnonzero(turn > max(TURN, usual))
    # a corner within a step turns at both its ends, at the nearer one by almost all
    both = np.append(turn, 0.0)[sharp + 1] > max(STRAIGHT, usual)
    cuts = np.unique(moving[sharp + both] + 1)
    gaps = np.diff(np.concatenate([[0], cuts, [len(s)]]))
    kept = cuts[np.minimum(gaps[:-1], gaps[1:]) >= SHORTEST]
    return [int(cut) for cut in kept] if len(kept) <= MOST_CORNERS else []
