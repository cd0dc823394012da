"""Batches of 10⁵ and 10⁶ cases without their solution: what everything else takes.

The results are made up, the rest is the real thing: plan, keys, manifest, summaries, columns. A
finished batch is resumed and shards are merged by the command; what the process that gives out the
cases takes for each is measured with workers that answer at once. From this, and seconds a case,
follows by simulation how long 10⁶ cases take on 16 and on 400 processes, and who waits for whom.
"""

from __future__ import annotations

import common  # first: settles the threads

# isort: split
import argparse
import heapq
import os
import random
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from eigassign.batch.cases import Batch, summarise
from eigassign.batch.manifest import LINES, line_of, write_header
from eigassign.batch.plan import BatchPlan, Variant, plan_of
from eigassign.batch.runner import run
from eigassign.batch.work import CaseOptions, outcome_of
from eigassign.batch.workers import Workers
from eigassign.output.batch.outcome import CaseOutcome, to_line

SWEEP = """sweep:
  sample: latin_hypercube
  count: {count}
  parameters:
    mechanism.bodies.tool_mass.mass: {{min: 0, max: 0.25}}
    targets.0.frequency: {{min: 180 Hz, max: 200 Hz}}
"""
CASE_S, TASK_S = 0.1, 5.0


def outcome(variant: Variant) -> CaseOutcome:
    """A made-up end of a case: one in fifty fails."""
    chance = random.Random(variant.index)
    if chance.random() < 0.02:
        return outcome_of(variant, "failed", CASE_S, message="unreachable: no design comes near")
    error = 0.05 * chance.random()
    return outcome_of(
        variant,
        "ok",
        CASE_S * (0.5 + chance.random()),
        verdict="reached",
        initial_max_relative=2 * error,
        predicted_max_relative=error,
        exact_max_relative=error,
        design=(("m1", 0.25 * chance.random()), ("m2", 0.0)),
        frequencies=(("mode 1", 180.0, 190.0 + error, 200.0),),
    )


def planned(folder: Path, count: int) -> BatchPlan:
    path = folder / "arm.yaml"
    path.write_text((common.CASES / "two_link.yaml").read_text() + SWEEP.format(count=count))
    return plan_of([path])


def batch_in(plan: BatchPlan, folder: Path, shard: tuple[int, int] = (1, 1)) -> Batch:
    return Batch(plan, folder, CaseOptions(str(folder), columns=True), shard)


def finished(batch: Batch) -> None:
    """The folder as a batch leaves it."""
    batch.folder.mkdir()
    write_header(batch.folder, batch.header)
    with open(batch.folder / LINES, "w") as file:
        for index in batch.header.indices():
            file.write(line_of(to_line(outcome(batch.plan[index])), batch.header.plan))
    summarise(batch.folder, batch.header)


def command(*words: object) -> dict[str, float]:
    """Wall-clock and processor seconds of a command."""
    before, start = common.children_s(), time.perf_counter()
    program = [sys.executable, "-m", "eigassign", *map(str, words)]
    done = subprocess.run(program, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    assert "cases failed" in done.stderr, done.stderr
    wall = time.perf_counter() - start
    return {"wall s": wall, "processor s": common.children_s() - before}


class AtOnce(Executor):
    """Workers that take no time."""

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        future.set_result([outcome(variant) for variant in args[0]])
        return future


@contextmanager
def at_once(_slots: int) -> Iterator[Executor]:
    yield AtOnce()


def given_out(batch: Batch) -> dict[str, float]:
    """Processor seconds a case to give it out and to keep its result; memory in MB."""
    batch.folder.mkdir()
    write_header(batch.folder, batch.header)
    start = time.process_time()
    for index in batch.header.indices():
        outcome(batch.plan[index])
    made_up = time.process_time() - start
    place = Workers(800, at_once, TASK_S)
    start = time.process_time()
    run(batch, place, lambda _progress: None, lambda _outcome: None)
    whole = time.process_time() - start
    start = time.process_time()
    summarise(batch.folder, batch.header, anew=True)
    summaries = time.process_time() - start
    size = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    n = len(batch.plan)
    return {"case": (whole - made_up - summaries) / n, "summary": summaries / n, "mb": size}


def simulated(cases: int, workers: int, parent_s: float, slots: int) -> dict[str, float]:
    """Tasks of about TASK_S seconds on so many workers; one process gives them out and keeps them.

    It works on one task at a time; a worker's next task is ready for it while ``slots`` allow.
    """
    chance, size = random.Random(0), round(TASK_S / CASE_S)
    tasks, parent, busy = cases // size, 0.0, 0.0
    free = [0.0] * workers  # when each worker has nothing to do
    ends: list[float] = []  # of tasks in flight
    for _ in range(tasks):
        if len(ends) == slots:
            parent = max(parent, heapq.heappop(ends)) + size * parent_s
        start = max(parent, heapq.heappop(free))
        seconds = sum(chance.uniform(0.5, 1.5) for _ in range(size)) * CASE_S
        busy += seconds
        heapq.heappush(free, start + seconds)
        heapq.heappush(ends, start + seconds)
    for end in sorted(ends):
        parent = max(parent, end) + size * parent_s
    used, own = busy / workers / parent, cases * parent_s / parent
    return {"hours": parent / 3600, "workers": used, "parent": own, "tasks": tasks / parent}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--resumed", type=int, default=100_000)
    parser.add_argument("--shards", type=int, default=100)
    parser.add_argument("--each", type=int, default=10_000, help="cases of a shard")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        os.environ["EIGASSIGN_CACHE_DIR"] = str(folder / "cache")
        plan = planned(folder, asked.resumed)
        given = given_out(batch_in(plan, folder / "given"))
        finished(batch_in(plan, folder / "whole"))
        case = folder / "arm.yaml"
        resumed = command("batch", case, "--columns", "--out", folder / "whole", "--quiet")
        plan = planned(folder, asked.shards * asked.each)
        n, parts = asked.shards, [folder / f"part-{k + 1}" for k in range(asked.shards)]
        for k, part in enumerate(parts):
            finished(batch_in(plan, part, (k + 1, n)))
        merged = command("merge", folder / "merged", *parts, "--quiet")
        files = [path.stat().st_size / 1e6 for path in (folder / "merged").iterdir()]
    rows: list[dict[str, object]] = [
        {"": f"resuming a finished batch of {asked.resumed} cases", **resumed},
        {"": f"merging {n} shards of {asked.each} cases", **merged},
        {"": "giving out a case and keeping its result", "processor s": given["case"]},
        {"": "a case in the summaries", "processor s": given["summary"]},
    ]
    for workers, shards in ((16, 1), (400, 1), (400, 8)):
        each = workers // shards
        found = simulated(1_000_000 // shards, each, given["case"], 2 * each)
        title = f"10⁶ cases of {CASE_S} s on {workers} processes"
        title += f", {shards} shards of {workers // shards}" if shards > 1 else ""
        rows.append(
            {
                "": title,
                "hours": found["hours"],
                "workers busy": f"{found['workers']:.0%}",
                "parent busy": f"{found['parent']:.0%}",
                "tasks/s": found["tasks"] * shards,
            }
        )
    remarks = [
        f"the merged batch has {len(files)} files of {sum(files):.0f} MB together",
        f"memory of the process that gives out {asked.resumed} cases: {given['mb']:.0f} MB",
    ]
    common.report("scale", "Batches of very many cases", rows, remarks)


if __name__ == "__main__":
    main()
