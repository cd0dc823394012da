"""From a case's targets to its answer: the paper's one shot, and the optimum of the exact problem.

The one shot is always made where all that is asked is wanted frequencies within bounds and linear
constraints; it is the answer of `method: one_shot`, and a start of the sequential method
otherwise.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

from eigassign.arrays import Floats
from eigassign.assignment.exact.design_problem import MET, ON
from eigassign.assignment.exact.sequential import End
from eigassign.assignment.one_shot import Assignment, LinearModel, hz_from_lam, solve_assignment
from eigassign.assignment.requirements.sampling import time_weights
from eigassign.brief import counted
from eigassign.case.case_file import CaseFile
from eigassign.errors import AccuracyError, EigassignError
from eigassign.study.design.clearance import finer_path
from eigassign.study.design.conclusions import Conflict, conflict, least_changed
from eigassign.study.design.robust import robust_optimum
from eigassign.study.design.search.lobes import basins, fastest
from eigassign.study.design.search.optimum import Found, deadline_of, find_optimum
from eigassign.study.results import RobustRow, SolverRow
from eigassign.study.scene import Scene

Progress = Callable[[str], None]
SAID = 5  # choices of the numbers of modes below the bands whose outcome is told
FINER = 6  # times that instants between samples are added: cases that could be met took up to 2
MAX_ERROR = 0.02  # of a wanted frequency, where the case says nothing


def require_assignable(file: CaseFile) -> None:
    """Raise CaseError naming every key that an assignment needs and the case lacks."""
    needs = {
        "trajectory": (file.trajectory is not None, "along which the frequencies are assigned"),
        "design": (bool(file.design.parameters), "at least one parameter that may change"),
        "targets": (file.has_question, "at least one target"),
    }
    file.require("optimize", needs)


class Answer(NamedTuple):
    """The design to be verified, and how it was found.

    ``scene`` has the instants between samples that were added. ``predicted`` has for each target
    what the model said of it before the last step, (n,) in Hz; None of limits. ``one_shot`` is the
    paper's answer where it could be had.
    """

    scene: Scene
    y: Floats
    predicted: tuple[Floats | None, ...]
    one_shot: Assignment | None
    found: Found | None
    notes: tuple[str, ...]
    conflict: Conflict | None = None
    robust: RobustRow | None = None

    @property
    def modes(self) -> int:
        """The highest mode that the targets need; 1 of the one shot, whose modes are expanded."""
        return 1 if self.found is None else self.found.variant.requirements.modes


def find_answer(scene: Scene, progress: Progress) -> Answer:
    """The design asked for by the case's method.

    Raises, under `method: one_shot`, InfeasibleError where bounds and linear constraints contradict
    each other, AccuracyError where it cannot be vouched for.
    """
    sequential = scene.file.assignment.method == "sequential"
    one_shot, notes = None, []
    plain = all(one.in_one_shot for one in (*scene.wanted, *scene.limits))
    if scene.wanted and plain and not scene.file.design.catalogues and scene.expanded is not None:
        try:
            one_shot = assign_design(scene)
        except EigassignError as error:  # also where its design cannot follow the path of a tip
            if not sequential:
                raise
            notes.append(f"no one-shot design: {error}")
    if not sequential:
        if one_shot is None:
            raise AccuracyError("the one-shot program has no answer")
        lam = tuple(hz_from_lam(values) for values in one_shot.lam)
        return Answer(scene, one_shot.y, lam, one_shot, None, tuple(notes))
    starts = [] if one_shot is None else [one_shot.y]
    found, robust, more = _between_samples(scene, starts, progress)
    notes += more
    finer, steps = found.task.scene, scene.file.assignment.steps
    contradiction = conflict(found, steps, finer.limits)
    notes += _choice_notes(found)
    if found.lost:
        notes.append(f"{len(found.lost)} designs were left out, the last because {found.lost[-1]}")
    predicted, y = tuple(_predicted(found)), found.best.y
    finer = replace(finer, trajectory=finer.path.lasting(y))
    return Answer(finer, y, predicted, one_shot, found, tuple(notes), contradiction, robust)


def assign_design(scene: Scene) -> Assignment:
    """Build and solve the quadratic program of eqs. (13)–(14) on the linearised expansion.

    Raises InfeasibleError with the names of the constraints that contradict each other.
    """
    file, path = scene.file, scene.path
    l0, slope = scene.expansions.linear_in_design(path)
    column = scene.expansions.column
    goals = [
        (own, LinearModel(l0[own.rows, k], slope[own.rows, k]))
        for own in scene.wanted
        for k in [column(own.mode)]
    ]
    return solve_assignment(
        goals,
        time_weights(path),
        scene.expansions.linear.y0,
        scene.initial,
        scene.bounds,
        scene.constraints,
        tuple(file.design.parameters),
    )


def solver_row(assignment: Assignment) -> SolverRow:
    """The solver's status and residuals, as plain numbers."""
    return SolverRow(
        assignment.status,
        assignment.iterations,
        assignment.primal_residual,
        assignment.dual_residual,
        assignment.gap,
    )


