"""Branch and bound over catalogues: parameters that take listed values only.

A catalogue lists rows; each row sets the columns of the design y that the catalogue owns (one for
a list of values, several for a list of sections). The other columns stay continuous.

A node of the tree holds the rows that every catalogue may still take. Its relaxation lets y be
anywhere in the convex hull of those rows, so its optimum is below that of every combination. The
node with the lowest one is split first: of the catalogue whose part of y lies furthest from every
row, the rows on either side of that part, along the direction in which they differ most.
Combinations are found by rounding to the nearest rows, and by looking at all those of a small node;
a node is dropped when its bound is not below the worst of the combinations kept.

Relaxations and combinations are those of a `CatalogueProblem`.
"""

from __future__ import annotations

import heapq
import itertools
import time
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import prod

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.linear import LinearConstraint
from eigassign.assignment.program import Bounds
from eigassign.assignment.targets import Floats, finite, frozen, same_length
from eigassign.errors import AccuracyError, EigassignError, InfeasibleError, UsageError

Rows = tuple[int, ...]  # one row of every catalogue: a combination
Node = tuple[Rows, ...]  # the rows that every catalogue may still take

# Of the objective: bounds this near to a known one are not looked into. OSQP's tolerance.
PROVED = 1e-9
KEEP, SECONDS = 5, 60.0  # the combinations that are told of, and the time to find them in


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

    def price(self, y: Floats) -> float:
        """The price of the row nearest to a design (n_y,), in shares of the columns' ranges."""
        if not self.prices:
            return 0.0
        width = np.ptp(self.rows, axis=0)
        away = (self.rows - y[list(self.columns)]) / np.where(width > 0.0, width, 1.0)
        return self.prices[int(np.linalg.norm(away, axis=1).argmin())]

    def price_below(self, rows: Rows) -> tuple[Floats, float]:
        """Slopes (n_columns,) and constant of a linear price that none of these rows is below.

        It fits their prices by least squares, lowered by the largest amount that it is above one.
        """
        if not self.prices:
            return np.zeros(len(self.columns)), 0.0
        own, prices = self.rows[list(rows)], np.array(self.prices)[list(rows)]
        middle, width = own.mean(axis=0), np.ptp(own, axis=0)
        unit = (own - middle) / np.where(width > 0.0, width, 1.0)
        fit = np.linalg.lstsq(unit, prices - prices.mean(), rcond=None)[0]
        slopes = fit / np.where(width > 0.0, width, 1.0)
        return slopes, float((prices - own @ slopes).min())


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


# --- The problem, by its nodes and combinations


@dataclass(frozen=True)
class Relaxed:
    """A node's optimum over the hull of its rows, and a bound of all its combinations.

    ``row_bounds``: of the combinations with each row, by catalogue; () where nothing says so.
    """

    y: Floats
    bound: float
    row_bounds: tuple[Floats, ...] = ()


class CatalogueProblem(ABC):
    """A problem over catalogues.

    ``root``: the rows to choose from. ``metric`` (any, n_y): designs are as far apart as
    ``metric @ y``. ``convex``: the bounds of its relaxations hold without doubt, so that the best
    few can be proved. ``small``: the number of combinations up to which all those of a node are
    looked at together.

    Raises UsageError for columns that are none of y (n_y,), or that two catalogues own.
    """

    convex = False
    small = 1

    def __init__(self, catalogues: Sequence[ListedValues], n_y: int) -> None:
        _refuse_columns(catalogues, n_y)
        self.catalogues, width = catalogues, np.ones(n_y)
        for own in catalogues:
            width[list(own.columns)] = np.ptp(own.rows, axis=0)
        self.metric = np.diag(1.0 / np.where(width > 0.0, width, 1.0))
        self.root = tuple(tuple(distinct_rows(own).tolist()) for own in catalogues)

    @abstractmethod
    def relax(self, node: Node, near: Floats | None) -> Relaxed | None:
        """Return None where there is nothing; ``near`` is y of the node around it."""

    @abstractmethod
    def fix(self, rows: Rows, cutoff: float) -> tuple[Floats, float] | None:
        """Return y (n_y,) and the objective of a combination; each is asked for once.

        None where there is none; or none below the cutoff, where that is easier to tell.
        """

    def ranked(self, node: Node) -> Iterable[tuple[float, Rows]]:
        """Return the combinations of a small node, the lowest bound of the objective first."""
        return ((-np.inf, rows) for rows in itertools.product(*node))

    def away(self, node: Node, y: Floats) -> list[Floats]:
        """The way (rows, any) from y to each row in the node, by catalogue."""
        return [
            (own.rows[list(rows)] - y[list(own.columns)]) @ self.metric[:, own.columns].T
            for own, rows in zip(self.catalogues, node, strict=True)
        ]

    def nearest(self, node: Node, y: Floats) -> Rows:
        """The rows of a node that are nearest to a design."""
        ways = zip(node, self.away(node, y), strict=True)
        return tuple(rows[int(np.linalg.norm(away, axis=1).argmin())] for rows, away in ways)


def distinct_rows(catalogue: ListedValues) -> NDArray[np.int_]:
    """The first of all rows that are equal, in the order of the list."""
    return np.sort(np.unique(catalogue.rows, axis=0, return_index=True)[1])


