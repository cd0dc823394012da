"""The assignment solved by SciPy on exact frequencies: the reference for every way to a design.

    J(y) = Σ_g w_g Σ_k ω_k (f(t_k, y) / f_d(t_k) − 1)² / Σ_g w_g Σ_k ω_k

over the bounds and linear constraints of a case, with g its targets and ω_k trapezoidal weights,
each trajectory for itself. Only the exact modes are the package's. Slopes follow from the modes:
∂f/∂y = φᵀ (K_y − λ M_y) φ / (8 π² f).
"""

import time
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
from scipy.optimize import LinearConstraint, least_squares, minimize

Floats = np.ndarray
FEASIBLE = 1e-9  # of a constraint's range in the box: rounding of SLSQP's own linear algebra
STARTS = 12


@dataclass(eq=False)
class ExactAssignment:
    """One case as a problem of nonlinear least squares; counts what it evaluates."""

    model: Any
    q: Floats
    targets: list[tuple[slice, int, Floats, Floats]]  # rows, column of the mode, f_d, share of J
    initial: Floats
    lower: Floats
    upper: Floats
    C: Floats  # c_lower ≤ C y ≤ c_upper
    c_lower: Floats
    c_upper: Floats
    evaluations: int = 0
    _at: Floats = field(default_factory=lambda: np.array([]))
    _hz: Floats = field(default_factory=lambda: np.array([]))
    _phi: Floats = field(default_factory=lambda: np.array([]))

    @property
    def width(self) -> Floats:
        """Of the box, 1 where a parameter is held."""
        return np.where(self.upper > self.lower, self.upper - self.lower, 1.0)

    def frequencies(self, y: Floats) -> Floats:
        """f (n, count) in Hz; the last design's modes are kept for its slopes."""
        if not np.array_equal(y, self._at):
            self._hz, self._phi = self.solve(y, 1 + max(k for _, k, *_ in self.targets))
            self._at = np.array(y)
            self.evaluations += 1
        return self._hz

    def solve(self, y: Floats, count: int) -> tuple[Floats, Floats]:
        """Exact frequencies (n, count) in Hz and mass-normalised modes (n, n_dof, count)."""
        return self.model.modes(self.q, y, count)

    def slopes(self, y: Floats) -> Floats:
        """∂f/∂y (n, count, n_y)."""
        hz, pencil, x = self.frequencies(y), self.model.pencil, self.model.x(self.q, y)
        result = np.empty((*hz.shape, len(y)))
        lam = (2.0 * np.pi * hz) ** 2
        products = self._phi[:, pencil.rows] * self._phi[:, pencil.columns]
        forms = [
            products[..., k] @ pencil.stiffness - lam[:, [k]] * (products[..., k] @ pencil.mass)
            for k in range(hz.shape[1])
        ]
        steps = 1e-5 * np.maximum(np.abs(y), 1e-3 * self.width)
        for j, h in enumerate(steps):
            step = np.zeros(x.shape[1])
            step[self.q.shape[1] + j] = h
            rates = (pencil.theta(x + step) - pencil.theta(x - step)).T / (2.0 * h)
            for k, form in enumerate(forms):
                result[:, k, j] = (form * rates).sum(axis=1) / (8.0 * np.pi**2 * hz[:, k])
        return result

    def errors(self, y: Floats) -> Floats:
        """f/f_d − 1 of all targets, one after the other."""
        hz = self.frequencies(y)
        return np.concatenate([hz[rows, k] / wanted - 1.0 for rows, k, wanted, _ in self.targets])

    def error_slopes(self, y: Floats) -> Floats:
        """Its slopes by y."""
        df = self.slopes(y)
        return np.concatenate([df[rows, k] / f_d[:, None] for rows, k, f_d, _ in self.targets])

    @property
    def roots(self) -> Floats:
        """√ of the weight of each error in J."""
        return np.sqrt(np.concatenate([weights for *_, weights in self.targets]))

    def gradient(self, y: Floats) -> Floats:
        """∂J/∂y."""
        return 2.0 * (self.roots**2 * self.errors(y)) @ self.error_slopes(y)

    def rms(self, y: Floats) -> float:
        """√J."""
        return float(np.linalg.norm(self.roots * self.errors(y)))

    def violation(self, y: Floats) -> float:
        """The largest violation of a bound or constraint, relative to its range in the box."""
        out = np.maximum(self.lower - y, y - self.upper) / self.width
        reach = np.abs(self.C) @ self.width
        rows = np.maximum(self.c_lower - self.C @ y, self.C @ y - self.c_upper) / reach
        return float(max(out.max(), rows.max(initial=0.0), 0.0))

    def starts(self, count: int = STARTS, seed: int = 0) -> Iterator[Floats]:
        """The initial design, the middle of the box, and random designs.

        Uniform in the logarithm where the bounds span more than a decade.
        """
        rng = np.random.default_rng(seed)
        yield np.clip(self.initial, self.lower, self.upper)
        yield 0.5 * (self.lower + self.upper)
        far = (self.lower > 0.0) & (self.upper > 10.0 * self.lower)
        for _ in range(count - 2):
            u, low = rng.random(len(self.lower)), np.where(far, self.lower, 1.0)
            straight = self.lower + u * (self.upper - self.lower)
            yield np.where(far, low * (np.where(far, self.upper, 1.0) / low) ** u, straight)


