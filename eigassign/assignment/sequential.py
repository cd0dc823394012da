"""The exact optimum: quadratic programs in a row, each inside a trust region, judged exactly.

What is minimised over the design y is

    F(y) = Σ_k r_k(y)² + p·(y − y_ref)      least squares,      r_k = √ω_k (f_k / f_d,k − 1), or
    F(y) = max_k |r_k(y)| + p·(y − y_ref)   worst case,

with prices p, bounds, linear constraints, and excesses c(y) ≤ 0 (how far inequalities are missed).
At the design reached, in units z ∈ [0, 1] of the bounds, the step d solves eqs. (13)–(14) anew,

    min ½‖r + J d‖² + ½ dᵀS d + ½ p·d + ν v,   c + C d ≤ v,  v ≥ 0,  |d| ≤ Δ,

or the same with the worst case's epigraph max |r + J d|. The bounds |d| ≤ Δ are the trust region:
its norm is the largest entry, so that it only tightens bounds, and the program stays the one that
`solver` solves. v keeps it feasible, ν is raised until v falls no further. S is the part of the
Hessian that J does not hold, gathered from the slopes met (symmetric rank-one updates), made
convex. A step is taken only if the exact merit, F plus ν times the largest excess, falls by a tenth
of what the program promised; a step spoilt by the curvature of c is corrected once.

The answer is judged by first-order optimality of the exact problem (`stationarity`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np
from scipy.optimize import nnls

from eigassign.assignment.checks import Floats, frozen
from eigassign.assignment.program import SNAP, LinearConstraint, ScaledProgram
from eigassign.assignment.solver import solve_scaled
from eigassign.errors import EigassignError

FIRST, LARGEST, SMALLEST = 0.3, 1.0, 1e-10  # trust region, of the bounds
TAKEN, GOOD = 0.1, 0.7  # of the promised fall: a step is taken, the region doubled
OPTIMAL = 1e-7  # stationarity that is accepted
MET = 1e-9  # excess, relative to the inequality's limit, that is round-off
TINY = 1e-11  # rms relative error that is round-off of exact frequencies
HEAVIER = 6  # tenfold rises of ν in one step, while v falls
FLAT = 1e-13  # of the merit: a promised fall below it is round-off


class Objective(StrEnum):
    """What is made small: the mean square of the residuals, or the largest of them."""

    LEAST_SQUARES = "least_squares"
    WORST_CASE = "worst_case"


@dataclass(frozen=True)
class Appraisal:
    """A design seen from the targets: residuals (m,) and excesses (k,), with slopes in y.

    ``slopes`` (m, n_y) and ``excess_slopes`` (k, n_y) are per SI unit of y. An excess is relative
    to its limit, and negative where there is room.
    """

    residual: Floats
    slopes: Floats
    excess: Floats
    excess_slopes: Floats

    @property
    def violation(self) -> float:
        """The largest excess, 0 if all inequalities hold."""
        return float(np.max(self.excess, initial=0.0))


@dataclass(frozen=True)
class DesignProblem:
    """F and its limits; ``appraise`` may raise EigassignError where a design has no answer."""

    appraise: Callable[[Floats], Appraisal]
    lower: Floats  # (n_y,), finite
    upper: Floats
    constraints: tuple[LinearConstraint, ...] = ()
    prices: Floats | None = None  # (n_y,), of F per SI unit of y
    reference: Floats | None = None  # (n_y,), y that costs nothing
    objective: Objective = Objective.LEAST_SQUARES

    def __call__(self, y: Floats, seen: Appraisal) -> float:
        """F of a design and what `appraise` found of it."""
        r = seen.residual
        if self.objective is Objective.WORST_CASE:
            return float(np.max(np.abs(r), initial=0.0)) + self.price(y)
        return float(r @ r) + self.price(y)

    def price(self, y: Floats) -> float:
        """p·(y − y_ref)."""
        if self.prices is None:
            return 0.0
        return float(self.prices @ (y - (0.0 if self.reference is None else self.reference)))


class End(StrEnum):
    """Why the steps ended."""

    OPTIMAL = "first-order optimal"
    STALLED = "no step improves it further"
    STEPS = "steps used up"
    SECONDS = "time used up"
    INTERRUPTED = "interrupted"


@dataclass(frozen=True)
class Step:
    """One program: the design it led to, what that is worth, and whether it was taken."""

    y: Floats
    objective: float
    violation: float
    radius: float  # of the bounds
    promised: float  # fall of the merit
    taken: bool


@dataclass(frozen=True)
class Limit:
    """A limit that the optimum lies on: what F falls by when it is relaxed by one unit, ≥ 0.

    ``kind`` is bound, constraint or excess; ``index`` counts among them, ``upper`` says which side.
    The unit is the SI one of the parameter or constraint, or 1 (100 % of its limit) of an excess.
    """

    kind: str
    index: int
    upper: bool
    multiplier: float


@dataclass(frozen=True)
class Optimum:
    """The best design found: by violation first, then by F.

    ``stationarity`` as `stationarity` recomputes it. ``predicted`` is what the last program that
    was taken promised of the residuals (m,) here, None if none was.
    """

    y: Floats
    seen: Appraisal
    objective: float
    stationarity: float
    limits: tuple[Limit, ...]
    predicted: Floats | None
    end: End
    steps: tuple[Step, ...]
    appraisals: int


# --- Steps


@dataclass(frozen=True)
class _Place:
    """A design in units of the bounds, with its slopes in these units."""

    z: Floats
    seen: Appraisal
    J: Floats
    C: Floats
    value: float  # F


@dataclass
class _Progress:
    """What the steps have gathered."""

    radius: float
    S: Floats
    weight: float  # ν
    steps: list[Step] = field(default_factory=list)
    appraisals: int = 0


def minimise(
    problem: DesignProblem,
    start: Floats,
    steps: int = 100,
    stop: Callable[[], End | None] = lambda: None,
) -> Optimum:
    """The local optimum that steps from ``start`` (n_y,) lead to; start is put within its limits.

    ``stop`` is asked between steps; Ctrl-C ends them too, and the best design so far is returned.
    Raises what ``appraise`` raises at the start.
    """
    box = _Box.of(problem)
    progress = _Progress(FIRST, np.zeros((box.n, box.n)), 0.0)
    place = best = _placed(problem, box, box.inside(box.z(start)), progress)
    predicted: Floats | None = None
    end = End.STEPS
    try:
        while len(progress.steps) < steps:
            # beyond a limit by a little, where one more program ends on it
            beyond = place is not best or MET < place.seen.violation <= ON
            if not beyond and stationarity(problem, box.y(place.z), place.seen) <= OPTIMAL:
                end = End.OPTIMAL
                break
            if (asked := stop()) is not None:
                end = asked
                break
            move = _program(problem, box, place, progress)
            if move is None or progress.radius < SMALLEST:
                end = End.STALLED
                break
            reached = _try(problem, box, place, move, progress)
            if reached is not None:
                place, predicted = reached, move.residual
                best = _better(best, place)
    except KeyboardInterrupt:
        end = End.INTERRUPTED
    y = box.y(best.z)
    if best is not place:
        predicted = None
    left = stationarity(problem, y, best.seen)
    return Optimum(
        y=frozen(y),
        seen=best.seen,
        objective=best.value,
        stationarity=left,
        limits=tuple(active_limits(problem, y, best.seen)),
        predicted=predicted,
        end=End.OPTIMAL if left <= OPTIMAL else end,
        steps=tuple(progress.steps),
        appraisals=progress.appraisals,
    )


def _placed(problem: DesignProblem, box: _Box, z: Floats, progress: _Progress) -> _Place:
    y = box.y(z)
    progress.appraisals += 1
    seen = problem.appraise(y)
    J, C = (slopes[:, box.free] * box.width for slopes in (seen.slopes, seen.excess_slopes))
    return _Place(z, seen, J, C, problem(y, seen))


def _better(best: _Place, place: _Place) -> _Place:
    """By violation first, then by F."""
    missed, reached = (max(p.seen.violation, MET) for p in (best, place))
    return place if (reached, place.value) < (missed, best.value) else best


@dataclass(frozen=True)
class _Move:
    """A program's step d, what it promises, and its multipliers for the Hessian."""

    d: Floats
    promised: float  # fall of the merit
    residual: Floats  # (m,) by the linear model
    on_residual: Floats  # (m,) weights of the residuals' Hessians in that of the merit
    on_excess: Floats  # (k,)


