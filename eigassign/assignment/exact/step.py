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
    UnitBox,
    merit,
)
from eigassign.assignment.program import ScaledProgram
from eigassign.assignment.solver import solve_scaled

SMALLEST = 1e-10  # trust region, of the bounds
FLAT = 1e-13  # of the merit: a promised fall below it is round-off


@dataclass(frozen=True)
class TrustRegion:
    """The knowledge of the problem that the steps have gathered."""

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
        """Add cuts that have a value and slope at d."""
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

    def with_model(self, local: _LocalProblem, d: Floats, model: Expected) -> _Kinks:
        """Add what is expected at d."""
        m, place = len(local.r), local.place
        own, on = model.kinked[:m], model.kinked[m:]
        excess = self.excess.and_through(d, model.excess[on], model.C[on], np.eye(len(on))[on])
        objective = self.objective
        if local.problem.is_worst_case:
            sign = np.sign(model.residual[own])[:, None]
            there = sign[:, 0] * model.residual[own], sign * model.J[own], sign * np.eye(m)[own]
            objective = objective.and_through(d, *there)
        elif own.any():
            linear = local.r + place.J @ d
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
) -> tuple[ProposedStep | None, TrustRegion]:
    """The step of the program at a place, None where there is none, and the region it was made in.

    After a ``spoilt`` step the model passes through what was found there, not only through here.
    Where all steps past a kink promise nothing, the region shrinks to where the rows behind the
    kink hold.
    """
    r, c = place.seen.residual, place.seen.excess
    if spoilt is not None:
        there, move = spoilt
        r = r + there.seen.residual - move.model.residual
        c = c + there.seen.excess - move.model.excess
    local = _LocalProblem(problem, box, place, r, c)
    if region.weight == 0.0 and len(c):
        region = replace(region, weight=local.first_weight())
    while True:
        best, passed_kinks, region = local.best_step(region)
        before = merit(problem, place.value, place.seen.violation, region.weight)
        if best is None or spoilt is not None or best.promised > FLAT * max(abs(before), TINY**2):
            return best, region
        if not passed_kinks or region.radius < SMALLEST:
            return (replace(best, promised=0.0) if best.d.any() else None), region
        region = replace(region, radius=0.1 * region.radius)


