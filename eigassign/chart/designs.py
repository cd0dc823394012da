"""Ways to a design: time against the exact objective that each reaches.

    one shot                       the paper's: expand, linearise, one quadratic program
    sequential                     `optimize`'s programs in a row, from the initial design
    sequential, several starts     all that `optimize` does to find the optimum
    SLSQP, differential evolution  SciPy's searches on exact eigenvalues

The objective is the one that `optimize` makes small, F of `assignment.exact.design_problem`: the
mean square of f/f_d − 1 with the weights of targets and time.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, LinearConstraint, differential_evolution, minimize

from eigassign.assignment.exact.design_problem import UnitBox
from eigassign.assignment.exact.requirements import Frequencies
from eigassign.assignment.exact.sequential import minimise
from eigassign.case.schema.targets import FrequencyTarget
from eigassign.chart.question import SEED
from eigassign.chart.results import DesignRun, Timing, excess_over
from eigassign.chart.timing import Effort, measure
from eigassign.errors import EigassignError
from eigassign.modal.expansion import expand
from eigassign.study.design.one_shot import assign_design
from eigassign.study.design.optimum import find_optimum
from eigassign.study.design.variants import PosedProblem, Task, variant_of
from eigassign.study.requirements.requirement import Requirement
from eigassign.study.requirements.sampling import requirements_of
from eigassign.study.scene import Expansions, Scene

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
    wanted, design = scene.file.targets, scene.file.design
    plain = (isinstance(t, FrequencyTarget) and not (t.followed or t.during) for t in wanted)
    limited = design.catalogues or design.mass or scene.file.assignment.objective != "least_squares"
    if not (wanted and all(plain) and len(lower) and np.isfinite(upper - lower).all()) or limited:
        return (), ()
    if scene.path.follows_design:
        return (), ("no designs are charted where the coordinates follow the design",)
    rows = scene.path.spread(max(5, int(effort.most_s / 40.0 / solve_s)))
    path, runs, notes = scene.path.chosen(rows), list[DesignRun](), list[str]()
    if len(path.q) < len(scene.path.q):
        few = f"designs are charted on {len(path.q)} of {len(scene.path.q)} samples"
        notes.append(f"{few} of the trajectory, for an exact solve takes long")
    thinned, targets = replace(scene, trajectory=path), requirements_of(scene.file, path)
    posed = variant_of(Task(thinned, targets, 0.0), ())
    most = min(effort.objectives, max(1, int(effort.most_s / (len(path.q) * solve_s))))
    ways = {
        "one shot": partial(_one_shot, thinned, targets, effort),
        "sequential": partial(_sequential, thinned, posed, effort),
        "sequential, several starts": partial(_several_starts, thinned, targets),
        "SLSQP, analytic gradient": partial(_search, thinned, posed, most, partial(_slsqp, True)),
        "SLSQP, finite differences": partial(_search, thinned, posed, most, partial(_slsqp, False)),
        "differential evolution": partial(_search, thinned, posed, most, _evolution),
    }
    for name, way in ways.items():
        progress(f"designing by {name}")
        try:
            y, spent, solves, how, more = way()
            seen = posed.problem.appraise(y)
        except EigassignError as error:
            notes.append(f"no design by {name}: {error}")
            continue
        curves = zip(posed.requirements.curves(seen), targets, strict=True)
        off = max(float(np.abs(hz / own.hz - 1.0).max()) for (hz, _), own in curves)
        value, rms = posed.problem(y, seen), float(np.linalg.norm(seen.residual))
        run = DesignRun(
            name, not more, how, spent, solves, tuple(y.tolist()), value, off, rms, 0.0, **more
        )
        runs.append(run)
    best = min((run.objective for run in runs), default=0.0)
    return tuple(replace(r, excess=excess_over(best, r.objective)) for r in runs), tuple(notes)


# Design, time, exact solves, parameters, and of a search how it went
_Reached = tuple[Floats, Timing, int, dict[str, Any], dict[str, Any]]


def _one_shot(scene: Scene, targets: tuple[Requirement, ...], effort: Effort) -> _Reached:
    full, order = scene.expansions.full, scene.expansions.order

    def design() -> Any:
        linear = expand(scene.model.pencil, full.q0, full.y0, full.modes, order, linear_in_y=True)
        return assign_design(
            replace(scene, expansions=Expansions(full, linear, order, order)), targets
        )

    found, spent = measure(design, effort)
    return found.y, spent, 1, {"order": order, "q0": full.q0, "y0": full.y0}, {}


def _sequential(scene: Scene, posed: PosedProblem, effort: Effort) -> _Reached:
    start, most = np.clip(scene.initial, *scene.bounds), scene.file.assignment.steps
    found, spent = measure(lambda: minimise(posed.problem, start, most), effort)
    how = {"designs judged": found.appraisals}
    return found.y, spent, found.appraisals * len(scene.path.q), how, {}


def _several_starts(scene: Scene, targets: tuple[Requirement, ...]) -> _Reached:
    """Run once: it takes as long as the others in sum."""
    begun = perf_counter()
    found = find_optimum(scene, targets, (), lambda line: None)
    return found.best.y, _once(begun), found.exact_solves, {"starts": found.starts}, {}


def _once(begun: float) -> Timing:
    seconds = perf_counter() - begun
    return Timing(seconds, seconds, seconds, 0)


def _search(scene: Scene, posed: PosedProblem, most: int, search: Callable[..., None]) -> _Reached:
    """A search on exact eigenvalues over z in [0, 1]^n of the parameters with room.

    Run once: its trace says how it went. A design counts as the best if it keeps the limits.
    """
    problem, asked, q, box = (
        posed.problem,
        posed.requirements,
        scene.path.q,
        UnitBox.of(posed.problem),
    )
    start = box.z(np.clip(scene.initial, problem.lower, problem.upper))
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
            hz = scene.model.frequencies(q, y, asked.modes)
            seen = asked.appraise(y, Frequencies(hz, np.zeros((*hz.shape, len(y)))))
        value, row = problem(y, seen), box.rows @ inside
        slack = 1e-8 * (1.0 + np.abs(row))  # rounding
        kept = (row >= box.row_lower - slack) & (row <= box.row_upper + slack)
        if value < best[0] and kept.all():
            best = value, inside
            trace.append((perf_counter() - begun, value))
        slopes = 2.0 * (seen.residual @ seen.slopes)[box.free] * box.width + box.prices
        return (value, slopes) if sloped else value

    bounds, limits, note = Bounds(np.zeros(box.n), np.ones(box.n)), [], ""
    if len(box.rows):
        limits.append(LinearConstraint(box.rows, box.row_lower, box.row_upper))
    try:
        search(objective, start, bounds=bounds, constraints=tuple(limits))
    except SpentError:
        note = "stopped: no evaluation left"
    how, more = {"evaluations": calls, "most": most}, {"trace": tuple(trace), "note": note}
    return box.y(best[1]), _once(begun), calls * len(q), how, more


def _slsqp(analytic: bool, objective: Any, start: Floats, **how: Any) -> None:
    how |= {"jac": analytic or None, "options": {"ftol": 1e-12, "maxiter": 100}}
    minimize(objective, start, (analytic,), method="SLSQP", **how)


def _evolution(objective: Any, start: Floats, **how: Any) -> None:
    """Search until the evaluations are used up, without polishing."""
    how |= {"seed": SEED, "popsize": 8, "tol": 1e-10, "polish": False}
    differential_evolution(objective, args=(False,), x0=start, **how)
