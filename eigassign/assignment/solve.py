"""A scaled program handed to OSQP, whose traps are all handled here.

What OSQP 1.1 does, and the answer to each: its tolerances default to 1e-3 (set to 1e-9); on
failure x is 2143289344.0 and not NaN (x is read only when the status is 1); NaN in the data is not
refused (refused here); a lower triangle is ignored (the upper one is given); an interrupt is
swallowed (raised again); its own polishing may worsen the answer, and prints to stdout in spite of
``verbose=False`` (off; `active_set` polishes, and `certificate` judges both). With a positive
semidefinite P and ordered limits nothing is printed, so stdout needs no redirection.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from eigassign.assignment.checks import Floats
from eigassign.assignment.scales import ScaledProgram
from eigassign.errors import UsageError


class Status(IntEnum):
    """What OSQP says of a run; the names are its own."""

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
        """For people: ``maximum iterations`` and the like."""
        return self.name.lower().replace("_", " ")


@dataclass(frozen=True)
class RawSolution:
    """What OSQP returned: x (n,) and multipliers mu (rows of G,), None unless it says solved."""

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
    solver = osqp.OSQP()
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
