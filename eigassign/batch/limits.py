"""Time that one case may take, enforced in the process that runs it."""

from __future__ import annotations

import contextlib
import ctypes
import faulthandler
import multiprocessing
import os
import threading
from collections.abc import Iterator

_PATIENCE_S = 5.0  # until a process that does not listen is ended
_AGAIN_S = 0.5  # Python ignores what some callbacks raise: then the next one ends the case


class OutOfTimeError(BaseException):
    """The case took longer than it may; no Exception, so that nothing on the way catches it."""


@contextlib.contextmanager
def limited(seconds: float | None) -> Iterator[None]:
    """Raise OutOfTimeError inside as soon as so many seconds are over, in any thread.

    A process of a pool or a cluster that is deep in compiled code, and does not hear that its time
    is over, is ended some seconds later.
    """
    if seconds is None:
        yield
        return
    with open(os.devnull, "w") as nowhere:
        if is_worker := multiprocessing.parent_process() is not None:
            faulthandler.dump_traceback_later(seconds + _PATIENCE_S, exit=True, file=nowhere)
        try:
            with _alarm(seconds):
                yield
        finally:
            if is_worker:
                faulthandler.cancel_dump_traceback_later()


@contextlib.contextmanager
def _alarm(seconds: float) -> Iterator[None]:
    """By a thread: signals reach the main one only, and a cluster's tasks run in another."""
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
