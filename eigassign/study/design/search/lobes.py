"""The fastest motion: residual vibration has lobes over the motion time, and basins between them.

Slopes lead to the end of one basin only. So designs all over the bounds are looked at for every
motion time, which costs little in their modes. In the basins of the smallest residuals the modes'
amplitudes are made small by least squares: they are smooth where residuals have kinks, so that
this follows valleys in which two modes come to rest at once. From there the search for the optimum
starts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from eigassign.assignment.requirements.residual import STEP
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
LOOKS, SOLVES = 2 * LOBES, 10  # basins whose amplitudes are made small, and steps of each
STEPS = 30  # from each basin: what takes more is none that can keep the limits


class Basin(NamedTuple):
    """A motion time at which the limits are missed least, and the design (n_y,) with it."""

    time_s: float
    missed: float  # the largest residual relative to its limit; 1 keeps it
    y: Floats


def duration_column(scene: Scene) -> int:
    """Which entry of y is the motion time."""
    return [own.parameter for own in scene.file.design.parameters.values()].index(DURATION_PATH)


def basins(scene: Scene, starts: Sequence[Floats], progress: Callable[[str], None]) -> list[Floats]:
    """The designs with motion times (n_y,) to search the fastest motion from, the best first."""
    column, (lower, upper) = duration_column(scene), scene.bounds
    times = np.geomspace(lower[column], upper[column], TIMES)
    width = np.delete(upper - lower, column)
    count = DESIGNS * int((width > 0.0).sum())
    designs = [scene.initial, *starts, *spread_designs(scene.bounds, max(count, 1), 0)]
    designs += [lower + side * (upper - lower) for side in box_corners(len(lower))]
    progress(f"fastest: {len(designs)} designs at {TIMES} motion times")
    found = [b for y in designs for b in _basins(scene, y, column, times)]
    near = [b if b.missed <= 1.0 else _quietest(scene, b, column) for b in _best(found, LOOKS)]
    return [basin.y for basin in _best(near, LOBES)]


def fastest(
    scene: Scene, starts: Sequence[Floats], progress: Callable[[str], None], deadline: float
) -> Found:
    """The design with the least motion time that keeps all limits, from many basins."""
    keys = scene.file.assignment
    short = keys.model_copy(update={"steps": min(keys.steps, STEPS)})
    scene = replace(scene, file=replace(scene.file, assignment=short))
    return find_optimum(scene, starts, progress, basins(scene, starts, progress), deadline=deadline)


def _quietest(scene: Scene, basin: Basin, column: int) -> Basin:
    """The design nearby whose modes vibrate least after about the same motion time."""
    lower, upper = (end.copy() for end in scene.bounds)
    lower[column] = max(lower[column], basin.time_s / (1.0 + SAME))
    upper[column] = min(upper[column], basin.time_s * (1.0 + SAME))
    free, limits = np.flatnonzero(upper > lower), scene.residuals
    width = (upper - lower)[free]

    def design(share: Floats) -> Floats:
        y = np.clip(basin.y, lower, upper)
        y[free] = lower[free] + share * width
        return y

    def amplitudes(share: Floats) -> Floats:
        y = design(share)
        return np.concatenate([one.quantity.amplitudes(y) / one.allowed[1] for one in limits])

    start = np.clip((basin.y[free] - lower[free]) / width, STEP, 1.0 - STEP)
    try:
        steps = np.full(len(free), STEP)
        found = least_squares(amplitudes, start, bounds=(0, 1), diff_step=steps, max_nfev=SOLVES)
        y = design(found.x)
        missed = max(one.quantity(y)[0] / one.allowed[1] for one in limits)
    except EigassignError:
        return basin
    return Basin(float(y[column]), missed, y) if missed < basin.missed else basin


def _basins(scene: Scene, y: Floats, column: int, times: Floats) -> Iterator[Basin]:
    """Yield the motion times at which a design misses the residual limits least, beside others."""
    missed = np.zeros(len(times))
    for one in scene.residuals:
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


def _best(basins: Sequence[Basin], most: int) -> list[Basin]:
    """The fastest basin that keeps the limits, faster ones that miss them least, slower ones.

    One of each time; half of them at least are slower, where other limits may forbid the faster.
    """
    apart: list[Basin] = []
    for basin in sorted(basins, key=lambda b: (max(b.missed, 1.0), b.time_s)):
        if all(abs(basin.time_s / one.time_s - 1.0) > SAME for one in apart):
            apart.append(basin)
    kept = [basin for basin in apart if basin.missed <= 1.0]
    first = kept[0].time_s if kept else np.inf
    faster, half = [b for b in apart[len(kept) :] if b.time_s < first], most // 2
    return [*kept[:1], *faster[:half], *kept[1:], *faster[half:]][:most]
