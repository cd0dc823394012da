"""Branch and bound over catalogues: parameters that take listed values only.

A catalogue lists rows; each row sets the columns of the design y that the catalogue owns (one for
a list of values, several for a list of sections). The other columns stay continuous.

A node of the tree holds the rows that every catalogue may still take. Its relaxation lets y be
anywhere in the convex hull of those rows, so its optimum is below that of every combination. The
node with the lowest one is split first: of the catalogue whose part of y lies furthest from every
row, the rows on either side of that part, along the direction in which they differ most.
Combinations are found by rounding to the nearest rows, and by looking at all those of a small node;
a node is dropped when its bound is not below the worst of the combinations kept.

The tree is searched over the linear model in `linear`, and here over any model whose relaxations
the caller solves (`search_catalogue`).
"""

from __future__ import annotations

import heapq
import itertools
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from math import prod
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.checks import Floats, finite, frozen, same_length
from eigassign.assignment.program import Bounds, LinearConstraint
from eigassign.errors import AccuracyError, InfeasibleError, UsageError

Rows = tuple[int, ...]  # one row of every catalogue: a combination
Node = tuple[Rows, ...]  # the rows that every catalogue may still take

# Of the objective: bounds this near to a known one are not looked into. OSQP's tolerance.
PROVED = 1e-9
KEEP, SECONDS = 5, 60.0  # the combinations that are told of, and the time to find them in


@dataclass(frozen=True)
class ListedValues:
    """Listed values of some columns of y: row r sets y[columns] = rows[r], (n_rows, n_columns)."""

    name: str
    columns: tuple[int, ...]
    rows: Floats
    labels: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        what = f"catalogue {self.name!r}"
        object.__setattr__(self, "rows", finite(what, self.rows, 2))
        if not self.rows.size:
            raise UsageError(f"{what}: lists nothing to choose from")
        same_length(f"{what}, values", self.rows.shape[1], len(self.columns), "parameters it sets")
        if self.labels:
            same_length(f"{what}, labels", len(self.labels), self.rows.shape[0], "rows")


@dataclass(frozen=True)
class Combination:
    """The row of every catalogue, the design y (n_y,) in SI units, and its objective."""

    rows: Rows
    y: Floats
    objective: float


@dataclass(frozen=True)
class CatalogueSearch:
    """The best combinations found, and how far they can be from the best there is.

    ``best``: distinct combinations, the best first. ``lower_bound``: no combination is below it.
    ``exhausted``: the tree was searched to its end, so that ``best`` are the best there are; else
    a limit ended the search, and ``gap`` says what may have been missed.
    """

    best: tuple[Combination, ...]
    lower_bound: float
    nodes: int
    exhausted: bool

    @property
    def gap(self) -> float:
        """Objective of the best combination − lower bound."""
        return self.best[0].objective - self.lower_bound

    @property
    def relative_gap(self) -> float:
        """``gap`` over the objective."""
        return self.gap / abs(self.best[0].objective) if self.gap > 0.0 else 0.0


# --- The tree


@dataclass(frozen=True)
class Relaxed:
    """A node after its relaxation.

    ``node``: the rows that may still be better. ``bound``: no combination of them is below it.
    ``y`` (n_y,): the optimum, with the multipliers ``mu`` that the problem may want of it again.
    """

    node: Node
    bound: float
    y: Floats
    mu: Floats = field(default_factory=lambda: np.zeros(0))


class CatalogueProblem(Protocol):
    """A problem over catalogues, by its nodes.

    ``metric`` (any, n_y): designs are as far apart as ``metric @ y``. ``small``: the number of
    combinations up to which all those of a node are looked at together.
    """

    catalogues: Sequence[ListedValues]
    metric: Floats
    small: int

    def relax(self, node: Node, above: Relaxed | None, cutoff: float) -> Relaxed | None:
        """Return None if no combination is below the cutoff; ``above`` is the node split."""

    def combinations(
        self, node: Node, near: Relaxed, cutoff: Callable[[], float]
    ) -> Iterable[Combination]:
        """Yield those that can be below the cutoff; ``near`` is a node around this small one."""


class _Best:
    """The best combinations so far, distinct, the best first."""

    def __init__(self, keep: int) -> None:
        self.keep = keep
        self.found: list[Combination] = []

    def cutoff(self) -> float:
        """The objective that a combination must be below to be kept."""
        return self.found[-1].objective if len(self.found) >= self.keep else np.inf

    def add(self, combinations: Iterable[Combination]) -> None:
        for one in combinations:
            if one.objective < self.cutoff() and all(one.rows != k.rows for k in self.found):
                self.found = sorted([*self.found, one], key=lambda c: (c.objective, c.rows))
                self.found = self.found[: self.keep]