@dataclass(frozen=True)
class Found:
    """The best feasible end of several searches, and what each start led to."""

    y: Floats
    value: float  # rms
    ends: tuple[float, ...]  # value of each start's end; infinite where it is not feasible
    evaluations: tuple[int, ...]
    seconds: tuple[float, ...]


def of_case(case: Any) -> ExactAssignment:
    """The exact problem of a loaded case with targets on single frequencies."""
    file = case.file
    path = case.trajectory.with_instants([_knots_between(file, p) for p in case.trajectory.parts])
    times = [(part.weight, np.asarray(part.trajectory.time_s)) for part in path.parts]
    omega = np.concatenate([weight * _trapezoidal(t) for weight, t in times])
    goals = []
    for target in file.targets:
        rows = path.rows_of(target.trajectory)
        goals.append((target, rows, _wanted(target.frequency, path.time_s[rows])))
    total = sum(target.weight * omega[rows].sum() for target, rows, _ in goals)
    names = list(file.design.parameters)
    limits = list(file.design.constraints.values())
    return ExactAssignment(
        model=case.model(),
        q=path.q,
        targets=[
            (rows, target.mode - 1, wanted, target.weight * omega[rows] / total)
            for target, rows, wanted in goals
        ],
        initial=case.initial_design,
        lower=np.array([p.min for p in file.design.parameters.values()], dtype=float),
        upper=np.array([p.max for p in file.design.parameters.values()], dtype=float),
        C=np.array([[c.terms.get(n, 0.0) for n in names] for c in limits]).reshape(-1, len(names)),
        c_lower=np.array([-np.inf if c.min is None else c.min for c in limits]),
        c_upper=np.array([np.inf if c.max is None else c.max for c in limits]),
    )


def best_least_squares(problem: ExactAssignment, starts: int = STARTS) -> Found:
    """√J by ``least_squares``, or by SLSQP where there are linear constraints."""
    search = _slsqp if len(problem.C) else _least_squares
    return _best(problem, problem.rms, search, starts)


def least_squares_from(problem: ExactAssignment, start: Floats) -> Floats:
    """The end of one ``least_squares`` within the bounds, to SciPy's own tolerances."""
    unit, roots = _Unit(problem), problem.roots
    found = least_squares(
        lambda v: roots * unit.errors(v), unit.v(start),
        lambda v: roots[:, None] * unit.slopes(v), (unit.low, unit.high),
    )  # fmt: skip
    return unit.y(found.x)


def _best(problem: ExactAssignment, value: Any, search: Any, starts: int) -> Found:
    ys, ends, counts, seconds = [], [], [], []
    for start in problem.starts(starts):
        before, begun = problem.evaluations, time.process_time()
        y = search(problem, start)
        seconds.append(time.process_time() - begun)
        counts.append(problem.evaluations - before)
        ys.append(y)
        ends.append(value(y) if problem.violation(y) <= FEASIBLE else np.inf)
    k = int(np.argmin(ends))
    return Found(ys[k], ends[k], tuple(ends), tuple(counts), tuple(seconds))


