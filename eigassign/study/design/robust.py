"""A design that holds for every deviation within its tolerances, by cutting planes.

The optimum of the problem alone is the first. Of each thing that is asked the worst deviation is
sought, from corners of the box of tolerances and from the design itself; where it is worse than all
scenarios so far, it is one more (`assignment.exact.requirements`), and the design is sought anew.
A scenario less leaves more designs, so that each objective is a bound of that of the robust design,
as far as a search finds optima. At last random deviations are solved.

What is known by a covariance lies on an ellipsoid, |z| ≤ r (`Ellipsoid`). There the worst point of
a limit that is linear in p is p = c − r C∇g / √(∇gᵀC∇g): the search goes there, solves again, and
goes on as long as that is worse.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from time import monotonic
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eigassign.arrays import Floats, Ints
from eigassign.assignment.exact.design_problem import Appraisal, DesignProblem, Objective
from eigassign.assignment.exact.requirements import Ellipsoid
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
AGREE = 0.98  # of few designs: what is linear judges them as exact solves do
SHARES = (1.0, 0.5, 0.25, 0.1)  # of the way to the worst of what is linear
LOST_BY = 10.0  # of a limit: what stands for a deviation without modes
GAINED = 1e-7  # relative: less worse is no worse
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
    drawn, holds = look.drawn(worst)
    before_holds = alone.drawn(first)[1] if first else None  # none where some have no modes
    targets = tuple(look.rows(worst, before, drawn, nominal.best.y))
    row = RobustRow(
        scenarios=len(found.task.scenarios),
        draws=draws,
        nominal=nominal.best.y[: len(scene.file.design.chosen)],
        measured=scene.file.assignment.named_objective,
        objective_nominal=nominal.variant.problem.measure(nominal.best.seen.residual),
        objective=look.had,
        mass_nominal=scene.model.mass(nominal.best.y),
        mass=scene.model.mass(found.best.y),
        price_nominal=cost(scene, nominal.best.y),
        price=cost(scene, found.best.y),
        targets=targets,
        probability=None if holds is None else float(holds.mean()),
        judged=None if holds is None else len(holds),
        probability_nominal=None if before_holds is None else float(before_holds.mean()),
        wanted=None if holds is None else scene.file.assignment.probability,
        within=scene.deviating,
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
        self.small = self.scene.model.pencil.is_dense and not few
        self.ellipsoid = self.scene.tolerances.ellipsoid
        solved = self.small and any(rows.of.mode_terms for rows in self.edges)
        self.many = MANY if solved or self.ellipsoid is not None else 0

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

    def _most(self, rows: EdgeRows, y: Floats) -> float:
        """What is missed most at a design; infinite where it has no answer."""
        try:
            return self.worst_at(rows, y)[0]
        except EigassignError:
            return np.inf

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
        count = 0 if self.ellipsoid is None else len(self.ellipsoid.centres)
        ends = [design for e in range(count) for _, design in self.ends(e)]
        for design in (*self.corners, *ends):
            try:
                self.response(design)
            except EigassignError as why:
                found.append((self.scene.tolerances.scenario(self.y, design), why))
        return found

    def ends(self, e: int) -> list[tuple[Floats, Floats]]:
        """The ends z (n,) of the axes of an ellipsoid, with the designs (n_y,) there."""
        ball: Any = self.ellipsoid
        axes = ball.radius * np.eye(len(ball.columns))
        return [(z, ball.placed(self.y, z, e)[0]) for z in (*axes, *-axes)]

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
            starts = (corner, self.y) if (self.upper > self.lower).any() else ()
            ends = [minimise(problem, start, STEPS).y for start in starts] or [self.y]
            if (ball := self.ellipsoid) is not None:
                inner, ends = ends, []
                for start, e in itertools.product(inner, range(len(ball.centres))):
                    far = max(self.ends(e), key=lambda end: self.worst_at(rows, end[1])[0])[0]
                    ends += [self._outwards(rows, start, ball, e, z) for z in (0.0 * far, far)]
            design = max(ends, key=lambda one: self.worst_at(rows, one)[0])
            found.append(WorstDeviation(rows, *self.worst_at(rows, design)[:2], design))
        return tuple(found)

    def _outwards(
        self, rows: EdgeRows, start: Floats, ball: Ellipsoid, e: int, z: Floats
    ) -> Floats:
        """The worst design found on an ellipsoid, and at corners of the box, from a start at z."""
        best, dp = ball.placed(start, z, e)
        most = self.worst_at(rows, best)[0]
        for _ in range(STEPS):
            value, slopes = rows.at(best, self.response(best))
            missed, unit = self.missed(rows, value)
            slopes = unit[:, None] * slopes
            g = slopes[:, ball.columns] @ dp
            size = np.linalg.norm(g, axis=1)
            aside = np.where(slopes > 0.0, self.upper, self.lower) - best
            aside[:, ball.columns] = 0.0
            ahead = missed - g @ z + ball.radius * size + (slopes * aside).sum(axis=1)
            k = int(ahead.argmax())
            way = ball.radius * g[k] / (size[k] or 1.0) - z
            for share in SHARES:
                tried, turned = ball.placed(best + share * aside[k], z + share * way, e)
                if most + GAINED < (worse := self._most(rows, tried)) < np.inf:
                    best, dp, z, most = tried, turned, z + share * way, worse
                    break
            else:
                break
        return best

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

    def draw(self, rng: np.random.Generator, n: int) -> tuple[Floats, NDArray[np.bool_]]:
        """Random designs (n, n_y), of explanations by turns; and which are in the ellipsoids."""
        designs = rng.uniform(self.lower, self.upper, (n, len(self.y)))
        if (ball := self.ellipsoid) is None:
            return designs, np.ones(n, dtype=bool)
        z = rng.standard_normal((n, len(ball.columns)))
        both = enumerate(zip(designs, z, strict=True))
        found = [ball.placed(y, own, k % len(ball.centres))[0] for k, (y, own) in both]
        return np.reshape(found, designs.shape), np.linalg.norm(z, axis=1) <= ball.radius

    def drawn(self, worst: Sequence[WorstDeviation]) -> tuple[dict[str, float], Floats | None]:
        """The worst of random deviations by name; whether all limits hold in each of many, (n,).

        Frequencies of small models are solved where they have least room, other limits are linear
        about the ``worst``: where these judge few designs at all samples otherwise than exact
        solves, those are all. Where one has no answer, all is missed.
        """
        rng, first = np.random.default_rng(0), len(self.asked.residuals)
        limits = [*enumerate(worst)][first:]
        designs, inside = self.draw(rng, DRAWS)
        missed = np.array([[self._most(rows, y) for rows in self.edges] for y in designs])
        most = np.minimum(missed[inside].max(axis=0, initial=0.0), LOST_BY)
        found = [*zip(self.edges, most, strict=True)]
        holds = missed[:, first:].max(axis=1, initial=-np.inf) <= CUT
        about = [self._about(one, designs) for _, one in limits]
        agree = np.mean((np.max(about, axis=0) <= CUT) == holds) if about else 0.0
        designs, inside = self.draw(rng, self.many)
        solved = dict(self._solved(worst, designs)) if self.small and self.many else {}
        found += [
            (self.edges[k], min(own[inside].max(initial=0.0), LOST_BY)) for k, own in solved.items()
        ]
        if agree > AGREE or (limits and solved.keys() >= dict(limits).keys()):
            each = [solved[k] if k in solved else self._about(one, designs) for k, one in limits]
            holds = np.max(each, axis=0) <= CUT
        by_name = _by_name((rows.of.name, float(most)) for rows, most in found)
        counts = self.ellipsoid is not None and limits
        return by_name, np.asarray(holds, dtype=np.float64) if counts else None

    def _about(self, worst: WorstDeviation, designs: Floats) -> Floats:
        """What designs (n, n_y) miss (n,) of an edge, linear about its worst."""
        missed, _, slopes = self.worst_at(worst.rows, worst.design)
        return np.asarray(missed + (designs - worst.design) @ slopes)

    def _solved(
        self, worst: Sequence[WorstDeviation], designs: Floats
    ) -> Iterator[tuple[int, Floats]]:
        """Yield what designs (n, n_y) miss (n,) of edges of frequencies, by their number.

        By exact solves at the samples where the ``worst`` have least room.
        """
        least = sorted((-one.missed, one.sample) for one in worst if one.rows.of.mode_terms)
        at = np.array([*dict.fromkeys(sample for _, sample in least)][:AT], dtype=np.intp)
        parts = np.split(designs, range(AT_ONCE, len(designs), AT_ONCE))
        hz = np.concatenate([self._hz(part, at) for part in parts])
        for k, rows in enumerate(self.edges):
            own = np.flatnonzero((at >= rows.of.rows.start) & (at < rows.of.rows.stop))
            if (terms := rows.of.mode_terms) and len(own):
                place = at[own] - rows.of.rows.start
                curve = sum(c * hz[:, own, m - 1 if m > 0 else m] for m, c in terms)
                missed, _ = self.missed(rows, rows.scale[place] * (curve - rows.edge[place]))
                yield k, np.nan_to_num(missed.max(axis=1), nan=np.inf)

    def _hz(self, designs: Floats, at: Ints) -> Floats:
        """Frequencies (n, k, modes) of designs at some samples; NaN where one has no answer."""
        try:
            q = np.concatenate([self.scene.path.at(y)[0][at] for y in designs])
            y = np.repeat(designs, len(at), axis=0)
            hz = self.scene.model.frequencies(q, y, self.asked.modes)
        except EigassignError:
            if len(designs) == 1:
                return np.full((1, len(at), self.asked.modes), np.nan)
            return np.concatenate([self._hz(half, at) for half in np.array_split(designs, 2)])
        return hz.reshape(len(designs), len(at), -1)

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
