"""What the answer means: what it hangs on, what its limits cost, what can be reached at all.

Where all frequencies are monotone in every parameter (`response`), two corners of the bounds prove
between what values each mode stays at every sample. Otherwise the target is searched for at the
samples where it is missed most, each by itself: a sample at which no design comes near enough, from
several starts, is out of reach. A target that is missed somewhere but within reach at every sample
is not called unreachable: there, one design cannot serve all samples.

Both are read off the exact slopes that the answer was judged by; nothing is solved. A limit with
multiplier μ = −dF/db, relaxed by δ, lowers F to F − μδ to first order; F is the mean square of the
relative errors, or the largest of them, so that the rms error falls from √F to √(F − μδ).

How much is studied is the user's choice and changes no answer. What follows from slopes already
known, or from two exact solves a pose of a small model, is cheap; `all` adds those of a large one.

Of a mode that is missed it is said what would help: all properties that the mechanism is made of
and that are not 0 become parameters of a model of their own, whose exact slopes are the levers, the
coordinates as they are.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from enum import StrEnum
from typing import TypeVar

import numpy as np

from eigassign.arrays import Floats, Ints
from eigassign.assignment.exact.design_problem import MET, Appraisal, DesignProblem, Objective
from eigassign.assignment.exact.requirements import Requirements
from eigassign.assignment.exact.sequential import minimise
from eigassign.assignment.one_shot import ActiveLimit
from eigassign.assignment.requirements.kinds import AssignedFrequency, Margin
from eigassign.assignment.requirements.requirement import Requirement, Solved
from eigassign.case.case_file import CaseFile
from eigassign.case.units import handy, handy_unit
from eigassign.errors import EigassignError
from eigassign.modal.model import Model
from eigassign.study.built_case import build_model
from eigassign.study.design.account import active_rows
from eigassign.study.design.answer import Answer
from eigassign.study.design.followed import Rest, followers, solve_design
from eigassign.study.design.search.optimum import Choices
from eigassign.study.design.search.response import Designs, corners, effects
from eigassign.study.design.search.variants import PosedProblem, Task, variant_of
from eigassign.study.results import (
    LeverRow,
    Meaning,
    RangeRow,
    RelaxedRow,
    SensitivityRow,
)
from eigassign.study.scene import Scene

FEW = 21  # samples of a trajectory at which levers are looked at
LIMIT = 1e-4  # of a limit: by so much it must be missed to be called out of reach
STEPS, STARTS = 30, 3  # of a search at one sample
COMBINED = 64  # combinations of catalogues, each searched there
CHOICES = 8  # of the numbers of modes below bands there
R = TypeVar("R", bound=Requirement)


def proved_ranges(scene: Scene) -> tuple[Solved, Solved] | None:
    """Lowest and highest frequencies of all designs within the bounds, of numbered modes only.

    None where that is not known of every parameter, or a corner of the bounds has no frequencies.
    """
    lower, upper = scene.bounds
    if not np.all((effects(scene.file) != 0.0) | (lower == upper)):
        return None
    softest, stiffest = corners(scene.file, lower, lower, upper)
    try:
        return solve_design(scene, (), softest), solve_design(scene, (), stiffest)
    except EigassignError:
        return None


def reach_rows(wanted: Sequence[Requirement], ranges: tuple[Solved, Solved]) -> Iterator[RangeRow]:
    """The range of each target's curve at every sample, and the least error that is left."""
    for w in wanted:
        if w.terms and not w.followed:
            error = float(w.least_errors(*ranges).max())
            how = "proved" if len(w.terms) == 1 else "bounded"
            yield RangeRow(w.label, *w.curve_range(*ranges), how, error)


def misses(wanted: Requirement, exact: Solved, max_error: float) -> bool:
    """True if a target is missed by more than is allowed, ``max_error`` of a wanted frequency."""
    return bool(np.abs(wanted.errors(exact)).max() > _allowed(wanted, max_error))


def _allowed(wanted: Requirement, max_error: float) -> float:
    return max_error if wanted.is_goal else LIMIT


