"""Parameters of a case from measured frequencies, and what the measurements say of them.

The unknowns are the design parameters between their bounds, starting from the values in the file.
Modes are numbered by size, as measured. Linear constraints, the limit on the mass, targets and
prices are about what shall be, not about what is: they are left aside, and lists of values count as
ranges.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from eigassign.assignment.exact.identification import (
    POOR,
    Identified,
    MeasuredFrequencies,
    identify,
)
from eigassign.assignment.exact.sequential import PAYS, unseen
from eigassign.case.case_file import CaseFile
from eigassign.case.units import handy
from eigassign.facts import Fact, Hertz, InUnit, Key, Seconds
from eigassign.modal.exact.solver import in_hz
from eigassign.modal.model import Model
from eigassign.study.built_case import BuiltCase
from eigassign.study.checks import WEIGHT_POSES, judged_poses, study_weight
from eigassign.study.design.search.response import spread_designs
from eigassign.study.results import CaseRow, InOneUnit, Origin
from eigassign.study.updating.measured import PosedMeasurement, read_measurements

Floats = NDArray[np.float64]
STARTS = 100  # at most
OUTLIER = 3.0  # standard deviations

# --- Results

Correlation = Annotated[Floats, Fact("of the parameters", name="correlation", may_lack=True)]
Residual = Annotated[float, Fact("in standard deviations", digits="+.2f", name="residual")]
Outlier = Annotated[
    bool,
    Fact("over three deviations", "remark", digits=lambda far: "outlier" * far, name="outlier"),
]


@dataclass(frozen=True)
class UpdatedParameter(InOneUnit):
    """One parameter before and after, in SI units; its interval holds it with 95 %."""

    name: Key
    parameter: Annotated[str, Fact("its key path in the case file")]
    unit: str
    initial: Annotated[InUnit, Fact("as the case file says", "before")]
    value: Annotated[InUnit, Fact("the one found", "after")]
    deviation: Annotated[InUnit | None, Fact("standard, while bounds hold", digits=".3g")]
    low: Annotated[InUnit, Fact("where its interval begins", "95 % from")]
    high: Annotated[InUnit, Fact("where its interval ends", "to")]
    low_is_bound: Annotated[bool, Fact("it begins at a bound that measurements do not exclude")]
    high_is_bound: bool
    lower: InUnit
    upper: InUnit
    held: Annotated[str, Fact("the bound that holds it, lower or upper; or empty")]

    @property
    def remark(self) -> str:
        """The reason why the interval is one-sided, if it is."""
        if self.held:
            return f"held by its {self.held} bound: one-sided"
        if self.low_is_bound and self.high_is_bound:
            return "the whole range of its bounds is possible"
        ends = "lower" * self.low_is_bound + "upper" * self.high_is_bound
        return f"the {ends} bound is possible: one-sided" if ends else ""


@dataclass(frozen=True)
class ExplainedMeasurement:
    """One measurement, and the model's frequency before and after, in Hz."""

    label: Annotated[str, Fact("where it is written", "measurement")]
    trajectory: str | None
    time_s: Seconds | None
    q: tuple[float, ...]
    mode: int
    measured_hz: Hertz
    deviation_hz: Annotated[Hertz, Fact("standard", "±", digits=".3g")]
    initial_hz: Annotated[Hertz, Fact("of the model", "before", digits=".5g")]
    updated_hz: Annotated[Hertz, Fact("of the updated model", "after", digits=".5g")]

    @property
    def residual(self) -> Residual:
        """(model − measured)/σ after."""
        return (self.updated_hz - self.measured_hz) / self.deviation_hz

    @property
    def is_outlier(self) -> Outlier:
        """True where it is further off than three standard deviations."""
        return abs(self.residual) > OUTLIER


@dataclass(frozen=True)
class UnidentifiedDirection:
    """A common change of parameters (SI, by name) that the measurements do not notice."""

    change: Annotated[Mapping[str, float], Fact("by their names")]
    amounts: Annotated[str, Fact(heading="change", unwritten=True)]  # of it, as people read them
    words: Annotated[str, Fact("what cannot be told, in words", "what")]


@dataclass(frozen=True)
class ExplainingMinimum:
    """One of several minima of χ² that explain the measurements: the parameters there, by name."""

    values: Annotated[Mapping[str, float], Fact("SI, by their names")]
    amounts: Annotated[str, Fact(heading="values", unwritten=True)]  # as people read them
    chi_squared: Annotated[float, Fact(heading="χ²", digits=".4g")]


