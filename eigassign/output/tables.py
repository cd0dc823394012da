"""The tables of a run as text: the console and the report show the same ones."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from eigassign.case.units import is_bare
from eigassign.facts import (
    OF_ROW,
    Fact,
    about,
    capital,
    fact,
    number,
    percent,
    positive_percent,
    seconds,
)
from eigassign.study.design.verdict import verdict_word
from eigassign.study.results import (
    MET,
    SEEN,
    Comparison,
    DesignRow,
    ErrorSummary,
    ModeAnatomy,
    RunResults,
    TargetStudy,
    ValidationRow,
    WeightRow,
)

Floats = NDArray[np.float64]
MOST_HELPS = 10  # properties of a mode in the table; results.json has all
SAGGING = 6  # nodes in the table; results.json has all
STAGES = {  # of a run, as they are named in results.json
    "model": "assembly of K and M",
    "trajectory": "trajectory",
    "expansion": "expansion of the eigenvalues",
    "assignment": "search of the design",
    "initial": "exact frequencies of the initial design",
    "verification": "exact frequencies of the optimal design",
    "comparison": "comparison of the expansion with exact",
    "meaning": "study of what the answer means",
}


@dataclass(frozen=True)
class Table:
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
        return tuple(bool(column) and all(map(_is_number, column)) for column in cells)


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


def run_tables(results: RunResults) -> tuple[Table, ...]:
    """What there is something to show of, section by section of `SECTIONS`."""
    made = (
        replace(kind(results), section=section)
        for section, kinds in _KINDS.items()
        for kind in kinds
    )
    return tuple(table for table in made if table.rows)


def headline(results: RunResults) -> str | None:
    """The verdict with its reason, then worst distance, worst violation and least room.

    None where nothing was asked for.
    """
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
    if violation is not None and (violation.initial or violation.exact or not goals):
        exactly = "" if goals else ", solved exactly"
        said.append(f"Worst violation of a limit: {violation.words}{exactly}.")
    if row is not None and row.clearances and row.verdict == "reached":
        least = min(row.clearances, key=lambda one: one.room)
        said.append(f"Least room: {positive_percent(least.room)} ({least.label}).")
    return " ".join(said) or None


def design(results: RunResults) -> Table:
    """Parameters before and after, what each lies on, was chosen or costs; the mass."""
    active = results.assignment.active if results.assignment else ()
    on = {limit.name: limit.side for limit in active if limit.kind == "bound"}
    chosen = any(row.chosen for row in results.design)
    columns = ("name", "parameter", "unit", "initial", "optimal", "lower", "upper")
    priced = results.price is not None
    listed = any(row.choice_price is not None for row in results.design)
    cost = "costs" if listed else "change costs"
    more = [name for name, shown in (("lies on", on), ("choice", chosen), (cost, priced)) if shown]
    rows = []
    for row in results.design:
        unit, size = row.handy
        values = (row.initial, row.optimal, row.lower, row.upper)
        rows.append(
            (row.name, row.parameter, unit, *(number(value / size) for value in values),
             *((on.get(row.name, ""),) if on else ()), *((row.chosen,) if chosen else ()),
             *((number(row.cost),) if priced else ()))
        )  # fmt: skip
    if (mass := results.mass) is not None:
        edges = ("" if limit is None else number(limit) for limit in (mass.lower, mass.upper))
        both = (number(mass.initial), number(mass.optimal))
        cells = ["" for _ in more]
        if mass.price is not None:
            cells[-1] = number(mass.cost)
        own = "total mass" if any(row.name == "mass" for row in results.design) else "mass"
        rows.append((own, "of all links and bodies", "kg", *both, *edges, *cells))
    constraints = [limit.name for limit in active if limit.kind == "constraint"]
    caption = f"The constraint {', '.join(constraints)} is active." if constraints else ""
    if results.price is not None:
        what = "It" if listed else "The change"
        caption = f"{what} costs {number(results.price)} in all. {caption}".strip()
    return Table("Design", (*columns, *more), tuple(rows), caption)


def objective(results: RunResults) -> Table:
    """What is to be light, high or wide, before and after."""
    row = results.assignment
    caption = f"Along {results.along}, also between samples that are far apart."
    if row is not None and row.robust is not None and row.objective != "lightest":
        caption += " The least of all deviations that were searched."
    rows = () if row is None or row.aim is None else (row.aim,)
    return facts_table("Objective", rows, "label before after", caption)


def _by_name(results: RunResults, y: Floats) -> Iterator[str]:
    """The values of a design in these units."""
    for row, value in zip(results.design, y, strict=True):
        yield number(float(value) / row.handy[1])


def _named(results: RunResults) -> Iterator[str]:
    """The parameters with these units: ``wall [mm]``."""
    for row in results.design:
        unit = row.handy[0]
        yield f"{row.name} [{unit}]" if unit else row.name


def errors(results: RunResults) -> Table:
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
    caption = "Frequency against its target in Hz, relative to the target, along "
    caption += f"{results.along}; predicted by the expansion, exact by solving every sample again."
    if len({target.asked.weight for target in wanted}) > 1:
        caption += " All: all targets, with equal weights."
    return Table("Distance to the target", columns, tuple(rows), caption)


def required(results: RunResults) -> Table:
    """Limits and bands: met, or violated by how much at worst, before and after; amounts."""
    kinds = tuple(kind for kind in _stages(results) if kind != "predicted")
    rows = []
    for target in results.targets:
        if not target.asked.is_goal and not target.asked.is_aim:
            cells = (getattr(target.error, kind.replace(" ", "_")) for kind in kinds)
            said = ("" if e is None else violated(e.max_relative) for e in cells)
            rows.append((target.label, *said, _met(target.satisfied)))
    for row in () if results.assignment is None else results.assignment.limits:
        amounts = {"initial": row.initial, "exact": row.optimal}
        cells = (row.said(amounts[k]) if k in amounts else "" for k in kinds)
        rows.append((row.words, *cells, _met(row.satisfied)))
    caption = f"Violations are relative to the limit, along {results.along}."
    return Table("Limits and bands", ("limit", *kinds, "verdict"), tuple(rows), caption)


def drives(results: RunResults) -> Table:
    """What every drive exerts: its peak, where that is, and rms, before and after."""
    rows = results.drives
    of = rows[0].of if rows else ""
    caption = f"Of {of}, along {results.along}, by rigid links; springs carry nothing."
    names = "name handy initial.peak initial.rms optimal.peak optimal.at optimal.rms"
    headings = {
        f"{design}.{fact}": f"{fact} {when}"
        for design, when in (("initial", "before"), ("optimal", "after"))
        for fact in ("peak", "rms")
    }
    return facts_table(
        "What the drives carry", rows, f"{names} limit", caption, name="coordinate", **headings
    )


def anatomy(results: RunResults) -> Table:
    """The parts that modes of missed targets have their energies in."""
    each = (row for one in results.meaning.anatomies for row in one.parts)
    rows = [row for row in each if 100.0 * max(abs(row.strain), row.kinetic) > SEEN]
    names = "mode part strain strain_largest kinetic kinetic_largest"
    caption = "Shares of the energies of missed modes, for the answer: mean over the samples, and "
    caption += "the largest. The weight has a negative share of strain where it softens."
    return facts_table("What the missed modes are", rows, names, caption)


def helps(results: RunResults) -> Table:
    """What properties that are no parameters do to the modes of missed targets."""
    rows = [row for one in results.meaning.anatomies for row in one.properties[:MOST_HELPS]]
    names = "mode property percent_per_percent percent_per_percent_largest"
    caption = "By how many % the frequency rises for 1 % more of a property that is no parameter, "
    caption += "the coordinates unchanged. The most effective ones, by exact slopes."
    return facts_table("What would help", rows, names, caption)


def _met(satisfied: bool) -> str:
    return "met" if satisfied else "VIOLATED"


def violated(worst: float) -> str:
    """``violated by 1.55 %``; ``met`` where no more than round-off is left."""
    return f"violated by {percent(worst)}" if worst > MET else "met"


def clearances(results: RunResults) -> Table:
    """Bands to keep out of: how many modes are below each, and whether that was checked."""
    rows = results.assignment.clearances if results.assignment else ()
    caption = (
        "All modes, at every sample and between samples. Room is the distance to the nearest "
        "edge, relative to the edge, after the error of the model is subtracted."
    )
    return facts_table("Clearance", rows, "label below room raised clear", caption)


def combinations(results: RunResults) -> Table:
    """The best combinations of the catalogues, solved exactly."""
    row = results.assignment
    if row is None or row.catalogue is None:
        return Table("Combinations", (), ())
    wanted = any(target.asked.is_goal for target in results.targets)
    best = row.catalogue.best
    own = {each.name: each for each in results.design}
    facts: dict[str, tuple[str, Callable[[float], str]]] = {
        "worst error": ("error", percent),
        "mass [kg]": ("mass", number),
        "price": ("price", number),
        "objective": ("objective", number),
    }
    if row.objective == "lightest" or (results.price is not None and not wanted and not row.aim):
        del facts["objective"]  # which is the mass, or the price
    shown = {name: fact for name, fact in facts.items() if getattr(best[0], fact[0]) is not None}
    rows = tuple(
        (str(k), *(_choice(own.get(name), choice) for name, choice in one.choices.items()),
         *(said(getattr(one, fact)) for fact, said in shown.values()), violated(one.violation))
        for k, one in enumerate(best, 1)
    )  # fmt: skip
    columns = ("combination", *best[0].choices, *shown, "limits")
    return Table("Combinations", columns, rows, f"{capital(row.optimality.words)}.")


def _choice(row: DesignRow | None, choice: str) -> str:
    """Its name, or the value that it is in the unit of its parameter."""
    if row is None or not is_bare(choice):
        return choice
    unit, size = row.handy
    return f"{number(float(choice) / size)} {unit}".rstrip()


def optima(results: RunResults) -> Table:
    """The distinct local optima, the best first; none of a single one."""
    row = results.assignment
    columns = ("optimum", "objective", "violation", *_named(results))
    if row is None or row.catalogue is not None or len(row.local_optima) < 2:
        return Table("Local optima", columns, ())
    rows = tuple(
        (str(k), number(each.objective), positive_percent(each.violation),
         *_by_name(results, each.design))
        for k, each in enumerate(row.local_optima, 1)
    )  # fmt: skip
    caption = f"Found from {row.starts} starts; the first is the answer."
    if results.price is not None and row.objective != "lightest":
        caption += " Objectives include prices."
    return Table("Local optima", columns, rows, caption)


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


def sensitivity(results: RunResults) -> Table:
    """Slopes of the targeted frequencies at the answer."""
    columns = ("parameter", "target", "Hz per unit", "unit", "% per %", "% per % at most")
    units = {row.name: row.handy for row in results.design}
    rows = []
    for row in results.meaning.sensitivity:
        unit, size = units.get(row.parameter, (row.unit, 1.0))
        shares = (row.percent_per_percent, row.percent_per_percent_largest)
        rows.append(
            (row.parameter, row.label, f"{row.hz_per_unit * size:.3g}", unit,
             *(f"{share + 0.0:.3g}" for share in shares))
        )  # fmt: skip
    caption = (
        "How the exact frequency rises at the optimum with one unit more of the parameter, and in "
        "% with 1 % more: means over the samples."
    )
    return Table("Sensitivity", columns, tuple(rows), caption)


def limits(results: RunResults) -> Table:
    """Gains from a little more room at each limit that the answer lies on, to first order."""
    return facts_table("Limits", results.meaning.relaxed, "words")


def reach(results: RunResults) -> Table:
    """The range of each target's curve within the bounds, over all samples."""
    caption = "All designs within the bounds, at any sample (proved)."
    if any(row.how == "bounded" for row in results.meaning.reach):
        caption += " Distances of two modes lie in between, but may not reach the ends."
    rows, names = results.meaning.reach, "label lowest_hz highest_hz error"
    return facts_table("Reach", rows, names, caption, error="least error")