def unreachable(
    scene: Scene,
    wanted: Sequence[Requirement],
    y: Floats,
    exact: Solved,
    max_error: float,
    ranges: tuple[Solved, Solved] | None,
) -> Iterator[str]:
    """The targets that y misses and that are out of reach at some sample, in words.

    A wanted frequency is out of reach where no design that keeps all limits comes near enough; a
    limit where no design does that keeps the linear ones: with others it contradicts.
    """
    for w in wanted:
        if not misses(w, exact, max_error):
            continue
        allowed, errors = _allowed(w, max_error), w.errors(exact)
        known = ranges is not None and not w.followed
        # of listed values one beyond a limit may meet it, though another is nearer to that
        listed = bool(scene.file.design.catalogues) and not w.is_goal
        others = [*scene.limits, *(one for one in wanted if not one.is_goal)] if w.is_goal else []
        if known and ranges is not None:
            left = w.least_errors(*ranges)
            k = int(left.argmax())
            if left[k] > allowed:
                low, high = (float(values[k]) for values in w.curve_range(*ranges))
                how = f"between {low:.4g} and {high:.4g} Hz within the bounds, proved"
                free = not (others or scene.constraints or scene.file.design.catalogues)
                best: float | None = low if low > w.lower[k] else high
                if not free or len(w.terms) > 1:  # the corners need not keep all limits
                    best = None if listed else _nearest(scene, w, others, k, y, allowed)
                    how = how if best is None else f"found by a search; it is {how}"
                yield _words(scene, w, k, best, how)
                continue
        if w.terms and (others or not known) and not listed:
            yield from _searched(scene, w, others, y, errors, allowed)


def _words(scene: Scene, wanted: Requirement, k: int, reached: float | None, how: str) -> str:
    """The frequency that is ``reached`` at sample k of a target, and the one that was asked for."""
    asked = float(wanted.hz[k])
    curve = wanted.curve_name if len(wanted.terms) == 1 else "the distance of the modes"
    where = f"{wanted.label} is out of reach at {scene.path.where(wanted.rows.start + k)}"
    said = f"{where}: {asked:.4g} Hz was asked, "
    if clash := ", ".join(_contradicting(scene, wanted, k)):
        said += f"which {clash} contradicts, "
    if reached is None:
        return f"{said}{curve} is {how}"
    most = "highest" if reached < asked else "lowest"
    return f"{said}the {most} that {curve} reaches there is {reached:.4g} Hz ({how})"


def _contradicting(scene: Scene, wanted: Requirement, k: int) -> Iterator[str]:
    """The limits and bands of the same mode that its frequency wanted at sample k would miss."""
    at, hz = wanted.rows.start + k, wanted.hz[k]
    for one in scene.wanted if wanted.is_goal else ():
        same = wanted.mode in one.modes or not one.modes if one.bands else one.terms == wanted.terms
        if same and not one.is_goal and _holds(one, at):
            own = at - one.rows.start
            beyond = max(one.lower[own] - hz, hz - one.upper[own])
            if beyond < 0.0 if one.bands else beyond > 0.0:
                yield one.label


def _searched(
    scene: Scene,
    wanted: Requirement,
    others: Sequence[Requirement],
    y: Floats,
    errors: Floats,
    allowed: float,
) -> Iterator[str]:
    """The sample missed most of those above and below, at which no design is near enough."""
    missed = [int(errors.argmax()), *([int(errors.argmin())] if wanted.is_goal else [])]
    missed.sort(key=lambda k: -abs(errors[k]))
    for k in dict.fromkeys(k for k in missed if abs(errors[k]) > allowed):
        nearest = _nearest(scene, wanted, others, k, y, allowed)
        if nearest is not None and abs(nearest / wanted.hz[k] - 1.0) > allowed:
            how = f"found by a search from {STARTS} starts within the limits"
            yield _words(scene, wanted, k, nearest, how)
            return