@dataclass(frozen=True)
class _LocalProblem:
    """The problem about a place; r and c are the values there, but after a spoilt step."""

    problem: DesignProblem
    box: UnitBox
    place: DesignPoint
    r: Floats
    c: Floats

    def first_weight(self) -> float:
        """ν, ten times what balances the steepest objective with the flattest excess."""
        J = self.place.J
        steep = np.abs(J if self.problem.is_worst_case else J.T @ self.r).max(initial=0.0)
        steep += np.abs(self.box.prices).max(initial=0.0)
        flat = np.abs(self.place.C).max(initial=0.0)
        return float(10.0 * max(steep, 1e-3) / max(flat, 1e-3))

    def best_step(self, region: TrustRegion) -> tuple[ProposedStep | None, bool, TrustRegion]:
        """The step that promises most, whether one passed a kink, and the region with its weight.

        Where a step passes a kink, what is expected behind it is one more row, and it is sought
        anew.
        """
        problem, place = self.problem, self.place
        cuts = _Kinks(_Cuts.none(self.box.n, len(self.c)), _Cuts.none(self.box.n, len(self.r)))
        solved, heavier = self.solved(region, cuts), region
        for _ in range(6):  # tenfold rises of ν, while v falls
            if solved is None or solved[1] <= MET:
                break
            heavier = replace(heavier, weight=10.0 * heavier.weight)
            again = self.solved(heavier, cuts)
            if again is not None and again[1] < 0.99 * solved[1]:
                region, solved = heavier, again
        before = merit(problem, place.value, place.seen.violation, region.weight)
        curved = self.convex(region.S)[0]
        best: ProposedStep | None = None
        for _ in range(12):  # programs, while they miss a kink
            if solved is None:
                break
            d, v, on_residual, on_excess = solved
            y, model = self.box.y(place.z + d), self.expected(d)
            here = 0.5 * float(d @ curved @ d)
            behind = float(np.max(model.excess, initial=0.0))
            value = problem.value(y, model.residual)
            promised = before - here - merit(problem, value, behind, region.weight)
            if best is None or promised > best.promised:
                best = ProposedStep(d, promised, model, on_residual, on_excess)
            linear = self.r + place.J @ d
            hoped, t = problem.value(y, linear), cuts.objective.at(d)
            if problem.is_worst_case:
                hoped += max(t - float(np.max(np.abs(linear), initial=0.0)), 0.0)
            else:
                hoped += 2.0 * t
            hoped = before - here - merit(problem, hoped, v, region.weight)
            # a step is taken for a tenth of its promise: as little may be lost at kinks
            if not model.kinked.any() or hoped <= 0.0 or best.promised >= 0.9 * hoped:
                break
            cuts = cuts.with_model(self, d, model)
            solved = self.solved(region, cuts)
        return best, len(cuts.objective) + len(cuts.excess) > 0, region

    def expected(self, d: Floats) -> Expected:
        """Residuals and excesses that are expected of a step."""
        place, m = self.place, len(self.r)
        values, slopes = np.append(self.r, self.c), np.vstack([place.J, place.C])
        expected, kinked = values + slopes @ d, np.zeros(len(values), dtype=bool)
        if place.pairs is not None:
            shift = values - np.append(place.seen.residual, place.seen.excess)
            found, turning, turned = place.pairs.along(values, slopes, shift, d)
            for k, value, slope in zip(
                place.pairs.row[turned], found[turned], turning[turned], strict=True
            ):
                if value > expected[k] if k >= m else abs(value) > abs(expected[k]):
                    expected[k], slopes[k], kinked[k] = value, slope, True
        return Expected(expected[:m], slopes[:m], expected[m:], slopes[m:], kinked)

    def convex(self, S: Floats) -> tuple[Floats, Floats]:
        """S such that JᵀJ + S (S alone, of the worst case) is convex; and a root A of that sum."""
        J, worst = self.place.J, self.problem.is_worst_case
        gauss = np.zeros_like(S) if worst else J.T @ J
        if not S.any() and not worst:
            return S, np.asarray(np.linalg.qr(J, mode="r"))
        values, vectors = np.linalg.eigh(gauss + S)
        values = np.maximum(values, 0.0)
        root = np.sqrt(values)[:, None] * vectors.T
        return root.T @ root - gauss, root

    def solved(
        self, region: TrustRegion, cuts: _Kinks
    ) -> tuple[Floats, float, Floats, Floats] | None:
        """d (n,), v, and the multipliers of residuals and excesses; None where nothing is found."""
        box, place, r, c = self.box, self.place, self.r, self.c
        n, worst = box.n, self.problem.is_worst_case
        needs_t = worst or len(cuts.objective) > 0
        _, root = self.convex(region.S)
        slope = box.prices if worst else 0.5 * box.prices + place.J.T @ r
        cost = np.append(slope, [region.weight if len(c) else 0.0, 1.0 if needs_t else 0.0])
        offset, (v, t) = box.rows @ place.z, -np.eye(2)
        # each: slopes in d, what multiplies v and t, and the limits
        rows = [
            (box.rows, 0.0 * v, box.row_lower - offset, box.row_upper - offset),
            (place.C, v, -np.inf, -c - MET),
            (cuts.excess.slopes, v, -np.inf, -cuts.excess.value - MET),
            (cuts.objective.slopes, t, -np.inf, -cuts.objective.value),
        ]
        if worst:
            rows += [(place.J, t, -np.inf, -r), (-place.J, t, -np.inf, r)]
        G = np.vstack([np.hstack([a, np.tile(b, (len(a), 1))]) for a, b, *_ in rows])
        lower = np.concatenate([np.full(len(a), low) for a, _, low, _ in rows])
        upper = np.concatenate([high for *_, high in rows])
        norms = np.linalg.norm(G, axis=1)
        norms = np.where(norms > 0.0, norms, 1.0)
        scale = max(float(np.abs(cost).max()), float(np.abs(root).max(initial=0.0)) ** 2)
        if scale == 0.0:
            return None
        least = np.maximum(-place.z, -region.radius)
        most = np.minimum(1.0 - place.z, region.radius)
        scaled = ScaledProgram(
            A=np.pad(root, ((0, 0), (0, 2))) / np.sqrt(scale),
            b=np.zeros(len(root)),
            G=np.vstack([np.eye(n + 2), G / norms[:, None]]),
            lower=np.concatenate([least, np.zeros(2), lower / norms]),
            upper=np.concatenate([most, np.full(2, np.inf), upper / norms]),
            cost=cost / scale,
        )
        # No step, with v and t as they are, is feasible: from there limits are walked along in a
        # fraction of the time that OSQP takes, above all where they cannot all be met.
        stay = np.zeros(n + 2)
        if len(c):
            stay[n] = max(float(c.max()), cuts.excess.at(stay[:n])) + MET
        largest = float(np.max(np.abs(r), initial=0.0)) if worst else 0.0
        stay[-1] = max(largest, cuts.objective.at(stay[:n]))
        found = solve_scaled(scaled, stay)
        if found is None:
            return None
        d, mu = np.clip(found[0][:n], least, most), scale * found[1][n + 2 :] / norms
        parts = np.split(mu, np.cumsum([len(a) for a, *_ in rows])[:-1])
        on_excess, on_residual = parts[1] + cuts.excess.owners.T @ parts[2], np.zeros(0)
        if worst:
            on_residual = parts[4] - parts[5] + cuts.objective.owners.T @ parts[3]
        missed = max(float(np.max(c + place.C @ d, initial=0.0)), cuts.excess.at(d))
        return d, missed, on_residual, on_excess
