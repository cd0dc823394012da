"""Sixteen processes that write the same, some of them killed at work, never spoil it."""

import os
import random
import signal
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from run_scenes import CASE, TARGET, snapshot, write_a_few_files
from stopping import forked

from eigassign.output import Cache, is_untouched

WRITERS, KILLED = 16, 6
KEY = 64 * "0"


@pytest.fixture
def root(tmp_path: Path) -> Path:
    (tmp_path / CASE).parent.mkdir()
    (tmp_path / CASE).write_text("title: arm\n")
    return tmp_path


def side_by_side(job: Callable[[int], None]) -> list[int]:
    """The exit codes of the processes that do the job, without those killed at random instants."""
    writers = [forked(lambda: job(number) or 0) for number in range(WRITERS)]  # noqa: B023
    draw = random.Random(1)
    for pid in writers[:KILLED]:
        time.sleep(draw.uniform(0.0, 0.05))
        os.kill(pid, signal.SIGKILL)
    codes = [os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1]) for pid in writers]
    return [code for code in codes[:KILLED] if code != -signal.SIGKILL] + codes[KILLED:]


def test_sixteen_writers_of_one_key_leave_one_whole_entry(root: Path) -> None:
    def store(number: int) -> None:
        for turn in range(10):
            cache = Cache(root / "cache")
            found = cache.load(KEY)
            assert found is None or (found["a"] == found["a"][0]).all()
            cache.store(KEY, {"a": np.full(2000, 100.0 * number + turn)})

    assert not any(side_by_side(store))
    found = Cache(root / "cache").load(KEY)
    assert (found["a"] == found["a"][0]).all()
    assert [path.name for path in (root / "cache").iterdir()] == [f"{KEY}.h5"]


def test_sixteen_runs_of_one_case_leave_one_whole_run(root: Path) -> None:
    def run(number: int) -> None:
        for _ in range(5):
            write_a_few_files(root / CASE, root / TARGET, False)

    assert not any(side_by_side(run))
    assert is_untouched(root / TARGET)
    pids = {
        text.split()[-1]
        for name, text in (snapshot(root / TARGET) or {}).items()
        if name != "run.json"
    }
    assert len(pids) == 1
    write_a_few_files(root / CASE, root / TARGET, False)
    assert [path.name for path in (root / TARGET).parent.iterdir()] == [TARGET.name]
