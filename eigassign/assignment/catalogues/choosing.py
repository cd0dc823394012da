"""The two problems whose combinations the tree of `branching` chooses.

**The program of eqs. (13)–(14)** (`solve_catalogue`). A node's relaxation is the program within the
hull of its rows. Its bound does not trust the solver: J is convex, so that with any design ŷ, any
multipliers ν of the constraints C y, and h = ∇J(ŷ) + Cᵀν, every admissible y has

    J(y) ≥ J(ŷ) + min h·(y − ŷ) − max ν·C (y − ŷ)

where the minimum is over the rows of the node and the bounds of the continuous columns, the maximum
over the limits of C y. An inaccurate ŷ or ν makes the bound low, never wrong. It is a sum over the
catalogues, and so a bound for each of their rows. All combinations of a small node are bounded at
once, by J ≥ ‖P (A (y − y0) + b)‖², where P projects onto what continuous columns cannot change;
without such columns that bound is J itself.

**The exact problem** (`choose`), solved in steps. A combination is the problem with the listed
columns held, its continuous columns minimised by `sequential`. Few combinations (`are_few`) are
gone through one by one, each as far as what is known of it (`Least`) does not put it behind the
best: without continuous columns the best few are the best there are. Of more, a node's relaxation
is the problem within the hull of its rows. That is a local optimum and no bound: the best of a tree
is the best found.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from math import prod

import numpy as np

from eigassign.assignment.catalogues.branching import (
    KEEP,
    SECONDS,
    CatalogueProblem,
    CatalogueSearch,
    Combination,
    ListedValues,
    Node,
    Relaxed,
    Rows,
    distinct_rows,
    hull,
    none_found,
    search_catalogue,
)
from eigassign.assignment.exact.design_problem import MET, DesignProblem, best_first
from eigassign.assignment.exact.sequential import End, Optimum, minimise, worth
from eigassign.assignment.feasibility import (
    TOUCH,
    feasible_point,
    reach,
    refuse_impossible,
    row_rounding,
    smallest,
)
from eigassign.assignment.optimality import best_candidate
from eigassign.assignment.program import Bounds, QuadraticProgram, scaled_program, unscaled
from eigassign.assignment.solver import solve_osqp, solve_program
from eigassign.assignment.targets import Floats
from eigassign.errors import AccuracyError, EigassignError, InfeasibleError

# --- The program of eqs. (13)–(14)

# Bounds further away are taken to be there, in units that change λ by 100 %: no linear model holds
# so far, and h·y of a continuous column, 0 but for OSQP's tolerance, is multiplied by it.
FAR = 1e4
# Of the distance between rows: their effect on λ counts (by the range of their values alone a tree
# has 1.4 times as many nodes), but rows without any are still different rows.
APART = 1e-3


def solve_catalogue(
    program: QuadraticProgram,
    catalogues: Sequence[ListedValues],
    seconds: float = SECONDS,
) -> CatalogueSearch:
    """The combinations of least J(y), the continuous columns at their optimum for each.

    Rows outside the program's bounds do not count, nor do repetitions of a row. Every answer is
    certified as those of `solve_assignment` are.

    Raises:
        UsageError: columns that do not exist, or that two catalogues own.
        InfeasibleError: no combination meets all limits (the tree was searched to its end);
            ``constraints`` names a smallest set of them, or the catalogue without admissible row.
        AccuracyError: time ran out before any combination was found.
    """
    problem = _OneShot(program, catalogues)
    refuse_impossible(problem.program)

    def contradict(names: list[str]) -> bool:
        feasible = replace(program, A=np.zeros_like(program.A), b=np.zeros_like(program.b))
        only = feasible.within(program.bounds, [c for c in program.constraints if c.name in names])
        try:
            search_catalogue(_OneShot(only, catalogues), 1, seconds)
        except AccuracyError:
            return False
        except InfeasibleError:
            return True
        return False

    try:
        return search_catalogue(problem, KEEP, seconds)
    except InfeasibleError:
        needed = smallest(dict.fromkeys(program.constraint_names), contradict)
    listed = " and ".join(map(repr, needed))
    lists = ", ".join(repr(own.name) for own in catalogues)
    raise InfeasibleError(f"no combination of the catalogues {lists} meets {listed}", tuple(needed))


def held(
    program: QuadraticProgram, catalogues: Sequence[ListedValues], rows: Rows
) -> QuadraticProgram:
    """The program of a combination's continuous columns, the others held at its rows.

    Constraints of held columns alone are left out: the combination meets them.
    """
    bounds = hull(catalogues, tuple((row,) for row in rows), program.bounds)[0]
    free = bounds.lower < bounds.upper
    return program.within(bounds, [c for c in program.constraints if c.coefficients[free].any()])


class _OneShot(CatalogueProblem):
    """The program with the rows that its bounds admit.

    ``relaxed``: with A and b of as few rows as there are columns, and constraints that rounding
    cannot miss. ``room``: the least and the most of C y that continuous columns add. ``PAb``:
    P (A, b).
    """

    convex = True
    # 3¹² combinations of a smooth model of 152 samples: 0.6 s with 1, 0.4 s with 243, 0.2 s with
    # 4096 and with 16384
    small = 4096

    def __init__(self, program: QuadraticProgram, catalogues: Sequence[ListedValues]) -> None:
        super().__init__(catalogues, program.y0.size)
        admitted = zip(catalogues, self.root, strict=True)
        self.root = tuple(_within(program.bounds, own, rows) for own, rows in admitted)
        around = hull(catalogues, self.root, program.bounds)[0]
        self.program = program = program.within(around, program.constraints)
        R = np.linalg.qr(np.column_stack([program.A, program.b]))[1]  # ‖A dy + b‖ = ‖R (dy, 1)‖
        slack = TOUCH * program.scales.rows + row_rounding(program)
        lower, upper = program.c_lower - slack, program.c_upper + slack
        self.relaxed = replace(program, A=R[:, :-1], b=R[:, -1], c_lower=lower, c_upper=upper)
        unit, start = program.scales.y, program.y_start
        self.lower = np.maximum(program.lower, start - FAR * unit)
        self.upper = np.minimum(program.upper, start + FAR * unit)
        listed = [column for own in catalogues for column in own.columns]
        self.free = np.setdiff1d(np.arange(unit.size), listed)
        effect = R[:, :-1] * unit / np.sqrt(program.scales.objective)
        self.metric = np.vstack([effect, APART * np.eye(unit.size)]) / unit
        U, s, _ = np.linalg.svd(effect[:, self.free], full_matrices=False)
        U = U[:, s > 1e-13 * np.max(s, initial=0.0)]  # the rest changes nothing but round-off
        self.PAb = R - U @ (U.T @ R)
        C = program.C.copy()
        C[:, listed] = 0.0
        self.room = reach(replace(program, C=C))

    def relax(self, node: Node, near: Floats | None) -> Relaxed | None:
        """OSQP's optimum over the hull of the node, bounded without trusting it."""
        bounds, rows = hull(self.catalogues, node, self.relaxed.bounds)
        program = self.relaxed.within(bounds, [*self.relaxed.constraints, *rows])
        scaled, free = scaled_program(program), list(program.scales.free)
        x: Floats | None = np.zeros(len(free))
        mu = np.zeros(len(scaled.G))
        if free:
            raw = solve_osqp(scaled)
            x = feasible_point(scaled) if raw.x is None else raw.x
            mu = mu if raw.mu is None else raw.mu
        if x is None:
            return None
        answer, own = unscaled(program, scaled, x, mu), self.relaxed
        y, nu = answer.y, answer.constraint_multipliers[: len(own.C)]
        h, used = own.gradient(y) + own.C.T @ nu, nu != 0.0
        room = np.where(nu > 0.0, own.c_upper, own.c_lower)[used] - own.C[used] @ y
        box = np.minimum(h * (self.lower - y), h * (self.upper - y))[self.free]
        parts = [
            (c.rows[list(r)], list(c.columns)) for c, r in zip(self.catalogues, node, strict=True)
        ]
        costs = [(at - y[columns]) @ h[columns] for at, columns in parts]
        bound = own.objective(y) + box.sum() - nu[used] @ room + sum(map(min, costs))
        return Relaxed(y, bound, tuple(bound + cost - cost.min() for cost in costs))

    def ranked(self, node: Node) -> Iterator[tuple[float, Rows]]:
        """Yield combinations that can meet each constraint alone, by the module's bound of them."""
        program, (least, most) = self.relaxed, self.room
        places = np.indices(tuple(map(len, node))).reshape(len(node), -1)
        chosen = np.array([np.array(rows)[at] for rows, at in zip(node, places, strict=True)])
        Y = np.tile(program.y0, (chosen.shape[1], 1))
        row = np.zeros((chosen.shape[1], len(program.C)))
        for own, at in zip(self.catalogues, chosen, strict=True):
            columns = list(own.columns)
            Y[:, columns] = own.rows[at]
            row += own.rows[at] @ program.C[:, columns].T
        bounds = np.sum(((Y - program.y0) @ self.PAb[:, :-1].T + self.PAb[:, -1]) ** 2, axis=1)
        met = (row + least <= program.c_upper) & (row + most >= program.c_lower)
        possible = np.flatnonzero(met.all(axis=1))
        for i in possible[np.argsort(bounds[possible], kind="stable")]:
            yield float(bounds[i]), tuple(chosen[:, i].tolist())

    def fix(self, rows: Rows, cutoff: float) -> tuple[Floats, float] | None:
        relaxed = self.relax(tuple((row,) for row in rows), None)
        if relaxed is None or relaxed.bound >= cutoff:
            return None
        only = held(self.program, self.catalogues, rows)
        try:
            y = best_candidate(only, solve_program(only).candidates)[0].y
        except InfeasibleError:
            return None
        return y, self.program.objective(y)


