"""What one run found, as plain numbers: the only thing the output layer is given to show.

Shapes: n_t samples in time, n_q coordinates, n_y design parameters, n poses in d dimensions (2 in a
plane, 3 in space). SI units, frequencies in Hz, errors as fractions (0.01 is 1 %) of the frequency
in Hz.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from decimal import ROUND_DOWN, Context
from functools import partial
from operator import itemgetter
from typing import Annotated, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from eigassign._version import __version__
from eigassign.arrays import Floats
from eigassign.assignment.exact.sequential import StepRecord
from eigassign.assignment.one_shot import ActiveLimit
from eigassign.assignment.requirements.requirement import Requirement
from eigassign.brief import Brief
from eigassign.case.case_file import CaseFile
from eigassign.case.units import handy, handy_unit, is_bare
from eigassign.facts import (
    OF_ROW,
    Curve,
    Fact,
    Hertz,
    InUnit,
    Key,
    Residual,
    Seconds,
    Share,
    Unwritten,
    Violation,
    about,
    fact,
    hints,
    number,
    percent,
    positive_percent,
    priced,
    told,
)
from eigassign.modal.adaptive_order import MARGIN

_DOWN = Context(prec=4, rounding=ROUND_DOWN)
Numbers = NDArray[np.intp]
SCHEMA = 3  # of results.json: raised when a field goes or means something else
Row = TypeVar("Row")
Kilograms = Annotated[float, Fact(unit="kg", digits=number)]
MET = 1e-8  # a violation below it is round-off
# Of a limit on a frequency: as much as 0.2 % of a stiffness or mass, which no machine is known to
THIN = 1e-3
WEIGHED = "weight and motion"  # what loads of drives are of, where gravity is known
InPower = Annotated[float, Fact(unit="m/N", digits=partial(handy, unit="m/N"), says_unit=True)]
KEPT = 1e-6  # of a limit: what is beyond it by less keeps it
Metres = Annotated[float, Fact(unit="m", digits=partial(handy, unit="m"), says_unit=True)]


def _lowest(hz: Floats) -> str:
    return number(float(hz.min()))


def _highest(hz: Floats) -> str:
    return number(float(hz.max()))


def violated(worst: float) -> str:
    """``violated by 1.55 %``; ``met`` where no more than round-off is left."""
    return f"violated by {percent(worst)}" if worst > MET else "met"


def _metres(along: Floats) -> str:
    """``0, -12.3 mm``: three digits each."""
    unit, size = handy_unit("m", *along.tolist())
    small = 1e-6 * float(np.abs(along).max())
    shown = (value / size if abs(value) > small else 0.0 for value in along.tolist())
    return f"{', '.join(f'{value:.3g}' for value in shown)} {unit}"


# --- How good an expansion is


@dataclass(frozen=True, repr=False)
class Comparison(Brief):
    """Exact, full Taylor and linearised frequency of one mode at the same points, in Hz."""

    exact_hz: Floats
    taylor_hz: Floats
    linearised_hz: Floats

    @property
    def errors(self) -> dict[str, Floats]:
        """Relative errors in frequency of both expansions, point by point."""
        both = {"taylor": self.taylor_hz, "linearised": self.linearised_hz}
        return {name: np.asarray(hz / self.exact_hz - 1.0) for name, hz in both.items()}

    @property
    def worst(self) -> dict[str, float]:
        """The largest magnitude of each."""
        return {name: _worst(errors) for name, errors in self.errors.items()}


def _worst(errors: Floats) -> float:
    """The largest magnitude; infinite where a polynomial gave no frequency (NaN)."""
    worst = float(np.max(np.abs(errors), initial=0.0))
    return worst if worst == worst else float("inf")


_OF_EXPANSIONS = Fact(
    "over_time, and with a margin everywhere; of each taylor and linearised",
    name="max_relative",
    may_lack=True,
)


@dataclass(frozen=True, repr=False)
class ModeStudy(Brief):
    """The accuracy of the expansion of one mode at (q0, y0), against exact."""

    mode: int
    order: int
    q0: Floats
    y0: Floats
    over_time: Unwritten[Comparison | None]  # (n_t,) along the trajectory, at the initial design
    everywhere: Unwritten[Comparison | None] = None  # between the samples, all over the bounds

    @property
    def max_relative(self) -> Annotated[Mapping[str, Mapping[str, Share] | None], _OF_EXPANSIONS]:
        """The largest errors of both expansions by where they were looked for."""
        places = {"over_time": (self.over_time, 1.0), "everywhere": (self.everywhere, MARGIN)}
        return {
            place: None if found is None else {k: times * e for k, e in found.worst.items()}
            for place, (found, times) in places.items()
        }


@dataclass(frozen=True)
class ValidationRow:
    """One line of a validation: both expansions of one mode against exact, somewhere."""

    case: str
    mode: int
    order: int
    where: str  # "trajectory", "box of q and y", ...
    points: int
    worst_taylor: Annotated[Share, Fact(heading="Taylor")]  # infinite where λ came out negative
    worst_linearised: Annotated[Share, Fact(heading="linearised in y")]
    rms_taylor: Share
    rms_linearised: Share
    limit: Share
    passed: Annotated[bool, Fact(heading="verdict", digits=lambda ok: "ok" if ok else "FAILED")]
    lowest_hz: Hertz  # of the exact frequencies there
    mean_hz: Hertz
    highest_hz: Hertz


# --- What an assignment reaches


_READ_IN = Fact("unit, and its size in SI", "unit", digits=itemgetter(0), name="read_in")


class InOneUnit:
    """Base of rows with amounts in their ``unit``, SI."""

    unit: str

    @property
    def handy(self) -> Annotated[tuple[str, float], _READ_IN]:
        """The unit that people read them in, and the size of that in SI."""
        kind: Any = type(self)
        amounts = (getattr(self, k) for k in hints(kind) if fact(kind, k).unit == OF_ROW)
        return handy_unit(self.unit, *(each for each in amounts if isinstance(each, float)))


@dataclass(frozen=True)
class DesignRow(InOneUnit):
    """One design parameter before and after, in SI ``unit``; what was chosen of its catalogue."""

    name: Key
    parameter: Annotated[str, Fact("its key path in the case file")]
    unit: str
    initial: InUnit
    optimal: InUnit
    lower: InUnit
    upper: InUnit
    choice: Annotated[str | None, Fact("name or value chosen of its catalogue")] = None
    price: Annotated[float | None, Fact("of one SI unit")] = None
    choice_price: Annotated[float | None, Fact("of the choice, by its first property")] = None
    lies_on: Unwritten[str] = ""  # which of its bounds

    def place(self, value: float) -> float:
        """Where a value is between its bounds, in % of the way from lower to upper."""
        way = (value - self.lower) / (self.upper - self.lower or 1.0)
        return round(100.0 * min(max(way, 0.0), 1.0), 2)

    @property
    def chosen(self) -> Annotated[str, Fact(heading="choice")]:
        """The name of what was chosen; empty for a value, which stands for itself."""
        return "" if self.choice is None or is_bare(self.choice) else self.choice

    @property
    def cost(self) -> Annotated[float | None, Fact(digits=number)]:
        """Price of the change, or of the choice; None without a price."""
        if self.price is None:
            return self.choice_price
        return self.price * (self.optimal - self.initial) + (self.choice_price or 0.0)


@dataclass(frozen=True)
class MassRow:
    """Mass of all links and bodies before and after, and its limits if any, in kg.

    It is a row of the table of design parameters, by a ``name`` that no parameter has.
    """

    initial: Kilograms
    optimal: Kilograms
    lower: Kilograms | None
    upper: Kilograms | None
    price: Annotated[float | None, Fact("of one kg")] = None
    name: Key = "mass"
    handy: Unwritten[tuple[str, float]] = ("kg", 1.0)  # as of a design parameter
    parameter = "of all links and bodies"
    lies_on = chosen = ""

    @property
    def cost(self) -> float | None:
        """Price of the change; None without a price."""
        return None if self.price is None else self.price * (self.optimal - self.initial)


@dataclass(frozen=True)
class DriveLoad:
    """What a drive exerts along all trajectories, in the SI unit of its row."""

    peak: Annotated[InUnit, Fact("its largest magnitude")]
    rms: Annotated[InUnit, Fact("over time")]
    at: Annotated[str, Fact("the sample of the peak")]


@dataclass(frozen=True, repr=False)
class StaticRow(InOneUnit, Brief):
    """A stiffness, compliance or sag that a target limits, before and after; (n_t,) curves.

    Where the target does not hold, and where nothing gives way, a curve has no number.
    """

    name: Key
    unit: str
    limit: Annotated[InUnit | None, Fact("of the magnitude")]
    initial_curve: Annotated[Floats, Fact("before", unit=OF_ROW, may_lack=True)]
    optimal_curve: Annotated[Floats, Fact("with the answer", unit=OF_ROW, may_lack=True)]

    @property
    def quantity(self) -> str:
        """What it is, where its name does not say it."""
        return ""


@dataclass(frozen=True, repr=False)
class DriveRow(StaticRow):
    """What the drive of one coordinate exerts, positive along it, before and after; (n_t,) curves.

    The links are rigid: torque in N m, or force in N, of weight and motion as ``of`` says. Springs
    of `springs` rest in the unloaded pose and carry nothing.
    """

    of: Annotated[str, Fact("weight, motion or both")]
    initial: DriveLoad
    optimal: DriveLoad

    @property
    def handy(self) -> Annotated[tuple[str, float], _READ_IN]:
        """The unit that people read it in, and the size of that in SI."""
        return handy_unit(self.unit, self.initial.peak, self.optimal.peak)

    @property
    def quantity(self) -> str:
        """The word for what it exerts."""
        return " force" if self.unit == "N" else " torque"


@dataclass(frozen=True)
class FreeSpeeds:
    """Speeds of a spindle at which no harmonic of the passing of teeth meets a mode on the path."""

    of: Annotated[Key, Fact(heading="response")]
    lowest: Annotated[float, Fact("from", "from", "rpm", number)]
    highest: Annotated[float, Fact("to", "to", "rpm", number)]
    teeth: Unwritten[int]


@dataclass(frozen=True, repr=False)
class ResponseRow(InOneUnit, Brief):
    """A response at n samples and k frequencies; of ranges of damping the worst choice of ends."""

    name: Annotated[Key, Fact(heading="response")]
    unit: str
    least: Annotated[InUnit, Fact("the least dynamic stiffness 1/|H|", "least stiffness")]
    at_hz: Annotated[Hertz, Fact("of the least", "at")]
    at_s: Annotated[Seconds, Fact("of the least, from the start of its trajectory", "at time")]
    before: Annotated[InUnit | None, Fact("the least of the initial design", may_lack=True)]
    real: Annotated[InPower, Fact("the least of H, limits chatter", "least Re H", may_lack=True)]
    mesh: Annotated[Share | None, Fact("what twice the elements change of the least", "mesh")]
    free: Annotated[tuple[FreeSpeeds, ...], Fact("of the spindle", name="free_speeds")]
    frequency_hz: Unwritten[Floats]  # (k,)
    response: Unwritten[NDArray[np.complex128]]  # H (dampings, n, k), m/N
    initial: Unwritten[Floats | None]  # (k,), N/m: the least of the initial design
    places: Unwritten[tuple[str, ...]]  # m nodes and directions
    constants: Unwritten[Floats]  # b·φ (n, r, m), 1/√kg
    modes_hz: Unwritten[Floats]  # (n, r)
    ratios: Unwritten[tuple[Floats, ...]]  # ζ (n, r), the least and the most of ranges
    tracked: Unwritten[Numbers]  # (n, r): what number a mode has where its trajectory begins

    @property
    def stiffness(self) -> Floats:
        """1/|H| (n, k) in N/m, of the worst damping."""
        size = np.abs(self.response).max(axis=0)
        return np.asarray(1.0 / np.maximum(size, np.finfo(float).tiny))

    @property
    def least_real(self) -> Floats:
        """Re H (k,) in m/N, the least of all samples."""
        return np.asarray(self.response.real.min(axis=(0, 1)))


@dataclass(frozen=True)
class ShaperRow:
    """An input shaper for the modes of a move, and what it leaves of the node's vibration."""

    name: Annotated[str, Fact("as controllers call it; with * one for each mode", "shaper")]
    hz: Annotated[str, Fact("what it is designed for", "for", "Hz")]
    zeta: Annotated[float, Fact("damping ratio that it is designed for", "ζ", digits=".3g")]
    delay: Annotated[float, Fact("by which the command is longer", "delay", "s", ".3g")]
    residual: Annotated[Metres, Fact("largest way after the stop", "leaves")]