class _Unit:
    """The design over v in [1, 2]^n: ``least_squares`` takes its first step relative to |v|."""

    def __init__(self, problem: ExactAssignment) -> None:
        self.problem = problem
        held = problem.upper == problem.lower
        self.low, self.high = np.ones(len(held)), np.where(held, 1.0 + 1e-15, 2.0)

    def y(self, v: Floats) -> Floats:
        p = self.problem
        return np.clip(p.lower + p.width * (v - 1.0), p.lower, p.upper)

    def v(self, y: Floats) -> Floats:
        return 1.0 + (y - self.problem.lower) / self.problem.width

    def errors(self, v: Floats) -> Floats:
        return self.problem.errors(self.y(v))

    def slopes(self, v: Floats) -> Floats:
        return self.problem.error_slopes(self.y(v)) * self.problem.width

    def limits(self) -> list[LinearConstraint]:
        """The linear constraints over v."""
        p = self.problem
        if not len(p.C):
            return []
        C, offset = p.C * p.width, p.C @ (p.lower - p.width)
        size = np.abs(C).sum(axis=1)  # each row relative to its range in the box
        return [
            LinearConstraint(
                C / size[:, None], (p.c_lower - offset) / size, (p.c_upper - offset) / size
            )
        ]


def _least_squares(problem: ExactAssignment, start: Floats) -> Floats:
    """Trust-region reflective, then dogbox: the first nears active bounds from inside only."""
    unit, roots = _Unit(problem), problem.roots
    v = unit.v(start)
    for method in ("trf", "dogbox"):
        found = least_squares(
            lambda v: roots * unit.errors(v), v, lambda v: roots[:, None] * unit.slopes(v),
            (unit.low, unit.high), method, ftol=1e-9, xtol=1e-9, gtol=1e-10, max_nfev=100,
        )  # fmt: skip
        v = found.x
    return unit.y(v)


def _slsqp(problem: ExactAssignment, start: Floats) -> Floats:
    """Restarted where it stopped until J falls no more: its quasi-Newton matrix starts anew."""
    unit, weights = _Unit(problem), problem.roots**2
    v, value = unit.v(start), np.inf
    for _ in range(4):
        found = minimize(
            lambda v: float(weights @ unit.errors(v) ** 2), v, method="SLSQP",
            jac=lambda v: 2.0 * (weights * unit.errors(v)) @ unit.slopes(v),
            bounds=list(zip(unit.low, unit.high, strict=True)), constraints=unit.limits(),
            options={"ftol": 1e-13, "maxiter": 150},
        )  # fmt: skip
        v = np.clip(found.x, unit.low, unit.high)
        if not found.fun < value * (1.0 - 1e-6):
            break
        value = found.fun
    return unit.y(v)


def _trapezoidal(t: Floats) -> Floats:
    return 0.5 * (np.append(np.diff(t), 0.0) + np.append(0.0, np.diff(t)))


def _knots_between(file: Any, part: Any) -> list[float]:
    """Points of profiles between two samples that the straight line from one to the next misses."""
    t, found = np.asarray(part.trajectory.time_s), []
    for target in file.targets:
        if target.trajectory not in (None, part.name) or not hasattr(target.frequency, "time"):
            continue
        knots = np.asarray(target.frequency.time, dtype=float)
        for first, last in pairwise(t):
            own = knots[(knots > first) & (knots < last)]
            hz = _wanted(target.frequency, np.array([first, *own, last]))
            line = np.interp(own, [first, last], hz[[0, -1]])
            if np.any(np.abs(line / hz[1:-1] - 1.0) > 1e-12):
                found += own.tolist()
    return found


def _wanted(frequency: Any, time_s: Floats) -> Floats:
    if isinstance(frequency, float | int):
        return np.full(len(time_s), float(frequency))
    return np.interp(time_s, frequency.time, frequency.frequency)
