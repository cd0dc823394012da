"""A run folder appears whole or not at all, and replaces only earlier runs of its own case."""

import errno
import fcntl
import os
import stat
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from eigassign.errors import StorageError
from eigassign.output import run_folder

MARKER = "run.json"


@pytest.fixture
def case(tmp_path: Path) -> Path:
    path = tmp_path / "cases" / "arm.yaml"
    path.parent.mkdir()
    path.write_text("title: arm\n")
    return path


@pytest.fixture
def target(tmp_path: Path) -> Path:
    return tmp_path / "results" / "arm"


def write(target: Path, case: Path, text: str = "one", sha: str = "a" * 64, **options) -> None:
    with run_folder(target, case_path=case, key=sha, **options) as folder:
        (folder / "results.json").write_text(text)
        (folder / "figures").mkdir()
        (folder / "figures" / "modes.png").write_bytes(b"png")


def fill(target: Path, case: Path, work: Callable[[Path], None]) -> None:
    with run_folder(target, case_path=case, key="a") as folder:
        work(folder)


def hidden(target: Path) -> list[str]:
    return [p.name for p in target.parent.iterdir() if p.name.startswith(".")]


@pytest.fixture(params=["exchange", "two renames"])
def any_system(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if request.param == "two renames":
        monkeypatch.setattr(sys, "platform", "darwin")


def test_a_first_run_appears_with_its_marker_and_leaves_nothing_hidden(target, case):
    write(target, case)
    names = {p.relative_to(target).as_posix() for p in target.rglob("*")}
    assert names == {"results.json", "figures", "figures/modes.png", MARKER}
    assert hidden(target) == []


def test_nothing_is_visible_at_the_target_before_the_run_ends(target, case):
    with run_folder(target, case_path=case, key="a") as folder:
        assert folder.parent == target.parent
        assert not target.exists()
    assert target.exists()


@pytest.mark.usefixtures("any_system")
def test_a_rerun_of_the_same_case_file_replaces_the_folder_whole(target, case):
    write(target, case, "one")
    write(target, case, "two", sha="b" * 64)  # the case was edited in between
    assert (target / "results.json").read_text() == "two"
    assert [p.name for p in target.parent.iterdir()] == ["arm"]


def test_case_and_results_may_move_together(tmp_path, target, case):
    write(target, case)
    moved = tmp_path / "elsewhere"
    moved.mkdir()
    os.rename(case.parent, moved / "cases")
    os.rename(target.parent, moved / "results")
    write(moved / "results" / "arm", moved / "cases" / "arm.yaml", "two", sha="b" * 64)
    assert (moved / "results" / "arm" / "results.json").read_text() == "two"


def test_an_empty_folder_is_accepted(target, case):
    target.mkdir(parents=True)
    write(target, case)
    assert (target / MARKER).exists()


def foreign(target: Path, case: Path) -> None:
    target.mkdir(parents=True)
    (target / "thesis.tex").write_text("precious")


def unfinished(target: Path, case: Path) -> None:
    foreign(target, case)
    (target / MARKER).write_text('{"eigassign_run": 1')


def other_case(target: Path, case: Path) -> None:
    other = case.with_name("other.yaml")
    other.write_text("title: other\n")
    write(target, other, sha="c" * 64)


def plain_file(target: Path, case: Path) -> None:
    target.parent.mkdir(parents=True)
    target.write_text("precious")


@pytest.mark.parametrize("occupy", [foreign, unfinished, other_case, plain_file])
def test_what_is_not_an_earlier_run_of_the_case_is_refused_before_any_work(target, case, occupy):
    occupy(target, case)
    before = snapshot(target)
    with pytest.raises(StorageError, match=r"--out.*--force"):
        fill(target, case, lambda folder: pytest.fail("the run must not start"))
    assert snapshot(target) == before
    assert hidden(target) == []


@pytest.mark.usefixtures("any_system")
@pytest.mark.parametrize("occupy", [foreign, unfinished, other_case, plain_file])
def test_force_moves_what_was_there_aside_and_deletes_nothing(target, case, occupy, caplog):
    occupy(target, case)
    before = snapshot(target)
    write(target, case, force=True)
    assert (target / "results.json").read_text() == "one"
    assert snapshot(target.with_name("arm.1")) == before
    assert "arm.1" in caplog.text


@pytest.mark.usefixtures("any_system")
def test_files_that_a_user_added_to_a_run_are_kept_beside_the_new_one(target, case, caplog):
    write(target, case, "one")
    for number in (1, 2):
        (target / "notes.md").write_text(f"mine {number}")
        write(target, case, "two")
        assert (target.with_name(f"arm.{number}") / "notes.md").read_text() == f"mine {number}"
    assert not (target / "notes.md").exists()
    assert "kept what was in" in caplog.text


def test_a_run_of_which_a_file_was_deleted_is_kept_beside_the_new_one(target, case):
    write(target, case, "one")
    (target / "figures" / "modes.png").unlink()
    write(target, case, "two")
    assert (target.with_name("arm.1") / "results.json").read_text() == "one"


def snapshot(path: Path) -> dict[str, str]:
    if path.is_file():
        return {"": path.read_text()}
    return {p.relative_to(path).as_posix(): p.read_text() for p in path.rglob("*") if p.is_file()}


@pytest.mark.parametrize("interrupt", [KeyboardInterrupt(), SystemExit(143), RuntimeError("bug")])
def test_an_interrupt_in_the_middle_leaves_the_earlier_run_and_no_litter(target, case, interrupt):
    write(target, case, "one")
    before = snapshot(target)

    def half(folder: Path) -> None:
        (folder / "results.json").write_text("half")
        raise interrupt

    with pytest.raises(type(interrupt)):
        fill(target, case, half)
    assert snapshot(target) == before
    assert hidden(target) == []


def failing(call: Callable[..., object], ours: Callable[..., bool]) -> Callable[..., object]:
    """A function of the system that fails where it is called so by us."""

    def attempt(*arguments: object) -> object:
        if ours(*arguments):
            raise OSError(errno.EIO, "input/output error")
        return call(*arguments)

    return attempt


@pytest.mark.parametrize(
    ("name", "ours"),
    [
        ("fsync", lambda descriptor: stat.S_ISREG(os.fstat(descriptor).st_mode)),
        ("rename", lambda source, _: str(source).endswith(".tmp")),
        ("walk", lambda *_: True),
    ],
)
def test_a_failure_while_publishing_leaves_the_earlier_run(target, case, name, ours, monkeypatch):
    write(target, case, "one")
    (target / "notes.md").write_text("mine")
    before = snapshot(target)
    with monkeypatch.context() as patch:
        patch.setattr(os, name, failing(getattr(os, name), ours))
        with pytest.raises(StorageError, match="input/output error"):
            write(target, case, "two")
    assert snapshot(target) == before
    assert [p.name for p in target.parent.iterdir()] == ["arm"]


def test_a_second_rename_that_fails_brings_the_earlier_run_back(target, case, monkeypatch):
    write(target, case, "one")
    monkeypatch.setattr(sys, "platform", "darwin")
    ours = lambda source, _: str(source).endswith(".new")  # noqa: E731
    monkeypatch.setattr(os, "rename", failing(os.rename, ours))
    with pytest.raises(StorageError):
        write(target, case, "two")
    assert (target / "results.json").read_text() == "one"


def test_a_folder_that_appears_during_the_run_is_left_alone(target, case):
    with pytest.raises(StorageError, match="appeared during this run"):
        fill(target, case, lambda folder: foreign(target, case))
    assert snapshot(target) == {"thesis.tex": "precious"}
    assert hidden(target) == []


def test_the_working_folder_and_the_case_are_never_replaced(tmp_path, case, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for target in (tmp_path, tmp_path.parent, case.parent):
        with pytest.raises(StorageError, match="--out"):
            write(target, case, force=True)


def test_a_linked_folder_stays_linked(tmp_path, case):
    (tmp_path / "disk").mkdir()
    (tmp_path / "link").symlink_to(tmp_path / "disk" / "arm")
    write(tmp_path / "link", case, "one")
    write(tmp_path / "link", case, "two")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "disk" / "arm" / "results.json").read_text() == "two"


def test_the_folder_of_a_killed_run_is_removed_by_the_next_but_not_that_of_a_live_one(target, case):
    dead, other, alive = (
        target.parent / name
        for name in (".arm.1-deaddead.tmp", ".rail.1-deaddead.tmp", ".arm.1-0a11fe00.tmp")
    )
    for folder in (dead, other, alive):
        (folder / "figures").mkdir(parents=True)
    held = os.open(alive, os.O_RDONLY)
    fcntl.flock(held, fcntl.LOCK_EX)
    write(target, case)
    os.close(held)
    assert hidden(target) == [alive.name]


def test_hidden_folders_of_others_are_left_alone(target, case):
    names = (".git", ".arm.tmp", ".arm.1-DEADDEAD.tmp", ".1-deaddead.tmp", "arm.1-deaddead.tmp")
    for name in names:
        (target.parent / name).mkdir(parents=True)
    write(target, case)
    assert {path.name for path in target.parent.iterdir()} == {"arm", *names}


def test_what_a_killed_swap_had_moved_away_comes_back(target, case):
    write(target, case, "one")
    os.rename(target, target.with_name(".arm.1-deadbeef.old0"))

    def stop(folder: Path) -> None:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fill(target, case, stop)
    assert (target / "results.json").read_text() == "one"
    assert hidden(target) == []