@dataclass(frozen=True)
class MoveRow(InOneUnit):
    """What a move leaves at a node; of ranges of damping the worst choice of ends."""

    name: Annotated[Key, Fact(heading="what")]
    unit: str
    duration: Annotated[Seconds, Fact("of the motion", "motion time")]
    residual: Annotated[InUnit, Fact("the largest way after the stop", "leaves")]
    before: Annotated[InUnit, Fact("of the initial design and its motion time", "initially")]
    limit: InUnit
    confirmed: Annotated[InUnit, Fact("with twice the modes and steps", "more finely")]
    shapers: tuple[ShaperRow, ...]
    time_s: Unwritten[Floats]  # (n,)
    error: Unwritten[Floats]  # (n,) m
    times: Unwritten[Floats]  # (k,) s
    lobes: Unwritten[Floats]  # (k,) m
    lobes_before: Unwritten[Floats]
    command: Unwritten[tuple[Floats, Floats] | None]  # of a ZV over time: t (n,) and q (n, n_q)
    lines: Unwritten[str]  # for controllers
    impulses: Unwritten[tuple[tuple[str, Floats, Floats], ...]]

    @property
    def advice(self) -> Annotated[str, Fact("which shaper to take, in words")]:
        """The shaper of the least delay that keeps the limit, or the one that leaves least."""
        said = f"{handy(self.residual, self.unit, 3)} without a shaper"
        if not self.shapers:
            return f"{said}; no mode is excited"
        kept = [row for row in self.shapers if row.residual <= self.limit]
        best = min(kept or self.shapers, key=lambda row: row.delay if kept else row.residual)
        leaves = f"leaves {handy(best.residual, self.unit, 3)} after {1e3 * best.delay:.3g} ms more"
        if self.residual <= (1.0 + KEPT) * self.limit:
            return f"{said}, so that none is needed; {best.name} for {best.hz} Hz {leaves}"
        rest = "" if kept else ", the least of all, above the limit"
        return f"{said}; take {best.name} for {best.hz} Hz: it {leaves}{rest}"


