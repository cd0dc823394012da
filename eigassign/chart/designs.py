"""Ways to a design, the paper's, eigassign's and SciPy's: time against the objective of each.

The objective is the one that `optimize` makes small, F of `assignment.exact.design_problem`: the
mean square of f/f_d − 1 with the weights of targets and time, by exact eigenvalues.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, LinearConstraint, differential_evolution, minimize

from eigassign.assignment.exact.design_problem import UnitBox
from eigassign.assignment.exact.sequential import minimise
from eigassign.assignment.requirements.sampling import requirements_of
from eigassign.chart.question import SEED, Effort, measure
from eigassign.chart.results import DesignRun, excess_over
from eigassign.errors import EigassignError
from eigassign.modal.expansion import NearestExpansion, expand
from eigassign.study.design.answer import assign_design
from eigassign.study.design.search.optimum import find_optimum
from eigassign.study.design.search.variants import Task, variant_of
from eigassign.study.scene import Expansions, Scene

Floats = NDArray[np.float64]
# Design, exact solves, parameters, and of a search its trace and a note
Reached = tuple[Floats, int, dict[str, Any], dict[str, Any]]
SLSQP: dict[str, Any] = {"method": "SLSQP", "options": {"ftol": 1e-12, "maxiter": 100}}
EVOLUTION: dict[str, Any] = {"seed": SEED, "popsize": 8, "tol": 1e-10, "polish": False}


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
    wanted, design = scene.file.targets, scene.file.design
    plain = (t.is_goal and not (t.followed or t.during) for t in wanted)
    limited = bool(design.catalogues or design.mass or design.torque)
    keys = scene.file.assignment
    limited = limited or keys.objective != "least_squares" or keys.robust
    if not (wanted and all(plain) and len(lower) and np.isfinite(upper - lower).all()) or limited:
        return (), ()
    if scene.path.follows_design:
        return (), ("searches of a design are left out: the coordinates follow the design",)
    path = scene.path.chosen(scene.path.spread(max(5, int(effort.most_s / 40.0 / solve_s))))
    runs, notes, samples = list[DesignRun](), list[str](), len(scene.path.q)
    if len(path.q) < samples:
        few = f"searches of a design see {len(path.q)} of {samples} samples"
        notes.append(f"{few}, because an exact solve takes long")
    task = Task(replace(scene, trajectory=path), requirements_of(scene.file, path))
    most = min(effort.objectives, max(1, int(effort.most_s / (len(path.q) * solve_s))))
    ways: dict[str, Callable[[Task], Reached]] = {
        "one shot": _one_shot,
        "sequential": _sequential,
        "sequential, several starts": _several_starts,
        "SLSQP, analytic gradient": partial(_search, most, minimize, {**SLSQP, "jac": True}),
        "SLSQP, finite differences": partial(_search, most, minimize, SLSQP),
        "differential evolution": partial(_search, most, differential_evolution, EVOLUTION),
    }
    for name, way in ways.items():
        progress(f"designing by {name}")
        try:
            (y, solves, told, more), seconds = measure(partial(way, task), effort)
            posed = variant_of(task, ())
            seen = posed.problem.appraise(y)
        except EigassignError as error:
            notes.append(f"no design by {name}: {error}")
            continue
        curves = posed.requirements.curves(seen)
        off = max(float(np.abs(hz / own.hz - 1.0).max()) for own, hz, _ in curves)
        value, rms = posed.problem(y, seen), float(np.linalg.norm(seen.residual))
        at = tuple(y.tolist())
        run = DesignRun(name, not more, told, seconds, solves, at, value, off, rms, 0.0, **more)
        runs.append(run)
    best = min((run.objective for run in runs), default=0.0)
    return tuple(replace(r, excess=excess_over(best, r.objective)) for r in runs), tuple(notes)


def _one_shot(task: Task) -> Reached:
    scene, full, order = task.scene, task.scene.expansions.full, task.scene.expansions.order
    linear = expand(scene.model.pencil, full.q0, full.y0, full.modes, order, linear_in_y=True)
    both = NearestExpansion((full,)), NearestExpansion((linear,))
    expanded = replace(scene, expanded=Expansions(*both, order, order))
    told = {"order": order, "q0": full.q0, "y0": full.y0}
    return assign_design(expanded, task.wanted).y, 1, told, {}


def _sequential(task: Task) -> Reached:
    """A problem of its own, for it remembers the answers at designs that it has seen."""
    scene = task.scene
    start = np.clip(scene.initial, *scene.bounds)
    found = minimise(variant_of(task, ()).problem, start, scene.file.assignment.steps)
    solves = found.appraisals * len(scene.path.q)
    return found.y, solves, {"designs judged": found.appraisals}, {}


def _several_starts(task: Task) -> Reached:
    found = find_optimum(task.scene, task.wanted, (), lambda line: None)
    return found.best.y, found.exact_solves, {"starts": found.starts}, {}


def _search(most: int, search: Callable[..., Any], how: dict[str, Any], task: Task) -> Reached:
    """SciPy's ``search`` on exact eigenvalues over z in [0, 1]^n of the parameters with room.

    A design counts as the best if it keeps the limits.
    """
    posed, begun = variant_of(task, ()), time.process_time()
    problem, box = posed.problem, UnitBox.of(posed.problem)
    start = box.z(np.clip(task.scene.initial, problem.lower, problem.upper))
    best, trace, calls, note = (np.inf, start), list[tuple[float, float]](), 0, ""

    def objective(z: Floats) -> Any:
        nonlocal best, calls
        if calls >= most:
            raise SpentError
        calls += 1
        inside = np.clip(z, 0.0, 1.0)
        y = box.y(inside)
        seen = problem.appraise(y) if "jac" in how else posed.without_slopes(y)
        value, row = problem(y, seen), box.rows @ inside
        missed = np.abs(row - np.clip(row, box.row_lower, box.row_upper))
        if value < best[0] and np.all(missed <= 1e-8 * (1.0 + np.abs(row))):  # rounding
            best = value, inside
            trace.append((time.process_time() - begun, value))
        slopes = 2.0 * (seen.residual @ seen.slopes)[box.free] * box.width
        slopes += problem.cost_slopes(y)[box.free] * box.width
        return (value, slopes) if "jac" in how else value

    limits = (LinearConstraint(box.rows, box.row_lower, box.row_upper),) if len(box.rows) else ()
    bounds = Bounds(np.zeros(box.n), np.ones(box.n))
    try:
        search(objective, x0=start, bounds=bounds, constraints=limits, **how)
    except SpentError:
        note = "stopped: no evaluation left"
    told, more = {"evaluations": calls, "most": most}, {"trace": tuple(trace), "note": note}
    return box.y(best[1]), calls * len(task.scene.path.q), told, more
