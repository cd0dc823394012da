"""The design problem that the sequential method works on: objective, limits, and its units.

What is minimised over the design y is

    F(y) = Σ_k r_k(y)² + c(y)      least squares,      r_k = √ω_k (f_k / f_d,k − 1), or
    F(y) = max_k |r_k(y)| + c(y)   worst case, or
    F(y) = max_k r_k(y) + c(y)     the largest of rows such as −f_k,

with a cost c (`Cost`), bounds, linear constraints, and excesses ≤ 0 (how far inequalities are
missed). Steps and slopes are in units z ∈ [0, 1] of the bounds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from enum import StrEnum
from typing import NamedTuple, TypeVar

import numpy as np

from eigassign.arrays import Floats
from eigassign.assignment.program import LinearConstraint, Program, solve_program
from eigassign.assignment.requirements.requirement import NeighbourPairs

MET = 1e-9  # excess, relative to the inequality's limit, that is round-off
TINY = 1e-11  # rms relative error that is round-off of exact frequencies
ON = 1e-7  # of the bounds or of the limit: this near to a limit is on it
T = TypeVar("T")


class Objective(StrEnum):
    """The measure that is made small: the mean square of the residuals, or the largest.

    The worst case is the largest in magnitude; ``largest`` looks at one sign only.
    """

    LEAST_SQUARES = "least_squares"
    WORST_CASE = "worst_case"
    LARGEST = "largest"


class Cost(NamedTuple):
    """c(y) = p·(y − y_ref) + p_m (m(y) − m_ref) + what is chosen of lists, p_m ≥ 0 and m > 0.

    Of parameters, of a mass, and of choices with a price each, which no slope tells.
    """

    prices: Floats  # (n_y,), per SI unit of y
    reference: Floats  # (n_y,), y that costs nothing
    of_mass: float = 0.0  # p_m
    mass: Callable[[Floats], tuple[float, Floats]] | None = None  # its value and slopes (n_y,)
    free: float = 0.0  # m_ref
    is_affine: bool = True  # but for the choices
    listed: Callable[[Floats], Floats | float] = lambda _y: 0.0  # (n,) of designs (n, n_y) too
    is_time: bool = False  # c is the motion time, s

    def __call__(self, y: Floats) -> tuple[float, Floats]:
        """The cost of a design y (n_y,), and its slopes (n_y,)."""
        value, slopes = float(self.prices @ (y - self.reference) + self.listed(y)), self.prices
        if self.mass is None:
            return value, slopes
        mass, steep = self.mass(y)
        return value + self.of_mass * (mass - self.free), slopes + self.of_mass * steep

    def least(self, lower: Floats, upper: Floats) -> Floats:
        """Costs (n,) that no design between two (n, n_y) is below: of affine c theirs."""
        slopes, constant = self.prices, -self.of_mass * self.free
        if self.mass is not None and self.is_affine:
            mass, steep = self.mass(self.reference)
            slopes, constant = slopes + self.of_mass * steep, constant + self.of_mass * mass
        y = np.where(slopes > 0.0, lower, upper)
        least = (y - self.reference) @ slopes + constant + self.listed(y)
        if not self.is_affine:
            for k in np.flatnonzero((lower == upper).all(axis=1)):
                least[k] = self(y[k])[0]
        return np.asarray(least)


class Appraisal(NamedTuple):
    """A design seen from the targets: residuals (m,) and excesses (k,), with slopes in y.

    ``slopes`` (m, n_y) and ``excess_slopes`` (k, n_y) are per SI unit of y. An excess is relative
    to its limit, and negative where there is room. ``pairs`` are rows that may have a kink.
    """

    residual: Floats
    slopes: Floats
    excess: Floats
    excess_slopes: Floats
    pairs: NeighbourPairs | None = None

    @property
    def violation(self) -> float:
        """The largest excess, 0 if all inequalities hold."""
        return float(np.max(self.excess, initial=0.0))


class DesignProblem(NamedTuple):
    """F and its limits; ``appraise`` may raise EigassignError where a design has no answer."""

    appraise: Callable[[Floats], Appraisal]
    lower: Floats  # (n_y,), finite
    upper: Floats
    constraints: tuple[LinearConstraint, ...] = ()
    cost: Cost | None = None
    objective: Objective = Objective.LEAST_SQUARES

    @property
    def is_squared(self) -> bool:
        """True where squares of residuals are what is made small, not the largest."""
        return self.objective is Objective.LEAST_SQUARES

    @property
    def is_one_sided(self) -> bool:
        """True where residuals are the better the less they are, also below 0."""
        return self.objective is Objective.LARGEST

    @property
    def is_error(self) -> bool:
        """True where F is an error: it cannot be below 0."""
        return self.cost is None and not self.is_one_sided

    def __call__(self, y: Floats, seen: Appraisal) -> float:
        """F of a design and what `appraise` found of it."""
        return self.value(y, seen.residual)

    def value(self, y: Floats, residual: Floats) -> float:
        """F of a design that has these residuals."""
        return self.measure(residual) + self.price(y)

    def least_value(self, lower: Floats, upper: Floats, residual: Floats) -> float:
        """An F that no design between two (n_y,) is below, with residuals that none is below."""
        cost = 0.0 if self.cost is None else self.cost.least(lower[None], upper[None])[0]
        return self.least_measure(residual) + float(cost)

    def least_measure(self, residual: Floats) -> float:
        """`measure` of such residuals; without any nothing is known where it may be < 0."""
        unknown = self.is_one_sided and not len(residual)
        return -np.inf if unknown else self.measure(residual)

    def measure(self, residual: Floats) -> float:
        """F but for the cost."""
        if self.is_squared or not len(residual):
            return float(residual @ residual)
        return float(np.max(residual if self.is_one_sided else np.abs(residual)))

    def price(self, y: Floats) -> float:
        """c(y)."""
        return 0.0 if self.cost is None else self.cost(y)[0]

    def cost_slopes(self, y: Floats) -> Floats:
        """The slopes (n_y,) of c."""
        return np.zeros(len(y)) if self.cost is None else self.cost(y)[1]


# --- The bounds as units


class UnitBox(NamedTuple):
    """z = (y − lower)/width of the parameters with room, and the linear constraints over z."""

    lower: Floats
    all_width: Floats
    free: list[int]
    width: Floats  # of the free ones
    rows: Floats
    row_lower: Floats
    row_upper: Floats

    @classmethod
    def of(cls, problem: DesignProblem) -> UnitBox:
        """The units of a problem."""
        width = problem.upper - problem.lower
        free = [int(j) for j in np.flatnonzero(width > 0.0)]
        C = np.array([row.coefficients for row in problem.constraints])
        C = C.reshape(len(problem.constraints), len(width))
        fixed = C @ problem.lower
        rows = C[:, free] * width[free]
        return cls(
            lower=problem.lower,
            all_width=width,
            free=free,
            width=width[free],
            rows=rows,
            row_lower=np.array([row.lower for row in problem.constraints]) - fixed,
            row_upper=np.array([row.upper for row in problem.constraints]) - fixed,
        )

    @property
    def n(self) -> int:
        """The number of parameters with room."""
        return len(self.free)

    def z(self, y: Floats) -> Floats:
        """(n,) of a design (n_y,)."""
        return np.asarray((y[self.free] - self.lower[self.free]) / self.width)

    def y(self, z: Floats) -> Floats:
        """(n_y,) of z (n,); at a bound exactly the bound."""
        y = self.lower.copy()
        y[self.free] = self.lower[self.free] + z * self.width
        top = self.lower + self.all_width
        y[self.free] = np.where(z >= 1.0, top[self.free], y[self.free])
        return y

    def inside(self, z: Floats) -> Floats:
        """The nearest z within bounds and constraints."""
        z = np.clip(z, 0.0, 1.0)
        row = self.rows @ z
        if self.n == 0 or np.all((row >= self.row_lower) & (row <= self.row_upper)):
            return z
        norms = np.linalg.norm(self.rows, axis=1)
        norms = np.where(norms > 0.0, norms, 1.0)
        found = solve_program(
            Program(
                A=np.eye(self.n),
                b=-z,
                G=np.vstack([np.eye(self.n), self.rows / norms[:, None]]),
                lower=np.append(np.zeros(self.n), self.row_lower / norms),
                upper=np.append(np.ones(self.n), self.row_upper / norms),
                cost=np.zeros(self.n),
            )
        )
        return z if found is None else np.clip(found[0], 0.0, 1.0)


def best_first(found: Iterable[T], worth: Callable[[T], tuple[float, float]]) -> list[T]:
    """Order by violation in whole numbers of `MET`, then by F; ``worth`` gives both.

    All violations up to `MET` are equal. Of equals the first stays first.
    """

    def rank(one: T) -> tuple[float, float]:
        violation, value = worth(one)
        return float(np.ceil(max(violation / MET, 1.0))), value

    return sorted(found, key=rank)


def merit(problem: DesignProblem, value: float, violation: float, weight: float) -> float:
    """Half of F for least squares, as in the program, and the weighted violation."""
    return (0.5 if problem.is_squared else 1.0) * value + weight * violation
