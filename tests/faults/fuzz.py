"""Case files that nobody wrote, run one after the other: shipped cases with changes.

Those that are optimised are right ones, with small limits of work.
"""

import random
from collections.abc import Iterator

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
