"""Ways to a design: time against the exact objective that each reaches.

    one shot                       the paper's: expand, linearise, one quadratic program
    sequential                     `optimize`'s programs in a row, from the initial design
    sequential, several starts     all that `optimize` does to find the optimum
    SLSQP, differential evolution  SciPy's searches on exact eigenvalues

The objective is the one that `optimize` makes small, F of `assignment.exact.design_problem`: the
mean square of f/f_d − 1 with the weights of targets and time.
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

from eigassign.assignment.assign import Assignment
from eigassign.assignment.exact.design_problem import DesignProblem
from eigassign.assignment.exact.requirements import Frequencies
from eigassign.assignment.exact.sequential import minimise
from eigassign.case.case_file import CaseFile
from eigassign.chart.effort import Effort, suited
from eigassign.chart.question import SEED
from eigassign.chart.results import DesignRun, Timing, excess_over
from eigassign.chart.timing import measure
from eigassign.errors import EigassignError
from eigassign.modal.expansion import expand
from eigassign.study.design.one_shot import assign_design
from eigassign.study.design.optimum import Found, PosedProblem, Task, find_optimum, variant_of
from eigassign.study.scene import Expansions, Scene
from eigassign.study.wanted import Wanted, target_frequencies

Floats = NDArray[np.float64]


def chart_designs(
    scene: Scene, effort: Effort, solve_s: float, progress: Callable[[str], None]
) -> tuple[tuple[DesignRun, ...], tuple[str, ...]]:
    """Every way to a design; none where the case has no targets or bounds without limit."""
    lower, upper = scene.bounds
    if not len(lower) or not np.isfinite(upper - lower).all() or not _is_plain(scene.file):
        return (), ()
    if scene.path.follows_design:
        return (), ("no designs are charted where the coordinates follow the design",)
    task, runs, notes = design_task(scene, suited(effort, scene.model.n_dof), solve_s), [], []
    if (charted := len(task.scene.path.q)) < len(scene.path.q):
        notes.append(
            f"designs are charted on {charted} of {len(scene.path.q)} samples of the "
            "trajectory, for an exact solve takes long"
        )
    for name, run in _ways(task, suited(effort, scene.model.n_dof), solve_s):
        progress(f"designing by {name}")
        try:
            runs.append(run(name))
        except EigassignError as error:
            notes.append(f"no design by {name}: {error}")
    best = min((run.objective for run in runs), default=0.0)
    return tuple(replace(r, excess=excess_over(best, r.objective)) for r in runs), tuple(notes)


def _is_plain(file: CaseFile) -> bool:
    """Whether frequencies of numbered modes are wanted along whole motions, and nothing else."""
    wanted, design = file.requirements, file.design
    plain = (r.kind == "frequency" and not r.followed and not r.target.during for r in wanted)
    limited = design.catalogues or design.mass or file.assignment.objective != "least_squares"
    return bool(wanted) and all(plain) and not limited


def _ways(
    task: DesignTask, effort: Effort, solve_s: float
) -> Iterator[tuple[str, Callable[[str], DesignRun]]]:
    yield "one shot", partial(_one_shot, task, effort)
    yield "sequential", partial(_sequential, task, effort)
    yield "sequential, several starts", partial(_several_starts, task)
    samples = len(task.scene.path.q)
    most = min(effort.objectives, max(1, int(effort.searched_s / (samples * solve_s))))
    yield "SLSQP, analytic gradient", partial(_search, task, most, by_slsqp, True)
    yield "SLSQP, finite differences", partial(_search, task, most, by_slsqp, False)
    yield "differential evolution", partial(_search, task, most, by_evolution, False)


# --- The assignment that all are put


@dataclass(frozen=True, eq=False)
class DesignTask:
    """The assignment of one case on (perhaps thinned) samples of its trajectory."""

    scene: Scene  # with these samples only
    wanted: tuple[Wanted, ...]  # at them

    @cached_property
    def variant(self) -> PosedProblem:
        """The targets on exact frequencies."""
        return variant_of(Task(self.scene, self.wanted, 0.0), ())

    @property
    def problem(self) -> DesignProblem:
        """F and its limits."""
        return self.variant.problem

    def objective(self, y: Floats) -> float:
        """F of a design, without the price of slopes."""
        asked = self.variant.requirements
        hz = self.scene.model.frequencies(self.scene.path.q, y, asked.modes)
        return self.problem(y, asked.appraise(y, Frequencies(hz, np.zeros((*hz.shape, len(y))))))

    def with_slope(self, y: Floats) -> tuple[float, Floats]:
        """F of a design and its gradient (n_y,), 2 Jᵀ r and the prices."""
        seen = self.problem.appraise(y)
        slope = 2.0 * seen.residual @ seen.slopes
        prices = self.problem.prices
        return self.problem(y, seen), slope if prices is None else slope + prices

    def reached(self, name: str, spent: Timing, solves: int, y: Floats, **more: Any) -> DesignRun:
        """What a way to the design y has reached, by exact solves."""
        seen = self.problem.appraise(y)
        curves = self.variant.requirements.curves(seen)
        off = [
            np.abs(hz / own.hz - 1.0).max()
            for (hz, _), own in zip(curves, self.wanted, strict=True)
        ]
        return DesignRun(
            method=name,
            seconds=spent,
            solves=solves,
            design=tuple(y.tolist()),
            objective=self.problem(y, seen),
            max_relative=float(max(off)),
            rms_relative=float(np.linalg.norm(seen.residual)),
            excess=0.0,
            **more,
        )


def design_task(scene: Scene, effort: Effort, solve_s: float) -> DesignTask:
    """All samples, or so few that one exact objective takes about a fortieth of a search."""
    rows = scene.path.spread(max(5, int(effort.searched_s / 40.0 / solve_s)))
    path = scene.path.chosen(rows)
    return DesignTask(replace(scene, trajectory=path), target_frequencies(scene.file, path))


# --- Those of `optimize`


def _one_shot(task: DesignTask, effort: Effort, name: str) -> DesignRun:
    scene, full, order = task.scene, task.scene.expansions.full, task.scene.expansions.order

    def design() -> Assignment:
        linear = expand(scene.model.pencil, full.q0, full.y0, full.modes, order, linear_in_y=True)
        made = Expansions(full, linear, order, order)
        return assign_design(replace(scene, expansions=made), task.wanted)

    found, spent = measure(design, effort.patience)
    how = {"order": order, "q0": full.q0, "y0": full.y0}
    return task.reached(name, spent, 1, found.y, ours=True, parameters=how)


def _sequential(task: DesignTask, effort: Effort, name: str) -> DesignRun:
    start, most = np.clip(task.scene.initial, *task.scene.bounds), task.scene.file.assignment.steps
    found, spent = measure(lambda: minimise(task.problem, start, most), effort.patience)
    how = {"designs judged": found.appraisals}
    solves = found.appraisals * len(task.scene.path.q)
    return task.reached(name, spent, solves, found.y, ours=True, parameters=how)


def _several_starts(task: DesignTask, name: str) -> DesignRun:
    """Run once: it takes as long as the others in sum."""

    def design() -> Found:
        return find_optimum(task.scene, task.wanted, (), lambda line: None)

    begun = perf_counter()
    found = design()
    seconds = perf_counter() - begun
    spent, how = Timing(seconds, seconds, seconds, 0), {"starts": found.starts}
    return task.reached(name, spent, found.exact_solves, found.best.y, ours=True, parameters=how)


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

    ``objective`` gives F(v) and, where it has one, its gradient. A design counts as the best only
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
        """F(v); raises SpentError when no evaluation is left."""
        return self.with_slope(v)[0]

    def with_slope(self, v: Floats) -> tuple[float, Floats]:
        """F(v) and its gradient (0 where the objective has none)."""
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
    lower, upper = task.scene.bounds
    width = upper - lower

    def objective(v: Floats) -> tuple[float, Floats | None]:
        y = lower + width * v
        if not analytic:
            return task.objective(y), None
        value, slope = task.with_slope(y)
        return value, slope * width

    start = np.clip((task.scene.initial - lower) / np.where(width > 0.0, width, 1.0), 0.0, 1.0)
    record = SearchRecord(objective, _unit_limits(task.problem), most)
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
        record.calls * len(task.scene.path.q),
        y,
        ours=False,
        parameters={"evaluations": record.calls, "most": most},
        trace=tuple(record.trace),
        note=stopped,
    )


def _unit_limits(problem: DesignProblem) -> UnitLimits:
    """The linear constraints over v."""
    lower, rows = problem.lower, problem.constraints
    C = np.array([row.coefficients for row in rows]).reshape(len(rows), len(lower))
    low, high = (np.array([getattr(row, side) for row in rows]) for side in ("lower", "upper"))
    return UnitLimits(C * (problem.upper - lower), low - C @ lower, high - C @ lower)