def _merit(problem: DesignProblem, value: float, violation: float, weight: float) -> float:
    """Half of F for least squares, as in the program, and the weighted violation."""
    half = 0.5 if problem.objective is Objective.LEAST_SQUARES else 1.0
    return half * value + weight * violation


def _try(
    problem: DesignProblem, box: _Box, place: _Place, move: _Move, progress: _Progress
) -> _Place | None:
    """The place that a move leads to if it keeps a tenth of its promise, corrected once if not."""
    reached = _go(problem, box, place, move, progress)
    if reached is not None and not _kept(problem, place, reached, move, progress):
        corrected = _program(problem, box, place, progress, (reached, move))
        if corrected is not None:
            again = _go(problem, box, place, corrected, progress)
            if again is not None and _kept(problem, place, again, move, progress):
                reached, move = again, replace(corrected, promised=move.promised)
    length = float(np.abs(move.d).max(initial=0.0))
    taken = reached is not None and _kept(problem, place, reached, move, progress)
    _record(progress, box, place if reached is None else reached, move, taken)
    if reached is None or not taken:
        progress.radius = 0.25 * min(length, progress.radius)
        if reached is not None:
            progress.S = _updated(progress.S, place, reached, move)
        return None
    fall = _fall(problem, place, reached, progress)
    if fall > GOOD * move.promised and length > 0.9 * progress.radius:
        progress.radius = min(2.0 * progress.radius, LARGEST)
    elif fall < 0.25 * move.promised:
        progress.radius = max(0.5 * length, SMALLEST)
    progress.S = _updated(progress.S, place, reached, move)
    return reached


