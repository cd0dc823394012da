"""From a case's targets to its answer: the paper's one shot, and the optimum of the exact problem.

The one shot is always made where all that is asked is wanted frequencies within bounds, lists and
linear constraints; it is the answer of `method: one_shot`, and a start of the sequential method
otherwise.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.assign import Assignment
from eigassign.assignment.exact.design_problem import MET
from eigassign.assignment.exact.sequential import End
from eigassign.assignment.targets import hz_from_lam
from eigassign.case.case_file import CaseFile
from eigassign.errors import AccuracyError, InfeasibleError
from eigassign.study.accuracy import model_error
from eigassign.study.design.clearance import Clearance
from eigassign.study.design.conclusions import (
    Conflict,
    conflict,
    idle_notes,
    is_proved,
    least_changed,
)
from eigassign.study.design.judgement import verdict
from eigassign.study.design.one_shot import assign_design, catalogues
from eigassign.study.design.optimum import Found, find_optimum
from eigassign.study.design.variants import MASS, Task, variant_of
from eigassign.study.requirements.requirement import Requirement
from eigassign.study.results import (
    ActiveRow,
    AssignmentRow,
    CatalogueRow,
    ClearanceRow,
    CombinationRow,
    LocalOptimum,
    OptimalityRow,
    StepRow,
    TargetStudy,
)
from eigassign.study.scene import Scene

Floats = NDArray[np.float64]
MAX_ERROR = 0.02  # of a wanted frequency, where the case says nothing


def require_assignable(file: CaseFile) -> None:
    """Raise CaseError naming every key that an assignment needs and the case lacks."""
    needs = {
        "trajectory": (file.trajectory is not None, "along which the frequencies are assigned"),
        "design": (bool(file.design.parameters), "at least one parameter that may change"),
        "targets": (bool(file.targets), "at least one target"),
    }
    file.require("optimize", needs)


@dataclass(frozen=True)
class Answer:
    """The design to be verified, and how it was found.

    ``predicted`` has for each target what the model said of it before the last step, (n,) in Hz;
    None of limits. ``one_shot`` is the paper's answer where it could be had.
    """

    y: Floats
    predicted: tuple[Floats | None, ...]
    one_shot: Assignment | None
    found: Found | None
    notes: tuple[str, ...]
    conflict: Conflict | None = None

    @property
    def modes(self) -> int:
        """The highest mode that the targets need; 1 of the one shot, whose modes are expanded."""
        return 1 if self.found is None else self.found.variant.requirements.modes


def find_answer(
    scene: Scene, wanted: Sequence[Requirement], progress: Callable[[str], None]
) -> Answer:
    """The design asked for by the case's method.

    Under `method: one_shot` raises InfeasibleError where bounds, lists and linear constraints
    contradict each other, AccuracyError where it cannot be vouched for.
    """
    sequential = scene.file.assignment.method == "sequential"
    one_shot, notes = None, []
    plain = all(one.is_goal and one.followed is None for one in wanted)
    if wanted and plain and scene.file.design.mass is None:  # eqs. (13)–(14) take all of it
        try:
            one_shot = assign_design(scene, wanted)
        except (AccuracyError, InfeasibleError) as error:
            if not sequential:
                raise
            notes.append(f"no one-shot design: {error}")
    if not sequential:
        if one_shot is None:
            raise AccuracyError("the one-shot program has no answer")
        lam = tuple(hz_from_lam(values) for values in one_shot.lam)
        return Answer(one_shot.y, lam, one_shot, None, tuple(notes))
    starts = []
    if one_shot is not None:  # of catalogues the best few combinations
        search = one_shot.search
        starts = [one_shot.y] if search is None else [one.y for one in search.best]
    found = least_changed(find_optimum(scene, wanted, starts, progress), scene.initial)
    contradiction = conflict(found, catalogues(scene.file), scene.file.assignment.steps)
    notes += idle_notes(scene.model.y_names, found.variant, found.best.seen)
    notes += _band_notes(found)
    if found.lost:
        notes.append(f"{len(found.lost)} designs were passed over, for {found.lost[-1]}")
    predicted = tuple(_predicted(found, wanted))
    return Answer(found.best.y, predicted, one_shot, found, tuple(notes), contradiction)


def _band_notes(found: Found) -> Iterator[str]:
    """Say what came of each number of modes below the bands, where there was a choice."""
    for one in found.variants if len(found.variants) > 1 else ():
        choice = ", ".join(f"{band} with {k} below it" for band, k in one.variant.below)
        best, missed = one.optima[0], one.optima[0].seen.violation
        how = f"missed by {100 * missed:.2g} %" if missed > MET else f"met at {best.objective:.6g}"
        yield f"{choice}: {how}"


def _in_words(
    scene: Scene, wanted: Sequence[Requirement], contradiction: Conflict | None, proved: bool
) -> str:
    """Name the limits that contradict, with their lines in the case file; empty where none do."""
    if contradiction is None:
        return ""
    file = scene.file
    places = {w.label: w.place for w in wanted} | {MASS: MASS}
    places |= {name: f"design.constraints.{name}" for name in file.design.constraints}
    lines = (file.problem(places[name], "").line for name in contradiction.names)
    listed = " and ".join(
        f"{'the limit of the mass' if name == MASS else name} (line {line})"
        for name, line in zip(contradiction.names, lines, strict=True)
    )
    meets = "meets" if proved else "was found that meets"
    if not contradiction.smallest:
        return f"no design {meets} all limits; the nearest one misses {listed}"
    together = " together" if len(contradiction.names) > 1 else ""
    return f"no design within the bounds {meets} {listed}{together}"


def _predicted(found: Found, wanted: Sequence[Requirement]) -> Iterator[Floats | None]:
    """Frequencies that the last program promised; where no step was taken those of the design."""
    best, asked = found.best, found.variant.requirements
    residual = best.seen.residual if best.predicted is None else best.predicted
    curves = iter(asked.promised(residual))
    for one in wanted:
        yield next(curves) if one.is_goal else None


def assignment_row(
    scene: Scene,
    answer: Answer,
    wanted: Sequence[Requirement],
    targets: Sequence[TargetStudy],
    unreachable: Sequence[str] = (),
) -> AssignmentRow:
    """How the answer was found and what it is worth, as plain numbers.

    ``unreachable`` says in words which targets are out of reach within the bounds.
    """
    keys, found = scene.file.assignment, answer.found
    initial, optimal = _merits(answer, targets)
    accepted = scene.file.validation.max_error
    # The exact optimum rests on exact frequencies, the one shot on its prediction.
    trusted = found is not None or all(t.approximation_error <= accepted for t in targets)
    clearances = () if found is None else tuple(map(_clearance, found.clearances))
    optimality = _optimality(scene, answer)
    proved = optimality.kind == "proved"
    contradiction = _in_words(scene, wanted, answer.conflict, proved)
    merits = initial, optimal
    word, reason = verdict(targets, merits, trusted, unreachable, contradiction)
    unproved = [_why_unproved(row) for row in clearances if not row.clear]
    of_model = {m for one in wanted if one.of_soft_model for m in one.modes}
    raised = model_error(scene, answer.y, of_model)
    largest = MAX_ERROR if keys.max_error is None else keys.max_error
    at_stake = (t.asked.stake(t.exact_hz, raised) for t in targets)
    if word == "reached" and any(stake > largest for stake in at_stake):
        word, reason = "do_not_use", _too_coarse(raised, largest)
    if word == "reached" and unproved:
        word, reason = "do_not_use", f"not proved clear along the motion: {'; '.join(unproved)}"
    if found is not None and found.best.end in (End.SECONDS, End.STEPS, End.INTERRUPTED):
        reason = f"{reason}; unfinished: {found.best.end.value}"
    return AssignmentRow(
        method=keys.method,
        objective=keys.objective,
        objective_initial=initial[1],
        objective_optimal=optimal[1],
        optimality=optimality,
        verdict=word,
        reason=reason,
        steps=()
        if found is None
        else tuple(
            StepRow(step.y, step.objective, step.violation, step.radius, bool(step.taken))
            for step in found.best.steps
        ),
        starts=0 if found is None else found.starts,
        local_optima=()
        if found is None
        else tuple(LocalOptimum(o.y, o.objective, o.seen.violation) for o in found.optima),
        exact_solves=0 if found is None else found.exact_solves,
        ended="one program" if found is None else found.best.end.value,
        finished=found is None or found.best.end in (End.OPTIMAL, End.STALLED),
        active=tuple(active_rows(scene, answer)),
        one_shot=None if answer.one_shot is None else answer.one_shot.y,
        max_error=largest,
        max_error_given=keys.max_error is not None,
        clearances=clearances,
        model_error=raised if np.isfinite(raised) else None,
        conflict=() if answer.conflict is None else answer.conflict.names,
        catalogue=_catalogue(scene, answer, wanted),
    )


def _clearance(found: Clearance) -> ClearanceRow:
    return ClearanceRow(
        found.label,
        found.below,
        found.clear,
        found.room,
        found.counted,
        found.raised if np.isfinite(found.raised) else None,
    )


FINER = "give the links more elements, raise reduce_to, or write auto"


def _too_coarse(raised: float, accepted: float) -> str:
    how = f"by up to {100 * raised:.2g} %" if np.isfinite(raised) else "by more than can be told"
    return (
        f"mesh and reduced links raise the frequencies {how}, and {100 * accepted:.2g} % are "
        f"accepted: {FINER}"
    )


def _why_unproved(row: ClearanceRow) -> str:
    """Its label; and what to do where it is for what the model is too high by."""
    if row.raised is not None and row.room + row.raised <= 0.0:
        return row.label
    how = "not bounded" if row.raised is None else f"{100 * row.raised:.2g} % too high at most"
    return f"{row.label} (what mesh and reduced links do to the mode above it: {how}; {FINER})"


def _catalogue(scene: Scene, answer: Answer, wanted: Sequence[Requirement]) -> CatalogueRow | None:
    """The search of the catalogues; of the one shot's best few what they are exactly worth."""
    own, found, one_shot = scene.file.design.catalogues, answer.found, answer.one_shot
    if found is not None and found.chosen is not None:
        search = found.chosen.search
        of_rows = found.chosen.rows
        worth = [(o.y, o.objective, o.seen.violation) for o in found.chosen.optima]
    elif found is None and one_shot is not None and one_shot.search is not None:
        search = one_shot.search
        of_rows = tuple(one.rows for one in search.best)
        exact = variant_of(Task(scene, tuple(wanted), 0.0), ()).problem
        worth = [(one.y, exact(one.y, exact.appraise(one.y)), 0.0) for one in search.best]
    else:
        return None
    best = tuple(
        CombinationRow({c.name: c.choices[k] for c, k in zip(own, rows, strict=True)}, *each)
        for rows, each in zip(of_rows, worth, strict=True)
    )
    if search is None:
        return CatalogueRow(None, None, best)
    return CatalogueRow(search.nodes, search.relative_gap, best)


