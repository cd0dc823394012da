"""The first screen of a report: what was asked and found, can it be trusted, what it takes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.facts import about, capital, number, percent
from eigassign.output.tables import TONES, headline, violated
from eigassign.study.results import LimitRow, RunResults, TargetStudy

Floats = NDArray[np.float64]
MOST = 8  # findings on the first screen


@dataclass(frozen=True)
class Finding:
    """One target before and after, in words, in a tone, and what else there is to say of it."""

    label: str
    before: str
    after: str
    tone: str
    more: tuple[str, ...] = ()


@dataclass(frozen=True)
class FirstScreen:
    """The first screen."""

    word: str
    tone: str  # good | fair | bad
    sentence: str  # what follows the word in the headline
    helps: tuple[str, ...]  # where a target is missed
    findings: tuple[Finding, ...]
    cost: tuple[str, ...]
    trust: tuple[str, ...]


def verdict_of(results: RunResults) -> FirstScreen | None:
    """The verdict of a run; None where nothing was asked for."""
    row = results.assignment
    if row is None:
        return None
    aim, tone = row.aim, TONES.get(row.verdict, "bad")
    findings = [] if aim is None else [Finding(capital(aim.label), aim.before, aim.after, tone)]
    targets = (target for target in results.targets if not target.asked.is_aim)
    word, _, sentence = (headline(results) or "").partition(": ")
    static = {one.name for one in results.statics}
    broken = [r for r in row.limits if r.violation or r.initial_violation or r.name in static]
    findings += [*map(_kept, broken), *(_finding(target, row.max_error) for target in targets)]
    return FirstScreen(
        word=word,
        tone=tone if row.shortcoming is None else "bad",
        sentence=sentence,
        helps=tuple(_helps(results)),
        findings=tuple(findings[:MOST]),
        cost=tuple(_cost(results)),
        trust=tuple(_trust(results)),
    )


def _helps(results: RunResults) -> Iterator[str]:
    """What would help where something is missed: what limits cost."""
    met = all(target.satisfied for target in results.targets)
    if met and all(one.satisfied for one in results.assignment.limits):  # type: ignore[union-attr]
        return
    for row in results.meaning.relaxed[:2]:
        if f"{row.before:.3g}" != f"{row.after:.3g}":
            yield f"{capital(row.words)}."


def _finding(target: TargetStudy, accepted: float) -> Finding:
    """The worst distance before and after, with the rms where that alone fell; of limits theirs."""
    both = target.error.initial, target.error.exact
    before, after = (each.max_relative for each in both)
    more = [f"{_between(target.initial_hz)} → {_between(target.exact_hz)} Hz"]
    better = after < before
    if target.asked.is_goal:
        met, accept = after <= accepted, f"{100 * accepted:.3g} % is accepted"
        said, is_ = percent(before), percent(after)
        first, last = (each.rms_relative for each in both)
        if not better and last < first:
            better, accept = True, f"{accept} at worst"
            pair = f"{percent(first)} and {said}", f"is {percent(last)} off rms, {is_} at worst"
        else:
            accept = f"{percent(first)} → {percent(last)} rms; {accept}"
            pair = said, f"is {is_} off at worst"
        more.insert(0, accept)
    else:
        met = target.satisfied
        pair = violated(before), f"is {violated(after)}"
        more *= len(target.asked.terms) == 1
    tone = "good" if met else "fair" if better else "bad"
    return Finding(capital(target.label), *pair, tone, tuple(more))


def _kept(limit: LimitRow) -> Finding:
    """A limit of a quantity that a design breaks, or of statics, with its amounts."""
    before, after = limit.said(limit.initial), limit.said(limit.optimal)
    tone = "good" if limit.satisfied else "bad"
    return Finding(capital(limit.words), before, f"is {after}", tone)


def _between(hz: Floats) -> str:
    """``186.9–192.6``; one number where they are alike."""
    low, high = f"{np.nanmin(hz):.4g}", f"{np.nanmax(hz):.4g}"
    return low if low == high else f"{low}–{high}"


def _trust(results: RunResults) -> Iterator[str]:
    row = results.assignment
    yield f"Frequencies solved exactly at all {results.time_s.size} samples."
    if row is None:
        return
    if row.model_error != 0.0:
        judged = results.discretisation
        few = judged is not None and judged.poses < results.time_s.size
        where = f" (checked at {judged.poses} samples)" if judged is not None and few else ""
        cause = "of mesh and reduced links" if results.reduced else "of the mesh"
        most = about(np.inf if row.model_error is None else row.model_error)
        yield f"Frequencies are too high because {cause}: {most}{where}."
    yield f"{capital(row.optimality.words)}."
    if not row.finished:
        yield "The search was ended before it was done."
    for clear in row.clearances:
        proof = "checked clear" if clear.clear else "NOT clear"
        below = f"{clear.below} mode{'' if clear.below == 1 else 's'}"
        yield f"{capital(clear.label)}: {proof}, {below} below."
    if row.robust is not None:
        yield f"What robustness costs: {row.robust.words}."


def _cost(results: RunResults) -> Iterator[str]:
    mass = results.mass
    if mass is not None:
        change = mass.optimal - mass.initial
        added = f"{change:+.4g} kg".replace("-", "−") if number(change) != "0" else "unchanged"
        yield f"Mass {number(mass.initial)} → {number(mass.optimal)} kg ({added})"
    if results.price is not None:
        listed = any(row.choice_price is not None for row in results.design)
        what = "Price" if listed else "Price of the change"
        yield f"{what} {number(results.price)}".replace("-", "−")
