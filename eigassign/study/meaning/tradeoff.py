"""What less mass, or a lower price, costs: the least error that each limit of it leaves.

Where an answer adds mass, limits of the mass of the whole mechanism are stepped from the answer's
down to the initial design's; where it adds none, down to the lightest design. Where parameters have
prices, the price takes the place of the mass. Each problem starts at the optimum of the limit
before it, so that the curve is one of local optima, at the samples; no limit does worse than a
lower one, whose optimum it admits.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.exact.design_problem import MET, Appraisal, DesignProblem
from eigassign.assignment.exact.sequential import Optimum, minimise
from eigassign.errors import EigassignError
from eigassign.study.design.search.optimum import Found
from eigassign.study.design.search.variants import cost_of
from eigassign.study.meaning.sensitivity import as_error, error_kind
from eigassign.study.results import TradeOff, TradeOffPoint
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]
Amount = Callable[[Floats], tuple[float, Floats]]  # of a design: its value and slope (n_y,)
LIMITS = 8
STEPS = 30  # from one optimum to the next
SEEN = 1e-3  # of an error: a gain that its three digits do not show
SAME = 1e-6  # of the mass: a range too small to trade in


def trade_off(scene: Scene, found: Found) -> TradeOff | None:
    """Errors over limits of mass or price, the lowest limit first.

    None without wanted frequencies, with catalogues, or where the design does not change the mass.
    """
    variant, best = found.variant, found.best
    if not variant.requirements.goals or found.chosen or best.seen.violation > MET:
        return None
    price, problem = cost_of(scene), replace(variant.problem, cost=None)  # in the file's units
    priced = price is not None
    quantity: Amount = scene.model.total_mass if price is None else price
    high, first = quantity(best.y)[0], quantity(scene.initial)[0]
    low = min(first, high)
    if high - low <= SAME * abs(high):
        n = len(best.y)  # the limits of the design alone
        empty = Appraisal(np.zeros(0), np.zeros((0, n)), np.zeros(0), np.zeros((0, n)))
        alone = replace(problem, appraise=lambda y: empty)
        lightest = _limited(alone, quantity, 0.0, 1.0)
        low = quantity(minimise(lightest, best.y, STEPS).y)[0]
    if high - low <= SAME * abs(high):
        return None
    kind = error_kind(problem, variant.requirements)
    error = as_error(kind, problem(best.y, best.seen))
    points = [TradeOffPoint(high, error, best.y)]
    y = best.y
    for limit in np.linspace(low, high, LIMITS)[-2::-1]:
        optimum = _optimum(_limited(problem, quantity, float(limit), high - low), y)
        if optimum is None or optimum.seen.violation > MET:
            break
        y = optimum.y
        points.append(TradeOffPoint(quantity(y)[0], as_error(kind, optimum.objective), y))
    return TradeOff(
        "price" if priced else "mass",
        "" if priced else "kg",
        first,
        kind,
        tuple(kept(points)),
    )


def _limited(problem: DesignProblem, quantity: Amount, limit: float, unit: float) -> DesignProblem:
    """The problem with quantity ≤ limit beside its other limits."""

    def appraise(y: Floats) -> Appraisal:
        seen, (value, slope) = problem.appraise(y), quantity(y)
        return replace(
            seen,
            excess=np.append(seen.excess, (value - limit) / unit),
            excess_slopes=np.vstack([seen.excess_slopes, slope / unit]),
        )

    return replace(problem, appraise=appraise)


def _optimum(problem: DesignProblem, start: Floats) -> Optimum | None:
    try:
        return minimise(problem, start, STEPS)
    except EigassignError:
        return None


def kept(points: list[TradeOffPoint]) -> list[TradeOffPoint]:
    """Ascending, without those that cost more and are no better by `SEEN`; the answer, the last."""
    found: list[TradeOffPoint] = []
    ascending = sorted(points, key=lambda one: (one.amount, one.error))
    for point in ascending:
        need = 1.0 if point is ascending[-1] else 1.0 - SEEN
        if not found or point.error < need * found[-1].error:
            found.append(point)
    return found