def _within(bounds: Bounds, own: ListedValues, rows: Rows) -> Rows:
    """The rows of a catalogue that are within the bounds."""
    columns, at = list(own.columns), own.rows[list(rows)]
    inside = np.all((at >= bounds.lower[columns]) & (at <= bounds.upper[columns]), axis=1)
    if not inside.any():
        raise InfeasibleError(f"catalogue {own.name!r}: no row is within the bounds", (own.name,))
    return tuple(np.array(rows)[inside].tolist())


# --- The exact problem

RELAXED = 3  # starts of the relaxation of all combinations
MISSED = 1e-7  # of a constraint's terms: what the programs leave of a limit
# Combinations that are gone through one by one, without anything continuous and with. Of 16 000
# without that takes 14 to 35 s where a tree takes 40 to 200; of 6 000 with, 200 s and more.
LISTED, MOST = 20_000, 5000
TOGETHER = 64  # combinations that are looked at together
STOPPED = (End.SECONDS, End.INTERRUPTED)


@dataclass(frozen=True)
class Chosen:
    """The best combinations met, the best first: their rows, and each with its exact optimum.

    ``search`` is None where time ran out or Ctrl-C came before all was searched, and ``ended`` says
    which. ``each``: they were gone through one by one. ``settled``: of each of all ``count``
    combinations it is known that it is not better.
    """

    rows: tuple[Rows, ...]
    optima: tuple[Optimum, ...]
    search: CatalogueSearch | None
    appraisals: int
    count: int
    each: bool
    settled: bool
    ended: End | None


