"""From linear models of λ to the optimal design: eqs. (13)–(14) built, solved and judged.

Reading order:

    checks       refuses input that is not finite or has another shape
    targets      wanted frequencies at the samples, weights in time, the distance to a target
    program      build: the quadratic program of eqs. (13)–(14), and its dimensionless units
    feasibility  which limits contradict each other
    solver       solve: OSQP, then an active-set method that goes to round-off
    optimality   judge: Karush–Kuhn–Tucker residuals, recomputed from the data
    exact        the optimum of the exact problem, and parameters from measurements
    catalogues   the best of what catalogues list
    assign       build, solve, judge: from targets to the optimal design
"""

from __future__ import annotations

from eigassign.assignment.assign import ActiveLimit, Assignment, solve_assignment
from eigassign.assignment.catalogues.branching import Catalogue
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
