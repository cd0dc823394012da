"""Where a fit holds: a trajectory or a box of q, times a box of y, as few axes v ∈ [−1, 1].

A trajectory is one axis. Where it is straight in joint space, v is the joint coordinate along it;
else v is the distance travelled there, and its samples alone are candidates for nodes and can be
asked for. Joint coordinates and design parameters that no frequency depends on are no axes.

Nodes on an axis v ∈ [−1, 1], and a trajectory as one such axis.

Where a trajectory is straight in joint space, v is the joint coordinate along it; else v is the
distance travelled there, and its samples alone are candidates for nodes and can be asked for.

A path as stretches without corners: no polynomial goes round one, nor from path to path.

Where a sampled path turns sharply: no frequency along it is smooth there.

At sample i the step to the next one may hold a corner. The direction before it and the one after
differ by J_i; of a smooth path that is its curvature, as the steps around show it, times the
length between the middles of both.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.errors import AccuracyError, UsageError
from eigassign.interpolation.newton import Nodes, basis, generic, interval, roots
from eigassign.mechanism.trajectory.trajectory import Trajectories
from eigassign.modal.arguments import samples

# --- Nodes on an axis v ∈ [−1, 1], and a trajectory as one such axis

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
MOST_STATIONS = 48  # nodes along a trajectory
DENSE = 513  # samples of a trajectory that may be nodes
MOST_GIVEN = 128  # nodes on an axis where solves are given: with more, round-off grows
SKEW = 0.03  # by which the best nodes are shifted in the middle
CHECKS = 15  # generic places on an axis where an interpolant may be checked
STILL = 1e-9  # rad or m: what moves less stands still, what is off by less lies on the path


@dataclass(frozen=True, eq=False)
class Axis:
    """Nodes, and what each and each check adds to the centre of x, (n_points, n_x)."""

    points: Nodes
    steps: Floats

    @property
    def nodes(self) -> Floats:
        """v of the nodes, in their order."""
        return self.points.v


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
    def strays(self) -> float:
        """By how much of its reach the path itself is missed by its interpolant at all nodes.

        What depends on the path is no better known, whatever few frequencies show.
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
    return Nodes(places[nearest] if len(nearest) == count else places, count)


def _others(places: Floats, nodes: Floats) -> tuple[float, ...]:
    """Of samples that are no nodes those nearest to generic places."""
    others = np.setdiff1d(places, nodes)
    nearest = np.abs(others[:, None] - generic(CHECKS)).argmin(axis=0) if len(others) else []
    return tuple(others[list(dict.fromkeys(nearest))].tolist())


def _best(count: int) -> Floats:
    """The best places, a little askew: at symmetric ones an even f shows only half of itself."""
    v = roots(count)
    return np.asarray(v + SKEW * (1.0 - v * v))


@lru_cache(maxsize=64)
def interval_nodes(most: int) -> Nodes:
    """Nested nodes of [−1, 1], and where they are checked."""
    return Nodes(interval(), most, checks=tuple(generic(CHECKS).tolist()))


@lru_cache(maxsize=64)
def chosen_nodes(count: int) -> Nodes:
    """The best ``count`` nodes of [−1, 1], nearly; `MOST_GIVEN` of them at most."""
    count = min(count, MOST_GIVEN)
    return Nodes(_best(count), count)


def _placed(reach: Floats, S: Floats) -> tuple[Floats, Floats, bool]:
    """v (n_t,) in [−1, 1], dv/dq, and whether the path s − s_0 (n_t, n_s) is straight."""
    far = reach[np.argmax(np.square(reach).sum(axis=1))]
    along = reach @ far / (far @ far)
    straight = bool(np.abs(reach - np.outer(along, far)).max() <= STILL)
    if not straight:
        steps = np.linalg.norm(np.diff(reach, axis=0), axis=1)
        along = np.concatenate([[0.0], np.cumsum(steps)])
    low, width = along.min(), np.ptp(along)
    row = 2.0 / width * (far / (far @ far)) @ S if straight else np.zeros(S.shape[1])
    return 2.0 * (along - low) / width - 1.0, row, straight


# --- Where a fit holds: a trajectory or a box of q, times a box of y, as few axes v ∈ [−1, 1]

MOST_NODES = 20  # on an axis of a box
MOST_AXES = 10
INSIDE = 1e-9  # by how much |v| may exceed 1
OFF = 10.0 * STILL  # what is farther lies off the path


@dataclass(frozen=True)
class Box:
    """Lower and upper bounds of q or of y, SI; equal ones for what is kept."""

    lower: tuple[float, ...]
    upper: tuple[float, ...]

    def __init__(self, lower: ArrayLike, upper: ArrayLike) -> None:
        low, high = (np.atleast_1d(np.asarray(b, dtype=float)) for b in (lower, upper))
        if low.shape != high.shape or low.ndim != 1 or not np.isfinite([low, high]).all():
            raise UsageError("a box has as many finite upper bounds as lower ones")
        if (low > high).any():
            raise UsageError(f"lower bound {int(np.argmax(low > high))} of a box is over its upper")
        object.__setattr__(self, "lower", tuple(low.tolist()))
        object.__setattr__(self, "upper", tuple(high.tolist()))


