"""The first screen of a report: what was asked and found, can it be trusted, what it takes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eigassign.facts import capital, percent
from eigassign.output.tables import violated
from eigassign.study.results import LimitRow, RunResults, TargetStudy

Floats = NDArray[np.float64]
TONES = {"reached": "good", "improved": "fair"}  # every other verdict is bad
WORDS = {
    "reached": "Reached",
    "improved": "Improved, not reached",
    "unreachable": "Not reachable",
    "infeasible": "Limits contradict",
    "do_not_use": "Do not use",
}


@dataclass(frozen=True)
class Bar:
    """A parameter between its bounds; places are shares of the way from lower to upper."""

    name: str
    before: str
    after: str
    unit: str
    ends: tuple[str, str]
    start: float
    end: float


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
    reason: str
    asked: tuple[str, ...]
    findings: tuple[Finding, ...]
    trust: tuple[str, ...]
    bars: tuple[Bar, ...]
    cost: tuple[str, ...]


def verdict_of(results: RunResults) -> FirstScreen | None:
    """The verdict of a run; None where nothing was asked for.

    Of more than three targets only the worst distance is told.
    """
    row = results.assignment
    if row is None:
        return None
    few = len(results.targets) <= 3
    aim, tone = row.aim, TONES.get(row.verdict, "bad")
    said = {one.mode: one.words for one in results.meaning.anatomies}
    findings = [] if aim is None else [Finding(aim.label, aim.before, aim.after, tone)]
    targets = (target for target in results.targets if not target.asked.is_aim)
    findings += [_finding(target, row.max_error, few, said) for target in targets]
    static = {one.name for one in results.statics}
    findings += [_kept(one) for one in row.limits if one.name in static or not one.satisfied]
    return FirstScreen(
        word=WORDS[row.verdict],
        tone=tone if row.shortcoming is None else "bad",
        reason=_sentence(row.reason),
        asked=tuple(_asked(results)),
        findings=tuple(findings),
        trust=tuple(_trust(results)),
        bars=tuple(_bars(results)),
        cost=tuple(_cost(results)),
    )


def _sentence(text: str) -> str:
    return capital(text) if text.endswith(".") else f"{capital(text)}."


def _asked(results: RunResults) -> Iterator[str]:
    row = results.assignment
    if row is not None and row.aim is not None:
        yield capital(row.aim.label)
    for target in (each for each in results.targets if not each.asked.is_aim):
        within = f", within {100 * row.max_error:.3g} %" if row and target.asked.is_goal else ""
        yield f"{capital(target.label)}{within}"
    yield from (capital(static.name) for static in results.statics)
    parameters = [each.name for each in results.design]
    names = ", ".join(parameters[:4]) + (", …" if len(parameters) > 4 else "")
    yield f"by {names} within the bounds" if parameters else "with the design as it is"
    yield f"along {results.along}, {results.time_s.size} samples"
    if results.mass is not None and results.mass.upper is not None:
        yield f"mass at most {_few(results.mass.upper)} kg"


def _finding(
    target: TargetStudy, accepted: float, detailed: bool, modes: Mapping[str, str]
) -> Finding:
    """Worst distances, with rms and frequencies; of a limit by how much it is violated.

    ``modes`` says what they are, by their names, where a target is missed.
    """
    start, end = target.error.initial, target.error.exact
    before, after = start.max_relative, end.max_relative
    more = [f"{_between(target.initial_hz)} → {_between(target.exact_hz)} Hz"]
    if target.asked.is_goal:
        met = after <= accepted
        said = percent(before), f"{percent(after)} off at worst"
        more.insert(0, f"{percent(start.rms_relative)} → {percent(end.rms_relative)} rms")
    else:
        met = target.satisfied
        said = violated(before), violated(after)
        more *= len(target.asked.terms) == 1
    tone = "good" if met else "fair" if after < before else "bad"
    if not met:
        own = [row.name for row in target.followed]
        own = own or [f"mode {mode}" for mode in sorted(target.judged)]
        more += [modes[name] for name in own if name in modes]
    return Finding(target.label, *said, tone, tuple(more) if detailed else ())


def _kept(limit: LimitRow) -> Finding:
    """A limit of a quantity that the answer breaks, or of statics, with its amounts."""
    before, after = (limit.said(_rounded(a)) for a in (limit.initial, limit.optimal))
    tone = "good" if limit.satisfied else "bad"
    return Finding(limit.words, before, after, tone, (limit.stated,))


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
        most = row.model_error
        how = "an unknown amount" if most is None else f"{percent(max(most, 1e-5))} at most"
        judged = results.discretisation
        few = judged is not None and judged.poses < results.time_s.size
        where = f", at {judged.poses} of them" if judged is not None and few else ""
        yield f"Mesh and reduced links put the modes asked for too high by {how}{where}."
    yield _sentence(row.optimality.words)
    if not row.finished:
        yield "The search was ended before it was done."
    for clear in row.clearances:
        proof = "checked clear" if clear.clear else "NOT clear"
        below = f"{clear.below} mode{'' if clear.below == 1 else 's'}"
        yield f"{capital(clear.label)}: {proof}, {below} below."
    if row.robust is not None:
        yield f"Robust instead of alone: {row.robust.words}."
    found = results.meaning.tolerance
    if found is not None:
        yield _sentence(found.words)
    count = len(results.warnings)
    if count:
        yield f"{count} warning{'s' if count > 1 else ''}, listed below."


def _bars(results: RunResults) -> Iterator[Bar]:
    for row in results.design:
        width = row.upper - row.lower or 1.0
        unit, size = row.handy
        start, end = (
            min(max((value - row.lower) / width, 0.0), 1.0) for value in (row.initial, row.optimal)
        )
        yield Bar(
            row.name,
            _few(row.initial / size),
            _few(row.optimal / size),
            f"{unit} ({row.chosen})" if row.chosen else unit,
            (_few(row.lower / size), _few(row.upper / size)),
            round(100.0 * start, 2),
            round(100.0 * end, 2),
        )


def _cost(results: RunResults) -> Iterator[str]:
    mass = results.mass
    if mass is not None:
        change = mass.optimal - mass.initial
        added = f"{change:+.4g} kg".replace("-", "−") if _few(change) != "0" else "unchanged"
        yield f"Mass {_few(mass.initial)} → {_few(mass.optimal)} kg ({added})"
    if results.price is not None:
        listed = any(row.choice_price is not None for row in results.design)
        what = "Price" if listed else "Price of the change"
        yield f"{what} {_few(results.price)}".replace("-", "−")


def _few(value: float) -> str:
    """Four digits, and 15000 rather than 1.5e+04: the tables below have more."""
    return f"{_rounded(value):.7g}"


def _rounded(value: float) -> float:
    return float(f"{value:.4g}") + 0.0
