"""Errors as people read them on stderr, and the exit code of each."""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass

from eigassign import signals
from eigassign.errors import CaseError, EigassignError, Problem, StorageError

BUG, STORAGE, INTERRUPTED = EigassignError.exit_code, StorageError.exit_code, 130
_SNIPPETS = 3  # problems shown with their line of the file
_WIDEST = 120


@dataclass(frozen=True)
class Failure:
    """What an error amounts to: exit code, one line, and what there is to list before it."""

    exit_code: int
    summary: str
    problems: tuple[Problem, ...] = ()

    @property
    def text(self) -> str:
        """The problems if there are any, else the line."""
        return "\n".join(map(str, self.problems)) or self.summary


def judged(error: BaseException) -> Failure:
    """Exit code and message of any error; a closed pipe has no message."""
    match error:
        case KeyboardInterrupt():
            return Failure(INTERRUPTED, "interrupted")
        case signals.Terminated():
            return Failure(error.exit_code, str(error))
        case CaseError():
            return Failure(error.exit_code, counted(error.problems), error.problems)
        case EigassignError() if error.exit_code != BUG:
            return Failure(error.exit_code, f"error: {error}")
        case BrokenPipeError():
            return Failure(STORAGE, "")
        case OSError():
            return Failure(STORAGE, f"error: {_os_error(error)}")
        case MemoryError():
            return Failure(STORAGE, "error: out of memory")
        case _:
            return Failure(BUG, _internal(error))


def report(error: BaseException, debug: bool = False) -> int:
    """Say on stderr what went wrong; returns the exit code."""
    failure = judged(error)
    if debug and failure.summary:
        import traceback

        traceback.print_exception(error)
    say(problem_lines(failure.problems))
    say([f"eigassign: {failure.summary}"] if failure.summary else [])
    return failure.exit_code


def say(lines: Iterable[str]) -> None:
    """Write lines to stderr; if that is closed the exit code must do."""
    with suppress(OSError, AttributeError, ValueError):
        for line in lines:
            sys.stderr.write(f"{line}\n")


def problem_lines(problems: Sequence[Problem]) -> list[str]:
    """``file:line:column: path: message`` for each, the first few with their line of the file."""
    lines = []
    for k, problem in enumerate(problems):
        lines.append(str(problem))
        lines.extend(_snippet(problem) if k < _SNIPPETS else ())
    return lines


def _snippet(problem: Problem) -> Iterator[str]:
    """The line and a caret below its column, where that can be shown faithfully."""
    line = _line(problem).replace("\t", " ")
    if line.strip() and line.isprintable() and len(line) <= _WIDEST >= problem.column:
        yield f"{problem.line:>6} | {line}"
        yield f"{'':>6} | {'^':>{problem.column}}"


def _line(problem: Problem) -> str:
    try:
        with open(problem.file, encoding="utf-8") as file:
            return next((t.rstrip("\r\n") for k, t in enumerate(file, 1) if k == problem.line), "")
    except (OSError, ValueError):
        return ""


def counted(problems: Sequence[Problem]) -> str:
    """``3 problems in case.yaml``."""
    files = Counter(problem.file for problem in problems)
    return "; ".join(f"{n} problem{'s' if n > 1 else ''} in {file}" for file, n in files.items())


def _os_error(error: OSError) -> str:
    reason = error.strerror or str(error) or type(error).__name__
    return f"{error.filename}: {reason}" if error.filename else reason


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


def problems(error: BaseException) -> list[Problem]:
    """What is wrong, for programs: the problems with their lines, or the message without a line."""
    failure = judged(error)
    return list(failure.problems) or [Problem("", 0, 0, "", str(error))]
