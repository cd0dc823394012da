"""Ways to a design: time against the exact objective that each reaches.

    program on the expansion       `optimize`'s own: expand, linearise, one quadratic program
    program on a reduced model     the same, linearised on a reduced model
    programs in a row              linearised anew at each other's optimum, until the design stays
    SLSQP, differential evolution  SciPy's searches on exact eigenvalues

The objective J is that of eqs. (13)–(14): the weighted mean square of the relative error in λ. Its
slope for SLSQP is that of the exact eigenvalues (`eigassign.modal.slopes`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, LinearConstraint, differential_evolution, minimize

from eigassign.assignment import (
    Assignment,
    Goal,
    LinearModel,
    hz_from_lam,
    lam_from_hz,
    relative_error,
    solve_assignment,
)
from eigassign.assignment import Bounds as DesignBounds
from eigassign.case import CaseFile
from eigassign.chart.effort import Effort, suited
from eigassign.chart.methods import points_along, reduced_model, solves_per_point
from eigassign.chart.question import SEED
from eigassign.chart.results import DesignRun, Timing, excess_over
from eigassign.chart.timing import measure
from eigassign.errors import EigassignError
from eigassign.mechanism.trajectory.trajectory import Trajectories
from eigassign.modal.expansion import expand
from eigassign.modal.slopes import eigenvalue_slopes
from eigassign.study.design.one_shot import assign_design, linear_constraints
from eigassign.study.design.wanted import Wanted, target_frequencies, time_weights
from eigassign.study.scene import Expansions, Scene

Floats = NDArray[np.float64]
ROUNDS = 12  # programs in a row at most
STILL = 1e-7  # of the box: a design that moves less has arrived
CHARTED_ONLY = "charted only"  # `optimize` solves one program, on the expansion
REDUCED_STEP = 1e-4  # of central differences of reduced models, relative to the box


def chart_designs(
    scene: Scene, effort: Effort, solve_s: float, progress: Callable[[str], None]
) -> tuple[tuple[DesignRun, ...], tuple[str, ...]]:
    """Every way to a design; none where the case has no targets or bounds without limit."""
    lower, upper = scene.bounds
    if not len(lower) or not np.isfinite(upper - lower).all() or not _are_frequencies(scene.file):
        return (), ()
    if scene.path.follows_design:
        return (), ("no designs are charted where the coordinates follow the design",)
    effort = suited(effort, scene.model.n_dof)
    task, runs, notes = design_task(scene, effort, solve_s), [], []
    if len(task.q) < len(scene.path.q):
        notes.append(
            f"designs are charted on {len(task.q)} of {len(scene.path.q)} samples of the "
            "trajectory, for an exact solve takes long"
        )
    for name, run in _ways(task, effort, solve_s):
        progress(f"designing by {name}")
        try:
            runs.append(run(name))
        except EigassignError as error:
            notes.append(f"no design by {name}: {error}")
    best = min((run.objective for run in runs), default=0.0)
    return tuple(replace(r, excess=excess_over(best, r.objective)) for r in runs), tuple(notes)


def _are_frequencies(file: CaseFile) -> bool:
    """Whether there are targets, and all are frequencies of numbered modes along a whole motion."""
    wanted = file.requirements
    plain = (r.kind == "frequency" and not r.followed and not r.target.during for r in wanted)
    return bool(wanted) and all(plain) and not file.design.catalogues


def _ways(
    task: DesignTask, effort: Effort, solve_s: float
) -> Iterator[tuple[str, Callable[[str], DesignRun]]]:
    yield "program on the expansion", partial(_on_expansion, task, effort)
    for count, guard in ((1, False), (3, True)):
        if count <= max(effort.expansion_points):
            where = f"reduced m = 2, {count} point{'s' if count > 1 else ''}"
            reduced = partial(_on_reduced, task, effort, 2, count, guard)
            yield f"program on {where}", partial(reduced, 1)
            yield f"programs in a row on {where}", partial(reduced, ROUNDS)
    most = min(effort.objectives, max(1, int(effort.searched_s / (len(task.q) * solve_s))))
    yield "SLSQP, analytic gradient", partial(_search, task, most, by_slsqp, True)
    yield "SLSQP, finite differences", partial(_search, task, most, by_slsqp, False)
    yield "differential evolution", partial(_search, task, most, by_evolution, False)


# --- The assignment that all are put


@dataclass(frozen=True, eq=False)
class DesignTask:
    """The assignment of one case on (perhaps thinned) samples of its trajectory."""

    scene: Scene
    path: Trajectories  # with these samples only
    wanted: tuple[Wanted, ...]  # at them
    rows: NDArray[np.intp]  # which samples of the whole trajectory these are

    @property
    def q(self) -> Floats:
        """(n_t, n_q)."""
        return self.path.q

    @cached_property
    def weights(self) -> Floats:
        """ω (n_t,) of the integral over time."""
        return time_weights(self.path)

    @cached_property
    def total_s(self) -> float:
        """The time that all targets stand for, each by its weight."""
        return float(sum(own.weight * self.weights[own.rows].sum() for own in self.wanted))

    @property
    def count(self) -> int:
        """The highest mode with a target."""
        return max(own.mode for own in self.wanted)

    @property
    def box(self) -> tuple[Floats, Floats]:
        """Lower bound and width of y."""
        lower, upper = self.scene.bounds
        return lower, upper - lower

    def exact_lam(self, y: Floats) -> Floats:
        """λ (n_t, highest mode) at one design."""
        return lam_from_hz(self.scene.model.frequencies(self.q, y, self.count))

    def objective(self, lam: Floats) -> float:
        """J, the weighted mean square of the relative error in λ; lam (n_t, highest mode)."""
        value = 0.0
        for own in self.wanted:
            off = lam[own.rows, own.mode - 1] / lam_from_hz(own.hz) - 1.0
            value += float(own.weight / self.total_s * self.weights[own.rows] @ off**2)
        return value

    def slope(self, lam: Floats, slopes: Floats) -> Floats:
        """∂J/∂y (n_y,) from ∂λ/∂y (n_t, highest mode, n_y)."""
        value = np.zeros(slopes.shape[2])
        for own in self.wanted:
            lam_d, k = lam_from_hz(own.hz), own.mode - 1
            push = self.weights[own.rows] * (lam[own.rows, k] / lam_d - 1.0) / lam_d
            value += 2.0 * own.weight / self.total_s * push @ slopes[own.rows, k]
        return value

    def reached(self, name: str, spent: Timing, solves: int, y: Floats, **more: Any) -> DesignRun:
        """What a way to the design y has reached, by exact solves."""
        lam = self.exact_lam(y)
        worst, square = 0.0, 0.0
        for own in self.wanted:
            hz, weights = hz_from_lam(lam[own.rows, own.mode - 1]), self.weights[own.rows]
            off = relative_error(hz, own.hz, weights)
            worst = max(worst, off.max_relative)
            square += own.weight * weights.sum() / self.total_s * off.rms_relative**2
        return DesignRun(
            method=name,
            seconds=spent,
            solves=solves,
            design=tuple(y.tolist()),
            objective=self.objective(lam),
            max_relative=worst,
            rms_relative=square**0.5,
            excess=0.0,
            **more,
        )


def design_task(scene: Scene, effort: Effort, solve_s: float) -> DesignTask:
    """All samples, or so few that one exact objective takes about a fortieth of a search."""
    rows = scene.path.spread(max(5, int(effort.searched_s / 40.0 / solve_s)))
    path = scene.path.chosen(rows)
    return DesignTask(scene, path, target_frequencies(scene.file, path), rows)


# --- Quadratic programs on models of λ


def _on_expansion(task: DesignTask, effort: Effort, name: str) -> DesignRun:
    scene, full, order = task.scene, task.scene.expansions.full, task.scene.expansions.order

    def design() -> Assignment:
        linear = expand(scene.model.pencil, full.q0, full.y0, full.modes, order, linear_in_y=True)
        made = Expansions(full, linear, order, order)
        return assign_design(replace(scene, expansions=made, trajectory=task.path), task.wanted)

    found, spent = measure(design, effort.patience)
    how = {"order": order, "q0": full.q0, "y0": full.y0}
    return task.reached(name, spent, 1, found.y, ours=True, parameters=how)


def _on_reduced(
    task: DesignTask, effort: Effort, m: int, count: int, guard: bool, rounds: int, name: str
) -> DesignRun:
    scene = task.scene
    q, y = points_along(scene, count)

    def design() -> tuple[Floats, int]:
        made = reduced_model(scene, m, q, y, guard)
        return _programs(
            task, lambda at: lam_from_hz(made.frequencies(task.q, at)), list(made.modes), rounds
        )

    (found, programs), spent = measure(design, effort.patience)
    how = {"half_order": m, "q": q, "y": y, "guard": guard, "programs": programs}
    solves = len(q) * solves_per_point(scene, m, guard)
    return task.reached(name, spent, solves, found, ours=True, parameters=how, note=CHARTED_ONLY)


def _programs(
    task: DesignTask, lam: Callable[[Floats], Floats], columns: list[int], rounds: int
) -> tuple[Floats, int]:
    """Gauss–Newton: the quadratic program of the model linearised at y, until y stays."""
    scene, (lower, width) = task.scene, task.box
    y, moved, done = scene.expansions.full.y0, np.inf, 0
    while done < rounds and moved >= STILL:
        l0, slope = _linearised(lam, y, width)
        goals = [
            Goal(LinearModel(l0[own.rows, k], slope[own.rows, k]), own.hz, own.weight, own.rows)
            for own in task.wanted
            for k in [columns.index(own.mode)]
        ]
        found = solve_assignment(
            goals,
            task.weights,
            y,
            np.clip(y, *scene.bounds),
            DesignBounds(*scene.bounds),
            linear_constraints(scene.file),
            tuple(scene.file.design.parameters),
        )
        moved = float((np.abs(found.y - y) / np.where(width > 0.0, width, 1.0)).max())
        y, done = found.y, done + 1
    return np.clip(y, lower, lower + width), done


def _linearised(lam: Callable[[Floats], Floats], y: Floats, width: Floats) -> tuple[Floats, Floats]:
    """λ (n_t, n_modes) and ∂λ/∂y (n_t, n_modes, n_y) by central differences."""
    l0 = lam(y)
    slope = np.zeros((*l0.shape, len(y)))
    for j in np.flatnonzero(width > 0.0):
        step = REDUCED_STEP * width[j] * np.eye(len(y))[j]
        slope[:, :, j] = (lam(y + step) - lam(y - step)) / (2.0 * REDUCED_STEP * width[j])
    return l0, slope


# --- Searches on exact eigenvalues, over v in [0, 1]^n with y = lower + width v


class SpentError(Exception):
    """The evaluations that a search may make are used up."""


@dataclass(frozen=True, eq=False)
class UnitLimits:
    """The case's linear constraints, lower ≤ C v ≤ upper."""

    C: Floats
    lower: Floats
    upper: Floats

    def met(self, v: Floats) -> bool:
        """Whether the design v (n,) keeps them, up to rounding."""
        row = self.C @ v
        slack = 1e-8 * (1.0 + np.abs(row))
        return bool(((row >= self.lower - slack) & (row <= self.upper + slack)).all())

    @property
    def constraints(self) -> Any:
        """As SciPy wants them."""
        return (LinearConstraint(self.C, self.lower, self.upper),) if len(self.C) else ()


