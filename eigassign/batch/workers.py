"""Where tasks run: in this process, or in processes beside it.

What a worker that dies had in flight runs again. Workers share the folders of the cases and of the
results.
"""

from __future__ import annotations

import contextlib
import itertools
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
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
from types import FrameType
from typing import Any, TypeVar

from eigassign.errors import EigassignError
from eigassign.process import ONE_THREAD, raise_terminated, unwind_when_terminated

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
    return Workers(slots, process_pool if slots > 1 else lambda _: _AtOnce())


class _AtOnce(Executor):
    """Runs each task in this process as it is submitted."""

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        future.set_result(fn(*args, **kwargs))
        return future


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
    own = dict(os.environ)
    os.environ.update(ONE_THREAD)  # for these, before they import NumPy
    try:
        with _Pool(workers, multiprocessing.get_context("spawn"), _prepare_worker) as pool:
            try:
                yield pool
            except BaseException:
                _stop(pool, set(multiprocessing.active_children()) - others)
                raise
    finally:
        for name in ONE_THREAD:
            del os.environ[name]
        os.environ.update(own)


def _stop(pool: Executor, workers: set[Any]) -> None:
    """Start nothing more, end the workers, and wait until the pool has taken note of their ends."""
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
