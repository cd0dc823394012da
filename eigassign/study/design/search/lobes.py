"""The fastest motion: residual vibration has lobes over the motion time, and basins between them.

Slopes lead to the end of one basin only. So designs all over the bounds are looked at for every
motion time, which costs little in their modes; the basins in which residuals are smallest are where
the search for the optimum starts. At what it has found all times are looked at again: where a
faster one keeps the limits too, it goes on from there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.exact.design_problem import ON
from eigassign.assignment.requirements.quantity import LimitedQuantity
from eigassign.case.schema.trajectory import DURATION_PATH
from eigassign.errors import EigassignError
from eigassign.study.design.search.optimum import Found, find_optimum
from eigassign.study.design.search.response import box_corners, spread_designs
from eigassign.study.design.search.variants import LOBES
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]
TIMES = 241  # over the bounds of the motion time
DESIGNS = 12  # for each other parameter, beside corners
NEAR = 4.0  # times its limit: a basin that is worse is passed over
SAME = 0.02  # of the times of basins: nearer ones are one, of which the best is looked at
STEPS = 30  # from each basin: what takes more is none that can keep the limits
AGAIN = 3  # times that a search goes on from a faster motion
FASTER = 1e-3  # relative


class Basin(NamedTuple):
    """A motion time at which the limits are missed least, and the design (n_y,) with it."""

    time_s: float
    missed: float  # the largest residual relative to its limit; 1 keeps it
    y: Floats


def fastest(
    scene: Scene, starts: Sequence[Floats], progress: Callable[[str], None], deadline: float
) -> Found:
    """The design with the least motion time that keeps all limits, from many basins."""
    designed = [own.parameter for own in scene.file.design.parameters.values()]
    column, (lower, upper) = designed.index(DURATION_PATH), scene.bounds
    times = np.geomspace(lower[column], upper[column], TIMES)
    width = np.delete(upper - lower, column)
    count = DESIGNS * int((width > 0.0).sum())
    designs = [scene.initial, *starts, *spread_designs(scene.bounds, max(count, 1), 0)]
    designs += [lower + side * (upper - lower) for side in box_corners(len(lower))]
    progress(f"fastest: {len(designs)} designs at {TIMES} motion times")
    basins = [basin for y in designs for basin in _basins(scene, y, column, times)]
    near: list[Floats] = [basin.y for basin in _best(basins)]
    keys = scene.file.assignment
    short = keys.model_copy(update={"steps": min(keys.steps, STEPS)})
    scene = replace(scene, file=replace(scene.file, assignment=short))
    found = find_optimum(scene, starts, progress, near, deadline=deadline)
    for _ in range(AGAIN):
        y, kept = found.best.y, found.best.seen.violation <= ON
        faster = [b for b in _basins(scene, y, column, times[times < y[column] * (1.0 - FASTER)])
                  if b.missed <= 1.0 or not kept]  # fmt: skip
        if not faster:
            break
        again = [basin.y for basin in sorted(faster)[:LOBES]]
        other = find_optimum(scene, [y], progress, again, deadline=deadline)
        if not (other.missed, other.best.objective) < (found.missed, found.best.objective):
            break
        found = other
    return found


def _basins(scene: Scene, y: Floats, column: int, times: Floats) -> Iterator[Basin]:
    """Yield the motion times at which a design misses the residual limits least, beside others."""
    if not len(times):
        return
    missed = np.zeros(len(times))
    for one in scene.limits:
        if isinstance(one, LimitedQuantity) and one.is_residual:
            try:
                w = one.quantity.along(y, times)
            except EigassignError:
                return
            missed = np.maximum(missed, w / one.allowed[1])
    before, after = np.append(np.inf, missed[:-1]), np.append(missed[1:], np.inf)
    least = (missed <= before) & (missed <= after)
    least |= (missed <= 1.0) & (before > 1.0)  # where one begins
    for k in np.flatnonzero(least & (missed <= NEAR)):
        design = y.copy()
        design[column] = times[k]
        yield Basin(float(times[k]), float(missed[k]), design)


def _best(basins: Sequence[Basin]) -> list[Basin]:
    """The fastest basins that keep the limits, one of each time, and faster ones that are near."""
    chosen: list[Basin] = []
    for basin in sorted(basins, key=lambda b: (max(b.missed, 1.0), b.time_s)):
        apart = all(abs(basin.time_s / one.time_s - 1.0) > SAME for one in chosen)
        kept = min((one.time_s for one in chosen if one.missed <= 1.0), default=np.inf)
        if apart and (basin.missed <= 1.0 or basin.time_s < kept):
            chosen.append(basin)
    return chosen[:LOBES]