def _go(
    problem: DesignProblem, box: _Box, place: _Place, move: _Move, progress: _Progress
) -> _Place | None:
    """Where a move leads, None where no design is."""
    z = place.z + move.d
    z = np.where(z <= SNAP, 0.0, np.where(z >= 1.0 - SNAP, 1.0, z))
    try:
        return _placed(problem, box, z, progress)
    except EigassignError:
        return None


def _fall(problem: DesignProblem, place: _Place, reached: _Place, progress: _Progress) -> float:
    before, after = (
        _merit(problem, p.value, p.seen.violation, progress.weight) for p in (place, reached)
    )
    return before - after


def _kept(
    problem: DesignProblem, place: _Place, reached: _Place, move: _Move, progress: _Progress
) -> bool:
    return bool(_fall(problem, place, reached, progress) > TAKEN * move.promised)


def _record(progress: _Progress, box: _Box, reached: _Place, move: _Move, taken: bool) -> None:
    progress.steps.append(
        Step(
            y=frozen(box.y(reached.z)),
            objective=reached.value,
            violation=reached.seen.violation,
            radius=progress.radius,
            promised=move.promised,
            taken=taken,
        )
    )


def _updated(S: Floats, place: _Place, reached: _Place, move: _Move) -> Floats:
    """S with S d = (J⁺ − J)ᵀ w + (C⁺ − C)ᵀ μ, by a symmetric rank-one update."""
    d = reached.z - place.z
    w = reached.seen.residual if move.on_residual.size == 0 else move.on_residual
    rest = (reached.J - place.J).T @ w + (reached.C - place.C).T @ move.on_excess
    rest = rest - S @ d
    along = float(rest @ d)
    if abs(along) <= 1e-8 * np.linalg.norm(rest) * np.linalg.norm(d):
        return S
    return np.asarray(S + np.outer(rest, rest) / along)


# --- One program


def _program(
    problem: DesignProblem,
    box: _Box,
    place: _Place,
    progress: _Progress,
    spoilt: tuple[_Place, _Move] | None = None,
) -> _Move | None:
    """The step of the program at a place; None where it promises nothing.

    After a ``spoilt`` step the model passes through what was found there, not only through here.
    """
    r, c = place.seen.residual, place.seen.excess
    if spoilt is not None:
        there, move = spoilt
        r = there.seen.residual - place.J @ move.d
        c = there.seen.excess - place.C @ move.d
    _weigh_first(problem, box, place, progress)
    solved = _solved(problem, box, place, progress, r, c)
    heavier = progress
    for _ in range(HEAVIER):
        if solved is None or solved[1] <= MET:
            break
        heavier = replace(heavier, weight=10.0 * heavier.weight)
        again = _solved(problem, box, place, heavier, r, c)
        if again is not None and again[1] < 0.99 * solved[1]:
            progress.weight, solved = heavier.weight, again
    if solved is None:
        return None
    d, v, on_residual, on_excess = solved
    linear = place.seen.residual + place.J @ d
    before = _merit(problem, place.value, place.seen.violation, progress.weight)
    after = _merit(problem, _linear_value(problem, box, place, d), v, progress.weight)
    promised = before - after - 0.5 * float(d @ _convex(progress.S, place.J, problem)[0] @ d)
    if spoilt is None and promised <= FLAT * max(abs(before), TINY**2):
        return None
    return _Move(d, promised, linear, on_residual, on_excess)


