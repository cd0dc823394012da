"""The assignment that ways to a design are charted on: exact objective, slopes and limits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment import (
    Bounds,
    LinearConstraint,
    lam_from_hz,
    trapezoidal_weights,
)
from eigassign.study.assignment_study import target_frequencies
from eigassign.study.chart_bench import spread_rows
from eigassign.study.chart_effort import Effort
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Task:
    """The assignment of one case on (perhaps thinned) samples of its trajectory."""

    scene: Scene
    time_s: Floats
    q: Floats
    wanted_hz: tuple[Floats, ...]  # (n_t,) each
    rows: NDArray[np.intp]

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
        weights = trapezoidal_weights(self.time_s)
        total, value = sum(t.weight for t in self.scene.file.targets) * weights.sum(), 0.0
        for target, hz in zip(self.scene.file.targets, self.wanted_hz, strict=True):
            off = lam[:, target.mode - 1] / lam_from_hz(hz) - 1.0
            value += float(target.weight / total * weights @ off**2)
        return value

    def slope(self, lam: Floats, slopes: Floats) -> Floats:
        """∂J/∂y (n_y,) from ∂λ/∂y (n_t, highest mode, n_y)."""
        weights = trapezoidal_weights(self.time_s)
        total = sum(t.weight for t in self.scene.file.targets) * weights.sum()
        value = np.zeros(slopes.shape[2])
        for target, hz in zip(self.scene.file.targets, self.wanted_hz, strict=True):
            lam_d, k = lam_from_hz(hz), target.mode - 1
            off = lam[:, k] / lam_d - 1.0
            value += 2.0 * target.weight / total * (weights * off / lam_d) @ slopes[:, k]
        return value


def task_of(scene: Scene, effort: Effort, solve_s: float) -> Task:
    """All samples, or so few that one exact objective takes about a fortieth of a search."""
    path, wanted = scene.path, target_frequencies(scene.file, scene.path.time_s)
    affordable = max(5, int(effort.searched_s / 40.0 / solve_s))
    rows = spread_rows(len(path.time_s), affordable)
    return Task(scene, path.time_s[rows], path.q[rows], tuple(w[rows] for w in wanted), rows)


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
