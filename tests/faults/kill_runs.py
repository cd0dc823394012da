"""Kill and interrupt whole runs of `eigassign optimize`, and list what was lost or left.

    python tests/faults/kill_runs.py --calls 1 --kills 200 --signals 60

The runs are forked from a process that has imported everything, so that they are met at work.
``--calls 1`` kills one before every change that it makes to a file, ``--calls 5`` before every
fifth; ``--kills`` at random instants; ``--signals`` sends INT, TERM and HUP in turn instead. Prints
a line for every fault, and the figures; the exit code is 1 if there was one.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import os
import random
import signal
import sys
import tempfile
import time
from collections import Counter
from itertools import count, cycle
from pathlib import Path
from unittest.mock import patch

sys.path.insert(0, str(Path(__file__).parent))

from run_scenes import EARLIER, Scene, Stage, edited, faults
from stopping import can_stop, stopped_after, stopped_at

from eigassign.cli import main
from eigassign.output import Cache

TWO_LINK = Path(__file__).parents[2] / "cases" / "two_link.yaml"
SHORT = (("samples: 152", "samples: 12"), ("order: 4", "order: 2"))
LITTLE = ("--study", "none", "--figures", "none")


def optimize(case: Path, target: Path, force: bool) -> int:
    """The whole command, with a cache beside its case."""
    os.chdir(case.parents[1])
    args = ["optimize", case, "--out", target, "--cache-dir", case.parents[1] / "cache"]
    with (
        contextlib.redirect_stdout(io.StringIO()),
        contextlib.redirect_stderr(io.StringIO()),
        patch.dict(os.environ, EIGASSIGN_CACHE="always"),
    ):
        return main([*map(str, args), *LITTLE, *(["--force"] if force else [])])


def case_text() -> str:
    text = TWO_LINK.read_text()
    for old, new in SHORT:
        assert old in text
        text = text.replace(old, new)
    return text + "assignment: {method: one_shot}\n"


def judged(scene: Scene, where: str, found: Counter[str]) -> None:
    """Count what is wrong, and show it."""
    wrong = faults(scene)
    cache = Cache(scene.root / "cache")
    found_files = [path for path in cache.directory.iterdir() if path.suffix == ".arrays"]
    wrong += [f"{path.name} is damaged" for path in found_files if cache.load(path.stem) is None]
    found["faults"] += len(wrong)
    for fault in wrong:
        say(f"{where}: {fault}")


def kill_before_changes(folder: Path, every: int, found: Counter[str]) -> None:
    """Of a run with an empty cache, which takes the place of a run that was edited."""
    if not can_stop():
        sys.exit("--calls needs ptrace, on Linux")
    scenes = Stage(folder, optimize, case_text()).scenes(edited)
    for call, scene in zip(count(1, every), scenes, strict=False):
        empty_cache(scene)
        stopped = stopped_at(scene.run, call, signal.SIGKILL)
        judged(scene, f"killed before change {call}", found)
        if not stopped.reached:
            return
        found["killed before a change"] += 1


def stop_at_random(
    folder: Path, runs: int, numbers: tuple[signal.Signals, ...], found: Counter[str]
) -> None:
    """Of runs with and without what they need in the cache, over every kind of earlier run."""
    draw = random.Random(runs)
    stages = [Stage(folder / name.__name__, optimize, case_text()).scenes(name) for name in EARLIER]
    scene = next(stages[0])
    start = time.perf_counter()
    scene.run()
    longest = 1.3 * (time.perf_counter() - start)
    for run, number, scenes in zip(range(runs), cycle(numbers), cycle(stages), strict=False):
        scene = next(scenes)
        if draw.random() < 0.5:
            empty_cache(scene)
        code = stopped_after(scene.run, draw.uniform(0.0, longest), number)
        found[f"{number.name}: exit code {code}"] += 1
        if code not in (0, -number, 128 + number):
            found["faults"] += 1
            say(f"run {run}: exit code {code} after {number.name}")
        judged(scene, f"run {run}, {number.name}", found)


def empty_cache(scene: Scene) -> None:
    for entry in (scene.root / "cache").iterdir():
        entry.unlink()


def say(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def command() -> int:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--calls", type=int, default=0)
    parser.add_argument("--kills", type=int, default=0)
    parser.add_argument("--signals", type=int, default=0)
    asked = parser.parse_args()
    found: Counter[str] = Counter(faults=0)
    start = time.perf_counter()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if asked.calls:
            kill_before_changes(folder / "calls", asked.calls, found)
        stop_at_random(folder / "kills", asked.kills, (signal.SIGKILL,), found)
        three = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
        stop_at_random(folder / "signals", asked.signals, three, found)
        os.chdir("/")
    for what, number in sorted(found.items()):
        say(f"{number:6d} {what}")
    say(f"{time.perf_counter() - start:6.0f} s")
    return int(found["faults"] > 0)


if __name__ == "__main__":
    sys.exit(command())
