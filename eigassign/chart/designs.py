"""Time to a design against the exact objective it reaches: programs on expansions, and searches.

The assignment that ways to a design are charted on: exact objective, slopes and limits.

Exact eigenvalues with their analytic derivatives over the design parameters.

    ∂λ/∂y = φᵀ (∂K/∂y − λ ∂M/∂y) φ,   φᵀ M φ = 1,

with ∂K = Σ_j K_j ∂θ_j: no further eigensolve. The coefficient functions θ are differentiated by
central differences of θ alone, which is cheap and accurate to about 1e-10; of parameters without
room the derivatives are left at 0.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property, partial
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment import (
    Assignment,
    Bounds,
    Goal,
    LinearConstraint,
    LinearModel,
    hz_from_lam,
    lam_from_hz,
    relative_error,
    solve_assignment,
)
from eigassign.chart.effort import Effort, suited
from eigassign.chart.methods import points_along, reduced_model, solves_per_point
from eigassign.chart.results import DesignRun, Timing, excess_over
from eigassign.chart.search import Limits, Watched, by_evolution, by_gradient
from eigassign.chart.timing import measure
from eigassign.errors import EigassignError
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.mechanism.trajectory.trajectory import Trajectories
from eigassign.modal.exact.solver import modes_at
from eigassign.modal.expansion import expand
from eigassign.study.assignment import Wanted, assign_design, target_frequencies, time_weights
from eigassign.study.scene import Expansions, Scene

# --- Time to a design against the exact objective it reaches: programs on expansions, and searc

Floats = NDArray[np.float64]
Search = Callable[[Watched, Floats, Limits], None]
ROUNDS = 12  # programs in a row at most
STILL = 1e-7  # of the box: a design that moves less has arrived
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
    for name, search in ways.items():
        slopes = name == "SLSQP, analytic gradient"
        yield name, partial(_search, task, name, most, search, slopes)


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


# --- The assignment that ways to a design are charted on: exact objective, slopes and limits


@dataclass(frozen=True, eq=False)
class Task:
    """The assignment of one case on (perhaps thinned) samples of its trajectory."""

    scene: Scene
    path: Trajectories  # with these samples only
    wanted: tuple[Wanted, ...]  # at them
    rows: NDArray[np.intp]

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
        pairs = zip(self.scene.file.targets, self.wanted, strict=True)
        return float(sum(t.weight * self.weights[own.rows].sum() for t, own in pairs))

    @property
    def modes(self) -> tuple[int, ...]:
        """Of the targets, in their order."""
        return tuple(target.mode for target in self.scene.file.targets)

    @property
    def box(self) -> tuple[Floats, Floats]:
        """Lower bound and width of y."""
        lower, upper = self.scene.bounds
        return lower, upper - lower

    def objective(self, lam: Floats) -> float:
        """J, the weighted mean square of the relative error in λ; lam (n_t, highest mode)."""
        value = 0.0
        for target, own in zip(self.scene.file.targets, self.wanted, strict=True):
            off = lam[own.rows, target.mode - 1] / lam_from_hz(own.hz) - 1.0
            value += float(target.weight / self.total_s * self.weights[own.rows] @ off**2)
        return value

    def slope(self, lam: Floats, slopes: Floats) -> Floats:
        """∂J/∂y (n_y,) from ∂λ/∂y (n_t, highest mode, n_y)."""
        value = np.zeros(slopes.shape[2])
        for target, own in zip(self.scene.file.targets, self.wanted, strict=True):
            lam_d, k = lam_from_hz(own.hz), target.mode - 1
            push = self.weights[own.rows] * (lam[own.rows, k] / lam_d - 1.0) / lam_d
            value += 2.0 * target.weight / self.total_s * push @ slopes[own.rows, k]
        return value


def task_of(scene: Scene, effort: Effort, solve_s: float) -> Task:
    """All samples, or so few that one exact objective takes about a fortieth of a search."""
    affordable = max(5, int(effort.searched_s / 40.0 / solve_s))
    rows = scene.path.spread(affordable)
    path = scene.path.chosen(rows)
    return Task(scene, path, target_frequencies(scene.file, path), rows)


def limits_of(scene: Scene) -> tuple[Bounds, list[LinearConstraint], tuple[str, ...]]:
    """Bounds, linear constraints and names of the design parameters, as programs want them."""
    names = tuple(scene.file.design.parameters)
    constraints = [
        LinearConstraint(
            name,
            np.array([c.terms.get(parameter, 0.0) for parameter in names]),
            -np.inf if c.min is None else c.min,
            np.inf if c.max is None else c.max,
        )
        for name, c in scene.file.design.constraints.items()
    ]
    return Bounds(*scene.bounds), constraints, names


# --- Exact eigenvalues with their analytic derivatives over the design parameters

STEP = 1e-5  # of a central difference, relative to a parameter's range


def theta_slopes(pencil: Pencil, x: Floats, ranges: Floats) -> Floats:
    """∂θ/∂y (n_y, n_theta, n) at samples x (n, n_x); ``ranges`` (n_y,) set the steps."""
    slopes = []
    for j, size in enumerate(ranges):
        if size == 0.0:  # a parameter that is kept
            slopes.append(np.zeros((pencil.n_theta, len(x))))
            continue
        step = np.zeros(x.shape[1])
        step[pencil.n_q + j] = STEP * size
        slopes.append((pencil.theta(x + step) - pencil.theta(x - step)) / (2.0 * STEP * size))
    return np.array(slopes)


def eigenvalue_slopes(
    pencil: Pencil, x: Floats, count: int, ranges: Floats
) -> tuple[Floats, Floats]:
    """λ (n, count) and ∂λ/∂y (n, count, n_y) of the lowest elastic modes at x (n, n_x)."""
    theta = pencil.theta(x)
    found = modes_at(pencil, theta, count)
    slopes = theta_slopes(pencil, x, ranges)
    moving = np.flatnonzero(np.abs(slopes).max(axis=(0, 2)) > 0.0)
    stiffness, mass = pencil.stiffness[:, moving], pencil.mass[:, moving]
    result = np.empty((len(x), count, len(ranges)))
    for mode in range(count):
        phi = found.phi[:, :, mode]
        products = phi[:, pencil.rows] * phi[:, pencil.columns]
        forms = products @ stiffness - found.lam[:, [mode]] * (products @ mass)
        result[:, mode] = np.einsum("nt,jtn->nj", forms, slopes[:, moving])
    return found.lam, result
