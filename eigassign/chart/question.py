"""The question put to every method: frequencies along the trajectory, over the box of designs.

The points are random samples of trajectory × design box, and the trajectory at several designs.
Surrogates and grids are functions of a few *features* u in [0, 1]: the place along the trajectory,
and each design parameter that may change. The place is the joint coordinate itself where only one
matters to any frequency, else the distance travelled in joint coordinates. Either is the best
choice for them: they need not learn poses that the trajectory never takes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.chart.timing import Effort
from eigassign.errors import CaseError
from eigassign.study.planning import joint_map
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]
Ints = NDArray[np.intp]
SEED = 20211204


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


def exact_frequencies(scene: Scene, points: Points) -> Floats:
    """The charted modes by eigassign's own exact solve, (n, n_modes) in Hz."""
    modes = scene.expansions.modes
    hz = scene.model.frequencies(points.q, points.y, max(modes))
    return np.asarray(hz[:, np.array(modes) - 1])


@dataclass(frozen=True, eq=False)
class Features:
    """The trajectory and the box of designs as features."""

    names: tuple[str, ...]
    q: Floats  # (n_t, n_q) of the trajectory
    place: Floats | None  # u_0 (n_t,) of its samples; None: no pose that matters changes
    lower: Floats  # (n_y,); the same as upper where a parameter is kept
    upper: Floats

    def points(self, samples: Ints, y: Floats) -> Points:
        """Samples of the trajectory (n,) at designs (n, n_y)."""
        free = self.upper > self.lower
        u = (y - self.lower)[:, free] / (self.upper - self.lower)[free]
        u = u if self.place is None else np.column_stack([self.place[samples], u])
        return Points(self.q[samples], y, u)

    def nearest(self, u: Floats) -> Points:
        """The points at features (n, d), each at the nearest sample of the trajectory."""
        samples, unit = np.zeros(len(u), dtype=np.intp), u
        if self.place is not None:
            order = np.argsort(self.place, kind="stable")
            known, unit = self.place[order], u[:, 1:]
            samples = order[np.searchsorted(0.5 * (known[1:] + known[:-1]), u[:, 0])]
        return self.points(samples, self.design(unit))

    def design(self, unit: Floats) -> Floats:
        """y (n, n_y) at ``unit`` (n, n_free), 0 at the lower and 1 at the upper bounds."""
        free, y = self.upper > self.lower, np.tile(self.lower, (len(unit), 1))
        y[:, free] = (1.0 - unit) * self.lower[free] + unit * self.upper[free]
        return y


def build_features(scene: Scene) -> Features:
    """Raises CaseError where nothing varies that a frequency could depend on."""
    lower, upper = scene.bounds
    room, place = upper > lower, _place(scene)
    names = ["place along the trajectory"] if place is not None else []
    names += [scene.model.y_names[k] for k in np.flatnonzero(room)]
    if not names:
        raise CaseError((scene.file.problem("trajectory", _nothing_varies(scene)),))
    kept = np.clip(scene.initial, lower, upper)
    bounds = np.where(room, lower, kept), np.where(room, upper, kept)
    return Features(tuple(names), scene.path.q, place, *bounds)


def _nothing_varies(scene: Scene) -> str:
    """Why there is nothing to chart, and what to do."""
    pencil, driven = scene.model.pencil, list(scene.file.coordinates.values())
    which = np.flatnonzero(pencil.active[: pencil.n_q])
    joints = ", ".join(dict.fromkeys(driven[k].joint for k in which if k < len(driven)))
    fixed, room = "no design parameter may change", "a design parameter a `max` above its `min`"
    if not joints:
        return f"nothing to chart: no coordinate changes a frequency, and {fixed}; give {room}"
    why = f"along the trajectory nothing moves that a frequency depends on (joints: {joints})"
    return f"nothing to chart: {why}, and {fixed}; let it move, or give {room}"


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
    """``points``: first ``n_random`` ones, then runs along the trajectory, one for each design."""

    points: Points
    n_random: int
    runs: tuple[slice, ...]


def build_question(scene: Scene, features: Features, effort: Effort, solve_s: float) -> Question:
    """Seeded points, every third of the random ones at a corner of the box of designs.

    The runs are of the initial design, of the expansion's, then of corners and random ones in turn,
    each design once: of one design only where no parameter may change. The points are fewer where
    an exact solve takes long (``solve_s``), but at least three designs are followed.
    """
    random, n_t = np.random.default_rng(SEED), len(features.q)
    in_runs = effort.designs * effort.samples_per_design
    share = min(1.0, effort.most_s / ((effort.random_points + in_runs) * solve_s))
    designs = max(min(3, effort.designs), round(effort.designs * share))
    n_random, per_design = (
        max(4, int(share * n)) for n in (effort.random_points, in_runs / designs)
    )

    def in_box(n: int, ends: slice) -> Floats:
        unit = random.random((n, int((features.upper > features.lower).sum())))
        corners = random.integers(0, 2, unit[ends].shape)
        pairs = len(corners) // 2
        corners[1::2] = 1 - corners[: 2 * pairs : 2]  # opposite: errors are largest at such ends
        unit[ends] = corners
        return features.design(unit)

    samples, y = random.integers(0, n_t, n_random), in_box(n_random, slice(2, None, 3))
    first = np.vstack([scene.initial, scene.expansions.full.y0])
    first = np.clip(first, features.lower, features.upper)
    followed = np.vstack([first, in_box(2 * designs, slice(0, None, 2))])
    followed = followed[np.sort(np.unique(followed, axis=0, return_index=True)[1])[:designs]]
    along = np.unique(np.linspace(0, n_t - 1, min(per_design, n_t)).round().astype(np.intp))
    samples = np.concatenate([samples, np.tile(along, len(followed))])
    y, n = np.vstack([y, np.repeat(followed, len(along), axis=0)]), len(along)
    runs = tuple(slice(n_random + k * n, n_random + (k + 1) * n) for k in range(len(followed)))
    return Question(features.points(samples, y), n_random, runs)
