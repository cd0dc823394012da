"""Solve: OSQP, then an active-set method that goes to round-off.

**OSQP.** What OSQP 1.1 does, and the answer to each: its tolerances default to 1e-3 (set to 1e-9);
on failure x is 2143289344.0 and not NaN (x is read only when the status is 1); NaN in the data is
not refused (refused here); a lower triangle is ignored (the upper one is given); an interrupt is
swallowed (raised again); its own polishing may worsen the answer, and prints to stdout in spite of
``verbose=False`` (off; the active-set method below polishes, and `judge` judges both). With a
positive semidefinite P and ordered limits nothing is printed, so stdout needs no redirection. Made
without a name of its algebra it looks for others on the disk, 1 to 2 ms for each program (named).

**Polish.** Least squares with a linear cost and limits, by the primal active-set method, to
round-off:

    min ½‖A x + b‖² + costᵀx  with  lower ≤ G x ≤ upper

(Nocedal, Wright, Numerical Optimization, 2nd ed., algorithm 16.3, in null-space form.) It works on
A, not on AᵀA, so that digits are lost with cond(A) only, and starts at a point that is feasible but
for a solver's tolerance; there, it needs one or two steps.

**Undetermined directions.** A direction that changes A x by no more than 1e-9 of what the strongest
one does is not determined by the data (fewer samples than parameters, two parameters that do the
same). Among all optima the one nearest to x = 0, the initial design, is then taken: what does not
help is not changed, and equal parameters share the change in proportion to their ranges. So the
answer is unique and the same on every run.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import IntEnum
from functools import cached_property

import numpy as np

from eigassign.assignment.inputs import Floats
from eigassign.assignment.program import (
    ProgramAnswer,
    QuadraticProgram,
    ScaledProgram,
    contradiction,
    feasible_point,
    refuse_impossible,
    scaled_program,
    unscaled,
)
from eigassign.errors import UsageError


@dataclass(frozen=True)
class Solution:
    """Candidates for the optimum, the more exact first; `judge` decides which of them holds.

    ``undetermined`` counts the directions of the free parameters that change no target.
    """

    candidates: tuple[ProgramAnswer, ...]
    status: str
    iterations: int
    undetermined: int


def solve_program(program: QuadraticProgram) -> Solution:
    """OSQP's answer polished, then as it is.

    Raises InfeasibleError with the names of the constraints that contradict each other.
    """
    refuse_impossible(program)
    scaled, n = scaled_program(program), len(program.scales.free)
    if n == 0:
        fixed = unscaled(program, scaled, np.zeros(0), np.zeros(scaled.G.shape[0]))
        return Solution((fixed,), "nothing is free", 0, 0)
    raw = solve_osqp(scaled)
    start = feasible_point(scaled) if raw.x is None else raw.x
    if start is None:
        raise contradiction(program, scaled)
    polished = polish(scaled, start)
    candidates = [unscaled(program, scaled, polished.x, polished.mu)]
    status = f"solved (active set; {raw.status.words})"
    if raw.x is not None and raw.mu is not None:
        candidates.append(unscaled(program, scaled, raw.x, raw.mu))
        status = raw.status.words
    return Solution(tuple(candidates), status, raw.iterations, n - polished.rank)


def solve_scaled(
    scaled: ScaledProgram, start: Floats | None = None
) -> tuple[Floats, Floats] | None:
    """x and multipliers mu (rows of G,) of a program in units of its own; None if none is found.

    From a ``start`` (n,) that is feasible the active-set method goes alone, without OSQP.
    """
    if start is None:
        raw = solve_osqp(scaled)
        start = feasible_point(scaled) if raw.x is None else raw.x
    return None if start is None else solve_active_set(scaled, start)


# --- OSQP
class Status(IntEnum):
    """The end of a run in OSQP's words; the names are its own."""

    SOLVED = 1
    SOLVED_INACCURATE = 2
    PRIMAL_INFEASIBLE = 3
    PRIMAL_INFEASIBLE_INACCURATE = 4
    DUAL_INFEASIBLE = 5
    DUAL_INFEASIBLE_INACCURATE = 6
    MAX_ITER_REACHED = 7
    TIME_LIMIT_REACHED = 8
    NON_CONVEX = 9
    INTERRUPTED = 10
    UNSOLVED = 11

    @property
    def words(self) -> str:
        """The name for people: ``maximum iterations`` and the like."""
        return self.name.lower().replace("_", " ")


@dataclass(frozen=True)
class RawSolution:
    """OSQP's answer: x (n,) and multipliers mu (rows of G,), None unless it says solved."""

    status: Status
    iterations: int
    x: Floats | None
    mu: Floats | None


SETTINGS = {
    "verbose": False,
    "eps_abs": 1e-9,
    "eps_rel": 1e-9,
    "eps_prim_inf": 1e-9,
    "eps_dual_inf": 1e-9,
    "max_iter": 20000,
    "polishing": False,
    "adaptive_rho": 1,
    "adaptive_rho_interval": 50,  # in iterations, not in seconds: the same answer on every machine
}