def _nearest(
    scene: Scene,
    wanted: Requirement,
    others: Sequence[Requirement],
    k: int,
    y: Floats,
    allowed: float,
) -> float | None:
    """The frequency nearest to the one wanted at sample k of the target, by a search of its own."""
    at, goal = wanted.rows.start + k, wanted.hz[k : k + 1]
    there = AssignedFrequency(
        *(wanted.label, wanted.place, wanted.terms, slice(0, 1), goal, goal),
        followed=wanted.followed,
    )
    alone = replace(scene, trajectory=scene.path.chosen([at]))
    beside = [_at(one, at) for one in others if one.mode_terms and _holds(one, at)]
    bands = [_at(band, at) for one in others for band in one.bands if _holds(band, at)]
    names = {one.name for one in (*others, *scene.limits) if one in others or one.constraint}
    task = Task(alone, (there, *beside, *bands), (Margin(),) * len(bands))
    belows = Designs.all_over(alone, bands).choices[:CHOICES]
    every, (lower, upper) = Choices(task, belows, names), scene.bounds
    if every.count > COMBINED * len(belows):
        return None
    found = []
    for variant in filter(None, every.left(every.count)):
        for start in (y, 0.5 * (lower + upper), scene.initial)[:STARTS]:
            problem = variant.problem
            try:
                best = minimise(problem, np.clip(start, problem.lower, problem.upper), STEPS)
            except EigassignError:
                continue
            if best.seen.violation > MET:
                continue
            found.append((abs(best.seen.residual[0]), (best.seen.residual[0] + 1.0) * goal[0]))
            if found[-1][0] <= allowed:
                return float(found[-1][1])
    return float(min(found)[1]) if found else None


def _holds(one: Requirement, at: int) -> bool:
    return bool(one.rows.start <= at < one.rows.stop)


def _at(one: R, at: int) -> R:
    """A requirement at one of its samples, which is the only one there is."""
    own = slice(at - one.rows.start, at - one.rows.start + 1)
    return replace(one, rows=slice(0, 1), lower=one.lower[own], upper=one.upper[own], along=())


STEP = 0.04  # of the range of a bound, or of a limit: how far it is relaxed, to one digit
MOST = 0.3  # of F: a larger fall is beyond what first order can tell


def sensitivities(
    file: CaseFile, asked: Requirements, y: Floats, seen: Appraisal
) -> Iterator[SensitivityRow]:
    """One row for each parameter and curve that a target or limit is about."""
    curves = list(asked.curves(seen))
    for k, name in enumerate(file.design.parameters):
        for own, hz, slopes in curves:
            of_f = slopes[:, k]
            share = y[k] * of_f / np.where(hz == 0.0, np.inf, hz)
            yield SensitivityRow(
                parameter=name,
                unit=file.design_units[k],
                handy=handy_unit(file.design_units[k], float(y[k])),
                label=own.label,
                hz_per_unit=float(of_f.mean()),
                hz_per_unit_largest=_largest(of_f),
                percent_per_percent=float(share.mean()),
                percent_per_percent_largest=_largest(share),
            )


def deviations(scene: Scene, asked: Requirements, y: Floats, seen: Appraisal) -> Iterator[str]:
    """Say how far frequencies move within the tolerances δ to first order, Σ_k |∂f/∂y_k| δ_k."""
    lower, upper = scene.tolerances.box(y)
    for own, _, slopes in asked.curves(seen):
        most = float((np.abs(slopes) @ (0.5 * (upper - lower))).max())
        if most > 0.0:
            yield f"{own.label}: within the tolerances it moves by up to {most:.3g} Hz, about"


def _largest(values: Floats) -> float:
    return float(values[np.abs(values).argmax()])


# --- Limits


def error_kind(problem: DesignProblem, asked: Requirements) -> str:
    """The objective F in words: an error, room or a frequency only where nothing has a price."""
    if asked.aims and problem.cost is None:
        return "room" if asked.aims[0].kind != "highest" else "frequency"
    if problem.cost is not None and not asked.goals and not asked.aims:
        if problem.cost.is_time:
            return "motion time"
        return "price" if problem.cost.free or not problem.cost.of_mass else "mass"
    if not asked.goals or problem.cost is not None:
        return "objective"
    return "worst error" if problem.objective is Objective.WORST_CASE else "rms error"


