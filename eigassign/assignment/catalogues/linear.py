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
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.catalogues.branching import (
    CatalogueSearch,
    Combination,
    ListedValues,
    Node,
    Relaxed,
    Rows,
    SearchLimits,
    answered,
    branch_and_bound,
    distinct_rows,
    refuse_columns,
)
from eigassign.assignment.checks import Floats, frozen
from eigassign.assignment.feasibility import TOUCH, refuse_impossible
from eigassign.assignment.optimality import best_candidate
from eigassign.assignment.program import QuadraticProgram, choose_scales, scaled_program
from eigassign.assignment.solver import SETTINGS, Status, solve_program
from eigassign.errors import InfeasibleError


def solve_catalogue(
    program: QuadraticProgram,
    catalogues: Sequence[ListedValues],
    limits: SearchLimits | None = None,
) -> CatalogueSearch:
    """The combinations of least J(y), the continuous columns at their optimum for each.

    Rows outside the program's bounds do not count, nor do repetitions of a row. Every answer with
    continuous columns is certified as those of `solve_assignment` are.

    Raises:
        UsageError: columns that do not exist, or that two catalogues own.
        InfeasibleError: no combination meets all limits (the tree was searched to its end);
            ``constraints`` names a smallest set of them, or the catalogue without admissible row.
        AccuracyError: a limit of ``limits`` was reached before any combination was found.
    """
    limits = limits or SearchLimits()
    program, root = _listed(program, catalogues)
    refuse_impossible(program)
    if not program.scales.free:
        only = Combination(
            tuple(rows[0] for rows in root), program.y_start, program.objective(program.y_start)
        )
        return CatalogueSearch((only,), only.objective, 1, True)
    found = branch_and_bound(_LinearModel(program, catalogues), root, limits)
    if not found.best and found.exhausted:
        raise _contradiction(program, catalogues, root, limits)
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
    return _within(program, lower, upper), tuple(root)


def _within(program: QuadraticProgram, lower: Floats, upper: Floats) -> QuadraticProgram:
    """The program with other bounds, and units that suit them."""
    start = np.clip(program.y_start, lower, upper)
    b = program.A @ (start - program.y0) + program.b
    return replace(
        program,
        y_start=frozen(start),
        lower=frozen(lower),
        upper=frozen(upper),
        scales=choose_scales(program.A, b, lower, upper, program.C, program.y0),
    )


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
    kept = np.flatnonzero(program.C[:, lower < upper].any(axis=1))
    return _within(_constrained(program, kept), lower, upper)


def _constrained(program: QuadraticProgram, kept: Iterable[int]) -> QuadraticProgram:
    """The program with these of its constraints."""
    rows = list(kept)
    return replace(
        program,
        constraint_names=tuple(program.constraint_names[k] for k in rows),
        C=program.C[rows],
        c_lower=program.c_lower[rows],
        c_upper=program.c_upper[rows],
        scales=replace(program.scales, rows=program.scales.rows[rows]),
    )


def _contradiction(
    program: QuadraticProgram, catalogues: Sequence[ListedValues], root: Node, limits: SearchLimits
) -> InfeasibleError:
    """The error that names constraints, none of which can be left out of the contradiction."""
    program = replace(program, A=np.zeros_like(program.A), b=np.zeros_like(program.b))
    needed = list(dict.fromkeys(program.constraint_names))
    for name in list(needed):
        rest = [other for other in needed if other != name]
        kept = [k for k, own in enumerate(program.constraint_names) if own in rest]
        only = _LinearModel(_constrained(program, kept), catalogues)
        tried = branch_and_bound(only, root, replace(limits, keep=1))
        if not tried.best and tried.exhausted:
            needed = rest
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
# Of the coordinates in which rows are compared: their effect on λ counts, but rows without any
# are still different rows.
APART = 1e-3
# Of the norm of a factor: columns below it change nothing but round-off.
NOTHING = 1e-13


