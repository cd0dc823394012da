"""One command on one case file in a process of its own, within limits of time and memory.

A `Worker` is a process that has imported everything and forks for each case, so that a case costs
no start. `Outcome.faults` says what no case file may lead to.
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
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

SECONDS, BYTES = 10, 2**30  # of processor time, and of memory, for one case
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
        """What went wrong that is eigassign's, not the file's; none if nothing did."""
        found = []
        if self.code not in (0, 1, 2, 3):
            found.append(f"exit code {self.code}")
        if "out of memory" in self.err:
            found.append("out of memory")
        if PYTHON.search(self.err):
            found.append("a message of Python's")
        if self.code == 2 and not PROBLEM.search(self.err):
            found.append("refused without a place in the file")
        if self.code == 0 and NO_NUMBER.search(re.sub(r"^case\.yaml.*", "", self.out)):
            found.append("a result that is no number")
        if self.seconds > SECONDS:
            found.append(f"{self.seconds:.0f} s")
        if self.megabytes > BYTES / 2**20:
            found.append(f"{self.megabytes:.0f} MB")
        return found


class Worker:
    """A process that runs commands on case files, one after the other; a context manager.

    It is begun anew where a case ended it.
    """

    def __init__(self) -> None:
        self._folder = Path(tempfile.mkdtemp(prefix="fuzz"))
        for file in (*CASES.glob("*.csv"), *CASES.glob("*/*.mtx")):
            place = self._folder / file.relative_to(CASES)
            place.parent.mkdir(exist_ok=True)
            shutil.copy(file, place)
        self._process = self._begun()

    def _begun(self) -> subprocess.Popen[str]:
        pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
        command = [sys.executable, __file__]
        process = subprocess.Popen(command, cwd=self._folder, text=True, **pipes)
        assert process.stdout is not None
        process.stdout.readline()
        return process

    def run(self, command: str, text: str) -> Outcome:
        """``eigassign <command> case.yaml`` where the file holds ``text``."""
        case = self._folder / "case.yaml"
        case.write_text(text, encoding="utf-8", errors="surrogatepass")
        asked, answered = self._process.stdin, self._process.stdout
        assert asked is not None
        assert answered is not None
        asked.write(command + "\n")
        asked.flush()
        if not select.select([answered], [], [], PATIENCE * SECONDS)[0]:
            self._process.kill()
        line = answered.readline()
        took = json.loads(line) if line else self._ended()
        said = {name: self._said(name) for name in ("out", "err")}
        shutil.rmtree(self._folder / "run", ignore_errors=True)
        return Outcome(command, text, **took, **said)

    def _ended(self) -> dict[str, float]:
        code = self._process.wait()
        self._close()
        self._process = self._begun()
        return {"code": code, "seconds": math.nan, "megabytes": math.nan}

    def _close(self) -> None:
        for pipe in (self._process.stdin, self._process.stdout):
            assert pipe is not None
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
    for command in sys.stdin:
        print(json.dumps(_ran(command.strip())), file=answers, flush=True)


def _ran(command: str) -> dict[str, float]:
    from eigassign.cli import main

    for number in (1, 2):
        os.ftruncate(number, 0)
        os.lseek(number, 0, os.SEEK_SET)
    before = _processor_time()
    resource.setrlimit(resource.RLIMIT_CPU, (int(before) + SECONDS + 1, resource.RLIM_INFINITY))
    code = main([command, "case.yaml", *OPTIONS[command]])
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return {"code": code, "seconds": _processor_time() - before, "megabytes": most}


def _processor_time() -> float:
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime


if __name__ == "__main__":
    sys.path[0] = str(Path(__file__).parents[2])
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    _serve()
