"""A path of samples as axes v ∈ [−1, 1]: cut at its corners, each stretch one axis with its nodes.

Where a stretch is straight in joint space, v is the joint coordinate along it; else v is the
distance travelled there, and its samples alone are candidates for nodes and can be asked for.

No polynomial goes round a corner. At sample i the step to the next one may hold a corner: the
direction before it and the one after differ by J_i; of a smooth path that is its curvature, as the
steps around show it, times the length between the middles of both.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.errors import UsageError
from eigassign.interpolation.newton import Nodes, basis, generic, interval, roots
from eigassign.mechanism.trajectory.trajectory import Trajectories
from eigassign.modal.arguments import samples

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
STILL = 1e-9  # rad or m: what moves less stands still, what is off by less lies on the path

# --- Nodes of an axis

MOST_STATIONS = 48  # nodes along a trajectory
DENSE = 513  # samples of a trajectory that may be nodes
MOST_GIVEN = 128  # nodes on an axis where solves are given: with more, round-off grows
SKEW = 0.03  # by which the best nodes are shifted in the middle
CHECKS = 15  # generic places on an axis where an interpolant may be checked


@dataclass(frozen=True, eq=False)
class Axis:
    """Nodes, and what each and each check adds to the centre of x, (n_points, n_x)."""

    points: Nodes
    steps: Floats

    @property
    def nodes(self) -> Floats:
        """v of the nodes, in their order."""
        return self.points.v


@lru_cache(maxsize=64)
def interval_nodes(most: int) -> Nodes:
    """Nested nodes of [−1, 1], and where they are checked."""
    return Nodes(interval(), most, checks=tuple(generic(CHECKS).tolist()))


@lru_cache(maxsize=64)
def chosen_nodes(count: int) -> Nodes:
    """The best ``count`` nodes of [−1, 1], nearly; `MOST_GIVEN` of them at most."""
    count = min(count, MOST_GIVEN)
    return Nodes(_best(count), count, domain=interval(4 * MOST_GIVEN + 1))


def _sampled(places: Floats, of: int, count: int | None) -> Nodes:
    """Nodes among the ``of`` samples: Leja points, or the ``count`` nearest to the best places.

    Of given counts `MOST_GIVEN` at most, unless they are all samples.
    """
    if count is None or count >= of:
        most = MOST_STATIONS if count is None else count
        nodes = Nodes(places, most, of <= most)
        return nodes if nodes.whole else replace(nodes, checks=_others(places, nodes.v))
    count = min(count, MOST_GIVEN)
    nearest = np.unique(np.abs(places[:, None] - _best(count)).argmin(axis=0))
    return Nodes(places[nearest] if len(nearest) == count else places, count, domain=places)


def _others(places: Floats, nodes: Floats) -> tuple[float, ...]:
    """Of samples that are no nodes those nearest to generic places."""
    others = np.setdiff1d(places, nodes)
    nearest = np.abs(others[:, None] - generic(CHECKS)).argmin(axis=0) if len(others) else []
    return tuple(others[list(dict.fromkeys(nearest))].tolist())


def _best(count: int) -> Floats:
    """The best places, a little askew: at symmetric ones an even f shows only half of itself."""
    v = roots(count)
    return np.asarray(v + SKEW * (1.0 - v * v))


# --- A stretch without corners as one axis


@dataclass(frozen=True, eq=False)
class Line:
    """A trajectory as one axis: v_0 of its samples; a straight one is linear in x."""

    axis: Axis
    place: Floats  # (n_t,) in [−1, 1]
    row: Floats  # dv_0/dx (n_x,)
    straight: bool
    reach: Floats  # joint coordinates from the first sample on, (n_t, n_s)

    @cached_property
    def table(self) -> Floats:
        """Newton's basis at the samples, (n_t, most)."""
        return basis(self.axis.nodes, self.place)

    @cached_property
    def missed(self) -> float:
        """Error of the path's own interpolant at all nodes, as a part of its reach.

        The error of frequencies along it is not smaller, whatever few of them show.
        """
        if self.straight:
            return 0.0
        count = len(self.axis.nodes)
        c = self.axis.points.inverse @ self.reach[np.searchsorted(self.place, self.axis.nodes)]
        off = np.abs(self.table[:, :count] @ c - self.reach).max()
        return float(off / np.abs(self.reach).max())