@dataclass(frozen=True)
class ErrorRow:
    """Distance to the target in Hz relative to the target: its maximum and root mean square."""

    max_relative: Share
    rms_relative: Share


@dataclass(frozen=True)
class ErrorSummary:
    """The distance to the targets at the initial design, and at the answer: ``exact``."""

    initial: ErrorRow
    exact: ErrorRow
    predicted: Annotated[ErrorRow | None, Fact("by the last program", may_lack=True)] = None
    one_shot: Annotated[ErrorRow | None, Fact("the exact distance of the paper's answer")] = None


@dataclass(frozen=True)
class TargetAlong:
    """The errors of a target along one trajectory; ``rows`` are of the target's own arrays."""

    name: str
    rows: slice
    error: ErrorSummary


@dataclass(frozen=True, repr=False)
class FollowedRow(Brief):
    """A mode followed by its shape: its ``name``, and which modes (n,) it is, from the lowest."""

    name: str
    like: Annotated[int, Fact("its number where it is named")]
    initial_numbers: Annotated[Numbers, Fact("at each sample, before", name="initial_modes")]
    exact_numbers: Annotated[Numbers, Fact("at each sample of the answer", name="exact_modes")]


@dataclass(frozen=True, repr=False)
class ModeRow(Brief):
    """Exact frequencies (n_t,) of a mode before and after (Figure 5)."""

    mode: int
    initial_hz: Curve
    optimal_hz: Curve


OfSamples = Annotated[Sequence[str] | None, Fact("of each sample, of several", optional=True)]


@dataclass(frozen=True, repr=False)
class Curves(Brief):
    """A target over its samples."""

    time_s: Annotated[Floats, Fact("from the start of its trajectory", unit="s")]
    trajectory: OfSamples
    target_hz: Annotated[Curve, Fact("wanted, or the limit, of a band the lower edge")]
    initial_hz: Annotated[Curve, Fact("exact, at the initial design")]
    one_shot_hz: Annotated[Curve | None, Fact("exact, at the paper's design")]
    predicted_hz: Annotated[Curve | None, Fact("by the last program", may_lack=True)]
    exact_hz: Annotated[Curve, Fact("exact, at the answer")]
    lower_hz: Annotated[Curve | None, Fact("lower edge of a limit", optional=True)] = None
    upper_hz: Annotated[Curve | None, Fact("upper edge of a limit", optional=True)] = None


@dataclass(frozen=True, repr=False)
class TargetStudy(Brief):
    """One target along the trajectory (the paper's Figure 4); arrays (n,) in Hz.

    They belong to the rows of all samples at which what is ``asked`` holds, and are its curve: of
    its mode, of a gap the distance of its two, of a band the frequency nearest to its middle.
    Errors of limits and bands are relative violations, 0 where they are met. ``weight_s`` is the
    time that it stands for, weighted. ``near`` are the modes about a band; None of other kinds.
    """

    asked: Annotated[Requirement, Fact(flat=True)]
    time_s: Unwritten[Floats]
    initial_hz: Unwritten[Floats]
    exact_hz: Unwritten[Floats]
    predicted_hz: Unwritten[Floats | None]
    one_shot_hz: Unwritten[Floats | None]
    error: ErrorSummary
    satisfied: bool
    weight_s: Unwritten[float]
    along: Unwritten[tuple[TargetAlong, ...]]
    followed: Unwritten[tuple[FollowedRow, ...]] = ()
    near: Annotated[tuple[ModeRow, ...] | None, Fact("modes about a band", optional=True)] = None
    room: Annotated[
        Share | None, Fact("least distance to the limit, relative to it; below 0 it is missed")
    ] = None

    @property
    def label(self) -> str:
        """What is asked, in words: "mode 2 at least 320 Hz"."""
        return self.asked.label

    @property
    @told()
    def closest(self) -> str:
        """What is asked of the mode that is nearest to it: "mode 2 clear of 24 … 26 Hz"."""
        low, high, of = self.asked.lower, self.asked.upper, self.asked.modes
        rows = [row for row in self.near or () if not of or row.mode in of]
        if not rows:
            return self.label
        hz = np.array([row.optimal_hz for row in rows])
        k = int(np.maximum(1.0 - hz / low, hz / high - 1.0).min(axis=1).argmin())
        return f"mode {rows[k].mode} clear of{self.label.partition(' clear of')[2]}"

    @property
    @told()
    def mode(self) -> int | None:
        """The lowest of its modes; null of one followed by its shape, and of an antiresonance."""
        return None if self.asked.followed else self.asked.mode

    @property
    @told("followed", optional=True)
    def by_shape(self) -> FollowedRow | None:
        """The first that is followed by its shape."""
        return next(iter(self.followed), None)

    @property
    @told()
    def worst(self) -> Share:
        """The largest error or violation of the answer."""
        return self.error.exact.max_relative

    @property
    @told()
    def frequencies(self) -> Curves:
        """Its curves with what is asked."""
        asked, names = self.asked, None
        if asked.trajectory is not None or len(self.along) > 1:
            names = [one.name for one in self.along for _ in self.time_s[one.rows]]
        own = self.initial_hz, self.one_shot_hz, self.predicted_hz, self.exact_hz
        edges = (asked.lower, asked.upper) if not asked.is_goal else ()
        limits = (hz if np.isfinite(hz).all() else None for hz in edges)
        return Curves(self.time_s, names, asked.hz, *own, *limits)

    @property
    def numbers(self) -> set[int]:
        """The modes that it names, and those that followed ones are with the answer."""
        followed = (row.exact_numbers.tolist() for row in self.followed)
        return {mode for mode in {*self.asked.modes}.union(*followed) if mode > 0}

    @property
    def judged(self) -> set[int]:
        """``numbers``, and of a band those about it."""
        return self.numbers.union(row.mode for row in self.near or ())

    @property
    def approximation_error(self) -> float:
        """Largest |predicted / exact − 1| along the trajectory, at the optimum; 0 if not known."""
        if self.predicted_hz is None:
            return 0.0
        return _worst(np.asarray(self.predicted_hz / self.exact_hz - 1.0))