def _weigh_first(problem: DesignProblem, box: _Box, place: _Place, progress: _Progress) -> None:
    """ν, at first ten times what balances the steepest objective with the flattest excess."""
    if progress.weight == 0.0 and len(place.C):
        half = place.J.T @ place.seen.residual
        steep = np.abs(half).max(initial=0.0)
        if problem.objective is Objective.WORST_CASE:
            steep = np.abs(place.J).max(initial=0.0)
        steep += np.abs(box.prices).max(initial=0.0)
        flat = np.abs(place.C).max(initial=0.0)
        progress.weight = 10.0 * max(steep, 1e-3) / max(flat, 1e-3)


def _linear_value(problem: DesignProblem, box: _Box, place: _Place, d: Floats) -> float:
    r = place.seen.residual + place.J @ d
    price = problem.price(box.y(place.z + d))
    if problem.objective is Objective.WORST_CASE:
        return float(np.max(np.abs(r), initial=0.0)) + price
    return float(r @ r) + price


def _convex(S: Floats, J: Floats, problem: DesignProblem) -> tuple[Floats, Floats]:
    """S such that JᵀJ + S (or S alone, of the worst case) is convex; and a root A of that sum."""
    gauss = J.T @ J if problem.objective is Objective.LEAST_SQUARES else np.zeros_like(S)
    if not S.any() and problem.objective is Objective.LEAST_SQUARES:
        return S, np.asarray(np.linalg.qr(J, mode="r"))
    values, vectors = np.linalg.eigh(gauss + S)
    values = np.maximum(values, 0.0)
    root = np.sqrt(values)[:, None] * vectors.T
    return root.T @ root - gauss, root


def _solved(
    problem: DesignProblem, box: _Box, place: _Place, progress: _Progress, r: Floats, c: Floats
) -> tuple[Floats, float, Floats, Floats] | None:
    """d (n,), v, and the multipliers of residuals and excesses; None where nothing is found."""
    n, worst = box.n, problem.objective is Objective.WORST_CASE
    extra = int(len(c) > 0) + int(worst)  # v, then the epigraph's variable
    _, root = _convex(progress.S, place.J, problem)
    A = np.hstack([root, np.zeros((len(root), extra))])
    cost = np.zeros(n + extra)
    half = 1.0 if worst else 0.5
    cost[:n] = half * box.prices
    if not worst:
        cost[:n] += place.J.T @ r
    rows: list[Floats] = [np.hstack([box.rows, np.zeros((len(box.rows), extra))])]
    low, high = [box.row_lower - box.rows @ place.z], [box.row_upper - box.rows @ place.z]
    if len(c):
        cost[n] = progress.weight
        rows.append(np.hstack([place.C, -np.ones((len(c), 1)), np.zeros((len(c), extra - 1))]))
        low.append(np.full(len(c), -np.inf))
        high.append(-c - MET)
    if worst:
        cost[-1] = 1.0
        J = np.hstack([place.J, np.zeros((len(r), extra - 1)), -np.ones((len(r), 1))])
        rows += [J, J * np.append(-np.ones(n), np.ones(extra))]
        low += [np.full(len(r), -np.inf)] * 2
        high += [-r, r]
    reach = [np.maximum(-place.z, -progress.radius), np.minimum(1.0 - place.z, progress.radius)]
    beyond = (np.zeros(extra), np.full(extra, np.inf))
    G, lower, upper = np.vstack(rows), np.concatenate(low), np.concatenate(high)
    norms = np.linalg.norm(G, axis=1)
    norms = np.where(norms > 0.0, norms, 1.0)
    scale = max(float(np.abs(cost).max(initial=0.0)), float(np.abs(root).max(initial=0.0)) ** 2)
    if scale == 0.0:
        return None
    scaled = ScaledProgram(
        A=A / np.sqrt(scale),
        b=np.zeros(len(A)),
        G=np.vstack([np.eye(n + extra), G / norms[:, None]]),
        lower=np.concatenate([reach[0], beyond[0], lower / norms]),
        upper=np.concatenate([reach[1], beyond[1], upper / norms]),
        cost=cost / scale,
    )
    # No step, with v and the epigraph as they are, is feasible: from there limits are walked along
    # in a fraction of the time that OSQP takes, above all where they cannot all be met.
    stay = np.zeros(n + extra)
    if len(c):
        stay[n] = float(np.max(c + MET, initial=0.0))
    if worst:
        stay[-1] = float(np.max(np.abs(r), initial=0.0))
    found = solve_scaled(scaled, stay)
    if found is None:
        return None
    x, mu = found
    d = np.clip(x[:n], reach[0], reach[1])
    mu = scale * mu[n + extra :] / norms
    first = len(box.rows)
    on_excess = mu[first : first + len(c)]
    m = len(r)
    both = mu[first + len(c) :]
    on_residual = both[:m] - both[m:] if worst else np.zeros(0)
    v = float(np.max(c + place.C @ d, initial=0.0)) if len(c) else 0.0
    return d, v, on_residual, on_excess


