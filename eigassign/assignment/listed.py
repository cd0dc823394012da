"""Parameters that take listed values only, and the program of eqs. (13)–(14) over them.

A list has rows; each row sets the columns of the design y that the list owns: one for a list of
values, several for a list of sections. A row of every list is a combination; the other columns stay
continuous.

All combinations are bounded at once, by J ≥ ‖P (A (y − y0) + b)‖², where P projects onto what
continuous columns cannot change: without such columns that bound is J itself. They are solved in
the order of their bounds, until none that is left is below the best few.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from math import prod

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.feasibility import (
    TOUCH,
    reach,
    refuse_impossible,
    row_rounding,
    smallest,
)
from eigassign.assignment.optimality import best_candidate
from eigassign.assignment.program import Bounds, QuadraticProgram
from eigassign.assignment.solver import solve_program
from eigassign.assignment.targets import Floats, finite, frozen, same_length
from eigassign.errors import AccuracyError, InfeasibleError, UsageError

Rows = tuple[int, ...]  # one row of every list: a combination
Ints = NDArray[np.intp]
KEEP = 5  # the combinations that are told of
MOST = 2_000_000  # combinations that are bounded: 3¹² take 0.6 s
AT_ONCE = 65_536  # of these
SOLVED = 3_000  # programs of combinations, about 1 ms each


@dataclass(frozen=True)
class ListedValues:
    """Listed values of some columns of y: row r sets y[columns] = rows[r], (n_rows, n_columns).

    ``prices`` (n_rows,): what a whole row costs, of F; none where its columns have prices, if any.
    """

    name: str
    columns: tuple[int, ...]
    rows: Floats
    labels: tuple[str, ...] = ()
    prices: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        what = f"catalogue {self.name!r}"
        object.__setattr__(self, "rows", finite(what, self.rows, 2))
        if not self.rows.size:
            raise UsageError(f"{what}: lists nothing to choose from")
        same_length(f"{what}, values", self.rows.shape[1], len(self.columns), "parameters it sets")
        if self.labels:
            same_length(f"{what}, labels", len(self.labels), self.rows.shape[0], "rows")

    @property
    def distinct(self) -> Ints:
        """The first of all rows that are equal, in the order of the list."""
        return np.sort(np.unique(self.rows, axis=0, return_index=True)[1])

    def nearest(self, y: Floats) -> Ints:
        """The rows (...) nearest to designs (..., n_y), in shares of the columns' ranges."""
        width = np.ptp(self.rows, axis=0)
        unit = np.where(width > 0.0, width, 1.0)
        away = (self.rows - y[..., None, list(self.columns)]) / unit
        return np.asarray(np.linalg.norm(away, axis=-1).argmin(axis=-1))

    def price(self, y: Floats) -> Floats | float:
        """The prices (...) of the rows nearest to designs (..., n_y)."""
        return np.array(self.prices)[self.nearest(y)] if self.prices else 0.0


@dataclass(frozen=True)
class Combination:
    """The row of every list, the design y (n_y,) in SI units, and its objective."""

    rows: Rows
    y: Floats
    objective: float


@dataclass(frozen=True)
class CatalogueSearch:
    """The best combinations of the program, and how far they can be from the best there is.

    ``best``: distinct combinations, the best first. ``lower_bound``: no combination is below it.
    ``solved`` of them were solved; ``exhausted``: all others are known not to be better.
    """

    best: tuple[Combination, ...]
    lower_bound: float
    solved: int
    exhausted: bool

    @property
    def gap(self) -> float:
        """Objective of the best combination − lower bound."""
        return self.best[0].objective - self.lower_bound

    @property
    def relative_gap(self) -> float:
        """``gap`` over the objective."""
        return self.gap / abs(self.best[0].objective) if self.gap > 0.0 else 0.0


def refuse_columns(listed: Sequence[ListedValues], n_y: int) -> None:
    """UsageError unless every column is one of y (n_y,) and has one owner."""
    owner: dict[int, str] = {}
    for own in listed:
        for column in own.columns:
            if not 0 <= column < n_y:
                raise UsageError(f"catalogue {own.name!r}: there is no column {column} of y")
            if column in owner:
                raise UsageError(
                    f"catalogues {owner[column]!r} and {own.name!r} both set column {column}"
                )
            owner[column] = own.name


def with_rows(listed: Sequence[ListedValues], rows: Ints, y: Floats) -> Floats:
    """Designs (n, n_y): y (n_y,) with the columns of each combination of rows (n, n_lists)."""
    designs = np.tile(y, (len(rows), 1))
    for own, at in zip(listed, rows.T, strict=True):
        designs[:, own.columns] = own.rows[at]
    return designs


def held(program: QuadraticProgram, listed: Sequence[ListedValues], rows: Rows) -> QuadraticProgram:
    """The program of a combination's continuous columns, the others held at its rows.

    Constraints of held columns alone are left out: the combination meets them.
    """
    at = np.array([rows])
    lower, upper = (with_rows(listed, at, y)[0] for y in (program.lower, program.upper))
    free = lower < upper
    own = [c for c in program.constraints if c.coefficients[free].any()]
    return program.within(Bounds(lower, upper), own)