def solve_osqp(scaled: ScaledProgram) -> RawSolution:
    """Minimise the scaled program (at least one variable) from x = 0.

    Raises:
        UsageError: data that is not a number.
        KeyboardInterrupt: the user pressed Ctrl-C meanwhile.
    """
    import osqp  # loaded only where something is solved
    from scipy.sparse import csc_matrix

    P, c = scaled.P, scaled.c
    _refuse_nan(P, c, scaled)
    solver = osqp.OSQP(algebra="builtin")
    P_upper, G = csc_matrix(np.triu(P)), csc_matrix(scaled.G)
    solver.setup(P_upper, c, G, scaled.lower, scaled.upper, **SETTINGS)
    result = solver.solve(raise_error=False)
    status = Status(result.info.status_val)
    if status is Status.INTERRUPTED:
        raise KeyboardInterrupt
    if status is not Status.SOLVED:
        return RawSolution(status, int(result.info.iter), None, None)
    return RawSolution(status, int(result.info.iter), np.array(result.x), np.array(result.y))


def _refuse_nan(P: Floats, c: Floats, scaled: ScaledProgram) -> None:
    """OSQP does not reject NaN, and limits must be ordered."""
    numbers = (P, c, scaled.G)
    if not all(np.isfinite(part).all() for part in numbers):
        raise UsageError("the quadratic program's data is not finite")
    if not np.all(scaled.lower <= scaled.upper):
        raise UsageError("the quadratic program's limits are not ordered, or not numbers")


# --- Polish to round-off: least squares with limits by the primal active-set method

RANK = 1e-9  # of the largest singular value; leaves a gradient a tenth of what is accepted
SIGN = 1e-11  # multipliers of the wrong sign below this are round-off; gradients are O(1)
INDEPENDENT = 1e-9  # sine of a unit row's angle to the span of the others
PASSES = 4  # at most: from the second on, moves onto the limits are round-off
NEAR = 1e-6  # this near a limit, the first guess takes it as active
FAR = 1e6  # beyond every limit, in units in which the program is O(1)


@dataclass(frozen=True)
class Polished:
    """x (n,), multipliers mu (m,), rank of A."""

    x: Floats
    mu: Floats
    rank: int


@dataclass(frozen=True)
class _State:
    """A feasible point and its working set: +1 at the upper, −1 at the lower limit, 0 inactive."""

    x: Floats
    side: tuple[int, ...]
    mu: Floats
    done: bool = False

    @cached_property
    def rows(self) -> list[int]:
        return [i for i, side in enumerate(self.side) if side]

    def with_side(self, row: int, side: int) -> _State:
        sides = list(self.side)
        sides[row] = side
        return replace(self, side=tuple(sides))


def polish(scaled: ScaledProgram, x: Floats) -> Polished:
    """Refine a nearly feasible x to the optimum (nearest to 0, if there are several)."""
    values, rows = np.linalg.svd(scaled.A, full_matrices=False)[1:]
    rank = int(np.sum(values > RANK * np.max(values, initial=0.0)))
    x, mu = solve_active_set(scaled, x)
    if rank < x.size:
        x = solve_active_set(_nearest(scaled, rows[:rank], x), x)[0]
    return Polished(x, mu, rank)


def _nearest(scaled: ScaledProgram, rows: Floats, x: Floats) -> ScaledProgram:
    """min ½‖z‖² over the optima: those feasible z with the same A z and costᵀz as the optimum x.

    The multipliers of the first problem belong to every one of its optima, so they stay.
    """
    if scaled.cost.any():
        rows = np.vstack([rows, scaled.cost / np.linalg.norm(scaled.cost)])
    fixed = rows @ x
    return ScaledProgram(
        A=np.eye(x.size),
        b=np.zeros(x.size),
        G=np.vstack([scaled.G, rows]),
        lower=np.append(scaled.lower, fixed),
        upper=np.append(scaled.upper, fixed),
        cost=np.zeros(x.size),
    )


def solve_active_set(scaled: ScaledProgram, x: Floats) -> tuple[Floats, Floats]:
    """x and mu at the optimum, from a nearly feasible x.

    Moving onto the limits shifts x by the solver's tolerance at first, by round-off in the end.
    """
    state = _first_guess(scaled, x)
    for _ in range(PASSES):
        state = _descend(scaled, state)
        shift = _onto_limits(scaled, state)
        state = replace(state, x=state.x + shift)
        if np.linalg.norm(shift) <= SIGN:
            break
    return state.x, state.mu


