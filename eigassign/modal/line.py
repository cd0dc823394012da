"""Nodes on an axis v ∈ [−1, 1], and a trajectory as one such axis.

Where a trajectory is straight in joint space, v is the joint coordinate along it; else v is the
distance travelled there, and its samples alone are candidates for nodes and can be asked for.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from eigassign.series.newton import Nodes, basis, generic, interval, roots

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
