"""The question put to every method: frequencies along the trajectory, over the box of designs.

The points are of two kinds: random samples of trajectory × design box, and the trajectory at
several designs. Surrogates and grids are functions of a few *features* u in [0, 1]: the place along
the trajectory, and each design parameter that may change. The place is the joint coordinate itself
where only one matters to any frequency, else the distance travelled in joint coordinates. Either is
the best choice for them: they need not learn poses that the trajectory never takes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from eigassign.errors import CaseError
from eigassign.study.planning import joint_map
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
SEED = 20211204
STILL = 1e-9  # rad or m: a coordinate that travels less stands still


@dataclass(frozen=True, eq=False)
class Features:
    """From features u (n, d) in [0, 1] to x = (q, y); ``place`` (n_t,) is u_0 of the samples."""

    names: tuple[str, ...]
    place: Floats | None  # None: no pose that matters changes
    q: Floats  # (n_t, n_q) of the trajectory
    pose: Callable[[Floats], Floats]  # u_0 (n,) → q (n, n_q)
    lower: Floats  # (n_y,)
    upper: Floats
    fixed_y: Floats  # (n_y,): parameters whose bounds coincide are kept here

    @property
    def d(self) -> int:
        """How many features there are."""
        return len(self.names)

    @cached_property
    def free(self) -> Ints:
        """The design parameters that may change."""
        return np.flatnonzero(self.upper > self.lower)

    def x(self, u: Floats) -> Floats:
        """(n, n_x) at features u (n, d)."""
        if self.place is None:
            return np.hstack([np.tile(self.q[0], (len(u), 1)), self.design(u)])
        return np.hstack([self.pose(u[:, 0]), self.design(u[:, 1:])])

    def design(self, unit: Floats) -> Floats:
        """y (n, n_y) at ``unit`` (n, n_free), 0 at the lower and 1 at the upper bounds."""
        lower, upper = self.lower[self.free], self.upper[self.free]
        y = np.tile(self.fixed_y, (len(unit), 1))
        y[:, self.free] = (1.0 - unit) * lower + unit * upper
        return y

    def at_samples(self, samples: Ints, y: Floats) -> tuple[Floats, Floats]:
        """x and u at samples of the trajectory (n,) and designs (n, n_y)."""
        lower, upper = self.lower[self.free], self.upper[self.free]
        u = (y[:, self.free] - lower) / (upper - lower)
        if self.place is not None:
            u = np.hstack([self.place[samples, None], u])
        return np.hstack([self.q[samples], y]), u


def build_features(scene: Scene) -> Features:
    """Raises CaseError where nothing varies that a frequency could depend on."""
    lower, upper = scene.bounds
    place, pose = _place(scene)
    names = [scene.model.y_names[k] for k in np.flatnonzero(upper > lower)]
    if place is not None:
        names.insert(0, "place along the trajectory")
    if not names:
        raise CaseError((scene.file.problem("trajectory", _nothing_varies(scene)),))
    fixed_y = np.clip(scene.initial, lower, upper)
    return Features(tuple(names), place, scene.path.q, pose, lower, upper, fixed_y)


def _nothing_varies(scene: Scene) -> str:
    """Why there is nothing to chart, and what to do."""
    pencil, driven = scene.model.pencil, list(scene.file.coordinates.values())
    which = np.flatnonzero(pencil.active[: pencil.n_q])
    which = which[which < len(driven)]
    joints = ", ".join(dict.fromkeys(driven[k].joint for k in which))  # in the order of q
    fixed, room = "no design parameter may change", "a design parameter a `max` above its `min`"
    if not joints:
        return f"nothing to chart: no coordinate changes a frequency, and {fixed}; give {room}"
    why = f"along the trajectory nothing moves that a frequency depends on (joints: {joints})"
    return f"nothing to chart: {why}, and {fixed}; let it move, or give {room}"


def _place(scene: Scene) -> tuple[Floats | None, Callable[[Floats], Floats]]:
    """The place (n_t,) of every sample, and the pose at any place."""
    S, q = joint_map(scene.model), scene.path.q
    s = q @ S.T
    if not len(S) or np.ptp(s, axis=0).max() <= STILL:
        return None, lambda u: np.tile(q[0], (len(u), 1))
    if len(S) > 1:
        return _distance(s, q, scene.path.rows)
    low, reach, back = s.min(), np.ptp(s), np.linalg.pinv(S)[:, 0]
    return (s[:, 0] - low) / reach, lambda u: q[0] + np.outer(low + u * reach - s[0, 0], back)


def _distance(
    s: Floats, q: Floats, parts: Sequence[slice]
) -> tuple[Floats, Callable[[Floats], Floats]]:
    """Distance travelled, as a fraction; poses between samples by a cubic spline over it.

    Each trajectory has a spline of its own; on the way from one to the next the pose is linear.
    """
    travelled = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(s, axis=0), axis=1))])
    place = travelled / travelled[-1]
    apart = np.concatenate([[True], np.diff(place) > 1e-9])
    apart[[rows.start for rows in parts]] = True
    kept = [np.flatnonzero(apart[rows]) + rows.start for rows in parts]
    splines = [CubicSpline(place[own], q[own]) for own in kept if len(own) > 1]

    def pose(u: Floats) -> Floats:
        out = np.column_stack([np.interp(u, place, column) for column in q.T])
        for spline in splines:
            inside = (u >= spline.x[0]) & (u <= spline.x[-1])
            out[inside] = spline(u[inside])
        return out

    return place, pose


@dataclass(frozen=True, eq=False)
class EvaluationPoints:
    """x (n, n_x) and u (n, d): first random ones, then ``designs`` runs along the trajectory."""

    x: Floats
    u: Floats
    n_random: int
    designs: int
    n_q: int
    along: Ints  # samples of the trajectory in every run

    @property
    def q(self) -> Floats:
        """(n, n_q)."""
        return self.x[:, : self.n_q]

    @property
    def y(self) -> Floats:
        """(n, n_y)."""
        return self.x[:, self.n_q :]

    @property
    def run_designs(self) -> Floats:
        """The design of every run along the trajectory, (designs, n_y)."""
        return self.y[self.n_random :: len(self.along)]

    def head(self, count: int) -> EvaluationPoints:
        """The first points only, for methods that are too slow for all."""
        if count >= len(self.x):
            return self
        n_random = min(self.n_random, count)
        return replace(self, x=self.x[:count], u=self.u[:count], n_random=n_random, designs=0)

    def repeated(self, copies: int) -> EvaluationPoints:
        """The same runs several times over, to time large batches."""
        x, u = np.tile(self.x, (copies, 1)), np.tile(self.u, (copies, 1))
        return replace(self, x=x, u=u, designs=copies * self.designs)

    def runs(self, most: int | None = None) -> EvaluationPoints:
        """The runs along the trajectory only, ``most`` of them if given."""
        designs = self.designs if most is None else min(most, self.designs)
        rows = slice(self.n_random, self.n_random + designs * len(self.along))
        return replace(self, x=self.x[rows], u=self.u[rows], n_random=0, designs=designs)

    def whole_runs(self, features: Features) -> EvaluationPoints:
        """The same designs at every sample of the trajectory."""
        along = np.arange(len(features.q))
        y = np.repeat(self.run_designs, len(along), axis=0)
        x, u = features.at_samples(np.tile(along, self.designs), y)
        return replace(self, x=x, u=u, n_random=0, along=along)


def build_points(
    scene: Scene, features: Features, n_random: int, designs: int, per_design: int, seed: int = SEED
) -> EvaluationPoints:
    """Seeded points, every third of the random ones at a corner of the box of designs.

    The runs are of the initial design, of the expansion's, then of corners and random ones in turn,
    each design once: of one design only where no parameter may change.
    """
    random = np.random.default_rng(seed)
    n_t, n_y = len(scene.path.q), len(features.lower)
    samples = random.integers(0, n_t, n_random)
    y = _in_box(features, random.random((n_random, n_y)), slice(2, None, 3), random)
    first = np.vstack([scene.initial, scene.expansions.full.y0])
    unit = random.random((2 * designs, n_y))
    others = _in_box(features, unit, slice(0, None, 2), random)
    runs = np.vstack([np.clip(first, features.lower, features.upper), others])
    once = np.sort(np.unique(runs, axis=0, return_index=True)[1])
    runs = runs[once[:designs]]
    along = np.unique(np.linspace(0, n_t - 1, min(per_design, n_t)).round().astype(np.intp))
    samples = np.concatenate([samples, np.tile(along, len(runs))])
    x, u = features.at_samples(samples, np.vstack([y, np.repeat(runs, len(along), axis=0)]))
    return EvaluationPoints(x, u, n_random, len(runs), len(scene.model.q_names), along)


def _in_box(features: Features, unit: Floats, at: slice, random: np.random.Generator) -> Floats:
    """Designs at ``unit`` (n, n_y) in [0, 1], but corners of the box in the rows ``at``."""
    inside = unit[:, features.free]
    inside[at] = box_corners(len(inside[at]), len(features.free), random)
    return features.design(inside)


def box_corners(count: int, d: int, random: np.random.Generator) -> Floats:
    """(count, d) of 0 and 1: all corners in turn where they are few enough, else random ones.

    Every second is opposite to the one before: the errors are largest at such ends.
    """
    half = -(-count // 2)
    if d > 0 and 2**d <= count:
        number = np.resize(random.permutation(2 ** (d - 1)), half)
        ends = (number[:, None] >> np.arange(d)) & 1
    else:
        ends = random.integers(0, 2, (half, d))
    both = np.stack([ends, 1 - ends], axis=1).reshape(2 * half, d)
    return both[:count].astype(np.float64)
