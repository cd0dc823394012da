"""The process around a command: signals, streams, threads of the linear algebra, collections."""

from __future__ import annotations

import atexit
import contextlib
import errno
import gc
import io
import os
import signal
import sys
import threading
from collections.abc import Iterator, Mapping
from types import FrameType
from typing import Any, TextIO

_THREADS = ("OPENBLAS", "OMP", "MKL", "BLIS", "VECLIB_MAXIMUM", "NUMEXPR")
ONE_THREAD: Mapping[str, str] = {f"{library}_NUM_THREADS": "1" for library in _THREADS}
_ENDING = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))


class Terminated(BaseException):
    """The process was told to end: unwinds like KeyboardInterrupt, so that cleanup happens."""

    def __init__(self, number: int) -> None:
        self.exit_code = 128 + number
        super().__init__(number)

    def __str__(self) -> str:
        return f"ended by {signal.Signals(self.exit_code - 128).name}"


@contextlib.contextmanager
def terminable() -> Iterator[None]:
    """SIGTERM and SIGHUP raise Terminated inside; as before afterwards."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = unwind_when_terminated()
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def unwind_when_terminated() -> dict[signal.Signals, Any]:
    """From now on SIGTERM and SIGHUP raise Terminated once; returns the handlers replaced.

    A signal that somebody handles or ignores already (nohup) is left alone.
    """
    before = {number: signal.getsignal(number) for number in _ENDING}
    before = {number: handler for number, handler in before.items() if handler == signal.SIG_DFL}
    for number in before:
        signal.signal(number, _terminate)
    return before


def _terminate(number: int, _frame: FrameType | None) -> None:
    for each in _ENDING:
        signal.signal(each, signal.SIG_IGN)  # the cleanup is not to be disturbed
    raise Terminated(number)


def prefer_one_thread() -> None:
    """One BLAS thread unless the user chose: small dense algebra is slower on more.

    Only has an effect before NumPy is imported.
    """
    for name, value in ONE_THREAD.items():
        os.environ.setdefault(name, value)


def expect_to_be_brief() -> None:
    """Spare a process its walks over all that it imported: fewer while it runs, none at its end.

    Worth a fifth of a short run. Memory is freed by reference counts as ever.
    """
    gc.set_threshold(50_000, 10, 10)
    atexit.register(gc.freeze)


@contextlib.contextmanager
def environment(changes: Mapping[str, str]) -> Iterator[None]:
    """Environment variables for the processes started inside."""
    before = {name: os.environ.get(name) for name in changes}
    os.environ.update(changes)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


class _ClosedOutput(io.TextIOBase):
    """Stands for a stdout that was closed before the process began: an answer would be lost."""

    def write(self, _text: str) -> int:
        raise OSError(errno.EBADF, "standard output is closed")


def mind_closed_streams() -> None:
    """Let writing to a closed stdout fail, and no file opened later take its descriptor.

    Python leaves ``sys.stdout`` None then, and what is printed vanishes without an error.
    """
    while (descriptor := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass
    os.close(descriptor)
    if sys.stdout is None:
        sys.stdout = _ClosedOutput()


def never_fail_to_encode() -> None:
    """Write ``?`` for what the terminal's character set lacks, instead of failing."""
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(AttributeError, ValueError):
            stream.reconfigure(errors="replace")  # type: ignore[union-attr]


def flush_streams() -> None:
    """Write out what is buffered now, where an error can still be reported.

    Raises OSError (BrokenPipeError if the reader went away); the stream is then silenced, so that
    the interpreter does not complain again on its way out.
    """
    failure: OSError | None = None
    for stream in (sys.stdout, sys.stderr):
        try:
            if stream is not None and not stream.closed:
                stream.flush()
        except OSError as error:
            _silence(stream)
            failure = failure or error
    if failure is not None:
        raise failure


def _silence(stream: TextIO) -> None:
    with contextlib.suppress(OSError, ValueError):
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
