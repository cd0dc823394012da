"""The problems that the targets of a case make, one for each choice of what its bands leave open.

What the case file asks for becomes requirements (`assignment.exact.requirements`). A band to keep
out of leaves a choice: on a connected trajectory it is clear if and only if the number k of
modes below it is the same everywhere, so each k that the bounds may allow is one more problem.
"""

from __future__ import annotations

import itertools
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.exact.design_problem import (
    Appraisal,
    Cost,
    DesignProblem,
    Objective,
    best_first,
)
from eigassign.assignment.exact.requirements import Appraise, Requirements, with_scenarios
from eigassign.assignment.program import constraints_agree
from eigassign.assignment.requirements.kinds import ForbiddenBand, Margin, ModeGap
from eigassign.assignment.requirements.requirement import Frequencies, Requirement, Solved
from eigassign.assignment.requirements.sampling import requirements_of, time_weights
from eigassign.errors import CaseError, EigassignError, MissingMassError
from eigassign.study.design.clearance import mode_above
from eigassign.study.design.followed import Follower, followers, with_followed
from eigassign.study.design.lists import catalogues, price_of_one
from eigassign.study.design.search.response import (
    DesignResponse,
    Glances,
    Outlook,
    ReducedModels,
    corners,
    outlook_of,
    response_of,
)
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]
SPREAD = 8  # designs all over the bounds, beside corners and middle, that bands are looked at in
Counts = tuple[int | None, ...]  # of modes below each band, None of one that is left out
MOST_CHOICES = 100_000  # of numbers of modes below the bands: 0.3 s to put them in order


@dataclass(frozen=True)
class PosedProblem:
    """One choice of the number of modes below some bands, with the problem that it makes."""

    task: Task
    below: tuple[tuple[str, int | None], ...]  # the band in words, and k; None of one left out
    requirements: Requirements
    problem: DesignProblem
    response: DesignResponse
    outlook: Outlook | None  # None where modes are followed

    @property
    def limit_names(self) -> tuple[str, ...]:
        """The names of all limits, those that every step keeps the last."""
        kept = (row.name for row in self.problem.constraints)
        return tuple(dict.fromkeys((*self.requirements.limit_names, *kept)))

    def with_limits(self, names: Collection[str]) -> PosedProblem:
        """The problem with those limits only that are named, and without prices."""
        some = self.requirements.with_limits(names)
        kept = tuple(row for row in self.problem.constraints if row.name in names)
        appraise = _appraise(self.task, some, self.response)
        problem = replace(self.problem, appraise=appraise, constraints=kept, cost=None)
        outlook = self.outlook and replace(self.outlook, requirements=some)
        return replace(self, requirements=some, problem=problem, outlook=outlook)

    def worth(self, y: Floats, hz: Floats) -> tuple[float, float]:
        """What a design of frequencies (n_t, n_modes) misses, and F."""
        seen = self.requirements.appraise(y, Frequencies(hz, np.zeros((*hz.shape, len(y)))))
        return seen.violation, self.problem(y, seen)


@dataclass(frozen=True)
class Task:
    """Targets on the samples of a scene."""

    scene: Scene
    wanted: tuple[Requirement, ...]
    margins: tuple[Margin, ...] = ()  # by which modes keep off each band; none without bands
    models: ReducedModels | None = None  # that stand for exact solves
    scenarios: tuple[Floats, ...] = ()  # in which it is asked too

    def designs(self, y: Floats) -> list[Floats]:
        """A design, and what it is in each scenario."""
        return [y, *(self.scene.tolerances.deviated(y, sigma)[0] for sigma in self.scenarios)]

    @cached_property
    def bands(self) -> tuple[ForbiddenBand, ...]:
        """The bands along each trajectory for itself."""
        return tuple(_bands(self.wanted))

    @cached_property
    def glances(self) -> dict[int, Glances]:
        """What is known of many designs, by the number of modes."""
        return {}

    @cached_property
    def followers(self) -> tuple[Follower, ...]:
        """The followers of every mode that targets follow by its shape."""
        return followers(self.scene, self.wanted)


def thinned(whole: Task, few: int) -> Task | None:
    """The same on few samples; None where there are few, or a target would have none of them."""
    path = whole.scene.path
    if len(path.q) < 2 * few:
        return None
    scene = replace(whole.scene, trajectory=path.chosen(_few(whole, few)))
    try:
        task = replace(whole, scene=scene, wanted=requirements_of(scene.file, scene.path))
    except CaseError:
        return None
    return task if len(task.bands) == len(whole.bands) else None


