"""Time and memory that one case may take, enforced in the process that runs it."""

from __future__ import annotations

import contextlib
import ctypes
import faulthandler
import multiprocessing
import os
import signal
import threading
from collections.abc import Iterator
from types import FrameType

from eigassign.errors import UsageError

_PATIENCE_S = 5.0  # until a process that does not listen is killed
_AGAIN_S = 0.5  # Python ignores what some callbacks raise: then the next one ends the case


class OutOfTimeError(BaseException):
    """The case took longer than it may; no Exception, so that nothing on the way catches it."""


def require_limits_here(seconds: float | None, megabytes: float | None) -> None:
    """Raise UsageError for a limit that this system cannot enforce."""
    if seconds is not None and not hasattr(signal, "setitimer"):
        raise UsageError("--case-time: this system has no timer that could end a case")
    if megabytes is not None and not os.path.exists("/proc/self/statm"):
        raise UsageError("--case-memory: only Linux can limit the memory of a case")


@contextlib.contextmanager
def limited(seconds: float | None, megabytes: float | None) -> Iterator[None]:
    """Raise OutOfTimeError or MemoryError inside, as soon as more than that is taken.

    The memory is what is taken beside what the process has already. A process of a pool or a
    cluster that is deep in compiled code, and does not hear that its time is over, is ended some
    seconds later.
    """
    with _in_time(seconds), _in_memory(megabytes):
        yield


@contextlib.contextmanager
def _in_time(seconds: float | None) -> Iterator[None]:
    if seconds is None:
        yield
        return
    in_main = threading.current_thread() is threading.main_thread()
    with open(os.devnull, "w") as nowhere:
        if is_worker := multiprocessing.parent_process() is not None:
            faulthandler.dump_traceback_later(seconds + _PATIENCE_S, exit=True, file=nowhere)
        try:
            with (_alarm if in_main else _alarm_of_thread)(seconds):
                yield
        finally:
            if is_worker:
                faulthandler.cancel_dump_traceback_later()


@contextlib.contextmanager
def _alarm(seconds: float) -> Iterator[None]:
    signal.signal(signal.SIGALRM, _over)
    signal.setitimer(signal.ITIMER_REAL, seconds, _AGAIN_S)
    try:
        yield
    finally:
        if signal.getsignal(signal.SIGALRM) is _over:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
            signal.signal(signal.SIGALRM, signal.SIG_DFL)


@contextlib.contextmanager
def _alarm_of_thread(seconds: float) -> Iterator[None]:
    """Signals reach the main thread alone; the tasks of a cluster's worker run in another one."""
    raise_in = ctypes.pythonapi.PyThreadState_SetAsyncExc
    here = ctypes.c_ulong(threading.get_ident())
    ended, out_of_time = threading.Event(), ctypes.py_object(OutOfTimeError)

    def ring() -> None:
        wait_s = seconds
        while not ended.wait(wait_s):
            raise_in(here, out_of_time)
            wait_s = _AGAIN_S

    def stop() -> None:
        ended.set()
        ringing.join()  # behind this it raises nothing more
        raise_in(here, None)  # nor what this thread has not heard yet

    ringing = threading.Thread(target=ring, daemon=True)
    try:
        ringing.start()  # it may ring before this returns
        yield
    finally:
        try:
            stop()
        finally:
            stop()  # the last ring may have come while it stopped


def _over(_number: int, _frame: FrameType | None) -> None:
    raise OutOfTimeError


@contextlib.contextmanager
def _in_memory(megabytes: float | None) -> Iterator[None]:
    if megabytes is None:
        yield
        return
    import resource

    with open("/proc/self/statm") as file:
        pages = int(file.read().split()[0])
    before = resource.getrlimit(resource.RLIMIT_AS)
    most = pages * resource.getpagesize() + int(1e6 * megabytes)
    resource.setrlimit(resource.RLIMIT_AS, (most, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_AS, before)