def _merits(
    answer: Answer, targets: Sequence[TargetStudy]
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Violation and objective of the initial design and of the answer."""
    if answer.found is not None:
        best = answer.found.best
        return answer.found.initial, (best.seen.violation, best.objective)
    weights = np.array([target.asked.weight * target.weight_s for target in targets])
    weights = weights / weights.sum()
    before, after = (
        float(weights @ [getattr(t.error, when).rms_relative ** 2 for t in targets])
        for when in ("initial", "exact")
    )
    return (0.0, before), (0.0, after)


def _optimality(scene: Scene, answer: Answer) -> OptimalityRow:
    found, one_shot = answer.found, answer.one_shot
    if found is None:
        search = one_shot and one_shot.search
        if not search:
            return OptimalityRow("local", None, None, "the optimum of the linearised problem only")
        gap = search.relative_gap
        words = (
            f"the best of the catalogues to {100 * gap:.2g} % of the objective of the linearised "
            f"problem only, by branch and bound in {search.nodes} nodes"
        )
        return OptimalityRow("bounded", None, gap, words)
    best, chosen = found.best, found.chosen
    many = f"{found.starts} start{'s' if found.starts > 1 else ''}"
    if chosen is not None and chosen.search is not None:
        gap = chosen.search.relative_gap
        better = f"better by more than {100 * gap:.2g} % of the objective" if gap else "better"
        words = (
            f"the best combination of the catalogues, by branch and bound in {chosen.search.nodes} "
            f"nodes: none is {better}, if the optima of the relaxed problems (the first from "
            f"{many}) are global"
        )
        return OptimalityRow("bounded", best.stationarity, gap, words)
    if chosen is None and is_proved(scene, found):
        met = best.seen.violation <= MET
        words = "the problem is convex: " + (
            "no design is better" if met else "no design meets all limits, or misses them by less"
        )
        return OptimalityRow("proved", best.stationarity, None, words)
    count = len(found.optima)
    which = f"best of {count} local optima" if count > 1 else "only local optimum"
    words = f"the {which} from {many}"
    if best.end is not End.OPTIMAL:
        words = f"{words}; {best.end.value}"
    return OptimalityRow("local", best.stationarity, None, words)


def active_rows(scene: Scene, answer: Answer) -> Iterator[ActiveRow]:
    """The limits that the answer lies on; of the one shot with the multipliers of its program."""
    found = answer.found
    if found is None:
        for one in () if answer.one_shot is None else answer.one_shot.active:
            yield ActiveRow(one.name, one.kind, one.side, one.multiplier)
        return
    names = tuple(scene.file.design.parameters)
    constraints = tuple(scene.file.design.constraints)
    for limit in found.best.limits:
        side = "upper" if limit.upper else "lower"
        if limit.kind == "bound":
            yield ActiveRow(names[limit.index], "bound", side, limit.multiplier)
        elif limit.kind == "constraint":
            yield ActiveRow(constraints[limit.index], "constraint", side, limit.multiplier)
    asked = found.variant.requirements
    shares: dict[tuple[str, str], float] = {}
    for limit in found.best.limits:
        if limit.kind == "excess":
            own = asked.owner(limit.index)
            shares[own] = shares.get(own, 0.0) + limit.multiplier
    for (name, side), multiplier in shares.items():
        yield ActiveRow(name, "target", side, multiplier)


def limit_notes(answer: Answer, row: AssignmentRow, missed: Collection[str]) -> list[str]:
    """What holds the answer back, and what the one shot's program does not depend on.

    ``missed`` are the labels of the targets that the answer does not meet.
    """
    grouped: dict[str, list[str]] = {}
    for limit in row.active:
        on = f"lies on its {limit.side} {limit.kind} of"
        if limit.kind == "target":
            on = "misses, by as little as was found," if limit.name in missed else "just meets"
        grouped.setdefault(on, []).append(limit.name)
    notes = [f"the optimum {on} {', '.join(dict.fromkeys(n))}" for on, n in grouped.items()]
    if answer.found is None and answer.one_shot is not None and answer.one_shot.undetermined:
        notes.append(
            f"{answer.one_shot.undetermined} direction(s) of the design change no target: there "
            "the initial design is kept as nearly as the limits allow"
        )
    return notes
