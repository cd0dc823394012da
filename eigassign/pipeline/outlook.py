"""What a run will take, before it is made; and a picture of the mechanism alone.

`optimize` solves all samples exactly, some `SEARCH` times for four starts (26 to 165 times on the
shipped cases); the time of one such solve is measured.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from eigassign.case.case_file import CaseFile
from eigassign.files import quoted
from eigassign.mechanism.kinematics.parameters import written_loads
from eigassign.mechanism.kinematics.travel_limits import resting_pose
from eigassign.mechanism.trajectory.trajectory import Trajectories
from eigassign.modal.model import Model
from eigassign.output.figures.graph import FigurePlan
from eigassign.output.figures.motion import mechanism_plan
from eigassign.output.reports.page import write_figures
from eigassign.pipeline.expansions import ExpansionSize, expansion_size
from eigassign.pipeline.run_files import RESULTS, new_run_folder
from eigassign.study.built_case import Case, load_case
from eigassign.study.drawing import draw_poses, rest_pose
from eigassign.study.planning import Plan

Floats = NDArray[np.float64]
SEARCH = 100  # times that all samples are solved exactly, with up to four starts
STARTS = 4
TIMED = 8  # samples whose exact solve is timed
ELSE_S = 1.5  # what every run takes: start, report and figures


@dataclass(frozen=True)
class Outlook:
    """About what a run takes: its full expansion, and all of `optimize` where it has targets."""

    modes: tuple[int, ...]
    expansion: ExpansionSize
    optimize_s: float | None


def outlook(case: Case, plan: Plan, trajectory: Trajectories | None) -> Outlook:
    """Estimated from sizes, and from one exact solve of some samples, which is timed."""
    size, file = expansion_size(case.model(), plan), case.file
    if trajectory is None or not file.targets:
        return Outlook(plan.modes, size, None)
    starts, least_s = file.assignment.starts, ELSE_S + size.seconds
    share = max(1.0, (STARTS if isinstance(starts, str) else starts) / STARTS)
    solve_s = _solve_s(case.model(), trajectory, case.initial_design)
    search_s = SEARCH * share * len(trajectory.q) * solve_s
    allowed_s = np.inf if file.assignment.seconds is None else file.assignment.seconds
    return Outlook(plan.modes, size, least_s + min(search_s, allowed_s))


def _solve_s(model: Model, trajectory: Trajectories, y: Floats) -> float:
    """Seconds that the exact solve of one sample takes here, the quicker of two tries."""
    q = trajectory.q[trajectory.spread(TIMED)]
    times = [perf_counter()]
    for _ in range(2):
        model.frequencies(q, y, 1)
        times.append(perf_counter())
    return float(np.diff(times).min()) / len(q)


def next_step(case: CaseFile) -> str:
    """What to do with a case that is in order."""
    name = quoted(case.path)
    if case.measurements is not None:
        return f"eigassign update {name}"
    missing = [key for key in ("trajectory", "design", "targets") if not _given(case, key)]
    if not missing:
        return f"eigassign optimize {name}"
    keys = " and ".join(filter(None, [", ".join(missing[:-1]), missing[-1]]))
    pose, more = "", f"eigassign docs {missing[0]}"
    if case.trajectory is None and case.expansion.q == "auto" and case.coordinates:
        pose = f' --q "{", ".join(f"{value:g}" for value in resting_pose(case))}"'
    return f"eigassign modes {name}{pose} --draw (to optimize it needs {keys}: {more})"


def _given(case: CaseFile, key: str) -> bool:
    return bool(case.design.parameters if key == "design" else getattr(case, key))


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
    target = RESULTS / f"{case.file.path.stem}_check" if out is None else out
    with new_run_folder(case.file, target, force) as folder:
        write_figures([picture(case)], folder.hidden, formats)
        (folder.hidden / "case.yaml").write_text(case.file.resolved(), encoding="utf-8")
    return target


def picture(case: Case) -> FigurePlan:
    """The mechanism along its trajectory, or in one pose; raises CaseError where it has none."""
    file, y = case.file, case.initial_design
    with case.located():
        model = case.model()
        if file.trajectory is None:
            poses = rest_pose(file, model, some_pose(case), y)
        else:
            poses = draw_poses(file, model, case.trajectory, y)
    return mechanism_plan(file.title, poses)


def some_pose(case: Case) -> Floats:
    """q (n_q,) of a case without a trajectory: its expansion point, else where it may rest."""
    given = case.file.expansion.q
    pose = resting_pose(case.file) if given == "auto" else given
    return np.append(np.asarray(pose, dtype=np.float64), written_loads(case.file))
