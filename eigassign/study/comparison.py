"""How good an expansion is: full Taylor and partially linearised frequencies against exact ones.

stated error = 1.25 max |f / f_exact − 1|

at up to 64 corners of the bounds of the design, each at the poses farthest from the expansion
points, and at 128 points of a fixed sequence between the samples and all over the bounds.

Only the exact solves cost anything, so all points of one study are solved in one batch. A mode
study holds what the figures show: along the trajectory, over the box of y, over the box of q. A
validation compares at three places, all of which count against ``validation.max_error``, since
together they are what an assignment relies on:

trajectory
    every sample of the trajectory, or of each of several, at the initial design;
box of y at q0
    corners of the bounds, and designs all over them, at the expansion point;
between samples
    corners of the bounds, and points between the samples of the trajectory and all over the bounds
    (`unseen_points`): the worst there is stated with its margin.

Errors are in frequency (Hz), relative; a point where a polynomial gives λ < 0 counts as infinitely
wrong. Where the full set was too large for the order asked for, only the linearised error counts.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import zip_longest

import numpy as np
from numpy.typing import NDArray

from eigassign.errors import CaseError, EigassignError
from eigassign.facts import percent
from eigassign.modal.adaptive_order import MARGIN
from eigassign.modal.model import Model
from eigassign.study.planning import (
    MOST_CORNERS,
    SCATTERED,
    at_corners,
    corners,
    joint_map,
    scattered,
    travelled,
    unseen,
)
from eigassign.study.results import (
    Comparison,
    DesignMap,
    ModeStudy,
    ValidationRow,
    frozen,
)
from eigassign.study.scene import Expansions, Scene

Floats = NDArray[np.float64]


def unseen_points(scene: Scene) -> Floats:
    """x (n, n_x) where the scene's expansions are judged; `auto` has looked at other ones."""
    about = np.array([part.q0 for part in scene.expansions.fulls.parts])
    y0, first = scene.expansions.full.y0, 1 + SCATTERED
    return unseen(scene.file, scene.model, scene.trajectory, about, y0, first).x


def compare(
    model: Model,
    expansions: Expansions,
    x: Floats,
    exact_hz: Floats | None = None,
) -> tuple[Comparison, ...]:
    """One comparison for each expanded mode at the points x (n, n_x), arrays (n,) in Hz.

    ``exact_hz`` (n, at least the highest mode) are exact frequencies already known there.
    """
    q, y = np.split(x, [len(model.q_names)], axis=1)
    if exact_hz is None:
        exact_hz = model.frequencies(q, y, max(expansions.modes))
    taylor, linearised = expansions.taylor_hz(q, y), expansions.linearised_hz(q, y)
    return tuple(
        Comparison(frozen(exact_hz[:, mode - 1]), frozen(taylor[:, k]), frozen(linearised[:, k]))
        for k, mode in enumerate(expansions.modes)
    )


def study_expansions(scene: Scene) -> tuple[Comparison, ...]:
    """Both expansions of each mode at `unseen_points`; raises EigassignError where one has none."""
    return compare(scene.model, scene.expansions, unseen_points(scene))


def expansion_lines(scene: Scene, found: tuple[Comparison, ...]) -> tuple[str, ...]:
    """`study_expansions` in words, one line a mode."""
    where = "between the samples and all over the bounds"
    return tuple(
        f"mode {mode}: the full expansion is about {percent(MARGIN * one.worst_taylor)} off at "
        f"worst, the linearised one {percent(MARGIN * one.worst_linearised)}, measured by exact "
        f"solves at {len(one.exact_hz)} poses and designs {where}"
        for mode, one in zip(scene.modes, found, strict=True)
    )


# --- At given points, and on grids over one or two entries of x = (q, y)

# Points along the axes of a map of one and of two variables, both ends included; odd, so that the
# middle is one of them; fewer where a single exact solve takes milliseconds.
AXES = {1: 61, 2: 13}
COARSE = {1: 21, 2: 7}


@dataclass(frozen=True)
class Grid:
    """A tensor grid over one or two entries of x, the others as in ``x0``."""

    entries: tuple[int, ...]
    names: tuple[str, ...]
    units: tuple[str, ...]
    axes: tuple[Floats, ...]
    x0: Floats

    @property
    def shape(self) -> tuple[int, ...]:
        """Points along each axis."""
        return tuple(len(axis) for axis in self.axes)

    def points(self) -> Floats:
        """The points of the grid, (n, n_x), the last axis varying fastest."""
        mesh = np.meshgrid(*self.axes, indexing="ij")
        x = np.tile(self.x0, (mesh[0].size, 1))
        for entry, values in zip(self.entries, mesh, strict=True):
            x[:, entry] = values.ravel()
        return x


