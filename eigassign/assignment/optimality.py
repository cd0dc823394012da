"""The judge: Karush–Kuhn–Tucker residuals of an answer, recomputed from the unscaled data.

No solver is believed. With g = dJ/dy, multipliers μ of the bounds and ν of the constraints
(positive at an upper limit, negative at a lower one), the answer is optimal exactly if

    dual:   g + μ + Cᵀν = 0,
    primal: all limits are met,
    gap:    a limit with a multiplier is active.

All three are dimensionless, in the units of `Scales`, and J is convex: with all three at zero no
design within the limits has a smaller J. What the last bits of y, as float64, change in a sum or
in a slope is not held against an answer (it matters for ranges of 1e-7 of the value or less).

Which limits contradict each other, by name.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from eigassign.assignment.checks import Floats
from eigassign.assignment.program import QuadraticProgram, ScaledProgram
from eigassign.errors import InfeasibleError

# --- The judge: Karush–Kuhn–Tucker residuals of an answer, recomputed from the unscaled data

ACCEPT = 1e-8
SNAP = 1e-10  # of a parameter's unit: this near to a bound is on it (a hundredth of ACCEPT)
ROUNDING = 4.0 * np.finfo(np.float64).eps


@dataclass(frozen=True)
class Candidate:
    """A design y (n_y,) with signed multipliers of bounds (n_y,) and constraints (n_c,).

    Multipliers are in J per SI unit of y or of the constraint: positive at the upper limit,
    negative at the lower one.
    """

    y: Floats
    bound_multipliers: Floats
    constraint_multipliers: Floats


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
        """All three within 1e-8."""
        return self.worst <= ACCEPT


def candidate(program: QuadraticProgram, scaled: ScaledProgram, x: Floats, mu: Floats) -> Candidate:
    """Back to SI units: x (n,) and mu (rows of G,) of the scaled program."""
    scales, free = program.scales, list(program.scales.free)
    n = len(free)
    mu = _possible(mu, scaled.lower, scaled.upper)
    y = program.y_start.copy()
    y[free] = _snapped(program, scaled, x)
    nu = 2.0 * scales.objective * mu[n:] / scales.rows
    bound = -(program.gradient(y) + program.C.T @ nu)  # what a fixed parameter's bounds bear
    bound[free] = 2.0 * scales.objective * mu[:n] / scales.y[free]
    return Candidate(y, bound, nu)


def _possible(mu: Floats, lower: Floats, upper: Floats) -> Floats:
    """Without the multipliers of limits that do not exist."""
    missing = ((mu > 0.0) & np.isinf(upper)) | ((mu < 0.0) & np.isinf(lower))
    return np.where(missing, 0.0, mu)


def _snapped(program: QuadraticProgram, scaled: ScaledProgram, x: Floats) -> Floats:
    """y of the free parameters, exactly on a bound where x is within rounding of it."""
    free, n = list(program.scales.free), x.size
    lower, upper = program.lower[free], program.upper[free]
    y = np.clip(program.y_start[free] + program.scales.y[free] * x, lower, upper)
    y = np.where(np.abs(x - scaled.lower[:n]) <= SNAP, lower, y)
    return np.where(np.abs(x - scaled.upper[:n]) <= SNAP, upper, y)


def judge(program: QuadraticProgram, answer: Candidate) -> Certificate:
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
    """How far each value is outside its limits; 0 inside."""
    return np.asarray(np.maximum(np.maximum(lower - value, value - upper), 0.0))


def _slackness(value: Floats, multiplier: Floats, lower: Floats, upper: Floats) -> float:
    """Σ |multiplier| · |value − the limit it belongs to|."""
    bears = multiplier != 0.0
    side = np.where(multiplier > 0.0, upper, lower)[bears]
    return float(np.sum(np.abs(multiplier[bears] * (side - value[bears]))))


# --- Which limits contradict each other, by name

TOUCH = 1e-9  # in units of `Scales`: a tenth of what the certificate accepts as violation


def refuse_impossible(program: QuadraticProgram) -> None:
    """Refuse constraints that no design within the bounds meets, each looked at alone.

    Over a box, coefficients @ y ranges exactly over [Σ min(c·lower, c·upper), Σ max(…)].

    Raises:
        InfeasibleError: with the names of all such constraints.
    """
    lowest, highest = reach(program)
    slack = TOUCH * program.scales.rows
    slack = slack + 1e-15 * (np.abs(program.C) @ np.abs(program.y_start))  # C y costs this rounding
    bad = (program.c_lower > highest + slack) | (program.c_upper < lowest - slack)
    if not bad.any():
        return
    lines = [_range_message(program, int(k), lowest[k], highest[k]) for k in np.flatnonzero(bad)]
    names = tuple(program.constraint_names[k] for k in np.flatnonzero(bad))
    raise InfeasibleError("; ".join(lines), names)


def reach(program: QuadraticProgram) -> tuple[Floats, Floats]:
    """Smallest and largest value (n_c,) of each constraint over the bounds."""
    C = program.C
    with np.errstate(invalid="ignore"):  # 0 · inf, a parameter that does not occur
        ends = np.stack([C * program.lower, C * program.upper])
    ends = np.where(C == 0.0, 0.0, ends)
    return ends.min(axis=0).sum(axis=1), ends.max(axis=0).sum(axis=1)


def _range_message(program: QuadraticProgram, k: int, lowest: float, highest: float) -> str:
    name, low, high = program.constraint_names[k], program.c_lower[k], program.c_upper[k]
    if low > highest:
        return (
            f"constraint {name!r} asks for at least {low:g}, the bounds allow {highest:g} at most"
        )
    return (
        f"constraint {name!r} asks for at most {high:g}, the bounds allow no less than {lowest:g}"
    )


def feasible_point(scaled: ScaledProgram, rows: list[int] | None = None) -> Floats | None:
    """Some x within the bounds and the given constraints (all, if None); None if there is none."""
    from scipy.optimize import linprog  # heavy, and needed only when something is wrong

    n = scaled.G.shape[1]
    kept = [n + k for k in range(scaled.G.shape[0] - n)] if rows is None else [n + k for k in rows]
    G = np.vstack([scaled.G[kept], -scaled.G[kept]])
    h = np.concatenate([scaled.upper[kept], -scaled.lower[kept]])
    finite = np.isfinite(h)
    box = [(float(scaled.lower[j]), float(scaled.upper[j])) for j in range(n)]
    found = linprog(
        np.zeros(n),
        A_ub=G[finite],
        b_ub=h[finite],
        bounds=box,
        method="highs",
        options={"primal_feasibility_tolerance": TOUCH},
    )
    return np.asarray(found.x) if found.status == 0 else None


def contradiction(program: QuadraticProgram, scaled: ScaledProgram) -> InfeasibleError:
    """The error that names a smallest set of constraints that cannot be met together.

    Deletion filter: a constraint without which the rest is still impossible is left out. Of what
    remains every one is needed for the contradiction.
    """
    needed = list(range(len(program.constraint_names)))
    for k in list(needed):
        rest = [other for other in needed if other != k]
        if feasible_point(scaled, rest) is None:
            needed = rest
    names = tuple(program.constraint_names[k] for k in needed)
    listed = " and ".join(repr(name) for name in names)
    together = " together" if len(names) > 1 else ""
    return InfeasibleError(f"no design within the bounds meets {listed}{together}", names)
