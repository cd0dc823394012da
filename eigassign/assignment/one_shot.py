"""The paper's one shot: the quadratic program of eqs. (13)–(14), built, solved and judged.

Along the trajectory the eigenvalue of target i is, to first order in the design (eq. (9)),

    λ_i(t, y) = l0_i(t) + l_i(t)·(y − y0),         e_i(t, y) = λ_i(t, y) / λ_d,i(t) − 1,

and what is minimised is the weighted mean square of the relative error in λ,

    J(y) = Σ_i w_i ∫_i e_i² dt / Σ_i w_i ∫_i dt                                [dimensionless]

over the samples on which target i is wanted, by the trapezoidal rule along each trajectory for
itself, every trajectory by its own weight. √J is the rms relative error in λ: near the target,
twice that in Hz.

**Against the paper.** Eqs. (13)–(14) weigh the absolute error, R = ∫ l lᵀ dt and
h = ∫ (l0 − λ_d) l dt. For one target constant in time λ_d is a common factor,

    J = (dyᵀ R dy + 2 hᵀ dy + const) / (λ_d² ∫ dt),

and both have the same solution. They differ where λ_d differs: the absolute error lets a mode (or
an instant) of twice the target frequency weigh sixteen times as much, for no other reason than
being fast; here 1 % is 1 % in every mode and at every instant, and ``weight`` alone says what
matters more.

**Units.** x is (y − y_start)/unit. The unit is the range of the parameter, but no more than what
changes λ by 100 % in the root mean square (so that a maximum of 1e12, meant as "none", does not
drown the others). J/2 is divided by a·max(a, e), a being the largest rms change of λ that one unit
makes and e the rms relative error at the start: gradients are then at most 1 there.

**Judged.** The solver is not believed. With multipliers μ of all limits (positive at an upper one)
the answer is optimal exactly if the slope and Gᵀμ are 0 together, all limits are met, and those
with a multiplier are active; J is convex: no design within the limits has a smaller one then.

**Undetermined directions.** A direction that changes A x by no more than 1e-9 of what the strongest
one does is not determined by the data (fewer samples than parameters, two parameters that do the
same). Among all optima the one nearest to the initial design is then taken: what does not help is
not changed, and equal parameters share the change in proportion to their ranges.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from eigassign.arrays import Floats
from eigassign.assignment.program import (
    RANK,
    SNAP,
    LinearConstraint,
    Program,
    Solved,
    feasible_point,
    frozen,
    smallest,
    solve_program,
)
from eigassign.assignment.requirements.requirement import Requirement, time_shares
from eigassign.brief import Brief
from eigassign.errors import AccuracyError, InfeasibleError
from eigassign.facts import Fact

ACCEPT = 1e-8  # residual of optimality


class LinearModel(NamedTuple):
    """λ along the trajectory, λ = l0 + l @ (y − y0).

    ``l0`` (n_t,) in rad²/s²; ``l`` (n_t, n_y) in rad²/s² per SI unit of y.
    """

    l0: Floats
    l: Floats  # noqa: E741 - the paper's symbol

    def __call__(self, dy: Floats) -> Floats:
        """λ (n_t,) at y = y0 + dy."""
        return np.asarray(self.l0 + self.l @ dy)


Goals = Sequence[tuple[Requirement, LinearModel]]  # wanted frequencies, each with λ at its rows


def lam_from_hz(frequency_hz: ArrayLike) -> Floats:
    """λ = (2π f)² in rad²/s² of frequencies in Hz, same shape."""
    return frozen((2.0 * np.pi * np.asarray(frequency_hz, dtype=np.float64)) ** 2)


def hz_from_lam(lam: ArrayLike) -> Floats:
    """f = √λ / 2π in Hz of λ in rad²/s², same shape.

    Raises:
        AccuracyError: a negative or non-finite λ. A mechanism has none, so the linear model that
            predicted it was used too far from its expansion point.
    """
    values = np.asarray(lam, dtype=np.float64)
    bad = np.argwhere(~(values >= 0.0) | ~np.isfinite(values))
    if bad.size:
        where = tuple(int(i) for i in bad[0])
        raise AccuracyError(
            f"the linear model predicts λ = {values[where]:.6g} rad²/s² at sample {list(where)}, "
            "which no mechanism has: the design is too far from the expansion point"
        )
    return frozen(np.sqrt(values) / (2.0 * np.pi))


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

    ``y`` (n_y,) in SI units; ``lam`` one array for each goal, (its n_t,) in rad²/s², predicted by
    the linear models. Residuals are recomputed and dimensionless (`judge`),
    each at most 1e-8. ``undetermined`` counts the directions of the free parameters that change no
    target.
    """

    y: Floats
    lam: tuple[Floats, ...]
    status: str
    iterations: int
    primal_residual: float
    dual_residual: float
    gap: float
    objective: float  # J
    active: tuple[ActiveLimit, ...]
    undetermined: int