def tolerance(results: RunResults) -> Table:
    """The range of each target's curve while parameters deviate within their tolerances."""
    found = results.meaning.tolerance
    rows, names = () if found is None else found.targets, "label lowest_hz highest_hz error"
    caption = "" if found is None else f"{capital(found.words)}."
    return facts_table("Tolerance", rows, names, caption, error="worst error")


def robust(results: RunResults) -> Table:
    """What deviations do to the robust design and to the optimum without them; the cost."""
    row = None if results.assignment is None else results.assignment.robust
    if row is None:
        return Table("Robust", (), ())
    caption = (
        f"Missed at the worst deviation that a search found within the tolerances, and at the "
        f"worst of {row.draws} random ones; of what is as high or wide as can be, what it is short "
        "of the robust design's. Alone: the optimum without deviations. From alone to "
        f"robust: {row.words}."
    )
    names = "label handy nominal robust nominal_worst worst drawn"
    return facts_table("Robust", row.targets, names, caption)


def approximation(results: RunResults) -> Table:
    """Worst error of both expansions, along the trajectory and over maps."""
    columns = ("mode", "where", "order", "Taylor", "linearised in y")
    caption = "Worst relative error of the frequency, against exact solves."
    rows = []
    for study in results.studies:
        places: list[tuple[str, Comparison]] = []
        if study.over_time is not None:
            places.append((f"along {results.along}, initial design", study.over_time))
        for over in (study.over_q, study.over_design):
            if over is not None:
                places.append((f"over {' and '.join(over.names)}", over.values))
        for where, values in places:
            worst = (percent(values.worst_taylor), percent(values.worst_linearised))
            rows.append((f"mode {study.mode}", where, str(study.order), *worst))
        if study.stated is not None:
            worst = (percent(study.stated["taylor"]), percent(study.stated["linearised"]))
            where = "between samples, all over the bounds, with a margin"
            rows.append((f"mode {study.mode}", where, str(study.order), *worst))
    return Table("Approximation", columns, tuple(rows), caption)


