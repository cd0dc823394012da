"""The first screen of a report: what was asked and found, can it be trusted, what it takes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from eigassign.output.formats import capital, percent
from eigassign.study.design.judgement import MET
from eigassign.study.results import RunResults, TargetStudy

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
    """One target before and after, in words, and whether it is met."""

    label: str
    before: str
    after: str
    met: bool


@dataclass(frozen=True)
class Verdict:
    """The first screen."""

    word: str
    tone: str  # good | fair | bad
    reason: str
    asked: tuple[str, ...]
    findings: tuple[Finding, ...]
    trust: tuple[str, ...]
    bars: tuple[Bar, ...]
    cost: tuple[str, ...]


def verdict_of(results: RunResults) -> Verdict | None:
    """That of a run; None where nothing was asked for."""
    row = results.assignment
    if row is None or results.error is None:
        return None
    misled = row.method == "one_shot" and not results.within_tolerance
    word = "do_not_use" if misled else row.verdict
    short = results.shortcoming
    return Verdict(
        word=WORDS[word],
        tone=TONES.get(word, "bad") if short is None else "bad",
        reason=_sentence(short if misled and short else row.reason),
        asked=tuple(_asked(results)),
        findings=tuple(_finding(target, row.max_error) for target in results.targets),
        trust=tuple(_trust(results)),
        bars=tuple(_bars(results)),
        cost=tuple(_cost(results)),
    )


def _sentence(text: str) -> str:
    return capital(text) if text.endswith(".") else f"{capital(text)}."


def _asked(results: RunResults) -> Iterator[str]:
    for target in results.targets:
        yield target.label
    parameters = [row.name for row in results.design]
    names = ", ".join(parameters[:4]) + (", …" if len(parameters) > 4 else "")
    yield f"by {names} within the bounds" if parameters else "with the design as it is"
    yield f"along {results.along}, {results.time_s.size} samples"
    if results.mass is not None and results.mass.upper is not None:
        yield f"mass at most {_few(results.mass.upper)} kg"


def _finding(target: TargetStudy, accepted: float) -> Finding:
    """Worst distances; of a limit by how much it is violated."""
    before, after = target.error.initial.max_relative, target.error.exact.max_relative
    if target.kind != "frequency":
        return Finding(target.label, _violated(before), _violated(after), target.satisfied)
    reached = f"{percent(after)} off at worst"
    return Finding(target.label, percent(before), reached, after <= accepted)


def _violated(worst: float) -> str:
    return "met" if worst <= MET else f"violated by {percent(worst)}"


def _trust(results: RunResults) -> Iterator[str]:
    row = results.assignment
    yield f"Exact eigenvalues at all {results.time_s.size} samples."
    if row is None:
        return
    yield _sentence(row.optimality.words)
    if not row.finished:
        yield "The search was ended before it was done."
    if row.model_error != 0.0:
        how = "not known" if row.model_error is None else f"{percent(row.model_error)} at most"
        yield f"How much mesh and reduced links raise the modes asked for: {how}."
    for clear in row.clearances:
        proof = "proved clear" if clear.clear else "NOT proved clear"
        below = f"{clear.below} mode{'' if clear.below == 1 else 's'}"
        yield f"{capital(clear.label)}: {proof}, {below} below."
    found = results.meaning.tolerance
    if found is not None:
        yield _sentence(found.words)
    count = len(results.warnings)
    if count:
        yield f"{count} warning{'s' if count > 1 else ''}, listed below."


def _bars(results: RunResults) -> Iterator[Bar]:
    for row in results.design:
        width = row.upper - row.lower or 1.0
        start, end = (
            min(max((value - row.lower) / width, 0.0), 1.0) for value in (row.initial, row.optimal)
        )
        yield Bar(
            row.name,
            _few(row.initial),
            _few(row.optimal) if row.choice is None else f"{_few(row.optimal)} ({row.choice})",
            row.unit,
            (_few(row.lower), _few(row.upper)),
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
        yield f"Price of the change {_few(results.price)}"


def _few(value: float) -> str:
    """Four digits, and 15000 rather than 1.5e+04: the tables below have more."""
    return f"{float(f'{value:.4g}') + 0.0:.7g}"
