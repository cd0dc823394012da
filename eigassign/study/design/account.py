"""The answer in numbers and words: the verdict, how it was found, and what holds it back."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from operator import itemgetter
from typing import Any, NamedTuple

import numpy as np

from eigassign.arrays import Floats
from eigassign.assignment.exact.design_problem import MET, ON
from eigassign.assignment.exact.sequential import OPTIMAL, PAYS, End
from eigassign.assignment.one_shot import ActiveLimit
from eigassign.assignment.requirements.requirement import Solved
from eigassign.brief import counted
from eigassign.case.units import handy
from eigassign.errors import LostModeError
from eigassign.facts import capital, priced
from eigassign.modal.residual_vibration import FINER
from eigassign.study import results
from eigassign.study.checks import (
    Accuracy,
    MotionStudy,
    finer,
    model_errors,
    motion_doubt,
    raised_by,
    weight_doubt,
)
from eigassign.study.design.answer import MAX_ERROR, Answer
from eigassign.study.design.clearance import LIMIT, check_band, lowest_room
from eigassign.study.design.conclusions import Conflict, aim_row, extreme
from eigassign.study.design.followed import Rest, followers
from eigassign.study.design.judgement import Facts, SolvedDesigns, judged_modes, verdict
from eigassign.study.design.lists import KEEP, cost
from eigassign.study.design.search.optimum import Found
from eigassign.study.scene import Scene

EQUAL = 1e-9  # of F: combinations apart by less differ by round-off
DEVIATED = 1e-3  # of a limit, by which deviations within the tolerances may miss it
CROSSED = 0.9  # of a gap, missed where both modes go through each other
CUT = (End.SECONDS, End.STEPS, End.INTERRUPTED)  # ways that a search is ended before it is done
UNTRUSTED = "the error of the expansion is above validation.max_error"


class VerifiedAssignment(NamedTuple):
    """An answer with exact frequencies before and after, and what it means."""

    answer: Answer
    targets: tuple[results.TargetStudy, ...]
    solved: SolvedDesigns
    meaning: results.Meaning
    bound: results.OptimalityRow | None = None  # what is proved of the optimum


def assignment_row(
    scene: Scene, own: VerifiedAssignment, accuracy: Accuracy, motion: MotionStudy | None
) -> results.AssignmentRow:
    """How the answer was found and what it is worth, as plain numbers."""
    keys, answer, targets = scene.file.assignment, own.answer, own.targets
    found, limits = answer.found, tuple(_limits(scene, answer.y))
    largest = MAX_ERROR if keys.max_error is None else keys.max_error
    worst = results.worst_violation(targets, limits)
    merits = _merits(answer, targets, worst)
    of_model = model_errors(scene, accuracy.mesh, answer.y, {m for t in targets for m in t.numbers})
    raised = max(of_model.values(), default=0.0)
    aim = None if found is None else aim_row(found, of_model, worst)
    deviated = tuple(_deviated(answer.robust, targets, limits, largest))
    met = all(one.satisfied for one in targets) and all(row.satisfied for row in limits)
    conflict = None if met and not deviated else _decided(scene, answer)
    costs, whole = cost(scene, answer.y), any(own.prices for own in scene.file.design.catalogues)
    paid = None if costs is None else priced(costs, whole)
    conflicting = () if conflict is None else conflict.names
    optimality = _optimality(answer, conflict, own.bound)
    coarse, undecided = _of_mesh(scene, own, of_model, largest)
    names, far = tuple(f"{name} is" for name in undecided), own.meaning.unreachable
    beyond = [why for why in far if not why.startswith(names)]
    doubts = list(_doubts(scene, own, accuracy, motion, largest))
    if not beyond and (far or undecided.keys() & conflicting):
        doubts += undecided.values()
    first_order = found is None or (found.best.stationarity <= OPTIMAL and found.ended is None)
    first_order |= keys.objective == "fastest"  # a residual has kinks; all times were looked at
    said = verdict(
        Facts(
            targets=targets,
            merits=merits,
            limits=limits,
            deviated=deviated,
            robust="" if answer.robust is None else answer.robust.checked,
            doubts=doubts,
            unproved=[*coarse, *_unproved(scene, own, largest)],
            unreachable=beyond,
            conflict=_in_words(scene, answer, conflict, optimality.kind == "proved"),
            held=_held(scene, answer),
            of_frequencies=not {row.name for row in limits}.issuperset(conflicting),
            unfinished=found.best.end.value if found is not None and found.best.end in CUT else "",
            max_error=keys.max_error,
            aim="" if aim is None else aim.words,
            met="every target is met" if paid is None else f"every target is met, price {paid}",
            is_optimal=aim is None or first_order,
        )
    )
    return results.AssignmentRow(
        method=keys.method,
        objective=keys.named_objective,
        objective_initial=merits[0][1],
        objective_optimal=merits[1][1],
        optimality=optimality,
        verdict=said.word,
        reason=said.reason,
        active=tuple(active_rows(scene, answer)),
        one_shot=None if answer.one_shot is None else answer.one_shot.y,
        max_error=largest,
        model_error=raised if np.isfinite(raised) else None,
        conflict=conflicting,
        limits=limits,
        shortcoming=said.shortcoming,
        aim=aim,
        robust=answer.robust,
        **({} if found is None else _searched(scene, found)),
    )


def _searched(scene: Scene, found: Found) -> dict[str, Any]:
    """The fields that a search has."""
    optima = (
        results.LocalOptimum(one.y, one.objective, one.seen.violation) for one in found.optima
    )
    return {
        "steps": found.best.steps,
        "starts": found.starts,
        "local_optima": tuple(optima),
        "exact_solves": found.exact_solves,
        "ended": found.best.end.value,
        "finished": found.best.end in (End.OPTIMAL, End.STALLED),
        "clearances": found.clearances,
        "catalogue": _catalogue(scene, found),
    }


def _decided(scene: Scene, answer: Answer) -> Conflict | None:
    """The limits that contradict, unless one is not decided for all designs; of lists by trial."""
    open_ = {one.name for one in scene.limits if not one.is_decided}
    settled = answer.found is not None and _is_settled(answer.found)
    found = answer.conflict
    return None if found is None or (not settled and open_.intersection(found.names)) else found


def _doubts(
    scene: Scene,
    own: VerifiedAssignment,
    accuracy: Accuracy,
    motion: MotionStudy | None,
    largest: float,
) -> Iterator[str]:
    """Say why numbers cannot be vouched for."""
    judged, accepted = judged_modes(scene.file, own.targets), scene.file.validation.max_error
    # the exact optimum rests on exact frequencies, the one shot on its prediction
    trusted = all(target.approximation_error <= accepted for target in own.targets)
    if not trusted and own.answer.found is None:
        yield UNTRUSTED
    yield from weight_doubt(scene.file, accuracy.weight.row, judged, largest)
    yield from motion_doubt(motion, judged, largest)


def _of_mesh(
    scene: Scene, own: VerifiedAssignment, of_model: Mapping[int, float], accepted: float
) -> tuple[list[str], dict[str, str]]:
    """Which target may be missed most, by as much as mesh and reduced links raise its modes."""
    exact, at_stake, undecided = own.solved.exact, [(accepted, "")], dict[str, str]()
    for target in own.targets:
        too_high = max((of_model[mode] for mode in target.numbers), default=0.0)
        for rest in followers(scene, [target.asked]) if target.followed else ():
            if isinstance(rest, Rest) and rest.needed.any():
                y = own.answer.y
                modes = set(rest.numbers(scene.path.at(y)[0][target.asked.rows], y).tolist())
                errors = model_errors(scene, None, y, modes, rest.of.held)
                too_high = max(too_high, *errors.values())
        if not too_high > 0.0 or not target.asked.terms:
            continue
        how = f"mesh and reduced links raise the frequencies {raised_by(too_high)}"
        help_, asked = capital(finer(scene.model)), target.asked
        if target.satisfied:
            stake = asked.stake(exact, too_high) if own.answer.robust is None else too_high
            if np.isfinite(too_high):
                how += f", so that it may be missed by {100 * stake:.3g} %"
            how += f"; accepted are {100 * accepted:.3g} %"
            at_stake.append((stake, f"{target.label}: {how}. {help_}"))
            continue
        lower = exact.hz / (1.0 + too_high), exact.followed / (1.0 + too_high), exact.numbers
        least = float(asked.least_errors(Solved(*lower), exact).max())
        if least <= (accepted if asked.is_goal else MET):
            missed = f"missed by {100 * target.error.exact.max_relative:.3g} %"
            undecided[target.label] = f"{target.label}: {missed}, and {how}. {help_}"
    words = max(at_stake, key=itemgetter(0))[1]
    return [words] if words else [], undecided


def _unproved(scene: Scene, own: VerifiedAssignment, largest: float) -> Iterator[str]:
    """Say what cannot be said to be met though it seems so."""
    answer, found = own.answer, own.answer.found
    designs = [answer.y] if found is None else found.task.designs(answer.y)
    yield from _missed_between(scene, designs, own.targets, largest)
    for one in scene.residuals:
        for y in designs:
            at = np.array([one.quantity.duration(y)])
            way = float(one.quantity.along(y, at, FINER)[0])
            if way > one.allowed[1] and one.violation(one.amount(y), 0.0) <= ON:
                yield f"{one.label}: {handy(way, one.unit, 4)} with twice the modes and steps"
    for y in designs:
        yield from (f"{each}: {finer(scene.model)}" for each in _too_stiff(scene, y))
    if found is not None and (bands := "; ".join(_why_unproved(scene, found))):
        yield f"not clear, as far as is checked: {bands}"


def _deviated(
    robust: results.RobustRow | None,
    targets: Sequence[results.TargetStudy],
    limits: Sequence[results.LimitRow],
    largest: float,
) -> Iterator[str]:
    """Say what the design itself meets, and some deviation does not; or too many of all do not."""
    if robust is None:
        return
    met = {one.label for one in targets if one.satisfied} | {r.words for r in limits if r.satisfied}
    far = [
        f"{one.label}: missed by {_percent(one.most)} within {robust.within}"
        for one in robust.targets
        if one.label in met and one.most > (largest if one.is_goal else DEVIATED)
    ]
    yield from far
    if robust.chance and (far or robust.is_rarer):
        yield robust.chance


def _missed_between(
    scene: Scene, designs: Sequence[Floats], targets: Sequence[results.TargetStudy], accepted: float
) -> Iterator[str]:
    """Targets missed between samples, by how much, of the answer (first) or its deviations."""
    y, own = designs[0], followers(scene, scene.wanted)
    statics = [one for one in scene.followed_limits if one.violation(one.amount(y), 0.0) <= ON]
    for one in (*(target.asked for target in targets if target.satisfied), *statics):
        try:
            rooms = (lowest_room(scene.model, one, scene.path, each, own) for each in designs)
            error = -min(low.room for low in rooms)
        except LostModeError as lost:
            yield f"{one.label} is not known between the samples: {lost}"
            continue
        if error == np.inf:
            yield f"{one.label} is not known between the samples: the tip cannot follow its path"
        elif error > (accepted if one.is_goal else LIMIT):
            help_ = "give the trajectory more samples"
            if len(one.mode_terms) > 1 and error > CROSSED:
                help_ = "its modes cross there; name them by their shapes"
            yield f"{one.label} is missed by {100 * error:.3g} % between samples: {help_}"


def _too_stiff(scene: Scene, y: Floats) -> Iterator[str]:
    """Static targets missed by finer meshes; beyond twice the elements a third more at most."""
    q = scene.path.at(y)[0]
    for one in scene.statics if scene.model.is_meshed else ():
        w, finer = (one.way.at(q[one.rows], y, each) for each in (False, True))
        missed = float((finer + np.maximum(finer - w, 0.0) / 3.0).max()) / float(one.upper[0]) - 1.0
        if one.violation(one.amount(y), 0.0) <= ON and missed > LIMIT:
            yield f"{one.label}: missed by {_percent(missed)} with twice the elements"


def _limits(scene: Scene, y: Floats) -> Iterator[results.LimitRow]:
    """The limits of quantities at the initial design and at y."""
    lower, upper = scene.bounds
    for one in scene.limits:
        before, after = one.amount(scene.initial), one.amount(y)
        reach = float(np.abs(one.slopes(y)) @ (upper - lower))
        misses = [one.violation(amount, reach, ON) for amount in (before, after)]
        kept = misses[1] == 0.0
        least = None if kept else extreme(scene, one, y)
        low, high = one.allowed
        yield results.LimitRow(
            name=one.name,
            words=one.asked_words,
            unit=one.unit,
            lower=low if np.isfinite(low) else None,
            upper=high if np.isfinite(high) else None,
            initial=before,
            optimal=after,
            satisfied=kept,
            initial_violation=misses[0],
            violation=misses[1],
            extreme=least,
            stated=one.stated(y, least),
        )


def _in_words(scene: Scene, answer: Answer, contradiction: Conflict | None, proved: bool) -> str:
    """Name the limits that contradict, with their lines in the case file; empty where none do."""
    found = answer.found
    if contradiction is None or found is None:
        return ""
    limits = {one.name: one for one in (*scene.limits, *found.variant.requirements.limits)}
    named = (limits[name] for name in contradiction.names)
    lines = ((one.in_words, scene.file.problem(one.place, "").line) for one in named)
    listed = " and ".join(f"{name} (line {line})" for name, line in lines)
    meets = "meets" if proved else "was found that meets"
    if not contradiction.smallest:
        return f"no design {meets} all limits; the nearest one misses {listed}"
    together = " together" if len(contradiction.names) > 1 else ""
    deviating = f" for all deviations within {answer.robust.within}" if answer.robust else ""
    return f"no design within the bounds {meets} {listed}{together}{deviating}"


def _held(scene: Scene, answer: Answer) -> str:
    """``; held by the lower bound of a, b``: the bounds that the nearest design lies on."""
    own = {"lower": list[str](), "upper": list[str]()}
    for row in active_rows(scene, answer):
        own[row.side] += [row.name] * (row.kind == "bound")
    told = (f"the {side} bound of {', '.join(names)}" for side, names in own.items() if names)
    listed = " and ".join(told)
    return f"; held by {listed}" if listed else ""


def _why_unproved(scene: Scene, found: Found) -> Iterator[str]:
    """Say which bands are not clear, and what the model leaves open where they are clear in it."""
    y = found.best.y
    for band, row in zip(found.task.bands, found.clearances, strict=True):
        if row.clear:
            continue
        of_model = check_band(
            scene.model, scene.path, band, row.below, y, found.task.followers, 0.0
        )
        if not of_model.clear:
            yield row.label
            continue
        how = raised_by(np.inf if row.raised is None else row.raised)
        yield (
            f"{row.label} (the model is clear by {_percent(of_model.room)}, but mesh and reduced "
            f"links raise the mode above the band {how}: {finer(scene.model)})"
        )


def _percent(share: float) -> str:
    return f"{100 * share:.2g} %"


def _catalogue(scene: Scene, found: Found) -> results.CatalogueRow | None:
    """The best combinations of the catalogues, with what each is worth."""
    own, best = scene.file.design.catalogues, list[results.CombinationRow]()
    if not own:
        return None
    for one in found.outcomes[:KEEP]:
        rows, y = zip(own, one.rows, strict=True), one.best.y
        curves = one.variant.requirements.curves(one.best.seen)
        errors = (float(each.outside(hz, hz).max()) for each, hz, _ in curves if each.is_goal)
        best.append(
            results.CombinationRow(
                choices={catalogue.name: catalogue.choices[k] for catalogue, k in rows},
                design=y,
                objective=one.best.objective,
                violation=one.best.seen.violation,
                error=max(errors, default=None),
                mass=scene.model.mass(y),
                price=cost(scene, y),
            )
        )
    gap = 0.0 if _is_settled(found) else None
    return results.CatalogueRow(found.choices - found.untried, gap, tuple(best))


def _merits(
    answer: Answer, targets: Sequence[results.TargetStudy], worst: results.ViolationRow | None
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
    missed = (0.0, 0.0) if worst is None else (worst.initial, worst.exact)
    return (missed[0], before), (missed[1], after)


def _optimality(
    answer: Answer, conflict: Conflict | None, bound: results.OptimalityRow | None
) -> results.OptimalityRow:
    """How good the optimum is known to be."""
    found = answer.found
    if found is None:
        return results.OptimalityRow(
            "local", None, None, "the optimum of the linearised problem only"
        )
    best = found.best
    if conflict is not None and conflict.is_linear:
        return results.OptimalityRow(
            "proved", best.stationarity, None, "no design meets all limits"
        )
    if found.are_listed:
        return _of_choices(found, conflict is None)
    if bound is not None and bound.kind == "proved":
        return bound
    row = results.OptimalityRow("local", best.stationarity, None, "")
    row = row if bound is None or bound.kind == "local" else bound
    words = _of_starts(found) + ("" if bound is None else f"; {bound.words}")
    if found.untried:
        words += f"; {found.untried} of {found.choices} choices were not searched"
    if best.end is not End.OPTIMAL:
        words = f"{words}; {best.end.value}"
    return replace(row, words=words)


def _of_starts(found: Found) -> str:
    """Say how many optima the starts led to, and whether more are to be expected."""
    tally = found.tally
    further = "; raise `starts` to look further" * (tally is not None and tally.unseen > PAYS)
    if found.choices > 1:
        some = f"{len(found.outcomes)} of " * (len(found.outcomes) < found.choices)
        searched = f"{some}{found.choices} choices of modes below bands"
        return f"the best of {searched}, from {counted(found.starts, 'start')}{further}"
    if tally is None or not tally.optima:
        return f"the best design that {counted(found.starts, 'start')} led to"
    which = f"best of {tally.optima} different optima" if tally.optima > 1 else "only optimum"
    return f"the {which} from {counted(tally.starts, 'start')}{further}"


def _of_choices(found: Found, can_be_met: bool) -> results.OptimalityRow:
    """What is known of the choices from catalogues, searched to the end or as far as solves go."""
    best, among = found.best, f"{found.choices} combinations of the catalogues"
    if found.task.bands:
        among = f"{found.choices} choices from the catalogues and of modes below bands"
    if _is_settled(found):
        met = best.seen.violation <= MET
        words = f"of all {among} none {'is better' if met else 'meets all limits'}"
        if not met and not found.task.bands:
            words += ", or misses them by less"
        most, others = best.objective + EQUAL * abs(best.objective), found.outcomes[1:]
        if equal := sum(o.missed <= MET and o.best.objective <= most for o in others):
            words += f"; {equal} more of the best are as good"
        return results.OptimalityRow("proved", best.stationarity, 0.0, words)
    words = f"the best found of {among}"
    if found.ended is not None:
        return results.OptimalityRow(
            "local", best.stationarity, None, f"{words}; {found.ended.value}"
        )
    if not found.is_discrete:
        starts = counted(found.starts, "start")
        words += f", the other parameters of {len(found.outcomes)} from {starts}"
    words += f"; {found.untried} were not searched" * bool(found.untried)
    words += "; others may " + ("be better" if can_be_met else "miss the limits by less")
    return results.OptimalityRow("local", best.stationarity, None, words)


def _is_settled(found: Found) -> bool:
    """True where every choice is known not to be better."""
    return found.is_discrete and not found.untried and not found.lost


def active_rows(scene: Scene, answer: Answer) -> Iterator[ActiveLimit]:
    """The limits that the answer lies on; of the one shot with the multipliers of its program."""
    found = answer.found
    if found is None:
        yield from () if answer.one_shot is None else answer.one_shot.active
        return
    constraints, asked = found.variant.problem.constraints, found.variant.requirements
    named = {
        "bound": tuple(scene.file.design.parameters),
        "constraint": tuple(one.name for one in constraints),
    }
    shares: dict[tuple[str, str], float] = {}
    for limit in found.best.limits:
        if limit.kind in named:
            side = "upper" if limit.upper else "lower"
            yield ActiveLimit(named[limit.kind][limit.index], limit.kind, side, limit.multiplier)
        elif limit.kind == "excess":
            own = asked.owner(limit.index)
            shares[own] = shares.get(own, 0.0) + limit.multiplier
    for (name, side), multiplier in shares.items():
        yield ActiveLimit(name, "target", side, multiplier)


def limit_notes(
    answer: Answer, row: results.AssignmentRow, targets: Sequence[results.TargetStudy]
) -> Iterator[str]:
    """What holds the answer back, and what the one shot's program does not depend on."""
    missed = {target.label for target in targets if not target.satisfied}
    missed |= {limit.name for limit in row.limits if not limit.satisfied}
    grouped: dict[str, list[str]] = {}
    for limit in row.active:
        on = f"lies on its {limit.side} {limit.kind} of"
        if limit.kind == "target":
            on = "misses, by the least that was found," if limit.name in missed else "just meets"
        grouped.setdefault(on, []).append(limit.name)
    yield from (f"the optimum {on} {', '.join(dict.fromkeys(n))}" for on, n in grouped.items())
    if answer.found is None and answer.one_shot is not None and answer.one_shot.undetermined:
        yield (
            f"{answer.one_shot.undetermined} direction(s) of the design change no target: along "
            "them the initial design is kept as far as the limits allow"
        )
