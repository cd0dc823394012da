"""Build, solve, judge: the design that brings the frequencies nearest to their targets.

`build_program` makes the quadratic program of eqs. (13)–(14) from linear models of λ,
`solve_program` gives candidates for its optimum, `best_candidate` returns the one whose residuals
prove it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.assignment.inputs import Floats, LinearConstraint, finite, frozen
from eigassign.assignment.optimality import ACCEPT, best_candidate
from eigassign.assignment.program import (
    Bounds,
    Goals,
    ProgramAnswer,
    QuadraticProgram,
    build_program,
)
from eigassign.assignment.solver import solve_program
from eigassign.brief import Brief


@dataclass(frozen=True)
class ActiveLimit:
    """A bound or constraint that the optimum lies on.

    ``multiplier`` ≥ 0: how much J falls per unit by which the limit is relaxed (to first order), in
    1 / SI unit of the parameter or of the constraint; 0 if relaxing it gains nothing.
    """

    name: str
    kind: str  # "bound" | "constraint"
    side: str  # "lower" | "upper"
    multiplier: float


@dataclass(frozen=True, repr=False)
class Assignment(Brief):
    """The optimal design and the proof that it is.

    ``y`` and ``dy = y − y0`` (n_y,) in SI units; ``lam`` one array for each goal, (its n_t,) in
    rad²/s², predicted by the linear models. J as in `program`: the mean square relative error in λ.
    Residuals are recomputed and dimensionless (`optimality`), each at most 1e-8. ``undetermined``
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
        UsageError: shapes that do not fit, values that are not finite, empty ranges.
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
        objective_initial=program.objective(finite("initial design", y_initial, 1)),
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