@dataclass(frozen=True, eq=False)
class Region:
    """v = ``to_v`` x + ``offset`` for x inside; on a curved path v_0 is that of its samples."""

    axes: tuple[Axis, ...]
    centre: Floats  # (n_x,)
    rows: tuple[Floats, ...]  # dv/dx, (n_x,) each
    path: Floats | None  # samples of the trajectory (n_t, n_q)
    line: Line | None  # the first axis, if it is that of a path that moves
    directions: Floats  # (n_w, n_x): the combinations of x on which anything depends
    n_q: int

    @property
    def d(self) -> int:
        """Number of axes."""
        return len(self.axes)

    @property
    def nodes(self) -> list[Nodes]:
        """Of each axis."""
        return [axis.points for axis in self.axes]

    @cached_property
    def to_v(self) -> Floats:
        """dv/dx, (d, n_x)."""
        return np.array(self.rows)

    @cached_property
    def offset(self) -> Floats:
        """v of x = 0, (d,)."""
        offset = -self.to_v @ self.centre
        if self.line is not None:
            offset[0] += self.line.place[0]
        return np.asarray(offset)

    @cached_property
    def joints(self) -> Floats:
        """The joint coordinates that matter, (n_s, n_q)."""
        return joints_of(self.directions, self.n_q)

    def x(self, members: Ints) -> Floats:
        """(q, y) (n, n_x) at the nodes of multi-indices (n, d)."""
        out = self.axes[0].steps.take(members[:, 0], axis=0) + self.centre
        for j, axis in enumerate(self.axes[1:], 1):
            out += axis.steps.take(members[:, j], axis=0)
        return out

    def v(self, q: ArrayLike, y: ArrayLike) -> Floats:
        """(n, d) of samples. Raises UsageError for any outside the region."""
        x = self.samples(q, y)
        v = x @ self.to_v.T + self.offset
        if self.path is not None:
            off = self._project(x[:, : self.n_q], v).max(initial=0.0)
            if not off <= OFF:
                raise UsageError(f"q lies off the path that was fitted, by up to {off:.3g}")
        self._inside(v)
        self._kept(x)
        return np.asarray(v)

    def samples(self, q: ArrayLike, y: ArrayLike) -> Floats:
        """x (n, n_x) of q and y. Raises UsageError for wrong shapes."""
        return samples(q, y, self.n_q, len(self.centre) - self.n_q)

    def on_path(self, x: Floats) -> NDArray[np.bool_]:
        """Which of x (n, n_x) are on the path, and not beyond its ends."""
        v = x @ self.to_v.T + self.offset
        off = self._project(x[:, : self.n_q], v)
        return np.asarray((off <= OFF) & (np.abs(v[:, 0]) <= 1.0 + INSIDE))

    def design(self, y: ArrayLike) -> Floats:
        """v (n_designs, d) of designs y (n_y,) or (n_designs, n_y), on the path's first sample."""
        to_v, offset, still = self._by_design
        rows = _designs(y, to_v.shape[1])
        v = rows @ to_v.T
        v += offset
        self._inside(v)
        if len(still):
            self._kept(np.hstack([np.tile(self._first, (len(rows), 1)), rows]))
        return np.asarray(v)

    @property
    def _first(self) -> Floats:
        return self.centre[: self.n_q] if self.path is None else self.path[0]

    @cached_property
    def _by_design(self) -> tuple[Floats, Floats, Ints]:
        """dv/dy (d, n_y), v at y = 0 on the first sample, and parameters with one value only."""
        offset = self.offset + self.to_v[:, : self.n_q] @ self._first
        return self.to_v[:, self.n_q :], offset, self.still[self.still >= self.n_q]

    def _inside(self, v: Floats) -> None:
        reach = float(np.abs(v).max())
        if not reach <= 1.0 + INSIDE:
            raise UsageError(f"q or y lies outside the region of the fit: {reach:.6g} half-widths")

    def _kept(self, x: Floats) -> None:
        """Refuse another value of what matters and was not varied."""
        if len(self.still):
            off = np.abs(x[:, self.still] - self.centre[self.still])
            if not (off <= STILL * (1.0 + np.abs(self.centre[self.still]))).all():
                raise UsageError("q or y differs from what the fit was made at")

    @cached_property
    def still(self) -> Ints:
        """Entries of x that matter and have one value in the whole region."""
        moved = (self.to_v != 0.0).any(axis=0)
        if self.path is not None:
            moved[: self.n_q] = True
        return np.flatnonzero((self.directions != 0.0).any(axis=0) & ~moved)

    def _project(self, q: Floats, v: Floats) -> Floats:
        """How far each of q lies off the path (n,); along a curved one v_0 becomes its sample's."""
        assert self.path is not None
        s, known = q @ self.joints.T, self.path @ self.joints.T
        if self.line is None or self.line.straight:
            far = known[np.argmax(np.square(known - known[0]).sum(axis=1))] - known[0]
            t = (s - known[0]) @ far / max(float(far @ far), 1e-300)
            return np.asarray(np.abs(s - known[0] - t[:, None] * far).max(axis=1, initial=0.0))
        from scipy.spatial import cKDTree

        distance, nearest = cKDTree(known).query(s)
        v[:, 0] = self.line.place[nearest]
        return np.asarray(distance)


