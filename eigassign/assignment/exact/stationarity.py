"""First-order optimality of the exact problem, recomputed from a design's own slopes.

Where modes meet it is that of Clarke: some share of the branches at each kink must balance.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import nnls

from eigassign.assignment.exact.design_point import DesignPoint, Indices
from eigassign.assignment.exact.design_problem import ON, TINY, Appraisal, DesignProblem, UnitBox
from eigassign.assignment.targets import Floats

_Held = tuple[Floats, str, int, bool]  # a limit that the design lies on: its outward normal, which


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


def first_order(
    problem: DesignProblem, y: Floats, seen: Appraisal
) -> tuple[float, tuple[BindingLimit, ...]]:
    """The stationarity, and the limits that y lies on with what F falls by per unit relaxed.

    It says how far y is from first-order optimality: 0 at a local optimum, 1 where nothing is
    balanced. The part of the slope of F (or of the violation, where inequalities are missed) that
    no limit on which y lies can balance, in units of the bounds, relative to the largest slope that
    the residuals could give: for least squares the largest cosine between Jᵀ's rows and r.
    """
    box = UnitBox.of(problem)
    if box.n == 0:
        return 0.0, ()
    place = DesignPoint.of(problem, box, box.z(y), seen)
    J, r, m = place.slopes[: place.m], seen.residual, place.m
    held = list(_box_normals(box, place.z))
    violated = _unbalanced_violation(held, place) if seen.violation > ON else 0.0
    rows, slopes = _with_branches(place, m + np.flatnonzero(seen.excess >= -ON))
    held += [(one, "excess", int(k) - m, True) for k, one in zip(rows, slopes, strict=True)]
    slope, size = place.cost_slopes, float(np.abs(place.cost_slopes).max())
    if m and not place.squared:
        badness = place.worse[:m] * r
        top = badness.max()
        # rows of one sign are relative, or frequencies in Hz
        near = ON * max(abs(top), 1.0 if place.one_sided else TINY)
        rows, slopes = _with_branches(place, np.flatnonzero(badness >= top - near))
        steepest, kink = place.worse[rows][:, None] * slopes, np.zeros_like(rows)
        size += float(np.abs(steepest).max(initial=0.0))
        unit = size if place.one_sided else 1.0
    else:
        slope = slope + 2.0 * J.T @ r
        largest = float(np.linalg.norm(r)) if np.linalg.norm(r) > TINY else 0.0
        size += 2.0 * float(np.linalg.norm(J, axis=0).max(initial=0.0)) * largest
        rows, slopes = _with_branches(place, np.unique(place.branches(np.arange(m))[0]))
        steepest, unit = 2.0 * r[rows, None] * (slopes - J[rows]), size
        kink = np.unique(rows, return_inverse=True)[1]
    if size == 0.0:
        return violated, ()
    left, mu = _left_over(slope, held, steepest, kink, unit)
    found = tuple(
        BindingLimit(kind, j, upper, float(share / (box.all_width[j] if kind == "bound" else 1.0)))
        for (_, kind, j, upper), share in zip(held, mu, strict=False)
    )
    return max(left / size, violated), found


def _box_normals(box: UnitBox, z: Floats) -> Iterator[_Held]:
    """The bounds and linear constraints that z lies on."""
    sides = ((False, -1.0), (True, 1.0))
    for i, j in enumerate(box.free):
        for upper, sign in sides:
            if (z[i] >= 1.0 - ON) if upper else (z[i] <= ON):
                yield sign * np.eye(box.n)[i], "bound", j, upper
    value, norms = box.rows @ z, np.abs(box.rows).sum(axis=1)
    for k, row in enumerate(box.rows):
        for upper, sign in sides:
            limit = box.row_upper[k] if upper else box.row_lower[k]
            if np.isfinite(limit) and abs(value[k] - limit) <= ON * max(norms[k], 1e-300):
                yield sign * row, "constraint", k, upper


def _unbalanced_violation(held: Sequence[_Held], place: DesignPoint) -> float:
    """The same of the largest excess: 0 where no direction within the limits lowers it."""
    excess = place.seen.excess
    _, steepest = _with_branches(place, place.m + np.flatnonzero(excess >= excess.max() - ON))
    together = np.zeros(len(steepest), dtype=np.intp)
    left, _ = _left_over(np.zeros(len(place.z)), held, steepest, together, 1.0)
    return left / max(float(np.abs(steepest).max()), 1.0)


def _with_branches(place: DesignPoint, on: Indices) -> tuple[Indices, Floats]:
    """The rows ``on`` and their slopes, then those of their other branches at kinks."""
    rows, slopes = place.branches(on)
    return np.append(on, rows), np.vstack([place.slopes[on], slopes])


def _left_over(
    slope: Floats, held: Sequence[_Held], branches: Floats, kink: Indices, unit: float
) -> tuple[float, Floats]:
    """The largest entry that is left of a slope, and the multipliers ≥ 0 that balance the rest.

    Those of the limits ``held``, then the shares of ``branches``, which are 1 together at each
    ``kink`` (in units of ``unit``).
    """
    kinks = int(kink.max(initial=-1)) + 1
    normals = np.array([one[0] for one in held]).reshape(-1, len(slope))
    system = np.block(
        [
            [normals, np.zeros((len(normals), kinks))],
            [branches, unit * np.eye(kinks)[kink]],
        ]
    ).T
    slope = np.append(slope, -np.full(kinks, unit))
    if not system.size:
        return float(np.abs(slope).max()), np.zeros(0)
    mu = nnls(system, -slope, maxiter=50 * max(system.shape))[0]
    return float(np.abs(slope + system @ mu).max()), mu
