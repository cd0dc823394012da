"""A design that holds for every deviation within its tolerances, by cutting planes.

The optimum of the problem alone is the first. Of each thing that is asked the worst deviation is
sought, from corners of the box of tolerances and from the design itself; where it is worse than all
scenarios so far, it is one more (`assignment.exact.requirements`), and the design is sought anew.
A scenario less leaves more designs, so that each objective is a bound of that of the robust design,
as far as a search finds optima. At last random deviations are solved.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from time import monotonic
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.exact.design_problem import Appraisal, DesignProblem, Objective
from eigassign.assignment.exact.sequential import End, minimise
from eigassign.assignment.requirements.quantity import LimitedQuantity
from eigassign.assignment.requirements.requirement import EdgeRows
from eigassign.brief import counted
from eigassign.errors import AccuracyError, EigassignError
from eigassign.study.design.conclusions import least_changed
from eigassign.study.design.lists import cost
from eigassign.study.design.search.optimum import Found, find_optimum
from eigassign.study.design.search.response import box_corners
from eigassign.study.design.search.variants import variant_of
from eigassign.study.results import RobustRow, RobustTarget
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]
FEW = 5  # optima from which the next round is searched
ROUNDS = 12  # of scenarios: known cases took at most 4
STEPS = 20  # to the worst deviation: from the best corner mostly none
CUT = 1e-5  # relative: a deviation that is worse by more is a scenario
LOST = (
    "no design was found of which all deviations within the tolerances have modes ({}): give "
    "smaller tolerances, or bounds that leave more room"
)
DRAWS = 128  # random deviations, at all samples
MANY = 10_000  # more of them, of small models, at so many samples
AT = 6
AT_ONCE = 100  # of these, solved together


class WorstDeviation(NamedTuple):
    """The worst found for one edge: what is missed, at which sample, with which design."""

    rows: EdgeRows
    missed: float
    sample: int
    design: Floats


def robust_optimum(
    scene: Scene,
    starts: Sequence[Floats],
    progress: Callable[[str], None],
    deadline: float,
) -> tuple[Found, RobustRow]:
    """The best design that keeps what is asked in the box of tolerances about it, and at what cost.

    Raises AccuracyError where a deviation of an optimum has no answer.
    """
    search = (scene, starts, progress)
    scenarios: list[Floats] = []
    seen: list[tuple[Found, tuple[WorstDeviation, ...]]] = []
    near, solves = list[Floats](), 0
    for _ in range(ROUNDS):
        try:
            found = find_optimum(*search, near, scenarios, deadline)
        except EigassignError as why:
            if scenarios:
                raise AccuracyError(LOST.format(why)) from why
            raise
        found = least_changed(found, scene.initial)
        look = _Deviations(found)
        ended = found.best.end in (End.SECONDS, End.INTERRUPTED) or monotonic() > deadline
        lost = look.lost()
        if lost and ended:
            raise AccuracyError(LOST.format("the search was ended before"))
        worst = () if lost else look.worst()
        seen.append((found, worst))
        more = [sigma for sigma, _ in lost] or list(look.cuts(worst))
        solves += found.exact_solves + look.response.exact_solves
        if not more or ended:
            break
        scenarios += more
        # where a deviation has no modes, from so far away that it is the design that has some
        back = [scene.tolerances.deviated(found.best.y, -sigma)[0] for sigma, _ in lost]
        near = [np.clip(y, *scene.bounds) for y in back] or [y.y for y in found.optima[:FEW]]
        progress(f"robust: the targets are to hold for {counted(len(scenarios), 'deviation')} too")
    if lost:
        raise AccuracyError(LOST.format(lost[0][1]))
    (nominal, first), found = seen[0], replace(found, exact_solves=solves)
    alone = _Deviations(nominal, look.had)
    both = zip(alone.edges, first, strict=bool(first))  # none where some have no modes
    before = _by_name((rows.of.name, alone.worst_at(rows, one.design)[0]) for rows, one in both)
    draws = DRAWS + look.many
    progress(f"robust: {draws} random deviations")
    targets = tuple(look.rows(worst, before, look.drawn(worst), nominal.best.y))
    row = RobustRow(
        scenarios=len(found.task.scenarios),
        draws=draws,
        nominal=nominal.best.y,
        measured=scene.file.assignment.named_objective,
        objective_nominal=nominal.variant.problem.measure(nominal.best.seen.residual),
        objective=look.had,
        mass_nominal=scene.model.mass(nominal.best.y),
        mass=scene.model.mass(found.best.y),
        price_nominal=cost(scene, nominal.best.y),
        price=cost(scene, found.best.y),
        targets=targets,
    )
    return found, row


class _Deviations:
    """The deviations about an optimum, and what is missed there, relative.

    Of goals that is their error, of limits their violation, of what shall be high or wide what it
    is short of what the optimum has in all its scenarios, or of what another one ``had``.
    """

    def __init__(self, found: Found, had: float | None = None) -> None:
        self.found, self.task, self.y = found, found.task, found.best.y
        self.scene = found.task.scene
        variant = variant_of(replace(self.task, scenarios=()), found.below, missed=True)
        self.asked = replace(variant.requirements, objective=Objective.WORST_CASE)
        self.response = variant.response
        self.edges = (*self.asked.residuals, *self.asked.excesses)
        own = found.variant.problem.measure(found.best.seen.residual)
        self.had = own if had is None else had
        self.lower, self.upper = self.scene.tolerances.box(self.y)
        few = self.task.followers or self.scene.path.follows_design  # each is followed anew
        small = self.scene.model.pencil.is_dense and not few
        self.many = MANY if small and any(rows.of.mode_terms for rows in self.edges) else 0

    def missed(self, rows: EdgeRows, value: Floats) -> tuple[Floats, Floats]:
        """What is missed where rows have some values, and the slopes of that in these."""
        if rows.of.is_goal:
            return np.abs(value) / rows.of.weight, np.sign(value) / rows.of.weight
        if rows not in self.asked.residuals:
            return value, np.ones_like(value)
        unit = 1.0 if rows.edge.any() else 1.0 / abs(self.had)
        return unit * (value - self.had), np.full_like(value, unit)

    def worst_at(self, rows: EdgeRows, y: Floats) -> tuple[float, int, Floats]:
        """What is missed most at a design, the sample, and the slopes (n_y,) there."""
        value, slopes = rows.at(y, self.response(y))
        missed, unit = self.missed(rows, value)
        k = int(missed.argmax())
        return float(missed[k]), rows.of.rows.start + k, unit[k] * slopes[k]

    @cached_property
    def corners(self) -> Floats:
        """The corners (n, n_y) of the box."""
        moving = self.upper > self.lower
        sides = box_corners(int(moving.sum()))
        corners = np.repeat(self.y[None], len(sides), axis=0)
        corners[:, moving] = np.where(sides > 0.5, self.upper[moving], self.lower[moving])
        return corners

    def lost(self) -> list[tuple[Floats, EigassignError]]:
        """The scenarios of corners at which the mechanism has no modes, and why."""
        found = []
        for corner in self.corners:
            try:
                self.response(corner)
            except EigassignError as why:
                found.append((self.scene.tolerances.scenario(self.y, corner), why))
        return found

    def worst(self) -> tuple[WorstDeviation, ...]:
        """The worst found of each edge: from the worst corner, and from the design itself."""
        box, found = (self.lower, self.upper), []
        none = np.zeros(0), np.zeros((0, len(self.y)))
        for rows in self.edges:

            def appraise(y: Floats, rows: EdgeRows = rows) -> Appraisal:
                missed, _, slopes = self.worst_at(rows, y)
                return Appraisal(np.array([-missed]), -slopes[None], *none)

            problem = DesignProblem(appraise, *box, objective=Objective.LARGEST)
            corner = max(self.corners, key=lambda one: self.worst_at(rows, one)[0])
            ends = (minimise(problem, start, STEPS).y for start in (corner, self.y))
            design = max(ends, key=lambda one: self.worst_at(rows, one)[0])
            found.append(WorstDeviation(rows, *self.worst_at(rows, design)[:2], design))
        return tuple(found)

    def cuts(self, worst: Sequence[WorstDeviation]) -> Iterator[Floats]:
        """Yield the deviations that miss more than is known of the scenarios.

        Of goals, where the largest error is what is made small.
        """
        made, squared = list[Floats](), self.found.variant.problem.is_squared
        designs = self.task.designs(self.y)
        for one in worst:
            known = max(0.0, *(self.worst_at(one.rows, design)[0] for design in designs))
            if one.rows.of.is_goal:
                known = np.inf if squared else self.had / one.rows.of.weight
            sigma = self.scene.tolerances.scenario(self.y, one.design)
            if one.missed > known + CUT and not any(np.allclose(sigma, s) for s in made):
                made.append(sigma)
                yield sigma

    def drawn(self, worst: Sequence[WorstDeviation]) -> dict[str, float]:
        """The worst of random deviations by name.

        Many more of small ones are solved where the ``worst`` of what is asked of frequencies have
        least room. Raises EigassignError where one has no answer.
        """
        rng, (model, path) = np.random.default_rng(0), (self.scene.model, self.scene.path)
        designs = rng.uniform(self.lower, self.upper, (DRAWS, len(self.y)))
        found = [(rows.of.name, self.worst_at(rows, y)[0]) for y in designs for rows in self.edges]
        least = sorted((-one.missed, one.sample) for one in worst if one.rows.of.mode_terms)
        at = np.array([*dict.fromkeys(sample for _, sample in least)][:AT], dtype=np.intp)
        designs = rng.uniform(self.lower, self.upper, (self.many, len(self.y)))
        for some in np.split(designs, range(AT_ONCE, self.many, AT_ONCE)) if self.many else ():
            q = np.concatenate([path.at(y)[0][at] for y in some])
            hz = np.full((len(some), len(path.q), self.asked.modes), np.nan)
            solved = model.frequencies(q, np.repeat(some, len(at), axis=0), self.asked.modes)
            hz[:, at] = solved.reshape(len(some), len(at), -1)
            for rows in self.edges:
                if terms := rows.of.mode_terms:
                    own = sum(c * hz[:, rows.of.rows, m - 1 if m > 0 else m] for m, c in terms)
                    missed, _ = self.missed(rows, rows.scale * (own - rows.edge))
                    found.append((rows.of.name, float(np.nanmax(missed, initial=0.0))))
        return _by_name(found)

    def rows(
        self,
        worst: Sequence[WorstDeviation],
        before: Mapping[str, float],
        drawn: Mapping[str, float],
        nominal: Floats,
    ) -> Iterator[RobustTarget]:
        """Yield what deviations do to each thing that is asked, where that is worst."""
        first = self.response(nominal)
        after = _by_name((one.rows.of.name, one.missed) for one in worst)
        for name in after:
            one = max((w for w in worst if w.rows.of.name == name), key=lambda w: w.missed)
            of, k = one.rows.of, one.sample - one.rows.of.rows.start
            both = (nominal, first), (self.y, self.response(self.y))
            amounts = [float(of.value(*design)[0][k]) for design in both]
            if isinstance(of, LimitedQuantity):
                amounts = [of.amount_of(value)[0] for value in amounts]
            yield RobustTarget(
                label=of.asked_words if isinstance(of, LimitedQuantity) else name,
                unit=of.unit if isinstance(of, LimitedQuantity) else "Hz",
                is_goal=of.is_goal,
                nominal=amounts[0],
                robust=amounts[1],
                nominal_worst=before.get(name),
                worst=after[name],
                drawn=drawn[name],
            )


def _by_name(missed: Iterable[tuple[str, float]]) -> dict[str, float]:
    """The worst of each thing that is asked, 0 at least."""
    found: dict[str, float] = {}
    for name, worst in missed:
        found[name] = max(found.get(name, 0.0), worst)
    return found
