"""One step of the sequential method: the program of eqs. (13)–(14) anew, in a trust region.

At the design reached, in units z ∈ [0, 1] of the bounds, the step d solves eqs. (13)–(14) anew,

    min ½‖r + J d‖² + ½ dᵀS d + ½ c'·d + ν v,   c + C d ≤ v,  v ≥ 0,  |d| ≤ Δ,

or the same with the epigraph of the largest: max |r + J d| ≤ t, or r + J d ≤ t. The bounds |d| ≤ Δ
are the trust region: its norm is the largest entry, so that it only tightens bounds, and the
program stays one that `assignment.program` solves. v keeps it feasible, ν is raised until v falls
no further. S is the part of the Hessian that J does not hold, gathered from the slopes met
(symmetric rank-one updates), made convex. Where the design expects of the step rows that the
program had not, it is sought anew with them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from eigassign.arrays import Floats
from eigassign.assignment.exact.design_point import DesignPoint, Expected, Rows
from eigassign.assignment.exact.design_problem import MET, TINY, DesignProblem, UnitBox, merit
from eigassign.assignment.program import Program, solve_program

SMALLEST = 1e-10  # trust region, of the bounds
FLAT = 1e-13  # of the merit: a promised fall below it is round-off


@dataclass
class TrustRegion:
    """The knowledge of the problem that the steps gather, and change."""

    radius: float
    S: Floats
    weight: float  # ν


class ProposedStep(NamedTuple):
    """A program's step d, what it promises, and the multipliers of its rows."""

    d: Floats
    promised: float  # fall of the merit, 0 where it is round-off
    expected: Expected
    multipliers: Floats  # (m + k,) with signs; of squares those of excesses alone


def step_program(
    problem: DesignProblem,
    box: UnitBox,
    place: DesignPoint,
    region: TrustRegion,
    spoilt: tuple[DesignPoint, ProposedStep] | None = None,
) -> ProposedStep | None:
    """The step of the program at a place, None where there is none; the region is as it needs.

    After a ``spoilt`` step the rows pass through what was found there, not only through here. Where
    steps with more and more rows promise nothing, the region shrinks to where the last ones hold;
    if that helps nothing, the first one is to show by its slopes whether it is nearer.
    """
    if spoilt is not None:
        there, move = spoilt
        place = place.shifted(there.values - move.expected.values)
    program = _Program(problem, box, place, region, *_convex(place, region.S))
    if region.weight == 0.0 and len(place.seen.excess):
        region.weight = program.first_weight()
    flat: tuple[ProposedStep, float] | None = None
    while True:
        best, has_more_rows = program.best_step()
        before = merit(problem, place.value, place.seen.violation, region.weight)
        if best is None or spoilt is not None or best.promised > FLAT * max(abs(before), TINY**2):
            return best
        flat = flat or (best._replace(promised=0.0), region.radius)
        if not has_more_rows or region.radius < SMALLEST:
            step, region.radius = flat
            return step if step.d.any() else None
        region.radius *= 0.1


def _convex(place: DesignPoint, S: Floats) -> tuple[Floats, Floats]:
    """S such that JᵀJ + S (S alone, of the largest) is convex; and a root A of that sum."""
    J = place.slopes[: place.m]
    if place.squared and not S.any():
        return S, np.asarray(np.linalg.qr(J, mode="r"))
    gauss = J.T @ J if place.squared else np.zeros_like(S)
    values, vectors = np.linalg.eigh(gauss + S)
    root = np.sqrt(np.maximum(values, 0.0))[:, None] * vectors.T
    return root.T @ root - gauss, root