@dataclass(frozen=True)
class SolverRow:
    """The residuals that the one-shot program's solver reached, recomputed from the data."""

    status: str
    iterations: int
    primal_residual: Residual
    dual_residual: Residual
    gap: Annotated[Residual, Fact("between the primal and the dual objective")]


@dataclass(frozen=True)
class OptimalityRow:
    """The extent to which the answer is known to be optimal."""

    kind: Annotated[str, Fact("proved, bounded or local")]
    stationarity: Annotated[float | None, Fact("what remains of the first-order conditions")]
    gap: Annotated[Share | None, Fact("of the objective, within which it is bounded")]
    words: Annotated[str, Fact("the same in words")]


@dataclass(frozen=True)
class LocalOptimum:
    """One of the distinct local optima found; objective as `AssignmentRow.objective` is."""

    design: Floats
    objective: float
    violation: Violation


@dataclass(frozen=True)
class LimitRow:
    """A limit of a quantity of the design, of its mass say, before and after; SI ``unit``."""

    name: str
    words: Annotated[str, Fact("the limit in words")]
    unit: str
    lower: InUnit | None
    upper: InUnit | None
    initial: InUnit
    optimal: InUnit
    satisfied: bool
    initial_violation: Violation
    violation: Violation
    extreme: Annotated[InUnit | None, Fact("of the most extreme design, where none keeps it")]
    stated: Annotated[str, Fact("the limit with the amount of the answer, in words")]

    @property
    @told()
    def room(self) -> Share | None:
        """The least distance to the limit, relative to it; below 0 it is missed, null of 0."""
        sides = ((1.0, self.lower), (-1.0, self.upper))
        ways = (sign * (self.optimal - edge) / abs(edge) for sign, edge in sides if edge)
        return min(ways, default=None)


@dataclass(frozen=True)
class ViolationRow:
    """The largest violation of any limit, before and with the answer, and which limit has it.

    Limits and bands of frequencies count, and all of mass, drives, statics and sums of parameters.
    """

    initial: Violation
    exact: Violation
    initial_limit: Annotated[str | None, Fact("the limit in words; null where all are kept")]
    exact_limit: Annotated[str | None, Fact("the same with the answer")]

    @property
    def words(self) -> str:
        """``31 % before (mass at most 6 kg), 0 % after``; one limit of both is named once."""
        named = [f" ({limit})" if limit else "" for limit in (self.initial_limit, self.exact_limit)]
        first = "" if self.initial_limit == self.exact_limit else named[0]
        return f"{percent(self.initial)} before{first}, {percent(self.exact)} after{named[1]}"


@dataclass(frozen=True)
class ClearanceRow:
    """Whether a band is clear, as checked, along a trajectory with ``below`` modes under it.

    ``room`` is the least distance of a mode relative to the edge, less what it may deviate between
    the points looked at, and less ``raised``: how much too high the mode above may be for mesh and
    reduced links, relative; None where that is not known.
    """

    label: Annotated[str, Fact("the band in words", "band")]
    below: Annotated[int, Fact("modes under it", "modes below")]
    clear: Annotated[bool, Fact(digits=lambda clear: "checked" if clear else "NO")]
    room: Annotated[Share, Fact("relative to the edge", "room at least", digits=positive_percent)]
    counted: Annotated[bool, Fact("inertia confirmed the modes below at every sample")]
    raised: Annotated[
        Share | None,
        Fact(heading="model too high by", absent="not known", digits=partial(about, how="")),
    ]


@dataclass(frozen=True)
class CombinationRow:
    """One choice of every catalogue: ``choices`` by the catalogues' names; objective as above.

    ``error`` is the largest of wanted frequencies, null where none is wanted; ``price`` that of
    the choices that have one and of the change of what has a price for one unit.
    """

    choices: Mapping[str, str]
    design: Floats
    objective: Annotated[float, Fact(digits=number)]
    violation: Annotated[Violation, Fact(digits=violated)]
    error: Share | None = None
    mass: Kilograms | None = None
    price: Annotated[float | None, Fact(digits=number)] = None


@dataclass(frozen=True)
class CatalogueRow:
    """The best of the catalogues; the gap is null where nothing is known of it."""

    nodes: Annotated[int | None, Fact("combinations that were looked at")]
    gap: Annotated[Share | None, Fact("relative to the objective")]
    best: Annotated[tuple[CombinationRow, ...], Fact("the best few, the best first")]


@dataclass(frozen=True)
class AimRow:
    """What the objective makes light, high or wide, before and after, between the samples too."""

    label: Annotated[str, Fact("what is wanted", "objective")]
    initial: InUnit
    optimal: InUnit
    unit: Annotated[str, Fact("kg or Hz; empty for a share")]
    words: Annotated[str, Fact("what was reached, in words")] = ""

    @property
    def before(self) -> Annotated[str, Fact(heading="initial")]:
        """The initial one with its unit."""
        return self._said(self.initial)

    @property
    def after(self) -> Annotated[str, Fact(heading="optimal")]:
        """The optimal one with its unit."""
        return self._said(self.optimal)

    def _said(self, value: float) -> str:
        """A mass or time rounded to four digits; frequencies and room, which are at least, down."""
        if self.unit in ("kg", "s"):
            return handy(value, self.unit, 4)
        down = float(_DOWN.create_decimal(value))
        if self.unit:
            return f"{down:g} {self.unit}"
        return f"{100.0 * down:.4g} %" if value > 0.0 else "none"


