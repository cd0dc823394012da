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
of what the program promised; a step spoilt by curvature is corrected once. Where a step passes a
kink, at which two modes meet (`crossing`), what is expected behind it is one more row.

The answer is judged by first-order optimality of the exact problem (`stationarity`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from enum import StrEnum

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from eigassign.assignment.checks import Floats, frozen
from eigassign.assignment.crossing import Pairs
from eigassign.assignment.program import SNAP, LinearConstraint, ScaledProgram
from eigassign.assignment.solver import solve_scaled
from eigassign.errors import EigassignError

FIRST, LARGEST, SMALLEST = 0.3, 1.0, 1e-10  # trust region, of the bounds
TAKEN, GOOD = 0.1, 0.7  # of the promised fall: a step is taken, the region doubled
OPTIMAL = 1e-7  # stationarity that is accepted
MET = 1e-9  # excess, relative to the inequality's limit, that is round-off
TINY = 1e-11  # rms relative error that is round-off of exact frequencies
HEAVIER = 6  # tenfold rises of ν in one step, while v falls
CUTS = 12  # programs in one step, while they miss a kink
MISSED = 0.1  # of the promised fall that may be lost at kinks
FLAT = 1e-13  # of the merit: a promised fall below it is round-off


class Objective(StrEnum):
    """What is made small: the mean square of the residuals, or the largest of them."""

    LEAST_SQUARES = "least_squares"
    WORST_CASE = "worst_case"


@dataclass(frozen=True)
class Appraisal:
    """A design seen from the targets: residuals (m,) and excesses (k,), with slopes in y.

    ``slopes`` (m, n_y) and ``excess_slopes`` (k, n_y) are per SI unit of y. An excess is relative
    to its limit, and negative where there is room. ``pairs`` are rows that may have a kink.
    """

    residual: Floats
    slopes: Floats
    excess: Floats
    excess_slopes: Floats
    pairs: Pairs | None = None

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
    pairs: Pairs | None

    def smooth_slopes(self, kinked: NDArray[np.bool_]) -> Floats:
        """Of all rows (m + k, n); of those at kinks the mean of both branches."""
        slopes = np.vstack([self.J, self.C])
        if self.pairs is not None:
            on = kinked[self.pairs.row]
            rows = self.pairs.row[on]
            slopes[rows] = 0.5 * (slopes[rows] + self.pairs.others[on])
        return slopes

    @classmethod
    def of(cls, problem: DesignProblem, box: _Box, z: Floats, seen: Appraisal) -> _Place:
        J, C = (slopes[:, box.free] * box.width for slopes in (seen.slopes, seen.excess_slopes))
        pairs = None if seen.pairs is None else seen.pairs.scaled(box.free, box.width)
        return cls(z, seen, J, C, problem(box.y(z), seen), pairs)


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
                place, predicted = reached, move.model.residual
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
    progress.appraisals += 1
    return _Place.of(problem, box, z, problem.appraise(box.y(z)))


def _better(best: _Place, place: _Place) -> _Place:
    """By violation first, then by F."""
    missed, reached = (max(p.seen.violation, MET) for p in (best, place))
    return place if (reached, place.value) < (missed, best.value) else best


@dataclass(frozen=True)
class _Move:
    """A program's step d, what it promises, and its multipliers for the Hessian."""

    d: Floats
    promised: float  # fall of the merit
    model: _Model  # of residuals and excesses there
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
    """S with S d = (J⁺ − J)ᵀ w + (C⁺ − C)ᵀ μ, by a symmetric rank-one update.

    Of rows at kinks the mean of both branches is taken, which is smooth.
    """
    d = reached.z - place.z
    w = reached.seen.residual if move.on_residual.size == 0 else move.on_residual
    before, after = (p.smooth_slopes(move.model.kinked) for p in (place, reached))
    rest = (after - before).T @ np.append(w, move.on_excess) - S @ d
    along = float(rest @ d)
    if abs(along) <= 1e-8 * np.linalg.norm(rest) * np.linalg.norm(d):
        return S
    return np.asarray(S + np.outer(rest, rest) / along)


# --- What is expected of a step


@dataclass(frozen=True)
class _Model:
    """Residuals (m,) and excesses (k,) expected of a step d, with their slopes there.

    Linear, but where a mode is expected to meet its neighbour: there the worse of that and of the
    eigenvalue of both modes' matrix. ``kinked`` (m + k,) are those rows.
    """

    residual: Floats
    J: Floats
    excess: Floats
    C: Floats
    kinked: NDArray[np.bool_]


def _modelled(place: _Place, r: Floats, c: Floats, d: Floats) -> _Model:
    """Of a step from values r and c, which are those at the place but after a spoilt step."""
    m = len(r)
    values, slopes = np.append(r, c), np.vstack([place.J, place.C])
    expected, kinked = values + slopes @ d, np.zeros(len(values), dtype=bool)
    if place.pairs is not None:
        slopes = slopes.copy()
        shift = values - np.append(place.seen.residual, place.seen.excess)
        found, turning, turned = place.pairs.along(values, np.vstack([place.J, place.C]), shift, d)
        for k, value, slope in zip(
            place.pairs.row[turned], found[turned], turning[turned], strict=True
        ):
            if value > expected[k] if k >= m else abs(value) > abs(expected[k]):
                expected[k], slopes[k], kinked[k] = value, slope, True
    return _Model(expected[:m], slopes[:m], expected[m:], slopes[m:], kinked)


@dataclass(frozen=True)
class _Cuts:
    """Rows value + slope·d ≤ v or t; ``owners`` (q, rows) say of which rows they are, with sign."""

    value: Floats  # (q,)
    slopes: Floats  # (q, n)
    owners: Floats

    @classmethod
    def none(cls, n: int, rows: int) -> _Cuts:
        return cls(np.zeros(0), np.zeros((0, n)), np.zeros((0, rows)))

    def __len__(self) -> int:
        return len(self.value)

    def at(self, d: Floats) -> float:
        """The least v or t, 0 at least."""
        return float(np.max(self.value + self.slopes @ d, initial=0.0))

    def and_through(self, d: Floats, value: Floats, slopes: Floats, owners: Floats) -> _Cuts:
        """Those too that have a value and slope at d."""
        return _Cuts(
            np.append(self.value, value - slopes @ d),
            np.vstack([self.slopes, slopes]),
            np.vstack([self.owners, owners]),
        )


@dataclass(frozen=True)
class _Kinks:
    """What was met behind kinks: of excesses, for v; of the objective, for t.

    In the worst case t is the largest error, in least squares what is to be added to ½‖r + Jd‖².
    """

    excess: _Cuts
    objective: _Cuts

    def with_model(
        self, problem: DesignProblem, place: _Place, r: Floats, d: Floats, model: _Model
    ) -> _Kinks:
        """With what is expected at d."""
        m = len(r)
        own, on = model.kinked[:m], model.kinked[m:]
        excess = self.excess.and_through(d, model.excess[on], model.C[on], np.eye(len(on))[on])
        objective = self.objective
        if problem.objective is Objective.WORST_CASE:
            sign = np.sign(model.residual[own])[:, None]
            there = sign[:, 0] * model.residual[own], sign * model.J[own], sign * np.eye(m)[own]
            objective = objective.and_through(d, *there)
        elif own.any():
            linear = r + place.J @ d
            rise = 0.5 * float(model.residual @ model.residual - linear @ linear)
            steep = model.J.T @ model.residual - place.J.T @ linear
            objective = objective.and_through(d, np.array([rise]), steep[None], np.zeros((1, m)))
        return _Kinks(excess, objective)


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
    Where the step passes a kink, what is expected behind it is one more row, and it is sought anew.
    """
    r, c = place.seen.residual, place.seen.excess
    if spoilt is not None:
        there, move = spoilt
        r = r + there.seen.residual - move.model.residual
        c = c + there.seen.excess - move.model.excess
    _weigh_first(problem, box, place, progress)
    cuts = _Kinks(_Cuts.none(box.n, len(c)), _Cuts.none(box.n, len(r)))
    solved = _solved(problem, box, place, progress, r, c, cuts)
    heavier = progress
    for _ in range(HEAVIER):
        if solved is None or solved[1] <= MET:
            break
        heavier = replace(heavier, weight=10.0 * heavier.weight)
        again = _solved(problem, box, place, heavier, r, c, cuts)
        if again is not None and again[1] < 0.99 * solved[1]:
            progress.weight, solved = heavier.weight, again
    before = _merit(problem, place.value, place.seen.violation, progress.weight)
    curved = _convex(progress.S, place.J, problem)[0]
    best: _Move | None = None
    for _ in range(CUTS):
        if solved is None:
            break
        d, v, on_residual, on_excess = solved
        model = _modelled(place, r, c, d)
        here = 0.5 * float(d @ curved @ d)
        behind = max(float(np.max(model.excess, initial=0.0)), 0.0)
        after = here + _merit(
            problem, _value(problem, box, place, d, model.residual), behind, progress.weight
        )
        if best is None or before - after > best.promised:
            best = _Move(d, before - after, model, on_residual, on_excess)
        linear = r + place.J @ d
        value = _value(problem, box, place, d, linear)
        t = cuts.objective.at(d)
        if problem.objective is Objective.WORST_CASE:
            value += max(t - float(np.max(np.abs(linear), initial=0.0)), 0.0)
        else:
            value += 2.0 * t
        hoped = before - here - _merit(problem, value, v, progress.weight)
        if not model.kinked.any() or hoped <= 0.0 or best.promised >= (1.0 - MISSED) * hoped:
            break
        cuts = cuts.with_model(problem, place, r, d, model)
        solved = _solved(problem, box, place, progress, r, c, cuts)
    if best is None or spoilt is not None or best.promised > FLAT * max(abs(before), TINY**2):
        return best
    if not len(cuts.objective) + len(cuts.excess) or progress.radius < SMALLEST:
        return None
    progress.radius *= 0.1  # nearer to the kink, where the rows behind it hold
    return _program(problem, box, place, progress)


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


def _value(problem: DesignProblem, box: _Box, place: _Place, d: Floats, r: Floats) -> float:
    """F of residuals r after a step."""
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
    problem: DesignProblem,
    box: _Box,
    place: _Place,
    progress: _Progress,
    r: Floats,
    c: Floats,
    cuts: _Kinks,
) -> tuple[Floats, float, Floats, Floats] | None:
    """d (n,), v, and the multipliers of residuals and excesses; None where nothing is found."""
    n, worst = box.n, problem.objective is Objective.WORST_CASE
    last = worst or len(cuts.objective) > 0
    extra = int(len(c) > 0) + int(last)  # v, then t
    _, root = _convex(progress.S, place.J, problem)
    A = np.hstack([root, np.zeros((len(root), extra))])
    cost = np.zeros(n + extra)
    half = 1.0 if worst else 0.5
    cost[:n] = half * box.prices
    if not worst:
        cost[:n] += place.J.T @ r
    v, t = (np.eye(extra)[[k]] for k in (0, -1)) if extra else (np.zeros((1, 0)), np.zeros((1, 0)))
    # each: slopes in d, what multiplies v and t, and the upper limit
    upper_rows: list[tuple[Floats, Floats, Floats]] = []
    if len(c):
        cost[n] = progress.weight
        upper_rows += [(place.C, -v, -c - MET), (cuts.excess.slopes, -v, -cuts.excess.value - MET)]
    if worst:
        upper_rows += [(place.J, -t, -r), (-place.J, -t, r)]
    if last:
        cost[-1] = 1.0
        upper_rows.append((cuts.objective.slopes, -t, -cuts.objective.value))
    rows = [np.hstack([box.rows, np.zeros((len(box.rows), extra))])]
    rows += [np.hstack([a, np.repeat(b, len(a), axis=0)]) for a, b, _ in upper_rows]
    offset = box.rows @ place.z
    low = [box.row_lower - offset, *(np.full(len(a), -np.inf) for a, *_ in upper_rows)]
    high = [box.row_upper - offset, *(limit for *_, limit in upper_rows)]
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
    # No step, with v and t as they are, is feasible: from there limits are walked along in a
    # fraction of the time that OSQP takes, above all where they cannot all be met.
    stay = np.zeros(n + extra)
    if len(c):
        stay[n] = max(float(np.max(c, initial=0.0)), cuts.excess.at(stay[:n])) + MET
    if last:
        largest = float(np.max(np.abs(r), initial=0.0)) if worst else 0.0
        stay[-1] = max(largest, cuts.objective.at(stay[:n]))
    found = solve_scaled(scaled, stay)
    if found is None:
        return None
    x, mu = found
    d = np.clip(x[:n], reach[0], reach[1])
    mu = scale * mu[n + extra :] / norms
    sizes = [len(box.rows), *(len(a) for a, *_ in upper_rows)]
    parts = iter(np.split(mu, np.cumsum(sizes)[:-1])[1:])
    on_excess = next(parts) + cuts.excess.owners.T @ next(parts) if len(c) else np.zeros(0)
    on_residual = np.zeros(0)
    if worst:
        on_residual = next(parts) - next(parts) + cuts.objective.owners.T @ next(parts)
    missed = max(float(np.max(c + place.C @ d, initial=0.0)), cuts.excess.at(d))
    return d, missed, on_residual, on_excess


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
        if self.n == 0 or np.all((row >= self.row_lower) & (row <= self.row_upper)):
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
    place = _Place.of(problem, box, box.z(y), seen)
    J, r, m = place.J, seen.residual, len(seen.residual)
    rows, branches = _branches(place)
    own = rows < m
    kinks, meeting = rows[own], branches[own]
    normals, owners, units = _normals(box, place, seen.excess)
    worst = problem.objective is Objective.WORST_CASE
    size = float(np.abs(box.prices).max())
    if worst and m:
        top = np.abs(r).max()
        on = np.abs(r) >= top - ON * max(top, TINY)
        epigraph = np.vstack([J[on], meeting[on[kinks]]])
        epigraph = epigraph * np.sign(np.append(r[on], r[kinks[on[kinks]]]))[:, None]
        slope = np.append(box.prices, 1.0)
        system = _columns((normals, 0.0), (epigraph, -1.0))
        size += float(np.abs(epigraph).max(initial=0.0))
    else:
        slope = 2.0 * J.T @ r + box.prices
        largest = float(np.linalg.norm(r)) if np.linalg.norm(r) > TINY else 0.0
        size += 2.0 * float(np.linalg.norm(J, axis=0).max(initial=0.0)) * largest
        # shares of the other branches at each kink, ≤ 1 together
        turns = 2.0 * r[kinks, None] * (meeting - J[kinks])
        at, group = np.unique(kinks, return_inverse=True)
        shares = size * np.eye(len(at))
        slope = np.append(slope, -np.full(len(at), size))
        left_over = np.hstack([np.zeros((len(at), box.n)), shares])
        system = np.hstack(
            [
                _columns((normals, np.zeros(len(at)))),
                np.hstack([turns, shares[group]]).T,
                left_over.T,
            ]
        )
    violated = seen.violation > ON
    if size == 0.0:
        return (_unbalanced_violation(box, place) if violated else 0.0), ()
    mu = nnls(system, -slope, maxiter=50 * max(system.shape))[0] if system.size else np.zeros(0)
    left = slope + (system @ mu if system.size else 0.0)
    found = tuple(
        Limit(kind, index, upper, float(m / unit))
        for (kind, index, upper), unit, m in zip(owners, units, mu, strict=False)
    )
    rest = float(np.abs(left).max()) / size
    if violated:
        rest = max(rest, _unbalanced_violation(box, place))
    return rest, found


def _columns(*parts: tuple[Floats, float | Floats]) -> Floats:
    """Slopes (k, n), each with more rows below, as the columns of one matrix."""
    return np.hstack([np.hstack([a, np.tile(np.atleast_1d(b), (len(a), 1))]).T for a, b in parts])


def _branches(place: _Place) -> tuple[NDArray[np.intp], Floats]:
    """Where a row has a kink that the design may lie in: its rows, and slopes of other branches.

    Behind other kinks the row is better than its own branch says: no optimum lies there.
    """
    if place.pairs is None:
        return np.zeros(0, dtype=np.intp), np.zeros((0, place.J.shape[1]))
    worse = np.append(np.sign(place.seen.residual), np.ones(len(place.C)))[place.pairs.row]
    worse_larger = np.where(place.pairs.larger, worse > 0.0, worse < 0.0)
    return place.pairs.chosen(worse_larger).branches(np.vstack([place.J, place.C]))


def _normals(
    box: _Box, place: _Place, excess: Floats
) -> tuple[Floats, list[tuple[str, int, bool]], list[float]]:
    """Outward normals of the limits that z lies on, which they are, and their units."""
    z, normals, owners, units = place.z, [], [], []
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
    rows, branches = _branches(place)
    for at in np.flatnonzero(excess >= -ON):
        for normal in (place.C[at], *branches[rows == len(place.J) + at]):
            normals.append(normal)
            owners.append(("excess", int(at), True))
            units.append(1.0)
    return np.array(normals).reshape(-1, box.n), owners, units


def _unbalanced_violation(box: _Box, place: _Place) -> float:
    """The same of the largest excess: 0 where no direction within the limits lowers it."""
    excess = place.seen.excess
    normals = _normals(box, place, np.full(len(excess), -np.inf))[0]
    on = excess >= excess.max() - ON
    rows, branches = _branches(place)
    own = rows >= len(place.J)
    steepest = np.vstack([place.C[on], branches[own][on[rows[own] - len(place.J)]]])
    slope = np.append(np.zeros(box.n), 1.0)
    system = _columns((normals, 0.0), (steepest, -1.0))
    mu = nnls(system, -slope, maxiter=50 * max(system.shape))[0]
    size = max(float(np.abs(steepest).max()), 1e-300)
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