def _refuse_columns(catalogues: Sequence[ListedValues], n_y: int) -> None:
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


# --- The tree


class _Met:
    """The combinations met so far, and of those the best."""

    def __init__(self, problem: CatalogueProblem, keep: int) -> None:
        self.problem, self.keep = problem, keep
        self.known: dict[Rows, Combination | None] = {}
        self.best: list[Combination] = []

    @property
    def cutoff(self) -> float:
        """The objective that a combination must be below to matter."""
        return self.best[-1].objective if len(self.best) >= self.keep else np.inf

    def look_at(self, node: Node) -> None:
        """Meet the combinations of a small node that can be below the cutoff."""
        for bound, rows in self.problem.ranked(node):
            if bound >= self.cutoff:
                break
            self.meet(rows)

    def meet(self, rows: Rows) -> None:
        if rows not in self.known:
            fixed = self.problem.fix(rows, self.cutoff)
            one = None if fixed is None else Combination(rows, frozen(fixed[0]), fixed[1])
            self.known[rows] = one
            if one is not None and one.objective < self.cutoff:
                found = [*self.best, one]
                self.best = sorted(found, key=lambda c: (c.objective, c.rows))[: self.keep]

    def exchange(self, end: float) -> None:
        """Exchange the rows of the best in two catalogues at a time while a better one is found."""
        root, here = self.problem.root, None
        while self.best[0] is not here and time.monotonic() < end:
            here = self.best[0]
            for pair in itertools.combinations(range(len(root)), min(2, len(root))):
                rows = (every if k in pair else (here.rows[k],) for k, every in enumerate(root))
                for exchanged in itertools.product(*rows):
                    self.meet(exchanged)


def search_catalogue(
    problem: CatalogueProblem,
    keep: int = KEEP,
    seconds: float = SECONDS,
    starts: Iterable[Rows] = (),
) -> CatalogueSearch:
    """The ``keep`` best combinations, the lowest bound searched first; begun with ``starts``.

    Where the problem is not convex, relaxations are dear and the lower bound is proved as far as
    their optima are global: the tree is then for the best combination, the others in ``best`` are
    the best of those met, and at the end the rows of the best are exchanged in two catalogues at a
    time, as long as that finds a better one.

    Raises:
        InfeasibleError: there is no combination.
        AccuracyError: time ran out before any combination was found.
    """
    end = time.monotonic() + seconds
    met = _Met(problem, keep if problem.convex else 1)
    for rows in starts:
        met.meet(rows)
    nodes = 0
    heap: list[tuple[float, int, Node, Relaxed]] = []  # bound, age
    pending, near = [problem.root], None
    while True:
        for node in pending:
            nodes += 1
            relaxed = problem.relax(node, near)
            if relaxed is not None and relaxed.bound < met.cutoff:
                heapq.heappush(heap, (relaxed.bound, nodes, node, relaxed))
                met.look_at(tuple((row,) for row in problem.nearest(node, relaxed.y)))
        exhausted = not heap or heap[0][0] >= met.cutoff - PROVED * abs(met.cutoff)
        if exhausted or time.monotonic() > end:
            break
        _, _, node, relaxed = heapq.heappop(heap)
        if relaxed.row_bounds:
            each = zip(node, relaxed.row_bounds, strict=True)
            node = tuple(tuple(np.array(rows)[at < met.cutoff].tolist()) for rows, at in each)
        near, pending = relaxed.y, []
        if prod(map(len, node)) <= problem.small:
            met.look_at(node)
        else:
            pending = _split(problem, node, near)
    if not met.best:
        raise none_found(problem, nodes, exhausted)
    bound = min([bound for bound, *_ in heap[:1]] + [met.best[0].objective])
    if not problem.convex:
        met.exchange(end)
    every = sorted(filter(None, met.known.values()), key=lambda one: (one.objective, one.rows))
    return CatalogueSearch(tuple(every[:keep]), min(bound, every[0].objective), nodes, exhausted)


def none_found(problem: CatalogueProblem, nodes: int, exhausted: bool) -> EigassignError:
    """The error of a search without any combination."""
    names = tuple(own.name for own in problem.catalogues)
    if exhausted:
        listed = ", ".join(map(repr, names))
        return InfeasibleError(f"no combination of the catalogues {listed} meets all limits", names)
    return AccuracyError(
        f"catalogues: no combination met all limits in {nodes} nodes of the search: allow more "
        "time, shorten the lists or relax a limit"
    )


def _split(problem: CatalogueProblem, node: Node, y: Floats) -> list[Node]:
    """Two nodes that share out the rows of the catalogue furthest from being decided."""
    ways = problem.away(node, y)
    k = int(
        np.argmax([np.linalg.norm(away, axis=1).min() if len(away) > 1 else -1.0 for away in ways])
    )
    rows, away = np.array(node[k]), ways[k]
    along = away @ np.linalg.svd(away - away.mean(axis=0), full_matrices=False)[2][0]
    low = along <= 0.0
    if low.all() or not low.any():
        low = np.isin(np.arange(rows.size), np.argsort(along, kind="stable")[: rows.size // 2])
    halves = (tuple(rows[side].tolist()) for side in (low, ~low))
    return [(*node[:k], half, *node[k + 1 :]) for half in halves]
