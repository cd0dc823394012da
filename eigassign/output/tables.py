"""The tables of a run as text: the console and the report show the same ones."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

from eigassign.case.units import handy, is_bare
from eigassign.facts import (
    OF_ROW,
    Fact,
    about,
    capital,
    fact,
    number,
    percent,
    positive_percent,
    priced,
    verdict_word,
)
from eigassign.study.results import (
    MET,
    DesignRow,
    ErrorSummary,
    LeverRow,
    LimitRow,
    RunResults,
    TargetStudy,
    ValidationRow,
    WeightRow,
    violated,
)

MOST_HELPS = 10  # properties of a mode in the table; results.json has all
SAGGING = 6  # nodes in the table; results.json has all
TONES = {"reached": "good", "improved": "fair"}  # every other verdict is bad
ANSWER = "Design", "Objective", "Distance to the target", "Limits and bands", "Input shapers"
RUNS = "runs"  # the section whose columns are runs, with cells of all kinds: all to the left
_RANGES = "label lowest_hz highest_hz error"


class Table(NamedTuple):
    """A table of finished text; the first column names the row.

    ``section`` is that of the page that it stands in.
    """

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    caption: str = ""
    section: str = "appendix"

    @property
    def numeric(self) -> tuple[bool, ...]:
        """True for each column of numbers, whatever their unit; empty cells do not count."""
        cells = ([row[k] for row in self.rows if row[k]] for k in range(len(self.columns)))
        alike = self.section != RUNS
        return tuple(alike and bool(own) and all(map(_is_number, own)) for own in cells)

    def without(self, name: str) -> Table:
        """The table without this column."""
        kept = [k for k, column in enumerate(self.columns) if column != name]
        rows = tuple(tuple(row[k] for k in kept) for row in self.rows)
        return self._replace(columns=tuple(self.columns[k] for k in kept), rows=rows)


def _is_number(cell: str) -> bool:
    try:
        float(cell.removeprefix("below ").removesuffix("ms").rstrip("s% "))
    except ValueError:
        return False
    return True


def facts_table(
    title: str, rows: Sequence[Any], names: str, caption: str = "", **headings: str
) -> Table:
    """The facts of these ``names``, each row's own; what no row has has no column.

    Numbers in the unit of their row are shown in its handy one. ``headings`` are those of facts
    that are called something else here.
    """
    kind: Any = type(rows[0]) if rows else None
    facts = {name: fact(kind, name) for name in names.split() if rows}
    cells = {k: [one.text(_value(row, k, one)) for row in rows] for k, one in facts.items()}
    shown = {name: column for name, column in cells.items() if any(column)}
    columns = tuple(headings.get(name, facts[name].column) for name in shown)
    return Table(title, columns, tuple(zip(*shown.values(), strict=True)), caption)


def _value(row: Any, name: str, one: Fact) -> Any:
    """The value of a fact in its row; None where there is nothing to have it."""
    size, found = row.handy[1] if one.unit == OF_ROW else 1.0, row
    for own in name.split("."):
        found = None if found is None else getattr(found, own)
    return found if size == 1.0 or found is None else found / size


def run_tables(results: RunResults, brief: bool = False) -> tuple[Table, ...]:
    """What there is something to show of, section by section of `_KINDS`; ``brief``: the answer."""
    made = (
        table._replace(section=section)
        for section, kinds in _KINDS.items()
        for table in kinds(results)
    )
    if not brief:
        return tuple(table for table in made if table.rows)
    return tuple(one.without("parameter") for one in made if one.rows and one.title in ANSWER)


def tone_of(results: RunResults) -> str:
    """How good the answer is, in colours: good, fair (too little room at a limit, too) or bad."""
    tone = TONES.get(results.assignment.verdict if results.assignment else "", "bad")
    if results.shortcoming is not None:
        return "bad"
    return "fair" if results.thin else tone


def helps(results: RunResults) -> Iterator[str]:
    """What would help where something is missed: properties; what limits cost."""
    met = all(target.satisfied for target in results.targets)
    if results.assignment is None or (
        met and all(one.satisfied for one in results.assignment.limits)
    ):
        return
    for mode in dict.fromkeys(row.mode for row in results.meaning.levers):
        own = [str(row) for row in results.meaning.levers if row.mode == mode][:3]
        told = re.sub(r"\b[a-z]+\.([^\s.]+)((?:\.\w+)+)", _plain, ", ".join(own))
        yield f"1 % more of what is no parameter changes {mode}: {told.replace(' -', ' −')}."
    for row in results.meaning.relaxed[:2]:
        if f"{row.before:.3g}" != f"{row.after:.3g}":
            yield f"{capital(row.words)}."


def _plain(path: re.Match[str]) -> str:
    """A property as people say it: ``length of forearm`` for ``links.forearm.length``."""
    what = path[2].replace(".", " ").replace("_", " ").replace("youngs", "Young's").strip()
    return f"{what} of {path[1]}"


def headline(results: RunResults) -> str | None:
    """Verdict, reason, worst distance and violation, least room; None if nothing was asked."""
    error, violation, row = results.error, results.violation, results.assignment
    goals = any(target.asked.is_goal for target in results.targets)
    said = [] if row is None else [f"{verdict_word(row.verdict)}: {row.reason}."]
    if error is not None and goals:
        beside = ""
        if "one shot" in _stages(results) and error.one_shot is not None:
            beside = f" (one shot: {percent(error.one_shot.max_relative)})"
        before, after = (percent(one.max_relative) for one in (error.initial, error.exact))
        distance = f"{before} before, {after} after{beside}"
        said.append(f"Worst distance to the target: {distance}, solved exactly.")
    if results.shortcoming is not None and row is not None and row.verdict in TONES:
        said.append(f"{capital(results.shortcoming)}.")
    named = None if violation is None else violation.exact_limit
    if row is not None and named is not None and named in row.reason:
        violation = None
    if violation is not None and (violation.initial or violation.exact):
        exactly = "" if goals else ", solved exactly"
        said.append(f"Worst violation of a limit: {violation.words}{exactly}.")
    near = sorted((one.room, one.closest) for one in results.targets if one.room is not None)
    if results.thin:
        tight = [
            f"{one.closest} by {percent(one.room or 0.0)}"
            if (one.room or 0.0) > MET
            else f"{one.closest} lies at its limit, as an optimum often does"
            for one in results.thin
        ]
        said.append(f"{capital('; '.join(tight))}: any deviation loses it. Ask for more, or use ")
        said[-1] += "`robust`."
    elif near and row is not None and row.verdict == "reached":
        said.append(f"Least room: {positive_percent(near[0][0])} ({near[0][1]}).")
    return " ".join(said) or None


def _design(results: RunResults) -> Iterator[Table]:
    """Parameters before and after, what each lies on, was chosen or costs; the mass."""
    row, listed = results.assignment, any(r.choice_price is not None for r in results.design)
    cost, price, caption = "costs" if listed else "change costs", results.price, ""
    constraints = [one.name for one in row.active if one.kind == "constraint"] if row else []
    if constraints:
        caption = f"The constraint {', '.join(constraints)} is active."
    if price is not None:
        caption = f"Price: {priced(price, listed)}. {caption}".strip()
    names = "name handy initial optimal lower upper lies_on chosen"
    costs = " cost" * (price is not None)
    rows = (*results.design, *filter(None, [results.mass])) if results.design else ()
    yield facts_table("Design", rows, f"{names}{costs} parameter", caption, cost=cost)
    yield _combinations(results)


def _requirements(results: RunResults) -> Iterator[Table]:
    """What is to be light, high or wide; distances to wanted frequencies; limits and bands."""
    row = results.assignment
    caption = f"Along {results.along}, also between samples that are far apart."
    if row is not None and row.robust is not None and row.objective != "lightest":
        caption += " The least of all deviations that were searched."
    aims = () if row is None or row.aim is None else (row.aim,)
    yield facts_table("Objective", aims, "label before after", caption)
    yield _errors(results)
    yield _required(results)


def _errors(results: RunResults) -> Table:
    """Distance to the wanted frequencies before, as predicted, and exact, side by side."""
    kinds = _stages(results)
    columns = ("target", "error", *kinds)
    wanted = [target for target in results.targets if target.asked.is_goal]
    summaries = [pair for target in wanted for pair in _of_target(target)]
    if 1 < len(results.trajectories) < len(wanted):
        each = ((f"all along {row.name!r}", row.error) for row in results.trajectories)
        summaries += [(label, error) for label, error in each if error is not None]
    if len(wanted) > 1 and results.error is not None:
        summaries.append(("all", results.error))
    rows = []
    for label, summary in summaries:
        errors = [getattr(summary, kind.replace(" ", "_")) for kind in kinds]
        for what, of in (("worst", "max_relative"), ("rms", "rms_relative")):
            cells = ("" if error is None else percent(getattr(error, of)) for error in errors)
            rows.append((label, what, *cells))
    caption = f"Relative to the target, along {results.along}; exact: every sample solved again."
    if len({target.asked.weight for target in wanted}) > 1:
        caption += " All: all targets, with equal weights."
    return Table("Distance to the target", columns, tuple(rows), caption)


def _required(results: RunResults) -> Table:
    """Limits and bands: met, or violated by how much, before and after; amounts; room."""
    kinds = tuple(kind for kind in _stages(results) if kind != "predicted")
    rows = []
    for target in results.targets:
        if not target.asked.is_goal and not target.asked.is_aim:
            cells = (getattr(target.error, kind.replace(" ", "_")) for kind in kinds)
            said = ("" if e is None else violated(e.max_relative) for e in cells)
            rows.append((target.label, *said, _room(target)))
    for row in () if results.assignment is None else results.assignment.limits:
        amounts = {"initial": row.initial, "exact": row.optimal}
        cells = (handy(amounts[k], row.unit, 4) if k in amounts else "" for k in kinds)
        rows.append((row.words, *cells, _room(row)))
    caption = "Violations, and the room that is left, relative to the limit."
    return Table("Limits and bands", ("limit", *kinds, "room"), tuple(rows), caption)


def _room(limit: TargetStudy | LimitRow) -> str:
    """The room to a limit that is kept."""
    if not limit.satisfied:
        return "VIOLATED"
    return "none" if limit.room is None else positive_percent(limit.room)


def _combinations(results: RunResults) -> Table:
    """The best combinations of the catalogues, solved exactly."""
    row = results.assignment
    if row is None or row.catalogue is None:
        return Table("Combinations", (), ())
    wanted = any(target.asked.is_goal for target in results.targets)
    best, caption = row.catalogue.best, f"{capital(row.optimality.words)}."
    own = {each.name: each for each in results.design}
    # of the lightest, or cheapest, the objective is the mass, or the price
    plain = results.price is not None and not wanted and not row.aim
    plain = plain or row.objective == "lightest"
    names = "error mass price violation" if plain else "error mass price objective violation"
    made = facts_table(
        "Combinations", best, names, caption, error="worst error", violation="limits"
    )
    rows = tuple(
        (str(k), *(_choice(own.get(name), choice) for name, choice in one.choices.items()), *cells)
        for k, (one, cells) in enumerate(zip(best, made.rows, strict=True), 1)
    )
    return made._replace(columns=("combination", *best[0].choices, *made.columns), rows=rows)


def _choice(row: DesignRow | None, choice: str) -> str:
    """Its name, or the value that it is in the unit of its parameter."""
    if row is None or not is_bare(choice):
        return choice
    unit, size = row.handy
    return f"{number(float(choice) / size)} {unit}".rstrip()


def _stages(results: RunResults) -> tuple[str, ...]:
    """The designs whose distance is shown; the one shot where it is not the answer itself."""
    row = results.assignment
    beside = row is not None and row.method != "one_shot" and row.one_shot is not None
    return ("initial", *(("one shot",) if beside else ()), "predicted", "exact")


def _of_target(target: TargetStudy) -> Iterator[tuple[str, ErrorSummary]]:
    """Errors along each trajectory if there are several, then in all."""
    if len(target.along) > 1:
        for one in target.along:
            yield f"{target.label} along {one.name!r}", one.error
    yield target.label, target.error


def _depends(results: RunResults) -> Iterator[Table]:
    """Slopes; what more room gains; what would help missed modes; what can be reached."""
    found = results.meaning
    caption = "How the exact frequency rises at the answer with one unit more of the parameter, "
    caption += "and in % with 1 % more: means over the samples."
    names = "parameter label slope percent_per_percent percent_per_percent_largest"
    headings = {"slope": "Hz per unit", "percent_per_percent": "% per %"}
    headings["percent_per_percent_largest"] = "% per % at most"
    yield facts_table("Sensitivity", found.sensitivity, names, caption, **headings)
    yield facts_table("Limits", found.relaxed, "words")
    seen = Counter[str]()
    helps = [row for row in found.levers if seen.update([row.mode]) or seen[row.mode] <= MOST_HELPS]
    names = "mode property percent_per_percent percent_per_percent_largest"
    caption = "By how many % the frequency rises for 1 % more of a property that is no parameter, "
    caption += "the coordinates unchanged. The most effective ones, by exact slopes."
    yield facts_table("What would help", helps, names, caption)
    caption = "All designs within the bounds, at any sample (proved)."
    if any(row.how == "bounded" for row in found.reach):
        caption += " Distances of two modes lie in between, but may not reach the ends."
    yield facts_table("Reach", found.reach, _RANGES, caption, error="least error")


def _robustness(results: RunResults) -> Iterator[Table]:
    """Bands, with the modes below each; deviations of parameters; sag under the stated weight."""
    row, weight = results.assignment, results.weight
    caption = (
        "All modes, at every sample and between samples. Room is the distance to the nearest "
        "edge, relative to the edge, after the error of the model is subtracted."
    )
    bands = () if row is None else row.clearances
    yield facts_table("Clearance", bands, "label below room raised clear", caption)
    if row is not None and (robust := row.robust) is not None:
        caption = (
            f"Missed at the worst deviation that a search found within {robust.within}, and at the "
            f"worst of {robust.draws} random ones; of what is as high or wide as can be, what it "
            "is short of the robust design's. Alone: the optimum without deviations. From alone "
            f"to robust: {robust.words}."
        )
        names = "label handy nominal robust nominal_worst worst drawn"
        yield facts_table("Robust", robust.targets, names, caption)
    if weight is not None:
        where = f"over {weight.poses} poses of the {weight.design} design"
        caption = f"The largest sag of each, {where}"
        if weight.buckling is not None:
            caption += f"; the weight is at most {percent(weight.buckling)} of the buckling load"
        far = [node for node in weight.sag if node.most][:SAGGING]
        yield facts_table("Sag under the weight", far, "node sag most", f"{caption}.")


def _responses(results: RunResults) -> Iterator[Table]:
    """The least dynamic stiffness of each response, and speeds that are free."""
    caption = f"Dynamic stiffness 1/|H|, the least at samples of {results.along} by frequency."
    yield facts_table(
        "Responses", results.responses, "name handy least at_hz at_s before real mesh", caption
    )
    caption = "No harmonic of the passing of teeth comes within f (1 ± ζ) of a mode at the samples."
    free = [one for row in results.responses for one in row.free]
    yield facts_table("Free speeds of the spindle", free, "of lowest highest", caption)


def _moves(results: RunResults) -> Iterator[Table]:
    """What moves leave, and what input shapers would."""
    caption = "The largest way after the stop; more finely: twice the modes and steps."
    names = "name handy duration residual before confirmed"
    yield facts_table("Residual vibration", results.moves, names, caption)
    for row in results.moves:
        caption = f"{row.name}: {row.advice}."
        names = "name hz zeta delay residual"
        yield facts_table("Input shapers", row.shapers, names, caption)


def _motion(results: RunResults) -> Iterator[Table]:
    """What every drive exerts: its peak, where that is, and rms, before and after."""
    rows = results.drives
    of = rows[0].of if rows else ""
    caption = f"Of {of}, along {results.along}, by rigid links; springs carry nothing."
    names = "name handy initial.peak initial.rms optimal.peak optimal.at optimal.rms limit"
    headings = {
        f"{design}.{fact}": f"{fact} {when}"
        for design, when in (("initial", "before"), ("optimal", "after"))
        for fact in ("peak", "rms")
    }
    headings["name"] = "coordinate"
    yield facts_table("What the drives carry", rows, names, caption, **headings)


def _appendix(results: RunResults) -> Iterator[Table]:
    """Worst error of both expansions, along and everywhere; the certificate of the one shot."""
    columns = ("mode", "where", "order", "Taylor", "linearised in y")
    caption = "Worst relative error of the frequency, against exact solves."
    where = {
        "over_time": f"along {results.along}, initial design",
        "everywhere": "between samples, all over the bounds, with a margin",
    }
    rows = [
        (f"mode {study.mode}", where[place], str(study.order), *map(percent, worst.values()))
        for study in results.studies
        for place, worst in study.max_relative.items()
        if worst is not None
    ]
    yield Table("Approximation", columns, tuple(rows), caption)
    solver = () if results.solver is None else (results.solver,)
    names = "status iterations primal_residual dual_residual gap"
    caption = "Residuals, computed again from the data of the scaled program."
    yield facts_table("Solver", solver, names, caption)


SECTIONS = {  # of a page, with their headings; what is in none is in the appendix
    "requirements": "Requirements",
    "design": "Design",
    "depends": "What it hangs on",
    "robustness": "Robustness",
    "responses": "Responses",
    "moves": "Residual vibration",
    "motion": "Motion",
}
_KINDS: dict[str, Callable[[RunResults], Iterator[Table]]] = {
    "design": _design,
    "requirements": _requirements,
    "depends": _depends,
    "robustness": _robustness,
    "responses": _responses,
    "moves": _moves,
    "motion": _motion,
    "appendix": _appendix,
}


def validation_table(rows: Sequence[ValidationRow]) -> Table:
    """Errors of both expansions, and whether the full one is within the case's tolerance."""
    names = "case mode where points order worst_taylor worst_linearised limit passed"
    return facts_table("Validation", rows, names, "Worst relative error of the frequency.")


