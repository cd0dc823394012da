"""What a design does to the targets, and the verdict: one word and its reason.

In this order, the first that holds:

    infeasible     limits that need no frequency contradict
    do_not_use     numbers of the answer cannot be vouched for
    unreachable    a target is out of reach whatever the design
    infeasible     limits contradict, some of them on frequencies
    do_not_use     every target seems to be met, and that cannot be vouched for
    reached        every target is met and every limit kept, to the accuracy that is accepted; what
                   is to be light, high or wide is first-order optimal besides
    do_not_use     limits are not met
    improved       better than the initial design
    do_not_use     no better than that
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.requirements.kinds import Margin
from eigassign.assignment.requirements.requirement import Requirement, Solved
from eigassign.assignment.requirements.sampling import time_weights
from eigassign.case.case_file import CaseFile
from eigassign.case.schema.targets import FollowedMode, StaticTarget
from eigassign.facts import verdict_word
from eigassign.mechanism.trajectory.trajectory import Trajectories
from eigassign.study.results import (
    MET,
    ErrorRow,
    ErrorSummary,
    FollowedRow,
    LimitRow,
    ModeRow,
    TargetAlong,
    TargetStudy,
)

Floats = NDArray[np.float64]


class SolvedDesigns(NamedTuple):
    """Exact frequencies of the initial design, the answer and the one shot."""

    initial: Solved
    exact: Solved
    one_shot: Solved | None = None
    notes: tuple[str, ...] = ()  # why there are none of the one shot


def judged_modes(file: CaseFile, targets: Sequence[TargetStudy]) -> set[int]:
    """The modes whose error under weight counts: of statics what it does to the lowest."""
    static = any(isinstance(target, StaticTarget) for target in file.targets)
    return {mode for target in targets for mode in target.judged} | ({1} if static else set())


def study_targets(
    path: Trajectories,
    wanted: Sequence[Requirement],
    solved: SolvedDesigns,
    predicted: Sequence[Floats | None],
    max_error: float,
) -> tuple[TargetStudy, ...]:
    """Each target before and after; ``predicted`` are their curves (n,) or None.

    A wanted frequency is satisfied within ``max_error``, a limit where nothing violates it.
    """
    found, times = list[TargetStudy](), time_weights(path)
    before, after, one_shot = solved.initial, solved.exact, solved.one_shot
    for asked, curve in zip(wanted, predicted, strict=True):
        weights, rows = asked.time_weights(times), asked.rows
        errors = {
            "initial": asked.errors(before),
            "exact": asked.errors(after),
            "predicted": None if curve is None else curve / asked.hz - 1.0,
            "one_shot": None if one_shot is None else asked.errors(one_shot),
        }
        summary, near = _summary(errors, weights), asked.near(before, after)
        each = [(name, own, _summary(errors, weights, own)) for name, own in asked.along]
        followed = zip(asked.followed, asked.followed_numbers, strict=True)
        found.append(
            TargetStudy(
                asked=asked,
                time_s=path.time_s[rows],
                initial_hz=asked.curve(before),
                exact_hz=asked.curve(after),
                predicted_hz=curve,
                one_shot_hz=None if one_shot is None else asked.curve(one_shot),
                error=summary,
                satisfied=bool(summary.exact.max_relative <= (max_error if asked.is_goal else MET)),
                weight_s=float(weights.sum()),
                along=tuple(TargetAlong(*one) for one in each),
                followed=tuple(
                    FollowedRow(one.name, one.like, before.numbers[rows, k], after.numbers[rows, k])
                    for one, k in followed
                    if isinstance(one, FollowedMode)
                ),
                near=None if near is None else mode_rows(near, before, after, rows),
                room=_room(asked, after),
            )
        )
    return tuple(found)


def _room(asked: Requirement, solved: Solved) -> float | None:
    """The least relative distance to its edges at the samples; None of what has no limit."""
    if asked.is_goal or asked.is_aim:
        return None
    if asked.bands:
        beyond = [float(one.errors_by_count(solved, Margin()).min()) for one in asked.bands]
    else:
        curve = asked.curve(solved)
        beyond = [float((row.scale * (curve - row.edge)).max()) for row in asked.edge_rows()]
    return None if np.isinf(max(beyond)) else -max(beyond)


def mode_rows(
    modes: Iterable[int], before: Solved, after: Solved, rows: slice = slice(None)
) -> tuple[ModeRow, ...]:
    """Some of the modes that were solved, before and after."""
    return tuple(ModeRow(k, before.hz[rows, k - 1], after.hz[rows, k - 1]) for k in modes)


def _summary(
    errors: Mapping[str, Floats | None], weights: Floats, own: slice = slice(None)
) -> ErrorSummary:
    """The errors (n,) of one target, at some ``own`` of its samples, by the names of the rows."""
    rows: dict[str, Any] = dict.fromkeys(errors)
    for name, e in ((name, every[own]) for name, every in errors.items() if every is not None):
        rms = float(np.sqrt(weights[own] @ e**2 / weights[own].sum()))
        rows[name] = ErrorRow(float(np.abs(e).max()), rms)
    return ErrorSummary(**rows)


# --- What a colleague would ask of the initial design

# f goes with √(stiffness / mass): a tenth, or ten times, is a hundredfold of either. Targets of the
# shipped cases are 0.80 to 2.6 times what their files have.
FAR = 10.0


def far_off(asked: Requirement, hz: Floats) -> Iterator[str]:
    """Doubt a frequency, or limit, that is a decade away from all that the initial design has."""
    low, high = asked.lower.min(), asked.upper.max()
    if len(asked.mode_terms) == 1 and (hz.max() < low / FAR or hz.min() > FAR * high):
        near, edge = (hz.max(), low) if hz.max() < low else (hz.min(), high)
        off = max(near / edge, edge / near)
        yield (
            f"{asked.label}: the initial design has {near:.4g} Hz, a factor of {off:,.0f} off. "
            "Check the unit (60 rpm are 1 Hz), the mode, stiffnesses and masses"
        )


# --- The verdict

IMPROVED = 0.01  # of the merit of the start
GAINED = 1e-9  # of what is to be light, high or wide: less is round-off


class Facts(NamedTuple):
    """What the verdict rests on.

    ``merits`` are (violation, objective) of the initial design and of the answer. ``doubts`` say
    why numbers cannot be vouched for, ``unproved`` what cannot be said to be met though it seems
    so; ``unreachable`` which targets are out of reach; ``deviated`` what is met, and not by all
    deviations, ``robust`` what these lie in and with which probability; ``conflict`` which limits
    contradict, ``of_frequencies`` whether some of these are on frequencies, and ``held`` which
    bounds the answer lies on;
    ``unfinished`` how a search was ended before it was done. ``max_error`` is the largest error
    accepted where the case says it. ``aim`` says what an objective that is no error has come to,
    and ``is_optimal`` whether that is first-order optimal; ``met`` what is said without one.
    """

    targets: Sequence[TargetStudy]
    merits: tuple[tuple[float, float], tuple[float, float]]
    limits: Sequence[LimitRow] = ()
    doubts: Sequence[str] = ()
    unproved: Sequence[str] = ()
    unreachable: Sequence[str] = ()
    deviated: Sequence[str] = ()
    robust: str = ""
    conflict: str = ""
    held: str = ""
    of_frequencies: bool = True
    unfinished: str = ""
    max_error: float | None = None
    aim: str = ""
    met: str = "every target is met"
    is_optimal: bool = True


class Verdict(NamedTuple):
    """The word, why in a sentence, and why this is no answer to build on; None if it is."""

    word: str
    reason: str
    shortcoming: str | None


def verdict(facts: Facts) -> Verdict:
    """The verdict of these facts."""
    word, reason = _word(facts)
    if facts.unfinished:
        reason = f"{reason}; unfinished: {facts.unfinished}"
    return Verdict(word, reason, _shortcoming(facts, word, reason))


def _word(facts: Facts) -> tuple[str, str]:
    missed = [target for target in facts.targets if not target.satisfied]
    broken = [row.stated for row in facts.limits if not row.satisfied]
    broken += facts.deviated
    if facts.conflict and not facts.of_frequencies:
        return "infeasible", _beside(facts.conflict, broken)
    if facts.doubts:
        return "do_not_use", "; ".join(facts.doubts)
    missed.sort(key=lambda one: (one.asked.is_goal, -one.error.exact.max_relative))
    worst = next(iter(missed), None)  # limits decide before what is wanted
    far = [*([] if worst is None else [_far(worst)]), *broken]
    if facts.unreachable:
        nearest = f"the nearest design: {'; '.join(far)}"
        return "unreachable", "; ".join([*facts.unreachable, nearest])
    if facts.conflict:
        return "infeasible", _beside(facts.conflict, far) + facts.held
    if not far:
        if facts.unproved:
            return "do_not_use", "; ".join(facts.unproved)
        if facts.is_optimal:
            checked = f", also for all deviations within {facts.robust}"
            return "reached", (facts.aim or facts.met) + checked * bool(facts.robust)
        far = [f"{facts.aim}; a better design may be near (not first-order optimal)"]
    (before_violation, before), (violation, after) = facts.merits
    gain = IMPROVED * before
    if facts.aim:  # all limits are kept: whatever is gained is one
        gain = GAINED * abs(before)
    if violation > MET:
        limits = broken if broken and (worst is None or worst.asked.is_goal) else far
        return "do_not_use", f"no design was found that meets all limits: {'; '.join(limits)}"
    if before_violation > MET or after < before - gain:
        though = "" if worst is None else _though(worst)
        return "improved", f"better than the initial design; {'; '.join(far)}{though}"
    return "do_not_use", f"no better than the initial design: {'; '.join(far)}"


def _shortcoming(facts: Facts, word: str, reason: str) -> str | None:
    if word not in ("reached", "improved"):
        return f"{verdict_word(word).lower()}: {reason}"
    wanted = [target for target in facts.targets if target.asked.is_goal] or facts.targets
    error = max((target.error.exact.max_relative for target in wanted), default=0.0)
    if facts.max_error is None or error <= facts.max_error:
        return None
    limit = f"{100 * facts.max_error:g} % of assignment.max_error"
    return f"worst error {100 * error:.3g} %, above the {limit}"


def _beside(conflict: str, far: Sequence[str]) -> str:
    """The contradiction with what is missed, whose name is not said twice."""
    missed = "; ".join(far)
    name, _, how = missed.partition(": ")
    if len(far) == 1 and how and name in conflict and conflict.count("(line ") == 1:
        return f"{conflict}: {how}"
    return f"{conflict} ({missed})" if far else conflict


def _far(target: TargetStudy) -> str:
    """Where the target ends, of a band a mode in it: ``mode 1 at 48 Hz: 45.11 Hz, 6.02 % off``."""
    asked, worst = target.asked, f"{100 * target.error.exact.max_relative:.3g} %"
    said = f"{worst} off at worst" if asked.is_goal else f"violated by {worst} at worst"
    if not asked.terms:
        mode = target.closest.partition(" clear of")[0]
        return f"{target.label}: {said}, by {mode}" if target.near else f"{target.label}: {said}"
    k = int(asked.outside(target.exact_hz, target.exact_hz).argmax())
    return f"{target.label}: {target.exact_hz[k]:.4g} Hz, {said}"


def _though(target: TargetStudy) -> str:
    """Say that the largest error has grown, where the mean one is what has fallen."""
    before, after = target.error.initial, target.error.exact
    if not target.asked.is_goal or after.max_relative <= before.max_relative:
        return ""
    fell = "" if after.rms_relative >= before.rms_relative else (
        f", while the rms error fell from {100 * before.rms_relative:.3g} to "
        f"{100 * after.rms_relative:.3g} %"
    )  # fmt: skip
    return f" (before: {100 * before.max_relative:.3g} %){fell}"
