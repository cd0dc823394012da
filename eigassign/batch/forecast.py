"""What a batch will take, before it runs: time, memory and files."""

from __future__ import annotations

from dataclasses import dataclass

from eigassign.batch.progress import Batch, outcomes_in
from eigassign.batch.work import load
from eigassign.errors import EigassignError
from eigassign.pipeline.outlook import ELSE_S, outlook
from eigassign.study.planning import plan_expansion

_PROCESS_MB = 150.0  # of a process that has solved the paper's arm
_FILES, _REPORT_FILES = 7, 14  # with the folder; figures and report of a case with one target
_FOLDER_KB, _REPORT_KB, _LINE_KB = 30.0, 700.0, 1.0  # of the paper's arm
_REPORT_S = 5.0  # light, with its figures
_FOLDER_S = 0.02  # its files, each of them on disk


@dataclass(frozen=True)
class Forecast:
    """About what is left of a batch; ``case_s`` is None where it cannot be told."""

    todo: tuple[int, ...]  # indices of the plan
    done: int
    case_s: float | None  # of one case in one process
    measured: bool  # from cases that are done; else estimated from the first one's sizes
    total_s: float | None
    process_mb: float  # of each process
    files: int
    disk_mb: float


def forecast(batch: Batch, slots: int) -> Forecast:
    """What is left of the batch, in so many processes."""
    done = {found.index: found for found in outcomes_in(batch)}
    todo = tuple(index for index in batch.header.indices() if index not in done)
    options, memory = batch.options, 0.0
    drawn = len(todo) if options.reports == "all" else 0
    if spent := [found.seconds for found in done.values()]:
        case_s: float | None = sum(spent) / len(spent)
    else:
        case_s, memory = _of_first(batch, todo)
        case_s = None if case_s is None else case_s + (_REPORT_S if drawn else _FOLDER_S)
    folders = 0 if options.columns else len(todo)
    kilobytes = _LINE_KB * len(todo) + _FOLDER_KB * folders + _REPORT_KB * drawn
    return Forecast(
        todo,
        len(done),
        case_s,
        bool(spent),
        None if case_s is None else case_s * len(todo) / min(slots, max(1, len(todo))),
        _PROCESS_MB + memory,
        _FILES * folders + _REPORT_FILES * drawn,
        kilobytes / 1e3,
    )


def _of_first(batch: Batch, todo: tuple[int, ...]) -> tuple[float | None, float]:
    """Seconds of the first case, and megabytes of its expansion, from their sizes."""
    if not todo:
        return None, 0.0
    try:
        case = load(batch.plan[todo[0]], batch.options)
        plan = plan_expansion(case.file, case.model(), case.trajectory)
        expected = outlook(case, plan, case.trajectory)
    except EigassignError:
        return None, 0.0
    seconds = expected.optimize_s
    return None if seconds is None else seconds - ELSE_S, expected.expansion.memory_mb