def build_region(
    directions: Floats,
    n_q: int,
    q: Stretch | Box,
    y: ArrayLike | Box,
    count: int | None = None,
    rests: bool = False,
) -> Region:
    """The region of q, a stretch of a trajectory, one pose or a box, and of y, a design or a box.

    ``directions`` (n_w, n_x) are the combinations of x on which anything depends. A single axis has
    the best ``count`` nodes where that is given. Raises UsageError for wrong lengths, and where
    nothing that matters varies, unless the stretch may be one that ``rests`` while others move.
    """
    n_y = directions.shape[1] - n_q
    path = None if isinstance(q, Box) else q.q
    axes: list[Axis] = []
    rows: list[Floats] = []
    if path is not None and not isinstance(y, Box):
        centre = np.concatenate([path[0], _numbers(y, n_y, "y")])
    else:
        both = [_ends(q if isinstance(q, Box) else q.q[0], n_q, "q"), _ends(y, n_y, "y")]
        low, high = np.hstack(both)
        centre = 0.5 * (low + high)
        rows, axes = _box_axes(directions, low, high, n_q, count if path is None else None)
    line = None if isinstance(q, Box) else q.line(None if axes else count)
    if line is not None:
        axes, rows = [line.axis, *axes], [line.row, *rows]
    if not axes and rests and not isinstance(q, Box):
        line = q.rest()
        axes, rows = [line.axis], [line.row]
    if not axes:
        raise UsageError("nothing to fit: no coordinate or parameter that matters has room")
    if len(axes) > MOST_AXES:
        raise UsageError(f"a fit has at most {MOST_AXES} axes, not {len(axes)}: fix some of them")
    return Region(tuple(axes), centre, tuple(rows), path, line, directions, n_q)


def path_samples(q: ArrayLike, n_q: int, n_y: int) -> Floats:
    """Of a trajectory, (n_t, n_q). Raises UsageError for wrong shapes."""
    if isinstance(q, np.ndarray) and q.dtype == np.float64 and q.ndim == 2 and q.shape[1] == n_q:
        return q  # whether it is finite is checked once
    return samples(q, np.zeros(n_y), n_q, n_y)[:, :n_q]


def joints_of(directions: Floats, n_q: int) -> Floats:
    """The joint coordinates that matter, (n_s, n_q)."""
    return np.asarray(directions[(directions[:, :n_q] != 0.0).any(axis=1), :n_q])


def _numbers(value: ArrayLike, n: int, name: str) -> Floats:
    """Numbers (n,); UsageError for others."""
    try:
        numbers = np.asarray(value, dtype=np.float64).reshape(-1)
    except (TypeError, ValueError) as error:
        raise UsageError(f"{name} must be {n} real numbers") from error
    if len(numbers) != n or not np.isfinite(numbers).all():
        raise UsageError(f"{name} has {len(numbers)} values, or not finite ones; expected {n}")
    return numbers


def _designs(y: ArrayLike, n_y: int) -> Floats:
    """(n_designs, n_y); those outside, or not finite, are no place of the region."""
    if isinstance(y, np.ndarray) and y.dtype == np.float64 and y.ndim == 2 and y.shape[1] == n_y:
        return y
    return samples([], y, 0, n_y)


def _ends(value: ArrayLike | Box, n: int, name: str) -> Floats:
    """Lower and upper ends (2, n)."""
    ends = (value.lower, value.upper) if isinstance(value, Box) else (value, value)
    return np.array([_numbers(end, n, name) for end in ends])


def _box_axes(
    directions: Floats, low: Floats, high: Floats, n_q: int, count: int | None
) -> tuple[list[Floats], list[Axis]]:
    """Rows dv/dx and axes of the box: of x, or of fewer combinations of q that matter."""
    half = 0.5 * (high - low)
    free = np.flatnonzero((half > 0.0) & (directions != 0.0).any(axis=0))
    joints = free[free < n_q]
    used = directions[(directions[:, joints] != 0.0).any(axis=1)]
    rows: list[Floats] = []
    steps: list[Floats] = []
    if len(used) < len(joints):
        back = np.zeros((len(half), len(used)))
        back[joints] = np.linalg.pinv(used[:, joints])
        for row, shift in zip(used, back.T, strict=True):
            reach = float(np.abs(row[joints]) @ half[joints])
            rows.append(np.append(row[:n_q], np.zeros(len(half) - n_q)) / reach)
            steps.append(shift * reach)
        free = free[free >= n_q]
    for k in free:
        unit = np.eye(len(half))[k]
        rows.append(unit / half[k])
        steps.append(unit * half[k])
    points = chosen_nodes(count) if count and len(rows) == 1 else interval_nodes(MOST_NODES)
    return rows, [Axis(points, points.points[:, None] * step) for step in steps]


# --- A path as stretches without corners: no polynomial goes round one, nor from path to path

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