# --- The bounds as units


@dataclass(frozen=True)
class _Box:
    """z = (y − lower)/width of the parameters with room, and the linear constraints over z."""

    lower: Floats
    all_width: Floats
    free: list[int]
    width: Floats  # of the free ones
    rows: Floats
    row_lower: Floats
    row_upper: Floats
    prices: Floats

    @classmethod
    def of(cls, problem: DesignProblem) -> _Box:
        width = problem.upper - problem.lower
        free = [int(j) for j in np.flatnonzero(width > 0.0)]
        C = np.array([row.coefficients for row in problem.constraints])
        C = C.reshape(len(problem.constraints), len(width))
        fixed = C @ problem.lower
        rows = C[:, free] * width[free]
        prices = np.zeros(len(width)) if problem.prices is None else problem.prices
        return cls(
            lower=problem.lower,
            all_width=width,
            free=free,
            width=width[free],
            rows=rows,
            row_lower=np.array([row.lower for row in problem.constraints]) - fixed,
            row_upper=np.array([row.upper for row in problem.constraints]) - fixed,
            prices=prices[free] * width[free],
        )

    @property
    def n(self) -> int:
        return len(self.free)

    def z(self, y: Floats) -> Floats:
        return np.asarray((y[self.free] - self.lower[self.free]) / self.width)

    def y(self, z: Floats) -> Floats:
        y = self.lower.copy()
        y[self.free] = self.lower[self.free] + z * self.width
        top = self.lower + self.all_width
        y[self.free] = np.where(z >= 1.0, top[self.free], y[self.free])
        return y

    def inside(self, z: Floats) -> Floats:
        """The nearest z within bounds and constraints."""
        z = np.clip(z, 0.0, 1.0)
        row = self.rows @ z
        if np.all((row >= self.row_lower) & (row <= self.row_upper)):
            return z
        norms = np.linalg.norm(self.rows, axis=1)
        norms = np.where(norms > 0.0, norms, 1.0)
        found = solve_scaled(
            ScaledProgram(
                A=np.eye(self.n),
                b=-z,
                G=np.vstack([np.eye(self.n), self.rows / norms[:, None]]),
                lower=np.append(np.zeros(self.n), self.row_lower / norms),
                upper=np.append(np.ones(self.n), self.row_upper / norms),
                cost=np.zeros(self.n),
            )
        )
        return z if found is None else np.clip(found[0], 0.0, 1.0)


# --- First-order optimality, recomputed from a design's own slopes

ON = 1e-7  # of the bounds or of the limit: this near to a limit is on it


def stationarity(problem: DesignProblem, y: Floats, seen: Appraisal) -> float:
    """How far y is from first-order optimality: 0 at a local optimum, 1 where nothing is balanced.

    The part of the slope of F (or of the violation, where inequalities are missed) that no limit
    on which y lies can balance, in units of the bounds, relative to the largest slope that the
    residuals could give: for least squares the largest cosine between Jᵀ's rows and r.
    """
    return _balance(problem, y, seen)[0]


def active_limits(problem: DesignProblem, y: Floats, seen: Appraisal) -> Iterator[Limit]:
    """The limits that y lies on, with what F falls by per unit relaxed."""
    yield from _balance(problem, y, seen)[1]


