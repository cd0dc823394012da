"""Where a fit holds: a trajectory or a box of q, times a box of y, as few axes v ∈ [−1, 1].

A trajectory is one axis. Where it is straight in joint space, v is the joint coordinate along it;
else v is the distance travelled there, and its samples alone are candidates for nodes and can be
asked for. Joint coordinates and design parameters that no frequency depends on are no axes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.errors import UsageError
from eigassign.modal.samples import samples
from eigassign.series.newton import basis, interval, leja

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
MOST_STATIONS = 48  # nodes along a trajectory
MOST_NODES = 20  # on an axis of a box
MOST_AXES = 10
DENSE = 513  # samples of a trajectory that may be nodes
STILL = 1e-9  # rad or m: what moves less stands still, what is off by less lies on the path
INSIDE = 1e-9  # by how much |v| may exceed 1


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
class Nodes:
    """At most ``most`` Leja points among candidates v (K,), with Newton's basis.

    They are ``whole`` if they are all that will be asked for.
    """

    places: Floats
    most: int
    whole: bool = False

    @cached_property
    def chosen(self) -> Ints:
        """Which candidates, in the order of the points."""
        return leja(self.places, self.most)

    @cached_property
    def v(self) -> Floats:
        """The points."""
        return np.asarray(self.places[self.chosen])

    @cached_property
    def table(self) -> Floats:
        """Newton's basis at the points."""
        return basis(self.v, self.v)


@dataclass(frozen=True, eq=False)
class Axis:
    """Nodes, and what each adds to the centre of x, (most, n_x)."""

    points: Nodes
    steps: Floats

    @property
    def nodes(self) -> Floats:
        """v of the nodes, in their order."""
        return self.points.v

    @property
    def table(self) -> Floats:
        """Newton's basis at the nodes."""
        return self.points.table


@dataclass(frozen=True, eq=False)
class Line:
    """A trajectory as one axis: v_0 of its samples; a straight one is linear in x."""

    axis: Axis
    q: Floats  # the samples (n_t, n_q)
    place: Floats  # (n_t,) in [−1, 1]
    row: Floats  # dv_0/dx (n_x,)
    straight: bool

    @cached_property
    def table(self) -> Floats:
        """Newton's basis at the samples, (n_t, most)."""
        return basis(self.axis.nodes, self.place)


@dataclass(frozen=True, eq=False)
class Region:
    """v = ``to_v`` x + ``offset`` for x inside; on a curved path v_0 is that of its samples."""

    axes: tuple[Axis, ...]
    centre: Floats  # (n_x,)
    to_v: Floats  # (d, n_x)
    offset: Floats  # (d,)
    path: Floats | None  # samples of the trajectory (n_t, n_q)
    line: Line | None  # the first axis, if it is that of a path that moves
    joints: Floats  # (n_s, n_q): the joint coordinates that matter
    matters: NDArray[np.bool_]  # (n_x,): whether anything depends on it
    n_q: int

    @property
    def d(self) -> int:
        """Number of axes."""
        return len(self.axes)

    def x(self, members: Ints) -> Floats:
        """(q, y) (n, n_x) at the nodes of multi-indices (n, d)."""
        out = self.axes[0].steps[members[:, 0]] + self.centre
        for j, axis in enumerate(self.axes[1:], 1):
            out += axis.steps[members[:, j]]
        return out

    def v(self, q: ArrayLike, y: ArrayLike) -> Floats:
        """(n, d) of samples. Raises UsageError for any outside the region."""
        x = samples(q, y, self.n_q, len(self.centre) - self.n_q)
        v = x @ self.to_v.T + self.offset
        if self.path is not None:
            self._project(x[:, : self.n_q], v)
        self._inside(v)
        self._kept(x)
        return np.asarray(v)

    def design(self, y: ArrayLike) -> Floats:
        """v (n_designs, d) of designs y (n_y,) or (n_designs, n_y), on the path's first sample."""
        first = self.centre[: self.n_q] if self.path is None else self.path[0]
        return self.v(first, y)

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
        return np.flatnonzero(self.matters & ~moved)

    def _project(self, q: Floats, v: Floats) -> None:
        """Refuse what lies off the path; along a curved one find the samples."""
        assert self.path is not None
        s, known = q @ self.joints.T, self.path @ self.joints.T
        if self.line is None or self.line.straight:
            far = known[np.argmax(np.square(known - known[0]).sum(axis=1))] - known[0]
            t = (s - known[0]) @ far / max(float(far @ far), 1e-300)
            off = float(np.abs(s - known[0] - t[:, None] * far).max(initial=0.0))
        else:
            from scipy.spatial import cKDTree

            distance, nearest = cKDTree(known).query(s)
            v[:, 0] = self.line.place[nearest]
            off = float(np.max(distance))
        if not off <= 10.0 * STILL:
            raise UsageError(f"q lies off the path that was fitted, by up to {off:.3g}")


