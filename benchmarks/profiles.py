"""Where the time of ``expand``, ``reduce`` and ``optimize`` goes, on small and large cases.

Cold: the first call of a fresh process with an empty cache, imports included; warm: later calls
of the same process, which for ``optimize`` finds its expansions in the cache. Times are processor
time of one thread, by category (see ``sampling.py``).
"""

from __future__ import annotations

import common  # first: settles the threads

# isort: split
import io
import json
import subprocess
import sys
import tempfile
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import asdict
from pathlib import Path
from typing import Any

from sampling import CATEGORIES, Profile, profile

CASES = ("two_link", "arm_6r, 10⁴ dof", "trunk with chains, 10⁵ dof")
JOBS = ("expand", "reduce", "optimize")
ENOUGH = 2.0  # s of processor time for a warm profile: a sample comes every few ms
FINE = 556  # elements a link: three links of six unknowns a node


def case_text(name: str) -> str:
    """The case file."""
    import chart_cases
    import yaml

    if name == "two_link":
        return (common.CASES / "two_link.yaml").read_text(encoding="utf-8")
    if name.startswith("trunk"):
        return chart_cases.large(326)
    data = yaml.safe_load(chart_cases.six())
    for link in ("column", "upper_arm", "forearm"):
        data["mechanism"]["links"][link]["elements"] = FINE
    return yaml.safe_dump(data, sort_keys=False)


def job_of(what: str, path: Path, folder: Path) -> Callable[[], object]:
    """One call that does everything from the case file on."""
    if what == "optimize":
        arguments = ["optimize", str(path), "--out", str(folder / "run"), "--force"]
        arguments += ["--cache-dir", str(folder / "cache")]
        return lambda: _command(arguments)
    return lambda: _library(what, path)


def _command(arguments: list[str]) -> None:
    from eigassign.cli import main

    try:
        main(arguments)
    except SystemExit as end:
        if end.code not in (0, None, 1):
            raise


def _library(what: str, path: Path) -> None:
    import eigassign as ea

    case = ea.load_case(path)
    model, y0, q = case.model(), case.initial_design, case.trajectory.q
    q0 = q[len(q) // 2]
    if what == "expand":
        ea.expand(model, q0, y0, (1,), 4).frequencies(q, y0)
    else:
        reduced = ea.reduce(model, q0, y0, (1,), 2)
        reduced.frequencies(q, y0)


def one(what: str, path: Path) -> list[Profile]:
    """Cold and warm profile of one job in this process."""
    with tempfile.TemporaryDirectory() as folder:
        job = job_of(what, path, Path(folder))
        with redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
            return [profile(job, enough) for enough in (0.0, ENOUGH)]


def row(what: str, name: str, state: str, found: dict[str, Any]) -> common.Row:
    """Shares of the whole, and the largest of our functions outside linear algebra."""
    top, share = next(iter(found["functions"].items()), ("", 0.0))
    return {
        "job": what,
        "case": name,
        "state": state,
        "time": f"{found['seconds']:.3g} s",
        **{c: percent(found["categories"].get(c, 0.0)) for c in CATEGORIES},
        "largest function": f"{top} {percent(share)}",
    }


def percent(share: float) -> str:
    return f"{100.0 * share:.0f} %"


def main() -> None:
    rows = []
    with tempfile.TemporaryDirectory() as folder:
        for k, name in enumerate(CASES):
            path = Path(folder) / f"case_{k}.yaml"
            path.write_text(case_text(name), encoding="utf-8")
            for what in JOBS:
                command = [sys.executable, __file__, what, str(path)]
                done = subprocess.run(command, check=True, capture_output=True, text=True)
                pair = json.loads(done.stdout.splitlines()[-1])
                states = ("cold", "warm")
                rows += [row(what, name, s, p) for s, p in zip(states, pair, strict=True)]
    common.report(
        "profiles",
        "Where the time goes",
        rows,
        [
            "largest function: of ours, with most time outside linear algebra, imports and what"
            " libraries read, draw or write for us; wanted: none over 20 %",
            "output: laying out and drawing figures, the report, files, the cache",
            "expand and reduce: from the case file on, with frequencies along"
            " the trajectory; optimize: the whole command in this process",
        ],
    )


if __name__ == "__main__":
    if len(sys.argv) == 3:
        print(json.dumps([asdict(found) for found in one(sys.argv[1], Path(sys.argv[2]))]))
    else:
        main()
