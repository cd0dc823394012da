"""How much a chart tries, and how jobs are timed: a first run, then repeats, of which the median.

Processor time, which on one thread is the time it takes where nothing else runs.
"""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np
import scipy

from eigassign._version import __version__
from eigassign.chart.results import Timing

T = TypeVar("T")


@dataclass(frozen=True)
class Effort:
    """Points, sizes of the methods and time limits, unless given those without ``--quick``."""

    quick: bool = False
    random_points: int = 600  # at which methods are compared, beside
    samples_per_design: int = 152  # along the trajectory at several designs
    most_s: float = 60.0  # for the exact answers, one method's set-up, one search for a design
    orders: tuple[int, ...] = (1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 12)
    coefficients: int = 5000  # largest set that is expanded
    half_orders: tuple[int, ...] = (0, 1, 2, 3)
    expansion_points: tuple[int, ...] = (1, 3, 5)
    fitted: tuple[tuple[int, int], ...] = ((1, 3), (2, 1))  # half order, points of reduced models
    accuracies: tuple[float, ...] = (1e-2, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9)  # of fits
    nodes: tuple[int, ...] = (2, 3, 4, 5, 6, 7, 9, 11)  # of a grid, along each axis
    stations: tuple[int, ...] = (3, 5, 9, 17, 33, 65)
    training: tuple[int, ...] = (27, 64, 125, 343)  # points of surrogates
    factors: tuple[float, ...] = (0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0)  # of a mesh's elements
    most_dof: int = 40_000  # of a refined mesh
    objectives: int = 600  # exact evaluations of the objective in a search
    repeats: int = 15  # of a job, at most, and none is begun after
    repeat_s: float = 1.0  # its first run included


QUICK = Effort(
    quick=True, random_points=150, most_s=2.0, orders=(1, 2, 3, 4, 6, 8), coefficients=1000,
    expansion_points=(1, 3), fitted=(), accuracies=(1e-2, 1e-4, 1e-6, 1e-8), nodes=(3, 5, 7),
    stations=(5, 17), training=(27, 125), factors=(0.5, 1.0, 2.0, 4.0), most_dof=2500,
    objectives=60, repeat_s=0.1,
)  # fmt: skip


def timed(job: Callable[[], T]) -> tuple[T, float]:
    """The result of a job, and the seconds it took."""
    start = time.process_time()
    result = job()
    return result, time.process_time() - start


def measure(job: Callable[[], T], effort: Effort, count: int = 1) -> tuple[T, Timing]:
    """The result of a job, and how long each of its ``count`` parts takes.

    The first run does not count, for it warms caches, unless it takes too long for another.
    """
    result, first = timed(job)
    spent = list[float]()
    while len(spent) < effort.repeats and first + sum(spent) < effort.repeat_s:
        spent.append(timed(job)[1])
    median, low, high = (np.quantile(spent or [first], (0.5, 0.25, 0.75)) / count).tolist()
    return result, Timing(median, low, high, len(spent))


def time_in_words(seconds: float) -> str:
    """Three digits with a unit: ``12.3 µs``."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds / 1e-9:.3g} ns" if seconds > 0.0 else "0"


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
