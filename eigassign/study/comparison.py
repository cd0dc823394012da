"""How good an expansion is: full Taylor and partially linearised frequencies against exact ones.

stated error = 1.25 max |f / f_exact − 1|

at up to 64 corners of the bounds of the design, each at the poses farthest from the expansion
points, and at 128 points of a fixed sequence between the samples and all over the bounds.

A mode study holds what the figures show, along the trajectory. A validation compares at three
places, all of which count against ``validation.max_error``, since together they are what an
assignment relies on:

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

from collections.abc import Iterable, Iterator
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
    scattered,
    unseen,
)
from eigassign.study.results import (
    Comparison,
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


# --- Mode studies: what the figures show


@dataclass(frozen=True)
class ModeStudies:
    """One study for each expanded mode, and what they say in words."""

    rows: tuple[ModeStudy, ...] = ()
    notes: tuple[str, ...] = ()


def study_modes(scene: Scene, initial_hz: Floats | None = None) -> ModeStudies:
    """The study of each expanded mode; ``initial_hz`` (n_t, modes) exact on the trajectory."""
    if scene.expanded is None:
        return ModeStudies()
    model, expansions = scene.model, scene.expanded
    everywhere, lines = tuple[Comparison, ...](), tuple[str, ...]()
    try:
        everywhere = study_expansions(scene)
        lines = expansion_lines(scene, everywhere)
    except EigassignError as error:  # a design has no pose or modes
        lines = (f"the expansion is not measured all over the bounds: {error}",)
    over_time: tuple[Comparison, ...] = ()
    if scene.trajectory is not None:
        x = model.x(scene.trajectory.q, scene.initial)
        over_time = compare(model, expansions, x, initial_hz)
    about = expansions.order, expansions.full.q0, expansions.full.y0
    parts = zip_longest(expansions.modes, over_time, everywhere)
    return ModeStudies(tuple(ModeStudy(mode, *about, *each) for mode, *each in parts), lines)


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
