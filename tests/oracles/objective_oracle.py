"""Light, high and wide designs by SciPy's SLSQP on the exact epigraph, from many starts.

    min m(y),  max t with f(y, t_k) ≥ t at every sample,  max t with every room ≥ t

within bounds, linear constraints and limits g(y) ≥ 0; a band for every number of modes below it
that a design may have, a catalogue for every choice. Only exact modes and the mass are the
package's. Rows of the next mode are added where they say less: SLSQP sees both where modes meet.
"""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from assignment_oracle import ExactAssignment, Floats
from scipy.optimize import LinearConstraint, minimize

Terms = tuple[tuple[int, float], ...]  # of a row: numbers of modes from 1, and factors


@dataclass(frozen=True)
class Row:
    """sign · (Σ c f − edge) / size, at the samples of ``rows``; an aim's is as large as can be."""

    rows: slice
    terms: Terms
    sign: float
    edge: float
    size: float
    is_aim: bool = False


@dataclass(frozen=True)
class Band:
    """The edges of a band, and where modes are to be out of it."""

    rows: slice
    low: float
    high: float


@dataclass(frozen=True)
class Aimed:
    """A case with an objective that is no error."""

    exact: ExactAssignment
    rows: tuple[Row, ...]
    bands: tuple[Band, ...]
    wide: bool
    lists: tuple[tuple[tuple[int, ...], Floats], ...]  # columns, and the rows that they may have
    mass_limits: tuple[float, float]
    size: float = 1.0  # what is made large is a share of it

    def below(self, designs: int = 40) -> Iterator[tuple[int, ...]]:
        """Every number of modes below the bands that some design has, in all combinations."""
        seen: list[set[int]] = [set() for _ in self.bands]
        for y in self.exact.starts(designs, seed=5):
            hz = self.exact.model.frequencies(self.exact.q, y, 6)
            for band, own in zip(self.bands, seen, strict=True):
                for edge in (band.low, band.high):
                    own |= set((hz[band.rows] < edge).sum(axis=1).tolist())
        yield from itertools.product(*seen)

    def with_bands(self, below: tuple[int, ...]) -> tuple[Row, ...]:
        """All rows, with those of bands that have so many modes below."""
        rows = list(self.rows)
        for band, k in zip(self.bands, below, strict=True):
            for aim in (False, True)[: 1 + self.wide]:
                if k:
                    edge = band.low
                    rows.append(Row(band.rows, ((k, 1.0),), -1.0, edge, edge, aim))
                edge = band.high
                rows.append(Row(band.rows, ((k + 1, 1.0),), 1.0, edge, edge, aim))
        return tuple(rows)


def of_case(case: Any, instants: int = 0) -> Aimed:
    """The problem of a loaded case; at so many instants of the motion, if any."""
    file, path = case.file, case.trajectory
    spans, q = {None: slice(None)}, path.q
    if instants:
        fine, times = instants // len(path.parts), [part.trajectory.time_s for part in path.parts]
        at = [np.unique(np.append(np.linspace(t[0], t[-1], fine), t)) for t in times]
        q = np.concatenate([
            part.trajectory.motion.poses(a) for part, a in zip(path.parts, at, strict=True)
        ])  # fmt: skip
        ends = np.cumsum([0, *map(len, at)])
        for part, first, last in zip(path.parts, ends[:-1], ends[1:], strict=True):
            spans[part.name] = slice(int(first), int(last))
    else:
        spans |= {part.name: path.rows_of(part.name) for part in path.parts}
    names, parameters = list(file.design.parameters), file.design.parameters.values()
    limits = list(file.design.constraints.values())
    exact = ExactAssignment(
        model=case.model(), q=q, targets=[], initial=case.initial_design,
        lower=np.array([p.min for p in parameters], dtype=float),
        upper=np.array([p.max for p in parameters], dtype=float),
        C=np.array([[c.terms.get(n, 0.0) for n in names] for c in limits]).reshape(-1, len(names)),
        c_lower=np.array([-np.inf if c.min is None else c.min for c in limits]),
        c_upper=np.array([np.inf if c.max is None else c.max for c in limits]),
    )  # fmt: skip
    objective, rows, bands, size = file.assignment.objective, [], [], 1.0
    wide = objective == "widest"
    for target in file.targets:
        own = spans[target.trajectory]
        if target.kind == "keep_out":
            bands.append(Band(own, *target.keep_out))
        elif target.kind == "gap":
            (low, high), edge = target.gap.between, target.gap.at_least
            for aim in (False, True)[: 1 + wide]:
                rows.append(Row(own, ((high, 1.0), (low, -1.0)), 1.0, edge, edge, aim))
        else:
            sign, edge = (1.0, target.at_least) if target.kind == "at_least" else (
                -1.0, target.at_most)  # fmt: skip
            rows.append(Row(own, ((target.mode, 1.0),), sign, edge, edge))
    if not isinstance(objective, str):
        asked = objective.target
        own, rows_of = spans[asked.trajectory], path.rows_of(asked.trajectory)
        size = float(case.model().frequencies(path.q, exact.initial, asked.mode)[rows_of, -1].min())
        rows.append(Row(own, ((asked.mode, 1.0),), 1.0, 0.0, size, True))
    mass = file.design.mass
    ends = (None, None) if mass is None else (mass.min, mass.max)
    lists = tuple((own.columns, np.array(own.rows)) for own in file.design.catalogues)
    low, high = ends
    edges = (-np.inf if low is None else low, np.inf if high is None else high)
    return Aimed(exact, tuple(rows), tuple(bands), wide, lists, edges, size)


