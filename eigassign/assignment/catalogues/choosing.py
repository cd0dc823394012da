"""The best combination of catalogue rows for a problem solved in steps, by the tree of `branching`.

A node's relaxation is the problem within the hull of its rows; a combination is the problem with
the listed columns held. Both are minimised by `sequential`, the continuous columns along with them.
The relaxations are local optima, so that the bound holds as far as these are global.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from eigassign.assignment.catalogues.branching import (
    KEEP,
    CatalogueSearch,
    ListedValues,
    Node,
    Rows,
    distinct_rows,
    hull,
    search_catalogue,
)
from eigassign.assignment.checks import Floats
from eigassign.assignment.exact.design_problem import MET, DesignProblem, best_first
from eigassign.assignment.exact.sequential import End, Optimum, minimise, worth
from eigassign.assignment.program import Bounds
from eigassign.errors import AccuracyError, EigassignError, InfeasibleError

RELAXED = 3  # starts of the relaxation of all combinations
TOUCH = 1e-7  # of a constraint's terms: what the programs leave of a limit
STOPPED = (End.SECONDS, End.INTERRUPTED)


@dataclass(frozen=True)
class Chosen:
    """The best combinations met, the best first: their rows, and each with its exact optimum.

    ``search`` is None where time ran out or Ctrl-C came before the tree was searched.
    """

    rows: tuple[Rows, ...]
    optima: tuple[Optimum, ...]
    search: CatalogueSearch | None
    appraisals: int


class _StoppedError(Exception):
    """Time ran out inside the tree."""


def choose(
    problem: DesignProblem,
    catalogues: Sequence[ListedValues],
    starts: Sequence[Floats],
    steps: int = 100,
    deadline: float = np.inf,
    progress: Callable[[str], None] = lambda _: None,
) -> Chosen:
    """The combination with the least violation, then the least F; begun near ``starts``.

    The first few are tried at the root of the tree. If no combination meets all limits, the tree is
    searched anew for the one that misses them least. ``deadline`` is a time of `time.monotonic`.
    Raises AccuracyError where no combination has an answer.
    """
    tree = _Tree(problem, catalogues, starts, steps, deadline, progress)
    try:
        search = tree.searched()
    except (_StoppedError, AccuracyError):
        search = None
    if not tree.fixed and tree.solved(tree.nearest(starts[0])) is None:
        raise AccuracyError(
            "catalogues: no combination was met that the mechanism can be solved at"
        )
    best = best_first(sorted(tree.fixed), lambda rows: worth(tree.fixed[rows]))[:KEEP]
    return Chosen(tuple(best), tuple(tree.fixed[r] for r in best), search, tree.appraisals)


class _Tree:
    """The caller's problem as relaxations and combinations; every combination is solved once."""

    def __init__(
        self,
        problem: DesignProblem,
        catalogues: Sequence[ListedValues],
        starts: Sequence[Floats],
        steps: int,
        deadline: float,
        progress: Callable[[str], None],
    ) -> None:
        self.problem, self.catalogues, self.starts = problem, catalogues, starts
        self.steps, self.deadline, self.progress = steps, deadline, progress
        self.bounds = Bounds(problem.lower, problem.upper)
        self.fixed: dict[Rows, Optimum] = {}
        self.appraisals, self.nodes = 0, 0

    def searched(self) -> CatalogueSearch:
        """Search by F of what meets all limits; where nothing does, by the violation."""
        try:
            return self._search(lambda o: o.objective if o.seen.violation <= MET else None)
        except InfeasibleError:
            return self._search(lambda o: o.seen.violation)

    def _search(self, value: Callable[[Optimum], float | None]) -> CatalogueSearch:
        def relax(node: Node, near: Floats | None) -> tuple[Floats, float] | None:
            found = [(value(o), o) for o in self._relaxed(node, near)]
            met = [(v, o) for v, o in found if v is not None]
            best = min(met, key=lambda pair: pair[0], default=None)
            return None if best is None else (best[1].y, best[0])

        def fix(rows: Rows) -> tuple[Floats, float] | None:
            optimum = self.solved(rows)
            if optimum is not None and optimum.end in STOPPED:
                raise _StoppedError
            worth = None if optimum is None else value(optimum)
            return None if optimum is None or worth is None else (optimum.y, worth)

        left = min(max(self.deadline - time.monotonic(), 0.0), 600.0)  # where the case gives none
        starts = dict.fromkeys(map(self.nearest, self.starts))
        return search_catalogue(self.catalogues, relax, fix, KEEP, left, starts)

    def _relaxed(self, node: Node, near: Floats | None) -> Iterator[Optimum]:
        self.nodes += 1
        self.progress(f"catalogues: node {self.nodes}")
        bounds, rows = hull(self.catalogues, node, self.bounds)
        problem = replace(
            self.problem,
            lower=bounds.lower,
            upper=bounds.upper,
            constraints=(*self.problem.constraints, *rows),
        )
        for start in self.starts[:RELAXED] if near is None else (near,):
            optimum = self._minimised(problem, start)
            if optimum is not None:
                if optimum.end in STOPPED:
                    raise _StoppedError
                yield optimum

    def solved(self, rows: Rows) -> Optimum | None:
        """The optimum with a combination's columns held; None where it has no answer."""
        if rows in self.fixed:
            return self.fixed[rows]
        lower, upper = self.bounds.lower.copy(), self.bounds.upper.copy()
        for catalogue, row in zip(self.catalogues, rows, strict=True):
            own = list(catalogue.columns)
            lower[own] = upper[own] = catalogue.rows[row]
        problem = replace(self.problem, lower=lower, upper=upper)
        start = np.clip(self.starts[0], lower, upper)
        found = self._minimised(problem, start)
        if found is not None:
            self.fixed[rows] = found
        return found

    def _minimised(self, problem: DesignProblem, start: Floats) -> Optimum | None:
        try:
            found = minimise(problem, start, self.steps, self.deadline)
        except EigassignError:
            return None
        self.appraisals += found.appraisals
        for row in problem.constraints:  # which no step can mend where bounds are too tight
            size = TOUCH * (np.abs(row.coefficients) @ np.abs(found.y) + 1e-300)
            if not row.lower - size <= row.coefficients @ found.y <= row.upper + size:
                return None
        return found

    def nearest(self, y: Floats) -> Rows:
        """The rows nearest to a design, relative to the ranges of their columns."""
        rows = []
        for catalogue in self.catalogues:
            width = np.ptp(catalogue.rows, axis=0)
            away = (catalogue.rows - y[list(catalogue.columns)]) / np.where(width > 0, width, 1.0)
            first = distinct_rows(catalogue)
            rows.append(int(first[np.argmin(np.linalg.norm(away[first], axis=1))]))
        return tuple(rows)
