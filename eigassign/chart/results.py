"""What a chart holds, as plain numbers and the words for them: seconds, Hz, relative errors.

An error is |f / f_exact − 1| over all charted modes, at test points that no method has seen.
"""

from __future__ import annotations

import os
import platform
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import scipy

from eigassign._version import __version__
from eigassign.facts import Fact, Seconds, Share, time_in_words
from eigassign.study.results import CaseRow

SCHEMA = 8  # of chart.json
EVALUATIONS = (1, 100, 10_000)  # trajectories over which a preparation is spread
ACCURACY = 1e-2  # wanted of a frequency, where nothing is said
Time = Annotated[Seconds, Fact(digits=time_in_words, says_unit=True)]
RelativeError = Annotated[Share, Fact(may_lack=True)]


def machine() -> dict[str, Any]:
    """Processor, cores, versions and threads of linear algebra; no names of host or user."""
    file, threads = Path("/proc/cpuinfo"), os.environ.get("OMP_NUM_THREADS")
    lines = file.read_text(errors="replace").splitlines() if file.exists() else []
    named = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    packages = {"eigassign": __version__, "NumPy": np.__version__, "SciPy": scipy.__version__}
    return {
        "processor": [*named, platform.processor(), platform.machine()][0],
        "cores": os.cpu_count() or 1,
        "versions": {"Python": platform.python_version(), **packages},
        "threads": threads or "as the library chooses",  # NumPy does not tell
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
    worst_by_shape: Annotated[
        RelativeError | None,
        Fact("against the mode of the same shape", "worst by shape", absent=""),
    ]
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
    claimed: Annotated[
        RelativeError | None, Fact("what the method says of its own error, at worst", absent="")
    ]


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
    gap: Annotated[float | None, Fact("of the frequencies, relative", digits=".1e", absent="")] = (
        None
    )


@dataclass(frozen=True)
class Advice:
    """What to write for a question, and what it was measured to give."""

    question: str
    words: Annotated[str, Fact("what to write, and the consequence", "write")]
    key: Annotated[str | None, Fact("of the case file", absent="")] = None


@dataclass(frozen=True)
class OrderRow:
    """`optimize` with an expansion of this order."""

    order: int
    moved: Annotated[
        float | None,
        Fact("the design, from that of the highest order, of the bounds", digits=".1e", absent=""),
    ]
    one_shot: Annotated[RelativeError | None, Fact("the one shot's worst error", absent="")]


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
    orders: tuple[OrderRow, ...] = ()
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    seconds: Annotated[Seconds, Fact("that the chart took")] = 0.0

    @property
    def case(self) -> CaseRow:
        """The case that was charted."""
        return CaseRow(self.case_name, self.title, None, self.reference, self.case_sha256, {})


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