def are_listed(catalogues: Sequence[ListedValues], lower: Floats, upper: Floats) -> bool:
    """True where nothing continuous is left between the limits (n_y,) of a design."""
    listed = [column for own in catalogues for column in own.columns]
    return not np.delete(upper > lower, listed).any()


def are_few(catalogues: Sequence[ListedValues], lower: Floats, upper: Floats) -> bool:
    """True where all combinations are gone through one by one."""
    most = LISTED if are_listed(catalogues, lower, upper) else MOST
    return prod(len(distinct_rows(own)) for own in catalogues) <= most


def combinations(
    catalogues: Sequence[ListedValues], lower: Floats, upper: Floats
) -> tuple[list[Rows], Floats, Floats]:
    """All combinations, none twice, and the limits (n, n_y) that each leaves of others (n_y,)."""
    every = list(itertools.product(*(distinct_rows(own).tolist() for own in catalogues)))
    least, most = (np.tile(side, (len(every), 1)) for side in (lower, upper))
    for own, rows in zip(catalogues, np.array(every).T, strict=True):
        least[:, own.columns] = most[:, own.columns] = own.rows[rows]
    return every, least, most


class _StoppedError(Exception):
    """The search was ended, by the clock or by Ctrl-C."""

    def __init__(self, end: End) -> None:
        super().__init__(end.value)
        self.end = end


