"""Searches for the optimal design on exact eigenvalues by SciPy.

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

Floats = NDArray[np.float64]
SEED = 20211204


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