def _few(whole: Task, few: int) -> NDArray[np.intp]:
    """About so many samples, and the instants between samples at which most is asked.

    Those are the first and the last of every target, and where its edges are lowest and highest.
    """
    path = whole.scene.path
    most = [
        one.rows.start + row
        for one in whole.wanted
        for row in (0, len(one.hz) - 1, int(one.lower.argmin()), int(one.upper.argmax()))
    ]
    between = [row for row in most if path.inserted[row]]
    return np.union1d(path.spread(few), np.array(between, dtype=np.intp))


def variant_of(
    task: Task,
    below: Counts,
    missed: bool = False,
    held: tuple[Floats, Floats] | None = None,
) -> PosedProblem:
    """The problem of a task with so many modes below each of its bands, without those of None.

    Linear limits may be ``missed`` as others may, and are where they contradict each other. The
    bounds are those of the scene, or what a choice from lists leaves ``held`` of them.
    """
    scene, wanted = task.scene, task.wanted
    lower, upper = held or scene.bounds
    aim = scene.file.assignment.named_objective
    asked = [one for one in wanted if not one.bands and not one.is_aim]
    aims = [one for one in wanted if one.is_aim]
    aims += (one for one in asked if aim == "widest" and isinstance(one, ModeGap))
    for band, k, margin in zip(task.bands, below, task.margins, strict=True):
        if k is None:
            continue
        q = scene.path.at(scene.initial)[0][band.rows]
        above = mode_above(scene.model, k, band.counted, q, scene.initial)
        asked += band.kept_clear(k, above, margin)
        aims += band.kept_clear(k, above, Margin()) if aim == "widest" else ()
    # linear limits are kept by every step; where they contradict, they are missed least
    kept = not (missed or task.scenarios)
    kept = kept and constraints_agree(scene.constraints, lower, upper)
    asked += (one for one in scene.limits if not kept or one.constraint is None)
    width = np.ptp(scene.bounds, axis=0)
    width = np.where(width > 0.0, width, 1.0)
    has_goals = any(one.is_goal for one in asked)
    objective = Objective.LARGEST if aims else Objective.LEAST_SQUARES
    objective = Objective.WORST_CASE if has_goals and aim == "worst_case" else objective
    cost = cost_of(scene, 1.0 / price_of_one(scene.file))
    requirements = Requirements(
        asked=tuple(asked),
        time_weights=time_weights(scene.path),
        objective=objective,
        least_change=None if has_goals or aims or cost else (scene.initial, width),
        aims=tuple(aims),
    )
    response = response_of(scene, requirements.modes, task.followers, task.models)
    problem = DesignProblem(
        appraise=_appraise(task, requirements, response),
        lower=lower,
        upper=upper,
        constraints=scene.constraints if kept else (),
        cost=cost,
        objective=objective,
    )
    named = tuple(zip((band.label for band in task.bands), below, strict=True))
    outlook = outlook_of(scene, requirements, task.followers, task.glances)
    return PosedProblem(task, named, requirements, problem, response, outlook)


def _appraise(task: Task, asked: Requirements, response: DesignResponse) -> Appraise:
    """What sees a design by what is asked, in all scenarios of the task, by aims too."""

    def nominal(y: Floats) -> Appraisal:
        return asked.appraise(y, response(y))

    largest = bool(asked.goals or asked.aims) and asked.objective is not Objective.LEAST_SQUARES
    return with_scenarios(nominal, task.scene.tolerances, task.scenarios, largest)


def cost_of(scene: Scene, unit: float) -> Cost | None:
    """What designs cost more than the initial one, in ``unit`` for 1 of the file; None: nothing.

    What is chosen of lists with a price each counts in full. Of the lightest design the mass is
    all that counts, in kg.
    """
    design, mass, n = scene.file.design, scene.model.total_mass, len(scene.initial)
    if scene.file.assignment.objective == "lightest":
        return Cost(np.zeros(n), scene.initial, 1.0, mass, is_affine=mass.is_affine)
    prices = np.array([column.price or 0.0 for column in design.parameters.values()])
    listed = [own for own in catalogues(scene.file) if own.prices]
    of_mass = (design.mass and design.mass.price) or 0.0
    if not of_mass and not prices.any() and not listed:
        return None
    return Cost(
        prices=unit * prices,
        reference=scene.initial,
        of_mass=unit * of_mass,
        mass=mass if of_mass else None,
        free=mass(scene.initial)[0] if of_mass else 0.0,
        is_affine=not of_mass or mass.is_affine,
        listed=lambda y: sum(own.price(y) for own in listed),
    )


