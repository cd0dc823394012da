"""A finished run that is run again and interrupted stays whole; the unfinished answer is beside it.

By Ctrl-C and SIGTERM at random moments, forked from a process that has imported everything.
"""

import contextlib
import io
import json
import random
import signal
import time
from pathlib import Path

import pytest
from run_scenes import LITTLE, TWO_LINK
from stopping import can_stop, stopped_after

from eigassign.cli import main
from eigassign.output import is_untouched
from eigassign.pipeline import Options, optimize

DONE, BESIDE = Path("results/arm"), Path("results/arm.unfinished")
HOW = Options(figures=(), report="none", study="none", use_cache=False)


@pytest.fixture(autouse=True)
def _in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    text = TWO_LINK.read_text().replace("samples: 152", "samples: 12")
    Path("arm.yaml").write_text(text + "assignment: {starts: 4}\n")


def verdict(folder: Path) -> str:
    return str(json.loads((folder / "results.json").read_text())["assignment"]["verdict"])


def interrupt(line: str) -> None:
    if ": start 2 of" in line:
        raise KeyboardInterrupt


def stop_the_search() -> Path:
    return optimize("arm.yaml", Options(**{**vars(HOW), "progress": interrupt})).folder


def test_an_unfinished_answer_goes_beside_the_finished_one_and_never_over_it() -> None:
    assert optimize("arm.yaml", HOW).folder == DONE
    finished = (DONE / "run.json").read_bytes()
    BESIDE.mkdir()
    (BESIDE / "mine").write_text("precious")
    for _ in range(2):  # the second takes the place of the first
        assert stop_the_search() == BESIDE
        assert (DONE / "run.json").read_bytes() == finished
        assert is_untouched(DONE)
        assert is_untouched(BESIDE)
        assert verdict(BESIDE) == "do_not_use"
        names = {path.name for path in DONE.parent.iterdir()}
        assert names == {"arm", "arm.unfinished", "arm.unfinished.1"}
    assert (DONE.parent / "arm.unfinished.1" / "mine").read_text() == "precious"
    assert verdict(DONE) != "do_not_use"


def test_where_nothing_is_finished_an_unfinished_answer_is_called_so_too() -> None:
    assert stop_the_search() == BESIDE
    assert not DONE.exists()


def run() -> int:
    with contextlib.redirect_stdout(io.StringIO()):
        return main(["optimize", "arm.yaml", *LITTLE, "--no-cache", "--report", "none"])


@pytest.mark.skipif(not can_stop(), reason="forks, on Linux")
@pytest.mark.parametrize("moments", [4, pytest.param(20, marks=pytest.mark.slow)])
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_finished_run_interrupted_again_is_always_whole(
    number: signal.Signals, moments: int
) -> None:
    start = time.perf_counter()
    assert run() == 0
    longest, draw = 1.1 * (time.perf_counter() - start), random.Random(moments)
    for k in range(moments):
        code = stopped_after(run, draw.uniform(k, k + 1) / moments * longest, number)
        assert code in (0, -number, 128 + number)
        assert is_untouched(DONE), k  # every file has the hash that run.json has of it
        assert verdict(DONE) != "do_not_use", k
        hidden = [path.name for path in DONE.parent.iterdir() if path.name[0] == "."]
        assert code == -number or not hidden, k
        assert not BESIDE.exists() or is_untouched(BESIDE), k
