"""Processes to run cases in: one BLAS thread each, gone when the parent is."""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Iterator
from concurrent.futures import Executor, ProcessPoolExecutor
from types import FrameType
from typing import Any

from eigassign.process import (
    ONE_THREAD,
    environment,
    raise_terminated,
    unwind_when_terminated,
)

_PATIENCE_S = 5.0  # for workers to clean up after an interrupt


def cores() -> int:
    """Processor cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@contextlib.contextmanager
def process_pool(workers: int) -> Iterator[Executor]:
    """Fresh processes, each with one BLAS thread; on an error inside they are stopped at once."""
    others = set(multiprocessing.active_children())
    with environment(ONE_THREAD):  # before NumPy is imported there
        context = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(workers, context, _prepare_worker) as pool:
            try:
                yield pool
            except BaseException:
                _stop(pool, set(multiprocessing.active_children()) - others)
                raise


def _stop(pool: Executor, workers: set[Any]) -> None:
    """Start nothing more, end the workers, and wait until the pool has taken note of their ends.

    The pool's own thread waits for the same processes: until it is done, a worker that it has
    reaped still counts as alive here.
    """
    ending = threading.Thread(target=pool.shutdown, args=(True,), kwargs={"cancel_futures": True})
    ending.daemon = True
    ending.start()
    _end(workers)
    ending.join(_PATIENCE_S)


def _end(workers: set[Any]) -> None:
    """Let workers remove their temporary folders, then kill those that take too long."""
    deadline = time.monotonic() + _PATIENCE_S
    for worker in workers:
        worker.terminate()
    for worker in workers:
        worker.join(max(0.0, deadline - time.monotonic()))
        worker.kill()
        worker.join(_PATIENCE_S)


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