def build_region(directions: Floats, n_q: int, q: ArrayLike | Box, y: ArrayLike | Box) -> Region:
    """The region of q, samples (n_t, n_q) of a trajectory, one pose or a box, and y likewise.

    ``directions`` (n_w, n_x) are the combinations of x on which anything depends. Raises UsageError
    for wrong lengths, and where nothing that matters varies.
    """
    n_y = directions.shape[1] - n_q
    path = None if isinstance(q, Box) else samples(q, np.zeros(n_y), n_q, n_y)[:, :n_q]
    low, high = np.hstack([_ends(q if path is None else path[0], n_q, "q"), _ends(y, n_y, "y")])
    centre = 0.5 * (low + high)
    rows, axes = _box_axes(directions, low, high, n_q)
    joints = directions[(directions[:, :n_q] != 0.0).any(axis=1), :n_q]
    line = None if path is None else _line(joints.tobytes(), len(joints), path.tobytes(), n_q, n_y)
    if line is not None:
        axes, rows = [line.axis, *axes], [line.row, *rows]
    if not axes:
        raise UsageError("nothing to fit: no coordinate or parameter that matters has room")
    if len(axes) > MOST_AXES:
        raise UsageError(f"a fit has at most {MOST_AXES} axes, not {len(axes)}: fix some of them")
    to_v = np.array(rows)
    offset = -to_v @ centre
    if line is not None:
        offset[0] += line.place[0]
    matters = (directions != 0.0).any(axis=0)
    return Region(tuple(axes), centre, to_v, offset, path, line, joints, matters, n_q)


def _ends(value: ArrayLike | Box, n: int, name: str) -> Floats:
    """Lower and upper ends (2, n)."""
    ends = (value.lower, value.upper) if isinstance(value, Box) else (value, value)
    both = np.array(ends, dtype=float).reshape(2, -1)
    if both.shape[1] != n or not np.isfinite(both).all():
        raise UsageError(f"{name} has {both.shape[1]} values, or not finite ones; expected {n}")
    return both


def _box_axes(
    directions: Floats, low: Floats, high: Floats, n_q: int
) -> tuple[list[Floats], list[Axis]]:
    """Rows dv/dx and axes of the box: of x, or of fewer combinations of q that matter."""
    half = 0.5 * (high - low)
    rows: list[Floats] = []
    axes: list[Axis] = []
    if not half.any():
        return rows, axes
    free = np.flatnonzero((half > 0.0) & (directions != 0.0).any(axis=0))
    joints = free[free < n_q]
    used = directions[(directions[:, joints] != 0.0).any(axis=1)]
    if len(used) < len(joints):
        back = np.zeros((len(half), len(used)))
        back[joints] = np.linalg.pinv(used[:, joints])
        for row, shift in zip(used, back.T, strict=True):
            reach = float(np.abs(row[joints]) @ half[joints])
            rows.append(np.append(row[:n_q], np.zeros(len(half) - n_q)) / reach)
            axes.append(_interval_axis(shift * reach))
        free = free[free >= n_q]
    for k in free:
        unit = np.eye(len(half))[k]
        rows.append(unit / half[k])
        axes.append(_interval_axis(unit * half[k]))
    return rows, axes


def _interval_axis(shift: Floats) -> Axis:
    points = _interval_nodes()
    return Axis(points, points.v[:, None] * shift)


@lru_cache(maxsize=1)
def _interval_nodes() -> Nodes:
    return Nodes(interval(), MOST_NODES)


@lru_cache(maxsize=1)
def _line_nodes() -> Nodes:
    return Nodes(interval(), MOST_STATIONS)


@lru_cache(maxsize=16)
def _line(joints: bytes, n_s: int, path: bytes, n_q: int, n_y: int) -> Line | None:
    """The axis of a trajectory, made once for all designs; None where it stands still."""
    if not n_q:
        return None
    q = np.frombuffer(path).reshape(-1, n_q)
    S = np.frombuffer(joints).reshape(n_s, n_q)
    reach = (q - q[0]) @ S.T
    if not reach.size or np.abs(reach).max() <= STILL:
        return None
    place, row, straight = _placed(reach, S)
    if straight:
        points = _line_nodes()
        far = int(np.abs(place - place[0]).argmax())
        back = np.linalg.pinv(S) @ (reach[far] / (place[far] - place[0]))
        steps = np.outer(points.v - place[0], np.append(back, np.zeros(n_y)))
        return Line(Axis(points, steps), q, place, np.append(row, np.zeros(n_y)), True)
    keep = np.unique(place, return_index=True)[1]
    some = np.unique(np.linspace(0, len(keep) - 1, min(len(keep), DENSE)).round().astype(int))
    points = Nodes(place[keep[some]], MOST_STATIONS, len(keep) <= MOST_STATIONS)
    steps = np.zeros((len(points.chosen), n_q + n_y))
    steps[:, :n_q] = q[keep[some][points.chosen]] - q[0]
    return Line(Axis(points, steps), q, place, np.append(row, np.zeros(n_y)), False)


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
