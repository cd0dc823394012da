"""What is asked of a chart and what it holds, as plain numbers, and the words for these.

Seconds and Hz; errors are those of a frequency, over all charted modes. Every number can be
computed again from ``parameters``, the seed and the case file.
"""

from __future__ import annotations

import os
import platform
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, cast

import numpy as np
import scipy

from eigassign._version import __version__
from eigassign.facts import Fact, Hertz, Seconds, Share, time_in_words
from eigassign.study.results import CaseRow

SCHEMA = 7  # of chart.json
_BREAK_EVEN = "evaluations from which it beats exact solves"
ACCURACIES = (1e-2, 1e-4, 1e-6, 1e-8)  # worst relative errors in Hz that are advised for
ErrorHz = Annotated[Hertz, Fact(digits=".2e")]
RelativeError = Annotated[Share, Fact("of the frequency", "relative", digits=".1e")]
_KINDS = {  # of methods whose family begins so: the first that fits
    "Taylor": "series of λ",
    "1/λ": "series of 1/λ",
    "reduced": "reduced models",
    "exact by others": "exact solves by others",
    "exact": "exact solves",
}


def kind_of(family: str) -> str:
    """The kind of a family's methods in words."""
    return next(kind for beginning, kind in _KINDS.items() if family.startswith(beginning))


def machine() -> dict[str, Any]:
    """Processor, cores, versions, linear algebra and its threads; no names of host or user."""
    file, settings = Path("/proc/cpuinfo"), cast(dict[str, Any], np.show_config(mode="dicts"))
    lines = file.read_text(errors="replace").splitlines() if file.exists() else []
    named = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    blas = settings.get("Build Dependencies", {}).get("blas", {})
    threads = {os.environ.get(f"{name}_NUM_THREADS") for name in ("OPENBLAS", "OMP", "MKL")}
    packages = {"eigassign": __version__, "NumPy": np.__version__, "SciPy": scipy.__version__}
    return {
        "processor": (named or [platform.processor()])[0] or platform.machine(),
        "cores": os.cpu_count() or 1,
        "system": f"{platform.system()} {platform.machine()}",
        "versions": {"Python": platform.python_version(), **packages},
        "blas": f"{blas.get('name', 'unknown')} {blas.get('version', '')}".strip(),
        "threads": "1" if threads == {"1"} else "as the library chooses",  # NumPy does not tell
    }


@dataclass(frozen=True)
class Timing:
    """Seconds: median and quartiles of ``repeats`` runs after a first one that does not count.

    ``repeats`` is 0 where the first run took so long that it alone was timed.
    """

    median_s: Seconds
    low_s: Seconds
    high_s: Seconds
    repeats: int

    def __str__(self) -> str:
        """Median and quartiles; one run alone is marked."""
        median, low, high = map(time_in_words, (self.median_s, self.low_s, self.high_s))
        if not self.median_s:
            return median
        return f"{median} ({low}–{high})" if self.repeats else f"{median} (once)"


@dataclass(frozen=True)
class Errors:
    """|f − f_exact| over ``samples`` points; ``failed`` gave no number and are infinitely wrong."""

    worst_hz: Annotated[ErrorHz, Fact(heading="worst")]
    rms_hz: ErrorHz
    worst_relative: RelativeError
    samples: int
    failed: Annotated[int, Fact(heading="no number", digits=lambda n: str(n or ""))]


@dataclass(frozen=True)
class ChartPoint:
    """One method: what it costs and how wrong it is."""

    method: Annotated[str, Fact("unique in its chart")]
    family: str
    ours: Annotated[bool, Fact("offered by eigassign; others are what people do without it")]
    parameters: Mapping[str, Any]
    offline: Annotated[Timing, Fact("set-up, exact solves included", "set-up")]
    online: Annotated[Timing, Fact("one evaluation out of a large batch", "one evaluation")]
    solves: Annotated[int, Fact("exact eigensolves of the set-up")]
    solves_online: Annotated[float, Fact("exact eigensolves of one evaluation")]
    everywhere: Annotated[Errors, Fact("random and along the trajectory")]
    random: Annotated[Errors | None, Fact("over random samples of trajectory × design box")]
    trajectory: Annotated[Errors | None, Fact("at several designs", "worst along the trajectory")]
    break_even: Annotated[float | None, Fact(_BREAK_EVEN, "pays from", "", ",.0f", "never")]
    use: Annotated[str, Fact("the call that asks for it", "how")] = ""
    key: Annotated[str, Fact("what a case file asks for it by, under `expansion`")] = ""

    @property
    def exact_solves(self) -> str:
        """The exact solves of the set-up, and of an evaluation."""
        each = f" + {self.solves_online:.2g} each" if self.solves_online else ""
        return f"{self.solves}{each}"

    def cost_s(self, evaluations: float | None) -> float:
        """Seconds for set-up and so many evaluations; of one evaluation alone where None."""
        if evaluations is None:
            return self.online.median_s
        return self.offline.median_s + evaluations * self.online.median_s


@dataclass(frozen=True)
class Front:
    """Methods that no other beats in cost and error at once, the most accurate first.

    The cost is that of ``evaluations`` with the set-up, or of one evaluation where it is None.
    """

    name: str
    evaluations: float | None
    methods: tuple[str, ...]


@dataclass(frozen=True)
class Advice:
    """What to write in a case for an accuracy: the lowest order that was measured to have it."""

    accuracy: Annotated[
        Share,
        Fact("the worst relative error in Hz", "asked for", digits=lambda a: f"{100.0 * a:.2g} %"),
    ]
    words: Annotated[str, Fact("what to write in the case, in a sentence")]
    key: Annotated[str | None, Fact("null: none does it", "under expansion", absent="none")] = None
    method: Annotated[str | None, Fact("the charted method that the key asks for")] = None
    worst_relative: Annotated[Share | None, Fact("its worst error", "worst error")] = None
    sample_s: Annotated[Seconds | None, Fact("its time", "a sample", "", time_in_words)] = None
    is_below_round_off: bool = False


@dataclass(frozen=True)
class MeshRow:
    """One mesh: ``elements`` in all, against the limit that the meshes converge to."""

    factor: Annotated[float, Fact("of the case's own elements", digits="g")]
    elements: int
    n_dof: Annotated[int, Fact("degrees of freedom", "dof")]
    worst_hz: Annotated[ErrorHz, Fact(heading="worst error")]
    worst_relative: RelativeError
    order: Annotated[float | None, Fact("observed, to the next finer mesh", digits=".2f")]
    solve: Annotated[Timing, Fact("one exact solve", "exact solve")]


@dataclass(frozen=True)
class Asked:
    """The question that every method is put."""

    modes: tuple[int, ...]
    n_dof: int
    random_points: int
    designs: int
    samples_per_design: int
    trajectory_samples: int
    seed: int
    typical_hz: Hertz
    floor_hz: Annotated[Hertz, Fact("round-off of exact answers: no error below it counts")]


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
    advice: tuple[Advice, ...]
    mesh: tuple[MeshRow, ...] = ()
    notes: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()
    seconds: Annotated[Seconds, Fact("that the chart took")] = 0.0

    @property
    def case(self) -> CaseRow:
        """The case that was charted."""
        return CaseRow(self.case_name, self.title, None, self.reference, self.case_sha256, {})
