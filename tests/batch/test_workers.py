"""Worker processes: what they start with, and that none of them outlives its work."""

import multiprocessing
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from beam import TEXT

from eigassign.batch import Batch, CaseOptions, Workers, outcome_of, plan_of, process_pool, run

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")


# What a worker evaluates in place of a case, by the first word of its name
WORK = {
    "kill": "(__import__('time').sleep(0.3), __import__('os').kill(__import__('os').getpid(), 9))",
    "slow": "__import__('time').sleep(1)",
}


class Dying(Executor):
    """Processes in which cases named kill end their process, and cases named slow last."""

    def __init__(self, pool: Executor) -> None:
        self.pool = pool

    def submit(self, fn, /, *args, **kwargs):  # type: ignore[no-untyped-def]
        variant, future = args[0], Future[Any]()

        def answer(done: Future[Any]) -> None:
            if error := done.exception():
                future.set_exception(error)
            else:
                future.set_result(outcome_of(variant, "ok"))

        work = WORK.get(variant.name.partition("_")[0], "None")
        self.pool.submit(eval, work).add_done_callback(answer)
        return future


@contextmanager
def dying_pool(slots: int) -> Iterator[Executor]:
    with process_pool(slots) as pool:
        yield Dying(pool)


def test_a_killed_worker_costs_its_own_case_only_and_what_was_at_work_runs_again(
    tmp_path: Path,
) -> None:
    """The pool tells the other worker to end: it must, though it is in the middle of its case."""
    cases = [tmp_path / f"{name}.yaml" for name in ("kill_1", "slow", "kill_2", "b")]
    for case in cases:
        case.write_text(TEXT)
    batch = Batch(plan_of(cases), tmp_path / "out", CaseOptions("out"))
    rows = run(batch, Workers(2, dying_pool), lambda _total, _done: None, lambda _row: None)
    found = {row.name: row for row in rows}
    assert {name: outcome.status for name, outcome in found.items()} == {
        "kill_1": "error",
        "slow": "ok",
        "kill_2": "error",
        "b": "ok",
    }
    assert all("killed" in found[name].message for name in ("kill_1", "kill_2"))


def test_workers_have_one_blas_thread_each_and_no_numpy_from_the_start(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "7")
    asked = "__import__('os').environ['OPENBLAS_NUM_THREADS'], 'numpy' in __import__('sys').modules"
    with process_pool(1) as pool:
        assert pool.submit(eval, f"({asked})").result() == ("1", False)
    assert os.environ["OPENBLAS_NUM_THREADS"] == "7"


@pytest.mark.parametrize("seed", range(20))  # two threads wait for the same processes
def test_an_interrupt_stops_the_workers_and_is_passed_on(seed: int) -> None:
    before = set(multiprocessing.active_children())

    def interrupted() -> None:
        with process_pool(2) as pool:
            pool.submit(eval, "__import__('time').sleep(600)")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert set(multiprocessing.active_children()) == before


@pytest.mark.slow  # it may take five seconds to see that it is gone
def test_workers_end_when_their_parent_is_killed(tmp_path: Path) -> None:
    code = (
        "import os, signal\nfrom eigassign.batch import process_pool\n"
        "if __name__ == '__main__':\n"
        "    with process_pool(1) as pool:\n"
        "        print(pool.submit(os.getpid).result(), flush=True)\n"
        "        os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    (tmp_path / "parent.py").write_text(code)
    # returns once every holder of its stdout, the worker too, is gone
    parent = [sys.executable, str(tmp_path / "parent.py")]
    done = subprocess.run(parent, stdout=subprocess.PIPE, text=True, timeout=120)
    assert done.returncode == -signal.SIGKILL
    assert done.stdout.strip().isdigit()
