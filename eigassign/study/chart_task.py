"""The assignment that ways to a design are charted on: exact objective, slopes and limits."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment import Bounds, LinearConstraint, lam_from_hz
from eigassign.mechanism.trajectories import Trajectories
from eigassign.study.assignment_study import Wanted, target_frequencies, time_weights
from eigassign.study.chart_effort import Effort
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]


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
