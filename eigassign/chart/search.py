"""Searches for the optimal design on exact eigenvalues: SciPy's, and one by Kriging.

All minimise J(v) over v in [0, 1]^n; the objective itself counts and times its evaluations.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from time import perf_counter
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, LinearConstraint, differential_evolution, minimize

from eigassign.chart.rivals import Kriging, fit_kriging, spread_points

Floats = NDArray[np.float64]
Objective = Callable[[Floats], float]
SEED = 20211204
CANDIDATES = 400  # designs among which Kriging looks for the next one


class SpentError(Exception):
    """The evaluations that a search may make are used up."""


@dataclass
class Watched:
    """An objective that remembers its best design, and when it was found."""

    objective: Callable[[Floats], tuple[float, Floats | None]]
    allowed: Callable[[Floats], NDArray[np.bool_]]
    most: int
    start: float = field(default_factory=perf_counter)
    calls: int = 0
    best: float = np.inf
    design: Floats | None = None
    trace: list[tuple[float, float]] = field(default_factory=list)

    def __call__(self, v: Floats) -> float:
        """J(v); raises SpentError when no evaluation is left."""
        return self.with_slope(v)[0]

    def with_slope(self, v: Floats) -> tuple[float, Floats | None]:
        """J(v) and its gradient, where the objective has one."""
        if self.calls >= self.most:
            raise SpentError
        self.calls += 1
        value, slope = self.objective(np.clip(v, 0.0, 1.0))
        if value < self.best and self.allowed(v):
            self.best, self.design = value, np.clip(v, 0.0, 1.0)
            self.trace.append((perf_counter() - self.start, value))
        return value, slope


@dataclass(frozen=True)
class Limits:
    """lower ≤ C v ≤ upper, on v in [0, 1]^n."""

    C: Floats
    lower: Floats
    upper: Floats

    def met(self, v: Floats) -> NDArray[np.bool_]:
        """Whether designs v (…, n) keep them, up to rounding."""
        row = v @ self.C.T
        slack = 1e-8 * (1.0 + np.abs(row))
        return np.asarray(((row >= self.lower - slack) & (row <= self.upper + slack)).all(axis=-1))


def by_gradient(watched: Watched, start: Floats, limits: Limits, analytic: bool) -> None:
    """SLSQP from ``start``, with the objective's own gradient or with finite differences."""
    rest: dict[str, Any] = {
        "method": "SLSQP",
        "bounds": Bounds(np.zeros(len(start)), np.ones(len(start))),
        "constraints": _constraints(limits),
        "options": {"ftol": 1e-12, "maxiter": 100},
    }
    try:
        if analytic:
            minimize(_sloped(watched), start, jac=True, **rest)
        else:
            minimize(watched, start, **rest)
    except SpentError:
        return


def _sloped(watched: Watched) -> Callable[[Floats], tuple[float, Floats]]:
    def both(v: Floats) -> tuple[float, Floats]:
        value, slope = watched.with_slope(v)
        return value, np.zeros(len(v)) if slope is None else slope

    return both


def _constraints(limits: Limits) -> Any:
    return (LinearConstraint(limits.C, limits.lower, limits.upper),) if len(limits.C) else ()


def by_evolution(watched: Watched, start: Floats, limits: Limits) -> None:
    """SciPy's differential evolution, without polishing, until the evaluations are used up."""
    try:
        differential_evolution(
            watched,
            Bounds(np.zeros(len(start)), np.ones(len(start))),
            x0=start,
            seed=SEED,
            popsize=8,
            tol=1e-10,
            polish=False,
            constraints=_constraints(limits),
        )
    except SpentError:
        return


def by_kriging(watched: Watched, start: Floats, limits: Limits) -> None:
    """Efficient global optimisation: Kriging of log J, and the largest expected improvement."""
    random = np.random.default_rng(SEED)
    n = len(start)
    designs = [start, *spread_points(4 * n + 4, n)]
    designs = [v for v in designs if limits.met(v)]
    try:
        values = [watched(v) for v in designs]
        while True:
            u, f = np.array(designs), np.log(np.array(values))
            chosen = _improving(fit_kriging(u, f, starts=1), f, random, limits)
            designs.append(chosen)
            values.append(watched(chosen))
    except SpentError:
        return


def _improving(model: Kriging, f: Floats, random: np.random.Generator, limits: Limits) -> Floats:
    """The candidate of largest expected improvement: all over the box, and around the best."""
    from scipy.special import ndtr

    n, best = model.u.shape[1], model.u[int(np.argmin(f))]
    near = best + random.normal(0.0, 1.0, (CANDIDATES, n)) * 10.0 ** random.uniform(
        -4, -1, (CANDIDATES, 1)
    )
    every = np.clip(np.vstack([random.random((CANDIDATES, n)), near]), 0.0, 1.0)
    every = every[limits.met(every)]
    every = every if len(every) else best[None]
    mean, sigma = model(every), np.maximum(model.deviation(every), 1e-12)
    z = (f.min() - mean) / sigma
    gain = sigma * (z * ndtr(z) + np.exp(-0.5 * z * z) / np.sqrt(2.0 * np.pi))
    return np.asarray(every[int(np.argmax(gain))])
