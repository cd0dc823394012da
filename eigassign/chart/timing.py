"""Honest times: a warm-up, repeats, medians with quartiles; and what machine they are from.

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


@dataclass(frozen=True)
class Patience:
    """How long jobs are repeated: ``rounds`` times, each for at least ``seconds`` in all.

    A job whose first run takes longer than ``long_s`` is not repeated.
    """

    rounds: int = 7
    seconds: float = 0.01
    long_s: float = 1.0


Clock = Callable[[], float]


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
    """Time (job, seconds of its first run) for each; all have run once, and are warm.

    The jobs take turns, round after round, so that all see the same machine; within a round a short
    job is repeated and its quickest run counts, which is the one least disturbed.
    """
    spent: list[list[float]] = [[] for _ in jobs]
    for _ in range(patience.rounds):
        for (job, first), mine in zip(jobs, spent, strict=True):
            if first <= patience.long_s:
                mine.append(_quickest(job, patience.seconds, clock))
    return [summary(mine, first) for (_, first), mine in zip(jobs, spent, strict=True)]


def _quickest(job: Callable[[], object], seconds: float, clock: Clock) -> float:
    best, total = float("inf"), 0.0
    while total < seconds or best == float("inf"):
        _, once = timed(job, clock)
        best, total = min(best, once), total + max(once, 1e-7)
    return best


def summary(spent: Sequence[float], first: float) -> Timing:
    """Median and quartiles; of a job that was not repeated, its first run."""
    if not spent:
        return Timing(first, first, first, 0)
    low, median, high = (float(v) for v in np.quantile(spent, (0.25, 0.5, 0.75)))
    return Timing(median, low, high, len(spent))


def measure(
    job: Callable[[], T], patience: Patience, clock: Clock = process_time
) -> tuple[T, Timing]:
    """What one job returns, and how long it takes once it is warm."""
    result, first = timed(job, clock)
    return result, take_turns([(job, first)], patience, clock)[0]


def machine() -> Machine:
    """Processor, cores, versions, linear algebra and its threads; no names of host or user."""
    versions = {
        "eigassign": __version__,
        "Python": platform.python_version(),
        "NumPy": np.__version__,
        "SciPy": scipy.__version__,
    }
    return Machine(
        processor=_processor(),
        cores=os.cpu_count() or 1,
        system=f"{platform.system()} {platform.machine()}",
        versions=versions,
        blas=_blas(),
        threads=_threads(),
    )


def _processor(where: Path = Path("/proc/cpuinfo")) -> str:
    """The model's name as the operating system gives it."""
    try:
        lines = where.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        lines = []
    named = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return (named or [platform.processor()])[0] or platform.machine()


def _blas() -> str:
    settings: Any = np.show_config(mode="dicts")
    found = settings.get("Build Dependencies", {}).get("blas", {})
    return f"{found.get('name', 'unknown')} {found.get('version', '')}".strip()


def _threads() -> str:
    """What the environment grants the linear algebra: read, for NumPy does not tell."""
    limits = {os.environ.get(f"{name}_NUM_THREADS") for name in ("OPENBLAS", "OMP", "MKL")}
    return "1" if limits == {"1"} else "as the library chooses"
