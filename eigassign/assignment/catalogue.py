"""The best combinations of the linear model: catalogues in the program of `program`.

`solve_catalogue` minimises J(y) by the tree of `branching`; `solve_worst_case_catalogue` minimises
max |A (y − y0) + b| as a mixed-integer linear program.

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

import itertools
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.branching import (
    Catalogue,
    CatalogueSearch,
    Combination,
    Effort,
    Node,
    Relaxed,
    Rows,
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

# --- The linear model


def solve_catalogue(
    program: QuadraticProgram, catalogues: Sequence[Catalogue], effort: Effort | None = None
) -> CatalogueSearch:
    """The combinations of least J(y), the continuous columns at their optimum for each.

    Rows outside the program's bounds do not count, nor do repetitions of a row. Every answer with
    continuous columns is certified as those of `solve_assignment` are.

    Raises:
        UsageError: columns that do not exist, or that two catalogues own.
        InfeasibleError: no combination meets all limits (the tree was searched to its end);
            ``constraints`` names a smallest set of them, or the catalogue without admissible row.
        AccuracyError: a limit of ``effort`` was reached before any combination was found.
    """
    effort = effort or Effort()
    program, root = _listed(program, catalogues)
    refuse_impossible(program)
    if not program.scales.free:
        only = Combination(
            tuple(rows[0] for rows in root), program.y_start, program.objective(program.y_start)
        )
        return CatalogueSearch((only,), only.objective, 1, True)
    found = branch_and_bound(_LinearModel(program, catalogues), root, effort)
    if not found.best and found.exhausted:
        raise _contradiction(program, catalogues, root, effort)
    return answered(found)


def _listed(
    program: QuadraticProgram, catalogues: Sequence[Catalogue]
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
    program: QuadraticProgram, catalogues: Sequence[Catalogue], root: Node, effort: Effort
) -> InfeasibleError:
    """The error that names constraints, none of which can be left out of the contradiction."""
    program = replace(program, A=np.zeros_like(program.A), b=np.zeros_like(program.b))
    needed = list(dict.fromkeys(program.constraint_names))
    for name in list(needed):
        rest = [other for other in needed if other != name]
        kept = [k for k, own in enumerate(program.constraint_names) if own in rest]
        only = _LinearModel(_constrained(program, kept), catalogues)
        tried = branch_and_bound(only, root, replace(effort, keep=1))
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

    def __init__(self, program: QuadraticProgram, catalogues: Sequence[Catalogue]) -> None:
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
            free = [self.program.scales.free[i] for i in self.continuous]
            lower, upper = y.copy(), y.copy()
            lower[free], upper[free] = self.program.lower[free], self.program.upper[free]
            # constraints of listed columns alone are met, in units of those columns
            kept = np.flatnonzero(self.program.C[:, free].any(axis=1))
            only = _within(_constrained(self.program, kept), lower, upper)
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


# --- The largest error of the linear model


def solve_worst_case_catalogue(
    program: QuadraticProgram, catalogues: Sequence[Catalogue], effort: Effort | None = None
) -> CatalogueSearch:
    """The combinations of least max |A (y − y0) + b|, by HiGHS as a mixed-integer linear program.

    Every further combination of ``effort.keep`` is another run in which those before are excluded.
    Arguments and errors are those of `solve_catalogue`.
    """
    effort = effort or Effort()
    program, root = _listed(program, catalogues)
    refuse_impossible(program)
    mixed, end = _MixedInteger(program, catalogues, root), time.monotonic() + effort.seconds
    best: list[Combination] = []
    lower, nodes, exhausted = np.inf, 0, True
    while len(best) < effort.keep:
        left = max(end - time.monotonic(), 0.0)
        answer = mixed.solve(time_limit=left, node_limit=effort.nodes - nodes)
        nodes += max(int(answer.mip_node_count or 0), 1)
        exhausted = answer.status in (0, 2)  # optimal, infeasible
        if answer.mip_dual_bound is not None:
            lower = min(lower, mixed.unit * answer.mip_dual_bound)
        if answer.x is None:
            break
        rows = mixed.rows(answer.x)
        best += mixed.fixed(rows)
        mixed.exclude(rows)
        if not exhausted or nodes >= effort.nodes:
            break
    if not best and exhausted:
        raise _contradiction(program, catalogues, root, effort)
    best = sorted(best, key=lambda one: (one.objective, one.rows))
    bounds = [one.objective for one in best[:1]]
    return answered(CatalogueSearch(tuple(best), min([lower, *bounds]), nodes, exhausted))


class _MixedInteger:
    """min t, |A x + b| ≤ t: x as in `scaled_program`, a 0–1 weight for each row of a catalogue."""

    def __init__(
        self, program: QuadraticProgram, catalogues: Sequence[Catalogue], root: Node
    ) -> None:
        self.program, self.catalogues, self.root = program, catalogues, root
        self.free = list(program.scales.free)
        scaled, scale, start = scaled_program(program), program.scales.y, program.y_start
        n, sizes = len(self.free), [len(rows) for rows in root]
        self.splits = n + np.cumsum([0, *sizes])
        total = int(self.splits[-1]) + 1
        b = program.A @ (start - program.y0) + program.b
        error = float(np.max(np.abs(b))) or 1.0
        self.unit = error * 1e-4  # HiGHS ends at a gap of 1e-6: 1e-10 of the error at the start
        A = np.zeros((b.size, total))
        A[:, :n] = program.A[:, self.free] * scale[self.free] / error
        A[:, -1] = -1.0
        above = A.copy()
        above[:, :n] *= -1.0
        self.parts: list[tuple[Floats, Any, Any]] = [
            (above, -np.inf, b / error),
            (A, -np.inf, -b / error),
        ]
        C = np.zeros((scaled.G.shape[0] - n, total))
        C[:, :n] = scaled.G[n:]
        self.parts.append((C, scaled.lower[n:], scaled.upper[n:]))
        for k, (catalogue, allowed) in enumerate(zip(catalogues, root, strict=True)):
            weights = slice(self.splits[k], self.splits[k + 1])
            tie, one = np.zeros((len(catalogue.columns), total)), np.zeros((1, total))
            for i, column in enumerate(catalogue.columns):
                if column in self.free:
                    away = catalogue.rows[list(allowed), i] - start[column]
                    tie[i, self.free.index(column)] = 1.0
                    tie[i, weights] = -away / scale[column]
            one[0, weights] = 1.0
            self.parts += [(tie, 0.0, 0.0), (one, 1.0, 1.0)]
        self.lower = np.concatenate([scaled.lower[:n], np.zeros(total - n)])
        self.upper = np.concatenate([scaled.upper[:n], np.ones(total - n)])
        self.upper[-1] = np.inf

    def solve(self, lower: Floats | None = None, **options: Any) -> Any:
        """HiGHS's answer, over all combinations not excluded."""
        from scipy.optimize import Bounds as Box
        from scipy.optimize import LinearConstraint as Limits
        from scipy.optimize import milp

        cost, whole = np.zeros(self.lower.size), np.zeros(self.lower.size, dtype=np.int_)
        cost[-1] = 1e4
        whole[self.splits[0] : self.splits[-1]] = 1
        limits: Any = {"mip_rel_gap": 0.0, **options}
        return milp(
            cost,
            integrality=whole,
            bounds=Box(self.lower if lower is None else lower, self.upper),
            constraints=[Limits(*part) for part in self.parts if part[0].size],
            options=limits,
        )

    def _places(self, x: Floats) -> list[int]:
        """Of each catalogue, the place of the row with the largest weight."""
        weights = itertools.pairwise(self.splits)
        return [int(np.argmax(x[first:last])) for first, last in weights]

    def rows(self, x: Floats) -> Rows:
        return tuple(rows[i] for rows, i in zip(self.root, self._places(x), strict=True))

    def _weights(self, rows: Rows) -> NDArray[np.int_]:
        """Where the weights of these rows are among the variables."""
        first = self.splits[:-1]
        return first + [own.index(row) for own, row in zip(self.root, rows, strict=True)]

    def exclude(self, rows: Rows) -> None:
        cut = np.zeros((1, self.lower.size))
        cut[0, self._weights(rows)] = 1.0
        self.parts.append((cut, -np.inf, len(rows) - 1.0))

    def fixed(self, rows: Rows) -> list[Combination]:
        """The combination with its rows exact and the rest at its optimum; none if impossible."""
        lower = self.lower.copy()
        lower[self._weights(rows)] = 1.0
        answer = self.solve(lower)
        if answer.x is None:
            return []
        y = self.program.y_start.copy()
        step = self.program.scales.y[self.free] * answer.x[: len(self.free)]
        y[self.free] = np.clip(
            y[self.free] + step, self.program.lower[self.free], self.program.upper[self.free]
        )
        for catalogue, row in zip(self.catalogues, rows, strict=True):
            y[list(catalogue.columns)] = catalogue.rows[row]
        errors = self.program.A @ (y - self.program.y0) + self.program.b
        return [Combination(rows, frozen(y), float(np.max(np.abs(errors))))]
