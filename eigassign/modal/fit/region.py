"""Where a fit holds: a trajectory or a box of q, times a box of y, as few axes v ∈ [−1, 1].

A trajectory is one axis. Joint coordinates and design parameters that no frequency depends on are
no axes; of joint coordinates that matter only together their combinations are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.errors import AccuracyError, UsageError
from eigassign.interpolation.newton import Nodes
from eigassign.modal.arguments import samples
from eigassign.modal.fit.path import (
    STILL,
    Axis,
    Line,
    Stretch,
    chosen_nodes,
    interval_nodes,
    joints_of,
)

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
MOST_NODES = 20  # on an axis of a box
MOST_AXES = 10
OUTSIDE = 1e-9  # by how much |v| may exceed 1
OFF_PATH = 10.0 * STILL  # what is farther lies off the path
MOST_MISSED = 0.03  # of its reach by which a path may be missed by its interpolant


@dataclass(frozen=True)
class Box:
    """Lower and upper bounds of q (rad or m) or of y (SI), for `fit`; equal ones for what is kept.

    ``Box([0, 0], [0.25, 0.25])``: as many numbers in both as q or y has. Raises UsageError for
    bounds of different lengths, not finite, or in the wrong order.
    """

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
            if not off <= OFF_PATH:
                raise UsageError(f"q lies off the path that was fitted, by up to {off:.3g}")
        self._inside(v)
        self._kept(x)
        return np.asarray(v)

    def samples(self, q: ArrayLike, y: ArrayLike) -> Floats:
        """x (n, n_x) of q and y. Raises UsageError for wrong shapes."""
        return samples(q, y, self.n_q, len(self.centre) - self.n_q)

    def on_path(self, x: Floats) -> NDArray[np.bool_]:
        """Which of x (n, n_x) lie on the path between its ends."""
        v = x @ self.to_v.T + self.offset
        off = self._project(x[:, : self.n_q], v)
        return np.asarray((off <= OFF_PATH) & (np.abs(v[:, 0]) <= 1.0 + OUTSIDE))

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
        if not reach <= 1.0 + OUTSIDE:
            raise UsageError(f"q or y lies outside the region of the fit: {reach:.6g} half-widths")

    def _kept(self, x: Floats) -> None:
        """Raise UsageError for another value of what matters and was not varied."""
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


def _ends(value: ArrayLike | Box, n: int, name: str) -> Floats:
    """Lower and upper ends (2, n)."""
    ends = (value.lower, value.upper) if isinstance(value, Box) else (value, value)
    return np.array([_numbers(end, n, name) for end in ends])


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


def require_path_followed(regions: Sequence[Region]) -> None:
    """Raise AccuracyError where nodes that were given do not even show the path."""
    for region in regions:
        if region.d == 1 and region.line is not None and region.line.missed > MOST_MISSED:
            raise AccuracyError(
                f"{len(region.axes[0].nodes)} solves do not follow the path: between them it is "
                f"missed by {region.line.missed:.0%} of its reach; give more"
            )