def grid_over(scene: Scene, entries: Sequence[int], lower: Floats, upper: Floats) -> Grid | None:
    """A grid over the first two of ``entries`` of x that have room between their bounds; or None.

    The others are as at the expansion point.
    """
    model, x0 = scene.model, scene.expansions.full.x0
    chosen = [k for k in range(len(entries)) if upper[k] > lower[k]][:2]
    if not chosen:
        return None
    names = (*model.q_names, *model.y_names)
    units = (*scene.file.q_units, *scene.file.design_units)
    count = (AXES if model.pencil.is_dense else COARSE)[len(chosen)]
    return Grid(
        tuple(entries[k] for k in chosen),
        tuple(names[entries[k]] for k in chosen),
        tuple(units[entries[k]] for k in chosen),
        tuple(frozen(np.linspace(lower[k], upper[k], count)) for k in chosen),
        x0,
    )


def map_over(
    model: Model, expansions: Expansions, grid: Grid | None
) -> tuple[tuple[DesignMap, ...], tuple[str, ...]]:
    """One map for each expanded mode; none without a grid.

    Nor where the mechanism has no pose or no modes at one of its points, with a note on that.
    """
    if grid is None:
        return (), ()
    try:
        compared = compare(model, expansions, grid.points())
    except EigassignError as error:
        return (), (f"no map over {' and '.join(grid.names)}: {error}",)
    found = []
    for values in compared:
        parts = (values.exact_hz, values.taylor_hz, values.linearised_hz)
        shaped = Comparison(*(part.reshape(grid.shape) for part in parts))
        found.append(DesignMap(grid.names, grid.units, grid.axes, shaped))
    return tuple(found), ()


# --- Mode studies: what the figures show


@dataclass(frozen=True)
class ModeStudies:
    """One study for each expanded mode, and why there are maps that they lack."""

    rows: tuple[ModeStudy, ...] = ()
    notes: tuple[str, ...] = ()


def study_modes(scene: Scene, initial_hz: Floats | None = None) -> ModeStudies:
    """The study of each expanded mode; ``initial_hz`` (n_t, modes) exact on the trajectory."""
    if scene.expanded is None:
        return ModeStudies()
    model, expansions = scene.model, scene.expanded
    everywhere, lines = _everywhere(scene)
    over_time: tuple[Comparison, ...] = ()
    if scene.trajectory is not None:
        x = model.x(scene.trajectory.q, scene.initial)
        over_time = compare(model, expansions, x, initial_hz)
    over_design, no_design = map_over(model, expansions, design_grid(scene))
    over_q, no_q = map_over(model, expansions, q_grid(scene))
    x0 = (expansions.full.q0, expansions.full.y0)
    parts = zip_longest(expansions.modes, over_time, over_design, over_q, everywhere)
    rows = tuple(ModeStudy(m, expansions.order, *x0, t, y, q, all_) for m, t, y, q, all_ in parts)
    return ModeStudies(rows, (*lines, *no_design, *no_q))


def _everywhere(scene: Scene) -> tuple[tuple[Comparison, ...], tuple[str, ...]]:
    """`study_expansions` in numbers and words; no numbers where a design has no pose or modes."""
    try:
        found = study_expansions(scene)
    except EigassignError as error:
        return (), (f"the expansion is not measured all over the bounds: {error}",)
    return found, expansion_lines(scene, found)


def design_grid(scene: Scene) -> Grid | None:
    """Over the bounds of the first two design parameters, at q0."""
    n_q = len(scene.q0)
    return grid_over(scene, range(n_q, n_q + len(scene.model.y_names)), *scene.bounds)


def q_grid(scene: Scene) -> Grid | None:
    """Over the range that the joint angles travel, at y0, for the first two that matter.

    A joint angle s_i = Σ_k S_ik q_k on which frequencies depend is moved by the last coordinate in
    its row of S, the others staying at q0; so an arm turning as a whole is not mapped.
    """
    S, q0 = joint_map(scene.model), scene.q0
    if scene.trajectory is None or not len(S):
        return None
    s, s0 = travelled(scene.file, scene.trajectory) @ S.T, S @ q0
    moved = [int(np.flatnonzero(row)[-1]) for row in S]
    ends = np.array([s.min(axis=0), s.max(axis=0)]) - s0
    ends = np.array([np.minimum(ends[0], 0.0), np.maximum(ends[1], 0.0)])  # q0 is always inside
    lower, upper = np.sort(ends / S[range(len(S)), moved], axis=0) + q0[moved]
    return grid_over(scene, moved, lower, upper)


