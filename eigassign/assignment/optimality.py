"""Judge: Karush–Kuhn–Tucker residuals of an answer, recomputed from the unscaled data.

No solver is believed. With g = dJ/dy, multipliers μ of the bounds and ν of the constraints
(positive at an upper limit, negative at a lower one), the answer is optimal exactly if

    dual:   g + μ + Cᵀν = 0,
    primal: all limits are met,
    gap:    a limit with a multiplier is active.

All three are dimensionless, in the units of `Scales`, and J is convex: with all three at zero no
design within the limits has a smaller J. What the last bits of y, as float64, change in a sum or
in a slope is not held against an answer (it matters for ranges of 1e-7 of the value or less).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from eigassign.assignment.inputs import Floats
from eigassign.assignment.program import ProgramAnswer, QuadraticProgram
from eigassign.errors import AccuracyError

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