@dataclass(frozen=True)
class FitRow:
    """The fit: χ² is the sum of squared residuals in standard deviations."""

    initial_chi_squared: Annotated[float, Fact("of the start", "χ² before", digits=".4g")]
    chi_squared: Annotated[float, Fact("of the answer", "χ² after", digits=".4g")]
    degrees: Annotated[int, Fact(heading="degrees of freedom", name="degrees_of_freedom")]
    p_value: Annotated[float | None, Fact("chance of so large a χ²", "p", "", ".3g", "none")]
    steps: int
    ended: Annotated[str, Fact("how the steps did")]


@dataclass(frozen=True, repr=False, kw_only=True)
class UpdateResults(Origin):
    """An update; what is not identified has no deviation, and a covariance that is no number."""

    verdict: Annotated[str, Fact("fitted, poor_fit, not_identified or unfinished")]
    parameters: Annotated[tuple[UpdatedParameter, ...], Fact(by="name")]
    covariance: Annotated[Floats, Fact("of the parameters, SI", may_lack=True)]  # (n_y, n_y)
    unidentified: Annotated[tuple[UnidentifiedDirection, ...], Fact(name="not_identified")]
    minima: Annotated[
        tuple[ExplainingMinimum, ...], Fact("distinct ones that explain the measurements")
    ]
    fit: FitRow
    measurements: tuple[ExplainedMeasurement, ...]
    warnings: tuple[str, ...]
    notes: tuple[str, ...]
    timing_s: Annotated[Mapping[str, float], Fact("by stage", unit="s")]

    @property
    def headline(self) -> Annotated[str, Fact("the verdict in words", name="headline")]:
        """The verdict in a sentence: the parameters, and whether they explain anything."""
        found = []
        for row in self.parameters:  # k1 = 52.47 kN m/rad (50.75 to 54.27)
            unit, size = row.handy
            value, low, high = (f"{each / size:.4g}" for each in (row.value, row.low, row.high))
            found.append(f"{row.name} = {value} {unit}".rstrip() + f" ({low} to {high})")
        of, why = self.fit, [direction.words for direction in self.unidentified]
        if len(self.minima) > 1:
            why.append(f"{len(self.minima)} distinct sets of values explain the measurements")
        chance = "" if of.p_value is None else f", p = {of.p_value:.2g}"
        fit = f"χ² = {of.chi_squared:.3g} with {of.degrees} degrees of freedom{chance}"
        verdict = {
            "fitted": f"Explained: the model fits the measurements ({fit})",
            "poor_fit": f"NOT EXPLAINED: the measurements are farther off than their standard "
            f"deviations allow ({fit}, below {POOR:g}), and the intervals do not hold",
            "not_identified": f"NOT IDENTIFIED: {'; '.join(why)} ({fit})",
            "unfinished": f"UNFINISHED: the fit ended before its optimum ({of.ended}; {fit})",
        }[self.verdict]
        return f"{verdict}. {', '.join(found)}."

    @property
    def design(self) -> dict[str, float]:
        """The updated parameters by name, SI."""
        return {row.name: row.value for row in self.parameters}

    @property
    def intervals(self) -> dict[str, tuple[float, float]]:
        """Their 95 % intervals."""
        return {row.name: (row.low, row.high) for row in self.parameters}

    @property
    def correlation(self) -> Correlation:
        """(n_y, n_y); NaN of parameters that are held or not identified."""
        deviation = np.array([row.deviation or np.nan for row in self.parameters])
        return np.asarray(self.covariance / np.outer(deviation, deviation))


# --- Updating


def require_updatable(file: CaseFile) -> None:
    """Raise CaseError naming every key that updating needs and the case lacks."""
    needs = {
        "design": (bool(file.design.parameters), "at least one parameter that is not known"),
        "measurements": (file.measurements is not None, "frequencies that were measured"),
    }
    file.require("update", needs)


@dataclass(frozen=True)
class UpdateProblem:
    """A case with its measurements, each pose once: what is solved."""

    case: BuiltCase
    measured: tuple[PosedMeasurement, ...]
    notes: tuple[str, ...]
    q: Floats  # (n_p, n_q) poses
    rows: NDArray[np.intp]  # (m,) which pose each measurement has
    columns: NDArray[np.intp]  # (m,) its mode, from 0
    lower: Floats
    upper: Floats

    @property
    def model(self) -> Model:
        """The model of the case."""
        return self.case.model()

    @property
    def frequencies(self) -> MeasuredFrequencies:
        """The measured values alone."""
        hz = np.array([each.hz for each in self.measured])
        return MeasuredFrequencies(hz, np.array([each.deviation_hz for each in self.measured]))

    def response(self, y: Floats) -> tuple[Floats, Floats]:
        """Exact frequencies (m,) in Hz of what was measured, and their slopes (m, n_y)."""
        n_q, count = self.q.shape[1], int(self.columns.max()) + 1
        scales = np.append(np.zeros(n_q), self.upper - self.lower)
        hz, slopes = in_hz(*self.model.slopes(self.q, y, count, scales))
        return hz[self.rows, self.columns], slopes[self.rows, self.columns, n_q:]


