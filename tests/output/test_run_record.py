"""What a run folder says about itself: every file by its hash, its case, its version."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from eigassign.errors import UsageError
from eigassign.output import run_folder, run_status

MARKER = "run.json"

FILES = {"results.json": "{}", "case.yaml": "title: arm\n", "figures/modes.png": "png"}


def sha(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


@pytest.fixture
def run(tmp_path: Path) -> Path:
    case, named = tmp_path / "cases" / "arm.yaml", tmp_path / "cases" / "arm" / "mass.mtx"
    named.parent.mkdir(parents=True)
    case.write_text("title: arm\n")
    named.write_text("1 1\n")
    target = tmp_path / "results" / "arm"
    known = {"case_sha256": sha(case), "case_files": {"arm/mass.mtx": sha(named)}}
    with run_folder(target, case_path=case, **known) as folder:
        (folder / "figures").mkdir()
        for name, text in FILES.items():
            (folder / name).write_text(text)
    return target


def differences(run: Path) -> tuple[tuple[str, ...], ...]:
    changes = run_status(run).changes
    return changes.changed, changes.missing, changes.added


def test_a_run_just_written_is_intact_and_current(run: Path) -> None:
    found = run_status(run)
    assert found.intact
    assert found.current
    assert (found.case_state, dict(found.case_files)) == ("same", {"arm/mass.mtx": "same"})
    assert Path(found.case).samefile(run.parents[1] / "cases" / "arm.yaml")
    assert found.files == len(FILES) + 1
    assert differences(run) == ((), (), ())


def test_case_and_run_may_move_together(run: Path) -> None:
    root = run.parents[1]
    moved = root.with_name("moved")
    os.rename(root, moved)
    assert run_status(moved / "results" / "arm").current


@pytest.mark.parametrize("name", [*FILES, MARKER])
def test_every_flipped_bit_of_every_file_is_noticed(run: Path, name: str) -> None:
    path = run / name
    data, rng = path.read_bytes(), np.random.default_rng(1)
    for position in range(len(data)):
        bit = 1 << int(rng.integers(8))
        path.write_bytes(data[:position] + bytes([data[position] ^ bit]) + data[position + 1 :])
        assert not believed(run), (position, bit)
    path.write_bytes(data)
    assert believed(run)


def believed(run: Path) -> bool:
    try:
        found = run_status(run)
    except UsageError:
        return False
    return found.intact and found.current


def test_changed_missing_and_added_files_are_named(run: Path) -> None:
    (run / "case.yaml").write_text("title: leg\n")
    (run / "results.json").unlink()
    (run / "notes").mkdir()
    (run / "notes" / "mine.md").write_text("mine")
    (run / "empty").mkdir()
    (run / "link").symlink_to(run.parent)
    expected = (("case.yaml",), ("results.json",), ("empty", "link", "notes/mine.md"))
    assert differences(run) == expected
    assert not run_status(run).intact


def test_files_that_were_only_added_leave_a_run_intact(run: Path) -> None:
    (run / "notes.md").write_text("mine")
    assert run_status(run).intact
    assert differences(run) == ((), (), ("notes.md",))


def test_the_folder_that_is_left_of_deleted_figures_is_not_taken_for_the_users(run: Path) -> None:
    (run / "figures" / "modes.png").unlink()
    assert differences(run) == ((), ("figures/modes.png",), ())


@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir, lambda path: os.symlink("x", path)])
def test_what_is_no_file_in_the_place_of_one_is_a_change_and_never_waited_for(
    run: Path, make: object
) -> None:
    for name in ("case.yaml", "results.json"):
        (run / name).unlink()
        make(run / name)  # type: ignore[operator]
    assert not run_status(run).intact


def test_a_pipe_in_the_place_of_the_case_is_no_case(run: Path) -> None:
    case = run.parents[1] / "cases" / "arm.yaml"
    case.unlink()
    os.mkfifo(case)
    assert run_status(run).case_state == "missing"


def test_a_changed_case_changed_matrices_and_another_version_are_told_apart(run: Path) -> None:
    cases = run.parents[1] / "cases"
    (cases / "arm" / "mass.mtx").write_text("2 2\n")
    assert states(run_status(run)) == ("same", "changed", True)
    (cases / "arm.yaml").write_text("title: leg\n")
    assert states(run_status(run)) == ("changed", "changed", True)
    shutil.rmtree(cases)
    assert states(run_status(run)) == ("missing", "missing", True)
    content = {**json.loads((run / MARKER).read_bytes()), "eigassign_version": "99"}
    del content["sha256"]  # of all the others, in one line
    own = hashlib.sha256(json.dumps(content).encode()).hexdigest()
    (run / MARKER).write_text(json.dumps({**content, "sha256": own}, indent=2) + "\n")
    assert states(run_status(run)) == ("missing", "missing", False)
    assert run_status(run).intact


def states(found: Any) -> tuple[str, str, bool]:
    assert not found.current
    return found.case_state, *found.case_files.values(), found.version == found.installed


@pytest.mark.parametrize("content", [b"", b"{}", b"[" * 10**5, b"[]", b"\xff", b'{"files": 1}'])
def test_what_is_not_a_finished_run_is_refused(run: Path, content: bytes) -> None:
    (run / MARKER).write_bytes(content)
    with pytest.raises(UsageError, match=MARKER):
        run_status(run)
    (run / MARKER).unlink()
    with pytest.raises(UsageError, match="not a run folder"):
        run_status(run)
    with pytest.raises(UsageError, match="not a run folder"):
        run_status(run / "nowhere")


def test_of_a_run_of_an_earlier_version_no_file_is_vouched_for(run: Path) -> None:
    path = run / MARKER
    found = json.loads(path.read_bytes())
    earlier = {**found, "eigassign_run": 1, "files": [*found["files"], MARKER]}
    path.write_text(json.dumps({k: v for k, v in earlier.items() if k != "token"}))
    assert not run_status(run).intact
