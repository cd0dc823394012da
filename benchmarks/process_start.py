"""The whole process ``eigassign optimize cases/two_link.yaml``, warm, against bare imports.

The bare process imports exactly the third-party modules that the command has loaded when it ends,
and does nothing else. Warm: the coefficients are in the cache and the files in memory.
"""

from __future__ import annotations

import common  # first: settles the threads

# isort: split
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

CASE = common.CASES / "two_link.yaml"
LIST = """
import json, sys
before = set(sys.modules)
from eigassign.cli import main
try:
    main({arguments!r})
except SystemExit:
    pass
loaded = [m for m in sys.modules if m not in before and not m.startswith("eigassign")]
print("\\n" + json.dumps(loaded))
"""
IMPORT = "import importlib\nfor m in {names!r}:\n    importlib.import_module(m)"


def run(*command: str) -> str:
    done = subprocess.run([sys.executable, *command], check=True, capture_output=True, text=True)
    return done.stdout


def importable(names: list[str]) -> list[str]:
    """Those that a process of their own can import by name."""
    script = (
        "import importlib, json, sys\n"
        "good = []\n"
        "for name in json.loads(sys.argv[1]):\n"
        "    try:\n"
        "        importlib.import_module(name)\n"
        "        good.append(name)\n"
        "    except Exception:\n"
        "        pass\n"
        "print(json.dumps(good))"
    )
    return list(json.loads(run("-c", script, json.dumps(names)).splitlines()[-1]))


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        out = str(Path(folder) / "run")
        arguments = ["optimize", str(CASE), "--out", out, "--force"]
        run("-m", "eigassign", *arguments)  # fills the cache
        loaded = json.loads(run("-c", LIST.format(arguments=arguments)).splitlines()[-1])
        bare = IMPORT.format(names=importable(loaded))
        jobs = {
            "optimize": lambda: run("-m", "eigassign", *arguments),
            "bare imports": lambda: run("-c", bare),
            "--help": lambda: run("-m", "eigassign", "--help"),
            "python alone": lambda: run("-c", ""),
        }
        times = common.medians(jobs, 15, time.perf_counter)
    rows = [
        {"process": name, "median": f"{t:.3g} s", "ratio": t / times["bare imports"]}
        for name, t in times.items()
    ]
    common.report(
        "process_start",
        "Whole processes, warm",
        rows,
        [
            f"bare imports: the {len(loaded)} modules outside eigassign that the command loads",
            "wanted: optimize at most 1.5 times the bare imports",
        ],
    )


if __name__ == "__main__":
    main()
