"""Time to a design against the exact objective it reaches: programs on expansions, and searches."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment import (
    Assignment,
    Goal,
    LinearModel,
    hz_from_lam,
    relative_error,
    solve_assignment,
)
from eigassign.errors import EigassignError
from eigassign.modal.expansion import expand
from eigassign.study.approximation import Expansions
from eigassign.study.assignment_study import assign_design
from eigassign.study.chart_data import DesignRun, Timing, excess_over
from eigassign.study.chart_effort import Effort, suited
from eigassign.study.chart_gradient import eigenvalue_slopes
from eigassign.study.chart_methods import points_along, reduced_model, solves_per_point
from eigassign.study.chart_search import Limits, Watched, by_evolution, by_gradient, by_kriging
from eigassign.study.chart_task import Task, limits_of, task_of
from eigassign.study.chart_timing import measure
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]
Search = Callable[[Watched, Floats, Limits], None]
ROUNDS = 12  # programs in a row at most
STILL = 1e-7  # of the box: a design that moves less has arrived
MOST_KRIGING = 12  # design parameters up to which Kriging is tried
FEW = 60  # evaluations of a Kriging search: it is for objectives that cost much
CHARTED_ONLY = "charted only"  # `optimize` solves one program, on the expansion
PRECISE_STEP = 1e-4  # of central differences of reduced models, relative to the box


def chart_designs(
    scene: Scene, effort: Effort, solve_s: float, progress: Callable[[str], None]
) -> tuple[tuple[DesignRun, ...], tuple[str, ...]]:
    """Every way to a design; none where the case has no targets or bounds without limit."""
    lower, upper = scene.bounds
    if not scene.file.targets or not len(lower) or not np.isfinite(upper - lower).all():
        return (), ()
    effort = suited(effort, scene.model.n_dof)
    task, runs, notes = task_of(scene, effort, solve_s), [], []
    if len(task.rows) < len(scene.path.time_s):
        notes.append(
            f"designs are charted on {len(task.rows)} of {len(scene.path.time_s)} samples of the "
            "trajectory, for an exact solve takes long"
        )
    for name, make in _ways(task, effort, solve_s):
        progress(f"designing by {name}")
        try:
            runs.append(make())
        except EigassignError as error:
            notes.append(f"no design by {name}: {error}")
    best = min((run.objective for run in runs), default=0.0)
    return tuple(replace(r, excess=excess_over(best, r.objective)) for r in runs), tuple(notes)


def _ways(
    task: Task, effort: Effort, solve_s: float
) -> Iterator[tuple[str, Callable[[], DesignRun]]]:
    yield "program on the expansion", partial(_one_shot, task, effort)
    for m, count, guard in ((2, 1, False), (2, 3, True)):
        if count > max(effort.expansion_points):
            continue
        for rounds, kind in ((1, "program"), (ROUNDS, "programs in a row")):
            name = f"{kind} on reduced m = {m}, {count} point{'s' if count > 1 else ''}"
            yield name, partial(_on_reduced, task, effort, name, (m, count, guard), rounds)
    most = min(effort.objectives, max(1, int(effort.searched_s / (len(task.rows) * solve_s))))
    yield from _searches(task, most)


def _searches(task: Task, most: int) -> Iterator[tuple[str, Callable[[], DesignRun]]]:
    ways: dict[str, Search] = {
        "SLSQP, analytic gradient": partial(by_gradient, analytic=True),
        "SLSQP, finite differences": partial(by_gradient, analytic=False),
        "differential evolution": by_evolution,
    }
    if len(task.box[1]) <= MOST_KRIGING:
        ways["Kriging search"] = by_kriging
    for name, search in ways.items():
        few = min(most, FEW) if search is by_kriging else most
        slopes = name == "SLSQP, analytic gradient"
        yield name, partial(_search, task, name, few, search, slopes)


def _exact(task: Task, y: Floats) -> Floats:
    """λ (n_t, highest mode) at one design."""
    hz = task.scene.model.frequencies(task.q, y, max(task.modes))
    return (2.0 * np.pi * hz) ** 2


def _run(
    task: Task,
    name: str,
    ours: bool,
    parameters: dict[str, object],
    spent: Timing,
    solves: int,
    y: Floats,
    trace: tuple[tuple[float, float], ...] = (),
    note: str = "",
) -> DesignRun:
    lam = _exact(task, y)
    worst, square = 0.0, 0.0
    for target, own in zip(task.scene.file.targets, task.wanted, strict=True):
        hz, weights = hz_from_lam(lam[own.rows, target.mode - 1]), task.weights[own.rows]
        off = relative_error(hz, own.hz, weights)
        worst = max(worst, off.max_relative)
        square += target.weight * weights.sum() / task.total_s * off.rms_relative**2
    value = task.objective(lam)
    return DesignRun(
        name, ours, parameters, spent, solves, tuple(y.tolist()), value, worst, square**0.5, 0.0,
        trace, note,
    )  # fmt: skip


def _one_shot(task: Task, effort: Effort) -> DesignRun:
    """`optimize`'s own way: expand, linearise, one quadratic program."""
    scene, full = task.scene, task.scene.expansions.full
    order = scene.expansions.order
    point = (scene.model.pencil, full.q0, full.y0, full.modes)

    def design() -> Assignment:
        linear = expand(*point, order, linear_in_y=True)
        made = Expansions(full, linear, order, order)
        return assign_design(replace(scene, expansions=made, trajectory=task.path), task.wanted)

    found, spent = measure(design, effort.patience)
    parameters: dict[str, object] = {"order": order, "q0": full.q0, "y0": full.y0}
    return _run(task, "program on the expansion", True, parameters, spent, 1, found.y)


