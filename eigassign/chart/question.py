"""The question put to every method, and how the answers are timed.

Frequencies are asked for between the samples of the trajectory and all over the design's box, and
along the trajectory at several designs.

Times are processor time, which on one thread is the time it takes where nothing else runs.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from eigassign.chart.results import Asked, Timing
from eigassign.errors import CaseError
from eigassign.modal.exact.solver import rounding_error
from eigassign.study.planning import at_corners, corners, joint_map, scattered
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]
SEED = 20211
Ints = NDArray[np.intp]
T = TypeVar("T")


# --- How much is tried, and how it is timed


@dataclass(frozen=True)
class Effort:
    """Points, sizes of the methods and time limits, unless given those without ``--quick``."""

    quick: bool = False
    random_points: int = 600  # at which methods are compared, beside
    samples_per_design: int = 152  # along the trajectory at several designs
    most_s: float = 60.0  # for the exact answers, one method's set-up
    orders: tuple[int, ...] = (1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 12)
    coefficients: int = 5000  # largest set that is expanded
    half_orders: tuple[int, ...] = (0, 1, 2, 3)
    expansion_points: tuple[int, ...] = (1, 3, 5)
    factors: tuple[float, ...] = (0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0)  # of a mesh's elements
    most_dof: int = 40_000  # of a refined mesh
    repeats: int = 15  # of a job, at most, and none is begun after
    repeat_s: float = 1.0  # its first run included


QUICK = Effort(
    quick=True, random_points=150, most_s=2.0, orders=(1, 2, 3, 4, 6, 8), coefficients=1000,
    expansion_points=(1, 3), factors=(0.5, 1.0, 2.0, 4.0), most_dof=2500,
    repeat_s=0.1,
)  # fmt: skip


def timed(job: Callable[[], T]) -> tuple[T, float]:
    """The result of a job, and the seconds it took."""
    start = time.process_time()
    return job(), time.process_time() - start


def measure(job: Callable[[], T], effort: Effort, count: int = 1) -> tuple[T, Timing]:
    """The result of a job, and how long each of its ``count`` parts takes.

    The first run does not count, for it warms caches, unless it takes too long for another.
    """
    result, first = timed(job)
    spent = list[float]()
    while len(spent) < effort.repeats and first + sum(spent) < effort.repeat_s:
        spent.append(timed(job)[1])
    median, low, high = (np.quantile(spent or [first], (0.5, 0.25, 0.75)) / count).tolist()
    return result, Timing(median, low, high, len(spent))


# --- The case, and its exact solves


@dataclass(frozen=True, eq=False)
class Points:
    """Poses q (n, n_q) and designs y (n, n_y)."""

    q: Floats
    y: Floats

    def __len__(self) -> int:
        return len(self.q)

    def __getitem__(self, rows: slice | Ints) -> Points:
        return Points(self.q[rows], self.y[rows])


@dataclass(frozen=True, eq=False)
class Bench:
    """A case on which methods are tried, and its exact solves."""

    scene: Scene
    effort: Effort
    lower: Floats  # (n_y,); the same as upper where a parameter is kept
    upper: Floats

    def points(self, samples: Floats | Ints, y: Floats) -> Points:
        """Samples of the trajectory (n,) at designs (n, n_y); 1.5 is between second and third."""
        every = np.arange(len(self.scene.path.q))
        q = [np.interp(samples, every, own) for own in self.scene.path.q.T]
        return Points(np.reshape(q, (-1, len(y))).T, y)

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


def build_bench(scene: Scene, effort: Effort) -> Bench:
    """Raises CaseError where nothing varies that a frequency could depend on."""
    (lower, upper), model = scene.bounds, scene.model
    if not (_moves(scene) or (upper > lower).any()):
        why, remedy = "no coordinate changes a frequency", "give"
        which = zip(scene.file.coordinates.values(), model.pencil.active, strict=False)
        if joints := ", ".join(dict.fromkeys(each.joint for each, active in which if active)):
            still = "along the trajectory nothing moves that a frequency depends on"
            why, remedy = f"{still} (joints: {joints})", "let it move, or give"
        room = f"{remedy} a design parameter a `max` above its `min`"
        message = f"nothing to chart: {why}, and no design parameter may change; {room}"
        raise CaseError((scene.file.problem("trajectory", message),))
    return Bench(scene, effort, lower, upper)


def _moves(scene: Scene) -> bool:
    """True where a joint on which a frequency depends moves along the trajectory, in rad or m."""
    s = scene.path.q @ joint_map(scene.model).T
    return bool(s.size) and float(np.ptp(s, axis=0).max()) > 1e-9


# --- The question


@dataclass(frozen=True, eq=False)
class Question:
    """``points``: first random ones, then ``runs`` along the trajectory, one for each design."""

    points: Points
    exact_hz: Floats  # (n, n_modes)
    runs: tuple[slice, ...]
    asked: Asked


def build_question(bench: Bench) -> Question:
    """Points between samples and all over the box of designs, and runs at several designs.

    The runs are at the initial design and at corners, where approximations err most. The samples
    are fewer where an exact solve takes long.
    """
    scene, effort, designs = bench.scene, bench.effort, corners(len(bench.lower))
    wanted = effort.random_points + (1 + len(designs)) * effort.samples_per_design
    share = min(1.0, effort.most_s / (wanted * bench.solve_s))
    n_random, along = (
        max(4, int(share * count)) for count in (effort.random_points, effort.samples_per_design)
    )
    case = scene.file, scene.trajectory, scene.q0, np.clip(scene.initial, *scene.bounds)
    within, outer = scattered(*case[:3], n_random), at_corners(*case, designs, along)
    x, where = np.vstack([within[0], outer[0]]), np.append(within[1], outer[1])
    points = bench.points(where, x[:, len(scene.q0) :])
    n, modes = len(scene.path.spread(along)), scene.expansions.modes
    runs = tuple(slice(k, k + n) for k in range(n_random, len(points), n))
    exact_hz, samples = bench.exact(points), len(scene.path.q)
    floor = max(rounding_error(scene.model.pencil, each, max(modes)) for each in x[[0, -1]])
    asked = Asked(
        modes=modes, n_dof=scene.model.n_dof, random_points=n_random, designs=len(runs),
        samples_per_design=n, trajectory_samples=samples,
        seed=SEED, typical_hz=float(np.median(exact_hz)),
        floor_hz=floor * float(exact_hz.max()),
    )  # fmt: skip
    return Question(points, exact_hz, runs, asked)
