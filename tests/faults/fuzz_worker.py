"""One command after the other in a process of their own, each within limits of time and memory.

A `Worker` is a process that has imported everything, so that a command costs no start.
`Outcome.faults` says what no case file may lead to, `Outcome.excesses` what no file at all may.
"""

from __future__ import annotations

import json
import math
import os
import re
import resource
import select
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

SECONDS, BYTES = 10, 2**30  # of processor time, and of memory, for one command
PATIENCE = 30  # times as long by the clock: other processes may be at work
CASES = Path(__file__).parents[2] / "cases"
PROBLEM = re.compile(r"^case\.yaml:[1-9]\d*:[1-9]\d*: ", re.MULTILINE)
PYTHON = re.compile(r"Traceback \(most|^.*\.py:\d+: \w*Warning|^\w*Warning: ", re.MULTILINE)
NO_NUMBER = re.compile(r"(?<![\w.])(nan|inf)(?![\w])", re.IGNORECASE)
RUN = ("--study", "none", "--figures", "none", "--no-cache", "--out", "run", "--force")
OPTIONS = {"check": (), "optimize": RUN}


@dataclass(frozen=True)
class Outcome:
    """How a command ended: its exit code (negative: the signal), what it said and what it took."""

    command: str
    text: str
    code: int
    out: str
    err: str
    seconds: float  # of processor time
    megabytes: float

    def faults(self) -> list[str]:
        """What went wrong that is eigassign's, not the case file's; none if nothing did."""
        found = self.excesses()
        if self.code == 2 and not PROBLEM.search(self.err):
            found.append("refused without a place in the file")
        if self.code == 0 and NO_NUMBER.search(re.sub(r"^case\.yaml.*", "", self.out)):
            found.append("a result that is no number")
        return found

    def excesses(self) -> list[str]:
        """What no file may lead to, whatever it is read for."""
        found = []
        if self.code not in (0, 1, 2, 3):
            found.append(f"exit code {self.code}")
        if "out of memory" in self.err:
            found.append("out of memory")
        if PYTHON.search(self.err):
            found.append("a message of Python's")
        if self.seconds > SECONDS:
            found.append(f"{self.seconds:.0f} s")
        if self.megabytes > BYTES / 2**20:
            found.append(f"{self.megabytes:.0f} MB")
        return found


class Worker:
    """A process that runs commands, one after the other; a context manager.

    It is begun anew where a command ended it.
    """

    def __init__(self) -> None:
        self._folder = Path(os.path.realpath(tempfile.mkdtemp(prefix="fuzz")))
        for file in (*CASES.glob("*.csv"), *CASES.glob("*/*.mtx")):
            place = self._folder / file.relative_to(CASES)
            place.parent.mkdir(exist_ok=True)
            shutil.copy(file, place)
        self._process = self._begun()

    def _begun(self) -> subprocess.Popen[str]:
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
        command = [sys.executable, __file__]
        process = subprocess.Popen(command, cwd=self._folder, text=True, **pipes)
        process.stdout.readline()
        return process

    def run(self, command: str, text: str) -> Outcome:
        """``eigassign <command> case.yaml`` where the file holds ``text``."""
        case = self._folder / "case.yaml"
        case.write_text(text, encoding="utf-8", errors="surrogatepass")
        outcome = self.ran((command, "case.yaml", *OPTIONS.get(command, ())), self._folder, text)
        shutil.rmtree(self._folder / "run", ignore_errors=True)
        return outcome

    def ran(self, arguments: Sequence[str], folder: Path, text: str = "") -> Outcome:
        """``eigassign <arguments>`` in this folder; ``text`` says on what."""
        asked, answered = self._process.stdin, self._process.stdout
        asked.write(json.dumps([str(folder), arguments]) + "\n")
        asked.flush()
        if not select.select([answered], [], [], PATIENCE * SECONDS)[0]:
            self._process.kill()
        line = answered.readline()
        took = json.loads(line) if line else self._ended()
        said = {name: self._said(name) for name in ("out", "err")}
        return Outcome(arguments[0], text, **took, **said)

    def _ended(self) -> dict[str, float]:
        code = self._process.wait()
        self._close()
        self._process = self._begun()
        return {"code": code, "seconds": math.nan, "megabytes": math.nan}

    def _close(self) -> None:
        for pipe in (self._process.stdin, self._process.stdout):
            with suppress(OSError):
                pipe.close()

    def _said(self, name: str) -> str:
        return (self._folder / name).read_text(encoding="utf-8", errors="replace")

    def __enter__(self) -> Worker:
        return self

    def __exit__(self, *_: object) -> None:
        self._close()
        self._process.wait()
        shutil.rmtree(self._folder)


def _serve() -> None:
    """Import what `check` needs, and build the schema; then run a command for each line."""
    from eigassign.pipeline import check

    check(CASES / "two_link.yaml")
    answers = open(os.dup(1), "w", encoding="utf-8")  # noqa: SIM115
    print("ready", file=answers, flush=True)
    for number, name in ((1, "out"), (2, "err")):
        os.dup2(os.open(name, os.O_RDWR | os.O_CREAT, 0o600), number)
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    resource.setrlimit(resource.RLIMIT_DATA, (BYTES, BYTES))
    for line in sys.stdin:
        folder, arguments = json.loads(line)
        os.chdir(folder)
        print(json.dumps(_ran(arguments)), file=answers, flush=True)


def _ran(arguments: list[str]) -> dict[str, float]:
    from eigassign.cli import main

    for number in (1, 2):
        os.ftruncate(number, 0)
        os.lseek(number, 0, os.SEEK_SET)
    Path("/proc/self/clear_refs").write_text("5")  # memory is counted from here on
    before = _processor_time()
    resource.setrlimit(resource.RLIMIT_CPU, (int(before) + SECONDS + 1, resource.RLIM_INFINITY))
    code = main(arguments)
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    most = re.search(r"VmHWM:\s*(\d+) kB", Path("/proc/self/status").read_text())
    megabytes = int(most[1]) / 1024  # ru_maxrss would be that of who has begun this process
    return {"code": code, "seconds": _processor_time() - before, "megabytes": megabytes}


def _processor_time() -> float:
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).parents[2])
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    _serve()
