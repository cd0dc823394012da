"""A sweep of 5000 small assignments by ``eigassign batch --jobs 2``, against bare loops.

The bare loop is ``for case in cases: ea.assign(case)`` over some of the same variants in two
processes at once, before and after the sweep; what a process takes to start is not counted there.
The sweep is counted whole: checking the variants, run folders that are synced to disk, summaries.
Memory is looked at every second, and compared between the first and the last tenth of the cases.
Then the same command is run again, with everything done.
"""

from __future__ import annotations

import common  # first: settles the threads

# isort: split
import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

LOOP = """
import json, sys, time
import eigassign as ea
from eigassign.case import checked, read
from eigassign.study.built_case import BuiltCase
from eigassign.batch.plan import plan_of
from pathlib import Path

plan = plan_of([Path(sys.argv[1])])
written = read(sys.argv[1])
values = [plan[k].values for k in map(int, sys.argv[2:])]
cases = [BuiltCase(checked(written, values=each)) for each in values]
ea.assign(cases[0])
wall, processor = time.perf_counter(), time.process_time()
for case in cases:
    ea.assign(case)
print(json.dumps([time.perf_counter() - wall, time.process_time() - processor]))
"""
SWEEP = """sweep:
  parameters:
    mechanism.bodies.tool.mass: {{min: 0, max: 0.5, count: {masses}}}
    targets.0.frequency: {{min: 170 Hz, max: 190 Hz, count: 50}}
"""


def write_case(folder: Path, count: int) -> Path:
    """A planar arm of two links with five samples, and its sweep."""
    path = folder / "small.yaml"
    starter = Path(common.__file__).parents[1] / "benchmarks" / "small_arm.yaml"
    path.write_text(starter.read_text() + SWEEP.format(masses=count // 50))
    return path


def loops(case: Path, indices: list[int]) -> list[tuple[float, float]]:
    """Wall-clock and processor time a case of two bare loops at once, half of the cases each."""
    halves = indices[::2], indices[1::2]
    command = [sys.executable, "-c", LOOP, str(case)]
    running = [
        subprocess.Popen([*command, *map(str, half)], stdout=subprocess.PIPE, text=True)
        for half in halves
    ]
    found = []
    for process, half in zip(running, halves, strict=True):
        wall, processor = json.loads(process.communicate()[0])
        found.append((wall / len(half), processor / len(half)))
    return found


def memory_mb(pid: int) -> dict[int, float]:
    """Resident memory of a process and of all below it."""
    below: dict[int, list[int]] = {}
    sizes: dict[int, float] = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                parent = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
                pages = int((entry / "statm").read_text().split()[1])
            except OSError:
                continue
            below.setdefault(parent, []).append(int(entry.name))
            sizes[int(entry.name)] = pages * resource.getpagesize() / 1e6
    found, ahead = {}, [pid]
    while ahead:
        each = ahead.pop()
        ahead += below.get(each, [])
        found[each] = sizes.get(each, 0.0)
    return found


def swept(case: Path, out: Path, count: int) -> dict[str, float]:
    """One whole command: wall-clock and processor time, and memory early and late."""
    command = [sys.executable, "-m", "eigassign", "batch", str(case), "--jobs", "2"]
    command += ["--out", str(out), "--reports", "none", "--quiet"]
    before, start = common.children_s(), time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    looks: list[tuple[int, float]] = []
    over = threading.Event()

    def look() -> None:
        while not over.wait(1.0):
            done = len([*out.glob("*/run.json")])
            looks.append((done, max(memory_mb(process.pid).values(), default=0.0)))

    watcher = threading.Thread(target=look)
    watcher.start()
    process.wait()
    over.set()
    watcher.join()
    early = [size for done, size in looks if 0.02 * count < done <= 0.1 * count]
    late = [size for done, size in looks if 0.9 * count < done]
    return {
        "wall": time.perf_counter() - start,
        "processor": common.children_s() - before,
        "early_mb": max(early, default=0.0),
        "late_mb": max(late, default=0.0),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--count", type=int, default=5000, help="a multiple of 50")
    parser.add_argument("--loop", type=int, default=400, help="cases of each bare loop")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        os.environ["EIGASSIGN_CACHE_DIR"] = str(folder / "cache")
        case = write_case(folder, asked.count)
        some = list(range(0, asked.count, max(1, asked.count // (2 * asked.loop))))
        bare = loops(case, some[::2])
        sweep = swept(case, folder / "sweep", asked.count)
        bare += loops(case, some[1::2])
        again = swept(case, folder / "sweep", asked.count)
    wall = sum(each for each, _ in bare) / len(bare)
    processor = sum(each for _, each in bare) / len(bare)
    rows = [
        {"": "bare loop, a case", "processor": common.milliseconds(processor)},
        {
            "": "sweep, a case",
            "processor": common.milliseconds(sweep["processor"] / asked.count),
            "ratio": sweep["processor"] / asked.count / processor,
        },
        {"": "bare loop, a case in each of two processes", "wall clock": common.milliseconds(wall)},
        {
            "": "sweep, the same",
            "wall clock": common.milliseconds(2 * sweep["wall"] / asked.count),
            "ratio": 2 * sweep["wall"] / asked.count / wall,
        },
        {"": "sweep, whole", "wall clock": f"{sweep['wall']:.0f} s"},
        {"": "the same command again, all done", "wall clock": f"{again['wall']:.1f} s"},
    ]
    common.report(
        "sweep",
        f"A sweep of {asked.count} small assignments in two processes",
        rows,
        [
            f"largest process: {sweep['early_mb']:.0f} MB within the first tenth of the cases, "
            f"{sweep['late_mb']:.0f} MB within the last",
            "wall-clock times depend on what else the machine does meanwhile",
        ],
    )


if __name__ == "__main__":
    main()
