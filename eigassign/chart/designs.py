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
from dataclasses import dataclass, replace
from functools import partial
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, LinearConstraint, differential_evolution, minimize

from eigassign.assignment.exact.design_problem import UnitBox
from eigassign.assignment.exact.requirements import Frequencies
from eigassign.assignment.exact.sequential import minimise
from eigassign.chart.question import SEED
from eigassign.chart.results import DesignRun, Timing, excess_over
from eigassign.chart.timing import Effort, measure
from eigassign.errors import EigassignError
from eigassign.modal.expansion import expand
from eigassign.study.design.one_shot import assign_design
from eigassign.study.design.optimum import PosedProblem, Task, find_optimum, variant_of
from eigassign.study.scene import Expansions, Scene
from eigassign.study.wanted import Wanted, target_frequencies

Floats = NDArray[np.float64]


class SpentError(Exception):
    """The evaluations that a search may make are used up."""


def chart_designs(
    scene: Scene, effort: Effort, solve_s: float, progress: Callable[[str], None]
) -> tuple[tuple[DesignRun, ...], tuple[str, ...]]:
    """Every way to a design, and notes; none where the case has no targets or open bounds.

    Only cases are charted that want frequencies of numbered modes along whole motions, and nothing
    else. Where a solve takes long, some of the samples are taken: so many that one exact objective
    takes about a fortieth of a search.
    """
    lower, upper = scene.bounds
    wanted, design = scene.file.requirements, scene.file.design
    plain = (r.kind == "frequency" and not r.followed and not r.target.during for r in wanted)
    limited = design.catalogues or design.mass or scene.file.assignment.objective != "least_squares"
    if not (wanted and all(plain) and len(lower) and np.isfinite(upper - lower).all()) or limited:
        return (), ()
    if scene.path.follows_design:
        return (), ("no designs are charted where the coordinates follow the design",)
    rows = scene.path.spread(max(5, int(effort.most_s / 40.0 / solve_s)))
    path, runs, notes = scene.path.chosen(rows), [], []
    if len(path.q) < len(scene.path.q):
        few = f"designs are charted on {len(path.q)} of {len(scene.path.q)} samples"
        notes.append(f"{few} of the trajectory, for an exact solve takes long")
    task = DesignTask(replace(scene, trajectory=path), target_frequencies(scene.file, path))
    most = max(1, int(effort.most_s / (len(path.q) * solve_s)))
    for name, run in _ways(task, effort, min(effort.objectives, most)):
        progress(f"designing by {name}")
        try:
            runs.append(replace(run(), method=name))
        except EigassignError as error:
            notes.append(f"no design by {name}: {error}")
    best = min((run.objective for run in runs), default=0.0)
    return tuple(replace(r, excess=excess_over(best, r.objective)) for r in runs), tuple(notes)


def _ways(
    task: DesignTask, effort: Effort, most: int
) -> Iterator[tuple[str, Callable[[], DesignRun]]]:
    yield "one shot", partial(_one_shot, task, effort)
    yield "sequential", partial(_sequential, task, effort)
    yield "sequential, several starts", partial(_several_starts, task)
    yield "SLSQP, analytic gradient", partial(_search, task, most, partial(_slsqp, True))
    yield "SLSQP, finite differences", partial(_search, task, most, partial(_slsqp, False))
    yield "differential evolution", partial(_search, task, most, _evolution)


@dataclass(frozen=True, eq=False)
class DesignTask:
    """The assignment of one case on (perhaps thinned) samples of its trajectory."""

    scene: Scene  # with these samples only
    wanted: tuple[Wanted, ...]  # at them

    @property
    def variant(self) -> PosedProblem:
        """The targets on exact frequencies."""
        return variant_of(Task(self.scene, self.wanted, 0.0), ())

    def reached(self, spent: Timing, solves: int, y: Floats, **more: Any) -> DesignRun:
        """What a way to the design y has reached, by exact solves."""
        variant = self.variant
        seen = variant.problem.appraise(y)
        curves = zip(variant.requirements.curves(seen), self.wanted, strict=True)
        off = max(float(np.abs(hz / own.hz - 1.0).max()) for (hz, _), own in curves)
        rms, objective = float(np.linalg.norm(seen.residual)), variant.problem(y, seen)
        how = {"method": "", "ours": True, "excess": 0.0, **more}
        return DesignRun(
            seconds=spent, solves=solves, design=tuple(y.tolist()), objective=objective,
            max_relative=off, rms_relative=rms, **how,
        )  # fmt: skip