class _LinearModel:
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
        scaled, free = scaled_program(program), program.scales.free
        n = self.n = len(free)
        self.A, self.P, self.c = scaled.A, scaled.P, scaled.c
        self.unit = 2.0 * program.scales.objective
        self.at_start = program.objective(program.y_start) / self.unit
        self.lower = np.maximum(scaled.lower[:n], -FAR)
        self.upper = np.minimum(scaled.upper[:n], FAR)
        self.C, self.C_lower, self.C_upper = scaled.G[n:], scaled.lower[n:], scaled.upper[n:]
        place = {column: i for i, column in enumerate(free)}
        self.own, self.rows = [], []
        for catalogue in catalogues:
            moving = [i for i, column in enumerate(catalogue.columns) if column in place]
            columns = [catalogue.columns[i] for i in moving]
            self.own.append(np.array([place[column] for column in columns], dtype=int))
            away = catalogue.rows[:, moving] - program.y_start[columns]
            self.rows.append(away / program.scales.y[columns])
        self.continuous = np.setdiff1d(np.arange(n), np.concatenate([*self.own, []]))
        self.effect = _projected(self.A, self.continuous)  # P A
        self.axes = [np.vstack([self.A[:, own], APART * np.eye(own.size)]).T for own in self.own]
        self.coordinates = tuple(r @ axes for r, axes in zip(self.rows, self.axes, strict=True))
        self._set_up()

    def _set_up(self) -> None:
        """OSQP's rows: bounds of x and w, the constraints, and what ties x to w."""
        import osqp  # loaded only where something is solved
        from scipy.sparse import block_diag, csc_matrix

        n, self.weights, ties, ends = self.n, {}, [], []
        total = self.n
        for k, own in enumerate(self.own):
            if own.size > 1:
                self.weights[k] = slice(total, total + self.rows[k].shape[0])
                total = self.weights[k].stop
        for k, weights in self.weights.items():
            tie = np.zeros((self.own[k].size + 1, total))
            tie[np.arange(self.own[k].size), self.own[k]] = 1.0
            tie[:-1, weights], tie[-1, weights] = -self.rows[k].T, 1.0
            ties.append(tie)
            ends.append(np.append(np.zeros(self.own[k].size), 1.0))
        constraints = np.hstack([self.C, np.zeros((self.C.shape[0], total - n))])
        self.G_lower = np.concatenate([self.lower, np.zeros(total - n), self.C_lower, *ends])
        self.G_upper = np.concatenate([self.upper, np.ones(total - n), self.C_upper, *ends])
        self.priced = slice(total, total + self.C.shape[0])  # the multipliers of the constraints
        self.solver = osqp.OSQP()
        self.solver.setup(
            csc_matrix(block_diag([np.triu(self.P), np.zeros((total - n, total - n))])),
            np.append(self.c, np.zeros(total - n)),
            csc_matrix(np.vstack([np.eye(total), constraints, *ties])),
            self.G_lower,
            self.G_upper,
            **{**SETTINGS, "eps_abs": ROUGH, "eps_rel": ROUGH},
        )

    def relax(self, node: Node, above: Relaxed | None, cutoff: float) -> Relaxed | None:
        """OSQP's optimum over the hull of the node, bounded without trusting it."""
        lower, upper = self.G_lower.copy(), self.G_upper.copy()
        for k, rows in enumerate(node):
            at = self.rows[k][list(rows)]
            lower[self.own[k]], upper[self.own[k]] = at.min(axis=0), at.max(axis=0)
            if k in self.weights:
                upper[self.weights[k]] = np.isin(np.arange(self.rows[k].shape[0]), rows)
        self.solver.update(l=lower, u=upper)
        result = self.solver.solve(raise_error=False)
        status = Status(result.info.status_val)
        if status is Status.INTERRUPTED:
            raise KeyboardInterrupt
        if status is Status.PRIMAL_INFEASIBLE and self._impossible(node, result.prim_inf_cert):
            return None
        if status is Status.SOLVED:
            x, mu = np.array(result.x)[: self.n], self._of_limits(result.y)
        else:
            x, mu = np.clip(np.zeros(self.n), lower[: self.n], upper[: self.n]), self._of_limits()
        h, value = self._tangent(x, mu)
        own = [self.rows[k][list(rows)] @ h[self.own[k]] for k, rows in enumerate(node)]
        bound = self.unit * (value + sum(part.min() for part in own))
        if bound >= cutoff:
            return None
        room = (cutoff - bound) / self.unit
        kept = tuple(
            tuple(r for r, more in zip(rows, part - part.min(), strict=True) if more < room)
            for rows, part in zip(node, own, strict=True)
        )
        points = tuple(x[own] @ axes for own, axes in zip(self.own, self.axes, strict=True))
        return Relaxed(kept, bound, points, x, mu)

    def _of_limits(self, multipliers: Any = None) -> Floats:
        """OSQP's multipliers of the constraints C x, without those of limits that do not exist."""
        if multipliers is None:
            return np.zeros(self.C.shape[0])
        mu = np.array(multipliers)[self.priced]
        missing = np.where(mu > 0.0, np.isinf(self.C_upper), np.isinf(self.C_lower))
        return np.where(missing, 0.0, mu)

    def _most(self, mu: Floats) -> float:
        """max μ·C x over the limits of C x."""
        used = mu != 0.0
        limits = np.where(mu > 0.0, self.C_upper, self.C_lower)
        return float(mu[used] @ limits[used])

    def _least(self, h: Floats) -> float:
        """min h·x over the box of the continuous columns."""
        h, lower, upper = (v[self.continuous] for v in (h, self.lower, self.upper))
        return float(np.minimum(h * lower, h * upper).sum())

    def _impossible(self, node: Node, certificate: Any) -> bool:
        """Farkas: for these μ, μ·C x is above its largest allowed value everywhere in the node."""
        mu = self._of_limits(certificate)
        h = self.C.T @ mu
        least = self._least(h)
        least += sum((self.rows[k][list(r)] @ h[self.own[k]]).min() for k, r in enumerate(node))
        return bool(least - self._most(mu) > TOUCH * np.abs(mu).sum())

    def _tangent(self, x: Floats, mu: Floats) -> tuple[Floats, float]:
        """h, and the module's bound without the rows' part of h·x and without the square."""
        gradient = self.c + self.P @ x
        h = gradient + self.C.T @ mu
        value = self.at_start + self.c @ x + 0.5 * np.sum((self.A @ x) ** 2) - gradient @ x
        return h, float(value + self._least(h) - self._most(mu))

    def combinations(
        self, node: Node, near: Relaxed, cutoff: Callable[[], float]
    ) -> Iterator[Combination]:
        """In the order of the module's bound, which is J itself if no column is continuous."""
        x, mu = np.zeros(self.n), np.zeros_like(near.mu)
        if self.continuous.size:
            x, mu = near.x.copy(), near.mu
        h, value = self._tangent(x, mu)
        x[self.continuous] = 0.0
        bounds, change = np.array([value]), -(self.effect @ x)[np.newaxis]
        for rows, own, nodes in zip(self.rows, self.own, node, strict=True):
            at = rows[list(nodes)]
            bounds = np.add.outer(bounds, at @ h[own]).ravel()
            change = change[:, np.newaxis] + at @ self.effect[:, own].T
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
        """Whether each constraint, alone, can be met with these rows (any, n_catalogues)."""
        row = np.zeros((chosen.shape[0], self.C.shape[0]))
        for k, own in enumerate(self.own):
            row += (self.rows[k] @ self.C[:, own].T)[chosen[:, k]]
        free = self.C[:, self.continuous]
        ends = free * self.lower[self.continuous], free * self.upper[self.continuous]
        least = row + np.minimum(*ends).sum(axis=1)
        most = row + np.maximum(*ends).sum(axis=1)
        size = np.abs(self.program.C) @ np.abs(self.program.y_start)
        slack = TOUCH + 1e-15 * size / self.program.scales.rows  # C y costs this rounding
        met = (least <= self.C_upper + slack) & (most >= self.C_lower - slack)
        return np.asarray(met.all(axis=1))

    def _optimal(self, rows: Rows, near: Relaxed, cutoff: float) -> Iterator[Combination]:
        """The combination with its continuous columns at their optimum, if it can be better."""
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


def _projected(A: Floats, columns: NDArray[np.int_]) -> Floats:
    """A without what these of its columns can change: (I − U Uᵀ) A."""
    U, s, _ = np.linalg.svd(A[:, columns], full_matrices=False)
    U = U[:, s > NOTHING * np.max(s, initial=0.0)]
    return np.asarray(A - U @ (U.T @ A))
