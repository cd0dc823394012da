"""First-order optimality of the exact problem, recomputed from a design's own slopes.

Where modes meet it is that of Clarke: some share of the branches at each kink must balance.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from eigassign.assignment.checks import Floats
from eigassign.assignment.exact.design_problem import (
    ON,
    TINY,
    Appraisal,
    DesignPoint,
    DesignProblem,
    Objective,
    UnitBox,
)


@dataclass(frozen=True)
class BindingLimit:
    """A limit that the optimum lies on: what F falls by when it is relaxed by one unit, ≥ 0.

    ``kind`` is bound, constraint or excess; ``index`` counts among them, ``upper`` says which side.
    The unit is the SI one of the parameter or constraint, or 1 (100 % of its limit) of an excess.
    """

    kind: str
    index: int
    upper: bool
    multiplier: float


def stationarity(problem: DesignProblem, y: Floats, seen: Appraisal) -> float:
    """How far y is from first-order optimality: 0 at a local optimum, 1 where nothing is balanced.

    The part of the slope of F (or of the violation, where inequalities are missed) that no limit
    on which y lies can balance, in units of the bounds, relative to the largest slope that the
    residuals could give: for least squares the largest cosine between Jᵀ's rows and r.
    """
    return _balance(problem, y, seen)[0]


def active_limits(problem: DesignProblem, y: Floats, seen: Appraisal) -> Iterator[BindingLimit]:
    """The limits that y lies on, with what F falls by per unit relaxed."""
    yield from _balance(problem, y, seen)[1]


def _balance(
    problem: DesignProblem, y: Floats, seen: Appraisal
) -> tuple[float, tuple[BindingLimit, ...]]:
    box = UnitBox.of(problem)
    if box.n == 0:
        return 0.0, ()
    place = DesignPoint.of(problem, box, box.z(y), seen)
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
        BindingLimit(kind, index, upper, float(m / unit))
        for (kind, index, upper), unit, m in zip(owners, units, mu, strict=False)
    )
    rest = float(np.abs(left).max()) / size
    if violated:
        rest = max(rest, _unbalanced_violation(box, place))
    return rest, found


def _columns(*parts: tuple[Floats, float | Floats]) -> Floats:
    """Slopes (k, n), each with more rows below, as the columns of one matrix."""
    return np.hstack([np.hstack([a, np.tile(np.atleast_1d(b), (len(a), 1))]).T for a, b in parts])


def _branches(place: DesignPoint) -> tuple[NDArray[np.intp], Floats]:
    """Where a row has a kink that the design may lie in: its rows, and slopes of other branches.

    Behind other kinks the row is better than its own branch says: no optimum lies there.
    """
    if place.pairs is None:
        return np.zeros(0, dtype=np.intp), np.zeros((0, place.J.shape[1]))
    worse = np.append(np.sign(place.seen.residual), np.ones(len(place.C)))[place.pairs.row]
    worse_larger = np.where(place.pairs.larger, worse > 0.0, worse < 0.0)
    return place.pairs.chosen(worse_larger).branches(np.vstack([place.J, place.C]))


def _normals(
    box: UnitBox, place: DesignPoint, excess: Floats
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


def _unbalanced_violation(box: UnitBox, place: DesignPoint) -> float:
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
