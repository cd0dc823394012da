"""What a chart holds, as plain numbers, and what it tells in words: what to write, and why.

An error is |f/f_exact − 1| over all charted modes, at test points that no method has seen; times
are in seconds. Several charts stand side by side in a matrix.
"""

from __future__ import annotations

import os
import platform
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Annotated, Any

import numpy as np
import scipy

from eigassign._version import __version__
from eigassign.facts import Fact, Seconds, Share, percent, time_in_words
from eigassign.study.results import CaseRow

SCHEMA = 9  # of chart.json
EVALUATIONS = (1, 100, 10_000)  # trajectories over which a preparation is spread
ACCURACY = 1e-2  # wanted of a frequency, where nothing is said
UNFOLLOWED = ("straight or folded arm", "path not followed")  # findings, and charts at rest
ALIKE = 1.25  # times that differ by less are alike: a busy machine's spread
EQUAL = 100  # trajectories over which preparations are spread where cases are compared
Time = Annotated[Seconds, Fact(digits=time_in_words, says_unit=True)]


def off(error: float) -> str:
    """``1.6 % off``, or that a method has no number."""
    return f"{percent(error)} off" if np.isfinite(error) else "without a number somewhere"


RelativeError = Annotated[
    Share, Fact(may_lack=True, digits=lambda e: percent(e) if np.isfinite(e) else "no number")
]
TinyIfAny = Annotated[float | None, Fact(digits=lambda v: f"{v:.1e}" if v else "0", absent="")]


class Kind(StrEnum):
    """The kinds of methods, each a curve."""

    FULL = "Taylor"
    LINEAR = "Taylor, linearised in y"
    SEVERAL = "Taylor, several points"
    RITZ = "Ritz model"
    INTERPOLATED = "interpolation along the path"
    SURFACE = "response surface"
    RADIAL = "radial basis functions"
    KRIGING = "Kriging"
    EXACT = "exact, eigassign"
    SCIPY = "exact, SciPy"
    MESH = "mesh"


def machine() -> dict[str, Any]:
    """Processor, cores, versions and threads of linear algebra; no names of host or user."""
    packages = {"eigassign": __version__, "NumPy": np.__version__, "SciPy": scipy.__version__}
    return {
        "processor": platform.processor() or platform.machine(),
        "cores": os.cpu_count() or 1,
        "versions": {"Python": platform.python_version(), **packages},
        "threads": os.environ.get("OMP_NUM_THREADS", "as the library chooses"),
    }


@dataclass(frozen=True)
class ChartPoint:
    """One method of one size: what it costs and how wrong it is."""

    method: Annotated[str, Fact("unique in its chart")]
    curve: Annotated[str, Fact("the kind of method")]
    size: Annotated[str, Fact("order, number of vectors, stations, elements or points")]
    preparation_s: Annotated[Time, Fact("of all that comes before the first answer", "preparation")]
    trajectory_s: Annotated[Time, Fact("one design at all samples", "one trajectory")]
    spread_s: Annotated[Seconds, Fact("median of the repeats above their least", "spread")]
    worst_relative: Annotated[RelativeError, Fact("at the test points", "worst error")]
    rms_relative: Annotated[RelativeError, Fact(heading="rms error")]
    failed: Annotated[int, Fact("test points without a number", digits=lambda n: str(n or ""))]
    use: Annotated[str, Fact("the call or key that asks for it", "how")] = ""

    def cost_s(self, evaluations: float) -> float:
        """Seconds of a trajectory, with its share of the preparation."""
        return self.trajectory_s + self.preparation_s / evaluations


@dataclass(frozen=True)
class Front:
    """Methods that are accurate enough, and that no other beats in cost and error at once."""

    evaluations: Annotated[int, Fact("trajectories over which the preparation is spread")]
    methods: Annotated[tuple[str, ...], Fact("the cheapest first")]


@dataclass(frozen=True)
class BoxRow:
    """The worst error where only a part of the case's ranges is used, about the same point."""

    method: str
    varied: Annotated[str, Fact("q, y, or q and y")]
    half_width: Annotated[float, Fact("of the case's own ranges; 1: all of them", digits="g")]
    worst_relative: Annotated[RelativeError, Fact(heading="worst error")]