def modes_table(
    frequencies_hz: Sequence[float],
    *,
    rigid_modes: int,
    where: str,
    discretisation: Sequence[float] | None = None,
    truncation: Sequence[float] | None = None,
    weight: WeightRow | None = None,
    levers: Sequence[LeverRow] = (),
    note: str = "",
) -> Table:
    """Elastic modes in Hz from 1 upwards, where they were evaluated, and the rigid modes left out.

    ``where`` is the pose and design in words; ``discretisation`` and ``truncation`` are how much
    mesh and reduced links raise each frequency, about, relative; ``weight`` is what gravity
    changes; ``levers`` what would help; ``note`` is below.
    """
    columns = {
        "mode": [str(mode) for mode, _ in enumerate(frequencies_hz, start=1)],
        "frequency [Hz]": [f"{hz:#.6g}".rstrip(".") for hz in frequencies_hz],
    }
    weighed = weight is not None and weight.gravity is not None
    for cause, errors in (("mesh", discretisation), ("reduced links", truncation)):
        if errors is not None:
            columns[f"{cause}: too high by about"] = [
                about(e, "") if math.isfinite(e) else "not known" for e in errors
            ]
    if weight is not None:
        columns["sag: changes it by" if weighed else "gravity: may change it by"] = [
            f"{100 * e:.2g} %" if math.isfinite(e) else "may buckle or fall" for e in weight.change
        ]
    if levers:
        first = {row.mode: str(row) for row in reversed(levers)}
        columns["1 % more of"] = [first[f"mode {mode}"] for mode in columns["mode"]]
    caption = f"{rigid_modes} rigid-body mode{'s' if rigid_modes != 1 else ''} not counted."
    caption += f" {capital(note)}." if note else ""
    rows = tuple(zip(*columns.values(), strict=True))
    return Table(f"Modes at {where}", tuple(columns), rows, caption)