class _Program(NamedTuple):
    """The program about a place in a region, for any rows."""

    problem: DesignProblem
    box: UnitBox
    place: DesignPoint
    region: TrustRegion
    S: Floats  # convex
    root: Floats  # of the Hessian

    @property
    def least(self) -> float:
        """The least t: errors are not below 0."""
        return -np.inf if self.place.one_sided and self.place.m else 0.0

    def first_weight(self) -> float:
        """ν, ten times what balances the steepest objective with the flattest excess."""
        place = self.place
        J, C = np.split(place.slopes, [place.m])
        steep = np.abs(J.T @ place.values[: place.m] if place.squared else J).max(initial=0.0)
        steep += np.abs(place.cost_slopes).max(initial=0.0)
        return float(10.0 * max(steep, 1e-3) / max(np.abs(C).max(initial=0.0), 1e-3))

    def best_step(self) -> tuple[ProposedStep | None, bool]:
        """The step that promises most, and whether rows were added."""
        problem, place, rows = self.problem, self.place, self.place.first_rows()
        cost_here = problem.price(self.box.y(place.z))
        solved, weight = self.with_weight(rows), self.region.weight
        before = merit(problem, place.value, place.seen.violation, weight)
        best, count = None, len(rows)
        for _ in range(12):  # programs, while they miss rows
            if solved is None:
                break
            d, multipliers = solved
            cost, expected = cost_here + float(place.cost_slopes @ d), place.at(d)
            curved = before - 0.5 * float(d @ self.S @ d)
            value = problem.measure(expected.values[: place.m]) + cost
            violation = float(np.max(expected.values[place.m :], initial=0.0))
            promised = curved - merit(problem, value, violation, weight)
            if best is None or promised > best.promised:
                best = ProposedStep(d, promised, expected, multipliers)
            v, t = rows.levels(d, self.least)
            value = cost + t
            if place.squared:
                value = problem.measure(place.lines(d)[: place.m]) + cost + 2.0 * t
            hoped = curved - merit(problem, value, v, weight)
            # a step is taken for a tenth of its promise: as little may be lost at missed rows
            if not len(expected.rows) or hoped <= 0.0 or best.promised >= 0.9 * hoped:
                break
            rows = rows.and_more(expected.rows)
            solved = self.solved(rows, weight)
        return best, len(rows) > count

    def with_weight(self, rows: Rows) -> tuple[Floats, Floats] | None:
        """The step that the rows lead to, with a ν that no further rise betters."""
        weight = self.region.weight
        solved, last = self.solved(rows, weight), None
        for _ in range(6):  # tenfold rises of ν, while v falls
            if solved is None or (v := rows.levels(solved[0], self.least)[0]) <= MET:
                break
            last = last or self.solved(rows, 1e6 * weight)  # v does not rise with ν: none is less
            if last is not None and rows.levels(last[0], self.least)[0] >= 0.99 * v:
                break
            weight *= 10.0
            again = self.solved(rows, weight)
            if again is not None and rows.levels(again[0], self.least)[0] < 0.99 * v:
                self.region.weight, solved = weight, again
        return solved

    def solved(self, rows: Rows, weight: float) -> tuple[Floats, Floats] | None:
        """d (n,) and the multipliers (m + k,) of rows; None where nothing is found."""
        box, place, n = self.box, self.place, self.box.n
        slope, limited = place.cost_slopes, len(place.seen.excess) > 0
        if place.squared:
            slope = 0.5 * slope + place.slopes[: place.m].T @ place.values[: place.m]
        needs_t = (not place.squared and place.m > 0) or not rows.of_excess.all()
        # rows of one sign may have any unit: t is in that of their size
        unit = max(abs(place.seen.residual).max(), TINY) if np.isinf(self.least) else 1.0
        cost = np.append(slope, [weight if limited else 0.0, unit if needs_t else 0.0])
        offset = box.rows @ place.z
        own = np.column_stack([rows.slopes, -1.0 * rows.of_excess, -unit * ~rows.of_excess])
        G = np.vstack([np.pad(box.rows, ((0, 0), (0, 2))), own])
        lower = np.append(box.row_lower - offset, np.full(len(rows), -np.inf))
        upper = np.append(box.row_upper - offset, -rows.value - MET * rows.of_excess)
        norms = np.linalg.norm(G, axis=1)
        norms = np.where(norms > 0.0, norms, 1.0)
        scale = max(float(np.abs(cost).max()), float(np.abs(self.root).max(initial=0.0)) ** 2)
        if scale == 0.0:
            return None
        least = np.maximum(-place.z, -self.region.radius)
        most = np.minimum(1.0 - place.z, self.region.radius)
        scaled = Program(
            A=np.pad(self.root, ((0, 0), (0, 2))) / np.sqrt(scale),
            b=np.zeros(len(self.root)),
            G=np.vstack([np.eye(n + 2), G / norms[:, None]]),
            lower=np.concatenate([least, [0.0, self.least], lower / norms]),
            upper=np.concatenate([most, np.full(2, np.inf), upper / norms]),
            cost=cost / scale,
        )
        # no step, with v and t as they are, is feasible
        v, t = rows.levels(np.zeros(n), self.least)
        start = np.append(np.zeros(n), [v + MET if limited else 0.0, t / unit])
        found = solve_program(scaled, start)
        if found is None:
            return None
        mu = (scale * found[1][n + 2 :] / norms)[len(offset) :]
        multipliers = np.zeros(len(place.values))
        np.add.at(multipliers, rows.owner, rows.sign * mu)
        return np.clip(found[0][:n], least, most), multipliers