# --- Validation: is the expansion good enough

TRAJECTORY, DESIGN_BOX = "trajectory", "box of y at q0"
BETWEEN = "between samples, all over the bounds"


@dataclass(frozen=True)
class Validation:
    """The rows of one case, and what else a reader should know."""

    rows: tuple[ValidationRow, ...]
    notes: tuple[str, ...]
    warnings: tuple[str, ...]
    seconds: float

    @property
    def passed(self) -> bool:
        """True if every row is within the case's tolerance."""
        return all(row.passed for row in self.rows)


def validate_expansions(scene: Scene) -> tuple[ValidationRow, ...]:
    """One row for each place and expanded mode.

    Raises CaseError where there is nothing to look at: no trajectory, no design.
    """
    rows = [
        _row(scene, k, where, comparison)
        for where, x in _places(scene)
        for k, comparison in enumerate(compare(scene.model, scene.expansions, x))
    ]
    if not rows:
        message = "nothing to validate: give a trajectory or a design"
        raise CaseError((scene.file.problem("validation", message),))
    return tuple(rows)


def _places(scene: Scene) -> Iterator[tuple[str, Floats]]:
    """The places of a validation, each with its points x (n, n_x)."""
    model, file = scene.model, scene.file
    if scene.trajectory is not None:
        for part in scene.trajectory.parts:
            where = f"{TRAJECTORY} {part.name!r}" if scene.trajectory.several else TRAJECTORY
            yield where, model.x(part.trajectory.q, scene.initial)
    lower, upper = scene.bounds
    if np.any(upper > lower):
        ends = corners(len(lower), MOST_CORNERS)
        outer = at_corners(file, None, scene.q0, scene.expansions.full.y0, ends)
        yield DESIGN_BOX, outer.joined(scattered(file, None, scene.q0, SCATTERED)).x
    if scene.trajectory is not None:
        yield BETWEEN, unseen_points(scene)


def _row(scene: Scene, k: int, where: str, values: Comparison) -> ValidationRow:
    expansions, limit = scene.expansions, scene.file.validation.max_error
    counts = expansions.full_order == expansions.order
    margin = MARGIN if where == BETWEEN else 1.0
    worst_taylor, worst_linearised = margin * values.worst_taylor, margin * values.worst_linearised
    counted = [values.worst_linearised, *([values.worst_taylor] if counts else [])]
    if where == BETWEEN and counts:  # so far out the linearised one is a guide of the one shot only
        counted = [values.worst_taylor]
    return ValidationRow(
        case=scene.file.path.stem,
        mode=expansions.modes[k],
        order=expansions.order,
        where=where,
        points=values.exact_hz.size,
        worst_taylor=worst_taylor,
        worst_linearised=worst_linearised,
        rms_taylor=_rms(values.taylor_error),
        rms_linearised=_rms(values.linearised_error),
        limit=limit,
        passed=max(counted) <= limit,
        lowest_hz=float(values.exact_hz.min()),
        mean_hz=float(values.exact_hz.mean()),
        highest_hz=float(values.exact_hz.max()),
    )


def reach_warnings(scene: Scene, along: Iterable[tuple[float, int]]) -> tuple[str, ...]:
    """What to do where a given order is farther off than the case accepts along the trajectory.

    ``along`` is the worst relative error of the full expansion there, and the mode that has it.
    """
    file = scene.file
    worst, mode = max(along, default=(0.0, 0))
    limit = file.validation.max_error
    if worst <= limit or file.expansion.order == "auto":
        return ()
    off = f"is {100 * worst:.3g} % off" if np.isfinite(worst) else "gives no frequency (λ < 0)"
    return (
        f"the expansion of order {scene.expansions.full_order} {off} in mode {mode} along the "
        f"trajectory, and {100 * limit:g} % are accepted (validation.max_error). Write expansion: "
        "{order: auto}, which also takes several points; exact frequencies do not depend on it",
    )


def _rms(errors: Floats) -> float:
    rms = float(np.sqrt(np.mean(np.square(errors))))
    return rms if rms == rms else float("inf")