def choose(
    problem: DesignProblem,
    catalogues: Sequence[ListedValues],
    starts: Sequence[Floats],
    steps: int = 100,
    deadline: float = np.inf,
    progress: Callable[[str], None] = lambda _: None,
    lacking: Callable[[Floats], float] = lambda _: 0.0,
) -> Chosen:
    """The combination with the least violation, then the least F; begun near ``starts``.

    Few combinations (`are_few`) are gone through one by one, those of which it is known that they
    are no better excepted; more are searched as a tree. The first few starts are tried at its root.
    If no combination meets all limits, the tree is searched anew for the one that misses them
    least. ``deadline`` is a time of `time.monotonic`. ``lacking`` says of a design (n_y,) without
    anything continuous, which meets all limits, what it misses besides. Raises AccuracyError where
    no combination has an answer.
    """
    exact = _Exact(problem, catalogues, starts, steps, deadline, progress, lacking)
    each = are_few(catalogues, problem.lower, problem.upper)
    search, ended = None, None
    try:
        search = exact.enumerated() if each else exact.searched()
    except _StoppedError as stopped:
        ended = stopped.end
    except AccuracyError:  # of a tree, in which no combination was met in time
        ended = End.SECONDS
    except KeyboardInterrupt:
        ended = End.INTERRUPTED
    if not exact.fixed and exact.solved(exact.nearest(exact.root, starts[0])) is None:
        raise AccuracyError("catalogues: the mechanism has no modes with any of the combinations")
    best = best_first(sorted(exact.fixed), exact.worth)[:KEEP]
    optima = tuple(exact.fixed[rows] for rows in best)
    settled, count = search is not None and each and exact.is_listed, prod(map(len, exact.root))
    return Chosen(tuple(best), optima, search, exact.appraisals, count, each, settled, ended)