def update_problem(case: BuiltCase) -> UpdateProblem:
    """Read what is to be solved; raises CaseError for wrong measurements."""
    require_updatable(case.file)
    measured, notes = read_measurements(case)
    q, rows = np.unique(np.array([each.q for each in measured]), axis=0, return_inverse=True)
    parameters = case.file.design.parameters.values()
    problem = UpdateProblem(
        case=case,
        measured=measured,
        notes=notes,
        q=q,
        rows=rows.ravel(),
        columns=np.array([each.mode - 1 for each in measured]),
        lower=np.array([p.min for p in parameters]),
        upper=np.array([p.max for p in parameters]),
    )
    with case.located():
        labels = {int(row): each.label for row, each in zip(problem.rows, measured, strict=True)}
        problem.model.require_standing(q, case.initial_design, lambda k: labels[k])
    return problem


def solve_update(problem: UpdateProblem) -> Identified:
    """The most likely parameters; raises EigassignError where the start has no answer."""
    start, limits = problem.case.initial_design, (problem.lower, problem.upper)
    others = spread_designs(limits, STARTS - 1, 0) if len(start) else ()

    def enough(starts: int, found: int) -> bool:
        return unseen(starts, found) <= PAYS

    return identify(problem.response, problem.frequencies, *limits, start, others, enough)


def collect_update(
    problem: UpdateProblem, found: Identified, timing_s: Mapping[str, float]
) -> UpdateResults:
    """Everything that was found, as plain numbers and words."""
    case = problem.case
    directions = tuple(_direction(row, found.y, problem) for row in found.unidentified)
    q, modes = (
        judged_poses(problem.model, problem.q, WEIGHT_POSES),
        {each.mode for each in problem.measured},
    )
    weight = study_weight(case.file, problem.model, sorted(modes), q, found.y, "updated")
    return UpdateResults(
        case=CaseRow.of(case.file),
        parameters=tuple(_parameters(problem, found, directions)),
        covariance=found.covariance,
        measurements=tuple(
            ExplainedMeasurement(
                *(each.label, each.trajectory, each.time_s, tuple(each.q.tolist())),
                *(each.mode, each.hz, each.deviation_hz, *hz),
            )
            for each, *hz in zip(
                problem.measured, found.initial_hz.tolist(), found.hz.tolist(), strict=True
            )
        ),
        unidentified=directions,
        minima=tuple(
            ExplainingMinimum(values, _listed(problem, values), one.objective)
            for one in found.minima
            for values in [dict(zip(problem.model.y_names, one.y.tolist(), strict=True))]
        ),
        fit=FitRow(
            *(found.initial_chi_squared, found.chi_squared, found.degrees, found.p_value),
            len(found.fit.steps),
            str(found.fit.end),
        ),
        verdict=found.verdict,
        notes=(*problem.notes, *_notes(problem, found), *weight.lines),
        warnings=(*map(str, case.file.warnings), *_warnings(problem, found), *weight.warnings),
        timing_s=dict(timing_s),
    )


def _parameters(
    problem: UpdateProblem, found: Identified, directions: Sequence[UnidentifiedDirection]
) -> Iterator[UpdatedParameter]:
    file, initial, deviation = problem.case.file, problem.case.initial_design, found.deviation
    held = {name for name, side in zip(problem.model.y_names, found.held, strict=True) if side}
    # their deviation while the bounds hold says nothing
    moving = {name for each in directions if held & set(each.change) for name in each.change}
    for k, (name, column) in enumerate(file.design.parameters.items()):
        interval = found.intervals[k]
        yield UpdatedParameter(
            name=name,
            parameter=column.said,
            unit=file.design_units[k],
            initial=float(initial[k]),
            value=float(found.y[k]),
            deviation=float(deviation[k])
            if 0.0 < deviation[k] < np.inf and name not in moving
            else None,
            low=interval.low,
            high=interval.high,
            low_is_bound=interval.at_lower,
            high_is_bound=interval.at_upper,
            lower=column.min,
            upper=column.max,
            held=found.held[k],
        )


# --- What is not identified, in words


def _direction(change: Floats, y: Floats, problem: UpdateProblem) -> UnidentifiedDirection:
    width = problem.upper - problem.lower
    share = np.abs(change) / np.where(width > 0.0, width, 1.0)
    taking = [int(k) for k in np.flatnonzero(share > 1e-2 * share.max())]
    names = problem.model.y_names
    by_name = {names[k]: float(change[k]) for k in taking}
    units, amounts = {problem.case.file.design_units[k] for k in taking}, _listed(problem, by_name)
    relative = change[taking] / y[taking] if np.all(y[taking] != 0.0) else None
    words = _in_words(amounts, by_name, relative, len(units) == 1)
    return UnidentifiedDirection(by_name, amounts, words)


