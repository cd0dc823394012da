"""Many cases: one folder each, a summary, and nothing lost to cases that fail or kill."""

from __future__ import annotations

import csv
import multiprocessing
import os
import signal
import sys
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from concurrent.futures import Executor, Future
from contextlib import contextmanager
from pathlib import Path

import pytest
from commands import python
from wrong_inputs import GOOD

from eigassign.batch import (
    Batch,
    CaseOptions,
    Workers,
    cases_in,
    folder_names,
    plan_of,
    process_pool,
    run,
    work,
)
from eigassign.cli import main
from eigassign.output import CaseOutcome
from eigassign.process import Terminated

STRICT = GOOD.replace("50 %", "1e-9") + "assignment: {method: one_shot}\n"
BOUND = "max: 1}\n  constraints: {heavy: {terms: {m: 1}, min: 3}}"
INFEASIBLE = GOOD.replace("max: 1}", BOUND)

# A program like eigassign, whose cases named kill* take their process with them, and whose cases
# named slow* are at work meanwhile. Worker processes import this file too, so that they behave so
# as well.
KILLING = """
import os, signal, sys, time
import eigassign.batch.work

solved = eigassign.batch.work.solve_case

def solve_case(case, options):
    if case.file.path.stem.startswith("kill"):
        time.sleep(0.5)
        os.kill(os.getpid(), signal.SIGKILL)
    if case.file.path.stem.startswith("slow"):
        time.sleep(1.5)
    return solved(case, options)

eigassign.batch.work.solve_case = solve_case
if __name__ == "__main__":
    from eigassign.cli import main
    sys.exit(main())
"""


@pytest.fixture(autouse=True)
def _in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("EIGASSIGN_CACHE_DIR", str(tmp_path / "cache"))


def write(path: str, text: str = GOOD) -> Path:
    """A case file at ``path``, and the folders above it."""
    file = Path(path)
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text)
    return file


def summary(folder: str = "results") -> dict[str, dict[str, str]]:
    """The rows of summary.csv by name."""
    with open(Path(folder, "summary.csv"), newline="") as file:
        return {row["name"]: row for row in csv.DictReader(file)}


