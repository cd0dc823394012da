"""The question put to every method: frequencies along the trajectory, over the box of designs.

The points are random samples of trajectory × design box, and the trajectory at several designs.
Surrogates and grids are functions of a few *features* u in [0, 1]: the place along the trajectory,
and each design parameter that may change. The place is the joint coordinate itself where only one
matters to any frequency, else the distance travelled in joint coordinates. Either is the best
choice for them: they need not learn poses that the trajectory never takes.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from eigassign.chart.results import Asked
from eigassign.chart.timing import Effort, timed
from eigassign.errors import CaseError
from eigassign.modal.exact.roundoff import rounding_error
from eigassign.study.planning import SEED, at_corners, at_random, corners, joint_map
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Points:
    """Poses q (n, n_q), designs y (n, n_y) and features u (n, d)."""

    q: Floats
    y: Floats
    u: Floats

    def __len__(self) -> int:
        return len(self.q)

    def __getitem__(self, rows: slice | Ints) -> Points:
        return Points(self.q[rows], self.y[rows], self.u[rows])


@dataclass(frozen=True, eq=False)
class Bench:
    """A case on which methods are tried: the features of its samples, and its exact solves."""

    scene: Scene
    effort: Effort
    names: tuple[str, ...]  # of the features
    place: Floats | None  # u_0 (n_t,) of the samples; None: no pose that matters changes
    lower: Floats  # (n_y,); the same as upper where a parameter is kept
    upper: Floats

    def points(self, samples: Ints, y: Floats) -> Points:
        """Samples of the trajectory (n,) at designs (n, n_y)."""
        free = self.upper > self.lower
        u = ((y - self.lower) / np.where(free, self.upper - self.lower, 1.0))[:, free]
        u = u if self.place is None else np.column_stack([self.place[samples], u])
        return Points(self.scene.path.q[samples], y, u)

    def nearest(self, u: Floats) -> Points:
        """The points at features (n, d), each at the nearest sample of the trajectory, once."""
        samples, unit = np.zeros(len(u), dtype=np.intp), u
        if self.place is not None:
            order = np.argsort(self.place, kind="stable")
            known, unit = self.place[order], u[:, 1:]
            samples = order[np.searchsorted(0.5 * (known[1:] + known[:-1]), u[:, 0])]
        free, y = self.upper > self.lower, np.tile(self.lower, (len(u), 1))
        y[:, free] = (1.0 - unit) * self.lower[free] + unit * self.upper[free]
        found = self.points(samples, y)
        return found[np.unique(found.u, axis=0, return_index=True)[1]]

    def exact(self, points: Points) -> Floats:
        """The charted modes by eigassign's own exact solve, (n, n_modes) in Hz."""
        modes = self.scene.expansions.modes
        hz = self.scene.model.frequencies(points.q, points.y, max(modes))
        return np.asarray(hz[:, np.array(modes) - 1])

    @cached_property
    def solve_s(self) -> float:
        """Seconds of one exact solve, roughly: to decide how many can be afforded."""
        count = 1 if self.scene.model.n_dof > 1000 else min(16, len(self.scene.path.q))
        some = self.points(np.arange(count), np.tile(self.lower, (count, 1)))
        self.exact(some[:1])
        return max(timed(lambda: self.exact(some))[1] / count, 1e-6)

    @property
    def most_solves(self) -> int:
        """The most exact solves of one training: a table of 20 000 numbers stays in the cache."""
        return max(4, min(20_000, int(self.effort.most_s / self.solve_s)))


def build_bench(scene: Scene, effort: Effort) -> Bench:
    """Raises CaseError where nothing varies that a frequency could depend on."""
    (lower, upper), place = scene.bounds, _place(scene)
    names = ["place along the trajectory"] if place is not None else []
    names += [scene.model.y_names[k] for k in np.flatnonzero(upper > lower)]
    if not names:
        raise CaseError((scene.file.problem("trajectory", _nothing_varies(scene)),))
    return Bench(scene, effort, tuple(names), place, lower, upper)


def _nothing_varies(scene: Scene) -> str:
    """Why there is nothing to chart, and what to do."""
    pencil, driven = scene.model.pencil, list(scene.file.coordinates.values())
    which = np.flatnonzero(pencil.active[: pencil.n_q])
    joints = ", ".join(dict.fromkeys(driven[k].joint for k in which if k < len(driven)))
    why, remedy = "no coordinate changes a frequency", "give"
    if joints:
        why = f"along the trajectory nothing moves that a frequency depends on (joints: {joints})"
        remedy = "let it move, or give"
    room = f"{remedy} a design parameter a `max` above its `min`"
    return f"nothing to chart: {why}, and no design parameter may change; {room}"


def _place(scene: Scene) -> Floats | None:
    """The place (n_t,) of every sample."""
    s = scene.path.q @ joint_map(scene.model).T
    if not s.size or np.ptp(s, axis=0).max() <= 1e-9:  # rad or m: it stands still
        return None
    if s.shape[1] == 1:
        return np.asarray((s[:, 0] - s.min()) / np.ptp(s))
    travelled = np.cumsum(np.linalg.norm(np.diff(s, axis=0, prepend=s[:1]), axis=1))
    return np.asarray(travelled / travelled[-1])


@dataclass(frozen=True, eq=False)
class Question:
    """``points``: first random ones, then ``runs`` along the trajectory, one for each design."""

    points: Points
    exact_hz: Floats  # (n, n_modes)
    runs: tuple[slice, ...]
    asked: Asked


def build_question(bench: Bench) -> Question:
    """Random samples, half of them at corners of the box of designs, and runs at several designs.

    The runs are at the initial design and at corners, where approximations err most. The samples
    are fewer where an exact solve takes long.
    """
    scene, effort, designs = bench.scene, bench.effort, corners(len(bench.lower))
    wanted = effort.random_points + (1 + len(designs)) * effort.samples_per_design
    share = min(1.0, effort.most_s / (wanted * bench.solve_s))
    n_random = max(4, int(share * effort.random_points))
    along = max(4, int(share * effort.samples_per_design))
    case = scene.file, scene.trajectory, scene.q0, np.clip(scene.initial, *scene.bounds)
    found = at_random(*case, n_random).joined(at_corners(*case, designs, along))
    points = bench.points(found.samples, found.x[:, len(scene.q0) :])
    n = len(scene.path.spread(along))
    runs = tuple(slice(k, k + n) for k in range(n_random, len(points), n))
    exact_hz, modes, samples = bench.exact(points), scene.expansions.modes, len(scene.path.q)
    floor = max(rounding_error(scene.model.pencil, x, max(modes)) for x in found.x[[0, -1]])
    asked = Asked(
        modes=modes, n_dof=scene.model.n_dof, features=bench.names, random_points=n_random,
        designs=len(runs), samples_per_design=n, trajectory_samples=samples,
        evaluations=float(samples), seed=SEED, typical_hz=float(np.median(exact_hz)),
        floor_hz=floor * float(exact_hz.max()),
    )  # fmt: skip
    return Question(points, exact_hz, runs, asked)
