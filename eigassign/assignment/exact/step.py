"""One step of the sequential method: the program of eqs. (13)–(14) anew, in a trust region.

At the design reached, in units z ∈ [0, 1] of the bounds, the step d solves eqs. (13)–(14) anew,

    min ½‖r + J d‖² + ½ dᵀS d + ½ p·d + ν v,   c + C d ≤ v,  v ≥ 0,  |d| ≤ Δ,

or the same with the worst case's epigraph max |r + J d|. The bounds |d| ≤ Δ are the trust region:
its norm is the largest entry, so that it only tightens bounds, and the program stays the one that
`solver` solves. v keeps it feasible, ν is raised until v falls no further. S is the part of the
Hessian that J does not hold, gathered from the slopes met (symmetric rank-one updates), made
convex. Where a step passes a kink, at which two modes meet (`crossing`), what is expected behind it
is one more row.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.checks import Floats
from eigassign.assignment.exact.design_problem import (
    MET,
    TINY,
    DesignPoint,
    DesignProblem,
    Objective,
    UnitBox,
    merit,
)
from eigassign.assignment.program import ScaledProgram
from eigassign.assignment.solver import solve_scaled

SMALLEST = 1e-10  # trust region, of the bounds
HEAVIER = 6  # tenfold rises of ν in one step, while v falls
CUTS = 12  # programs in one step, while they miss a kink
MISSED = 0.1  # of the promised fall that may be lost at kinks
FLAT = 1e-13  # of the merit: a promised fall below it is round-off


@dataclass
class TrustRegion:
    """What the steps have gathered of the problem."""

    radius: float
    S: Floats
    weight: float  # ν


@dataclass(frozen=True)
class ProposedStep:
    """A program's step d, what it promises, and its multipliers for the Hessian."""

    d: Floats
    promised: float  # fall of the merit, 0 where it is round-off
    model: Expected  # of residuals and excesses there
    on_residual: Floats  # (m,) weights of the residuals' Hessians in that of the merit
    on_excess: Floats  # (k,)


# --- What is expected of a step


@dataclass(frozen=True)
class Expected:
    """Residuals (m,) and excesses (k,) expected of a step d, with their slopes there.

    Linear, but where a mode is expected to meet its neighbour: there the worse of that and of the
    eigenvalue of both modes' matrix. ``kinked`` (m + k,) are those rows.
    """

    residual: Floats
    J: Floats
    excess: Floats
    C: Floats
    kinked: NDArray[np.bool_]


def _expected_at(place: DesignPoint, r: Floats, c: Floats, d: Floats) -> Expected:
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
    return Expected(expected[:m], slopes[:m], expected[m:], slopes[m:], kinked)


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
        self, problem: DesignProblem, place: DesignPoint, r: Floats, d: Floats, model: Expected
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


def step_program(
    problem: DesignProblem,
    box: UnitBox,
    place: DesignPoint,
    region: TrustRegion,
    spoilt: tuple[DesignPoint, ProposedStep] | None = None,
) -> ProposedStep | None:
    """The step of the program at a place; None where there is none.

    After a ``spoilt`` step the model passes through what was found there, not only through here.
    Where the step passes a kink, what is expected behind it is one more row, and it is sought anew.
    """
    r, c = place.seen.residual, place.seen.excess
    if spoilt is not None:
        there, move = spoilt
        r = r + there.seen.residual - move.model.residual
        c = c + there.seen.excess - move.model.excess
    _weigh_first(problem, box, place, region)
    cuts = _Kinks(_Cuts.none(box.n, len(c)), _Cuts.none(box.n, len(r)))
    solved = _solved(problem, box, place, region, r, c, cuts)
    heavier = region
    for _ in range(HEAVIER):
        if solved is None or solved[1] <= MET:
            break
        heavier = replace(heavier, weight=10.0 * heavier.weight)
        again = _solved(problem, box, place, heavier, r, c, cuts)
        if again is not None and again[1] < 0.99 * solved[1]:
            region.weight, solved = heavier.weight, again
    before = merit(problem, place.value, place.seen.violation, region.weight)
    curved = _convex(region.S, place.J, problem)[0]
    best: ProposedStep | None = None
    for _ in range(CUTS):
        if solved is None:
            break
        d, v, on_residual, on_excess = solved
        model = _expected_at(place, r, c, d)
        here = 0.5 * float(d @ curved @ d)
        behind = max(float(np.max(model.excess, initial=0.0)), 0.0)
        after = here + merit(
            problem, _value(problem, box, place, d, model.residual), behind, region.weight
        )
        if best is None or before - after > best.promised:
            best = ProposedStep(d, before - after, model, on_residual, on_excess)
        linear = r + place.J @ d
        value = _value(problem, box, place, d, linear)
        t = cuts.objective.at(d)
        if problem.objective is Objective.WORST_CASE:
            value += max(t - float(np.max(np.abs(linear), initial=0.0)), 0.0)
        else:
            value += 2.0 * t
        hoped = before - here - merit(problem, value, v, region.weight)
        if not model.kinked.any() or hoped <= 0.0 or best.promised >= (1.0 - MISSED) * hoped:
            break
        cuts = cuts.with_model(problem, place, r, d, model)
        solved = _solved(problem, box, place, region, r, c, cuts)
    if best is None or spoilt is not None or best.promised > FLAT * max(abs(before), TINY**2):
        return best
    if not len(cuts.objective) + len(cuts.excess) or region.radius < SMALLEST:
        return replace(best, promised=0.0) if best.d.any() else None
    region.radius *= 0.1  # nearer to the kink, where the rows behind it hold
    return step_program(problem, box, place, region)


def _weigh_first(
    problem: DesignProblem, box: UnitBox, place: DesignPoint, region: TrustRegion
) -> None:
    """ν, at first ten times what balances the steepest objective with the flattest excess."""
    if region.weight == 0.0 and len(place.C):
        half = place.J.T @ place.seen.residual
        steep = np.abs(half).max(initial=0.0)
        if problem.objective is Objective.WORST_CASE:
            steep = np.abs(place.J).max(initial=0.0)
        steep += np.abs(box.prices).max(initial=0.0)
        flat = np.abs(place.C).max(initial=0.0)
        region.weight = 10.0 * max(steep, 1e-3) / max(flat, 1e-3)


def _value(problem: DesignProblem, box: UnitBox, place: DesignPoint, d: Floats, r: Floats) -> float:
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
    box: UnitBox,
    place: DesignPoint,
    region: TrustRegion,
    r: Floats,
    c: Floats,
    cuts: _Kinks,
) -> tuple[Floats, float, Floats, Floats] | None:
    """d (n,), v, and the multipliers of residuals and excesses; None where nothing is found."""
    n, worst = box.n, problem.objective is Objective.WORST_CASE
    last = worst or len(cuts.objective) > 0
    extra = int(len(c) > 0) + int(last)  # v, then t
    _, root = _convex(region.S, place.J, problem)
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
        cost[n] = region.weight
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
    reach = [np.maximum(-place.z, -region.radius), np.minimum(1.0 - place.z, region.radius)]
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