def branch_and_bound(
    problem: CatalogueProblem,
    root: Node,
    keep: int,
    seconds: float,
    start: Iterable[Combination] = (),
) -> CatalogueSearch:
    """Search the lowest bound first for the ``keep`` best, knowing some at the start.

    ``best`` is empty where there is no combination, or none was met in time.
    """
    best, nodes, end = _Best(keep), 0, time.monotonic() + seconds
    best.add(start)
    heap: list[tuple[float, int, Relaxed]] = []
    pending: list[Node] = [root]
    above: Relaxed | None = None
    while True:
        for node in pending:
            nodes += 1
            relaxed = problem.relax(node, above, best.cutoff())
            if relaxed is not None:
                near = [int(np.linalg.norm(d, axis=1).argmin()) for d in _away(problem, relaxed)]
                rounded = tuple((rows[k],) for rows, k in zip(relaxed.node, near, strict=True))
                best.add(problem.combinations(rounded, relaxed, best.cutoff))
                heapq.heappush(heap, (relaxed.bound, nodes, relaxed))
        exhausted = not heap or heap[0][0] >= best.cutoff() - PROVED * abs(best.cutoff())
        if exhausted or time.monotonic() > end:
            break
        above = heapq.heappop(heap)[2]
        pending = []
        if prod(map(len, above.node)) <= problem.small:
            best.add(problem.combinations(above.node, above, best.cutoff))
        else:
            pending = _split(problem, above)
    bounds = [bound for bound, *_ in heap[:1]] + [one.objective for one in best.found[:1]]
    return CatalogueSearch(tuple(best.found), min(bounds, default=np.inf), nodes, exhausted)


def _away(problem: CatalogueProblem, relaxed: Relaxed) -> list[Floats]:
    """The way (rows, any) from the relaxation's optimum to each row in the node, by catalogue."""
    return [
        (own.rows[list(rows)] - relaxed.y[list(own.columns)]) @ problem.metric[:, own.columns].T
        for own, rows in zip(problem.catalogues, relaxed.node, strict=True)
    ]