def _between_samples(
    scene: Scene, starts: Sequence[Floats], progress: Progress
) -> tuple[Found, RobustRow | None, list[str]]:
    """The optimum for samples, and for instants between them where its limits would be missed.

    Each optimum is looked at between the samples; where a limit that it keeps at samples is missed
    there, or what shall be high is lower, these instants are samples of one more scene, in which it
    is sought anew.
    """
    more = (progress, deadline_of(scene.file))
    (found, robust), notes = _optimum(scene, starts, *more), list[str]()
    for _ in range(FINER):
        if found.best.seen.violation > ON or found.best.end in (End.SECONDS, End.INTERRUPTED):
            break
        last = found.task.scene
        limits = [one for one in (*last.wanted, *last.followed_limits) if not one.is_goal]
        path = finer_path(last.path, last.model, limits, found.task.designs(found.best.y))
        if len(path.q) == len(last.path.q):
            break
        count = counted(len(path.q) - len(scene.path.q), "instant")
        instants = f"{count} between samples, where limits are nearest"
        notes = [f"{instants}, were looked at like samples"]
        progress(f"with {instants}")
        found, robust = _optimum(replace(last, trajectory=path), [found.best.y], *more)
    return found, robust, notes


def _optimum(
    scene: Scene, starts: Sequence[Floats], progress: Progress, deadline: float
) -> tuple[Found, RobustRow | None]:
    """The optimum at the samples, and what it costs to keep what is asked within tolerances."""
    if scene.file.assignment.robust:
        if scene.file.assignment.objective == "fastest":
            starts = [*basins(scene, starts, progress), *starts]
        return robust_optimum(scene, starts, progress, deadline)
    if scene.file.assignment.objective == "fastest":
        return fastest(scene, starts, progress, deadline), None
    found = find_optimum(scene, starts, progress, deadline=deadline)
    return least_changed(found, scene.initial), None


def _choice_notes(found: Found) -> Iterator[str]:
    """Say what came of the choices from lists and of numbers of modes below bands."""
    if found.choices > 1:
        searched = len(found.outcomes)
        excluded = found.choices - searched - found.untried
        each = ((searched, "searched"), (excluded, "excluded by bounds"))
        left = ((found.untried, "not searched: raise `starts` or `seconds`, or shorten the lists"),)
        said = ", ".join(f"{n} {what}" for n, what in (*each, *left) if n)
        of = (
            "lists" * found.are_listed,
            "how many modes are below each band" * bool(found.task.bands),
        )
        yield f"of {found.choices} choices of {' and '.join(filter(None, of))}: {said}"
    for one in found.outcomes[:SAID] if found.task.bands and len(found.outcomes) > 1 else ():
        numbers = zip(found.task.bands, one.below, strict=True)
        choice = ", ".join(f"{band.label} with {k} below it" for band, k in numbers)
        best = one.best
        value = -best.objective if found.variant.problem.is_one_sided else best.objective
        how = f"missed by {100 * one.missed:.2g} %" if one.missed > MET else f"met at {value:.6g}"
        yield f"{choice}: {how}"


def _predicted(found: Found) -> Iterator[Floats | None]:
    """Frequencies that the last program promised; where no step was taken those of the design."""
    best, asked = found.best, found.variant.requirements
    residual = best.seen.residual if best.predicted is None else best.predicted
    curves = iter(asked.promised(residual))
    for one in found.task.wanted:
        yield next(curves) if one.is_goal else None