@dataclass(frozen=True)
class Reach:
    """How far a method goes: the half-width up to which its error is below the one wanted."""

    method: str
    varied: str
    half_width: Annotated[float, Fact("1: all of the case's own ranges", "goes to", digits=".2g")]
    error_at_all: Annotated[RelativeError, Fact("at all of them", "error at all")]


@dataclass(frozen=True)
class Finding:
    """Something at which methods fail: what, where, why, and what serves instead."""

    kind: Annotated[str, Fact(heading="what")]
    where: str
    methods: Annotated[str, Fact("that fail by it", "fail")]
    why: str
    instead: str
    modes: Annotated[tuple[int, ...], Fact(digits=lambda m: ", ".join(map(str, m)))] = ()
    gap: Annotated[TinyIfAny, Fact("of the frequencies, relative")] = None


@dataclass(frozen=True)
class Advice:
    """What to write for a question, and what it was measured to give."""

    question: str
    words: Annotated[str, Fact("what to write, and the consequence", "write")]
    key: Annotated[str | None, Fact("of the case file", absent="")] = None


@dataclass(frozen=True)
class Asked:
    """The question that every method is put."""

    modes: Annotated[tuple[int, ...], Fact(digits=lambda m: ", ".join(map(str, m)))]
    n_dof: int
    varied: Annotated[tuple[str, ...], Fact("design parameters with room")]
    designs: int
    test_points: int
    trajectory_samples: int
    accuracy: Annotated[Share, Fact("wanted of a frequency")]
    floor: Annotated[RelativeError, Fact("round-off of exact answers: no error below it counts")]
    clock_s: Annotated[Seconds, Fact("resolution of the clock")]


@dataclass(frozen=True, kw_only=True)
class Chart:
    """Everything that one chart shows."""

    schema: Annotated[int, Fact("raised when a field goes or means something else")] = SCHEMA
    title: str
    case_name: str
    case_sha256: str
    reference: str | None
    version: str
    quick: bool
    machine: Annotated[Mapping[str, Any], Fact("that the times were measured on")]
    asked: Asked
    points: tuple[ChartPoint, ...]
    skipped: Annotated[tuple[tuple[str, str], ...], Fact("method, why")]
    fronts: tuple[Front, ...]
    boxes: tuple[BoxRow, ...]
    reach: tuple[Reach, ...]
    findings: tuple[Finding, ...]
    advice: tuple[Advice, ...] = ()
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    seconds: Annotated[Seconds, Fact("that the chart took")] = 0.0

    @property
    def case(self) -> CaseRow:
        """The case that was charted."""
        return CaseRow(self.case_name, self.title, None, self.reference, self.case_sha256, {})

    @property
    def headline(self) -> str:
        """How good the paper's method is here, how far it goes, and what to write, in sentences."""
        kinds = dict.fromkeys(f.kind for f in self.findings)
        said = ", ".join(kind for kind in kinds if kind not in ("refused", "out of memory"))
        lines = [f"Found: {said}."] if said else []
        lines += ["Charted at rest, without motion."] if kinds.keys() & set(UNFOLLOWED) else []
        paper = {p.size: p.worst_relative for p in self.points if p.curve == Kind.LINEAR}
        if paper:
            size = "order 4" if "order 4" in paper else next(reversed(paper))
            line = f"The paper's method (series linearised in y, {size}) is "
            line += f"{off(paper[size])} at worst"
            if min(paper.values()) > 0.5 * paper[size] > 0.01 * self.asked.accuracy:
                line += ", and more orders do not help"
            reach = [r for r in self.reach if r.method == f"{Kind.LINEAR}, {size}"]
            far = "; ".join(_far(r, self.asked.varied) for r in reach if r.half_width < 1.0)
            line += f"; it is within {percent(self.asked.accuracy)} up to {far}" if far else ""
            lines.append(f"{line}.")
        lines += [f"{one.words[:1].upper()}{one.words[1:]}." for one in self.advice if one.key]
        return " ".join(lines)


