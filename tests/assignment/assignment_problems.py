"""Problems and an independent oracle shared by the tests of the assignment."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.optimize import lsq_linear

from eigassign.assignment import (
    AssignedFrequency,
    LinearModel,
    hz_from_lam,
    lam_from_hz,
    trapezoidal_weights,
)


@dataclass(frozen=True)
class Problem:
    goals: list
    time_s: np.ndarray
    y0: np.ndarray
    y_initial: np.ndarray
    lower: np.ndarray
    upper: np.ndarray

    @property
    def bounds(self):
        return (self.lower, self.upper)

    @property
    def weights(self):
        return trapezoidal_weights(self.time_s)

    @property
    def arguments(self):
        return self.goals, self.weights, self.y0, self.y_initial, self.bounds


class Goal(NamedTuple):
    """A wanted frequency with the linear model of its mode, as the program takes them."""

    wanted: AssignedFrequency
    model: LinearModel

    @property
    def target_hz(self):
        return self.wanted.hz

    @property
    def lam_d(self):
        return lam_from_hz(self.wanted.hz)

    @property
    def weight(self):
        return self.wanted.weight


def wanted(target_hz, rows=slice(None), **more):
    return AssignedFrequency(
        "mode 1", "targets[0]", ((1, 1.0),), rows, target_hz, target_hz, **more
    )


def goal(l0, slope, lam_d, weight=1.0, rows=slice(None)):
    l0 = np.atleast_1d(np.asarray(l0, dtype=float))
    target = hz_from_lam(np.broadcast_to(np.asarray(lam_d, dtype=float), l0.shape))
    model = LinearModel(l0, np.asarray(slope, dtype=float))
    return Goal(wanted(target, rows, weight=weight), model)


def random_problem(seed, n_y=None, n_t=None):
    """λ between 1e4 and 1e14, each y on a scale of its own between 1e-9 and 1e9."""
    rng = np.random.default_rng(seed)
    n_y = n_y or int(rng.integers(1, 7))
    n_t = n_t or int(rng.integers(n_y + 2, 40))
    lam, unit = 10.0 ** rng.uniform(4, 14), 10.0 ** rng.uniform(-9, 9, n_y)
    lower, upper = -unit * rng.uniform(0.05, 1, n_y), unit * rng.uniform(0.05, 1, n_y)
    y_initial = rng.uniform(lower, upper)
    goals = [
        goal(
            lam * (1 + 0.3 * rng.normal(size=n_t)),
            lam * rng.normal(size=(n_t, n_y)) / unit,
            lam * rng.uniform(0.7, 1.3, n_t),
            weight=rng.uniform(0.2, 5),
        )
        for _ in range(int(rng.integers(1, 4)))
    ]
    time_s = np.cumsum(rng.uniform(0.1, 2.0, n_t))
    return Problem(goals, time_s, rng.normal(size=n_y) * unit, y_initial, lower, upper)


def bounded_least_squares(problem):
    """The same optimum by scipy's bounded-variable least squares, on rows written out by hand.

    Works in units of the ranges, as the oracle too wants O(1) numbers.
    """
    t, width = problem.time_s, problem.upper - problem.lower
    rows, right = [], []
    for g in problem.goals:
        for k in range(t.size):
            before, after = t[max(k - 1, 0)], t[min(k + 1, t.size - 1)]
            root = np.sqrt(g.weight * (0.5 * (after - before) if t.size > 1 else 1.0))
            lam_d = (2 * np.pi * g.target_hz[k]) ** 2
            rows.append(root * g.model.l[k] * width / lam_d)
            at_lower = g.model.l0[k] + g.model.l[k] @ (problem.lower - problem.y0)
            right.append(root * (1.0 - at_lower / lam_d))
    found = lsq_linear(np.array(rows), np.array(right), (0.0, 1.0), method="bvls", tol=1e-15)
    return problem.lower + width * found.x
