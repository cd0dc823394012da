"""The problems that the targets of a case make, one for each choice of what its bands leave open.

What the case file asks for becomes requirements (`assignment.exact.requirements`). A band to keep
out of leaves a choice: on a connected trajectory it is clear if and only if the number k of
modes below it is the same everywhere, so each k that the bounds may allow is one more problem.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.exact.design_problem import DesignProblem, Objective
from eigassign.assignment.exact.requirements import (
    FrequencyGoal,
    FrequencyLimit,
    QuantityLimit,
    Requirements,
)
from eigassign.assignment.feasibility import constraints_agree
from eigassign.assignment.program import Bounds, LinearConstraint
from eigassign.errors import CaseError, EigassignError, MissingMassError
from eigassign.study.design.clearance import mode_above
from eigassign.study.design.followed import Follower, followers
from eigassign.study.design.one_shot import linear_constraints
from eigassign.study.design.response import DesignResponse, ReducedModels, response_of
from eigassign.study.scene import Scene
from eigassign.study.wanted import Wanted, target_frequencies, time_weights

Floats = NDArray[np.float64]
MASS = "design.mass"  # what the limit of the whole mechanism's mass is called


@dataclass(frozen=True)
class PosedProblem:
    """One choice of the number of modes below each band, with the problem that it makes."""

    below: tuple[tuple[str, int], ...]  # the band in words, and k
    requirements: Requirements
    problem: DesignProblem
    response: DesignResponse

    def with_limits(self, names: Collection[str]) -> DesignProblem:
        """The problem with those limits only that are named."""
        some = self.requirements.with_limits(names)
        return replace(self.problem, appraise=lambda y: some.appraise(y, self.response(y)))


@dataclass(frozen=True)
class Task:
    """Targets on the samples of a scene."""

    scene: Scene
    wanted: tuple[Wanted, ...]
    margin: float  # by which the limits of bands are drawn in, relative
    models: ReducedModels | None = None  # that stand for exact solves

    @cached_property
    def bands(self) -> tuple[_Band, ...]:
        """The bands along each trajectory for itself."""
        return tuple(_bands(self.scene, self.wanted))

    @cached_property
    def followers(self) -> tuple[Follower, ...]:
        """The followers of every mode that targets follow by its shape."""
        return followers(self.scene, self.wanted)


def thinned(whole: Task, few: int) -> Task | None:
    """The same on few samples; None where there are few, or a target would have none of them."""
    path = whole.scene.path
    if len(path.q) < 2 * few:
        return None
    scene = replace(whole.scene, trajectory=path.chosen(path.spread(few)))
    try:
        task = replace(whole, scene=scene, wanted=target_frequencies(scene.file, scene.path))
    except CaseError:
        return None
    return task if len(task.bands) == len(tuple(_bands(scene, whole.wanted))) else None


def variant_of(task: Task, below: tuple[int, ...], missed: bool = False) -> PosedProblem:
    """The problem of a task with so many modes below each of its bands.

    Linear limits may be ``missed`` as others may, and are where they contradict each other.
    """
    scene, wanted = task.scene, task.wanted
    lower, upper = scene.bounds
    targets = tuple(
        FrequencyGoal(w.mode, w.hz, w.rows, w.weight)
        for w in wanted
        if w.requirement.kind == "frequency"
    )
    objective = Objective(scene.file.assignment.objective)
    prices = np.array([column.price or 0.0 for column in scene.file.design.parameters.values()])
    if targets:  # F is errors, and prices are in %² of them, in the worst case in %
        prices = prices / (1e2 if objective is Objective.WORST_CASE else 1e4)
    of_bands = [
        limit
        for band, k in zip(task.bands, below, strict=True)
        for limit in _beside(scene, band, k, task.margin)
    ]
    constraints, elastic = _linear(scene, missed)
    width = np.where(upper > lower, upper - lower, 1.0)
    asked = Requirements(
        targets=targets,
        limits=(*_limits(wanted), *of_bands),
        quantities=(*_mass(scene), *elastic),
        time_weights=time_weights(scene.path),
        objective=objective,
        least_change=(scene.initial, width) if not targets and not prices.any() else None,
    )
    response = response_of(scene, asked.modes, task.followers, task.models)
    problem = DesignProblem(
        appraise=lambda y: asked.appraise(y, response(y)),
        lower=lower,
        upper=upper,
        constraints=constraints,
        prices=prices if prices.any() else None,
        reference=scene.initial,
        objective=objective if targets else Objective.LEAST_SQUARES,
    )
    named = zip((band.label for band in task.bands), below, strict=True)
    return PosedProblem(tuple(named), asked, problem, response)


def _mass(scene: Scene) -> Iterator[QuantityLimit]:
    given = scene.file.design.mass
    if given is not None:
        low = -np.inf if given.min is None else given.min
        high = np.inf if given.max is None else given.max
        yield QuantityLimit(MASS, scene.model.total_mass, low, high)


def _linear(
    scene: Scene, missed: bool
) -> tuple[tuple[LinearConstraint, ...], tuple[QuantityLimit, ...]]:
    """Linear limits that every step keeps; where they contradict, limits to be missed least."""
    rows = tuple(linear_constraints(scene.file))
    if not missed and constraints_agree(rows, Bounds(*scene.bounds)):
        return rows, ()
    return (), tuple(QuantityLimit(r.name, partial(_sum, r), r.lower, r.upper) for r in rows)


def _sum(row: LinearConstraint, y: Floats) -> tuple[float, Floats]:
    """The value of a linear limit and its slopes."""
    return float(row.coefficients @ y), row.coefficients


def _limits(wanted: Sequence[Wanted]) -> Iterator[FrequencyLimit]:
    for w in wanted:
        kind, label = w.requirement.kind, w.requirement.label
        if kind == "at_least":
            yield FrequencyLimit(label, ((w.mode, 1.0),), w.lower_hz, w.rows, True)
        elif kind == "at_most":
            yield FrequencyLimit(label, ((w.mode, 1.0),), w.upper_hz, w.rows, False)
        elif kind == "gap":
            low, high = w.requirement.modes
            yield FrequencyLimit(label, ((high, 1.0), (low, -1.0)), w.lower_hz, w.rows, True)


@dataclass(frozen=True)
class _Band:
    """A band to keep out of along one trajectory."""

    wanted: Wanted
    label: str  # with the trajectory, of several
    rows: slice  # of all samples
    lower_hz: Floats
    upper_hz: Floats


def _bands(scene: Scene, wanted: Sequence[Wanted]) -> Iterator[_Band]:
    """Yield every band along each trajectory for itself: only there k must not change."""
    for w in wanted:
        if w.requirement.kind != "keep_out":
            continue
        for part, rows in zip(scene.path.parts, scene.path.rows, strict=True):
            label = w.requirement.label
            label = f"{label} along {part.name!r}" if scene.path.several else label
            first, last = max(rows.start, w.rows.start), min(rows.stop, w.rows.stop)
            if first < last:
                own = slice(first - w.rows.start, last - w.rows.start)
                yield _Band(w, label, slice(first, last), w.lower_hz[own], w.upper_hz[own])


def possible_counts(scene: Scene, band: _Band) -> list[int]:
    """Each k that may be, from the fewest modes below the band to the most, at designs all over.

    The likeliest comes first.
    """
    named, (lower, upper) = sorted(band.wanted.requirement.modes), scene.bounds
    designs = [scene.initial, lower, upper, 0.5 * (lower + upper)]
    if len(lower):
        designs += list(spread_designs(scene, 8, 1))
    found = []
    for y in designs:
        with suppress(EigassignError):
            q = scene.path.at(y)[0][band.rows]
            hz = _all_below(scene, q, y, float(band.upper_hz.max()))
            hz = hz[:, [m - 1 for m in named if m <= hz.shape[1]]] if named else hz
            edges = (band.lower_hz, band.upper_hz)
            found.append(np.concatenate([(hz < e[:, None]).sum(axis=1) for e in edges]))
    first, counts = int(np.median(found[0])), np.array(found)
    possible = range(int(counts.min()), int(counts.max()) + 1)
    return sorted(possible, key=lambda k: (abs(k - first), k))


def _beside(scene: Scene, band: _Band, k: int, margin: float) -> Iterator[FrequencyLimit]:
    """The limits that say: k of the named modes (of all, if none is named) are below the band."""
    lower, upper = band.lower_hz * (1.0 - margin), band.upper_hz * (1.0 + margin)
    label, named = band.wanted.requirement.label, tuple(sorted(band.wanted.requirement.modes))
    if k:
        below = named[k - 1] if named else k
        yield FrequencyLimit(label, ((below, 1.0),), lower, band.rows, False)
    q = scene.path.at(scene.initial)[0][band.rows]
    if above := mode_above(scene.model, k, named, q, scene.initial):
        yield FrequencyLimit(label, ((above, 1.0),), upper, band.rows, True)


def _all_below(scene: Scene, q: Floats, y: Floats, hz: float) -> Floats:
    """The lowest frequencies (n, count), as many as reach beyond ``hz`` everywhere or have mass."""
    available = scene.model.n_dof - scene.model.n_rigid
    count = min(4, available)
    while True:
        try:
            found = scene.model.frequencies(q, y, count)
        except MissingMassError as error:
            count = available = error.most
            continue
        if count == available or found[:, -1].min() > hz:
            return found
        count = min(2 * count, available)


def spread_designs(scene: Scene, count: int, seed: int) -> Floats:
    """Designs (count, n_y) of a Latin hypercube over the bounds."""
    lower, upper = scene.bounds
    cells = np.tile(np.arange(count), (len(lower), 1))
    share = (np.random.default_rng(seed).permuted(cells, axis=1).T + 0.5) / count
    wide = (lower > 0.0) & (upper > 10.0 * lower)
    low = np.where(wide, lower, 1.0)
    ratio = np.where(wide, upper, 1.0) / low
    return np.where(wide, low * ratio**share, lower + share * (upper - lower))
