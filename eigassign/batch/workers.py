"""What a worker does, check a variant and run it; and where tasks run.

What a worker that dies had in flight runs again. Workers share the folders of the cases and of the
results.
"""

from __future__ import annotations

import contextlib
import errno
import itertools
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    Executor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from time import perf_counter
from types import FrameType
from typing import Any, TypeVar

from eigassign.batch.plan import STUDY, Variant, content_of, key_of
from eigassign.case.case_file import Unchecked, checked, read
from eigassign.errors import CaseError, EigassignError, Problem, StorageError, UsageError
from eigassign.output.batch.summary import CaseOutcome, Status, frequency_ranges, to_plain
from eigassign.output.store.run_folder import MARKER, read_record
from eigassign.pipeline.run import Options, solve_case
from eigassign.pipeline.stages import new_run_folder
from eigassign.process import (
    ONE_THREAD,
    environment,
    failure_of,
    raise_terminated,
    unwind_when_terminated,
)
from eigassign.study.built_case import BuiltCase
from eigassign.study.results import RunResults

_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EROFS)  # not of one case only


@dataclass(frozen=True)
class CaseOptions:
    """Options of each case's run, which can be sent to another process."""

    out: str  # the folder of the batch
    cache_dir: str | None = None
    use_cache: bool = True
    force: bool = False
    figures: tuple[str, ...] = ("png",)
    reports: str = "all"  # of which cases there are figures and a report: all, failed or none
    redraw: bool = False  # cases that were done without theirs run again
    allow_outside: bool = False

    def draws(self, status: str) -> bool:
        """True where a case that ended so has figures and a report."""
        return self.reports == "all" or (self.reports == "failed" and status != "ok")


# --- Reading and checking


def check_cases(
    variants: Sequence[Variant], options: CaseOptions
) -> list[tuple[int, tuple[Problem, ...]]]:
    """The index of every variant that is no valid case, and what is wrong with it.

    Raises StorageError where a file of one cannot be read.
    """
    found = []
    for variant in variants:
        try:
            load(variant, options)
        except CaseError as error:
            found.append((variant.index, error.problems))
        except StorageError:
            raise
        except EigassignError as error:
            found.append((variant.index, (Problem(variant.path, 0, 0, "", str(error)),)))
    return found


def load(variant: Variant, options: CaseOptions) -> BuiltCase:
    """The case of a variant; raises CaseError."""
    return BuiltCase(checked(_written(variant.path), options.allow_outside, variant.values))


def _written(path: str) -> Unchecked:
    """The case file, parsed once as long as it stays the same."""
    try:
        status = os.stat(path)
    except OSError:
        return read(path)
    return _parsed(path, status.st_mtime_ns, status.st_size)


@lru_cache(maxsize=4)
def _parsed(path: str, _time: int, _size: int) -> Unchecked:
    return read(path)


# --- Running


def run_case(variant: Variant, options: CaseOptions) -> CaseOutcome:
    """The outcome of a case; raises StorageError where the disk is full, else no Exception."""
    start = perf_counter()

    def ended(status: Status, message: str, **found: Any) -> CaseOutcome:
        return outcome_of(variant, status, perf_counter() - start, message=message, **found)

    try:
        return _solved(variant, options, ended)
    except MemoryError:
        return ended("error", "out of memory")
    except Exception as error:
        if isinstance(error, StorageError) and getattr(error.__cause__, "errno", 0) in _FULL:
            raise  # no case can be written any more
        failure = failure_of(error)
        return ended("failed" if failure.exit_code == 1 else "error", failure.text)


def outcome_of(
    case: Variant | CaseOutcome, status: Status, seconds: float = 0.0, **found: Any
) -> CaseOutcome:
    """The outcome of this case."""
    named = {name: getattr(case, name) for name in ("name", "path", "values", "index", "key")}
    return CaseOutcome(**named, status=status, seconds=seconds, **found)


