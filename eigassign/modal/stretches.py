"""A path as stretches without corners: no polynomial goes round one, nor from path to path."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.errors import AccuracyError, UsageError
from eigassign.mechanism.trajectories import Trajectories
from eigassign.modal.corners import smooth_parts
from eigassign.modal.line import Stretch
from eigassign.modal.region import Region, joints_of, path_samples

Floats = NDArray[np.float64]
STRAYS = 0.03  # of a path's reach by which its interpolant may miss it


@dataclass(frozen=True, eq=False)
class Path:
    """Stretches, which of all samples each has, and its length."""

    parts: tuple[Stretch, ...]
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
    if not shape[0]:
        raise UsageError("a trajectory without samples is no region: give at least one pose")
    q, directions = np.ndarray(shape, buffer=path), np.ndarray(of, buffer=combinations)
    if not np.isfinite(q).all():
        raise UsageError("q must be finite")
    joints = joints_of(directions, shape[1])
    s = q @ joints.T
    rows = smooth_parts(s)
    lengths = tuple(float(np.linalg.norm(np.diff(s[own], axis=0), axis=1).sum()) for own in rows)
    parts = tuple(Stretch(q[own], joints, of[1] - shape[1]) for own in rows)
    return Path(parts, rows, lengths)


def followed(regions: Sequence[Region]) -> None:
    """Raise AccuracyError where nodes that were given do not even show the path."""
    for region in regions:
        if region.d == 1 and region.line is not None and region.line.strays > STRAYS:
            raise AccuracyError(
                f"{len(region.axes[0].nodes)} solves do not follow the path: between them it is "
                f"missed by {region.line.strays:.0%} of its reach; give more"
            )
