"""A batch computes nothing twice, whoever is killed, and whatever was in its folder before."""

import json
import os
import shutil
import signal
import time
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor, Executor, Future
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import pytest
from instant import MASS, Instant, batch_of, case, instant, names, ran
from stopping import forked

from eigassign.batch import Batch, Workers
from eigassign.errors import CaseError, StorageError


def summary(batch: Batch) -> dict[str, str]:
    """Status of each case by its name."""
    rows = json.loads((batch.folder / "summary.json").read_text())["cases"]
    return {row["name"]: row["status"] for row in rows}


def test_what_is_done_is_left_out_and_errors_are_tried_again(tmp_path: Path) -> None:
    case(tmp_path)
    batch = batch_of(tmp_path)
    assert ran(batch) == names(batch, range(5))
    assert ran(batch) == ["mass=0.25"]
    assert [*summary(batch).items()] == [
        ("mass=0", "ok"),
        ("mass=0.25", "error"),
        ("mass=0.5", "ok"),
        ("mass=0.75", "failed"),
        ("mass=1", "ok"),
    ]
    shutil.rmtree(batch.folder / "mass=0.5")
    assert ran(batch) == ["mass=0.25", "mass=0.5"]


def test_a_sweep_may_be_enlarged(tmp_path: Path) -> None:
    case(tmp_path)
    ran(batch_of(tmp_path, "0..1:3"))
    larger = batch_of(tmp_path, "0..1:5")
    assert ran(larger) == ["mass=0.25", "mass=0.75"]
    assert list(summary(larger)) == names(larger, range(5))


def test_results_of_cases_that_are_gone_from_the_plan_are_kept_for_when_it_has_them(
    tmp_path: Path,
) -> None:
    case(tmp_path)
    ran(batch_of(tmp_path, "0,1"))
    other = batch_of(tmp_path, "1,2")
    assert ran(other) == ["mass=2"]
    assert [*summary(other)] == ["mass=1", "mass=2"]
    assert ran(other) == []
    again = batch_of(tmp_path, "2,1,0")
    assert ran(again) == []
    assert [*summary(again)] == ["mass=2", "mass=1", "mass=0"]


def test_cases_without_the_report_that_is_asked_for_run_again(tmp_path: Path) -> None:
    case(tmp_path)
    batch = batch_of(tmp_path, "0,0.75,1")
    ran(batch)
    (batch.folder / "mass=1" / "report.html").touch()
    assert ran(batch) == []  # as reports are drawn unless one says otherwise
    for reports, again in (("none", []), ("failed", []), ("all", ["mass=0"])):
        asked = replace(batch.options, reports=reports, redraw=True)
        assert ran(replace(batch, options=asked)) == again


def test_a_file_and_the_folder_of_a_run_are_no_place_for_a_batch(tmp_path: Path) -> None:
    case(tmp_path)
    batch = batch_of(tmp_path, "0,1")
    batch.folder.touch()
    with pytest.raises(StorageError, match="is a file: choose a folder with --out"):
        ran(batch)
    batch.folder.unlink()
    batch.folder.mkdir()
    (batch.folder / "run.json").touch()
    with pytest.raises(StorageError, match="is the folder of a run"):
        ran(batch)


def test_an_edited_case_runs_again(tmp_path: Path) -> None:
    case(tmp_path)
    ran(batch_of(tmp_path, "0,1"))
    case(tmp_path, end="# a comment\n")
    assert ran(batch_of(tmp_path, "0,1")) == []
    case(tmp_path, end="assignment: {starts: 2}\n")
    assert ran(batch_of(tmp_path, "0,1")) == ["mass=0", "mass=1"]


def test_nothing_runs_where_one_variant_is_no_case(tmp_path: Path) -> None:
    case(tmp_path)
    batch = batch_of(tmp_path, "1,-1,-2")
    with pytest.raises(CaseError) as error:
        ran(batch)
    said = [str(problem) for problem in error.value.problems]
    assert said[0].endswith("2 of 3 variants are not valid: nothing was run")
    assert said[1] == f"--set: {MASS}: mass=-1: must be >= 0 kg, got -1"
    assert not batch.folder.exists()


class Failing(Instant):
    """What dies with the case of mass 0.5, and with what is in flight then."""

    def __init__(self, out: Path, error: BaseException) -> None:
        super().__init__(out, lambda _name: None)
        self.error, self.broken = error, False

    def submit(self, fn, /, *args, **kwargs):  # type: ignore[no-untyped-def]
        variant, future = args[0], Future[object]()
        hit = variant.values[MASS] == 0.5
        if hit and not isinstance(self.error, Exception):
            raise self.error
        self.broken |= hit and isinstance(self.error, BrokenExecutor)
        if not (hit or self.broken):
            return super().submit(fn, *args, **kwargs)
        future.set_exception(self.error)
        return future


def failing(batch: Batch, error: BaseException) -> Workers:
    @contextmanager
    def opened(_slots: int) -> Iterator[Executor]:
        yield Failing(batch.folder, error)

    return Workers(3, opened)


@pytest.mark.parametrize("error", [BrokenProcessPool(), RuntimeError("worker lost")], ids=type)
def test_of_what_breaks_the_culprit_is_told_and_nobody_else_loses(
    error: Exception, tmp_path: Path
) -> None:
    """A pool of processes breaks with all that it has in flight."""
    case(tmp_path)
    batch = batch_of(tmp_path, "0,0.5,1,2")
    assert sorted(ran(batch, failing(batch, error))) == names(batch, range(4))
    assert [*summary(batch).values()] == ["ok", "error", "ok", "ok"]
    found = (batch.folder / "summary.csv").read_text()
    assert "the process that ran it was killed" in found


def test_an_interrupt_leaves_a_summary_of_what_was_finished(tmp_path: Path) -> None:
    case(tmp_path)
    batch = batch_of(tmp_path, "0,0.5,1")
    with pytest.raises(KeyboardInterrupt):
        ran(batch, replace(failing(batch, KeyboardInterrupt()), slots=1))
    assert summary(batch) == {"mass=0": "ok"}


needs_locks = pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fcntl and fork")


@needs_locks
def test_a_second_batch_is_refused_until_the_first_has_ended(tmp_path: Path) -> None:
    case(tmp_path)
    batch, log = batch_of(tmp_path, "1..2:21"), tmp_path / "log"

    def heard(name: str) -> None:
        time.sleep(0.02)
        with open(log, "a") as file:
            file.write(f"{name}\n")

    other = forked(lambda: len(ran(batch, instant(batch.folder, heard, 1))) * 0)
    while not log.exists():
        time.sleep(0.01)
    with pytest.raises(StorageError, match=r"another batch is running in .*: wait for it"):
        ran(batch)
    assert os.waitpid(other, 0)[1] == 0
    assert log.read_text().split() == names(batch, range(21))
    assert ran(batch) == []
    assert len(summary(batch)) == 21


@needs_locks
def test_a_batch_that_was_killed_is_gone_on_with(tmp_path: Path) -> None:
    case(tmp_path)
    batch, log = batch_of(tmp_path, "1..2:21"), tmp_path / "log"

    def heard(name: str) -> None:
        with open(log, "a") as file:
            file.write(f"{name}\n")
        if name == "mass=1.5":
            os.kill(os.getpid(), signal.SIGKILL)

    other = forked(lambda: len(ran(batch, instant(batch.folder, heard, 1))) * 0)
    assert os.waitstatus_to_exitcode(os.waitpid(other, 0)[1]) == -signal.SIGKILL
    done = log.read_text().split()
    assert ran(batch) == names(batch, range(21))[len(done) - 1 :]
