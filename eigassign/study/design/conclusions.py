"""What may be said of an optimum, and what an objective that is no error has come to.

Where every parameter raises or lowers each frequency (`response`), those at two corners of a box
bound each mode at every sample, and with it the limits that no design of the box keeps, and the F
that none is below (`Requirements.least`). The box of the least bound is halved where it is widest,
as slopes at the optimum weigh its sides. Where this misses limits, the least violation takes the
place of F.

Each before and after, as it is found between the samples too (`clearance`); of a robust design the
least in all scenarios, but the mass as it is without deviations.
"""

from __future__ import annotations

import heapq
import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from eigassign.arrays import Floats
from eigassign.assignment.exact.design_point import first_order
from eigassign.assignment.exact.design_problem import MET, ON, Appraisal, DesignProblem
from eigassign.assignment.exact.requirements import Requirements
from eigassign.assignment.exact.sequential import NOTHING, End, minimise
from eigassign.assignment.program import can_be_kept, smallest
from eigassign.assignment.requirements.kinds import ModeGap
from eigassign.assignment.requirements.quantity import LimitedQuantity
from eigassign.assignment.requirements.requirement import Frequencies, Requirement
from eigassign.case.schema.trajectory import DURATION_PATH
from eigassign.case.units import handy
from eigassign.errors import EigassignError
from eigassign.facts import priced
from eigassign.study.checks import raised_by
from eigassign.study.design.clearance import WITHIN, check_band, lowest_room
from eigassign.study.design.lists import cost
from eigassign.study.design.search.optimum import Found, can_be_met
from eigassign.study.design.search.response import Outlook
from eigassign.study.design.search.variants import PosedProblem, lacking
from eigassign.study.results import AimRow, OptimalityRow, ViolationRow
from eigassign.study.scene import Scene

SHARE = 0.25  # of the search's exact solves: a count, so that the same case has the same words
MOST_SOLVED = 7000  # designs solved along the whole trajectory, where all studies are asked for
TOGETHER = 16  # boxes halved together: exact solves of many poses are quicker than one by one
GAP, POINTS = 0.01, 5e-4  # of F, and of the rms or the worst error: a smaller gap is none
SAID = 0.5  # of F: a wider gap says little
WIDE = 4.0  # times its lower end: a side so long is halved by ratio


def proof(scene: Scene, found: Found, thorough: bool) -> OptimalityRow | None:
    """What is proved of the optimum; None where nothing can be, or the search was ended."""
    best, problem = found.best, found.variant.problem
    missed, lower, upper = best.seen.violation > MET, problem.lower, problem.upper
    if found.are_listed or best.end in (End.SECONDS, End.INTERRUPTED):
        return None
    value = best.seen.violation if missed else best.objective
    least = 0.0 if missed else problem.least_value(lower, upper, np.zeros(0))
    enough = MET if missed else _enough(problem, value)
    if least < enough:  # else all that has a price is cheapest, or there is no error
        task = found.task
        given = task.scenarios or task.bands or task.followers or scene.path.follows_design
        outlook = found.variant.outlook
        if outlook is None or outlook.levels == 1 or given:
            return None
        most = MOST_SOLVED if thorough else int(SHARE * found.exact_solves / len(scene.path.q))
        least = min(value, _bound(found, outlook, least, enough, most))
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


def _bound(found: Found, outlook: Outlook, least: float, enough: float, most: int) -> float:
    """What no design is below; it solves about ``most`` of them."""
    variant, seen, number = found.variant, found.best.seen, itertools.count(1)
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
        values = _of_boxes(variant, outlook, lower, upper, seen.violation > MET)
        for before, own, *box in zip(np.tile(known, 2), values, lower, upper, strict=True):
            if own < np.inf:
                heapq.heappush(open_, (max(before, own), next(number), *box))
        made += len(some)
    return float(open_[0][0]) if open_ else np.inf


def _of_boxes(
    variant: PosedProblem, outlook: Outlook, lower: Floats, upper: Floats, missed: bool
) -> Iterator[float]:
    """Yield what no design of a box is below, F or violation; infinite if none keeps the limits."""
    problem = variant.problem
    kept = can_be_kept(problem.constraints, lower, upper)
    known = outlook(outlook.levels - 1, lower, upper)
    for low, high, met, (violation, residual) in zip(lower, upper, kept, known, strict=True):
        least = violation if met else np.inf
        value = problem.least_value(low, high, residual)
        yield least if missed else value if least <= MET else np.inf


