"""Programs with linear limits, solved by OSQP, and on to round-off by the active-set method.

    min ½‖A x + b‖² + costᵀx  with  lower ≤ G x ≤ upper

The primal active-set method (Nocedal, Wright, Numerical Optimization, 2nd ed., algorithm 16.3, in
null-space form) works on A, not on AᵀA, so that digits are lost with cond(A) only. A start that
violates a limit by no more than a solver's tolerance is good enough. A step of a search, whose
start is feasible, goes by it alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eigassign.arrays import Floats
from eigassign.errors import UsageError

T = TypeVar("T")
MISSED = 1e-7  # of a constraint's terms: what programs leave of it
TOUCH = 1e-9  # of a constraint's terms: a tenth of the violation that the one shot accepts
SNAP = 1e-10  # of a parameter's unit: this near to a bound is on it
RANK = 1e-9  # of the largest singular value; leaves a gradient a tenth of what is accepted
SIGN = 1e-11  # multipliers of the wrong sign below this are round-off; gradients are O(1)
INDEPENDENT = 1e-9  # sine of a unit row's angle to the span of the others
PASSES = 4  # at most: from the second on, moves onto the limits are round-off
NEAR = 1e-6  # this near a limit, the first guess takes it as active
FAR = 1e6  # beyond every limit, in units in which the program is O(1)


def frozen(values: ArrayLike) -> Floats:
    """A float64 copy that cannot be written to."""
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


@dataclass(frozen=True)
class LinearConstraint:
    """lower ≤ coefficients @ y ≤ upper, on y itself (not on y − y0); (n_y,), SI units."""

    name: str
    coefficients: Floats
    lower: float = -np.inf
    upper: float = np.inf

    def __call__(self, y: Floats) -> tuple[float, Floats]:
        """Its value at a design y (n_y,), and the slopes (n_y,)."""
        return float(self.coefficients @ y), self.coefficients


class Program(NamedTuple):
    """min ½‖A x + b‖² + costᵀx  with  lower ≤ G x ≤ upper, in units in which all is O(1).

    The rows of G, those of parameters that bounds hold among them, have norm 1.
    """

    A: Floats
    b: Floats
    G: Floats
    lower: Floats
    upper: Floats
    cost: Floats

    def gradient(self, x: Floats) -> Floats:
        """Aᵀ(A x + b) + cost (n,)."""
        return np.asarray(self.A.T @ (self.A @ x + self.b) + self.cost)

    def some(self, rows: NDArray[np.bool_]) -> Program:
        """The program with these rows of G only."""
        return self._replace(G=self.G[rows], lower=self.lower[rows], upper=self.upper[rows])


class Solved(NamedTuple):
    """x (n,), multipliers mu (rows of G,), OSQP's iterations and how it ended, in its words."""

    x: Floats
    mu: Floats
    iterations: int = 0
    status: str = ""


def solve_program(program: Program, start: Floats | None = None) -> Solved | None:
    """The optimum; None where limits contradict.

    Multipliers are positive at an upper limit, and Aᵀ(A x + b) + cost + Gᵀmu = 0. The ``start``
    (n,) is feasible; without one OSQP solves, and where it does not a feasible point is sought.
    Moving onto the limits shifts x by the violation of the start at first, by round-off in the end.
    Raises UsageError for data that is not a number, or limits that are not ordered.
    """
    if not all(np.isfinite(part).all() for part in (program.A, program.b, program.G, program.cost)):
        raise UsageError("the program's data is not finite")
    if not np.all(program.lower <= program.upper):
        raise UsageError("the program's limits are not ordered, or not numbers")
    x, iterations, status = start, 0, "solved"
    if x is None and program.cost.size:
        x, iterations, status = by_osqp(program)
    x = feasible_point(program) if x is None else x
    if x is None:
        return None
    side = _first_guess(program, x)
    for _ in range(PASSES):
        x, mu = _descend(program, x, side)
        rows, limits = program.G[side != 0], np.where(side > 0, program.upper, program.lower)
        shift = np.linalg.lstsq(rows, limits[side != 0] - rows @ x, rcond=None)[0]
        x = x + shift
        if np.linalg.norm(shift) <= SIGN:
            break
    return Solved(x, mu, iterations, status)