def _balance(problem: DesignProblem, y: Floats, seen: Appraisal) -> tuple[float, tuple[Limit, ...]]:
    box = _Box.of(problem)
    if box.n == 0:
        return 0.0, ()
    z = box.z(y)
    J, C = (slopes[:, box.free] * box.width for slopes in (seen.slopes, seen.excess_slopes))
    normals, owners, units = _normals(box, z, C, seen.excess)
    r = seen.residual
    worst = problem.objective is Objective.WORST_CASE
    if worst and len(r):
        top = np.abs(r).max()
        on = np.abs(r) >= top - ON * max(top, TINY)
        epigraph = J[on] * np.sign(r[on])[:, None]
        slope = np.append(box.prices, 1.0)
        system = np.hstack(
            [
                np.vstack([normals.T, np.zeros((1, len(normals)))]),
                np.vstack([epigraph.T, -np.ones((1, on.sum()))]),
            ]
        )
        size = float(np.abs(epigraph).max(initial=0.0)) + float(np.abs(box.prices).max())
    else:
        slope = 2.0 * J.T @ r + box.prices
        system = normals.T
        size = 2.0 * float(np.linalg.norm(J, axis=0).max(initial=0.0)) * float(np.linalg.norm(r))
        size += float(np.abs(box.prices).max())
        if np.linalg.norm(r) <= TINY and not box.prices.any():
            size = 0.0
    violated = seen.violation > ON
    if size == 0.0:
        return (_unbalanced_violation(box, z, C, seen.excess) if violated else 0.0), ()
    mu = nnls(system, -slope, maxiter=50 * max(system.shape))[0] if system.size else np.zeros(0)
    left = slope + (system @ mu if system.size else 0.0)
    found = tuple(
        Limit(kind, index, upper, float(m / unit))
        for (kind, index, upper), unit, m in zip(owners, units, mu, strict=False)
    )
    rest = float(np.abs(left).max()) / size
    if violated:
        rest = max(rest, _unbalanced_violation(box, z, C, seen.excess))
    return rest, found


def _normals(
    box: _Box, z: Floats, C: Floats, excess: Floats
) -> tuple[Floats, list[tuple[str, int, bool]], list[float]]:
    """Outward normals of the limits that z lies on, which they are, and their units."""
    normals, owners, units = [], [], []
    for i, j in enumerate(box.free):
        for upper, on in ((False, z[i] <= ON), (True, z[i] >= 1.0 - ON)):
            if on:
                normals.append((1.0 if upper else -1.0) * np.eye(box.n)[i])
                owners.append(("bound", j, upper))
                units.append(float(box.width[i]))
    row, norms = box.rows @ z, np.abs(box.rows).sum(axis=1)
    for k in range(len(box.rows)):
        for upper, limit in ((False, box.row_lower[k]), (True, box.row_upper[k])):
            if np.isfinite(limit) and abs(row[k] - limit) <= ON * max(norms[k], 1e-300):
                normals.append((1.0 if upper else -1.0) * box.rows[k])
                owners.append(("constraint", k, upper))
                units.append(1.0)
    for at in np.flatnonzero(excess >= -ON):
        normals.append(C[at])
        owners.append(("excess", int(at), True))
        units.append(1.0)
    return np.array(normals).reshape(-1, box.n), owners, units


def _unbalanced_violation(box: _Box, z: Floats, C: Floats, excess: Floats) -> float:
    """The same of the largest excess: 0 where no direction within the limits lowers it."""
    normals = _normals(box, z, C, np.full(len(excess), -np.inf))[0]
    on = excess >= excess.max() - ON
    slope = np.append(np.zeros(box.n), 1.0)
    system = np.hstack(
        [
            np.vstack([normals.T, np.zeros((1, len(normals)))]),
            np.vstack([C[on].T, -np.ones((1, on.sum()))]),
        ]
    )
    mu = nnls(system, -slope, maxiter=50 * max(system.shape))[0]
    size = max(float(np.abs(C[on]).max()), 1e-300)
    return float(np.abs(slope + system @ mu).max()) / max(size, 1.0)


# --- Several starts


def distinct(optima: Sequence[Optimum], problem: DesignProblem) -> tuple[Optimum, ...]:
    """Optima by violation, then F, those of the same design (to 1e-3 of the bounds) once."""
    width = np.where(problem.upper > problem.lower, problem.upper - problem.lower, 1.0)
    ordered = sorted(optima, key=lambda o: (max(o.seen.violation, MET), o.objective))
    kept: list[Optimum] = []
    for found in ordered:
        if all(np.abs((found.y - other.y) / width).max(initial=0.0) > 1e-3 for other in kept):
            kept.append(found)
    return tuple(kept)