@dataclass(frozen=True)
class Cell:
    """One kind of method on one case."""

    case: str
    curve: str
    error_at_equal_cost: Annotated[
        RelativeError | None, Fact("the least for at most the time of exact solves", absent="none")
    ]
    cost_at_equal_accuracy: Annotated[
        float | None,
        Fact("the least with the accuracy wanted, of that of exact solves", digits=".2g",
             absent="none"),
    ]  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class Matrix:
    """Scenes × methods."""

    schema: int = SCHEMA
    version: str
    accuracy: Share
    evaluations: Annotated[int, Fact("trajectories over which preparations are spread")]
    machine: Mapping[str, Any]
    cases: Annotated[tuple[str, ...], Fact("in the order of the rows")]
    cells: tuple[Cell, ...]
    findings: Annotated[Mapping[str, tuple[Finding, ...]], Fact("by case")]
    refused: Annotated[tuple[tuple[str, str], ...], Fact("case, why")]
    warnings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    seconds: Seconds = 0.0

    @property
    def case(self) -> CaseRow:
        """What stands at the head of its page."""
        count = f"{len(self.cases)} cases"
        return CaseRow(count, "Scenes × methods", None, None, "", {})

    @property
    def headline(self) -> str:
        """How many cases there are, and in how many methods fail by name."""
        fail = sum(1 for found in self.findings.values() if found)
        refused = f"; {len(self.refused)} refused" if self.refused else ""
        return f"{len(self.cases)} cases, methods fail by name in {fail}{refused}"


# --- What to write


def advised(chart: Chart) -> Chart:
    """The chart with what to write."""
    return replace(chart, advice=tuple(_advise(chart)))


def _far(reach: Reach, names: Sequence[str]) -> str:
    """``0.87 of the bounds of m1, m2``."""
    shown = ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")
    of = {"q": "the motion", "y": f"the bounds of {shown}", "q and y": "motion and bounds together"}
    return f"{reach.half_width:.2g} of {of[reach.varied]}"


def _advise(chart: Chart) -> Iterator[Advice]:
    accuracy, n = chart.asked.accuracy, EVALUATIONS[-1]
    able = [p for p in chart.points if p.worst_relative <= accuracy]
    if any(p.curve == Kind.FULL for p in chart.points):
        key, none = None, "solve exactly: no series that was charted is within"
        words = f"{none} {percent(accuracy)}"
        for p in [p for p in able if p.curve == Kind.FULL][:1]:
            key = p.size.replace("order ", "order: ")
            words = f"write `{key}` under `expansion`: {percent(p.worst_relative)} off at worst"
        yield Advice("the series (`expand`)", words, key)
    offered = [p for p in able if p.use and p.curve != Kind.MESH]
    least = min((p.cost_s(n) for p in offered), default=0.0)
    for p in [p for p in offered if p.cost_s(n) <= 2.0 * least][:1]:  # the simplest of the cheap
        words = f"{p.method}, {percent(p.worst_relative)} off, {time_in_words(p.trajectory_s)} a "
        yield Advice("thousands of evaluations elsewhere", f"{words}trajectory: `{p.use}`")
    for p in [p for p in able if p.curve == Kind.MESH and p.use][:1]:
        words = f"write `{p.use}` for every link: {percent(p.worst_relative)} from the finest mesh"
        yield Advice("the mesh", words, p.use)


def build_matrix(
    charts: Mapping[str, Chart], refused: Mapping[str, str], accuracy: float, seconds: float
) -> Matrix:
    """Scenes × methods: errors at equal cost, that of exact solves, and costs at equal accuracy."""
    cells = [Cell(name, k, *_cell(chart, k)) for name, chart in charts.items() for k in Kind]
    return Matrix(
        version=__version__, accuracy=accuracy, evaluations=EQUAL, machine=machine(),
        cases=tuple(charts), cells=tuple(cells), refused=tuple(refused.items()),
        findings={name: chart.findings for name, chart in charts.items()}, seconds=seconds,
        notes=tuple(dict.fromkeys(note for chart in charts.values() for note in chart.notes)),
    )  # fmt: skip


def _cell(chart: Chart, curve: str) -> tuple[float | None, float | None]:
    exact_s = min(p.cost_s(EQUAL) for p in chart.points if p.curve == Kind.EXACT)
    own = [(p.cost_s(EQUAL) / exact_s, p.worst_relative) for p in chart.points if p.curve == curve]
    cheap = [error for cost, error in own if cost <= ALIKE]
    right = [cost for cost, error in own if error <= chart.asked.accuracy]
    return min(cheap, default=None), min(right, default=None)