def solver(results: RunResults) -> Table:
    """The solver's status, and the residuals of its answer, recomputed from the data."""
    rows = () if results.solver is None else (results.solver,)
    names = "status iterations primal_residual dual_residual gap"
    caption = "Residuals, computed again from the data of the scaled program."
    return facts_table("Solver", rows, names, caption)


def timing(results: RunResults) -> Table:
    """Time by stage."""
    rows = tuple((STAGES.get(k, k), seconds(value)) for k, value in results.timing_s.items())
    return Table("Timing", ("stage", "time"), rows)


def weight(results: RunResults) -> Table:
    """The nodes that the stated weight moves most, and how near it is to buckling."""
    found = results.weight
    if found is None or not found.sag:
        return Table("Weight", (), ())
    rows = [row for row in found.sag if row.most][:SAGGING]
    where = f"over {found.poses} poses of the {found.design} design"
    caption = f"The largest sag of each, {where}"
    if found.buckling is not None:
        caption += f"; the weight is at most {percent(found.buckling)} of the buckling load"
    return facts_table("Sag under the weight", rows, "node sag most", f"{caption}.")


SECTIONS = {  # of a page, with their headings; what is in none is in the appendix
    "requirements": "Requirements",
    "design": "Design",
    "depends": "What it hangs on",
    "robustness": "Robustness",
    "motion": "Motion",
}
_KINDS: dict[str, tuple[Callable[[RunResults], Table], ...]] = {
    "design": (design, combinations),
    "requirements": (objective, errors, required),
    "depends": (sensitivity, limits, anatomy, helps, reach),
    "robustness": (clearances, tolerance, robust, weight),
    "motion": (drives,),
    "appendix": (optima, approximation, solver, timing),
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
    anatomies: Sequence[ModeAnatomy] = (),
    note: str = "",
) -> Table:
    """Elastic modes in Hz from 1 upwards, where they were evaluated, and the rigid modes left out.

    ``where`` is the pose and design in words; ``discretisation`` and ``truncation`` are how much
    mesh and reduced links raise each frequency, about, relative; ``weight`` is
    what gravity changes; ``anatomies`` are what the modes are; ``note`` is below.
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
    if anatomies:
        for kind, name in (("strain", "strain"), ("kinetic", "motion")):
            columns[f"{name} most in"] = [one.most(kind, 1) for one in anatomies]
        columns["1 % more of"] = [one.helped(1) for one in anatomies]
    caption = f"{rigid_modes} rigid-body mode{'s' if rigid_modes != 1 else ''} not counted."
    caption += f" {capital(note)}." if note else ""
    rows = tuple(zip(*columns.values(), strict=True))
    return Table(f"Modes at {where}", tuple(columns), rows, caption)
