"""Running eigassign in tests: inside this process, or as a process of its own."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import eigassign

ROOT = Path(eigassign.__file__).parents[1]
TWO_LINK = Path(__file__).parents[2] / "cases" / "two_link.yaml"
SECONDS = 120  # until a process that hangs is a failure


def environment(**changes: str) -> dict[str, str]:
    """This process's, with eigassign importable and nothing that bends its output."""
    kept = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "LC_", "LANG"))}
    return {**kept, "PYTHONPATH": str(ROOT), **changes}


def eigassign_process(*args: object, **how: Any) -> subprocess.CompletedProcess[str]:
    """``python -m eigassign *args``, to its end."""
    return python("-m", "eigassign", *args, **how)


def python(*args: object, **how: Any) -> subprocess.CompletedProcess[str]:
    """A Python process, to its end."""
    given: dict[str, Any] = {"env": environment(), "stdin": subprocess.DEVNULL, **how}
    if "stdout" not in given:
        given |= {"stdout": subprocess.PIPE}
    if "stderr" not in given:
        given |= {"stderr": subprocess.PIPE}
    command = [sys.executable, *map(str, args)]
    how_read = {"text": True, "errors": "backslashreplace", "timeout": SECONDS, "check": False}
    return subprocess.run(command, **how_read, **given)