def _listed(problem: UpdateProblem, values: Mapping[str, float]) -> str:
    """``a: 0.2287 m, b: 2 kg`` of SI values by the names of parameters."""
    units = dict(zip(problem.model.y_names, problem.case.file.design_units, strict=True))
    return ", ".join(f"{name}: {handy(value, units[name], 4)}" for name, value in values.items())


def _in_words(
    amounts: str, change: Mapping[str, float], relative: Floats | None, one_unit: bool
) -> str:
    """ "E can change unnoticed"; "m1 and m2 only as m1 + 0.5 m2"; or how they change, in per cent.

    ``relative`` is the change by the values, None where one of these is 0.
    """
    if len(change) == 1:
        return f"{next(iter(change))} can change from bound to bound without effect"
    *most, last = change
    together = f"{', '.join(most)} and {last} can change together without effect"
    if relative is not None and np.ptp(relative) <= 1e-2 * np.abs(relative).max():
        return f"{together}, all by the same percentage"
    if len(change) == 2 and (one_unit or relative is None):
        (a, along_a), (b, along_b) = change.items()
        factor = -along_a / along_b  # a + factor · b stays
        sign = "+" if factor > 0.0 else "−"
        size = f"{abs(factor):.3g} " if abs(abs(factor) - 1.0) > 5e-4 else ""
        return f"{a} and {b} are determined only together, as {a} {sign} {size}{b}"
    if relative is None:
        return f"{together}: {amounts}"
    sizes = [f"{v:.3g} %" for v in 10.0 * relative / np.abs(relative).max()]
    each = (f"{name} by {s.replace('-', '−')}" for name, s in zip(change, sizes, strict=True))
    return f"{together}: {', '.join(each)}"


# --- Notes and warnings


def _notes(problem: UpdateProblem, found: Identified) -> Iterator[str]:
    several = len(problem.measured) != len(problem.q)
    poses = f" at {len(problem.q)} poses" if several else ""
    yield f"{len(problem.measured)} measured frequencies{poses}, {len(found.y)} parameters"
    if found.rounds > 1:
        yield "the first fit was a local minimum: the fit began again from a better one"
    if not np.array_equal(
        start := problem.case.initial_design, np.clip(start, problem.lower, problem.upper)
    ):
        yield "the values in the file lie outside their bounds: the fit started from the bounds"
    names = problem.model.y_names
    held = [f"{n} at its {side} bound" for n, side in zip(names, found.held, strict=True) if side]
    if held:
        yield f"deviations and covariance assume {' and '.join(held)}; intervals do not"
    minima = f"{found.met} distinct minima" if found.met > 1 else "one minimum"
    left = unseen(found.starts, found.met)
    more = f"{left:.2g} more are expected" if np.isfinite(left) else "more are likely"
    yield f"{found.starts} starts led to {minima} of χ²; {more}"
    design = problem.case.file.design
    if design.constraints or design.mass is not None or design.torque:
        what = "the mass, of drives" if design.torque else "the mass"
        yield f"linear limits and limits of {what} are left aside: a fit has none"
    if design.catalogues:
        yield "of lists of values and choices only the smallest and largest value count"


MOST_PAIRS = 12  # that a warning lists


def _warnings(problem: UpdateProblem, found: Identified) -> Iterator[str]:
    pairs = [each for each in problem.measured if each.paired_hz is not None]
    if pairs:
        told = "; ".join(
            f"{each.label}, {each.hz:g} Hz, is mode {each.mode}, {each.paired_hz:.4g} Hz there"
            for each in pairs[:MOST_PAIRS]
        )
        told += f"; and {len(pairs) - MOST_PAIRS} more" * (len(pairs) > MOST_PAIRS)
        yield (
            "measurements without a mode are paired by frequency with the model as it is written: "
            f"{told}; where a pair is wrong, write its mode"
        )
    modes = sorted({each.mode for each in problem.measured})
    error = problem.model.discretisation_error(problem.q, found.y, modes)
    at = [modes.index(each.mode) for each in problem.measured]
    share = error[problem.rows, at] * found.hz / problem.frequencies.deviation
    worst = int(np.argmax(share))
    if share[worst] > 0.5:  # half of what the measurement itself leaves open
        yield (
            f"the mesh puts the frequency of {problem.measured[worst].label} off by "
            f"{share[worst]:.2g} standard deviations: give the links more elements, or auto"
        )
