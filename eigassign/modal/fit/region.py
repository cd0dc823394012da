"""Where a fit holds: a trajectory or a box of q, times a box of y, as few axes v ∈ [−1, 1].

A trajectory is one axis. Where it is straight in joint space, v is the joint coordinate along it;
else v is the distance travelled there, and its samples alone can be asked for. Joint coordinates
and design parameters that no frequency depends on are no axes; of joint coordinates that matter
only together their combinations are.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.errors import AccuracyError, UsageError
from eigassign.modal.arguments import samples
from eigassign.modal.fit.interpolation import Nodes, interval_nodes, newton_basis, sample_nodes
from eigassign.modal.fit.path import STILL, along_chord, moving_joints

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
MOST_NODES = 128  # on an axis; with 500 round-off grew to 7e-3
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
class Axis:
    """One variable v of a region: its nodes, and x − centre at each of their points."""

    nodes: Nodes
    steps: Floats  # (n_points, n_x)
    row: Floats  # dv/dx (n_x,); zeros on a curved path


@dataclass(frozen=True, eq=False)
class Region:
    """v = v_c + dv/dx (x − x_c) for x inside; on a curved path v_0 is that of its samples."""

    axes: tuple[Axis, ...]
    centre: Floats  # x_c (n_x,); on a trajectory its first sample
    path: Floats | None  # samples of the trajectory (n_t, n_q)
    place: Floats | None  # v_0 of the samples (n_t,), if they move
    directions: Floats  # (n_w, n_x): the combinations of x on which anything depends
    n_q: int

    @property
    def d(self) -> int:
        """Number of axes."""
        return len(self.axes)

    @property
    def nodes(self) -> list[Nodes]:
        """Nodes of each axis."""
        return [axis.nodes for axis in self.axes]

    @property
    def straight(self) -> bool:
        """True unless v_0 is that of the samples of a curved path."""
        return self.place is None or bool(self.axes[0].row.any()) or not np.ptp(self.place)

    @property
    def rests(self) -> bool:
        """True where nothing that matters varies, as on a stretch that rests while others move."""
        return self.d == 1 and len(self.nodes[0].points) == 1

    @property
    def length(self) -> float:
        """The length of the path in the joint coordinates that matter, in rad and m."""
        assert self.path is not None
        s = self.path @ moving_joints(self.directions, self.n_q).T
        return float(np.linalg.norm(np.diff(s, axis=0), axis=1).sum())

    @cached_property
    def _to_v(self) -> Floats:
        """dv/dx (d, n_x)."""
        return np.array([axis.row for axis in self.axes])

    def samples(self, q: ArrayLike, y: ArrayLike) -> Floats:
        """x (n, n_x) of q and y. Raises UsageError for wrong shapes."""
        return samples(q, y, self.n_q, len(self.centre) - self.n_q)

    def x(self, points: Ints) -> Floats:
        """(q, y) (n, n_x) at points (n, d) of the axes."""
        steps = (axis.steps[column] for axis, column in zip(self.axes, points.T, strict=True))
        return np.asarray(self.centre + sum(steps))

    def v(self, x: Floats) -> Floats:
        """(n, d) of samples x (n, n_x). Raises UsageError for any outside the region."""
        v, off = self._placed(x)
        if not off.max(initial=0.0) <= OFF_PATH:
            raise UsageError(f"q lies off the path that was fitted, by up to {off.max():.3g}")
        reach = float(np.abs(v).max(initial=0.0))
        if not reach <= 1.0 + OUTSIDE:
            raise UsageError(f"q or y lies outside the region of the fit: {reach:.6g} half-widths")
        still = self._still
        off = np.abs(x[:, still] - self.centre[still])
        if not (off <= STILL * (1.0 + np.abs(self.centre[still]))).all():
            raise UsageError("q or y differs from what the fit was made at")
        return v

    def on_path(self, x: Floats) -> NDArray[np.bool_]:
        """True for those of x (n, n_x) that lie on the path between its ends."""
        v, off = self._placed(x)
        return np.asarray((off <= OFF_PATH) & (np.abs(v[:, 0]) <= 1.0 + OUTSIDE))

    def _placed(self, x: Floats) -> tuple[Floats, Floats]:
        """v (n, d) of x, wherever that is, and how far each q lies off the path (n,)."""
        v = (x - self.centre) @ self._to_v.T
        if self.path is None:
            return v, np.zeros(len(x))
        if self.place is not None:
            v[:, 0] += self.place[0]
        joints = moving_joints(self.directions, self.n_q)
        s, known = x[:, : self.n_q] @ joints.T, self.path @ joints.T
        if self.straight:
            _, far, _ = along_chord(known - known[0])
            parts = (s - known[0]) @ far / max(float(far @ far), 1e-300)
            return v, np.abs(s - known[0] - np.outer(parts, far)).max(axis=1, initial=0.0)
        from scipy.spatial import cKDTree

        off, nearest = cKDTree(known).query(s)
        assert self.place is not None
        v[:, 0] = self.place[nearest]
        return v, np.asarray(off)

    @cached_property
    def _still(self) -> Ints:
        """Entries of x that matter and have one value in the whole region."""
        moved = (self._to_v != 0.0).any(axis=0)
        if self.path is not None:
            moved[: self.n_q] = True
        return np.flatnonzero((self.directions != 0.0).any(axis=0) & ~moved)

    def require_followed(self, count: int) -> None:
        """Raise AccuracyError where ``count`` nodes of a curved path do not even show the path.

        The error of frequencies along it is not smaller than that of its own interpolant, whatever
        few of them show.
        """
        if self.straight or self.d > 1:
            return
        assert self.path is not None
        assert self.place is not None
        nodes = self.nodes[0].v[:count]
        reach = (self.path - self.path[0]) @ moving_joints(self.directions, self.n_q).T
        at = [int(np.flatnonzero(self.place == v)[0]) for v in nodes]
        c = np.linalg.solve(newton_basis(nodes, nodes).T, reach[at])
        missed = np.abs(newton_basis(nodes, self.place).T @ c - reach).max() / np.abs(reach).max()
        if missed > MOST_MISSED:
            raise AccuracyError(
                f"{len(nodes)} solves do not follow the path: between them it is missed by "
                f"{missed:.0%} of its reach; give more"
            )


def build_region(directions: Floats, n_q: int, q: Floats | Box, y: ArrayLike | Box) -> Region:
    """The region of q, a stretch of a trajectory or a box, and of y, a design or a box.

    ``directions`` (n_w, n_x) are the combinations of x on which anything depends. Where none of
    them varies its one axis has a single node. Raises UsageError for wrong lengths.
    """
    path = None if isinstance(q, Box) else q
    ends = [
        _ends(q if path is None else path[0], n_q, "q"),
        _ends(y, directions.shape[1] - n_q, "y"),
    ]
    low, high = np.hstack(ends)
    axes, place = _box_axes(directions, low, high, n_q), None
    line = None if path is None else _travelled(path, moving_joints(directions, n_q))
    if line is not None and path is not None:
        place, row = line
        axes.insert(0, _line_axis(path, place, row, len(low)))
    elif not axes:
        zero, place = np.zeros((1, len(low))), np.zeros(1 if path is None else len(path))
        axes = [Axis(sample_nodes(np.zeros(1), 1), zero, zero[0])]
    return Region(tuple(axes), 0.5 * (low + high), path, place, directions, n_q)


def _ends(value: ArrayLike | Box, n: int, name: str) -> Floats:
    """Lower and upper ends (2, n)."""
    ends = (value.lower, value.upper) if isinstance(value, Box) else (value, value)
    try:
        numbers = np.array([np.asarray(end, dtype=np.float64).reshape(-1) for end in ends])
    except (TypeError, ValueError) as error:
        raise UsageError(f"{name} must be {n} real numbers") from error
    if numbers.shape[1] != n or not np.isfinite(numbers).all():
        raise UsageError(f"{name} has {numbers.shape[1]} values, or not finite ones; expected {n}")
    return numbers


def _box_axes(directions: Floats, low: Floats, high: Floats, n_q: int) -> list[Axis]:
    """One axis for each variable of x that matters and has room.

    Where joint coordinates matter in fewer combinations, these are the axes in their place.
    """
    half, nodes = 0.5 * (high - low), interval_nodes(MOST_NODES)
    is_free = (half > 0.0) & (directions != 0.0).any(axis=0)
    units, joints = np.eye(len(half)), is_free & (np.arange(len(half)) < n_q)
    together = np.where(joints, directions, 0.0)
    together = together[together.any(axis=1)]
    groups = [units[is_free]]
    if len(together) < joints.sum():
        groups = [together, units[is_free & ~joints]]
    axes = []
    for rows in groups:
        for row, step in zip(rows, np.linalg.pinv(rows).T, strict=True):
            reach = float(np.abs(row) @ half)
            axes.append(Axis(nodes, np.outer(nodes.points, step * reach), row / reach))
    return axes


def _travelled(q: Floats, joints: Floats) -> tuple[Floats, Floats] | None:
    """v_0 (n_t,) of samples in [−1, 1] and dv_0/dq, zero on a curved path; None if they rest."""
    reach = (q - q[0]) @ joints.T
    if np.abs(reach).max(initial=0.0) <= STILL:
        return None
    along, far, straight = along_chord(reach)
    if not straight:
        steps = np.linalg.norm(np.diff(reach, axis=0), axis=1)
        along = np.concatenate([[0.0], np.cumsum(steps)])
    low, width = along.min(), np.ptp(along)
    row = 2.0 / width * (far / (far @ far)) @ joints if straight else np.zeros(q.shape[1])
    return 2.0 * (along - low) / width - 1.0, row


def _line_axis(q: Floats, place: Floats, row: Floats, n_x: int) -> Axis:
    """The axis of a path: of a straight one the whole interval, of another some of its samples."""
    if row.any():
        nodes = interval_nodes(MOST_NODES)
        far = int(np.abs(place - place[0]).argmax())
        back = (q[far] - q[0]) / (place[far] - place[0])
        steps = np.outer(nodes.points - place[0], back)
    else:
        distinct, first = np.unique(place, return_index=True)
        nodes = sample_nodes(distinct, MOST_NODES)
        steps = q[first[np.searchsorted(distinct, nodes.points)]] - q[0]
    missing = n_x - q.shape[1]
    return Axis(nodes, np.pad(steps, ((0, 0), (0, missing))), np.pad(row, (0, missing)))