def as_error(kind: str, F: float) -> float:
    """F as the quantity of `error_kind`."""
    if kind in ("room", "frequency"):
        return -F
    return float(np.sqrt(max(F, 0.0))) if kind == "rms error" else F


def relaxed_limits(
    file: CaseFile, variant: PosedProblem, F: float, active: Sequence[ActiveLimit]
) -> Iterator[RelaxedRow]:
    """The gain of a little more room at each active limit, where there is one to be seen."""
    problem, kind = variant.problem, error_kind(variant.problem, variant.requirements)
    for row in active:
        asked = None if row.multiplier <= 0.0 else _relaxation(file, problem, row)
        if asked is None:
            continue
        amount, unit = asked
        while row.multiplier * amount > MOST * abs(F) > 0.0:
            amount = _rounded(0.5 * amount, unit)
        before, after = as_error(kind, F), as_error(kind, F - row.multiplier * amount)
        both, per_cent = (before, after), " %" * (kind.endswith("error") or kind == "room")
        shown = [f"{100.0 * each:#.3g}" if per_cent else f"{each:.4g}" for each in both]
        if kind == "mass":
            shown = [handy(each, file.mass_unit, 4) for each in both]
        if shown[0] == shown[1]:
            continue
        change = " → ".join(shown) + per_cent
        yield RelaxedRow(
            row.name, row.kind, row.side, amount, unit, kind, before, after,
            f"{_room(variant, row, amount, unit)}: {kind} {change}",
        )  # fmt: skip


def _relaxation(
    file: CaseFile, problem: DesignProblem, row: ActiveLimit
) -> tuple[float, str] | None:
    """How far a limit is relaxed; None of a mass, inertia or stiffness that is not below zero."""
    if row.kind == "bound":
        k = list(file.design.parameters).index(row.name)
        unit = file.design_units[k]
        if row.side == "lower" and problem.lower[k] == 0.0 and unit.startswith(("kg", "N")):
            return None
        return _rounded(STEP * float(problem.upper[k] - problem.lower[k]), unit), unit
    if row.kind == "constraint":
        (terms,) = (one.coefficients for one in problem.constraints if one.name == row.name)
        span = float(np.abs(terms) @ (problem.upper - problem.lower))
        unit = file.constraint_unit(row.name)
        return _rounded(STEP * span, unit), unit
    return 0.01, ""


def _rounded(value: float, unit: str) -> float:
    """``value`` to one digit of what its SI ``unit`` is answered in; 1 if there is nothing."""
    size = handy_unit(unit, value)[1]
    return float(f"{value / size:.0e}") * size if value > 0.0 else size


def _room(variant: PosedProblem, row: ActiveLimit, amount: float, unit: str) -> str:
    if row.kind == "target":
        return variant.requirements.named(row.name).relaxed(row.side, amount)
    more = "more" if row.side == "upper" else "less"
    named = f"{'bound' if row.kind == 'bound' else 'limit'} of {row.name}"
    return f"{handy(amount, unit)} {more} at the {row.side} {named}"


def levers(model: Model, q: Floats, y: Floats, numbers: Mapping[str, Ints]) -> Iterator[LeverRow]:
    """Yield what the properties do to each mode at poses q (n, n_q) of a design y, largest first.

    ``numbers`` (n,) are by the mode's name those that it has there, 0 where it does not matter.
    Without lengths, places and angles where loops cannot follow them. Raises EigassignError where
    the model has no such modes.
    """
    case = model.poses.case
    try:
        every = case.with_design(y).with_every_property()
        made = build_model(every)
    except EigassignError:
        every = case.with_design(y).with_every_property(places=False)
        made = build_model(every)
    made = made if model.held is None else made.holding(*model.held)
    x = made.x(q, np.array([every.value_at(path) for path in made.y_names]))
    wanted = np.arange(x.shape[1]) >= made.pencil.n_joints
    count = max(int(own.max()) for own in numbers.values())
    lam, slopes = made.slopes(q, x[0, made.pencil.n_q :], count, wanted)
    names = (*made.q_names, *made.y_names)
    known = {path for column in case.design.parameters.values() for path in column.factors}
    for name, own in numbers.items():
        there, rows = np.flatnonzero(own), list[LeverRow]()
        of = there, own[there] - 1
        for k in np.flatnonzero(wanted):
            if names[k] not in known:
                share = 0.5 * x[there, k] * slopes[*of, k] / lam[of]
                most = float(share[np.abs(share).argmax()])
                if most:
                    rows.append(LeverRow(name, names[k], float(share.mean()), most))
        # to six digits, so that round-off does not decide which of two alike stands first
        yield from sorted(rows, key=lambda row: -float(f"{abs(row.percent_per_percent):.5e}"))