def solve_assignment(
    goals: Goals,
    time_weights: ArrayLike,
    y0: ArrayLike,
    y_initial: ArrayLike,
    bounds: tuple[Floats, Floats],
    constraints: Sequence[LinearConstraint] = (),
    names: Sequence[str] | None = None,
) -> Assignment:
    """The design y within its limits that minimises J of eqs. (13)–(14), in relative error.

    ``goals`` are wanted frequencies, each with the linear model of its mode at its own samples.
    ``time_weights`` (n_t,) in s are those of the integral over time, of several trajectories one
    after the other; ``y0`` (n_y,) is the point of the models, ``y_initial`` (n_y,) the design to
    improve on. ``bounds`` lower and upper (n_y,) are infinite where there is none, equal where
    fixed; ``names`` of the parameters (y1, y2, … if not given) serve the list of active limits.

    Raises:
        UsageError: data that is not a number, limits that are not ordered.
        InfeasibleError: no design meets all limits; ``constraints`` names those that contradict.
        AccuracyError: the residuals of the answer exceed 1e-8.
    """
    A, b = relative_rows(goals, frozen(time_weights))
    y0, (lower, upper) = frozen(y0), bounds
    start = np.clip(y_initial, lower, upper)
    error, free = A @ (start - y0) + b, upper > lower
    C = np.array([row.coefficients for row in constraints]).reshape(len(constraints), y0.size)
    low, high = np.array([(row.lower, row.upper) for row in constraints]).reshape(-1, 2).T
    unit = _units(A, lower, upper, y0)[free]
    effect = float(np.max(np.linalg.norm(A[:, free] * unit, axis=0), initial=0.0))
    size = effect * max(effect, float(np.linalg.norm(error))) or 1.0
    norms = np.linalg.norm(C[:, free] * unit, axis=1)
    row_unit = np.where(norms > 0.0, norms, 1.0)

    q, r = np.linalg.qr(A[:, free] * unit / np.sqrt(size))
    sides = ((lower, low), (upper, high))
    least, most = (
        np.append((bound - start)[free] / unit, (limit - C @ start) / row_unit)
        for bound, limit in sides
    )
    G = np.vstack([np.eye(len(unit)), C[:, free] * unit / row_unit[:, None]])
    program = Program(r, q.T @ error / np.sqrt(size), G, least, most, np.zeros(len(unit)))
    rows = [row.name for row in constraints]
    solved, rank = _optimum(program, rows)
    x, mu = solved.x, solved.mu
    primal, dual, gap = judge(program, x, mu)
    if not max(primal, dual, gap) <= ACCEPT:
        raise AccuracyError(
            f"the quadratic program was not solved to {ACCEPT:.0e}: primal residual {primal:.1e}, "
            f"dual {dual:.1e}, gap {gap:.1e}. Widen the bounds, or relax constraints that nearly "
            "contradict each other"
        )

    n = len(unit)
    y = start.copy()
    y[free] = np.clip(start[free] + unit * x, lower[free], upper[free])
    y[free] = np.where(x == least[:n], lower[free], np.where(x == most[:n], upper[free], y[free]))
    error = A @ (y - y0) + b
    of_rows = 2.0 * size * mu[n:] / row_unit
    of_bounds = -(2.0 * A.T @ error + C.T @ of_rows)  # the multipliers of fixed parameters
    of_bounds[free] = 2.0 * size * mu[:n] / unit
    names = names or [f"y{j + 1}" for j in range(y0.size)]
    found = (
        *_active(names, "bound", y, (lower, upper), 0.0 * y, of_bounds),
        *_active(rows, "constraint", C @ y, (low, high), row_unit, of_rows),
    )
    return Assignment(
        y=frozen(y),
        lam=tuple(frozen(model(y - y0)) for _, model in goals),
        status=solved.status,
        iterations=solved.iterations,
        primal_residual=primal,
        dual_residual=dual,
        gap=gap,
        objective=float(error @ error),
        active=found,
        undetermined=n - rank,
    )


