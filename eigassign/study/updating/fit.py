"""Parameters of a case from measured frequencies, and what the measurements say of them.

Of frequencies that are known to lie between two there is no best fit: each parameter has a range.

The unknowns are the design parameters between their bounds, starting from the values in the file.
Modes are numbered by size, as measured. Linear constraints, the limit on the mass, targets and
prices are about what shall be, not about what is: they are left aside, and lists of values count as
ranges.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from eigassign.arrays import Floats
from eigassign.assignment.exact.design_problem import ON
from eigassign.assignment.exact.identification import (
    POOR,
    Identified,
    MeasuredFrequencies,
    identify,
)
from eigassign.assignment.exact.ranges import Explained, explain
from eigassign.assignment.exact.sequential import PAYS, unseen
from eigassign.case.case_file import CaseFile
from eigassign.case.units import handy
from eigassign.errors import CaseError
from eigassign.facts import Fact, Hertz, InUnit, Key, Seconds, Unwritten
from eigassign.modal.exact.solver import in_hz
from eigassign.modal.model import Model
from eigassign.study.built_case import BuiltCase
from eigassign.study.checks import WEIGHT_POSES, judged_poses, study_weight
from eigassign.study.design.search.response import corners, effects, spread_designs
from eigassign.study.planning import design_bounds
from eigassign.study.results import CaseRow, InOneUnit, Origin
from eigassign.study.updating.measured import PosedMeasurement, read_measurements

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
    """One parameter before and after, in SI units; its interval holds it with 95 %.

    Of ranges that were measured ``value`` is one that explains them, and the interval holds all of
    these that were found; no other has one outside the ``outer`` one, where that is known.
    """

    name: Key
    parameter: Annotated[str, Fact("its key path in the case file")]
    unit: str
    initial: Annotated[InUnit, Fact("as the case file says", "before")]
    value: Annotated[InUnit, Fact("the one found", "after")]
    deviation: Annotated[InUnit | None, Fact("standard, while bounds hold", digits=".3g")]
    low: Annotated[InUnit, Fact("where its interval begins", "from")]
    high: Annotated[InUnit, Fact("where its interval ends", "to")]
    low_is_bound: Annotated[bool, Fact("it begins at a bound that measurements do not exclude")]
    high_is_bound: bool
    lower: InUnit
    upper: InUnit
    held: Annotated[str, Fact("the bound that holds it, lower or upper; or empty")]
    outer_low: Annotated[InUnit | None, Fact("none is below", "none below")] = None
    outer_high: Annotated[InUnit | None, Fact("none is above", "none above")] = None

    @property
    def ends(self) -> tuple[float, float]:
        """What it may be: its outer range where that is known, else its interval."""
        low = self.low if self.outer_low is None else self.outer_low
        return low, self.high if self.outer_high is None else self.outer_high

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
    covariance: Annotated[Floats, Fact("of the parameters there, SI", may_lack=True)]


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
    fit: FitRow | None  # None of ranges
    measurements: tuple[ExplainedMeasurement, ...]
    warnings: tuple[str, ...]
    notes: tuple[str, ...]
    timing_s: Annotated[Mapping[str, float], Fact("by stage", unit="s")]
    unexplained: Unwritten[str] = ""  # how that is known of ranges

    @property
    def headline(self) -> Annotated[str, Fact("the verdict in words", name="headline")]:
        """The verdict in a sentence: the parameters, and whether they explain anything."""
        of, why = self.fit, [direction.words for direction in self.unidentified]
        if of is None:
            return self._of_ranges
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
        found = []
        for row in self.parameters:  # k1 = 52.47 kN m/rad (50.75 to 54.27)
            unit, size = row.handy
            value, low, high = (f"{each / size:.4g}" for each in (row.value, row.low, row.high))
            found.append(f"{row.name} = {value} {unit}".rstrip() + f" ({low} to {high})")
        return f"{verdict}. {', '.join(found)}."

    @property
    def _of_ranges(self) -> str:
        """The verdict of ranges: what each parameter may be, or which measurement stands out."""
        if self.verdict == "poor_fit":
            most = max(abs(row.residual) for row in self.measurements)
            missed = [row for row in self.measurements if abs(row.residual) > 0.95 * most]
            told = " and ".join(
                f"{row.label}, mode {row.mode}, by "
                f"{(abs(row.residual) - 1.0) * row.deviation_hz:.3g} Hz"
                for row in missed[:3]
            )
            ranges = f"all {len(self.measurements)} ranges; the nearest misses {told}"
            return f"NOT EXPLAINED: no design {self.unexplained} lies in {ranges}."
        found = []
        for row in self.parameters:  # k1 from 50.2 to 54.3 kN m/rad (none below 50.1 or above 54.4)
            unit, size = row.handy
            low, high = (f"{end / size:.4g}" for end in (row.low, row.high))
            ends = (f"{end / size:.4g}" for end in row.ends)
            none = "" if row.outer_low is None else " (none below {} or above {})".format(*ends)
            found.append(f"{row.name} from {low} to {high} {unit}".rstrip() + none)
        every = f"designs lie in all {len(self.measurements)} ranges. {', '.join(found)}."
        loose = [row.name for row in self.parameters if row.low_is_bound and row.high_is_bound]
        if not loose:
            return f"Explained: {every}"
        return f"NOT IDENTIFIED: {', '.join(loose)} may be anything within the bounds; {every}"

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
    if file.uncertain is not None:
        message = "update finds what is not known: write it under design, with bounds"
        raise CaseError((file.problem("uncertain", message),))
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
    def modes(self) -> list[int]:
        """The modes that were measured, ascending."""
        return sorted({each.mode for each in self.measured})

    def between(self, low: Floats, high: Floats) -> tuple[Floats, Floats]:
        """r (n, m) that no design of boxes (n, n_y) is below, and that none is above.

        Of parameters that raise or lower every frequency, by two corners of each.
        """
        count, measured = int(self.columns.max()) + 1, self.frequencies
        each = []
        for y in corners(self.case.file, low, low, high):
            q, own = np.tile(self.q, (len(y), 1)), np.repeat(y, len(self.q), axis=0)
            hz = self.model.frequencies(q, own, count).reshape(len(y), len(self.q), count)
            each.append(measured.standardised(hz[:, self.rows, self.columns]))
        return each[0], each[1]

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
    lower, upper = design_bounds(case.file)
    problem = UpdateProblem(
        case=case,
        measured=measured,
        notes=notes,
        q=q,
        rows=rows.ravel(),
        columns=np.array([each.mode - 1 for each in measured]),
        lower=lower,
        upper=upper,
    )
    with case.located():
        labels = {int(row): each.label for row, each in zip(problem.rows, measured, strict=True)}
        problem.model.require_standing(q, case.initial_design, lambda k: labels[k])
    return problem


def solve_update(problem: UpdateProblem) -> Identified | Explained:
    """The most likely parameters; raises EigassignError where the start has no answer.

    Of ranges all that explain them.
    """
    start, limits = problem.case.initial_design, (problem.lower, problem.upper)
    others = spread_designs(limits, STARTS - 1, 0) if len(start) else ()
    if problem.measured[0].is_range:
        measured, known = problem.frequencies, effects(problem.case.file) != 0.0

        def standardised(y: Floats) -> tuple[Floats, Floats]:
            hz, slopes = problem.response(y)
            return measured.standardised(hz), slopes / measured.deviation[:, None]

        between = problem.between if (known | (limits[0] == limits[1])).all() else None
        return explain(standardised, *limits, [start, *others], between)
    return identify(
        *(problem.response, problem.frequencies, *limits, start, others),
        enough=lambda starts, found: unseen(starts, found) <= PAYS,
    )


def collect_update(
    problem: UpdateProblem, found: Identified | Explained, timing_s: Mapping[str, float]
) -> UpdateResults:
    """Everything that was found, as plain numbers and words."""
    case, model = problem.case, problem.model
    q, modes = judged_poses(model, problem.q, WEIGHT_POSES), problem.modes
    weight = study_weight(case.file, model, modes, q, found.y, "updated")
    start = np.clip(case.initial_design, problem.lower, problem.upper)
    both = (problem.response(y)[0].tolist() for y in (start, found.y))
    measurements = tuple(
        ExplainedMeasurement(
            *(each.label, each.trajectory, each.time_s, tuple(each.q.tolist())),
            *(each.mode, each.hz, each.deviation_hz, *hz),
        )
        for each, *hz in zip(problem.measured, *both, strict=True)
    )
    common: dict[str, Any] = {
        "case": CaseRow.of(case.file),
        "measurements": measurements,
        "warnings": (
            *map(str, case.file.warnings),
            *_warnings(problem, found.y, np.array([row.updated_hz for row in measurements])),
            *weight.warnings,
        ),
        "timing_s": dict(timing_s),
    }
    if isinstance(found, Explained):
        n, ranges = len(found.y), tuple(_ranges(problem, found))
        loose = any(row.low_is_bound and row.high_is_bound for row in ranges)
        return UpdateResults(
            **common,
            verdict="poor_fit" if found.inner is None else "not_identified" if loose else "fitted",
            parameters=ranges,
            covariance=np.full((n, n), np.nan),
            unidentified=(),
            minima=(),
            fit=None,
            notes=(*problem.notes, *_range_notes(problem, found), *weight.lines),
            unexplained="within the bounds" + " (proved)" * found.is_impossible,
        )
    directions = tuple(_direction(row, found.y, problem) for row in found.unidentified)
    each = zip(found.minima, found.covariances, strict=True)
    return UpdateResults(
        **common,
        parameters=tuple(_parameters(problem, found, directions)),
        covariance=found.covariance,
        unidentified=directions,
        minima=tuple(
            ExplainingMinimum(values, _listed(problem, values), one.objective, covariance)
            for one, covariance in each
            for values in [dict(zip(model.y_names, one.y.tolist(), strict=True))]
        ),
        fit=FitRow(
            *(found.initial_chi_squared, found.chi_squared, found.degrees, found.p_value),
            len(found.fit.steps),
            str(found.fit.end),
        ),
        verdict=found.verdict,
        notes=(*problem.notes, *_notes(problem, found), *weight.lines),
    )


def _parameters(
    problem: UpdateProblem, found: Identified, directions: Sequence[UnidentifiedDirection]
) -> Iterator[UpdatedParameter]:
    deviation = found.deviation
    held = {name for name, side in zip(problem.model.y_names, found.held, strict=True) if side}
    # their deviation while the bounds hold says nothing
    moving = {name for each in directions if held & set(each.change) for name in each.change}
    rows = zip(_given(problem, found.y), found.intervals, strict=True)
    for k, (given, interval) in enumerate(rows):
        known = 0.0 < deviation[k] < np.inf and given["name"] not in moving
        yield UpdatedParameter(
            **given,
            deviation=float(deviation[k]) if known else None,
            low=interval.low,
            high=interval.high,
            low_is_bound=interval.at_lower,
            high_is_bound=interval.at_upper,
            held=found.held[k],
        )


def _given(problem: UpdateProblem, y: Floats) -> Iterator[dict[str, Any]]:
    """Yield what each parameter is, its bounds, and its values before and in ``y`` (n_y,)."""
    file, initial = problem.case.file, problem.case.initial_design
    for k, (name, column) in enumerate(file.design.parameters.items()):
        yield {
            **{"name": name, "parameter": column.said, "unit": file.design_units[k]},
            **{"lower": column.min, "upper": column.max},
            **{"initial": float(initial[k]), "value": float(y[k])},
        }


def _ranges(problem: UpdateProblem, found: Explained) -> Iterator[UpdatedParameter]:
    """What each parameter may be; where nothing explains the measurements, what is nearest."""
    low, high = (found.y, found.y) if found.inner is None else found.inner
    outer = np.full((2, len(low)), None) if found.outer is None else found.outer.tolist()
    near = ON * (problem.upper - problem.lower)
    for k, given in enumerate(_given(problem, found.y)):
        yield UpdatedParameter(
            **given,
            deviation=None,
            low=float(low[k]),
            high=float(high[k]),
            low_is_bound=bool(low[k] <= problem.lower[k] + near[k]),
            high_is_bound=bool(high[k] >= problem.upper[k] - near[k]),
            held="",
            outer_low=outer[0][k],
            outer_high=outer[1][k],
        )


def _range_notes(problem: UpdateProblem, found: Explained) -> Iterator[str]:
    n = len(found.y)
    yield f"{len(problem.measured)} measured ranges at {len(problem.q)} poses, {n} parameters"
    if found.outer is None and not found.is_impossible:
        yield (
            "no range is known that no value lies outside of: not every parameter raises, or "
            "lowers, all frequencies"
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
    poses = f" at {len(problem.q)} poses" * (len(problem.measured) != len(problem.q))
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


def _warnings(problem: UpdateProblem, y: Floats, hz: Floats) -> Iterator[str]:
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
    modes = problem.modes
    error = problem.model.discretisation_error(problem.q, y, modes)
    at = np.searchsorted(modes, problem.columns + 1)
    share = error[problem.rows, at] * hz / problem.frequencies.deviation
    worst = int(np.argmax(share))
    if share[worst] > 0.5:  # half of what the measurement itself leaves open
        yield (
            f"the mesh puts the frequency of {problem.measured[worst].label} off by "
            f"{share[worst]:.2g} standard deviations: give the links more elements, or auto"
        )