@dataclass(frozen=True, eq=False)
class Stretch:
    """Finite samples q (n_t, n_q) of a path, and the joint coordinates that matter (n_s, n_q)."""

    q: Floats
    joints: Floats
    n_y: int

    def line(self, count: int | None) -> Line | None:
        """Its axis, made once for all designs, with nested nodes or the best ``count`` ones.

        None where it stands still in the joint coordinates.
        """
        return _line(self, count)

    def rest(self) -> Line:
        """An axis of a single node, for a stretch that stands still."""
        n_t, n_x = len(self.q), self.q.shape[1] + self.n_y
        axis = Axis(Nodes(np.zeros(1), 1, True), np.zeros((1, n_x)))
        reach = np.zeros((n_t, len(self.joints)))
        return Line(axis, np.zeros(n_t), np.zeros(n_x), True, reach)


@lru_cache(maxsize=64)
def _line(stretch: Stretch, count: int | None) -> Line | None:
    q, joints, n_y = stretch.q, stretch.joints, stretch.n_y
    if not q.shape[1]:
        return None
    reach = (q - q[0]) @ joints.T
    if not reach.size or np.abs(reach).max() <= STILL:
        return None
    place, row, straight = _placed(reach, joints)
    row = np.append(row, np.zeros(n_y))
    if straight:
        points = interval_nodes(MOST_STATIONS) if count is None else chosen_nodes(count)
        far = int(np.abs(place - place[0]).argmax())
        back = np.linalg.pinv(joints) @ (reach[far] / (place[far] - place[0]))
        steps = np.outer(points.points - place[0], np.append(back, np.zeros(n_y)))
        return Line(Axis(points, steps), place, row, True, reach)
    keep = np.unique(place, return_index=True)[1]
    some = np.unique(np.linspace(0, len(keep) - 1, min(len(keep), DENSE)).round().astype(int))
    points = _sampled(place[keep[some]], len(keep), count)
    steps = np.zeros((len(points.points), q.shape[1] + n_y))
    at = np.searchsorted(place[keep], points.points)
    steps[:, : q.shape[1]] = q[keep[at]] - q[0]
    return Line(Axis(points, steps), place, row, False, reach)


def _placed(reach: Floats, S: Floats) -> tuple[Floats, Floats, bool]:
    """v (n_t,) in [−1, 1], dv/dq, and whether the path s − s_0 (n_t, n_s) is straight."""
    far, along = _along(reach)
    straight = bool(np.abs(reach - np.outer(along, far)).max() <= STILL)
    if not straight:
        steps = np.linalg.norm(np.diff(reach, axis=0), axis=1)
        along = np.concatenate([[0.0], np.cumsum(steps)])
    low, width = along.min(), np.ptp(along)
    row = 2.0 / width * (far / (far @ far)) @ S if straight else np.zeros(S.shape[1])
    return 2.0 * (along - low) / width - 1.0, row, straight


def _along(reach: Floats) -> tuple[Floats, Floats]:
    """The farthest sample from the first (n_s,), and each as a part of the way there (n_t,)."""
    far = reach[np.argmax(np.square(reach).sum(axis=1))]
    return far, reach @ far / max(float(far @ far), 1e-300)


# --- Where a sampled path turns sharply: no frequency along it is smooth there

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
    if len(moving) < 4:
        return whole
    far, along = _along(s - s[0])
    if np.abs(s - s[0] - np.outer(along, far)).max() <= STILL:  # straight, in whatever order
        return whole
    ends = moving[_corners(s[moving]) + 1]  # the first sample after each
    bounds = np.concatenate([[0], _apart(ends, len(s)), [len(s)]])
    if len(bounds) - 1 > min(MOST_PARTS, len(s) // (2 * LEAST_SAMPLES)):
        return whole
    return tuple(slice(a, b) for a, b in itertools.pairwise(bounds.tolist()))


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


# --- Paths as their stretches, one after the other


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


def path_samples(q: ArrayLike, n_q: int, n_y: int) -> Floats:
    """Of a trajectory, (n_t, n_q). Raises UsageError for wrong shapes."""
    if isinstance(q, np.ndarray) and q.dtype == np.float64 and q.ndim == 2 and q.shape[1] == n_q:
        return q  # whether it is finite is checked once
    return samples(q, np.zeros(n_y), n_q, n_y)[:, :n_q]


def joints_of(directions: Floats, n_q: int) -> Floats:
    """The joint coordinates that matter, (n_s, n_q)."""
    return np.asarray(directions[(directions[:, :n_q] != 0.0).any(axis=1), :n_q])