def relative_rows(goals: Goals, time_weights: Floats) -> tuple[Floats, Floats]:
    """A (n_rows, n_y) and b (n_rows,) with J(y) = ‖A (y − y0) + b‖².

    One row for each goal and sample: relative error, mean over time, weighted mean over the goals.
    """
    shares = time_shares([one for one, _ in goals], time_weights)
    slopes, errors = [], []
    for (one, model), share in zip(goals, shares, strict=True):
        root, lam_d = np.sqrt(share), lam_from_hz(one.hz)
        slopes.append((root / lam_d)[:, None] * model.l)
        errors.append(root * (model.l0 / lam_d - 1.0))
    return np.vstack(slopes), np.concatenate(errors)


def _units(A: Floats, lower: Floats, upper: Floats, y0: Floats) -> Floats:
    """The units (n_y,) of the parameters."""
    width, effect = upper - lower, np.linalg.norm(A, axis=0)
    full = np.where(effect > 0.0, 1.0 / np.where(effect > 0.0, effect, 1.0), np.inf)
    unit = np.where(width > 0.0, np.minimum(width, full), full)
    return np.where(np.isfinite(unit), unit, np.where(y0 != 0.0, np.abs(y0), 1.0))


def _optimum(program: Program, names: Sequence[str]) -> tuple[Solved, int]:
    """The optimum and the rank of A: of all optima the one nearest to x = 0."""
    n = program.cost.size
    solved = solve_program(program)
    if solved is None:
        raise _contradiction(program, names)
    x, mu = solved.x, solved.mu
    sizes, seen = np.linalg.svd(program.A, full_matrices=False)[1:]
    seen = seen[sizes > RANK * np.max(sizes, initial=0.0)]
    if len(seen) < n:
        nearest = Program(
            A=np.eye(n),
            b=np.zeros(n),
            G=np.vstack([program.G, seen]),
            lower=np.append(program.lower, seen @ x),
            upper=np.append(program.upper, seen @ x),
            cost=program.cost,
        )
        again = solve_program(nearest, x)
        x = x if again is None else again.x
    least, most = program.lower[:n], program.upper[:n]
    x = np.where(np.abs(x - least) <= SNAP, least, np.where(np.abs(x - most) <= SNAP, most, x))
    missing = ((mu > 0.0) & np.isinf(program.upper)) | ((mu < 0.0) & np.isinf(program.lower))
    return solved._replace(x=x, mu=np.where(missing, 0.0, mu)), len(seen)


def _contradiction(program: Program, names: Sequence[str]) -> InfeasibleError:
    """The error that names a smallest set of constraints that cannot be met together."""
    n = program.cost.size

    def contradict(rows: list[int]) -> bool:
        kept = np.isin(np.arange(len(program.G)) - n, rows)
        kept[:n] = True
        return feasible_point(program.some(kept)) is None

    found = tuple(names[k] for k in smallest(range(len(names)), contradict))
    together = " together" if len(found) > 1 else ""
    listed = " and ".join(map(repr, found))
    return InfeasibleError(f"no design within the bounds meets {listed}{together}", found)


def judge(program: Program, x: Floats, mu: Floats) -> tuple[float, float, float]:
    """Residuals of an answer x (n,) with multipliers mu (rows of G,), from the data only.

    The largest violation of a limit; the largest |Aᵀ(A x + b) + cost + Gᵀmu|; and the gap, the sum
    of |multiplier| · distance to its limit.
    """
    row = program.G @ x
    beyond = np.maximum(program.lower - row, row - program.upper)
    slope = np.abs(program.gradient(x) + program.G.T @ mu)
    active = mu != 0.0
    side = np.where(mu > 0.0, program.upper, program.lower)[active]
    gap = float(np.sum(np.abs(mu[active] * (side - row[active]))))
    return float(np.max(beyond, initial=0.0)), float(np.max(slope, initial=0.0)), gap


def _active(
    names: Sequence[str],
    kind: str,
    values: Floats,
    limits: tuple[Floats, Floats],
    units: Floats,
    multipliers: Floats,
) -> Iterator[ActiveLimit]:
    """Limits met to 1e-8 of their unit; of two equal ones that with the multiplier."""
    at_lower, at_upper = (np.abs(values - side) <= ACCEPT * units for side in limits)
    for k in map(int, np.flatnonzero(at_lower | at_upper)):
        is_upper = multipliers[k] > 0.0 if at_lower[k] and at_upper[k] else at_upper[k]
        size = abs(float(multipliers[k]))
        yield ActiveLimit(names[k], kind, "upper" if is_upper else "lower", size)