def _words(scene: Scene, found: Found, least: float, gap: float) -> str:
    """``no design within the bounds is below 1.297 %``: rounded so that it stays true."""
    problem, goals, keys = found.variant.problem, found.variant.requirements.goals, scene.file
    aim, better = keys.assignment.named_objective, "better"
    if gap > 1e-9:  # of F: round-off
        better += f" by more than {-_rounded(-100 * gap)} % of the objective"
        if aim == "lightest":
            better = f"below {handy(_rounded(least), keys.mass_unit, 4)}"
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


def aim_row(
    found: Found, of_model: Mapping[int, float], worst: ViolationRow | None
) -> AimRow | None:
    """What is light, high or wide before and after; None where the objective is an error.

    ``of_model`` is how much too high mesh and reduced links put modes at most, relative; ``worst``
    what limits are violated by.
    """
    scene = found.task.scene
    aim, kept, wanted = scene.file.assignment.named_objective, ")", scene.wanted
    designs = scene.initial, found.best.y
    if worst is not None:
        met = worst.exact == 0.0 and found.best.seen.violation <= ON
        met = met and all(row.clear for row in found.clearances)
        kept = ", with limits broken" * (worst.initial > 0.0)
        kept += "), all limits kept" if met else "), not all limits kept"
    if aim == "lightest":
        before, after = map(scene.model.mass, designs)
        row = AimRow("as light as can be", before, after, scene.file.mass_unit)
        return _in_words(row, f"lightest design found: {row.after}", kept)
    if aim == "fastest":
        columns = scene.file.design.parameters.values()
        column = [own.parameter for own in columns].index(DURATION_PATH)
        before, after = (float(y[column]) for y in designs)
        row = AimRow("as fast as can be", before, after, "s")
        return _in_words(row, f"fastest motion found: {row.after}", kept)
    if (paid := cost(scene, found.best.y)) is not None:
        one = "1 Hz" if aim == "highest" else "1 % of room"
        kept += f"; its price, {priced(paid)}, counts against it, 1 as {one}"
    if aim == "highest":
        (asked,) = (one for one in wanted if one.is_aim)
        before, after = (_least(found, asked, y) for y in designs)
        row, where = AimRow(asked.label, before, after, "Hz"), ""
        if asked.trajectory:
            where = f" along {asked.trajectory!r}"
        if (too_high := of_model[asked.mode]) > WITHIN:
            kept += f"; mesh and reduced links raise it {raised_by(too_high)}"
        return _in_words(row, f"mode {asked.mode} is at least {row.after}{where}", kept)
    if aim == "widest":
        before, after = (min(_rooms(found, wanted, y)) for y in designs)
        row = AimRow("bands and gaps as wide as can be", before, after, "")
        return _in_words(row, f"nearest band or gap: {row.after} room", kept)
    return None


def _in_words(row: AimRow, reached: str, kept: str) -> AimRow:
    return replace(row, words=f"{reached} (initially {row.before}{kept}")


def _least(found: Found, asked: Requirement, y: Floats) -> float:
    """The least of a curve, or the least room of a gap, of a design and of its scenarios."""
    model, path = found.task.scene.model, found.task.scene.path
    return min(lowest_room(model, asked, path, one).room for one in found.task.designs(y))


def _rooms(found: Found, wanted: Sequence[Requirement], y: Floats) -> Iterator[float]:
    """Yield the room at every gap and band, relative; of the answer's bands as it was checked."""
    model, path = found.task.scene.model, found.task.scene.path
    yield from (_least(found, gap, y) for gap in wanted if isinstance(gap, ModeGap))
    if not np.array_equal(y, found.best.y):
        yield from (-float(errors.min()) for errors in lacking(found.task, y))
        return
    for one in found.task.designs(y):
        for band, row in zip(found.task.bands, found.clearances, strict=True):
            judged = band, row.below, one, found.task.followers, row.raised, WITHIN
            yield check_band(model, path, *judged).room if row.clear else row.room


MOST_CHOICES = 60  # searches to say whether some limits can be met together
MOST = 12  # limits of which the smallest contradiction is looked for
# Steps of a search that nobody has asked to end sooner: of 20 runs 19 took at most 15, one 32
ENOUGH = 100
WITHOUT = 1e-9  # of the largest: a singular value of the slopes that is none
SAME = 1e-9  # of the merit: a design this little worse is as good


# --- Contradictions


