"""What a run folder says about itself: whether it is finished, and as its run wrote it."""

import json
import os
from pathlib import Path

import numpy as np
import pytest

from eigassign.output import is_untouched, run_folder

MARKER = "run.json"
FILES = {"results.json": "{}", "case.yaml": "title: arm\n", "figures/modes.png": "png"}


@pytest.fixture
def run(tmp_path: Path) -> Path:
    case = tmp_path / "cases" / "arm.yaml"
    case.parent.mkdir()
    case.write_text("title: arm\n")
    target = tmp_path / "results" / "arm"
    with run_folder(target, case_path=case, key="a" * 64) as folder:
        (folder / "figures").mkdir()
        for name, text in FILES.items():
            (folder / name).write_text(text)
    return target


def test_a_run_just_written_is_untouched_wherever_it_is_moved_to(run: Path) -> None:
    assert is_untouched(run)
    os.rename(run, run.with_name("moved"))
    assert is_untouched(run.with_name("moved"))
    assert not is_untouched(run)


@pytest.mark.parametrize("name", [*FILES, MARKER])
def test_every_flipped_bit_of_every_file_is_noticed(run: Path, name: str) -> None:
    path = run / name
    data, rng = path.read_bytes(), np.random.default_rng(1)
    for position in range(len(data)):
        bit = 1 << int(rng.integers(8))
        path.write_bytes(data[:position] + bytes([data[position] ^ bit]) + data[position + 1 :])
        assert not is_untouched(run), (position, bit)
    path.write_bytes(data)
    assert is_untouched(run)


@pytest.mark.parametrize(
    "touch",
    [
        lambda run: (run / "results.json").unlink(),
        lambda run: (run / "notes.md").write_text("mine"),
        lambda run: (run / "empty").mkdir(),
        lambda run: (run / "link").symlink_to(run.parent),
        lambda run: os.rename(run / "figures", run / "pictures"),
        lambda run: (run / "case.yaml").unlink() or os.mkfifo(run / "case.yaml"),
        lambda run: (run / "results.json").unlink() or os.mkfifo(run / "results.json"),
        lambda run: (run / "results.json").unlink() or os.mkdir(run / "results.json"),
        lambda run: (run / "results.json").unlink() or os.symlink("x", run / "results.json"),
    ],
)
def test_files_that_were_added_or_deleted_are_noticed(run: Path, touch) -> None:  # type: ignore[no-untyped-def]
    touch(run)
    assert not is_untouched(run)


@pytest.mark.parametrize("content", [b"", b"{}", b"[" * 10**5, b"[]", b"\xff", b'{"files": 1}'])
def test_what_is_not_a_finished_run_is_not_vouched_for(run: Path, content: bytes) -> None:
    (run / MARKER).write_bytes(content)
    assert not is_untouched(run)
    (run / MARKER).unlink()
    assert not is_untouched(run)


def test_of_a_run_of_an_earlier_version_no_file_is_vouched_for(run: Path) -> None:
    path = run / MARKER
    found = json.loads(path.read_bytes())
    path.write_text(json.dumps({**found, "eigassign_run": 1}))
    assert not is_untouched(run)
