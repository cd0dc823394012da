"""Many cases in parallel processes, a run folder for each; a case that fails does not stop others.

The one seam is ``Executor.submit(run_case, path, options) -> small dict``: any
``concurrent.futures`` executor will do, here or on a cluster. Workers write their own folders.
"""

from __future__ import annotations

import contextlib
import signal
import time
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from eigassign.batch.plan import folder_names
from eigassign.batch.workers import cores, process_pool
from eigassign.output.batch.files import write_files
from eigassign.output.batch.outcome import CaseOutcome, frequency_ranges, to_line
from eigassign.pipeline.run import Options, Outcome, optimize
from eigassign.process import failure_of

Row = dict[str, Any]  # what a worker sends back: plain text and numbers only
MakePool = Callable[[int], contextlib.AbstractContextManager[Executor]]


@dataclass(frozen=True)
class CaseOptions:
    """How one case is run; everything in it can be sent to another process."""

    out: str
    cache_dir: str | None = None
    use_cache: bool = True
    force: bool = False
    figures: tuple[str, ...] = ("png",)
    report: str = "light"
    allow_outside: bool = False


@dataclass(frozen=True)
class Job:
    """One case file and where its run goes."""

    case: str
    options: CaseOptions


def run_case(path: str, options: CaseOptions) -> Row:
    """Run one case into its folder: the fields of a CaseOutcome. Never raises an Exception."""
    start = time.perf_counter()
    try:
        row = _optimised(path, options)
    except Exception as error:
        row = _failure(error)
    return _row(path, options, **row, seconds=time.perf_counter() - start)


def _row(path: str, options: CaseOptions, **fields: object) -> Row:
    return {"name": Path(options.out).name, "path": path, "seconds": 0.0, **fields}


def _optimised(path: str, options: CaseOptions) -> Row:
    cache_dir = Path(options.cache_dir) if options.cache_dir else None
    how = Options(
        Path(options.out),
        cache_dir,
        options.use_cache,
        options.force,
        options.figures,
        report=options.report,
        allow_outside=options.allow_outside,
    )
    outcome = optimize(Path(path), how)
    error, found = outcome.results.error, outcome.results.assignment
    return {
        "status": _status(outcome),
        "message": outcome.shortcoming or "",
        "run_folder": outcome.folder and outcome.folder.name,
        "initial_max_relative": error and error.initial.max_relative,
        "predicted_max_relative": error and error.predicted and error.predicted.max_relative,
        "exact_max_relative": error and error.exact.max_relative,
        "design": tuple((row.name, row.optimal) for row in outcome.results.design),
        "frequencies": frequency_ranges(outcome.results),
        "verdict": found.verdict if found else "",
    }


def _status(outcome: Outcome) -> str:
    """Failed where there is no answer at all, tolerance where there is one that is not enough."""
    found = outcome.results.assignment
    if outcome.shortcoming is None:
        return "ok"
    no_answer = found is not None and found.verdict in ("unreachable", "infeasible")
    return "failed" if no_answer else "tolerance"


def _failure(error: Exception) -> Row:
    failure = failure_of(error)
    return {"status": "failed" if failure.exit_code == 1 else "error", "message": failure.text}


def plan(cases: Sequence[Path], options: CaseOptions) -> list[Job]:
    """Each case with a folder of its own below ``options.out``, whatever order they come in."""
    return [
        Job(str(case), replace(options, out=str(Path(options.out, name))))
        for case, name in zip(cases, folder_names(cases), strict=True)
    ]


def run_and_summarise(
    jobs: Sequence[Job], workers: int | None, out: Path, on_row: Callable[[Row], None]
) -> list[CaseOutcome]:
    """Run the jobs and write their summaries; after an interrupt, of what there is."""
    done: dict[str, Row] = {}

    def record(row: Row) -> None:
        done[row["path"]] = row
        on_row(row)

    out.mkdir(parents=True, exist_ok=True)
    try:
        run_batch(jobs, workers or cores(), record)
    finally:
        rows = [done.get(job.case) or not_run(job) for job in jobs]
        outcomes = [CaseOutcome(**row) for row in rows]
        write_files(out, map(to_line, outcomes), len(outcomes))
    return outcomes


def run_batch(
    jobs: Sequence[Job],
    workers: int,
    on_row: Callable[[Row], None] = lambda _row: None,
    executor: MakePool | None = None,
) -> dict[str, Row]:
    """Run every job; a row per case, in the order the jobs were given.

    ``on_row`` is called with each as it comes in. When a worker dies, the pool is rebuilt, and the
    cases that were running are run again, each alone in its own pool: so the one at fault shows.
    """
    rows: dict[str, Row] = {}
    make = executor or process_pool

    def record(row: Row) -> None:
        rows[row["path"]] = row
        on_row(row)

    waiting = list(jobs)
    while waiting:
        for suspect in _until_broken(waiting, workers, make, record):
            if _until_broken([suspect], 1, make, record):
                record(_killed(suspect))
        waiting = [job for job in waiting if job.case not in rows]
    return {job.case: rows[job.case] for job in jobs}


def _until_broken(
    jobs: Sequence[Job], workers: int, make: MakePool, record: Callable[[Row], None]
) -> list[Job]:
    """Run jobs, at most ``workers`` in flight; the jobs in flight when the pool broke, if it did.

    So few, because a broken pool does not say which of them was the cause.
    """
    waiting, running = list(jobs), dict[Future[Row], Job]()
    with make(min(workers, len(jobs))) as pool:
        try:
            while waiting or running:
                while waiting and len(running) < workers:
                    running[_submitted(pool, waiting[0])] = waiting[0]
                    del waiting[0]
                wait(running, return_when=FIRST_COMPLETED)
                _collect(running, record)
        except BrokenProcessPool:
            return list(running.values()) or waiting[:1]
    return []


def _collect(running: dict[Future[Row], Job], record: Callable[[Row], None]) -> None:
    """Take out what is done; raises BrokenProcessPool once all other results are recorded."""
    broken: BrokenProcessPool | None = None
    for future in [future for future in running if future.done()]:
        error = future.exception()
        if isinstance(error, BrokenProcessPool):
            broken = error
            continue
        job = running.pop(future)
        record(_killed(job) if error else future.result())
    if broken:
        raise broken


def _killed(job: Job) -> Row:
    message = "the process that ran it was killed, perhaps for want of memory"
    return _row(job.case, job.options, status="error", message=message)


def not_run(job: Job) -> Row:
    """Row of a case that an interrupt came before."""
    return _row(job.case, job.options, status="error", message="not run: interrupted before")


def _submitted(pool: Executor, job: Job) -> Future[Row]:
    """Submit with SIGINT blocked: processes started here inherit that, Ctrl-C is the parent's."""
    if not hasattr(signal, "pthread_sigmask"):
        return pool.submit(run_case, job.case, job.options)
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        return pool.submit(run_case, job.case, job.options)
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
