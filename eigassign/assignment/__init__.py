"""From linear models of λ to the optimal design: eqs. (13)–(14) built, solved and judged.

Reading order:

    checks        refuses input that is not finite or has another shape
    targets       wanted frequencies at the samples, weights in time, the distance to a target
    program       build: the quadratic program of eqs. (13)–(14), and its dimensionless units
    feasibility   which limits contradict each other
    solver        solve: OSQP, then an active-set method that goes to round-off
    optimality    judge: Karush–Kuhn–Tucker residuals, recomputed from the data
    crossing      two modes that meet: the matrix of both, which is smooth where each has a kink
    design_problem  objective and limits as the sequential method sees them, in units of the bounds
    stationarity  first-order optimality of the exact problem, also where modes meet
    step          one program in a trust region, and what is expected of its step
    sequential    the exact optimum: programs in a row, judged exactly
    requirements  targets, inequalities and quantities as the sequential method sees them
    identification  parameters from measured frequencies, their covariance and intervals
    branching     branch and bound over catalogues, of any model whose relaxations can be solved
    catalogue     the best combinations of catalogues on the linear model, proved
    assign        build, solve, judge: from targets to the optimal design
    choosing      the best combinations of catalogues on the exact problem
"""

from __future__ import annotations

from eigassign.assignment.assign import ActiveLimit, Assignment, solve_assignment
from eigassign.assignment.branching import Catalogue
from eigassign.assignment.program import (
    Bounds,
    Goal,
    LinearConstraint,
    LinearModel,
    QuadraticProgram,
    build_program,
    quadratic_form,
)
from eigassign.assignment.targets import (
    RelativeError,
    hz_from_lam,
    lam_from_hz,
    relative_error,
    sample_target,
    trapezoidal_weights,
)

__all__ = [
    "ActiveLimit",
    "Assignment",
    "Bounds",
    "Catalogue",
    "Goal",
    "LinearConstraint",
    "LinearModel",
    "QuadraticProgram",
    "RelativeError",
    "build_program",
    "hz_from_lam",
    "lam_from_hz",
    "quadratic_form",
    "relative_error",
    "sample_target",
    "solve_assignment",
    "trapezoidal_weights",
]