@dataclass
class SearchRecord:
    """An objective that counts its evaluations, and remembers its best design and when it came.

    ``objective`` gives J(v) and, where it has one, its gradient. A design counts as the best only
    where it keeps the ``limits``, up to rounding.
    """

    objective: Callable[[Floats], tuple[float, Floats | None]]
    limits: UnitLimits
    most: int
    start: float = field(default_factory=perf_counter)
    calls: int = 0
    best: float = np.inf
    design: Floats | None = None
    trace: list[tuple[float, float]] = field(default_factory=list)

    def __call__(self, v: Floats) -> float:
        """J(v); raises SpentError when no evaluation is left."""
        return self.with_slope(v)[0]

    def with_slope(self, v: Floats) -> tuple[float, Floats]:
        """J(v) and its gradient (0 where the objective has none)."""
        if self.calls >= self.most:
            raise SpentError
        self.calls += 1
        value, slope = self.objective(np.clip(v, 0.0, 1.0))
        if value < self.best and self.limits.met(v):
            self.best, self.design = value, np.clip(v, 0.0, 1.0)
            self.trace.append((perf_counter() - self.start, value))
        return value, np.zeros(len(v)) if slope is None else slope


def by_slsqp(record: SearchRecord, start: Floats, analytic: bool) -> None:
    """SLSQP from ``start``, with the objective's own gradient or with finite differences."""
    how: dict[str, Any] = {
        "method": "SLSQP",
        "bounds": Bounds(np.zeros(len(start)), np.ones(len(start))),
        "constraints": record.limits.constraints,
        "options": {"ftol": 1e-12, "maxiter": 100},
    }
    if analytic:
        minimize(record.with_slope, start, jac=True, **how)
    else:
        minimize(record, start, **how)