def _solved(
    variant: Variant, options: CaseOptions, ended: Callable[..., CaseOutcome]
) -> CaseOutcome:
    """The outcome of a case, which stands in run.json of its folder.

    That no design meets the limits is an answer too: a folder without results.
    """
    case, written = load(variant, options), _written(variant.path)
    if key_of(content_of(written), variant.values, written.path.parent) != variant.key:
        raise UsageError(
            "the case file, or a file it names, was changed since the batch began: run it again"
        )
    cache_dir = Path(options.cache_dir) if options.cache_dir else None
    how = Options(None, cache_dir, options.use_cache, report="none", study=STUDY)
    place, row = Path(options.out, variant.name), dict[str, Any]()
    force = options.force or _is_damaged(place)
    with new_run_folder(case.file, place, force, key=variant.key, outcome=row) as folder:
        try:
            results = solve_case(case, how).results
        except EigassignError as error:
            if error.exit_code != 1:
                raise
            outcome = ended("failed", failure_of(error).text)
        else:
            if results.interrupted:  # Ctrl-C ends a batch: the best design so far is no answer
                raise KeyboardInterrupt
            found = _found(case, results)
            drawn = options.draws(found["status"])
            folder.write(results, options.figures if drawn else (), "light" if drawn else "none")
            outcome = ended(**found, run_folder=variant.name)
        row.update(to_plain(outcome))
    return outcome


def _is_damaged(place: Path) -> bool:
    """True where a run has lost its record: what is left of it may be moved aside."""
    left = any(os.path.lexists(place / name) for name in (MARKER, "results.json"))
    return left and read_record(place) is None


def _found(case: BuiltCase, results: RunResults) -> dict[str, Any]:
    error, violation, found = results.error, results.violation, results.assignment
    return {
        "status": _status(results),
        "message": results.shortcoming or "",
        "verdict": found.verdict if found else "",
        "initial_max_relative": error and error.initial.max_relative,
        "predicted_max_relative": error and error.predicted and error.predicted.max_relative,
        "exact_max_relative": error and error.exact.max_relative,
        "exact_rms_relative": error and error.exact.rms_relative,
        "initial_violation": violation and violation.initial,
        "exact_violation": violation and violation.exact,
        "mass": results.mass and results.mass.optimal,
        "price": results.price,
        "design": tuple((row.name, row.optimal) for row in results.design),
        "units": {**case.file.variant_units, **{row.name: row.unit for row in results.design}},
        "frequencies": frequency_ranges(results),
    }


def _status(results: RunResults) -> Status:
    """Failed where there is no answer at all, tolerance where there is one that is not enough."""
    if results.shortcoming is None:
        return "ok"
    found = results.assignment
    no_answer = found is not None and found.verdict in ("unreachable", "infeasible")
    return "failed" if no_answer else "tolerance"


T = TypeVar("T")
R = TypeVar("R")
_PATIENCE_S = 5.0  # for workers to clean up after an interrupt


@dataclass(frozen=True)
class Workers:
    """A place where tasks run: ``open(slots)`` gives an executor of so many at a time."""

    slots: int
    open: Callable[[int], AbstractContextManager[Executor]]


def this_machine(jobs: int | None) -> Workers:
    """This process for one job, else a pool of processes; None is one for each core."""
    usable = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    slots = jobs or usable or 1
    return Workers(slots, in_this_process if slots == 1 else process_pool)


class _AtOnce(Executor):
    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        future.set_result(fn(*args, **kwargs))
        return future


@contextlib.contextmanager
def in_this_process(_slots: int) -> Iterator[Executor]:
    """An executor that runs each task in this process as it is submitted."""
    yield _AtOnce()


