"""What no design within the bounds is below: boxes of designs are bounded, and halved.

Where every parameter raises or lowers each frequency (`monotone`), those at two corners of a box
bound each mode at every sample, and with it the limits that no design of the box keeps, and the F
that none is below (`Requirements.least`). The box of the least bound is halved where it is widest,
as slopes at the optimum weigh its sides. Where this misses limits, the least violation takes the
place of F.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Iterator
from contextlib import suppress

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.exact.design_problem import MET, DesignProblem
from eigassign.assignment.exact.sequential import NOTHING, End
from eigassign.errors import EigassignError
from eigassign.study.design.search.optimum import Found
from eigassign.study.design.search.response import ENDLESS, Glances
from eigassign.study.design.search.variants import PosedProblem
from eigassign.study.monotone import corners, effects
from eigassign.study.results import OptimalityRow
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]
SHARE = 0.25  # of the search's exact solves: a count, so that the same case has the same words
MOST_SOLVED = 7000  # designs solved along the whole trajectory, where all studies are asked for
TOGETHER = 16  # boxes halved together: exact solves of many poses are quicker than one by one
GAP, POINTS = 0.01, 5e-4  # of F, and of the rms or the worst error: a smaller gap is none
SAID = 0.5  # of F: a wider gap says little
WIDE = 4.0  # times its lower end: a side so long is halved by ratio


def proof(scene: Scene, found: Found, thorough: bool) -> OptimalityRow | None:
    """What is proved of the optimum; None where nothing can be, or the search was ended.

    It takes a quarter of the exact solves of the search, or if ``thorough`` up to `MOST_SOLVED` designs.
    """
    best, problem, file = found.best, found.variant.problem, scene.file
    missed, lower, upper = best.seen.violation > MET, problem.lower, problem.upper
    if file.design.catalogues or best.end in (End.SECONDS, End.INTERRUPTED):
        return None
    value = best.seen.violation if missed else best.objective
    least = 0.0 if missed else problem.least_value(lower, upper, np.zeros(0))
    enough = MET if missed else _enough(problem, value)
    if least < enough:  # else all that has a price is cheapest, or there is no error
        task = found.task
        given = task.scenarios or task.bands or task.followers or scene.path.follows_design
        if given or not np.all((effects(file) != 0.0) | (lower == upper)):
            return None
        most = MOST_SOLVED if thorough else int(SHARE * found.exact_solves / len(scene.path.q))
        least = min(value, _bound(scene, found, least, enough, most))
    gap = (value - least) / (abs(value) + NOTHING)
    kind, words = "proved" if least >= enough else "bounded", _words(scene, found, least, gap)
    if missed:
        gap, words = 1.0, "no design within the bounds meets all limits"
    if (missed or gap > SAID) and kind == "bounded":
        return (
            None if thorough else OptimalityRow("local", None, None, "`--study all` may prove it")
        )
    return OptimalityRow(kind, best.stationarity, None if missed else gap, f"proved: {words}")


def _enough(problem: DesignProblem, value: float) -> float:
    """The F from which on a bound proves the optimum."""
    gap = GAP * abs(value)
    if problem.is_error:
        root = max(np.sqrt(value) - POINTS, 0.0) ** 2 if problem.is_squared else value - POINTS
        gap = max(gap, value - max(root, NOTHING))
    return value - gap


def _bound(scene: Scene, found: Found, least: float, enough: float, most: int) -> float:
    """What no design is below; it solves about ``most`` of them."""
    variant, seen, number = found.variant, found.best.seen, itertools.count(1)
    glances = Glances(scene.model, scene.path, variant.requirements.modes)
    width = variant.problem.upper - variant.problem.lower
    weight = np.linalg.norm(np.vstack([seen.slopes, seen.excess_slopes]), axis=0)
    weight += 1e-9 / np.where(width > 0.0, width, 1.0)  # of those without an effect there
    open_ = [(least, 0, variant.problem.lower, variant.problem.upper)]
    made = 0
    while open_ and open_[0][0] < enough and 2 * made < most:  # one more solve for each half
        some = [heapq.heappop(open_) for _ in range(min(TOGETHER, len(open_)))]
        known, _, low, high = map(np.array, zip(*some, strict=True))
        wide = (low > 0.0) & (high > WIDE * low)
        middle = np.where(wide, np.sqrt(np.where(wide, low * high, 1.0)), 0.5 * (low + high))
        side = np.arange(len(width)) == (weight * (high - low)).argmax(axis=1)[:, None]
        lower = np.concatenate([low, np.where(side, middle, low)])
        upper = np.concatenate([np.where(side, middle, high), high])
        values = _of_boxes(variant, glances, lower, upper, seen.violation > MET)
        for before, own, *box in zip(np.tile(known, 2), values, lower, upper, strict=True):
            if own < np.inf:
                heapq.heappush(open_, (max(before, own), next(number), *box))
        made += len(some)
    return float(open_[0][0]) if open_ else np.inf


def _of_boxes(
    variant: PosedProblem, glances: Glances, lower: Floats, upper: Floats, missed: bool
) -> Iterator[float]:
    """Yield what no design of each box is below, F or where ``missed`` the violation.

    Infinite where none meets the limits.
    """
    problem, n = variant.problem, len(glances.order)
    softest, stiffest = corners(variant.task.scene.file, lower, lower, upper)
    glances.look(np.concatenate([softest, stiffest]), n)
    for low, high, soft, stiff in zip(lower, upper, softest, stiffest, strict=True):
        lowest, highest = glances.solved(soft, n, 0.0), glances.solved(stiff, n, ENDLESS)
        violation, residual = 0.0, np.zeros(0)
        if lowest is not None and highest is not None:
            with suppress(EigassignError):  # a property that no mechanism has
                violation, residual = variant.requirements.least(low, high, lowest, highest)
        for row in problem.constraints:
            ends = row.coefficients * low, row.coefficients * high
            if np.maximum(*ends).sum() < row.lower or np.minimum(*ends).sum() > row.upper:
                violation = np.inf
        value = problem.least_value(low, high, residual)
        yield violation if missed else value if violation <= MET else np.inf


def _words(scene: Scene, found: Found, least: float, gap: float) -> str:
    """``no design within the bounds is below 1.297 %``: rounded so that it stays true."""
    problem, goals, keys = found.variant.problem, found.variant.requirements.goals, scene.file
    aim, better = keys.assignment.named_objective, "better"
    if gap > 1e-9:  # of F: round-off
        better += f" by more than {-_rounded(-100 * gap)} % of the objective"
        if aim == "lightest":
            better = f"below {_rounded(least)} kg"
        elif aim == "highest" and problem.cost is None:
            better = f"above {-_rounded(least)} Hz"
        elif problem.is_error and goals and all(one.weight == 1.0 for one in goals):
            root = np.sqrt(least) if problem.is_squared else least
            better = f"below {_rounded(100 * root)} %"
    return f"no design within the bounds is {better}"


def _rounded(value: float) -> float:
    """A number to four digits, not above it."""
    size = 10.0 ** (3 - int(np.floor(np.log10(abs(value) or 1.0))))
    return float(f"{np.floor(value * size) / size:.4g}")