@dataclass(frozen=True)
class Designs:
    """Designs all over the bounds with their frequencies, and what these say of bands.

    ``solved`` are the lowest frequencies of each on the samples of ``scene``, as many as reach
    beyond every band, and those followed; ``y`` (m, n_y) are the designs.
    """

    scene: Scene
    bands: Sequence[ForbiddenBand]
    y: Floats
    solved: Sequence[Solved]

    @classmethod
    def all_over(cls, scene: Scene, wanted: Sequence[Requirement], count: int) -> Designs:
        """The initial design, corners and the middle, and ``count`` spread ones.

        Raises LostModeError where a followed mode is lost at all of them.
        """
        bands, own = tuple(_bands(wanted)), followers(scene, wanted)
        lower, upper = scene.bounds
        extremes = corners(scene.file, scene.initial, lower, upper)
        designs = [scene.initial, lower, upper, 0.5 * (lower + upper), *extremes]
        if len(lower):
            designs += list(spread_designs(scene.bounds, count, 1))
        found: list[tuple[Floats, Solved]] = []
        for y in designs:
            try:
                found.append((y, solved_below(scene, bands, own, y)))
            except EigassignError as error:
                lost = error
        if not found:
            raise lost
        return cls(scene, bands, *(np.array([y for y, _ in found]), [each for _, each in found]))

    @cached_property
    def choices(self) -> list[tuple[int, ...]]:
        """Choices of a number for every band, those that designs are nearest to first.

        From the fewest to the most of any design. Of more than `MOST_CHOICES` not all are listed.
        """
        each = [[band.below(solved) for solved in self.solved] for band in self.bands]
        near = np.array([[int(np.median(own[k])) for own in each] for k in range(len(self.y))])
        counts = (
            range(min(int(k.min()) for k in own), max(int(k.max()) for k in own) + 1)
            for own in each
        )
        listed = itertools.islice(itertools.product(*counts), MOST_CHOICES)
        return sorted(
            dict.fromkeys((*map(tuple, near.tolist()), *listed)),
            key=lambda choice: int(np.abs(near - choice).sum(axis=1).min()),
        )

    def best_of(self, variant: PosedProblem, most: int) -> list[Floats]:
        """The designs that a variant promises most from."""
        modes, worths = variant.requirements.modes, []
        for y, each in zip(self.y, self.solved, strict=True):
            lacking = ((0, 0), (0, max(modes - each.hz.shape[1], 0)))
            lowest = np.pad(each.hz, lacking, constant_values=np.inf)
            worths.append(variant.worth(y, np.hstack([lowest, each.followed])))
        order = best_first(range(len(worths)), lambda k: worths[k])
        return [self.y[k] for k in order[:most]]


def solved_below(
    scene: Scene, bands: Sequence[ForbiddenBand], own: tuple[Follower, ...], y: Floats
) -> Solved:
    """The lowest frequencies of a design (n_y,), all that matter to the bands and have mass.

    At all samples, with the modes that are followed.
    """
    q = scene.path.at(y)[0]
    available = scene.model.n_dof - scene.model.n_rigid
    beyond = max((float(band.upper.max()) for band in bands), default=0.0)
    named = (mode for band in bands for mode in band.counted)
    count = min(max((4, *named)), available)
    while True:
        try:
            hz = scene.model.frequencies(q, y, count)
        except MissingMassError as error:
            count = available = error.most
            continue
        if count == available or hz[:, -1].min() > beyond:
            return with_followed(scene, own, y, hz)
        count = min(2 * count, available)


def _bands(wanted: Sequence[Requirement]) -> Iterator[ForbiddenBand]:
    return (band for one in wanted for band in one.bands)


def lacking(task: Task, y: Floats) -> list[Floats]:
    """What a design lacks to be clear of each band, by the number of modes below it from 0."""
    if not task.bands:
        return []
    each = []
    for one in task.designs(y):
        solved = solved_below(task.scene, task.bands, task.followers, one)
        both = zip(task.bands, task.margins, strict=True)
        each.append([band.errors_by_count(solved, margin) for band, margin in both])
    # of numbers of modes below those that all designs know
    known = ([e[: min(map(len, own))] for e in own] for own in zip(*each, strict=True))
    return [np.max(own, axis=0) for own in known]


def spread_designs(bounds: tuple[Floats, Floats], count: int, seed: int) -> Floats:
    """Designs (count, n_y) of a Latin hypercube over the ``bounds``, lower and upper (n_y,)."""
    lower, upper = bounds
    cells = np.tile(np.arange(count), (len(lower), 1))
    share = (np.random.default_rng(seed).permuted(cells, axis=1).T + 0.5) / count
    wide = (lower > 0.0) & (upper > 10.0 * lower)
    low = np.where(wide, lower, 1.0)
    ratio = np.where(wide, upper, 1.0) / low
    return np.where(wide, low * ratio**share, lower + share * (upper - lower))