def _on_reduced(
    task: Task, effort: Effort, name: str, kind: tuple[int, int, bool], rounds: int
) -> DesignRun:
    """Programs linearised anew at each other's optimum, all on one reduced model."""
    scene, (m, count, guard) = task.scene, kind
    q, y = points_along(scene, count)

    def design() -> tuple[Floats, int]:
        made = reduced_model(scene, m, q, y, guard)

        def lam(at: Floats) -> Floats:
            hz = made.frequencies(task.q, at)
            return (2.0 * np.pi * hz) ** 2

        return _programs(task, lam, list(made.modes), rounds)

    (found, programs), spent = measure(design, effort.patience)
    parameters: dict[str, object] = {
        "half_order": m, "q": q, "y": y, "guard": guard, "programs": programs,
    }  # fmt: skip
    solves = len(q) * solves_per_point(scene, m, guard)
    return _run(task, name, True, parameters, spent, solves, found, note=CHARTED_ONLY)


def _programs(
    task: Task, lam: Callable[[Floats], Floats], columns: list[int], rounds: int
) -> tuple[Floats, int]:
    """Gauss-Newton: the quadratic program of the model linearised at y, until y stays."""
    lower, width = task.box
    y = task.scene.expansions.full.y0
    bounds, constraints, names = limits_of(task.scene)
    done, moved = 0, np.inf
    while done < rounds and moved >= STILL:
        l0, slope = _linearised(lam, y, width)
        goals = [
            Goal(LinearModel(l0[own.rows, k], slope[own.rows, k]), own.hz, target.weight, own.rows)
            for target, own in zip(task.scene.file.targets, task.wanted, strict=True)
            for k in [columns.index(target.mode)]
        ]
        found = solve_assignment(
            goals, task.weights, y, np.clip(y, *task.scene.bounds), bounds, constraints, names
        )
        moved = float((np.abs(found.y - y) / np.where(width > 0.0, width, 1.0)).max())
        y, done = found.y, done + 1
    return np.clip(y, lower, lower + width), done


def _linearised(lam: Callable[[Floats], Floats], y: Floats, width: Floats) -> tuple[Floats, Floats]:
    """λ (n_t, n_modes) and ∂λ/∂y (n_t, n_modes, n_y) by central differences."""
    l0 = lam(y)
    slope = np.zeros((*l0.shape, len(y)))
    for j in np.flatnonzero(width > 0.0):
        step = np.zeros(len(y))
        step[j] = PRECISE_STEP * width[j]
        slope[:, :, j] = (lam(y + step) - lam(y - step)) / (2.0 * step[j])
    return l0, slope


def _search(task: Task, name: str, most: int, search: Search, slopes: bool) -> DesignRun:
    """A search on exact eigenvalues, run once: its trace says how it went."""
    lower, width = task.box
    limits = _unit_limits(task)
    count = max(task.modes)

    def objective(v: Floats) -> tuple[float, Floats | None]:
        y = lower + width * v
        if not slopes:
            return task.objective(_exact(task, y)), None
        x = task.scene.model.x(task.q, y)
        lam, rates = eigenvalue_slopes(task.scene.model.pencil, x, count, width)
        return task.objective(lam), task.slope(lam, rates) * width

    start = np.clip((task.scene.initial - lower) / np.where(width > 0.0, width, 1.0), 0.0, 1.0)
    watched = Watched(objective, limits.met, most)
    begun = perf_counter()
    search(watched, start, limits)
    seconds = perf_counter() - begun
    spent = Timing(seconds, seconds, seconds, 0)
    y = lower + width * (start if watched.design is None else watched.design)
    stopped = "stopped: no evaluation left" if watched.calls >= most else ""
    parameters: dict[str, object] = {"evaluations": watched.calls, "most": most}
    return _run(
        task, name, False, parameters, spent, watched.calls * len(task.q), y,
        tuple(watched.trace), stopped,
    )  # fmt: skip


def _unit_limits(task: Task) -> Limits:
    """The case's linear constraints over v, y = lower + width v."""
    lower, width = task.box
    _, constraints, _ = limits_of(task.scene)
    C = np.array([c.coefficients for c in constraints]).reshape(len(constraints), len(lower))
    base = C @ lower
    return Limits(
        C * width,
        np.array([c.lower for c in constraints]) - base,
        np.array([c.upper for c in constraints]) - base,
    )
