"""What a run will take, before it is made; and a picture of the mechanism alone."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter
from timeit import repeat

import numpy as np
from numpy.typing import NDArray

from eigassign.case.case_file import CaseFile
from eigassign.files import quoted
from eigassign.mechanism.kinematics.parameters import written_loads
from eigassign.mechanism.kinematics.travel_limits import resting_pose
from eigassign.mechanism.trajectory.trajectory import Trajectories
from eigassign.output.figures.graph import FigurePlan
from eigassign.output.figures.modes import mechanism_plan
from eigassign.output.reports.page import write_figures
from eigassign.pipeline.expansions import ExpansionSize, expansion_size
from eigassign.pipeline.run_files import new_run_folder
from eigassign.study.built_case import BuiltCase, load_case
from eigassign.study.pictures.drawing import draw_poses, rest_pose
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


def next_step(case: CaseFile) -> str:
    """The command for a case that is in order."""
    name = quoted(case.path)
    if case.measurements is not None:
        return f"eigassign update {name}"
    given = (case.trajectory, case.design.parameters, case.has_question)
    keys = ("trajectory", "design", "targets")
    missing = [key for key, value in zip(keys, given, strict=True) if not value]
    if not missing:
        return f"eigassign optimize {name}"
    needs = " and ".join(filter(None, [", ".join(missing[:-1]), missing[-1]]))
    pose, more = "", "eigassign docs case-file"
    if case.trajectory is None and case.expansion.q == "auto" and case.coordinates:
        pose = f' --q "{", ".join(f"{value:g}" for value in resting_pose(case))}"'
    return f"eigassign modes {name}{pose} --draw (to optimize it needs {needs}: {more})"


def draw(
    path: str | Path,
    out: Path | None = None,
    force: bool = False,
    formats: Sequence[str] = ("png",),
    allow_outside: bool = False,
) -> Path:
    """`picture` in a folder: ``out``, or results/<case>_check.

    Raises StorageError where the folder may not be replaced.
    """
    case = load_case(path, allow_outside)
    with new_run_folder(case.file, out, force, "_check") as folder:
        write_figures([picture(case)], folder.hidden, formats)
    return folder.path


def picture(case: BuiltCase) -> FigurePlan:
    """The mechanism along its trajectory, or in one pose; raises CaseError where it has none."""
    file, y = case.file, case.initial_design
    with case.located():
        model = case.model()
        if file.trajectory is None:
            poses = rest_pose(file, model, some_pose(case), y)
        else:
            poses = draw_poses(file, model, case.trajectory, y)
    return mechanism_plan(file.title, poses)


def some_pose(case: BuiltCase) -> Floats:
    """q (n_q,) of a case without a trajectory: its expansion point, else where it may rest."""
    given = case.file.expansion.q
    pose = resting_pose(case.file) if given == "auto" else given
    return np.append(np.asarray(pose, dtype=np.float64), written_loads(case.file))
