"""What every benchmark shares: one BLAS thread, interleaved medians, tables in ``results/``.

Import it first: threads must be settled before NumPy is loaded.
"""

from __future__ import annotations

import os

for _name in ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ[_name] = "1"

import json
import platform
import resource
import statistics
import subprocess
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

RESULTS = Path(__file__).parent / "results"
CASES = Path(__file__).parents[1] / "cases"
Row = Mapping[str, object]


def medians(
    jobs: Mapping[str, Callable[[], object]],
    repeats: int | Mapping[str, int],
    clock: Callable[[], float] = time.process_time,
) -> dict[str, float]:
    """Median seconds of each job; the jobs take turns, so that all see the same machine.

    Processor time unless another clock is given: on a busy machine the wall clock punishes long
    jobs, and with one thread on a quiet one they are the same.
    """
    wanted = {name: repeats if isinstance(repeats, int) else repeats[name] for name in jobs}
    times: dict[str, list[float]] = {name: [] for name in jobs}
    for job in jobs.values():
        job()  # warm: tables, imports, caches
    rounds = max(wanted.values())
    for turn in range(rounds):
        for name, job in jobs.items():
            if len(times[name]) * rounds <= turn * wanted[name]:
                times[name].append(once(job, clock))
    return {name: statistics.median(values) for name, values in times.items()}


def once(job: Callable[[], object], clock: Callable[[], float] = time.process_time) -> float:
    """Seconds of one call."""
    start = clock()
    job()
    return clock() - start


def milliseconds(seconds: float) -> str:
    """Three digits, in ms."""
    return f"{seconds * 1e3:.3g} ms"


def children_s() -> float:
    """Processor seconds of all processes that were started here and have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def report(name: str, title: str, rows: Sequence[Row], remarks: Sequence[str] = ()) -> None:
    """Print a table and keep it as ``results/<name>.md`` and ``.json``."""
    lines = [f"# {title}", "", *_table(rows), "", *(f"- {r}" for r in remarks), f"- {machine()}"]
    print("\n".join(lines))
    RESULTS.mkdir(exist_ok=True)
    (RESULTS / f"{name}.md").write_text("\n".join(lines) + "\n", encoding="utf-8")
    data = {"title": title, "rows": list(rows), "remarks": list(remarks), "machine": machine()}
    (RESULTS / f"{name}.json").write_text(json.dumps(data, indent=1) + "\n", encoding="utf-8")


def _table(rows: Sequence[Row]) -> list[str]:
    head = list(dict.fromkeys(key for row in rows for key in row))
    body = [[_text(row.get(key, "")) for key in head] for row in rows]
    return [
        "| " + " | ".join(head) + " |",
        "|" + "---|" * len(head),
        *("| " + " | ".join(cells) + " |" for cells in body),
    ]


def _text(value: object) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def machine() -> str:
    """The version and commit that are measured, and what they run on."""
    import numpy
    import scipy

    import eigassign

    return (
        f"eigassign {eigassign.__version__} at commit {_commit()},"
        f" Python {platform.python_version()}, NumPy {numpy.__version__},"
        f" SciPy {scipy.__version__}, {platform.machine()}, one BLAS thread"
    )


def _commit() -> str:
    """The commit that is measured, with a + if anything but results has changed since."""

    def git(*words: str) -> str:
        done = subprocess.run(["git", *words], cwd=RESULTS, capture_output=True, text=True)
        return done.stdout.strip()

    changed = git("status", "--porcelain", "--untracked-files=no", "--", ":/", ":!.")
    return (git("rev-parse", "--short", "HEAD") or "unknown") + ("+" if changed else "")
