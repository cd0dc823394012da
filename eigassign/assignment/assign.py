"""Build, solve, judge: the design that brings the frequencies nearest to their targets.

No solver is believed. With g = dJ/dy, multipliers μ of the bounds and ν of the constraints
(positive at an upper limit, negative at a lower one), the answer is optimal exactly if

    dual:   g + μ + Cᵀν = 0,
    primal: all limits are met,
    gap:    a limit with a multiplier is active.

All three are dimensionless, in the units of `Scales`, and J is convex: with all three at zero no
design within the limits has a smaller J. What the last bits of y, as float64, change in a sum or
in a slope is not held against an answer (it matters for ranges of 1e-7 of the value or less).

`build_program` makes the quadratic program of eqs. (13)–(14) from linear models of λ,
`solve_program` gives candidates for its optimum, `best_candidate` returns the one whose residuals
prove it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.assignment.inputs import Floats, LinearConstraint, frozen
from eigassign.assignment.program import (
    Bounds,
    Goals,
    ProgramAnswer,
    QuadraticProgram,
    build_program,
)
from eigassign.assignment.solver import solve_program
from eigassign.brief import Brief
from eigassign.errors import AccuracyError
from eigassign.facts import Fact

ACCEPT = 1e-8  # ten times the tolerance that OSQP is asked for
ROUNDING = 4.0 * np.finfo(np.float64).eps  # of sums: a few units in the last place


@dataclass(frozen=True)
class Certificate:
    """Residuals of optimality, dimensionless.

    primal: the largest violation, of a bound in units of the parameter's scale, of a constraint in
    those of its row. dual: the largest |g + μ + Cᵀν| · scale / (2 · objective scale) over the free
    parameters. gap: Σ |multiplier| · distance to its limit / (2 · objective scale).
    """

    primal_residual: float
    dual_residual: float
    gap: float

    @property
    def worst(self) -> float:
        """The largest of the three; infinite if any is not a number."""
        figures = (self.primal_residual, self.dual_residual, self.gap)
        return max(figures) if np.all(np.isfinite(figures)) else np.inf

    @property
    def accepted(self) -> bool:
        """True where all three are within 1e-8."""
        return self.worst <= ACCEPT


def best_candidate(
    program: QuadraticProgram, candidates: Sequence[ProgramAnswer]
) -> tuple[ProgramAnswer, Certificate]:
    """The first of ``candidates`` that is optimal to within 1e-8, with its residuals.

    Raises AccuracyError with the figures of the least bad one where none is.
    """
    judged = [(candidate, judge(program, candidate)) for candidate in candidates]
    for candidate, certificate in judged:
        if certificate.accepted:
            return candidate, certificate
    least = min((certificate for _, certificate in judged), key=lambda found: found.worst)
    raise AccuracyError(
        f"the quadratic program was not solved to {ACCEPT:.0e}: primal residual "
        f"{least.primal_residual:.1e}, dual {least.dual_residual:.1e}, gap {least.gap:.1e}. Widen "
        "the bounds, or relax constraints that nearly contradict each other"
    )


def judge(program: QuadraticProgram, answer: ProgramAnswer) -> Certificate:
    """Residuals of ``answer``, from the program's unscaled data only."""
    scales, free = program.scales, list(program.scales.free)
    y, mu, nu = answer.y, answer.bound_multipliers, answer.constraint_multipliers
    row = program.C @ y
    excess_row = _violation(row, program.c_lower, program.c_upper)
    excess_row = excess_row - ROUNDING * (np.abs(program.C) @ np.abs(y))
    excess = _violation(y, program.lower, program.upper) / scales.y
    slope = np.abs(program.gradient(y) + mu + program.C.T @ nu)
    slope = slope - ROUNDING * 2.0 * (np.abs(program.A.T) @ (np.abs(program.A) @ np.abs(y)))
    gap = _slackness(y, mu, program.lower, program.upper)
    gap += _slackness(row, nu, program.c_lower, program.c_upper)
    return Certificate(
        primal_residual=_largest(np.append(excess, excess_row / scales.rows)),
        dual_residual=_largest((slope * scales.y)[free]) / (2.0 * scales.objective),
        gap=gap / (2.0 * scales.objective),
    )


def _largest(values: Floats) -> float:
    return float(np.max(values, initial=0.0))


def _violation(value: Floats, lower: Floats, upper: Floats) -> Floats:
    """The distance of each value to its limits; 0 inside."""
    return np.asarray(np.maximum(np.maximum(lower - value, value - upper), 0.0))


