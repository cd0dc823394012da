"""Whatever becomes of a file that a run or batch has left, the commands that read it end as if
nothing had happened, or with an error that names it: within limits of time and memory.
"""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from fuzz_stored import Stage
from fuzz_worker import Worker

SEEDS, EACH = 125, 16  # damages of a seed: 2 000 in all


@pytest.fixture(scope="module")
def worker() -> Iterator[Worker]:
    with Worker() as running:
        yield running


@pytest.fixture(scope="module")
def stage(worker: Worker, tmp_path_factory: pytest.TempPathFactory) -> Stage:
    return Stage(tmp_path_factory.mktemp("stored"), worker)


@pytest.mark.parametrize("seed", range(SEEDS))
def test_stored_files_that_anything_has_happened_to_are_whole_again_or_named(
    stage: Stage, worker: Worker, seed: int
) -> None:
    faults = [fault for trial in stage.trials(seed, EACH) for fault in trial.faults(worker)]
    assert not faults, "\n".join(faults)
