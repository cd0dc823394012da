"""Targets, quadratic program, solver and judge: from linear models of λ to the optimal design."""

from __future__ import annotations

from eigassign.assignment.assign import ActiveLimit, Assignment, solve_assignment
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
