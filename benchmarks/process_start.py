"""The whole process ``eigassign optimize cases/two_link.yaml``, warm, against bare imports.

With all figures and with ``--figures none``. The bare process imports exactly the third-party
modules that the command has loaded when it ends, and does nothing else. Warm: the files are in
memory.
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


def bare_imports(arguments: list[str]) -> str:
    """A script that imports what this command loads from outside of eigassign."""
    loaded = json.loads(run("-c", LIST.format(arguments=arguments)).splitlines()[-1])
    return IMPORT.format(names=importable(loaded))


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        out = str(Path(folder) / "run")
        drawn = ["optimize", str(CASE), "--out", out, "--force"]
        plain = [*drawn, "--figures", "none"]
        run("-m", "eigassign", *drawn)
        bare = {"all figures": bare_imports(drawn), "no figures": bare_imports(plain)}
        jobs = {
            "optimize, all figures": lambda: run("-m", "eigassign", *drawn),
            "bare imports, all figures": lambda: run("-c", bare["all figures"]),
            "optimize, no figures": lambda: run("-m", "eigassign", *plain),
            "bare imports, no figures": lambda: run("-c", bare["no figures"]),
            "--help": lambda: run("-m", "eigassign", "--help"),
            "python alone": lambda: run("-c", ""),
        }
        times = common.medians(jobs, 15, time.perf_counter)
    rows = []
    for name, t in times.items():
        against = "no figures" if name.endswith("no figures") else "all figures"
        ratio = t / times[f"bare imports, {against}"]
        rows.append({"process": name, "median": f"{t:.3g} s", "ratio": ratio})
    common.report(
        "process_start",
        "Whole processes, warm",
        rows,
        [
            "ratio: to the bare imports of the modules outside eigassign that the command loads",
            "wanted: at most 3 with all figures, at most 1.5 without",
        ],
    )


if __name__ == "__main__":
    main()