@dataclass(frozen=True)
class RobustTarget(InOneUnit):
    """What the deviations do to one thing that is asked: errors, or relative violations.

    ``nominal`` and ``robust`` are what is asked for, in ``unit``, at the sample that is worst, of
    the optimum without deviations and of the robust design, neither deviating.
    """

    label: Annotated[str, Fact("in words", "target")]
    unit: str
    is_goal: Annotated[bool, Fact("a wanted frequency")]
    nominal: Annotated[InUnit, Fact("of the optimum without deviations", "alone")]
    robust: InUnit
    nominal_worst: Annotated[
        Share | None, Fact("of the optimum without deviations", "deviated alone", absent="no modes")
    ]
    worst: Annotated[Share, Fact("found by a search", "deviated", digits=positive_percent)]
    drawn: Annotated[Share, Fact("of random deviations", "at random")]

    @property
    def most(self) -> float:
        """The worst of all that were looked at."""
        return max(self.worst, self.drawn)


@dataclass(frozen=True, repr=False)
class RobustRow(Brief):
    """What deviations within the tolerances do to the robust design, and what it costs.

    ``nominal`` is the optimum without deviations, as are the amounts with that name.
    """

    scenarios: Annotated[int, Fact("deviations in which the search holds what is asked")]
    draws: Annotated[int, Fact("random deviations, 128 of them at all samples")]
    nominal: Floats
    measured: Annotated[str, Fact("the objective")]
    objective_nominal: Annotated[float, Fact("without masses and prices, not deviating")]
    objective: Annotated[
        float, Fact("the same at the worst deviation; of least_squares not deviating")
    ]
    mass_nominal: Kilograms
    mass: Kilograms
    price_nominal: float | None
    price: float | None
    targets: tuple[RobustTarget, ...]
    probability: Annotated[float | None, Fact("that all limits hold, as random values have it")]
    judged: Annotated[int | None, Fact("random values of what is uncertain")]
    probability_nominal: Annotated[float | None, Fact("of the optimum without deviations")]
    wanted: Annotated[float | None, Fact("probability that was asked for")]
    within: Annotated[str, Fact("what deviations lie in, in words")]

    @property
    def deviation(self) -> Annotated[float | None, Fact("standard, of the probability")]:
        """√(p(1 − p)/n) of n random values, one more failing than did."""
        if self.probability is None or not self.judged:
            return None
        failing = (1.0 - self.probability + 1.0 / self.judged) / (1.0 + 1.0 / self.judged)
        return float((failing * (1.0 - failing) / self.judged) ** 0.5)

    @property
    def is_rarer(self) -> bool:
        """True where the limits hold less often than was asked, by three standard deviations."""
        p, wanted, deviation = self.probability, self.wanted, self.deviation
        return None not in (p, wanted, deviation) and p + 3.0 * deviation < wanted  # type: ignore

    @property
    def checked(self) -> str:
        """What deviations lie in, and the probability that all limits hold, in words."""
        return f"{self.within} that were checked" + (f"; {self.chance}" if self.chance else "")

    @property
    def chance(self) -> str:
        """The probability that all limits hold, in words; empty where nothing is uncertain."""
        if self.probability is None or self.deviation is None or self.wanted is None:
            return ""
        alone = self.probability_nominal
        other = "" if alone is None else f", the optimum without deviations {100.0 * alone:.3g} %"
        return (
            f"all limits hold together with {100.0 * self.probability:.4g} % (± "
            f"{100.0 * self.deviation:.1g} %; {100.0 * self.wanted:g} % asked{other})"
        )

    @property
    def words(self) -> str:
        """What it costs to be robust, in words."""
        both, at_worst = (self.objective_nominal, self.objective), " at the worst deviation"
        has_goals = any(one.is_goal for one in self.targets)
        pairs = []
        if self.measured == "widest":
            pairs = [(f"least room {percent(-both[0])}", percent(-both[1]) + at_worst)]
        elif self.measured == "highest":
            pairs = [(f"least frequency {-both[0]:.4g}", f"{-both[1]:.4g} Hz{at_worst}")]
        elif self.measured == "worst_case" and has_goals:
            pairs = [(f"largest error {percent(both[0])}", percent(both[1]) + at_worst)]
        elif has_goals:
            pairs = [(f"rms error {percent(both[0] ** 0.5)}", percent(both[1] ** 0.5))]
        pairs += [(f"mass {number(self.mass_nominal)}", f"{number(self.mass)} kg")]
        if self.price is not None and self.price_nominal is not None:
            pairs += [(f"price {number(self.price_nominal)}", priced(self.price))]
        return ", ".join(" → ".join(pair) for pair in pairs).replace("-", "−")


@dataclass(frozen=True, repr=False, kw_only=True)
class AssignmentRow(Brief):
    """How the answer was found and what it is worth.

    Objectives are those of the exact problem: the weighted mean square relative error in Hz, of the
    worst case the largest weighted error; the mass in kg; less the least frequency in Hz, or the
    least room; prices included.
    """

    method: Annotated[str, Fact("sequential or one_shot")]
    objective: Annotated[str, Fact("least_squares, worst_case, lightest, highest or widest")]
    objective_initial: float
    objective_optimal: float
    optimality: OptimalityRow
    verdict: Annotated[str, Fact("reached, improved, unreachable, infeasible or do_not_use")]
    reason: Annotated[str, Fact("the verdict in a sentence")]
    steps: Annotated[tuple[StepRecord, ...], Fact("every design tried from the best start")] = ()
    starts: Annotated[int, Fact("how many designs a search began at")] = 0
    local_optima: Annotated[tuple[LocalOptimum, ...], Fact("distinct ones, the best first")] = ()
    exact_solves: int = 0
    ended: Annotated[str, Fact("how the search did")] = "one program"
    finished: bool = True
    active: Annotated[tuple[ActiveLimit, ...], Fact("limits that the answer lies on")]
    one_shot: Annotated[Floats | None, Fact("the paper's design")]
    max_error: Annotated[Share, Fact("the largest error that is accepted")]
    clearances: Annotated[tuple[ClearanceRow, ...], Fact("of bands to keep out of")] = ()
    model_error: Annotated[Share | None, Fact("how much too high mesh and reduced links are")]
    conflict: Annotated[tuple[str, ...], Fact("limits that contradict each other")] = ()
    catalogue: CatalogueRow | None = None
    limits: Annotated[tuple[LimitRow, ...], Fact("of quantities that need no frequency")] = ()
    shortcoming: Annotated[str | None, Fact("why this is no answer to build on")] = None
    aim: Annotated[AimRow | None, Fact("of an objective that is no error")] = None
    robust: RobustRow | None = None


