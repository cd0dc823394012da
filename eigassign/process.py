"""The process around a command: errors on stderr with their exit codes, signals, streams."""

from __future__ import annotations

import contextlib
import errno
import io
import os
import shutil
import signal
import sys
import threading
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cache
from time import monotonic
from types import FrameType
from typing import Any, NamedTuple

from eigassign.errors import CaseError, EigassignError, Problem, StorageError
from eigassign.files import CASE, printable, read_bytes

# --- Errors as people read them on stderr, and the exit code of each

BUG, STORAGE, INTERRUPTED = EigassignError.exit_code, StorageError.exit_code, 130


class Failure(NamedTuple):
    """An error on the command line: exit code, one line, and the problems listed before it."""

    exit_code: int
    summary: str
    problems: tuple[Problem, ...] = ()

    @property
    def text(self) -> str:
        """The problems if there are any, else the line."""
        return "\n".join(map(str, self.problems)) or self.summary


def failure_of(error: BaseException) -> Failure:
    """Exit code and message of any error; a closed pipe has no message."""
    match error:
        case KeyboardInterrupt() | RuntimeError(__cause__=KeyboardInterrupt()):
            return Failure(INTERRUPTED, "interrupted")
        case Terminated():
            return Failure(error.exit_code, str(error))
        case CaseError():
            files = Counter(problem.file for problem in error.problems)
            counts = (f"{n} problem{'s' if n > 1 else ''} in {file}" for file, n in files.items())
            return Failure(error.exit_code, "; ".join(counts), error.problems)
        case EigassignError() if error.exit_code != BUG:
            return Failure(error.exit_code, f"error: {error}")
        case BrokenPipeError():
            return Failure(STORAGE, "")
        case OSError():
            reason = error.strerror or str(error) or type(error).__name__
            if isinstance(error, FileNotFoundError) and error.filename is None:
                reason = "the working folder, where relative paths begin, does not exist any more"
            named = f"{error.filename}: {reason}" if error.filename else reason
            return Failure(STORAGE, f"error: {named}")
        case MemoryError():
            return Failure(
                STORAGE, "error: out of memory: fewer samples, modes or elements take less"
            )
        case _:
            return Failure(BUG, _internal(error))


def report(error: BaseException, debug: bool = False) -> int:
    """Say on stderr what went wrong; returns the exit code."""
    failure = failure_of(error)
    if debug and failure.summary:
        import traceback

        say("".join(traceback.format_exception(error)).splitlines())
    for k, problem in enumerate(failure.problems):
        say([str(problem), *(_snippet(problem) if k < 3 else ())])
    say([f"eigassign: {failure.summary}"] if failure.summary else [])
    return failure.exit_code


def say(lines: Iterable[str]) -> None:
    """Write lines to stderr, no raw escapes; if that is closed only the exit code is left."""
    with suppress(OSError, AttributeError, ValueError):
        end = "\x1b[K\n" if _writes_over() else "\n"
        for line in map(printable, lines):
            sys.stderr.write(f"{line}{end}")
        sys.stderr.flush()


def _writes_over() -> bool:
    """True on a terminal that can write over a line."""
    return sys.stderr.isatty() and os.environ.get("TERM", "dumb") != "dumb"


class Progress:
    """Lines of progress on stderr: on a terminal one that is written over, else a few.

    These begin after a second, one a second at most, and then one for each quarter of the time.
    """

    def __init__(self) -> None:
        self._begun = monotonic()
        self._due = self._begun + 1.0

    def __call__(self, line: str) -> None:
        """Show how far it is; an empty line clears the terminal's."""
        now = monotonic()
        with suppress(OSError, AttributeError, ValueError):
            if _writes_over():  # a line that wraps cannot be written over
                room = shutil.get_terminal_size().columns - 1
                sys.stderr.write(f"\r{printable(line)[:room]}\x1b[K\r")
                sys.stderr.flush()
            elif line and now >= self._due:
                self._due = now + max(1.0, 0.25 * (now - self._begun))
                say([line.strip()])


def _snippet(problem: Problem) -> Iterator[str]:
    """The line of the file and a caret below its column, where that can be shown faithfully."""
    try:
        text = io.StringIO(read_bytes(problem.file, CASE).decode(), newline=None)
    except (OSError, ValueError):
        return
    line = next((t for k, t in enumerate(text, 1) if k == problem.line), "")
    line = line.rstrip("\n").replace("\t", " ")
    if line.strip() and line.isprintable() and len(line) <= 120 >= problem.column:
        yield f"{problem.line:>6} | {line}"
        yield f"{'':>6} | {'^':>{problem.column}}"