def _descend(scaled: ScaledProgram, state: _State) -> _State:
    """Algorithm 16.3; if its steps run out, the last point is returned and the judge decides.

    A limit that x violates by a solver's tolerance stops the first step that makes it worse.
    """
    most = 10 * sum(scaled.G.shape) + 50
    for step in range(most):
        state = _step(scaled, state, cautious=step > most // 2)
        if state.done:
            break
    return replace(state, done=False)


def _first_guess(scaled: ScaledProgram, x: Floats) -> _State:
    """The working set of all equalities, then every limit x is near to, if independent."""
    row, equal = scaled.G @ x, scaled.lower == scaled.upper
    below, above = row - scaled.lower <= NEAR, scaled.upper - row <= NEAR
    side = np.where(above, 1, np.where(below, -1, 0))
    state = _State(x, (0,) * row.size, np.zeros(row.size))
    for i in [*np.flatnonzero(equal), *np.flatnonzero((side != 0) & ~equal)]:
        Z = _null_space(scaled.G[state.rows])
        if np.linalg.norm(Z.T @ scaled.G[i]) > INDEPENDENT:
            state = state.with_side(int(i), int(side[i]) or 1)
    return state


def _null_space(rows: Floats) -> Floats:
    """Orthonormal Z (n, n − k) with rows @ Z = 0, for k independent rows."""
    return np.asarray(np.linalg.qr(rows.T, mode="complete")[0][:, rows.shape[0] :])


def _step(scaled: ScaledProgram, state: _State, cautious: bool) -> _State:
    """Go to the minimum on the working set; meet a new limit, or drop a wrong one, or be done."""
    p = _direction(scaled, state)
    alpha, row, side = _longest(scaled, state, p)
    state = replace(state, x=state.x + alpha * p)
    if side:
        return state.with_side(row, side)
    mu = _multipliers(scaled, state)
    wrong = np.where(scaled.lower == scaled.upper, 0.0, -mu * np.array(state.side))
    if np.max(wrong, initial=0.0) <= SIGN:
        return replace(state, mu=mu, done=True)
    # Bland's rule cannot cycle; the largest is faster
    dropped = np.argmax(wrong > SIGN) if cautious else np.argmax(wrong)
    return replace(state, mu=mu).with_side(int(dropped), 0)


def _direction(scaled: ScaledProgram, state: _State) -> Floats:
    """The shortest step p with G_W p = 0 that minimises the objective.

    Where the cost falls along a direction that A does not see, the step goes that way beyond all
    limits: every direction of a falling cost has one.
    """
    Z = _null_space(scaled.G[state.rows])
    residual, cost = scaled.A @ state.x + scaled.b, Z.T @ scaled.cost
    U, s, Vt = np.linalg.svd(scaled.A @ Z, full_matrices=False)
    keep = s > RANK * np.linalg.norm(scaled.A, ord=2) if s.size else s > 0.0
    U, s, V = U[:, keep], s[keep], Vt[keep].T
    p = V @ ((U.T @ residual + (V.T @ cost) / s) / s)
    unseen = cost - V @ (V.T @ cost)
    if np.linalg.norm(unseen) > SIGN * (1.0 + np.linalg.norm(scaled.cost)):
        p = FAR * unseen / np.linalg.norm(unseen)
    return np.asarray(-Z @ p)


def _longest(scaled: ScaledProgram, state: _State, p: Floats) -> tuple[float, int, int]:
    """The part of p (at most 1) up to the first limit, with its row and side (0: none there)."""
    slope = scaled.G @ p
    row = scaled.G @ state.x
    meets = (np.array(state.side) == 0) & (np.abs(slope) > INDEPENDENT * np.linalg.norm(p))
    ahead = np.where(slope > 0.0, scaled.upper, scaled.lower)
    room = np.full(row.size, np.inf)
    room[meets] = np.maximum((ahead - row)[meets] / slope[meets], 0.0)
    first = int(np.argmin(room)) if room.size else 0
    if room.size == 0 or room[first] >= 1.0:
        return 1.0, 0, 0
    return float(room[first]), first, 1 if slope[first] > 0.0 else -1


def _multipliers(scaled: ScaledProgram, state: _State) -> Floats:
    """mu (m,) with Aᵀ(A x + b) + Gᵀ mu = 0 on the working set, 0 elsewhere."""
    gradient = scaled.gradient(state.x)
    mu = np.zeros(len(state.side))
    if state.rows:
        mu[state.rows] = np.linalg.lstsq(scaled.G[state.rows].T, -gradient, rcond=None)[0]
    return mu


def _onto_limits(scaled: ScaledProgram, state: _State) -> Floats:
    """The shortest shift (n,) of x exactly onto the limits of the working set."""
    if not state.rows:
        return np.zeros(state.x.size)
    rows = scaled.G[state.rows]
    limits = np.where(np.array(state.side) > 0, scaled.upper, scaled.lower)[state.rows]
    return np.asarray(np.linalg.lstsq(rows, limits - rows @ state.x, rcond=None)[0])