# --- What the answer means


@dataclass(frozen=True)
class SensitivityRow:
    """How a frequency along the trajectory changes with one parameter, at the answer.

    ``hz_per_unit`` is ∂f/∂y, ``percent_per_percent`` (y/f) ∂f/∂y: each the mean over the samples,
    and with ``_largest`` the one of largest magnitude.
    """

    parameter: str
    unit: Annotated[str, Fact("of the parameter")]
    label: Annotated[str, Fact("the target in words", "target")]
    handy: Unwritten[tuple[str, float]]  # its unit that people read, and the size of that in SI
    hz_per_unit: Annotated[float, Fact(unit="Hz per SI unit")]
    hz_per_unit_largest: Annotated[float, Fact(unit="Hz per SI unit")]
    percent_per_percent: Annotated[float, Fact(unit="% per %", digits=".3g")]
    percent_per_percent_largest: Annotated[float, Fact(unit="% per %", digits=".3g")]

    @property
    def slope(self) -> Annotated[str, Fact(heading="mean")]:
        """``0.0123 Hz per mm``."""
        unit, size = self.handy
        return f"{self.hz_per_unit * size:.3g} Hz per {unit or 1}"


@dataclass(frozen=True)
class LeverRow:
    """The per cents by which a frequency rises for 1 % more of a property that is no parameter.

    (p/f) ∂f/∂p at the poses looked at: its mean, and the one of largest magnitude.
    """

    mode: Annotated[str, Fact("its name")]
    property: str
    percent_per_percent: Annotated[float, Fact(heading="mean", unit="% per %", digits=".3g")]
    percent_per_percent_largest: Annotated[
        float, Fact(heading="largest", unit="% per %", digits=".3g")
    ]

    def __str__(self) -> str:
        """Property and mean, ``sections.rod.diameter +0.9 %``."""
        return f"{self.property} {self.percent_per_percent:+.2g} %"


@dataclass(frozen=True)
class RelaxedRow:
    """A limit that the answer lies on, relaxed by ``amount``: what that gains to first order."""

    name: Annotated[str, Fact(heading="limit")]
    kind: Annotated[str, Fact("bound, constraint or target")]
    side: Annotated[str, Fact("lower or upper", "side")]
    amount: Annotated[InUnit, Fact("of a target the share of its limit")]
    unit: str
    quantity: Annotated[
        str, Fact("rms or worst error, room (fractions), frequency, mass, price or objective")
    ]
    before: float
    after: float
    words: Annotated[str, Fact("all of it in words", "relaxed, to first order")]


@dataclass(frozen=True)
class RangeRow:
    """Between what values (n,) in Hz a target's curve lies over some designs; ``error`` over them.

    ``how``: proved (nothing lies outside, both ends are reached) or bounded (nothing lies outside).
    """

    label: Annotated[str, Fact("the target in words", "target")]
    lowest_hz: Annotated[Curve, Fact(digits=_lowest)]
    highest_hz: Annotated[Curve, Fact(digits=_highest)]
    how: str
    error: Annotated[Share, Fact(digits=positive_percent)]


@dataclass(frozen=True, repr=False)
class Meaning(Brief):
    """The meaning of the answer: what it hangs on, what holds it back, how sure it is."""

    sensitivity: Annotated[tuple[SensitivityRow, ...], Fact("to each parameter")] = ()
    relaxed: Annotated[tuple[RelaxedRow, ...], Fact("what more room at limits gains")] = ()
    levers: Annotated[tuple[LeverRow, ...], Fact("of missed modes, the largest first")] = ()
    reach: Annotated[tuple[RangeRow, ...], Fact("over all designs within the bounds")] = ()
    unreachable: Annotated[tuple[str, ...], Fact("what is out of reach, in words")] = ()
    notes: Unwritten[tuple[str, ...]] = ()


# --- What there is to draw of a mechanism


@dataclass(frozen=True, repr=False)
class DrawnJoint(Brief):
    """One joint: ``kind`` is "turning", "sliding" or "fixed"."""

    name: str
    kind: str
    grounded: bool
    driven: bool  # a coordinate moves it
    places: Floats  # (n, d)
    axes: Floats  # (n, d): unit vector along which it slides; along its follower if fixed


@dataclass(frozen=True, repr=False)
class DrawnBody(Brief):
    """One body, or rigid link without extent."""

    name: str
    mass: float  # kg
    places: Floats  # (n, d)


@dataclass(frozen=True, repr=False)
class DrawnSpring(Brief):
    """One spring, between two places or from one to the ground."""

    name: str
    grounded: bool
    turning: bool  # it resists rotation only
    starts: Floats  # (n, d)
    ends: Floats  # (n, d): the starts again if grounded


@dataclass(frozen=True, repr=False)
class DrawnSolid(Brief):
    """The surface of a meshed link in n poses."""

    link: str
    places: Floats  # (n, n_points, d)
    faces: NDArray[np.intp]  # (m, 4) corners of each, the last one twice of a triangle


@dataclass(frozen=True, repr=False)
class DrawnPoses(Brief):
    """The mechanism in n poses: ``lines[pose][line]`` is a polyline (n_points, d)."""

    time_s: Floats  # (n,)
    lines: tuple[tuple[Floats, ...], ...]
    link_names: tuple[str, ...]
    line_links: tuple[str, ...] = ()  # per line the link it belongs to
    bodies: tuple[DrawnBody, ...] = ()
    tip_path: Floats | None = None  # (…, d), NaN between the end of a trajectory and the next
    of: tuple[str, ...] = ()  # of several trajectories the one that each pose belongs to
    joints: tuple[DrawnJoint, ...] = ()
    springs: tuple[DrawnSpring, ...] = ()
    # per line: the depth of its section at start and end, m; 0 without a section
    depths: tuple[tuple[float, float], ...] = ()
    solids: tuple[DrawnSolid, ...] = ()