def solve_catalogue(program: QuadraticProgram, listed: Sequence[ListedValues]) -> CatalogueSearch:
    """The combinations of least J(y), the continuous columns at their optimum for each.

    Rows outside the program's bounds do not count, nor do repetitions of a row. Every answer is
    certified as those of `solve_assignment` are.

    Raises:
        UsageError: columns that do not exist, or that two lists own.
        InfeasibleError: no combination meets all limits; ``constraints`` names a smallest set of
            them, or the list without admissible row.
        AccuracyError: there are more combinations than can be bounded, or none was found.
    """
    refuse_columns(listed, program.y0.size)
    allowed = [_within(program.bounds, own) for own in listed]
    refuse_impossible(_around(program, listed, allowed))
    if prod(map(len, allowed)) > MOST:
        raise AccuracyError(f"catalogues: more than {MOST} combinations: shorten the lists")
    found = _searched(program, listed, allowed, KEEP)
    if found is not None:
        return found

    def contradict(names: Collection[str]) -> bool:
        none = replace(program, A=np.zeros_like(program.A), b=np.zeros_like(program.b))
        only = none.within(program.bounds, [c for c in program.constraints if c.name in names])
        return _searched(only, listed, allowed, 1) is None

    needed = smallest(dict.fromkeys(program.constraint_names), contradict)
    meets, lists = (" and ".join(map(repr, needed)), ", ".join(repr(own.name) for own in listed))
    raise InfeasibleError(f"no combination of the catalogues {lists} meets {meets}", tuple(needed))


def _within(bounds: Bounds, own: ListedValues) -> Ints:
    """The rows of a list that are within the bounds."""
    columns, rows = list(own.columns), own.distinct
    at = own.rows[rows]
    inside = np.all((at >= bounds.lower[columns]) & (at <= bounds.upper[columns]), axis=1)
    if not inside.any():
        raise InfeasibleError(f"catalogue {own.name!r}: no row is within the bounds", (own.name,))
    return rows[inside]


def _around(
    program: QuadraticProgram, listed: Sequence[ListedValues], allowed: Sequence[Ints]
) -> QuadraticProgram:
    """The program with bounds around the rows."""
    lower, upper = program.lower.copy(), program.upper.copy()
    for own, rows in zip(listed, allowed, strict=True):
        columns, at = list(own.columns), own.rows[rows]
        lower[columns], upper[columns] = at.min(axis=0), at.max(axis=0)
    return program.within(Bounds(lower, upper), program.constraints)


def _searched(
    program: QuadraticProgram, listed: Sequence[ListedValues], allowed: Sequence[Ints], keep: int
) -> CatalogueSearch | None:
    """The best few combinations; None where there is none. AccuracyError where none was found."""
    around = _around(program, listed, allowed)
    bounds, chosen, beyond = _bounded(around, listed, allowed)
    best: list[Combination] = []
    lower, solved = beyond, 0
    for bound, at in zip(bounds.tolist(), chosen, strict=True):
        if len(best) == keep and bound >= best[-1].objective:
            break
        if solved == SOLVED:
            lower = min(lower, bound)
            break
        rows, solved = tuple(at.tolist()), solved + 1
        only = held(around, listed, rows)
        try:
            y = frozen(best_candidate(only, solve_program(only).candidates)[0].y)
        except InfeasibleError:
            continue
        found = [*best, Combination(rows, y, program.objective(y))]
        best = sorted(found, key=lambda one: (one.objective, one.rows))[:keep]
    if not best and np.isfinite(lower):
        raise AccuracyError("catalogues: no combination was found that meets all limits")
    if not best:
        return None
    exhausted = (len(best) == keep and lower >= best[-1].objective) or not np.isfinite(lower)
    return CatalogueSearch(tuple(best), min(lower, best[0].objective), solved, exhausted)


def _bounded(
    program: QuadraticProgram, listed: Sequence[ListedValues], allowed: Sequence[Ints]
) -> tuple[Floats, Ints, float]:
    """Bounds (n,) of the combinations (n, n_lists) that are least, and what no other is below.

    Those only that can meet each constraint alone.
    """
    R = np.linalg.qr(np.column_stack([program.A, program.b]))[1]  # ‖A dy + b‖ = ‖R (dy, 1)‖
    columns = [column for own in listed for column in own.columns]
    free = np.setdiff1d(np.arange(program.y0.size), columns)
    effect = R[:, free] * program.scales.y[free]
    U, s, _ = np.linalg.svd(effect, full_matrices=False)
    U = U[:, s > 1e-13 * np.max(s, initial=0.0)]  # the rest changes nothing but round-off
    P = R - U @ (U.T @ R)
    slack = TOUCH * program.scales.rows + row_rounding(program)
    C = program.C.copy()
    C[:, columns] = 0.0
    least, most = reach(replace(program, C=C))
    fixed = program.C - C
    parts: list[tuple[Floats, Ints]] = []
    beyond = np.inf
    for rows in every_combination(allowed, AT_ONCE):
        Y = with_rows(listed, rows, program.y0)
        row = Y @ fixed.T
        met = row + least <= program.c_upper + slack
        met &= row + most >= program.c_lower - slack
        rows, Y = rows[met.all(axis=1)], Y[met.all(axis=1)]
        parts.append((np.sum(((Y - program.y0) @ P[:, :-1].T + P[:, -1]) ** 2, axis=1), rows))
        bounds, kept = (np.concatenate(each) for each in zip(*parts, strict=True))
        order = np.argsort(bounds, kind="stable")
        beyond = min(beyond, float(bounds[order[SOLVED:]].min(initial=np.inf)))
        parts = [(bounds[order[:SOLVED]], kept[order[:SOLVED]])]
    return *parts[0], beyond


def every_combination(allowed: Sequence[Ints], at_once: int) -> Iterator[Ints]:
    """Yield all combinations (n, n_lists), so many at a time; the last list varies first."""
    if not allowed:  # there is one, of nothing
        yield np.zeros((1, 0), dtype=np.intp)
        return
    sizes = tuple(map(len, allowed))
    for start in range(0, prod(sizes), at_once):
        places = np.arange(start, min(start + at_once, prod(sizes)))
        each = zip(allowed, np.unravel_index(places, sizes), strict=True)
        yield np.stack([np.asarray(rows)[at] for rows, at in each], axis=1)
