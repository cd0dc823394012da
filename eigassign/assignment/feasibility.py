"""Which limits contradict each other, by name, so that no design meets them all."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.inputs import Floats, LinearConstraint
from eigassign.assignment.program import Bounds, QuadraticProgram, ScaledProgram
from eigassign.errors import InfeasibleError

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