def judged(problem: Aimed, y: Floats) -> tuple[float, float]:
    """The violation of a design and what is made small, with the best numbers below the bands."""
    found = []
    for below in problem.below() if problem.bands else [()]:
        search = _Search(problem, problem.exact, problem.with_bands(below))
        found.append((search.violation(y), search.value(y)))
    return min(found, key=lambda each: (max(each[0], 1e-7), each[1]))


@dataclass(frozen=True)
class Best:
    """The best feasible design of all searches: its mass, or less what it makes large."""

    y: Floats
    value: float
    ends: tuple[float, ...]


def best(problem: Aimed, starts: int = 30) -> Best:
    """The best end over every choice of lists and of modes below the bands."""
    ends, designs = [], []
    combinations = list(itertools.product(*(range(len(rows)) for _, rows in problem.lists)))
    choices = list(problem.below()) if problem.bands else [()]
    for chosen, below in itertools.product(combinations, choices):
        own = problem.exact
        lower, upper = own.lower.copy(), own.upper.copy()
        for (columns, listed), k in zip(problem.lists, chosen, strict=True):
            lower[list(columns)] = upper[list(columns)] = listed[k]
        rows = problem.with_bands(below)
        search = _Search(problem, replace(own, lower=lower, upper=upper), rows)
        few = max(3, starts // (len(combinations) * len(choices)))
        for start in search.exact.starts(few, seed=len(ends)):
            y = search.end(np.clip(start, lower, upper))
            designs.append(y)
            ends.append(search.value(y) if search.violation(y) <= 1e-7 else np.inf)
    k = int(np.argmin(ends))
    return Best(designs[k], ends[k], tuple(ends))


class _Search:
    """SLSQP over v in [1, 2]^n, and t where something is made large."""

    def __init__(self, problem: Aimed, exact: ExactAssignment, rows: tuple[Row, ...]) -> None:
        self.problem, self.rows = problem, rows
        self.aims = [row for row in rows if row.is_aim]
        self.limits = [row for row in rows if not row.is_aim]
        count = max((mode for row in rows for mode, _ in row.terms), default=1) + 1
        count = min(count, exact.model.n_dof - exact.model.n_rigid)
        asked = [(slice(0, 1), count - 1, np.ones(1), np.ones(1))]
        self.exact = replace(exact, targets=asked, _at=np.array([]))
        self.count = count
        self.heavy = exact.model.mass(exact.initial)

    def y(self, v: Floats) -> Floats:
        p = self.exact
        return np.clip(p.lower + p.width * (v - 1.0), p.lower, p.upper)

    def values(self, some: list[Row], y: Floats, slopes: bool = False) -> Floats:
        """The rows at a design, and those that the next modes make; or their slopes."""
        hz = self.exact.slopes(y) if slopes else self.exact.frequencies(y)
        width = self.exact.width
        found = []
        for row in some:
            for terms in self.with_next(row):
                own = sum(c * hz[row.rows, mode - 1] for mode, c in terms)
                found.append(row.sign / row.size * (own * width if slopes else own - row.edge))
        if not found:
            return np.zeros((0, len(y))) if slopes else np.zeros(0)
        return np.concatenate(found)

    def with_next(self, row: Row) -> Iterator[Terms]:
        """The terms of a row, and those with the next mode, which say less."""
        yield row.terms
        for k, (mode, c) in enumerate(row.terms):
            other = mode + (1 if row.sign * c > 0.0 else -1)
            if 1 <= other <= self.count and other not in {m for m, _ in row.terms}:
                yield (*row.terms[:k], (other, c), *row.terms[k + 1 :])

    def value(self, y: Floats) -> float:
        """What is made small: the mass, or less the least of what is made large."""
        if not self.aims:
            return float(self.exact.model.mass(y))
        return -float(self.values(self.aims, y).min())

    def violation(self, y: Floats) -> float:
        """The largest relative violation of a limit."""
        low, high = self.problem.mass_limits
        mass = self.exact.model.mass(y)
        missed = [-float(self.values(self.limits, y).min(initial=0.0)), mass / high - 1.0]
        if np.isfinite(low):
            missed.append(1.0 - mass / low)
        return max(self.exact.violation(y), *missed, 0.0)

    def end(self, start: Floats) -> Floats:
        """Restarted where it stopped until it gains no more."""
        p = self.exact
        v, value = 1.0 + (start - p.lower) / p.width, np.inf
        for _ in range(4):
            v = np.clip(self.once(v), 1.0, np.where(p.upper > p.lower, 2.0, 1.0))
            y = self.y(v)
            now = self.value(y) if self.violation(y) <= 1e-7 else 1e300
            if not now < value - 1e-9 * abs(value):
                break
            value = now
        return self.y(v)

    def once(self, v: Floats) -> Floats:
        """One SLSQP: of v and t."""
        p, has_t = self.exact, bool(self.aims)
        n = len(v)
        limits: list[Any] = []

        def g(x: Floats) -> Floats:
            y = self.y(x[:n])
            own = [self.values(self.limits, y)]
            if has_t:
                own.append(self.values(self.aims, y) - x[n])
            return np.concatenate(own)

        def dg(x: Floats) -> Floats:
            y = self.y(x[:n])
            own = [self.values(self.limits, y, True)]
            if has_t:
                own.append(self.values(self.aims, y, True))
            J = np.vstack(own)
            if has_t:
                t = np.zeros((len(J), 1))
                t[len(own[0]) :] = -1.0
                J = np.hstack([J, t])
            return J

        if len(self.rows):
            limits.append({"type": "ineq", "fun": g, "jac": dg})
        low, high = self.problem.mass_limits
        for sign, edge in ((1.0, low), (-1.0, high)):
            if np.isfinite(edge):
                limits.append({
                    "type": "ineq",
                    "fun": lambda x, s=sign, e=edge: s * (p.model.mass(self.y(x[:n])) / e - 1.0),
                    "jac": lambda x, s=sign, e=edge: np.append(
                        s * p.model.total_mass(self.y(x[:n]))[1] * p.width / e, [0.0] * has_t),
                })  # fmt: skip
        if len(p.C):
            C, offset = p.C * p.width, p.C @ (p.lower - p.width)
            size = np.abs(C).sum(axis=1)
            size = np.where(size > 0.0, size, 1.0)
            C = np.hstack([C, np.zeros((len(C), int(has_t)))]) / size[:, None]
            ends = (p.c_lower - offset) / size, (p.c_upper - offset) / size
            limits.append(LinearConstraint(C, *ends))
        bounds = [(1.0, 2.0 if b > a else 1.0) for a, b in zip(p.lower, p.upper, strict=True)]
        if has_t:
            start = float(self.values(self.aims, self.y(v)).min())
            fun, jac = (lambda x: -x[n]), (lambda x: np.append(np.zeros(n), -1.0))
            x0, bounds = np.append(v, start), [*bounds, (None, None)]
        else:
            x0 = v
            fun = lambda x: p.model.mass(self.y(x)) / self.heavy  # noqa: E731
            jac = lambda x: p.model.total_mass(self.y(x))[1] * p.width / self.heavy  # noqa: E731
        try:
            found = minimize(
                fun, x0, jac=jac, method="SLSQP", bounds=bounds, constraints=limits,
                options={"ftol": 1e-13, "maxiter": 150},
            )  # fmt: skip
        except Exception:  # a design without modes
            return v
        return np.asarray(found.x[:n])