def _of_missed(
    scene: Scene, y: Floats, wanted: Sequence[Requirement], exact: Solved, max_error: float
) -> Iterator[LeverRow]:
    """The levers of the modes of targets that are missed, where they are asked for."""
    samples, numbers = scene.path.spread(FEW), dict[str, Ints]()
    for one in (w for w in wanted if misses(w, exact, max_error)):
        worst = one.rows.start + int(np.abs(one.errors(exact)).argmax())
        samples = np.union1d(samples, [worst])
        modes = one.near(exact, exact) or one.modes
        named = {f"mode {k}": np.full(len(exact.hz), k, dtype=np.intp) for k in modes}
        if one.followed:
            shapes = zip(one.followed, one.followed_numbers, strict=True)
            named = {mode.name: exact.numbers[:, k] for mode, k in shapes}
            for rest in followers(scene, [one]):
                if isinstance(rest, Rest) and rest.mode.name in named:
                    q, name = scene.path.at(y)[0][samples], rest.mode.name
                    yield from levers(rest.of.held, q, y, {name: rest.numbers(q, y)})
                    del named[name]
        for name, own in named.items():
            known = numbers.setdefault(name, np.zeros(len(exact.hz), dtype=np.intp))
            known[one.rows] = own[one.rows]
    if numbers:
        at = {name: own[samples] for name, own in numbers.items()}
        yield from levers(scene.model, scene.path.at(y)[0][samples], y, at)


class Studies(StrEnum):
    """The studies of an answer that the user asks for."""

    NONE = "none"
    CHEAP = "cheap"
    ALL = "all"


def study_meaning(
    scene: Scene,
    answer: Answer,
    wanted: Sequence[Requirement],
    exact: Solved,
    max_error: float,
    studies: Studies,
) -> Meaning:
    """What the answer, of frequencies ``exact``, means; as far as ``studies`` asks for it.

    Whether a target that is missed by more than ``max_error`` can be reached is always studied.
    """
    missed = any(misses(w, exact, max_error) for w in wanted)
    # two exact solves a pose are cheap for small models, even where nothing is missed
    small = scene.model.pencil.is_dense
    asked_for = studies is Studies.ALL or (studies is Studies.CHEAP and small)
    ranges = proved_ranges(scene) if missed or asked_for else None
    beyond = tuple(unreachable(scene, wanted, answer.y, exact, max_error, ranges))
    reach = () if ranges is None else tuple(reach_rows(wanted, ranges))
    if studies is Studies.NONE:
        return Meaning(unreachable=beyond)
    found = answer.found
    variant = variant_of(Task(scene, tuple(wanted)), ()) if found is None else found.variant
    seen = variant.problem.appraise(answer.y) if found is None else found.best.seen
    relaxed: Iterator[RelaxedRow] = iter(())
    if found is not None and found.best.seen.violation <= MET:  # else limits are no price
        active = tuple(active_rows(scene, answer))
        relaxed = relaxed_limits(scene.file, variant, found.best.objective, active)
    notes = list(deviations(scene, variant.requirements, answer.y, seen))
    helping: tuple[LeverRow, ...] = ()
    try:
        helping = tuple(_of_missed(scene, answer.y, wanted, exact, max_error))
    except EigassignError as error:
        notes.append(f"missed modes are not explained: {error}")
    return Meaning(
        sensitivity=tuple(sensitivities(scene.file, variant.requirements, answer.y, seen)),
        relaxed=tuple(relaxed),
        levers=helping,
        reach=reach,
        unreachable=beyond,
        notes=tuple(notes),
    )