def _slackness(value: Floats, multiplier: Floats, lower: Floats, upper: Floats) -> float:
    """Σ |multiplier| · |value − the limit it belongs to|."""
    active = multiplier != 0.0
    side = np.where(multiplier > 0.0, upper, lower)[active]
    return float(np.sum(np.abs(multiplier[active] * (side - value[active]))))


@dataclass(frozen=True)
class ActiveLimit:
    """A bound or constraint that the optimum lies on.

    ``multiplier`` ≥ 0: how much J falls per unit by which the limit is relaxed (to first order), in
    1 / SI unit of the parameter or of the constraint; 0 if relaxing it gains nothing.
    """

    name: str
    kind: Annotated[str, Fact("bound, constraint or target")]
    side: Annotated[str, Fact("lower or upper")]
    multiplier: Annotated[float, Fact("fall of the objective for each SI unit of relaxation")]


@dataclass(frozen=True, repr=False)
class Assignment(Brief):
    """The optimal design and the proof that it is.

    ``y`` and ``dy = y − y0`` (n_y,) in SI units; ``lam`` one array for each goal, (its n_t,) in
    rad²/s², predicted by the linear models. J as in `program`: the mean square relative error in λ.
    Residuals are recomputed and dimensionless (`judge`), each at most 1e-8. ``undetermined``
    counts the directions of the free parameters that change no target: there the initial design is
    kept as nearly as the limits allow (`solver`).
    """

    names: tuple[str, ...]
    y: Floats
    dy: Floats
    lam: tuple[Floats, ...]
    status: str
    iterations: int
    primal_residual: float
    dual_residual: float
    gap: float
    objective_initial: float
    objective_optimal: float
    active: tuple[ActiveLimit, ...]
    undetermined: int


def solve_assignment(
    goals: Goals,
    time_weights: ArrayLike,
    y0: ArrayLike,
    y_initial: ArrayLike,
    bounds: Bounds,
    constraints: Sequence[LinearConstraint] = (),
    names: Sequence[str] | None = None,
) -> Assignment:
    """The design y within its limits that minimises J of eqs. (13)–(14), in relative error.

    ``goals`` are wanted frequencies, each with the linear model of its mode at its own samples.
    ``time_weights`` (n_t,) in s are those of the integral over time (`trapezoidal_weights`, of
    several trajectories one after the other); ``y0`` (n_y,) is the point dy counts from,
    ``y_initial`` (n_y,) the design to improve on; ``names`` of the parameters (y1, y2, … if not
    given) serve messages and the list of active limits.

    Raises:
        UsageError: data that is not a number, limits that are not ordered.
        InfeasibleError: no design meets all limits; ``constraints`` names those that contradict.
        AccuracyError: the KKT residuals of the best answer found exceed 1e-8.
        KeyboardInterrupt: Ctrl-C while the solver runs.
    """
    program = build_program(goals, time_weights, y0, y_initial, bounds, constraints, names)
    solution = solve_program(program)
    optimum, certificate = best_candidate(program, solution.candidates)
    dy = optimum.y - program.y0
    return Assignment(
        names=program.names,
        y=frozen(optimum.y),
        dy=frozen(dy),
        lam=tuple(frozen(model(dy)) for _, model in goals),
        status=solution.status,
        iterations=solution.iterations,
        primal_residual=certificate.primal_residual,
        dual_residual=certificate.dual_residual,
        gap=certificate.gap,
        objective_initial=program.objective(frozen(y_initial)),
        objective_optimal=program.objective(optimum.y),
        active=tuple(_active_limits(program, optimum)),
        undetermined=solution.undetermined,
    )


def _active_limits(program: QuadraticProgram, answer: ProgramAnswer) -> Iterator[ActiveLimit]:
    """Bounds met exactly; then constraints met to 1e-8 of their unit."""
    for j, name in enumerate(program.names):
        near = np.array([program.lower[j], program.upper[j]]) == answer.y[j]
        yield from _limit(name, "bound", near, answer.bound_multipliers[j])
    row, reach = program.C @ answer.y, ACCEPT * program.scales.rows
    for k, name in enumerate(program.constraint_names):
        near = np.abs(np.array([program.c_lower[k], program.c_upper[k]]) - row[k]) <= reach[k]
        yield from _limit(name, "constraint", near, answer.constraint_multipliers[k])


def _limit(
    name: str, kind: str, near: NDArray[np.bool_], multiplier: float
) -> Iterator[ActiveLimit]:
    """One entry if a limit is met; of two equal limits the one with the multiplier."""
    if near.any():
        upper = bool(multiplier > 0.0) if near.all() else bool(near[1])
        yield ActiveLimit(name, kind, "upper" if upper else "lower", abs(float(multiplier)))
