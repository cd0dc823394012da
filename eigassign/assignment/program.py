"""Build: the quadratic program of eqs. (13)–(14), its dimensionless units; limits that contradict.

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

**Units.** The program is solved in dimensionless units (`Scales`, `ScaledProgram`), in which every
number is O(1); an answer goes back to SI units by `unscaled`.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.assignment.inputs import (
    Floats,
    LinearConstraint,
    LinearModel,
    frozen,
)
from eigassign.assignment.requirements.requirement import Requirement, time_shares
from eigassign.errors import InfeasibleError

Goals = Sequence[tuple[Requirement, LinearModel]]  # wanted frequencies, each with λ at its rows


@dataclass(frozen=True)
class Bounds:
    """lower ≤ y ≤ upper, (n_y,) in SI units; infinite where there is none, equal where fixed."""

    lower: Floats
    upper: Floats


@dataclass(frozen=True)
class QuadraticProgram:
    """min J(y) = ‖A (y − y0) + b‖²,  lower ≤ y ≤ upper,  c_lower ≤ C y ≤ c_upper.

    Everything in SI units; ``scales`` says in which dimensionless ones it is solved and judged.
    A (n_rows, n_y) and b (n_rows,) hold one row for each target and sample, weights included.
    ``y_start`` is the initial design put inside the bounds.
    """

    names: tuple[str, ...]
    A: Floats
    b: Floats
    y0: Floats
    y_start: Floats
    lower: Floats
    upper: Floats
    constraint_names: tuple[str, ...]
    C: Floats
    c_lower: Floats
    c_upper: Floats
    scales: Scales = field(repr=False)

    def objective(self, y: Floats) -> float:
        """J(y), the weighted mean square of the relative error in λ."""
        residual = self.A @ (y - self.y0) + self.b
        return float(residual @ residual)

    def gradient(self, y: Floats) -> Floats:
        """dJ/dy (n_y,), per SI unit of y."""
        return np.asarray(2.0 * self.A.T @ (self.A @ (y - self.y0) + self.b))


def build_program(
    goals: Goals,
    time_weights: ArrayLike,
    y0: ArrayLike,
    y_initial: ArrayLike,
    bounds: Bounds,
    constraints: Sequence[LinearConstraint] = (),
    names: Sequence[str] | None = None,
) -> QuadraticProgram:
    """The program of all goals over all samples; arguments as in `solve_assignment`."""
    y0 = frozen(y0)
    names = tuple(f"y{j + 1}" for j in range(y0.size)) if names is None else tuple(names)
    A, b = _relative_rows(goals, frozen(time_weights))
    start = np.clip(y_initial, bounds.lower, bounds.upper)
    C = np.array([c.coefficients for c in constraints]).reshape(len(constraints), y0.size)
    return QuadraticProgram(
        names=names,
        A=frozen(A),
        b=frozen(b),
        y0=y0,
        y_start=frozen(start),
        lower=bounds.lower,
        upper=bounds.upper,
        constraint_names=tuple(c.name for c in constraints),
        C=frozen(C),
        c_lower=frozen([c.lower for c in constraints]),
        c_upper=frozen([c.upper for c in constraints]),
        scales=choose_scales(A, A @ (start - y0) + b, bounds.lower, bounds.upper, C, y0),
    )


def _relative_rows(goals: Goals, time_weights: Floats) -> tuple[Floats, Floats]:
    """A and b of J: relative error, mean over time, weighted mean over the goals."""
    rows = []
    shares = time_shares([one for one, _ in goals], time_weights)
    for (one, model), share in zip(goals, shares, strict=True):
        rows.append(one.lam_rows(model, share))
    return np.vstack([A for A, _ in rows]), np.concatenate([b for _, b in rows])


# --- Dimensionless units for a quadratic program, the program written in them, and the way back

# Of a parameter's unit: this near to a bound is on it. A hundredth of what `judge` accepts.
SNAP = 1e-10


@dataclass(frozen=True)
class Scales:
    """Units in which a program is O(1).

    ``y`` (n_y,): the range of the parameter, but no more than what changes λ by 100 % in the root
    mean square (so that a maximum of 1e12, meant as "none", does not drown the others; with no
    range at all it is that change). ``objective``: with a the largest root mean square change of λ
    that one unit of ``y`` makes and e the rms relative error at the start, a·max(a, e); gradients
    of J/2 are then at most 1 at the start. ``rows`` (n_c,): the norm of a constraint's coefficients
    times ``y``, over the parameters that are free.
    """

    y: Floats
    objective: float
    rows: Floats
    free: tuple[int, ...]


@dataclass(frozen=True)
class ScaledProgram:
    """min ½‖A x + b‖² + costᵀx  with  lower ≤ G x ≤ upper.

    The first n rows of G are the identity (the bounds), the others the constraints, of norm 1. Of
    a `QuadraticProgram`, x = (y − y_start)/scale of the free parameters, A (≤ n, n) is triangular,
    its rows after a QR decomposition, which keeps AᵀA and Aᵀb, and there is no cost.
    """

    A: Floats
    b: Floats
    G: Floats
    lower: Floats
    upper: Floats
    cost: Floats

    @property
    def P(self) -> Floats:
        """The Hessian AᵀA (n, n)."""
        return np.asarray(self.A.T @ self.A)

    @property
    def c(self) -> Floats:
        """The gradient Aᵀb + cost (n,) at x = 0."""
        return self.gradient(np.zeros(self.cost.size))

    def gradient(self, x: Floats) -> Floats:
        """Aᵀ(A x + b) + cost (n,)."""
        return np.asarray(self.A.T @ (self.A @ x + self.b) + self.cost)


def choose_scales(
    A: Floats, b_start: Floats, lower: Floats, upper: Floats, C: Floats, y0: Floats
) -> Scales:
    """The units of a program with error A (y − y_start) + b_start."""
    width = upper - lower
    effect = np.linalg.norm(A, axis=0)
    full = np.where(effect > 0.0, 1.0 / np.where(effect > 0.0, effect, 1.0), np.inf)
    unit = np.where(width > 0.0, np.minimum(width, full), full)
    unit = np.where(np.isfinite(unit), unit, np.where(y0 != 0.0, np.abs(y0), 1.0))
    free = tuple(int(j) for j in np.flatnonzero(width > 0.0))
    strongest = float(np.max((effect * unit)[list(free)], initial=0.0))
    objective = strongest * max(strongest, float(np.linalg.norm(b_start)))
    norms = np.linalg.norm((C * unit)[:, list(free)], axis=1)
    rows = np.where(norms > 0.0, norms, 1.0)
    return Scales(frozen(unit), objective if objective > 0.0 else 1.0, frozen(rows), free)


def scaled_program(program: QuadraticProgram) -> ScaledProgram:
    """The program in its own units, fixed parameters eliminated."""
    scales, free = program.scales, list(program.scales.free)
    unit, start = scales.y[free], program.y_start
    root = np.sqrt(scales.objective)
    q, r = np.linalg.qr(program.A[:, free] * unit / root)
    b = q.T @ (program.A @ (start - program.y0) + program.b) / root
    at_start = program.C @ start
    G = np.vstack([np.eye(len(free)), program.C[:, free] * unit / scales.rows[:, np.newaxis]])
    bounds = [(side[free] - start[free]) / unit for side in (program.lower, program.upper)]
    limits = [(side - at_start) / scales.rows for side in (program.c_lower, program.c_upper)]
    lower, upper = (np.concatenate(pair) for pair in zip(bounds, limits, strict=True))
    cost = frozen(np.zeros(len(free)))
    return ScaledProgram(frozen(r), frozen(b), frozen(G), frozen(lower), frozen(upper), cost)


@dataclass(frozen=True)
class ProgramAnswer:
    """A design y (n_y,) with signed multipliers of bounds (n_y,) and constraints (n_c,).

    Multipliers are in J per SI unit of y or of the constraint: positive at the upper limit,
    negative at the lower one.
    """

    y: Floats
    bound_multipliers: Floats
    constraint_multipliers: Floats


def unscaled(
    program: QuadraticProgram, scaled: ScaledProgram, x: Floats, mu: Floats
) -> ProgramAnswer:
    """x (n,) and mu (rows of G,) of the scaled program, back in SI units."""
    scales, free = program.scales, list(program.scales.free)
    n = len(free)
    mu = of_finite_limits(mu, scaled.lower, scaled.upper)
    y = program.y_start.copy()
    y[free] = _snapped(program, scaled, x)
    nu = 2.0 * scales.objective * mu[n:] / scales.rows
    bound = -(program.gradient(y) + program.C.T @ nu)  # the multipliers of fixed parameters
    bound[free] = 2.0 * scales.objective * mu[:n] / scales.y[free]
    return ProgramAnswer(y, bound, nu)


def of_finite_limits(mu: Floats, lower: Floats, upper: Floats) -> Floats:
    """Multipliers without those of limits that do not exist."""
    missing = ((mu > 0.0) & np.isinf(upper)) | ((mu < 0.0) & np.isinf(lower))
    return np.where(missing, 0.0, mu)


def _snapped(program: QuadraticProgram, scaled: ScaledProgram, x: Floats) -> Floats:
    """y of the free parameters, exactly on a bound where x is within rounding of it."""
    free, n = list(program.scales.free), x.size
    lower, upper = program.lower[free], program.upper[free]
    y = np.clip(program.y_start[free] + program.scales.y[free] * x, lower, upper)
    y = np.where(np.abs(x - scaled.lower[:n]) <= SNAP, lower, y)
    return np.where(np.abs(x - scaled.upper[:n]) <= SNAP, upper, y)


T = TypeVar("T")
MISSED = 1e-7  # of a constraint's terms: what programs leave of it
TOUCH = 1e-9  # in units of `Scales`: a tenth of the violation that `judge` accepts


def refuse_impossible(program: QuadraticProgram) -> None:
    """Refuse constraints that no design within the bounds meets, each looked at alone.

    Over a box, coefficients @ y ranges exactly over [Σ min(c·lower, c·upper), Σ max(…)].

    Raises:
        InfeasibleError: with the names of all such constraints.
    """
    C = program.C
    with np.errstate(invalid="ignore"):  # 0 · inf, a parameter that does not occur
        ends = np.stack([C * program.lower, C * program.upper])
    ends = np.where(C == 0.0, 0.0, ends)
    lowest, highest = ends.min(axis=0).sum(axis=1), ends.max(axis=0).sum(axis=1)
    rounding = 1e-15 * (np.abs(C) @ np.abs(program.y_start))  # some units in the last place
    slack = TOUCH * program.scales.rows + rounding
    bad = (program.c_lower > highest + slack) | (program.c_upper < lowest - slack)
    if not bad.any():
        return
    lines = [_range_message(program, int(k), lowest[k], highest[k]) for k in np.flatnonzero(bad)]
    names = tuple(program.constraint_names[k] for k in np.flatnonzero(bad))
    raise InfeasibleError("; ".join(lines), names)


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


def constraints_agree(rows: Sequence[LinearConstraint], bounds: Bounds) -> bool:
    """True where a design within the bounds meets all linear limits, to 1e-9 of their terms."""
    if not rows:
        return True
    C = np.array([row.coefficients for row in rows])
    low, high = np.array([(row.lower, row.upper) for row in rows]).T
    width, n = bounds.upper - bounds.lower, len(bounds.lower)
    size = np.abs(C) @ np.maximum(np.abs(bounds.lower), np.abs(bounds.upper))
    size = np.where(size > 0.0, size, 1.0)
    fixed = C @ bounds.lower
    G = np.vstack([np.eye(n), C * width / size[:, None]])
    lower = np.append(np.zeros(n), (low - fixed) / size - TOUCH)
    upper = np.append(np.ones(n), (high - fixed) / size + TOUCH)
    nothing = np.zeros(n)
    return feasible_point(ScaledProgram(G[:0], nothing[:0], G, lower, upper, nothing)) is not None


def can_be_kept(
    rows: Sequence[LinearConstraint], lower: Floats, upper: Floats
) -> NDArray[np.bool_]:
    """True of each box of designs (n, n_y) in which some design meets each limit, taken alone."""
    kept = np.ones(len(lower), dtype=bool)
    for row in rows:
        ends = row.coefficients * lower, row.coefficients * upper
        size = MISSED * np.maximum(*np.abs(ends)).sum(axis=1)
        kept &= np.minimum(*ends).sum(axis=1) <= row.upper + size
        kept &= np.maximum(*ends).sum(axis=1) >= row.lower - size
    return kept


def contradiction(program: QuadraticProgram, scaled: ScaledProgram) -> InfeasibleError:
    """The error that names a smallest set of constraints that cannot be met together."""
    every = range(len(program.constraint_names))
    needed = smallest(every, lambda rows: feasible_point(scaled, rows) is None)
    names = tuple(program.constraint_names[k] for k in needed)
    listed = " and ".join(repr(name) for name in names)
    together = " together" if len(names) > 1 else ""
    return InfeasibleError(f"no design within the bounds meets {listed}{together}", names)


def smallest(every: Iterable[T], contradict: Callable[[list[T]], bool]) -> list[T]:
    """Those of ``every`` limit, which contradict, that are all needed for the contradiction.

    Deletion filter: a limit without which the rest still contradict is left out.
    """
    needed = list(every)
    for one in list(needed):
        rest = [other for other in needed if other != one]
        if contradict(rest):
            needed = rest
    return needed