class _Pool(ProcessPoolExecutor):
    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Submit with SIGINT blocked, which new processes inherit: Ctrl-C is the parent's."""
        if not hasattr(signal, "pthread_sigmask"):
            return super().submit(fn, *args, **kwargs)
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            return super().submit(fn, *args, **kwargs)
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextlib.contextmanager
def process_pool(workers: int) -> Iterator[Executor]:
    """Fresh processes, each with one BLAS thread; on an error inside they are stopped at once."""
    others = set(multiprocessing.active_children())
    with environment(ONE_THREAD):  # before NumPy is imported there
        context = multiprocessing.get_context("spawn")
        with _Pool(workers, context, _prepare_worker) as pool:
            try:
                yield pool
            except BaseException:
                _stop(pool, set(multiprocessing.active_children()) - others)
                raise


def _stop(pool: Executor, workers: set[Any]) -> None:
    """Start nothing more, end the workers, and wait until the pool has taken note of their ends.

    They may remove their temporary folders; those that take too long are killed. The pool's own
    thread waits for the same processes: until it is done, a worker that it has reaped still counts
    as alive here.
    """
    ending = threading.Thread(target=pool.shutdown, args=(True,), kwargs={"cancel_futures": True})
    ending.daemon = True
    ending.start()
    deadline = time.monotonic() + _PATIENCE_S
    for worker in workers:
        worker.terminate()
    for worker in workers:
        worker.join(max(0.0, deadline - time.monotonic()))
        worker.kill()
        worker.join(_PATIENCE_S)
    ending.join(_PATIENCE_S)


def _prepare_worker() -> None:
    """SIGTERM unwinds, Ctrl-C is left to the parent, and no worker outlives its parent."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for number in unwind_when_terminated():
        signal.signal(number, _end_soon)
    threading.Thread(target=_follow_parent, daemon=True).start()


def _end_soon(number: int, frame: FrameType | None) -> None:
    """Unwind, and end in any case.

    The exception may be lost: the pool's loop takes what a task raises for its result, and Python
    ignores what a callback of a weak reference raises. A pool that ends its workers, because one of
    them was killed, would wait for such a worker for ever.
    """
    signal.alarm(int(_PATIENCE_S))  # ends the process
    raise_terminated(number, frame)


def _follow_parent() -> None:
    """End this worker after its parent's death: the pool's own loop may swallow the first try."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGTERM)
        time.sleep(_PATIENCE_S)
        os.kill(os.getpid(), signal.SIGKILL)


# --- Tasks


def run_tasks(
    workers: Workers,
    tasks: Iterator[T],
    work: Callable[[T], R],
    keep: Callable[[T, R], None],
    slots: int | None = None,
) -> list[T]:
    """Work on tasks, at most ``slots`` in flight, and keep each result; the tasks that were lost.

    These are the ones in flight when a process of the pool died: it is not known which of them was
    the cause, and the pool takes no other. Raises our errors of a task.
    """
    running: dict[Future[R], T] = {}
    slots, lost = slots or workers.slots, list[T]()
    with workers.open(slots) as pool, contextlib.suppress(BrokenExecutor):
        while True:
            while len(running) < slots and (taken := list(itertools.islice(tasks, 1))):
                lost += taken  # until it is in flight
                future = pool.submit(work, *taken)
                running[future] = lost.pop()
            if not running:
                break
            wait(running, return_when=FIRST_COMPLETED)
            for future in [future for future in running if future.done()]:
                task, error = running.pop(future), future.exception()
                if error is None:
                    keep(task, future.result())
                elif isinstance(error, EigassignError):
                    raise error
                else:
                    lost.append(task)
    return [*lost, *running.values()]


def run_all(
    workers: Workers,
    tasks: Iterator[T],
    work: Callable[[T], R],
    keep: Callable[[T, R], None],
    lose: Callable[[T], None],
) -> None:
    """Work on all tasks; ``lose`` hears of those of which their process dies.

    What was in flight when a process died is run again, each task alone: so the one at fault shows,
    and the others lose nothing.
    """
    while suspects := run_tasks(workers, tasks, work, keep):
        for task in suspects:
            if run_tasks(workers, iter([task]), work, keep, slots=1):
                lose(task)