def _split(problem: CatalogueProblem, relaxed: Relaxed) -> list[Node]:
    """Two nodes that share out the rows of the catalogue furthest from being decided."""
    ways = _away(problem, relaxed)
    k = int(np.argmax([np.linalg.norm(d, axis=1).min() if len(d) > 1 else -1.0 for d in ways]))
    rows, away = np.array(relaxed.node[k]), ways[k]
    along = away @ np.linalg.svd(away - away.mean(axis=0), full_matrices=False)[2][0]
    low = along <= 0.0
    if low.all() or not low.any():
        low = np.isin(np.arange(rows.size), np.argsort(along, kind="stable")[: rows.size // 2])
    halves = (tuple(rows[side].tolist()) for side in (low, ~low))
    return [(*relaxed.node[:k], half, *relaxed.node[k + 1 :]) for half in halves]


def answered(found: CatalogueSearch) -> CatalogueSearch:
    """Return what was found; raise AccuracyError where time ran out first."""
    if found.best:
        return found
    raise AccuracyError(
        f"catalogues: no combination that meets all limits was found in {found.nodes} nodes; "
        "allow more, shorten the lists or relax a limit"
    )


def distinct_rows(catalogue: ListedValues) -> NDArray[np.int_]:
    """The first of all rows that are equal, in the order of the list."""
    return np.sort(np.unique(catalogue.rows, axis=0, return_index=True)[1])


def refuse_columns(catalogues: Sequence[ListedValues], n_y: int) -> None:
    """UsageError unless every column is one of y (n_y,) and has one owner."""
    owner: dict[int, str] = {}
    for catalogue in catalogues:
        for column in catalogue.columns:
            if not 0 <= column < n_y:
                raise UsageError(f"catalogue {catalogue.name!r}: there is no column {column} of y")
            if column in owner:
                raise UsageError(
                    f"catalogues {owner[column]!r} and {catalogue.name!r} both set column {column}"
                )
            owner[column] = catalogue.name


# --- Any model


def search_catalogue(
    catalogues: Sequence[ListedValues],
    relax: Callable[[Node, Floats | None], tuple[Floats, float] | None],
    fix: Callable[[Rows], tuple[Floats, float] | None],
    keep: int = KEEP,
    seconds: float = SECONDS,
    starts: Iterable[Rows] = (),
) -> CatalogueSearch:
    """Combinations of a model that need not be linear or convex, by the same tree.

    ``relax(node, near)`` returns y (n_y,) and the objective at the optimum over the hull of a
    node's rows (`hull`), or None where there is none; ``near`` is the optimum of the node around
    it, to start from. ``fix(rows)`` does so for one combination. ``starts``: combinations to begin
    with. At the end the rows of the best combination are exchanged in two catalogues at a time, as
    long as that finds a better one.

    Relaxations are dear, so the tree is for the best combination; the others in ``best`` are the
    best of those met. The lower bound is as good as the optima of ``relax``: on a model that is
    not convex it is proved as far as these are global.

    Raises:
        UsageError: columns that two catalogues own.
        InfeasibleError: there is no combination.
        AccuracyError: time ran out before any combination was found.
    """
    end = time.monotonic() + seconds
    problem = _AnyProblem(catalogues, relax, fix)
    known = filter(None, map(problem.combination, starts))
    found = branch_and_bound(problem, problem.root, 1, seconds, known)
    if not found.best and found.exhausted:
        names = tuple(own.name for own in catalogues)
        listed = ", ".join(map(repr, names))
        raise InfeasibleError(f"no combination of the catalogues {listed} meets all limits", names)
    here, better = None, answered(found).best[0]
    while better is not here and time.monotonic() < end:
        here = better
        for pair in itertools.combinations(range(len(catalogues)), min(2, len(catalogues))):
            rows = (every if k in pair else (here.rows[k],) for k, every in enumerate(problem.root))
            exchanged = filter(None, map(problem.combination, itertools.product(*rows)))
            better = min([better, *exchanged], key=lambda one: one.objective)
    met = filter(None, problem.known.values())
    best = tuple(sorted(met, key=lambda one: (one.objective, one.rows))[:keep])
    return replace(found, best=best, lower_bound=min(found.lower_bound, best[0].objective))


def hull(
    catalogues: Sequence[ListedValues], node: Node, bounds: Bounds
) -> tuple[Bounds, list[LinearConstraint]]:
    """Limits of y around the rows of a node: of every column, and along their principal axes.

    The hull of one row, of two, and of any rows of one column is met exactly; else what is around
    it is larger, by the corners of a box.
    """
    lower, upper, rows = bounds.lower.copy(), bounds.upper.copy(), []
    for catalogue, allowed in zip(catalogues, node, strict=True):
        own, at = list(catalogue.columns), catalogue.rows[list(allowed)]
        lower[own], upper[own] = at.min(axis=0), at.max(axis=0)
        width = np.ptp(at, axis=0)
        moving = np.flatnonzero(width > 0.0)
        if moving.size < 2:
            continue
        unit = at[:, moving] / width[moving]
        axes = np.linalg.svd(unit - unit.mean(axis=0))[2]
        for i, axis in enumerate(axes):
            along = unit @ axis
            coefficients = np.zeros(lower.size)
            coefficients[np.array(own)[moving]] = axis / width[moving]
            name = f"{catalogue.name}, axis {i + 1}"
            rows.append(LinearConstraint(name, coefficients, along.min(), along.max()))
    return Bounds(lower, upper), rows


class _AnyProblem:
    """The caller's relaxations and combinations; every combination is asked for once."""

    small = 1

    def __init__(
        self,
        catalogues: Sequence[ListedValues],
        relax: Callable[[Node, Floats | None], tuple[Floats, float] | None],
        fix: Callable[[Rows], tuple[Floats, float] | None],
    ) -> None:
        self.catalogues, self._relax, self._fix = catalogues, relax, fix
        width = np.ones(1 + max(max(own.columns) for own in catalogues))
        refuse_columns(catalogues, width.size)
        for own in catalogues:
            width[list(own.columns)] = np.ptp(own.rows, axis=0)
        self.metric = np.diag(1.0 / np.where(width > 0.0, width, 1.0))
        self.root = tuple(tuple(distinct_rows(own).tolist()) for own in catalogues)
        self.known: dict[Rows, Combination | None] = {}

    def relax(self, node: Node, above: Relaxed | None, cutoff: float) -> Relaxed | None:
        optimum = self._relax(node, None if above is None else above.y)
        if optimum is None or optimum[1] >= cutoff:
            return None
        return Relaxed(node, optimum[1], optimum[0])

    def combinations(
        self, node: Node, near: Relaxed, cutoff: Callable[[], float]
    ) -> Iterable[Combination]:
        return filter(None, map(self.combination, itertools.product(*node)))

    def combination(self, rows: Rows) -> Combination | None:
        """The combination with its objective, None where it has none."""
        if rows not in self.known:
            fixed = self._fix(rows)
            self.known[rows] = Combination(rows, frozen(fixed[0]), fixed[1]) if fixed else None
        return self.known[rows]