def by_evolution(record: SearchRecord, start: Floats, _: bool = False) -> None:
    """Differential evolution, without polishing, until the evaluations are used up."""
    differential_evolution(
        record,
        Bounds(np.zeros(len(start)), np.ones(len(start))),
        x0=start,
        seed=SEED,
        popsize=8,
        tol=1e-10,
        polish=False,
        constraints=record.limits.constraints,
    )


def _search(
    task: DesignTask,
    most: int,
    search: Callable[[SearchRecord, Floats, bool], None],
    analytic: bool,
    name: str,
) -> DesignRun:
    """Run once: its trace says how it went."""
    lower, width = task.box

    def objective(v: Floats) -> tuple[float, Floats | None]:
        y = lower + width * v
        if not analytic:
            return task.objective(task.exact_lam(y)), None
        x = task.scene.model.x(task.q, y)
        scales = np.append(np.zeros(task.q.shape[1]), width)
        lam, rates = eigenvalue_slopes(task.scene.model.pencil, x, task.count, scales)
        return task.objective(lam), task.slope(lam, rates[..., task.q.shape[1] :]) * width

    start = np.clip((task.scene.initial - lower) / np.where(width > 0.0, width, 1.0), 0.0, 1.0)
    record = SearchRecord(objective, _unit_limits(task), most)
    begun = perf_counter()
    try:
        search(record, start, analytic)
        stopped = ""
    except SpentError:
        stopped = "stopped: no evaluation left"
    seconds = perf_counter() - begun
    y = lower + width * (start if record.design is None else record.design)
    return task.reached(
        name,
        Timing(seconds, seconds, seconds, 0),
        record.calls * len(task.q),
        y,
        ours=False,
        parameters={"evaluations": record.calls, "most": most},
        trace=tuple(record.trace),
        note=stopped,
    )


def _unit_limits(task: DesignTask) -> UnitLimits:
    """The case's linear constraints over v."""
    lower, width = task.box
    rows = linear_constraints(task.scene.file)
    C = np.array([row.coefficients for row in rows]).reshape(len(rows), len(lower))
    low, high = (np.array([getattr(row, side) for row in rows]) for side in ("lower", "upper"))
    return UnitLimits(C * width, low - C @ lower, high - C @ lower)