class Conflict(NamedTuple):
    """Limits that no design was found to meet together; without any one of them there is one.

    ``smallest`` is False where there are so many that only those missed here are named. Of limits
    that are linear in the design no search misses a design.
    """

    names: tuple[str, ...]
    smallest: bool
    is_linear: bool = False


def conflict(found: Found, steps: int, of_design: Sequence[LimitedQuantity]) -> Conflict | None:
    """What contradicts where the best design misses limits; None where it meets them.

    Each trial starts at the compromise, for every choice that nothing excludes. Of a search that
    was ended, or that left out some choices, nothing but limits that need no frequency can be said
    to contradict.
    """
    best, asked = found.best, found.variant.requirements
    if best.seen.violation <= MET:
        return None
    owners = [asked.owner(int(k))[0] for k in np.flatnonzero(best.seen.excess > MET)]
    missed = tuple(dict.fromkeys(owners))
    names, steps = found.variant.limit_names, max(steps, ENOUGH)
    open_ = found.untried or best.end in (End.SECONDS, End.STEPS, End.INTERRUPTED)
    if open_:
        names = tuple(one.name for one in of_design if one.name in names)
    elif len(names) > MOST:
        return Conflict(missed, False)
    answers: list[bool | None] = []

    def contradict(rest: Sequence[str]) -> bool:
        met = not rest or can_be_met(found, rest, MOST_CHOICES, steps)
        answers.append(met)
        return met is False

    if open_ and not contradict(names):
        return None
    needed = smallest(names, contradict)
    if None in answers:
        return Conflict(missed, False)
    linear = {one.name for one in of_design if one.is_affine}
    return Conflict(tuple(needed), True, linear.issuperset(needed))


def extreme(scene: Scene, limit: LimitedQuantity, y: Floats) -> float | None:
    """The amount nearest to a limit that no design keeps; None if one does, of catalogues too."""
    if scene.file.design.catalogues:
        return None
    (lower, upper), n = scene.bounds, len(y)
    alone, none = Requirements((limit,), np.ones(1)), np.zeros((1, 0))
    unasked = Frequencies(none, np.zeros((1, 0, n)))
    problem = DesignProblem(lambda y: alone.appraise(y, unasked), lower, upper)
    best = minimise(problem, y, max(scene.file.assignment.steps, ENOUGH))
    return None if best.seen.violation <= MET else limit.amount(best.y)


# --- What changes nothing


def _effects(problem: DesignProblem, y: Floats, seen: Appraisal) -> Floats:
    """Slopes at y of all that is asked per width of the bounds, a column for each parameter."""
    width = problem.upper - problem.lower
    cost = () if problem.cost is None else (problem.cost_slopes(y),)
    return np.vstack([seen.slopes, seen.excess_slopes, *cost]) * width


def _null_space(J: Floats) -> Floats:
    """Orthonormal directions (n, k) that change nothing."""
    if not J.size:
        return np.zeros((J.shape[1], 0))
    _, s, V = np.linalg.svd(J, full_matrices=len(J) < J.shape[1])
    rank = int((s > WITHOUT * s[0]).sum())
    return np.asarray(V[rank:].T)


def least_changed(found: Found, initial: Floats) -> Found:
    """The answer with undetermined directions pulled back to the initial design."""
    problem, best = found.variant.problem, found.best
    settled = found.are_listed or found.variant.requirements.least_change is not None
    if settled or found.clearances:  # a band is checked at this very design
        return found
    free = np.flatnonzero(problem.upper > problem.lower)
    width = (problem.upper - problem.lower)[free]
    N = _null_space(_effects(problem, best.y, best.seen)[:, free])
    d = np.zeros(len(best.y))
    d[free] = width * (N @ (N.T @ ((initial - best.y)[free] / width)))
    if np.abs(d[free] / width).max(initial=0.0) <= SAME:
        return found
    y = np.clip(best.y + d, problem.lower, problem.upper)
    for row in problem.constraints:
        if not row.lower - 1e-12 <= row.coefficients @ y <= row.upper + 1e-12:
            return found
    try:
        seen = problem.appraise(y)
    except EigassignError:
        return found
    value = problem(y, seen)
    limit = best.objective + SAME * abs(best.objective) + 1e-20
    if value > limit or seen.violation > max(best.seen.violation * (1.0 + SAME), MET):
        return found
    left, limits = first_order(problem, y, seen)
    moved = best._replace(y=y, seen=seen, objective=value, stationarity=left, limits=limits)
    return replace(found, optima=(moved, *found.optima[1:]))