class _Exact(CatalogueProblem):
    """The caller's problem; every combination is solved once.

    ``value`` of an optimum is what the tree makes small; None where the optimum does not count.
    """

    def __init__(
        self,
        problem: DesignProblem,
        catalogues: Sequence[ListedValues],
        starts: Sequence[Floats],
        steps: int,
        deadline: float,
        progress: Callable[[str], None],
        lacking: Callable[[Floats], float],
    ) -> None:
        super().__init__(catalogues, problem.lower.size)
        self.problem, self.starts, self.lacking = problem, starts, lacking
        self.is_listed = are_listed(catalogues, problem.lower, problem.upper)
        self.steps, self.deadline, self.progress = steps, deadline, progress
        self.bounds = Bounds(problem.lower, problem.upper)
        self.fixed: dict[Rows, Optimum] = {}
        self.lacks: dict[Rows, float] = {}
        self.appraisals, self.nodes = 0, 0
        self.value: Callable[[Optimum], float | None] = _of_feasible

    def worth(self, rows: Rows) -> tuple[float, float]:
        """Violation and F of a combination that was solved."""
        found = self.fixed[rows]
        if found.seen.violation <= MET and self.is_listed and rows not in self.lacks:
            self.lacks[rows] = self.lacking(found.y)
        return max(found.seen.violation, self.lacks.get(rows, 0.0)), found.objective

    def enumerated(self) -> CatalogueSearch:
        """Go through all combinations, those first of which least is known against them.

        What is known grows level by level (`Least`); at last a combination is solved. The search
        ends when the first few are.
        """
        problem = self.problem
        every, lower, upper = combinations(self.catalogues, problem.lower, problem.upper)
        levels = 0 if problem.least is None else problem.least.levels
        level, violation = np.zeros(len(every), dtype=int), self._kept(lower, upper)
        boxes = zip(lower, upper, strict=True)
        value = np.array([problem.least_value(*box, np.zeros(0)) for box in boxes])
        for start in self.starts:  # so that there is an answer when time runs out
            self.solved(self.nearest(self.root, start))
        while True:
            level[np.isinf(violation)] = levels + 1
            equal = violation <= max(violation.min(), 0.0) + MET
            order = np.lexsort((value, np.where(equal, 0.0, violation)))
            ahead = [k for k in order[:KEEP] if level[k] <= levels]
            if not ahead:
                break
            if time.monotonic() > self.deadline:
                raise _StoppedError(End.SECONDS)
            first = ahead[0]
            if problem.least is not None and level[first] < levels:
                alike = order[level[order] == level[first]]
                alike = alike[:TOGETHER] if level[first] else alike
                known = problem.least(level[first], lower[alike], upper[alike])
                for k, (missed, residual) in zip(alike, known, strict=True):
                    violation[k] = max(violation[k], missed)
                    value[k] = problem.least_value(lower[k], upper[k], residual)
            else:
                self.progress(f"catalogues: {len(self.fixed)} of {len(every)} combinations solved")
                alike, found = np.array([first]), self.solved(every[first])
                if found is not None and found.end in STOPPED:
                    raise _StoppedError(found.end)
                none = np.inf, np.inf
                violation[first], value[first] = self.worth(every[first]) if found else none
            level[alike] += 1
        if np.isinf(violation[order[0]]):
            raise none_found(self, len(every), exhausted=True)
        best = [every[k] for k in order[:KEEP] if np.isfinite(violation[k])]
        told = (Combination(rows, self.fixed[rows].y, self.fixed[rows].objective) for rows in best)
        return CatalogueSearch(tuple(told), float(value[order[0]]), len(every), exhausted=True)

    def _kept(self, lower: Floats, upper: Floats) -> Floats:
        """0 of each box of designs that linear limits leave something of, else infinite."""
        kept = np.ones(len(lower), dtype=bool)
        for row in self.problem.constraints:
            ends = row.coefficients * lower, row.coefficients * upper
            size = MISSED * np.maximum(*np.abs(ends)).sum(axis=1)
            kept &= np.minimum(*ends).sum(axis=1) <= row.upper + size
            kept &= np.maximum(*ends).sum(axis=1) >= row.lower - size
        return np.where(kept, 0.0, np.inf)

    def searched(self) -> CatalogueSearch:
        """Search by F of what meets all limits; where nothing does, by the violation."""
        try:
            return self._search()
        except InfeasibleError:
            self.value = lambda found: found.seen.violation
            return self._search()

    def _search(self) -> CatalogueSearch:
        left = min(max(self.deadline - time.monotonic(), 0.0), 600.0)  # where the case gives none
        starts = dict.fromkeys(self.nearest(self.root, start) for start in self.starts)
        return search_catalogue(self, KEEP, left, starts)

    def relax(self, node: Node, near: Floats | None) -> Relaxed | None:
        self.nodes += 1
        self.progress(f"catalogues: {self.nodes} nodes searched")
        bounds, rows = hull(self.catalogues, node, self.bounds)
        constraints = (*self.problem.constraints, *rows)
        problem = replace(
            _with_linear_price(self.problem, self.catalogues, node),
            lower=bounds.lower,
            upper=bounds.upper,
            constraints=constraints,
        )
        starts = list(self.starts[:RELAXED])
        if near is not None:  # optima of the whole are those of a node that holds them
            within = ((bounds.lower <= y) & (y <= bounds.upper) for y in starts)
            starts = [near, *(y for y, at in zip(starts, within, strict=True) if at.all())]
        found = (self._valued(self._minimised(problem, start)) for start in starts)
        best = min(filter(None, found), key=lambda each: each[1], default=None)
        return None if best is None else Relaxed(*best)

    def fix(self, rows: Rows, cutoff: float) -> tuple[Floats, float] | None:
        return self._valued(self.solved(rows))

    def _valued(self, found: Optimum | None) -> tuple[Floats, float] | None:
        if found is None:
            return None
        if found.end in STOPPED:
            raise _StoppedError(found.end)
        value = self.value(found)
        return None if value is None else (found.y, value)

    def solved(self, rows: Rows) -> Optimum | None:
        """The optimum with a combination's columns held; None where it has no answer."""
        if rows in self.fixed:
            return self.fixed[rows]
        at = hull(self.catalogues, tuple((row,) for row in rows), self.bounds)[0]
        problem = replace(self.problem, lower=at.lower, upper=at.upper)
        starts = [self.starts[0]]
        if self.fixed and not self.is_listed:
            starts += [best_first(self.fixed.values(), worth)[0].y]
        each = (self._minimised(problem, np.clip(y, at.lower, at.upper)) for y in starts)
        found = best_first(filter(None, each), worth)
        if found:
            self.fixed[rows] = found[0]
        return self.fixed.get(rows)

    def _minimised(self, problem: DesignProblem, start: Floats) -> Optimum | None:
        try:
            found = minimise(problem, start, self.steps, self.deadline)
        except EigassignError:
            return None
        self.appraisals += found.appraisals
        for row in problem.constraints:  # which no step can mend where bounds are too tight
            size = MISSED * (np.abs(row.coefficients) @ np.abs(found.y) + 1e-300)
            if not row.lower - size <= row.coefficients @ found.y <= row.upper + size:
                return None
        return found


def _with_linear_price(
    problem: DesignProblem, catalogues: Sequence[ListedValues], node: Node
) -> DesignProblem:
    """The problem with prices that are linear over a node, and of no combination above its own."""
    if problem.cost is None:
        return problem
    prices, constant = problem.cost.prices.copy(), 0.0
    for own, rows in zip(catalogues, node, strict=True):
        slopes, rest = own.price_below(rows)
        prices[list(own.columns)] += slopes
        constant += rest + float(slopes @ problem.cost.reference[list(own.columns)])
    return replace(problem, cost=replace(problem.cost, prices=prices, listed=lambda _y: constant))


def _of_feasible(found: Optimum) -> float | None:
    """F where all limits are met."""
    return found.objective if found.seen.violation <= MET else None
