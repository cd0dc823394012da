"""A scheduler of dask and its workers, as the command line of dask starts them; and `eigassign`."""

import contextlib
import json
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import eigassign

ROOT = Path(eigassign.__file__).parents[1]


def begun(module: str, *arguments: str, **how: Any) -> subprocess.Popen[str]:
    """``python -m module`` with eigassign importable and one thread."""
    path = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH", "")]))
    environment = {**os.environ, "PYTHONPATH": path, "OPENBLAS_NUM_THREADS": "1"}
    command = [sys.executable, "-m", module, *arguments]
    return subprocess.Popen(command, text=True, env=environment, **how)


@contextlib.contextmanager
def _process(kind: str, *arguments: str) -> Iterator[subprocess.Popen[str]]:
    """A scheduler or a worker, killed at the end."""
    module = f"distributed.cli.dask_{kind}"
    process = begun(module, *arguments, "--no-dashboard", stderr=subprocess.DEVNULL)
    try:
        yield process
    finally:
        process.kill()
        process.wait()


@contextlib.contextmanager
def scheduler(
    folder: Path, *options: str, workers: int = 1, tls: tuple[str, ...] = ()
) -> Iterator[tuple[str, list[subprocess.Popen[str]]]]:
    """Its address, and its process followed by those of its workers, which it knows already."""
    told = folder / "there.json"
    told.unlink(missing_ok=True)
    where = ("--port", "0", "--scheduler-file", str(told))
    with contextlib.ExitStack() as stack:
        processes = [stack.enter_context(_process("scheduler", *where, *options, *tls))]
        while not told.exists():
            time.sleep(0.1)
        address = json.loads(told.read_text())["address"]
        one = (address, "--nthreads", "1", "--no-nanny", *tls)
        processes += [stack.enter_context(_process("worker", *one)) for _ in range(workers)]
        time.sleep(3.0)  # until they are known
        yield address, processes