SETTINGS = {  # of OSQP, whose tolerances are 1e-3 and whose polishing may worsen the answer
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


def by_osqp(program: Program) -> tuple[Floats | None, int, str]:
    """OSQP's x (n,), None unless it says solved (x is 2143289344.0 then); iterations and status.

    Raises KeyboardInterrupt, which it swallows.
    """
    import osqp
    from scipy.sparse import csc_matrix

    solver = osqp.OSQP(algebra="builtin")  # without a name it looks for others on the disk
    P = csc_matrix(np.triu(program.A.T @ program.A))  # it ignores a lower triangle
    c, G = program.A.T @ program.b + program.cost, csc_matrix(program.G)
    solver.setup(P, c, G, program.lower, program.upper, **SETTINGS)
    found = solver.solve(raise_error=False)
    status = osqp.SolverStatus(found.info.status_val)
    if status == osqp.SolverStatus.OSQP_SIGINT:
        raise KeyboardInterrupt
    solved, words = status == osqp.SolverStatus.OSQP_SOLVED, status.name.removeprefix("OSQP_")
    x = np.array(found.x) if solved else None
    return x, int(found.info.iter), words.lower().replace("_", " ")


def _first_guess(program: Program, x: Floats) -> NDArray[np.int_]:
    """The working set (rows of G,), ±1 at upper and lower limits that x is near, if independent."""
    row, equal = program.G @ x, program.lower == program.upper
    below, above = row - program.lower <= NEAR, program.upper - row <= NEAR
    near, side = np.where(above, 1, np.where(below, -1, 0)), np.zeros(len(row), dtype=int)
    for i in [*np.flatnonzero(equal), *np.flatnonzero((near != 0) & ~equal)]:
        Z = _null_space(program.G[side != 0])
        if np.linalg.norm(Z.T @ program.G[i]) > INDEPENDENT:
            side[i] = near[i] or 1
    return side


def _descend(program: Program, x: Floats, side: NDArray[np.int_]) -> tuple[Floats, Floats]:
    """Algorithm 16.3 from a working set, which it changes: x and mu.

    If its steps run out, the last point is returned and residuals decide. A limit that x violates
    stops the first step that makes it worse.
    """
    most, mu = 10 * sum(program.G.shape) + 50, np.zeros(len(side))
    fixed = program.lower == program.upper
    for step in range(most):
        p = _direction(program, x, side)
        alpha, row, meets = _longest(program, x, side, p)
        x = x + alpha * p
        if meets:
            side[row] = meets
            continue
        active = side != 0
        mu[:] = 0.0
        mu[active] = np.linalg.lstsq(program.G[active].T, -program.gradient(x), rcond=None)[0]
        wrong = np.where(fixed, 0.0, -mu * side)
        if np.max(wrong, initial=0.0) <= SIGN:
            break
        # Bland's rule cannot cycle; the largest is faster
        side[np.argmax(wrong > SIGN) if step > most // 2 else np.argmax(wrong)] = 0
    return x, mu


def _null_space(rows: Floats) -> Floats:
    """Orthonormal Z (n, n − k) with rows @ Z = 0, for k independent rows."""
    return np.asarray(np.linalg.qr(rows.T, mode="complete")[0][:, rows.shape[0] :])


def _direction(program: Program, x: Floats, side: NDArray[np.int_]) -> Floats:
    """The shortest step p with G_W p = 0 that minimises the objective.

    Where the cost falls along a direction that A does not see, the step goes that way beyond all
    limits: every direction of a falling cost has one.
    """
    Z = _null_space(program.G[side != 0])
    residual, cost = program.A @ x + program.b, Z.T @ program.cost
    U, s, Vt = np.linalg.svd(program.A @ Z, full_matrices=False)
    keep = s > RANK * np.linalg.norm(program.A, ord=2) if s.size else s > 0.0
    U, s, V = U[:, keep], s[keep], Vt[keep].T
    p = V @ ((U.T @ residual + (V.T @ cost) / s) / s)
    unseen = cost - V @ (V.T @ cost)
    if np.linalg.norm(unseen) > SIGN * (1.0 + np.linalg.norm(program.cost)):
        p = FAR * unseen / np.linalg.norm(unseen)
    return np.asarray(-Z @ p)


def _longest(
    program: Program, x: Floats, side: NDArray[np.int_], p: Floats
) -> tuple[float, int, int]:
    """The part of p (at most 1) up to the first limit, with its row and side (0: none there)."""
    slope, row = program.G @ p, program.G @ x
    meets = (side == 0) & (np.abs(slope) > INDEPENDENT * np.linalg.norm(p))
    ahead = np.where(slope > 0.0, program.upper, program.lower)
    room = np.full(row.size, np.inf)
    room[meets] = np.maximum((ahead - row)[meets] / slope[meets], 0.0)
    first = int(np.argmin(room)) if room.size else 0
    if room.size == 0 or room[first] >= 1.0:
        return 1.0, 0, 0
    return float(room[first]), first, 1 if slope[first] > 0.0 else -1


# --- Limits that contradict each other


def feasible_point(program: Program) -> Floats | None:
    """Some x (n,) within all limits, to 1e-9 of each; None if there is none."""
    from scipy.optimize import linprog

    G = np.vstack([program.G, -program.G])
    h = np.concatenate([program.upper, -program.lower])
    finite = np.isfinite(h)
    nothing = np.zeros(G.shape[1])
    if not nothing.size:
        return nothing if np.all(h >= -TOUCH) else None
    A, b = G[finite], h[finite]
    found = linprog(
        nothing, A, b, bounds=(None, None), options={"primal_feasibility_tolerance": TOUCH}
    )
    return np.asarray(found.x) if found.status == 0 else None


def constraints_agree(rows: Sequence[LinearConstraint], lower: Floats, upper: Floats) -> bool:
    """True where a design between two (n_y,) meets all linear limits, to 1e-9 of their terms."""
    if not rows:
        return True
    C = np.array([row.coefficients for row in rows])
    low, high = np.array([(row.lower, row.upper) for row in rows]).T
    n = len(lower)
    size = np.abs(C) @ np.maximum(np.abs(lower), np.abs(upper))
    size = np.where(size > 0.0, size, 1.0)
    fixed = C @ lower
    G = np.vstack([np.eye(n), C * (upper - lower) / size[:, None]])
    least = np.append(np.zeros(n), (low - fixed) / size - TOUCH)
    most = np.append(np.ones(n), (high - fixed) / size + TOUCH)
    nothing = np.zeros(n)
    return feasible_point(Program(G[:0], nothing[:0], G, least, most, nothing)) is not None


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