def _internal(error: BaseException) -> str:
    """One line for an error that nobody expected, with the last place in our own code."""
    trace, place = error.__traceback__, ""
    while trace is not None:
        name = trace.tb_frame.f_globals.get("__name__", "?")
        place = f" ({name}:{trace.tb_lineno})" if name.startswith("eigassign") else place
        trace = trace.tb_next
    what = ": ".join(filter(None, [type(error).__name__, " ".join(str(error).split())]))
    return (
        f"internal error: {what}{place}. This is a bug of eigassign: please report it with the "
        "case file (--debug shows the traceback)"
    )


def document(error: BaseException) -> dict[str, object]:
    """A failure for programs, the same of every command: ``problems`` with their lines.

    An error that has no line in a file is its own problem, without a place.
    """
    failure = failure_of(error)
    message = failure.summary.removeprefix("error: ")
    return {
        "error": type(error).__name__,
        "exit_code": failure.exit_code,
        "message": message,
        "problems": failure.problems or (Problem("", 0, 0, "", message),),
    }


# --- Signals, streams, threads of the linear algebra

_THREADS = ("OPENBLAS", "OMP", "MKL", "BLIS", "VECLIB_MAXIMUM", "NUMEXPR")
ONE_THREAD: Mapping[str, str] = {f"{library}_NUM_THREADS": "1" for library in _THREADS}
_ENDING = tuple(getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name))


class Terminated(SystemExit):
    """The process was told to end: unwinds like KeyboardInterrupt, so that cleanup happens.

    As a SystemExit it ends a worker that waits for a task without a traceback.
    """

    def __init__(self, number: int) -> None:
        super().__init__(number)
        self.code = self.exit_code = 128 + number

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
        signal.signal(number, raise_terminated)
    return before


def raise_terminated(number: int, _frame: FrameType | None) -> None:
    """Handler of such a signal: raises Terminated, and lets no second one disturb the cleanup."""
    for each in _ENDING:
        signal.signal(each, signal.SIG_IGN)
    raise Terminated(number)


def prefer_one_thread() -> None:
    """One BLAS thread unless the user chose: small dense algebra is slower on more.

    Only has an effect before NumPy is imported; `one_thread` is for a session that has it already.
    """
    for name, value in ONE_THREAD.items():
        os.environ.setdefault(name, value)


class _OneThread(contextlib.ContextDecorator):
    """One BLAS thread while any call of ours is at work, in whatever thread; then as before.

    Nothing changes where the environment says how many there are. A call takes 10 µs longer, one
    inside another 1 µs: the libraries are looked for once, which takes 4 ms.
    """

    def __init__(self) -> None:
        self._lock, self._inside = threading.Lock(), 0
        self._before: list[int] = []

    def __enter__(self) -> None:
        with self._lock:
            self._inside += 1
            if self._inside == 1:
                self._before = [library.get_num_threads() for library in _blas()]
                _set_threads([1] * len(self._before))

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._inside -= 1
            if self._inside == 0:
                _set_threads(self._before)


@cache
def _blas() -> Sequence[Any]:
    """The libraries of linear algebra in this process; none where the user chose their threads."""
    if any(name in os.environ for name in ONE_THREAD):
        return ()
    import scipy.linalg  # noqa: F401  # it has a BLAS of its own
    from threadpoolctl import ThreadpoolController

    return tuple(ThreadpoolController().select(user_api="blas").lib_controllers)


def _set_threads(counts: Sequence[int]) -> None:
    for library, count in zip(_blas(), counts, strict=True):
        library.set_num_threads(count)
        # else OpenBLAS, from threadpoolctl 3.8 on, heeds this thread alone until it ends
        getattr(library, "clear_controlling_thread", lambda: None)()


one_thread = _OneThread()


class _ClosedOutput(io.TextIOBase):
    """A stdout that was closed before the process began: writing to it fails."""

    def write(self, _text: str) -> int:
        raise OSError(errno.EBADF, "standard output is closed")


def refuse_closed_stdout() -> None:
    """Make writing to a closed stdout fail, and let no file opened later take its descriptor.

    Python leaves ``sys.stdout`` None then, and what is printed vanishes without an error.
    """
    while (descriptor := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass
    os.close(descriptor)
    if sys.stdout is None:
        sys.stdout = _ClosedOutput()


def replace_what_cannot_be_encoded() -> None:
    """Write ``?`` for what the terminal's character set lacks, instead of failing."""
    for stream in (sys.stdout, sys.stderr):
        with suppress(AttributeError, ValueError):
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
            with suppress(OSError, ValueError):
                nowhere = os.open(os.devnull, os.O_WRONLY)
                os.dup2(nowhere, stream.fileno())
                os.close(nowhere)
            failure = failure or error
    if failure is not None:
        raise failure
