"""What every method of a chart is asked: poses and designs that it learns from, others as a test.

Methods learn at the samples of the trajectory. They are judged between them and at other designs of
one fixed sequence (`kronecker`), so that no test point is ever one that was learnt from. How many
points there are follows from the size of the model alone: a slow machine changes times.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace

import numpy as np

from eigassign.arrays import Bools, Floats, Ints
from eigassign.case.case_file import CaseFile
from eigassign.errors import CaseError, EigassignError, SingularityError, TrajectoryError
from eigassign.mechanism.kinematics.loop_closure import kronecker
from eigassign.mechanism.kinematics.parameters import resting_pose
from eigassign.mechanism.trajectory.trajectory import Trajectories
from eigassign.modal.model import Model
from eigassign.study.built_case import BuiltCase
from eigassign.study.planning import corners, design_bounds, plan_expansion, poses_at

LEARNT = 1000  # the row of the sequence from which designs are learnt; tests begin with row 1
LARGE = 1000  # degrees of freedom above which fits learn from few points
EDGE = 0.05  # of a step between samples: test points keep so far from both


@dataclass(frozen=True)
class Effort:
    """Points and sizes, unless given those without ``--quick``."""

    quick: bool = False
    designs: int = 32
    instants: int = 16  # along the trajectory at each design
    coefficients: int = 5000  # of the largest set that is expanded
    learnt: tuple[int, ...] = (25, 50, 100, 200, 400)  # points of radial basis functions
    kriged: tuple[int, ...] = (25, 50, 100, 200)  # Kriging takes their third power
    elements: tuple[int, ...] = (1, 2, 4, 8, 16)
    most_dof: int = 10_000  # of a mesh
    boxes: int = 16  # designs and instants of each box
    repeats: int = 9

    def of_size(self, n_dof: int) -> Effort:
        """Fewer points for larger models, so that the work grows slowly."""
        share = min(1.0, 400.0 / n_dof) ** 0.5
        names = ("designs", "instants", "boxes")
        fewer = {name: max(4, round(share * getattr(self, name))) for name in names}
        sizes = (5, 5) if n_dof <= LARGE else (2, 1)
        learnt, kriged = self.learnt[: sizes[0]], self.kriged[: sizes[1]]
        return replace(self, **fewer, learnt=learnt, kriged=kriged)


QUICK = Effort(True, 16, 12, 1500, (25, 50, 100), (25, 50), (1, 2, 4, 8), 1500, 8, 5)


@dataclass(frozen=True, eq=False)
class Points:
    """Poses and designs x (n, n_x); where along the samples (n,); which design (n,) each is."""

    x: Floats
    place: Floats
    design: Ints

    def __len__(self) -> int:
        return len(self.x)

    def __getitem__(self, rows: slice | Ints | Bools) -> Points:
        return Points(self.x[rows], self.place[rows], self.design[rows])


@dataclass(frozen=True, eq=False)
class Subject:
    """A case on which methods are tried. SI units, x = (q, y)."""

    file: CaseFile
    model: Model
    path: Trajectories | None
    modes: tuple[int, ...]
    x0: Floats  # about which series are expanded, (n_x,)
    initial: Floats  # (n_y,)
    bounds: tuple[Floats, Floats]  # of y
    _followed: dict[bytes, Floats] = field(default_factory=dict)  # q at all samples, by design

    @property
    def rows(self) -> tuple[slice, ...]:
        """The samples of each trajectory; none where there is nothing between samples."""
        rows = () if self.path is None else self.path.rows
        return rows if any(own.stop - own.start > 1 for own in rows) else ()

    @property
    def free(self) -> tuple[str, ...]:
        """The names of the design parameters that have room."""
        room = zip(self.model.y_names, *self.bounds, strict=True)
        return tuple(name for name, low, high in room if high > low)

    def split(self, x: Floats) -> tuple[Floats, Floats]:
        """q and y of x."""
        n_q = len(self.model.q_names)
        return x[..., :n_q], x[..., n_q:]

    def exact(self, x: Floats, count: int | None = None) -> Floats:
        """The charted modes (n, n_modes) in Hz, or the lowest ``count``; NaN where there are none.

        By eigassign's own exact solve.
        """
        most = count or max(self.modes)
        hz = answered(lambda k: self.model.frequencies(*self.split(x[k]), most), len(x), most)
        return hz if count else hz[:, np.array(self.modes) - 1]

    def tested(self, effort: Effort) -> Points:
        """Test points: between the samples, at designs spread over the bounds and at corners."""
        designs, instants = self.initial[None], effort.designs * effort.instants
        if self.free:
            instants = effort.instants if self.rows else 1
            inside = self._designs(1, effort.designs * effort.instants // instants)
            ends = corners(len(self.initial))[: effort.designs]
            designs = np.vstack([np.where(ends, *self.bounds[::-1]), inside])
        if not self.rows:
            q = np.tile(self.split(self.x0)[0], (len(designs), 1))
            return Points(np.hstack([q, designs]), np.zeros(len(q)), np.arange(len(q)))
        share = kronecker(1 + len(designs) * instants, 1)[1:, 0].reshape(len(designs), -1)
        steps = np.concatenate([np.arange(own.start, own.stop - 1) for own in self.rows])
        step, rest = np.divmod(np.sort(share) * len(steps), 1.0)
        place = steps[step.astype(np.intp)] + EDGE + (1.0 - 2.0 * EDGE) * rest
        if self.free:  # poses that hold still, at designs that none has seen
            held = [own.start for own in self.rows if own.stop - own.start == 1]
            place = np.sort(np.hstack([place, np.tile(held, (len(place), 1))]))
        parts = list[tuple[Floats, Floats, Ints]]()
        for k, y in enumerate(designs):
            with suppress(TrajectoryError):  # a design that cannot follow the path
                x = np.hstack([self._poses(place[k], y), np.tile(y, (place.shape[1], 1))])
                parts.append((x, place[k], np.full(place.shape[1], k)))
        return Points(*map(np.concatenate, zip(*parts, strict=True)))

    def learnt(self, count: int) -> Points:
        """Points to learn from: samples, at other designs of the same sequence; each once."""
        y = self._designs(LEARNT, count) if self.free else np.tile(self.initial, (count, 1))
        q, k = np.tile(self.split(self.x0)[0], (count, 1)), np.zeros(count, dtype=np.intp)
        if self.rows and self.path is not None:
            share = kronecker(LEARNT + count, 1 + y.shape[1])[LEARNT:, 0]
            last = len(self.path.q) - 1  # of samples alone evenly, both ends included
            k = np.rint(last * (share if self.free else np.linspace(0, 1, count))).astype(int)
            q = self.path.q[k]
            if self.path.follows_design and count:
                q = np.array([self._poses_at(y[i])[k[i]] for i in range(count)])
        x = np.hstack([q, y])
        once = np.sort(np.unique(x, axis=0, return_index=True)[1])
        return Points(x[once], k[once].astype(np.float64), once)

    def along(self, y: Floats) -> Points:
        """One trajectory, at its own samples, or a single pose, at design y."""
        q = self._poses_at(y)
        x = np.hstack([q, np.tile(y, (len(q), 1))])
        return Points(x, np.arange(len(q), dtype=np.float64), np.zeros(len(q), dtype=np.intp))

    def _poses_at(self, y: Floats) -> Floats:
        """q at every sample at design y, made once; of x0 without a path."""
        if self.path is None:
            return self.split(self.x0[None])[0]
        key = y.tobytes()
        if key not in self._followed:
            self._followed[key] = poses_at(self.path, y)
        return self._followed[key]

    def _designs(self, first: int, count: int) -> Floats:
        lower, upper = self.bounds
        return lower + kronecker(first + count, len(lower))[first:] * (upper - lower)

    def _poses(self, place: Floats, y: Floats) -> Floats:
        """q at ascending places along the samples; raises TrajectoryError as `between` does."""
        found = list[Floats]()
        for rows in self.rows:
            own = place[(place >= rows.start) & (place <= rows.stop - 1)] - rows.start
            if self.path is not None and len(own):
                found.append(self.path.between(rows, y)(own))
        return np.concatenate(found)


def answered(solve: Callable[[Ints], Floats], count: int, width: int) -> Floats:
    """``solve`` of the rows 0 to ``count`` − 1, (count, width), NaN at those at which it raises."""

    def part(rows: Ints) -> Floats:
        try:
            return solve(rows)
        except EigassignError:
            if len(rows) == 1:
                return np.full((1, width), np.nan)
        return np.vstack([part(half) for half in np.array_split(rows, 2)])

    return part(np.arange(count)) if count else np.empty((0, width))


def asked(answer: Callable[[Points], Floats], points: Points, exact: Floats) -> Floats:
    """What a method says at points, in the shape of what is exact there; NaN where it has none."""
    with np.errstate(all="ignore"):
        return answered(lambda rows: answer(points[rows]), *exact.shape)


def errors(hz: Floats, exact: Floats) -> tuple[float, float, int]:
    """Worst and rms of |f/f_exact − 1|, infinite where a method has no number; how many have none.

    Points without an exact answer do not count.
    """
    off = np.abs(hz / exact - 1.0)[np.isfinite(exact).all(axis=1)]
    failed = ~np.isfinite(off)
    off = np.where(failed, np.inf, off)
    rms = float(np.sqrt(np.mean(off**2))) if off.size else 0.0
    return float(off.max(initial=0.0)), rms, int(failed.any(axis=1).sum())


def build_subject(case: BuiltCase) -> tuple[Subject, str]:
    """What of a case is charted, and why its trajectory cannot be followed, where that is so.

    Then it is charted at rest. Raises CaseError for what cannot be modelled.
    """
    file, model, path, why = case.settled.file, case.model(), None, ""
    if file.trajectory is not None:
        try:
            path = case.trajectory
        except CaseError as error:
            if not isinstance(error.__cause__, TrajectoryError | SingularityError):
                raise
            why = error.problems[0].message
    if path is None and file.expansion.q == "auto":
        at_rest = file.expansion.model_copy(update={"q": tuple(resting_pose(file).tolist())})
        file = replace(file, expansion=at_rest)
    plan, bounds = plan_expansion(file, model, path, order=1), design_bounds(file)
    x0, initial = np.append(plan.q0, plan.y0), np.clip(case.initial_design, *bounds)
    return Subject(file, model, path, plan.modes, x0, initial, bounds), why
