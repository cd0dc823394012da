"""The best combinations of the linear model: catalogues in the program of `program`.

`solve_catalogue` minimises J(y) by the tree of `branching`.

**A bound that does not trust the solver.** J is convex. With any point x̂, the gradient g there, any
multipliers μ of the constraints C x, and h = g + Cᵀμ, every admissible x has

    J(x) ≥ J(x̂) − g·x̂ + min h·x − max μ·C x + ½ ‖P A (x − x̂)‖²        [J = ½‖A x + b‖² + c·x]

where the minimum is over the rows of the node and the box of the continuous columns, the maximum
over the limits of C x, and P projects onto what continuous columns cannot change. An inaccurate x̂
or μ makes the bound low, never wrong. Without its last term it is a sum over the catalogues, so
that a row which alone lifts it to the best known J leaves the node. With it, the combinations of a
small node are bounded all at once, by array operations; without continuous columns that bound (at
μ = 0) is J itself.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.catalogues.branching import (
    KEEP,
    SECONDS,
    CatalogueSearch,
    Combination,
    ListedValues,
    Node,
    Relaxed,
    Rows,
    answered,
    branch_and_bound,
    distinct_rows,
    refuse_columns,
)
from eigassign.assignment.checks import Floats, frozen
from eigassign.assignment.feasibility import TOUCH, refuse_impossible, row_rounding, smallest
from eigassign.assignment.optimality import best_candidate
from eigassign.assignment.program import (
    QuadraticProgram,
    choose_scales,
    of_finite_limits,
    scaled_program,
)
from eigassign.assignment.solver import SETTINGS, Status, solve_program
from eigassign.errors import InfeasibleError


def solve_catalogue(
    program: QuadraticProgram,
    catalogues: Sequence[ListedValues],
    seconds: float = SECONDS,
) -> CatalogueSearch:
    """The combinations of least J(y), the continuous columns at their optimum for each.

    Rows outside the program's bounds do not count, nor do repetitions of a row. Every answer with
    continuous columns is certified as those of `solve_assignment` are.

    Raises:
        UsageError: columns that do not exist, or that two catalogues own.
        InfeasibleError: no combination meets all limits (the tree was searched to its end);
            ``constraints`` names a smallest set of them, or the catalogue without admissible row.
        AccuracyError: time ran out before any combination was found.
    """
    program, root = _listed(program, catalogues)
    refuse_impossible(program)
    if not program.scales.free:
        only = Combination(
            tuple(rows[0] for rows in root), program.y_start, program.objective(program.y_start)
        )
        return CatalogueSearch((only,), only.objective, 1, True)
    found = branch_and_bound(_LinearProblem(program, catalogues), root, KEEP, seconds)
    if not found.best and found.exhausted:
        raise _contradiction(program, catalogues, root, seconds)
    return answered(found)


def _listed(
    program: QuadraticProgram, catalogues: Sequence[ListedValues]
) -> tuple[QuadraticProgram, Node]:
    """The program with bounds around the rows, and of equal rows within its bounds the first."""
    refuse_columns(catalogues, program.y0.size)
    lower, upper, root = program.lower.copy(), program.upper.copy(), []
    for catalogue in catalogues:
        own, rows = list(catalogue.columns), catalogue.rows
        first = distinct_rows(catalogue)
        kept = first[np.all((rows[first] >= lower[own]) & (rows[first] <= upper[own]), axis=1)]
        if not kept.size:
            raise InfeasibleError(
                f"catalogue {catalogue.name!r}: no row is within the bounds", (catalogue.name,)
            )
        lower[own], upper[own] = rows[kept].min(axis=0), rows[kept].max(axis=0)
        root.append(tuple(kept.tolist()))
    return _within(program, lower, upper, range(len(program.C))), tuple(root)


def held(
    program: QuadraticProgram, catalogues: Sequence[ListedValues], rows: Rows
) -> QuadraticProgram:
    """The program of a combination's continuous columns, the others held at its rows.

    Constraints of held columns alone are left out: the combination meets them.
    """
    lower, upper = program.lower.copy(), program.upper.copy()
    for catalogue, row in zip(catalogues, rows, strict=True):
        own = list(catalogue.columns)
        lower[own] = upper[own] = catalogue.rows[row]
    return _within(program, lower, upper, np.flatnonzero(program.C[:, lower < upper].any(axis=1)))


def _within(
    program: QuadraticProgram, lower: Floats, upper: Floats, kept: Iterable[int]
) -> QuadraticProgram:
    """The program with other bounds and some of its constraints, and units that suit it."""
    start, rows = np.clip(program.y_start, lower, upper), list(kept)
    b = program.A @ (start - program.y0) + program.b
    return replace(
        program,
        y_start=frozen(start),
        lower=frozen(lower),
        upper=frozen(upper),
        constraint_names=tuple(program.constraint_names[k] for k in rows),
        C=program.C[rows],
        c_lower=program.c_lower[rows],
        c_upper=program.c_upper[rows],
        scales=choose_scales(program.A, b, lower, upper, program.C[rows], program.y0),
    )


def _contradiction(
    program: QuadraticProgram,
    catalogues: Sequence[ListedValues],
    root: Node,
    seconds: float,
) -> InfeasibleError:
    """The error that names constraints, none of which can be left out of the contradiction."""
    program = replace(program, A=np.zeros_like(program.A), b=np.zeros_like(program.b))

    def contradict(names: list[str]) -> bool:
        kept = [k for k, own in enumerate(program.constraint_names) if own in names]
        only = _within(program, program.lower, program.upper, kept)
        tried = branch_and_bound(_LinearProblem(only, catalogues), root, 1, seconds)
        return not tried.best and tried.exhausted

    needed = smallest(list(dict.fromkeys(program.constraint_names)), contradict)
    listed = " and ".join(repr(name) for name in needed)
    lists = ", ".join(repr(catalogue.name) for catalogue in catalogues)
    return InfeasibleError(
        f"no combination of the catalogues {lists} meets {listed}", tuple(needed)
    )


# OSQP's tolerance here. The bound does not trust it, and 1e-9 takes 1.5 times as long.
ROUGH = 1e-6
# Bounds further away are taken to be there, in units that change λ by 100 %: no linear model holds
# so far, and h·x of a continuous column, 0 but for OSQP's tolerance, is multiplied by it.
FAR = 1e4
# Of the distance between rows: their effect on λ counts (by the range of their values alone a tree
# has 1.4 times as many nodes), but rows without any are still different rows.
APART = 1e-3


class _LinearProblem:
    """The program in its own units (`scaled_program`), and OSQP set up for its relaxations.

    Its variables are x (n,) and, for each catalogue that sets several columns, weights w ≥ 0 of
    its rows, with x = Σ w_r row_r and Σ w_r = 1: the convex hull. ``own``: the columns of x that
    each catalogue sets (fixed ones are left out); ``rows``: its rows in them.
    """

    # 3¹² combinations of a smooth model of 152 samples: 0.7 s with 1, 0.35 s with 243, 0.2 s with
    # 4096 and with 16384
    small = 4096

    def __init__(self, program: QuadraticProgram, catalogues: Sequence[ListedValues]) -> None:
        self.program, self.catalogues = program, catalogues
        scaled, self.free = scaled_program(program), list(program.scales.free)
        self.scale, n = program.scales.y[self.free], len(self.free)
        self.n = n
        self.A, self.P, self.c = scaled.A, scaled.P, scaled.c
        self.unit = 2.0 * program.scales.objective
        self.at_start = program.objective(program.y_start) / self.unit
        self.lower = np.maximum(scaled.lower[:n], -FAR)
        self.upper = np.minimum(scaled.upper[:n], FAR)
        self.C, self.C_lower, self.C_upper = scaled.G[n:], scaled.lower[n:], scaled.upper[n:]
        self.own, self.rows = [], []
        for catalogue in catalogues:
            moving = [i for i, column in enumerate(catalogue.columns) if column in self.free]
            own = np.array([self.free.index(catalogue.columns[i]) for i in moving], dtype=int)
            start = program.y_start[self.free][own]
            self.own.append(own)
            self.rows.append((catalogue.rows[:, moving] - start) / self.scale[own])
        self.continuous = np.setdiff1d(np.arange(n), np.concatenate([*self.own, []]))
        U, s, _ = np.linalg.svd(self.A[:, self.continuous], full_matrices=False)
        U = U[:, s > 1e-13 * np.max(s, initial=0.0)]  # the rest changes nothing but round-off
        self.effect = self.A - U @ (U.T @ self.A)  # P A
        self.metric = np.zeros((2 * n, len(program.y0)))
        self.metric[:, self.free] = np.vstack([self.A, APART * np.eye(n)]) / self.scale
        self._set_up()

    def _set_up(self) -> None:
        """Give OSQP its rows: bounds of x and w, the constraints, and what ties x to w."""
        import osqp  # loaded only where something is solved
        from scipy.sparse import block_diag, csc_matrix

        ends = np.cumsum([self.n, *(len(r) * (r.shape[1] > 1) for r in self.rows)])
        self.weights, total = [slice(*pair) for pair in pairwise(ends)], ends[-1]
        ties, fixed = [np.zeros((0, total))], [np.zeros(0)]
        for own, rows, weights in zip(self.own, self.rows, self.weights, strict=True):
            if own.size > 1:
                tie = np.zeros((own.size + 1, total))
                tie[np.arange(own.size), own] = 1.0
                tie[:-1, weights], tie[-1, weights] = -rows.T, 1.0
                ties.append(tie)
                fixed.append(np.append(np.zeros(own.size), 1.0))
        w = np.zeros(total - self.n)
        self.G_lower = np.concatenate([self.lower, w, self.C_lower, *fixed])
        self.G_upper = np.concatenate([self.upper, w + 1.0, self.C_upper, *fixed])
        self.priced = slice(total, total + len(self.C))  # the multipliers of the constraints
        self.solver = osqp.OSQP()
        self.solver.setup(
            csc_matrix(block_diag([np.triu(self.P), np.zeros((w.size, w.size))])),
            np.append(self.c, w),
            csc_matrix(np.vstack([np.eye(total), np.pad(self.C, ((0, 0), (0, w.size))), *ties])),
            self.G_lower,
            self.G_upper,
            **{**SETTINGS, "eps_abs": ROUGH, "eps_rel": ROUGH},
        )

    def relax(self, node: Node, above: Relaxed | None, cutoff: float) -> Relaxed | None:
        """OSQP's optimum over the hull of the node, bounded without trusting it."""
        lower, upper = self.G_lower.copy(), self.G_upper.copy()
        for own, every, weights, rows in zip(self.own, self.rows, self.weights, node, strict=True):
            at = every[list(rows)]
            lower[own], upper[own] = at.min(axis=0), at.max(axis=0)
            if own.size > 1:
                upper[weights] = np.isin(np.arange(len(every)), rows)
        self.solver.update(l=lower, u=upper)
        result = self.solver.solve(raise_error=False)
        status = Status(result.info.status_val)
        if status is Status.INTERRUPTED:
            raise KeyboardInterrupt
        if status is Status.PRIMAL_INFEASIBLE:
            mu = self._of_constraints(result.prim_inf_cert)  # Farkas: μ·C x is too large everywhere
            least = self._least(self.C.T @ mu, mu) + sum(map(min, self._costs(node, self.C.T @ mu)))
            if least > TOUCH * np.abs(mu).sum():
                return None
        x, mu = np.clip(np.zeros(self.n), lower[: self.n], upper[: self.n]), np.zeros(len(self.C))
        if status is Status.SOLVED:
            x, mu = np.array(result.x)[: self.n], self._of_constraints(result.y)
        h, value = self._tangent(x, mu)
        costs = self._costs(node, h)
        bound = self.unit * (value + sum(cost.min() for cost in costs))
        if bound >= cutoff:
            return None
        room = (cutoff - bound) / self.unit
        kept = tuple(
            tuple(r for r, more in zip(rows, cost - cost.min(), strict=True) if more < room)
            for rows, cost in zip(node, costs, strict=True)
        )
        y = self.program.y_start.copy()
        y[self.free] += self.scale * x
        return Relaxed(kept, bound, y, mu)

    def _of_constraints(self, multipliers: Any) -> Floats:
        """OSQP's multipliers of the constraints C x, without those of limits that do not exist."""
        return of_finite_limits(np.array(multipliers)[self.priced], self.C_lower, self.C_upper)

    def _costs(self, node: Node, h: Floats) -> list[Floats]:
        """h·x of the rows in the node, by catalogue."""
        parts = zip(self.own, self.rows, node, strict=True)
        return [every[list(rows)] @ h[own] for own, every, rows in parts]

    def _tangent(self, x: Floats, mu: Floats) -> tuple[Floats, float]:
        """h, and the module's bound without the rows' part of h·x and without the square."""
        gradient = self.c + self.P @ x
        h = gradient + self.C.T @ mu
        value = self.at_start + self.c @ x + 0.5 * np.sum((self.A @ x) ** 2) - gradient @ x
        return h, float(value + self._least(h, mu))

    def _least(self, h: Floats, mu: Floats) -> float:
        """min h·x over the box of the continuous columns, less max μ·C x over the limits of C x."""
        box = np.minimum(h * self.lower, h * self.upper)[self.continuous].sum()
        used = mu != 0.0
        return float(box - mu[used] @ np.where(mu > 0.0, self.C_upper, self.C_lower)[used])

    def combinations(
        self, node: Node, near: Relaxed, cutoff: Callable[[], float]
    ) -> Iterator[Combination]:
        """Ordered by the module's bound, which is J itself if no column is continuous."""
        x, mu = np.zeros(self.n), np.zeros(len(self.C))
        if self.continuous.size:
            x, mu = (near.y - self.program.y_start)[self.free] / self.scale, near.mu
        h, value = self._tangent(x, mu)
        x[self.continuous] = 0.0
        bounds, change = np.array([value]), -(self.effect @ x)[np.newaxis]
        for own, every, rows, cost in zip(
            self.own, self.rows, node, self._costs(node, h), strict=True
        ):
            bounds = np.add.outer(bounds, cost).ravel()
            change = change[:, np.newaxis] + every[list(rows)] @ self.effect[:, own].T
            change = change.reshape(bounds.size, -1)
        bounds = self.unit * (bounds + 0.5 * np.sum(change**2, axis=1))
        order = np.flatnonzero(bounds < cutoff())
        order = order[np.argsort(bounds[order], kind="stable")]
        places = np.unravel_index(order, tuple(map(len, node)))
        chosen = np.stack([np.array(rows)[i] for rows, i in zip(node, places, strict=True)], axis=1)
        for i in np.flatnonzero(self._possible(chosen)):
            if bounds[order[i]] >= cutoff():
                return
            yield from self._optimal(tuple(chosen[i].tolist()), near, cutoff())

    def _possible(self, chosen: NDArray[np.int_]) -> NDArray[np.bool_]:
        """True where each constraint, alone, can be met with these rows (any, n_catalogues)."""
        row = np.zeros((len(chosen), len(self.C)))
        for own, rows, each in zip(self.own, self.rows, chosen.T, strict=True):
            row += (rows @ self.C[:, own].T)[each]
        ends = self.C * self.lower, self.C * self.upper
        least = row + np.minimum(*ends)[:, self.continuous].sum(axis=1)
        most = row + np.maximum(*ends)[:, self.continuous].sum(axis=1)
        slack = TOUCH + row_rounding(self.program) / self.program.scales.rows
        met = (least <= self.C_upper + slack) & (most >= self.C_lower - slack)
        return np.asarray(met.all(axis=1))

    def _optimal(self, rows: Rows, near: Relaxed, cutoff: float) -> Iterator[Combination]:
        """Yield the combination, its continuous columns at their optimum, if it may be better."""
        y = self.program.y_start.copy()
        for catalogue, row in zip(self.catalogues, rows, strict=True):
            y[list(catalogue.columns)] = catalogue.rows[row]
        if self.continuous.size:
            if self.relax(tuple((row,) for row in rows), near, cutoff) is None:
                return
            only = held(self.program, self.catalogues, rows)
            try:
                y = best_candidate(only, solve_program(only).candidates)[0].y
            except InfeasibleError:
                return
        yield Combination(rows, frozen(y), self.program.objective(y))
