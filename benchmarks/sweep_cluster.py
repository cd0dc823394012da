"""The sweep of `sweep.py` on a local dask.distributed cluster, one of two workers killed half-way.

Its summary is compared with that of the same command with ``--jobs 2``, seconds apart.
"""

from __future__ import annotations

import common  # first: settles the threads

# isort: split
import argparse
import csv
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from distributed import Client, LocalCluster
from sweep import write_case


def batch(case: Path, out: Path, *where: str) -> subprocess.Popen[bytes]:
    words = [str(case), *where, "--out", str(out), "--reports", "none", "--quiet"]
    command = [sys.executable, "-m", "eigassign", "batch", *words]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL)


def finished(out: Path) -> int:
    return len([*out.glob("*/run.json")])


def summary(out: Path) -> list[dict[str, str]]:
    with open(out / "summary.csv", newline="", encoding="utf-8") as file:
        return [{**row, "seconds": ""} for row in csv.DictReader(file)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--count", type=int, default=5000)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        os.environ["EIGASSIGN_CACHE_DIR"] = str(folder / "cache")
        case = write_case(folder, asked.count)
        ours = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": ":0"}
        with LocalCluster(**ours) as cluster, Client(cluster) as client:
            victim = next(iter(client.run(os.getpid).values()))
            start = time.perf_counter()
            running = batch(case, folder / "there", "--scheduler", cluster.scheduler_address)
            killed_at = 0
            while running.poll() is None:
                if not killed_at and finished(folder / "there") >= asked.count // 2:
                    killed_at = finished(folder / "there")
                    os.kill(victim, signal.SIGKILL)
                time.sleep(0.2)
            there_s = time.perf_counter() - start
        start = time.perf_counter()
        batch(case, folder / "here", "--jobs", "2").wait()
        here_s = time.perf_counter() - start
        same = summary(folder / "there") == summary(folder / "here")
        rows = len(summary(folder / "there"))
        lines = finished(folder / "there")
    common.report(
        "sweep_cluster",
        f"A sweep of {asked.count} small assignments on two workers, one of them killed",
        [
            {"": "on the cluster", "wall clock": f"{there_s:.0f} s", "cases": rows},
            {"": "in two processes here", "wall clock": f"{here_s:.0f} s", "cases": asked.count},
        ],
        [
            f"a worker was killed when {killed_at} cases had ended; its successor was started by "
            "the cluster",
            f"the summaries are {'identical' if same else 'NOT identical'} but for the seconds",
            f"cases with a record: {lines}",
        ],
    )
    assert same


if __name__ == "__main__":
    main()
