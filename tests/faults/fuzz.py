"""Feed eigassign case files that nobody wrote, and list what no case file may lead to.

    python tests/faults/fuzz.py 20000 --optimize 500

They are shipped cases with changes. Those that are optimised are right ones, with small limits of
work. What leads to a fault is kept in a folder.
"""

from __future__ import annotations

import argparse
import random
import sys
import time
from collections import Counter
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

from fuzz_mutations import Mutations
from fuzz_worker import Outcome, Worker

LIMITS = {"starts": "1", "steps": "2", "seconds": "1"}
LIGHT = 0.3  # seconds of `check`: what takes longer is too large to optimise in a fuzzing run


def texts(start: int, limits: dict[str, str] | None = None) -> Iterator[str]:
    """Case files without end, the same for the same ``start``."""
    mutations = Mutations(random.Random(start))
    while True:
        yield mutations.case(limits)


def checked(worker: Worker, start: int) -> Iterator[Outcome]:
    """`check` of one after the other."""
    return (worker.run("check", text) for text in texts(start))


def optimized(worker: Worker, start: int) -> Iterator[Outcome]:
    """`optimize` of those that are right and light."""
    for text in texts(start, LIMITS):
        first = worker.run("check", text)
        if first.code == 0 and first.seconds < LIGHT and "targets 0" not in first.out:
            yield worker.run("optimize", text)


def main() -> int:
    """Run as asked; the exit code is 1 where there was a fault."""
    asked = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    asked.add_argument("check", type=int, help="case files through load, model and check")
    asked.add_argument("--optimize", type=int, default=0, help="more of them through optimize")
    asked.add_argument("--seed", type=int, default=1, help="another for other case files")
    asked.add_argument("--keep", type=Path, default=Path("results/fuzz"), help="folder for faults")
    given = asked.parse_args()
    given.keep.mkdir(parents=True, exist_ok=True)
    codes: Counter[tuple[str, int]] = Counter()
    faulty, slowest, largest, begun = 0, 0.0, 0.0, time.monotonic()
    with Worker() as worker:
        runs = (
            islice(checked(worker, given.seed), given.check),
            islice(optimized(worker, given.seed), given.optimize),
        )
        for outcome in (outcome for run in runs for outcome in run):
            codes[outcome.command, outcome.code] += 1
            slowest, largest = max(slowest, outcome.seconds), max(largest, outcome.megabytes)
            if faults := outcome.faults():
                faulty += 1
                file = given.keep / f"{outcome.command}_{given.seed}_{codes.total()}.yaml"
                file.write_text(outcome.text, encoding="utf-8", errors="surrogatepass")
                said = (outcome.err.strip().splitlines() or [""])[-1]
                sys.stdout.write(f"{file}: {', '.join(faults)}: {said[:200]}\n")
            if codes.total() % 500 == 0:
                sys.stdout.write(f"{codes.total()} cases, {faulty} with faults\n")
                sys.stdout.flush()
    ended = ", ".join(f"{command} {code}: {n}" for (command, code), n in sorted(codes.items()))
    sys.stdout.write(f"exit codes {ended}; with faults {faulty}; slowest {slowest:.1f} s, ")
    sys.stdout.write(f"largest {largest:.0f} MB; {time.monotonic() - begun:.0f} s in all\n")
    return int(faulty > 0)


if __name__ == "__main__":
    sys.exit(main())