def _one_shot(task: DesignTask, effort: Effort) -> DesignRun:
    scene, full, order = task.scene, task.scene.expansions.full, task.scene.expansions.order

    def design() -> Any:
        linear = expand(scene.model.pencil, full.q0, full.y0, full.modes, order, linear_in_y=True)
        made = Expansions(full, linear, order, order)
        return assign_design(replace(scene, expansions=made), task.wanted)

    found, spent = measure(design, effort)
    how = {"order": order, "q0": full.q0, "y0": full.y0}
    return task.reached(spent, 1, found.y, parameters=how)


def _sequential(task: DesignTask, effort: Effort) -> DesignRun:
    start, most = np.clip(task.scene.initial, *task.scene.bounds), task.scene.file.assignment.steps
    problem = task.variant.problem
    found, spent = measure(lambda: minimise(problem, start, most), effort)
    solves, how = found.appraisals * len(task.scene.path.q), {"designs judged": found.appraisals}
    return task.reached(spent, solves, found.y, parameters=how)


def _several_starts(task: DesignTask) -> DesignRun:
    """Run once: it takes as long as the others in sum."""
    begun = perf_counter()
    found = find_optimum(task.scene, task.wanted, (), lambda line: None)
    seconds = perf_counter() - begun
    spent, how = Timing(seconds, seconds, seconds, 0), {"starts": found.starts}
    return task.reached(spent, found.exact_solves, found.best.y, parameters=how)


# --- Searches on exact eigenvalues, over z in [0, 1]^n of the parameters with room


def _search(task: DesignTask, most: int, search: Callable[..., None]) -> DesignRun:
    """Run once: its trace says how it went. A design counts as the best if it keeps the limits."""
    variant, q = task.variant, task.scene.path.q
    problem, asked, box = variant.problem, variant.requirements, UnitBox.of(variant.problem)
    start = box.z(np.clip(task.scene.initial, problem.lower, problem.upper))
    best, trace, calls, begun = (np.inf, start), list[tuple[float, float]](), 0, perf_counter()

    def objective(z: Floats, sloped: bool) -> Any:
        nonlocal best, calls
        if calls >= most:
            raise SpentError
        calls += 1
        inside = np.clip(z, 0.0, 1.0)
        y = box.y(inside)
        if sloped:
            seen = problem.appraise(y)
        else:
            hz = task.scene.model.frequencies(q, y, asked.modes)
            seen = asked.appraise(y, Frequencies(hz, np.zeros((*hz.shape, len(y)))))
        value, row = problem(y, seen), box.rows @ inside
        slack = 1e-8 * (1.0 + np.abs(row))  # rounding
        kept = (row >= box.row_lower - slack) & (row <= box.row_upper + slack)
        if value < best[0] and kept.all():
            best = value, inside
            trace.append((perf_counter() - begun, value))
        slopes = 2.0 * (seen.residual @ seen.slopes)[box.free] * box.width + box.prices
        return (value, slopes) if sloped else value

    limits = LinearConstraint(box.rows, box.row_lower, box.row_upper)
    note = ""
    try:
        search(
            objective, start, bounds=Bounds(np.zeros(box.n), np.ones(box.n)),
            constraints=(limits,) if len(box.rows) else (),
        )  # fmt: skip
    except SpentError:
        note = "stopped: no evaluation left"
    seconds, how = perf_counter() - begun, {"evaluations": calls, "most": most}
    spent, y = Timing(seconds, seconds, seconds, 0), box.y(best[1])
    more = {"ours": False, "parameters": how, "trace": tuple(trace), "note": note}
    return task.reached(spent, calls * len(q), y, **more)


def _slsqp(analytic: bool, objective: Any, start: Floats, **how: Any) -> None:
    how |= {"jac": analytic or None, "options": {"ftol": 1e-12, "maxiter": 100}}
    minimize(objective, start, (analytic,), method="SLSQP", **how)


def _evolution(objective: Any, start: Floats, **how: Any) -> None:
    """Until the evaluations are used up, without polishing."""
    how |= {"seed": SEED, "popsize": 8, "tol": 1e-10, "polish": False}
    differential_evolution(objective, args=(False,), x0=start, **how)