def test_a_batch_keeps_going_past_every_kind_of_failure(
    capsys: pytest.CaptureFixture[str],
) -> None:
    texts = {"good": GOOD, "strict": STRICT, "infeasible": INFEASIBLE, "wrong": "title: x"}
    for name, text in texts.items():
        write(f"cases/{name}.yaml", text)
    assert main(["batch", "cases", "--jobs", "2"]) == 1
    out, err = capsys.readouterr()
    rows = summary()
    assert {name: row["status"] for name, row in rows.items()} == {
        "good": "ok",
        "infeasible": "failed",
        "strict": "tolerance",
        "wrong": "error",
    }
    assert "heavy" in rows["infeasible"]["message"]
    assert "mechanism: required key is missing" in rows["wrong"]["message"]
    assert rows["good"]["design"].startswith("m=")
    written = {path.name for path in Path("results").iterdir()}
    assert {"good", "strict", "infeasible", "summary.csv", "junit.xml"} < written
    assert "wrong" not in written
    assert "eigassign: 3 of 4 cases failed" in err
    assert err.count("case ") >= 4
    assert "tolerance" in out
    suite = ET.parse("results/junit.xml").getroot()
    assert (suite.get("tests"), suite.get("failures"), suite.get("errors")) == ("4", "2", "1")


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ("{targets.0.freqency: [1, 2]}", "did you mean 'targets.0.frequency'"),
        ("{targets.0.frequency: [100 Hz, 1 kg]}", "frequency=1kg: expected a frequency"),
    ],
)
def test_check_sees_a_wrong_sweep(
    values: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    write("a.yaml", f"{GOOD}sweep: {{parameters: {values}}}\n")
    assert main(["check", "a.yaml"]) == 2
    assert said in capsys.readouterr().err
    write("a.yaml", f"{GOOD}sweep: {{parameters: {{mechanism.bodies.tool.mass: [0.1, 0.2]}}}}\n")
    assert main(["check", "a.yaml"]) == 0
    assert "sweep: 2 variants, all of them valid" in " ".join(capsys.readouterr().out.split())


def test_a_batch_in_which_all_is_well_ends_with_0() -> None:
    write("a.yaml")
    assert main(["batch", "a.yaml", "--out", "runs", "--quiet"]) == 0
    assert Path("runs/a/results.json").exists()


def test_a_killed_worker_costs_its_own_case_only() -> None:
    write("killing.py", KILLING)
    for name in ("a", "b", "c", "kill_1", "kill_2"):
        write(f"cases/{name}.yaml")
    done = python("killing.py", "batch", "cases", "--jobs", "2", "--no-cache")
    assert done.returncode == 1, done.stderr
    rows = summary()
    assert [name for name, row in rows.items() if row["status"] == "ok"] == ["a", "b", "c"]
    assert all("killed" in rows[name]["message"] for name in ("kill_1", "kill_2"))


def test_a_case_at_work_when_another_worker_is_killed_is_run_again() -> None:
    """The pool tells the other worker to end: it must, though it is in the middle of its case."""
    write("killing.py", KILLING)
    for name in ("kill", "slow"):
        write(f"cases/{name}.yaml")
    done = python("killing.py", "batch", "cases", "--jobs", "2", "--no-cache")
    assert done.returncode == 1, done.stderr
    assert {name: row["status"] for name, row in summary().items()} == {
        "kill": "error",
        "slow": "ok",
    }
    assert "Traceback" not in done.stderr


def test_workers_have_one_blas_thread_each_and_no_numpy_from_the_start(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "7")
    asked = "__import__('os').environ['OPENBLAS_NUM_THREADS'], 'numpy' in __import__('sys').modules"
    with process_pool(1) as pool:
        assert pool.submit(eval, f"({asked})").result() == ("1", False)
    assert os.environ["OPENBLAS_NUM_THREADS"] == "7"


@pytest.mark.parametrize("_again", range(20))  # two threads wait for the same processes
def test_an_interrupt_stops_the_workers_and_is_passed_on(_again: int) -> None:
    before = set(multiprocessing.active_children())

    def interrupted() -> None:
        with process_pool(2) as pool:
            pool.submit(eval, "__import__('time').sleep(600)")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert set(multiprocessing.active_children()) == before


class InThisProcess(Executor):
    """An executor that is not a process pool: what a cluster's would look like."""

    def submit(self, fn, /, *args, **kwargs):  # type: ignore[no-untyped-def]
        future: Future[list[CaseOutcome]] = Future()
        names = [variant.name for variant in args[0]]
        if "interrupt" in names:
            raise Terminated(signal.SIGTERM)
        if "poison" in names:
            future.set_exception(RuntimeError("worker lost"))
        else:
            future.set_result(fn(*args, **kwargs))
        return future


@contextmanager
def in_this_process(_slots: int) -> Iterator[Executor]:
    with InThisProcess() as pool:
        yield pool


def batch_of(*names: str) -> Batch:
    cases = [write(f"{name}.yaml") for name in names]
    return Batch(plan_of(cases), Path("runs"), CaseOptions("runs", reports="none"))


def test_an_interrupt_leaves_a_summary_of_what_was_finished() -> None:
    with pytest.raises(Terminated):
        run(batch_of("a", "interrupt", "b"), Workers(1, in_this_process), print, print)
    assert {name: row["status"] for name, row in summary("runs").items()} == {"a": "ok"}


def test_any_executor_will_do_and_may_lose_a_case() -> None:
    heard: list[str] = []
    ends = run(
        batch_of("a", "poison"),
        Workers(3, in_this_process),
        lambda _progress: None,
        lambda found: heard.append(found.name),
    )
    assert ends == {"ok": 1, "error": 1}
    assert sorted(heard) == ["a", "poison"]
    assert "killed" in summary("runs")["poison"]["message"]


def test_a_bug_in_one_case_is_an_outcome_and_not_an_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(work, "solve_case", lambda _case, _options: 1 / 0)
    batch = batch_of("a")
    (found,) = work.run_cases([batch.plan[0]], batch.options)
    assert found.status == "error"
    assert "ZeroDivisionError" in found.message


def test_stems_that_collide_get_folders_that_tell_them_apart() -> None:
    cases = [Path(p) for p in ("x/arm.yaml", "y/arm.yaml", "y/ARM.yml", "leg.yaml", "leg.yml")]
    names = folder_names(cases)
    assert names[:2] == ["x-arm", "y-arm"]
    assert names[3] == "leg"
    assert len({name.casefold() for name in names}) == len(cases)


def test_folder_names_do_not_hide_the_summaries_and_need_no_common_stem() -> None:
    assert folder_names([Path("summary.csv.yaml")]) == ["summary.csv-2"]
    assert folder_names([Path("a.yaml"), Path("sub/b.yaml")]) == ["a", "b"]
    assert folder_names([]) == []


def test_folders_are_searched_but_not_their_runs_and_nothing_comes_twice() -> None:
    kept = [write(f"cases/{name}") for name in ("a.yaml", "b.yml", "deep/c.yaml")]
    for name in ("results/a/case.yaml", ".hidden/d.yaml", ".e.yaml", "notes.txt"):
        write(f"cases/{name}")
    write("cases/results/a/run.json", "{}")
    found = cases_in([Path("cases"), Path("cases/a.yaml"), Path("cases/../cases")])
    assert found == kept


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
def test_workers_end_when_their_parent_is_killed() -> None:
    code = (
        "import os, signal\nfrom eigassign.batch.workers import process_pool\n"
        "if __name__ == '__main__':\n"
        "    with process_pool(1) as pool:\n"
        "        print(pool.submit(os.getpid).result(), flush=True)\n"
        "        os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    write("parent.py", code)
    done = python("parent.py")  # returns once every holder of its stdout, the worker too, is gone
    assert done.returncode == -signal.SIGKILL
    assert done.stdout.strip().isdigit()


def test_a_batch_writes_figures_in_the_formats_asked_for() -> None:
    write("a.yaml")
    assert main(["batch", "a.yaml", "--jobs", "1", "--figures", "none"]) == 0
    assert Path("results/a/report.html").exists()
    assert not Path("results/a/figures").exists()
