"""What a run will take, before it is made; and a picture of the mechanism alone."""

from __future__ import annotations

from dataclasses import dataclass
from time import perf_counter
from timeit import repeat

import numpy as np
from numpy.typing import NDArray

from eigassign.mechanism.trajectory.trajectory import Trajectories
from eigassign.pipeline.expansions import ExpansionSize, expansion_size
from eigassign.study.built_case import BuiltCase
from eigassign.study.planning import Plan

Floats = NDArray[np.float64]
ELSE_S = 1.5  # s, of every run of the shipped cases: start, report and figures
ALONE_MB = 150.0  # MB of a process, and for each unknown of a part before it is reduced: of 7 437
PART_MB = 0.05  # 330 MB in `check`, 420 MB in a search


@dataclass(frozen=True)
class Outlook:
    """About what a run takes: its full expansion, and all of `optimize` where it has targets."""

    modes: tuple[int, ...]
    expansion: ExpansionSize
    optimize_s: float | None
    memory_mb: float  # of a process


def outlook(
    case: BuiltCase, plan: Plan, trajectory: Trajectories | None, started: float
) -> Outlook:
    """Estimated from sizes, and from one exact solve of some samples, which is timed.

    `optimize` solves all samples exactly some 100 times for up to four starts: 26 to 165 times on
    the shipped cases. Before, it does again what was done since ``started`` (perf_counter).
    """
    built_s = perf_counter() - started
    size, asked = expansion_size(case.model(), plan), case.file.assignment
    reduced = case.model().reduced
    whole = [one.reduction for one in ([] if reduced is None else reduced.links)]
    memory_mb = ALONE_MB + size.memory_mb + PART_MB * sum(r.mesh.n_local for r in whole if r)
    if trajectory is None or not case.file.has_question:
        return Outlook(plan.modes, size, None, memory_mb)
    q, y = trajectory.q[trajectory.spread(8)], case.initial_design
    solve_s = min(repeat(lambda: case.model().frequencies(q, y, 1), number=1, repeat=2)) / len(q)
    share = 1.0 if isinstance(asked.starts, str) else max(1.0, asked.starts / 4)
    search_s = 100 * share * len(trajectory.q) * solve_s
    search_s = search_s if asked.seconds is None else min(search_s, asked.seconds)
    return Outlook(plan.modes, size, ELSE_S + built_s + size.seconds + search_s, memory_mb)
