"""A case ready to be studied: its model, trajectory and expansions, and how good these are.

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

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from itertools import zip_longest
from typing import NamedTuple

import numpy as np

from eigassign.arrays import Floats
from eigassign.assignment.exact.requirements import Ellipsoid, Tolerances
from eigassign.assignment.program import LinearConstraint, frozen
from eigassign.assignment.requirements.quantity import DriveLimit, LimitedQuantity, StaticLimit
from eigassign.assignment.requirements.requirement import Requirement
from eigassign.assignment.requirements.sampling import design_limits, requirements_of
from eigassign.brief import Brief, counted
from eigassign.case.case_file import CaseFile
from eigassign.errors import AccuracyError, CaseError, EigassignError, MissingMassError
from eigassign.facts import percent
from eigassign.mechanism.trajectory.trajectory import Trajectories
from eigassign.modal.adaptive_order import MARGIN
from eigassign.modal.arguments import solve_blocks
from eigassign.modal.expansion import Expansion, NearestExpansion
from eigassign.modal.model import Model
from eigassign.study.planning import (
    MOST_CORNERS,
    SCATTERED,
    Plan,
    as_listed,
    at_corners,
    corners,
    scattered,
    unseen,
)
from eigassign.study.results import Comparison, ModeStudy, ValidationRow

OTHERS = 3  # modes shown above the highest assigned one


@dataclass(frozen=True, repr=False)
class Expansions(Brief):
    """The full and the partially linearised expansions of the same modes about the same points.

    ``order`` is that of the linearised ones, as asked for; ``full_order`` may be lower, where the
    full set would be too large. (The degree of a set may be lower still: where no coordinate
    matters, the linearised set is linear whatever its order.)
    """

    fulls: NearestExpansion
    linears: NearestExpansion
    order: int
    full_order: int

    @property
    def modes(self) -> tuple[int, ...]:
        """The modes that both hold, in the order of their columns."""
        return self.fulls.modes

    @property
    def full(self) -> Expansion:
        """The full expansion about the first point."""
        return self.fulls.parts[0]

    @property
    def linear(self) -> Expansion:
        """The partially linearised one."""
        return self.linears.parts[0]

    def taylor_hz(self, q: Floats, y: Floats) -> Floats:
        """Full expansion at samples, (n, n_modes) in Hz; each by the nearest point."""
        return self.fulls.frequencies(q, y)

    def linearised_hz(self, q: Floats, y: Floats) -> Floats:
        """Partially linearised expansion at samples, (n, n_modes) in Hz."""
        return self.linears.frequencies(q, y)

    def linear_in_design(self, path: Trajectories) -> tuple[Floats, Floats]:
        """l_0 (n, n_modes) and l (n, n_modes, n_y) of eq. (9) along a path; all points share y0.

        Where q follows the design, l is the total derivative ∂λ/∂y + ∂λ/∂q dq/dy at (q(y0), y0).
        Raises TrajectoryError where the design y0 cannot follow the path.
        """
        q, of_design = path.at(self.full.y0)
        l0, slopes = self.linears.slopes(q, self.full.y0)
        return l0, path.in_design(slopes, of_design)

    def column(self, mode: int) -> int:
        """Column of ``mode`` in what the expansions evaluate to."""
        return self.modes.index(mode)


@dataclass(frozen=True)
class Scene:
    """The model, trajectory and expansions that all studies of one case start from. SI units."""

    file: CaseFile
    model: Model
    initial: Floats  # y as the file writes it, (n_y,)
    trajectory: Trajectories | None
    plan: Plan
    expanded: Expansions | None  # None where an answer does without
    notes: tuple[str, ...]  # what was chosen and why

    @property
    def expansions(self) -> Expansions:
        """The expansions; raises AccuracyError where there are none."""
        if self.expanded is None:
            raise AccuracyError("no expansion meets the accuracy that is asked for")
        return self.expanded

    @property
    def modes(self) -> tuple[int, ...]:
        """The modes that are expanded, or would be: those with a target, or of the file."""
        return self.plan.modes

    @property
    def path(self) -> Trajectories:
        """The trajectory, or several; raises CaseError where the case has none."""
        if self.trajectory is None:
            problem = self.file.problem("trajectory", "is missing, and needed here")
            raise CaseError((problem,))
        return self.trajectory

    @property
    def q0(self) -> Floats:
        """The expansion point in q, (n_q,)."""
        return self.plan.q0

    @property
    def warnings(self) -> tuple[str, ...]:
        """The warnings of what is implausible in the case file, with its place."""
        return tuple(str(problem) for problem in self.file.warnings)

    @property
    def bounds(self) -> tuple[Floats, Floats]:
        """Lower and upper bounds of y, each (n_y,)."""
        parameters = self.file.design.parameters.values()
        return np.array([p.min for p in parameters]), np.array([p.max for p in parameters])

    @cached_property
    def tolerances(self) -> Tolerances:
        """How far the parameters may deviate from what they are made to be, or are known to be."""
        columns, y = self.file.design.parameters, self.initial
        each = [column.tolerance for column in columns.values()]
        share, amount = (
            np.array([one.amount if one and one.relative == of else 0.0 for one in each])
            for of in (True, False)
        )
        natural = np.array([0 in (q.at_least, q.above) for q in self.file.design_quantities])
        middle, numbers = np.zeros(len(columns)), {name: k for k, name in enumerate(columns)}
        if (known := self.file.uncertain) is None or numbers.keys().isdisjoint(known.entries):
            return Tolerances(share, amount, natural)
        for name, one in known.entries.items():
            k = numbers[name]
            if one.min is not None and one.max is not None:
                amount[k] = 0.5 * (one.max - one.min)
                middle[k] = (0.5 * (one.max + one.min) - y[k]) / amount[k]
        at = [numbers[name] for name in known.spread]
        if not at:
            return Tolerances(share, amount, natural, middle)
        both = known.explained({name: float(y[numbers[name]]) for name in known.spread})
        centres, covariances = map(np.array, zip(*both, strict=True))
        amount[at] = np.sqrt(np.diag(covariances[0]))
        more = natural[at], self.file.assignment.probability
        return Tolerances(
            share, amount, natural, middle, Ellipsoid.of(at, centres, covariances, *more)
        )

    @property
    def deviating(self) -> str:
        """What deviations lie within, in words."""
        own, known = self.file.design.parameters.values(), self.file.uncertain
        each = ["the tolerances"] if any(column.tolerance for column in own) else []
        if known is not None and len(known.spread) < len(known.entries):
            each.append("the ranges of what is uncertain")
        if (ball := self.tolerances.ellipsoid) is not None:
            share = f"{100.0 * self.file.assignment.probability:g} %"
            each.append(f"the {share} ellipsoid of {counted(len(ball.columns), 'uncertain value')}")
        return " and ".join(each)

    @cached_property
    def wanted(self) -> tuple[Requirement, ...]:
        """What the targets ask of frequencies, at all samples of the trajectories."""
        return requirements_of(self.file, self.path)

    @cached_property
    def limits(self) -> tuple[LimitedQuantity, ...]:
        """The limits of quantities of the design, at all samples of the trajectories."""
        return design_limits(self.file, self.model, self.trajectory)

    @property
    def statics(self) -> tuple[StaticLimit, ...]:
        """Those of static targets."""
        return tuple(one for one in self.limits if isinstance(one, StaticLimit))

    @property
    def residuals(self) -> list[LimitedQuantity]:
        """The limits of vibration after a move."""
        return [one for one in self.limits if one.is_residual]

    @property
    def followed_limits(self) -> tuple[LimitedQuantity, ...]:
        """The limits that are looked at between the samples: static targets and drives."""
        return tuple(one for one in self.limits if isinstance(one, StaticLimit | DriveLimit))

    @property
    def constraints(self) -> tuple[LinearConstraint, ...]:
        """The limits that are linear in the design."""
        return tuple(one.constraint for one in self.limits if one.constraint is not None)

    def shown_modes(self, asked: int = 1) -> int:
        """The number of modes shown along the trajectory: up to three above those ``asked`` for."""
        available = self.model.n_dof - self.model.n_rigid
        highest = max(*self.modes, asked)
        last = min(highest + OTHERS, available)
        try:
            self.model.frequencies(self.q0, self.initial, last)
        except MissingMassError as error:
            last = max(highest, error.most)
        return last

    def exact(
        self,
        y: Floats,
        count: int | None = None,
        progress: Callable[[int, int], None] = lambda _done, _of: None,
    ) -> Floats:
        """Exact frequencies (n_t, count or `shown_modes`) in Hz on every sample, at design y.

        They are solved in blocks: between two of them ``progress`` is called with the number of
        samples done and of all, and signals are handled.
        """
        q, count = self.path.at(y)[0], self.shown_modes() if count is None else count
        parts, done = [], 0
        for some in solve_blocks(q, self.model.n_dof):
            parts.append(self.model.frequencies(some, y, count))
            done += len(some)
            if done < len(q):
                progress(done, len(q))
        hz = np.concatenate(parts)
        hz.setflags(write=False)
        return hz


def unseen_points(scene: Scene) -> Floats:
    """x (n, n_x) where the scene's expansions are judged; `auto` has looked at other ones."""
    about = np.array([part.q0 for part in scene.expansions.fulls.parts])
    y0, first = scene.expansions.full.y0, 1 + SCATTERED
    x = unseen(scene.file, scene.model, scene.trajectory, about, y0, first)
    return as_listed(scene.file, x)


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


