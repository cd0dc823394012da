"""How jobs are timed: a first run, repeats in turns, medians with quartiles; and the machine.

Processor time, which on one thread is the time it takes where nothing else runs.
"""

from __future__ import annotations

import os
import platform
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from time import process_time
from typing import Any, TypeVar

import numpy as np
import scipy

from eigassign._version import __version__
from eigassign.chart.results import Machine, Timing

T = TypeVar("T")
Clock = Callable[[], float]
CPU_INFO = Path("/proc/cpuinfo")


@dataclass(frozen=True)
class Patience:
    """How long jobs are repeated: ``rounds`` times, each for at least ``seconds`` in all.

    A job whose first run takes longer than ``long_s`` is not repeated.
    """

    rounds: int = 7
    seconds: float = 0.01
    long_s: float = 1.0


def timed(job: Callable[[], T], clock: Clock = process_time) -> tuple[T, float]:
    """What the job returns, and the seconds it took."""
    start = clock()
    result = job()
    return result, clock() - start


def take_turns(
    jobs: Sequence[tuple[Callable[[], object], float]],
    patience: Patience,
    clock: Clock = process_time,
) -> list[Timing]:
    """Time each (job, seconds of its first run), all of which have run once.

    The jobs take turns, round after round, so that all see the same machine; within a round a short
    job is repeated and its quickest run counts, which is the one least disturbed.
    """
    spent: list[list[float]] = [[] for _ in jobs]
    for _ in range(patience.rounds):
        for (job, first), mine in zip(jobs, spent, strict=True):
            if first <= patience.long_s:
                mine.append(_quickest(job, patience.seconds, clock))
    return [_summary(mine, first) for (_, first), mine in zip(jobs, spent, strict=True)]


def _quickest(job: Callable[[], object], seconds: float, clock: Clock) -> float:
    best, total = float("inf"), 0.0
    while total < seconds or best == float("inf"):
        _, once = timed(job, clock)
        best, total = min(best, once), total + max(once, 1e-7)
    return best


def _summary(spent: Sequence[float], first: float) -> Timing:
    """Median and quartiles; of a job that was not repeated, its first run."""
    if not spent:
        return Timing(first, first, first, 0)
    low, median, high = (float(v) for v in np.quantile(spent, (0.25, 0.5, 0.75)))
    return Timing(median, low, high, len(spent))


def measure(
    job: Callable[[], T], patience: Patience, clock: Clock = process_time
) -> tuple[T, Timing]:
    """What one job returns, and how long it takes after a first run."""
    result, first = timed(job, clock)
    return result, take_turns([(job, first)], patience, clock)[0]


def time_in_words(seconds: float) -> str:
    """Three digits with a unit: ``12.3 µs``."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds / 1e-9:.3g} ns" if seconds > 0.0 else "0"


def machine(cpu_info: Path = CPU_INFO) -> Machine:
    """Processor, cores, versions, linear algebra and its threads; no names of host or user.

    ``cpu_info`` is where the operating system names the processor.
    """
    try:
        lines = cpu_info.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    named = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    settings: Any = np.show_config(mode="dicts")
    blas = settings.get("Build Dependencies", {}).get("blas", {})
    threads = {os.environ.get(f"{name}_NUM_THREADS") for name in ("OPENBLAS", "OMP", "MKL")}
    return Machine(
        processor=(named or [platform.processor()])[0] or platform.machine(),
        cores=os.cpu_count() or 1,
        system=f"{platform.system()} {platform.machine()}",
        versions={
            "eigassign": __version__,
            "Python": platform.python_version(),
            "NumPy": np.__version__,
            "SciPy": scipy.__version__,
        },
        blas=f"{blas.get('name', 'unknown')} {blas.get('version', '')}".strip(),
        threads="1" if threads == {"1"} else "as the library chooses",  # NumPy does not tell
    )