@dataclass(frozen=True, repr=False)
class ModePictures(Brief):
    """Elastic modes at one pose and design: the rigid links at rest, and one deformed pose a mode.

    The largest displacement of each mode is ``amplitude`` times the mechanism's extent at rest;
    the opposite phase is as far on the other side.
    """

    title: str
    rigid_modes: int
    frequencies_hz: tuple[float, ...]
    where: str  # q and y in words
    amplitude: float
    rest: DrawnPoses  # one pose
    deformed: DrawnPoses  # a pose a mode


@dataclass(frozen=True, repr=False)
class MovingMode(Brief):
    """One mode in n poses, its largest displacement alike in all: half a period takes it to −."""

    name: str  # "mode 1"
    hz: Floats  # (n,)
    deformed: DrawnPoses


@dataclass(frozen=True, repr=False)
class Motion(Brief):
    """The mechanism in n poses along a trajectory, and modes in each of them."""

    trajectory: str
    rest: DrawnPoses
    modes: tuple[MovingMode, ...]  # what is asked for first


# --- Everything together


@dataclass(frozen=True, repr=False)
class TrajectoryRow(Brief):
    """One trajectory: the ``rows`` of all samples that are its own, and what it counts.

    ``tip`` (n, 2 or 3) is in m, where the case gives a path of the tip; ``loads`` are the
    properties that it sets, None where these are none.
    """

    name: str
    rows: Unwritten[slice]
    duration_s: Seconds
    weight: float
    tip: Unwritten[Floats | None]
    tip_unit: Unwritten[str] = "m"
    loads: Annotated[
        Mapping[str, float] | None, Fact("properties that it sets, SI", name="set", optional=True)
    ] = None
    error: ErrorSummary | None = None

    @property
    @told()
    def samples(self) -> int:
        """How many it has."""
        return int(self.rows.stop - self.rows.start)


@dataclass(frozen=True)
class MeshError:
    """The largest relative error of the mesh in frequency; infinite where it is too coarse."""

    modes: tuple[int, ...]
    error: Annotated[tuple[Share, ...], Fact("of each mode", unit="fraction", may_lack=True)]
    poses: Annotated[int, Fact("at which it was judged")]
    design: Annotated[str, Fact("of which it is: initial or optimal")]


@dataclass(frozen=True)
class SagRow:
    """How far the weight bends a named node from its place, where that is farthest."""

    node: str
    sag: Annotated[
        Floats, Fact("along the axes of the ground", "sag", "m", _metres, says_unit=True)
    ]

    @property
    def most(self) -> Annotated[Metres, Fact("at its largest")]:
        """Its length."""
        return float(np.linalg.norm(self.sag))


@dataclass(frozen=True)
class WeightRow:
    """What gravity changes of each mode's frequency, relative, that is not in it.

    Of stated ``gravity`` (m/s²) that is sag. Not stated (null), it is the forces inside and the sag
    of 9.81 m/s², whichever way is down.
    """

    gravity: Annotated[Floats | None, Fact("as stated", unit="m/s²")]
    modes: tuple[int, ...]
    change: Annotated[
        tuple[Share, ...], Fact("of each mode; infinite: it may buckle or fall", may_lack=True)
    ]
    poses: Annotated[int, Fact("at which it was judged")]
    design: Annotated[str, Fact("of which it is: initial, optimal or updated")]
    sag: Annotated[tuple[SagRow, ...], Fact("of named nodes, the farthest first")] = ()
    turn: Annotated[float | None, Fact("of a node under the weight at most", unit="rad")] = None
    buckling: Annotated[Share | None, Fact("the weight, relative to that which buckles")] = None
    struts: Annotated[
        Share | None, Fact("what imported matrices may put frequencies off, from 2 % of it on")
    ] = None


@dataclass(frozen=True)
class CaseRow:
    """The case that the numbers are of."""

    name: Annotated[str, Fact("of the case file, without its ending")]
    title: str
    author: str | None
    reference: Annotated[str | None, Fact("source of the case")]
    sha256: Annotated[str, Fact("of the case file")]
    files: Annotated[Mapping[str, str], Fact("SHA-256 of each file that it names")]

    @classmethod
    def of(cls, file: CaseFile) -> CaseRow:
        """That of a case file."""
        name = file.path.stem.encode("utf-8", "replace").decode("utf-8")
        return cls(name, file.title, file.author, file.reference, file.sha256, file.files)


@dataclass(frozen=True, repr=False, kw_only=True)
class Origin(Brief):
    """The beginning of results.json."""

    schema: Annotated[int, Fact("raised when a field goes or means something else")] = SCHEMA
    version: Annotated[str, Fact(name="eigassign_version")] = __version__
    case: CaseRow