def expansion_lines(scene: Scene, found: tuple[Comparison, ...]) -> tuple[str, ...]:
    """A comparison of both expansions at `unseen_points` in words, one line a mode."""
    where = "between the samples and all over the bounds"
    return tuple(
        f"mode {mode}: the full expansion is about {percent(MARGIN * one.worst['taylor'])} off at "
        f"worst, the linearised one {percent(MARGIN * one.worst['linearised'])}, measured by exact "
        f"solves at {len(one.exact_hz)} poses and designs {where}"
        for mode, one in zip(scene.modes, found, strict=True)
    )


# --- Mode studies: what the figures show


class ModeStudies(NamedTuple):
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
        everywhere = compare(model, expansions, unseen_points(scene))
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


class Validation(NamedTuple):
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
        inner = scattered(file, None, scene.q0, SCATTERED)
        yield DESIGN_BOX, as_listed(file, np.vstack([outer, inner]))
    if scene.trajectory is not None:
        yield BETWEEN, unseen_points(scene)


def _row(scene: Scene, k: int, where: str, values: Comparison) -> ValidationRow:
    expansions, limit = scene.expansions, scene.file.validation.max_error
    counts = expansions.full_order == expansions.order
    margin = MARGIN if where == BETWEEN else 1.0
    worst, errors = values.worst, values.errors
    counted = [worst["linearised"], *([worst["taylor"]] if counts else [])]
    if where == BETWEEN and counts:  # so far out the linearised one is a guide of the one shot only
        counted = [worst["taylor"]]
    return ValidationRow(
        case=scene.file.path.stem,
        mode=expansions.modes[k],
        order=expansions.order,
        where=where,
        points=values.exact_hz.size,
        worst_taylor=margin * worst["taylor"],
        worst_linearised=margin * worst["linearised"],
        rms_taylor=_rms(errors["taylor"]),
        rms_linearised=_rms(errors["linearised"]),
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