@dataclass(frozen=True, repr=False, kw_only=True)
class RunResults(Origin):
    """A run; what it did not ask for is null or empty."""

    design: Annotated[
        tuple[DesignRow, ...], Fact("by parameter, in the order of the case", by="name")
    ] = ()
    mass: MassRow | None = None
    drives: Annotated[tuple[DriveRow, ...], Fact("what each exerts, by coordinate", by="name")] = ()
    statics: Annotated[
        tuple[StaticRow, ...], Fact("of static targets, by what they ask", by="name")
    ] = ()
    responses: Annotated[tuple[ResponseRow, ...], Fact("drawn ones", by="name")] = ()
    moves: Annotated[tuple[MoveRow, ...], Fact("with residual vibration", by="name")] = ()
    targets: Annotated[tuple[TargetStudy, ...], Fact("in the order of the case")] = ()
    assignment: Annotated[
        AssignmentRow | None, Fact("the verdict, and how the answer was found")
    ] = None
    meaning: Annotated[Meaning, Fact(flat=True)] = field(default_factory=Meaning)
    discretisation: Annotated[MeshError | None, Fact("how much too high the mesh is")] = None
    weight: Annotated[WeightRow | None, Fact("what gravity changes that is not computed")] = None
    studies: Annotated[
        tuple[ModeStudy, ...], Fact("of the expansion, mode by mode", name="approximation")
    ]
    trajectories: Annotated[tuple[TrajectoryRow, ...], Fact("in the order of the case")]
    solver: Annotated[SolverRow | None, Fact("the certificate of the one shot's program")] = None
    warnings: tuple[str, ...]
    notes: Annotated[tuple[str, ...], Fact("what was chosen and why")]
    timing_s: Annotated[Mapping[str, float], Fact("by stage", unit="s")]
    other_modes: Annotated[tuple[ModeRow, ...], Fact("some modes without a target")] = ()
    price: Annotated[float | None, Fact("of the choices and of the change of the design")] = None
    # for figures, tables and CSV files
    q_names: Unwritten[tuple[str, ...]]
    q_units: Unwritten[tuple[str, ...]]
    time_s: Unwritten[Floats]  # of each trajectory from its own start
    q: Unwritten[Floats]  # (n_t, n_q), of several trajectories one after the other
    poses: Unwritten[DrawnPoses]
    reduced: Unwritten[bool] = False  # links are
    orders: Unwritten[tuple[tuple[float, float, float], ...]] = ()  # multiple, of what Hz, margin
    given: Unwritten[tuple[str, ...]] = ()  # links, drives, what it carries where: a line each
    spectrum: Unwritten[tuple[ModeRow, ...]] = ()  # up to the mode above the highest asked for
    # by trajectory: instants between the samples too, and the modes there, where that is cheap
    between: Unwritten[Mapping[str, tuple[Floats, tuple[ModeRow, ...]]]] = field(
        default_factory=dict
    )
    only: Unwritten[str | None] = None  # of several trajectories the one that these are of
    moving: Unwritten[tuple[Motion, ...]] = ()  # of every trajectory, where a report shows it

    @property
    @told()
    def frequencies(self) -> Curves | None:
        """Those of the first target."""
        return self.targets[0].frequencies if self.targets else None

    @property
    def along(self) -> str:
        """The trajectory that the samples belong to, in words."""
        if self.only is not None:
            return f"trajectory {self.only!r}"
        several = len(self.trajectories) > 1
        return f"{len(self.trajectories)} trajectories" if several else "the trajectory"

    @property
    def interrupted(self) -> bool:
        """True where Ctrl-C ended the search: what was found until then is the answer."""
        return self.assignment is not None and self.assignment.ended == "interrupted"

    @property
    def thin(self) -> tuple[TargetStudy, ...]:
        """Limits met with less room than `THIN` or the error of mesh and links; the least first."""
        row = self.assignment
        if row is None or row.verdict != "reached" or row.robust is not None:
            return ()
        least = max(THIN, row.model_error or 0.0)
        found = (one for one in self.targets if one.room is not None and one.room < least)
        return tuple(sorted(found, key=lambda one: one.room or 0.0))

    @property
    def shortcoming(self) -> str | None:
        """Why this is not an answer to build on, in a sentence; None if it is."""
        return None if self.assignment is None else self.assignment.shortcoming

    @property
    @told()
    def error(self) -> ErrorSummary | None:
        """Over all wanted frequencies, else the violations of all limits; None without either."""
        found = [(target.error, target.weight_s) for target in counted_of(self.targets)]
        return over_all(found) if found else None

    @property
    @told()
    def violation(self) -> ViolationRow | None:
        """The largest of any limit, and which has it; None where nothing is limited."""
        return worst_violation(self.targets, self.assignment.limits if self.assignment else ())


def counted_of(targets: tuple[TargetStudy, ...]) -> tuple[TargetStudy, ...]:
    """The targets that errors are of: wanted frequencies, or else all that may be missed."""
    wanted = tuple(target for target in targets if target.asked.is_goal)
    return wanted or tuple(target for target in targets if not target.asked.is_aim)


def worst_violation(
    targets: Sequence[TargetStudy], limits: Sequence[LimitRow]
) -> ViolationRow | None:
    """The largest violation of all that may be violated; None where that is nothing."""
    asked = [one for one in targets if not one.asked.is_goal and not one.asked.is_aim]
    both = [(one.error.initial.max_relative, one.error.exact.max_relative) for one in asked]
    both += [(row.initial_violation, row.violation) for row in limits]
    if not both:
        return None
    names = [*(one.label for one in asked), *(row.words for row in limits)]
    worst = [
        max(zip(shares, names, strict=True), key=itemgetter(0))
        for shares in zip(*both, strict=True)
    ]
    (initial, before), (exact, after) = (one if one[0] > MET else (0.0, None) for one in worst)
    return ViolationRow(initial, exact, before, after)


def over_all(errors: Sequence[tuple[ErrorSummary, float]]) -> ErrorSummary:
    """The largest of the maxima, and of the mean squares their mean by the time they stand for."""
    weights = np.array([weight for _, weight in errors])
    found: dict[str, Any] = {}
    for kind in ("initial", "exact", "predicted", "one_shot"):
        rows = [getattr(error, kind) for error, _ in errors]
        if None not in rows:
            mean_square = weights @ [row.rms_relative**2 for row in rows] / weights.sum()
            worst = max(row.max_relative for row in rows)
            found[kind] = ErrorRow(worst, float(np.sqrt(mean_square)))
    return ErrorSummary(**found)


# --- The results along one of several trajectories


def along_each(results: RunResults) -> tuple[RunResults, ...]:
    """One for each trajectory, whose name is its ``only``; itself where there is none or one."""
    if len(results.trajectories) < 2:
        return (results,)
    return tuple(_along(results, row) for row in results.trajectories)


def _along(results: RunResults, row: TrajectoryRow) -> RunResults:
    rows = row.rows
    targets = (_target(target, row) for target in results.targets)
    return replace(
        results,
        only=row.name,
        time_s=results.time_s[rows],
        q=results.q[rows],
        trajectories=(replace(row, rows=slice(0, rows.stop - rows.start)),),
        studies=tuple(
            replace(study, over_time=_part(study.over_time, rows)) for study in results.studies
        ),
        targets=tuple(target for target in targets if target is not None),
        spectrum=_part(results.spectrum, rows),
        drives=_part(results.drives, rows),
        statics=_part(results.statics, rows),
    )


_OF_SAMPLES = (Comparison, ModeRow, FollowedRow, DriveRow, StaticRow, TargetStudy)


def _part(row: Row, rows: slice) -> Row:
    """What holds at some of the samples: of each array of rows of samples those."""
    if isinstance(row, np.ndarray):
        return row[rows]  # type: ignore[return-value]
    if isinstance(row, tuple):
        return type(row)(_part(one, rows) for one in row)
    if isinstance(row, _OF_SAMPLES):
        return replace(row, **{k: _part(v, rows) for k, v in vars(row).items()})
    return row


def _target(target: TargetStudy, row: TrajectoryRow) -> TargetStudy | None:
    """The target along one trajectory; None where it does not hold there."""
    along = next((one for one in target.along if one.name == row.name), None)
    if along is None:
        return None
    rows, asked = along.rows, target.asked.part(along.name, along.rows)
    first, length = asked.rows.start - row.rows.start, rows.stop - rows.start
    return replace(
        _part(target, rows),
        asked=replace(asked, rows=slice(first, first + length)),
        error=along.error,
        along=(replace(along, rows=slice(0, length)),),
    )
