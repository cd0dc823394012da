"""What is done is what its own record says is done: whatever becomes of a file, of clocks and of
processes, the same command ends with the same results.
"""

import hashlib
import json
import os
import resource
import shutil
import signal
from collections.abc import Callable
from itertools import count
from pathlib import Path

import pytest
from instant import batch_of, case, ran
from stopping import can_stop, forked, stopped_at

from eigassign.batch import Batch

MASSES = "0,0.5,0.75,1"  # that of 0.75 has no answer, and a folder without results
DONE = ["mass=0", "mass=0.5", "mass=0.75", "mass=1"]
FILES = ("results.json", "case.yaml", "run.json")


def summaries(folder: Path) -> dict[str, str]:
    """What they say, wherever they are."""
    names = ("summary.csv", "summary.json", "junit.xml")
    there = [folder / name for name in names if (folder / name).exists()]
    return {path.name: path.read_text().replace(str(folder.parent), "") for path in there}


@pytest.fixture
def batch(tmp_path: Path) -> Batch:
    """One that is done."""
    case(tmp_path)
    found = batch_of(tmp_path, MASSES)
    assert ran(found) == DONE
    return found


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:3])


def replaced(path: Path) -> None:
    path.unlink()
    path.mkdir()


def flipped(path: Path) -> None:
    data = path.read_bytes()
    path.write_bytes(bytes([data[0] ^ 1]) + data[1:])


def of_another(path: Path) -> None:
    shutil.copy(path.parents[1] / "mass=1" / path.name, path)


DAMAGES = (
    Path.unlink,
    cut,
    lambda path: path.write_bytes(b""),
    replaced,
    flipped,
    of_another,
    lambda path: (path.unlink(), path.symlink_to(path.parents[1] / "mass=1" / path.name)),
    lambda path: (path.unlink(), os.mkfifo(path)),
)


@pytest.mark.parametrize("damage", DAMAGES)
@pytest.mark.parametrize("name", FILES)
def test_a_case_of_which_any_file_was_damaged_runs_again_and_alone(
    batch: Batch, name: str, damage: Callable[[Path], object]
) -> None:
    before = summaries(batch.folder)
    damage(batch.folder / "mass=0.5" / name)
    assert ran(batch) == ["mass=0.5"]
    assert summaries(batch.folder) == before
    aside = batch.folder / "mass=0.5.1"
    assert aside.is_dir()
    assert os.path.lexists(aside / name) == (damage is not Path.unlink)
    assert ran(batch) == []
    assert summaries(batch.folder) == before


@pytest.mark.parametrize(
    "damage",
    [
        shutil.rmtree,
        lambda folder: os.rename(folder, folder.with_name("elsewhere")),
        lambda folder: (shutil.rmtree(folder), shutil.copytree(folder.with_name("mass=1"), folder)),
    ],
)
def test_a_folder_that_is_gone_or_another_case_s_is_made_again(
    batch: Batch, damage: Callable[[Path], object]
) -> None:
    before = summaries(batch.folder)
    damage(batch.folder / "mass=0.5")
    assert ran(batch) == ["mass=0.5"]
    assert summaries(batch.folder) == before


def test_notes_in_the_folder_of_a_case_leave_it_done(batch: Batch) -> None:
    (batch.folder / "mass=0.5" / "notes.md").write_text("mine")
    assert ran(batch) == []


def test_the_folder_of_a_case_of_another_batch_says_nothing(batch: Batch, tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    case(tmp_path / "other", end="assignment: {starts: 2}\n")
    other = batch_of(tmp_path / "other", MASSES)
    ran(other)
    before = summaries(batch.folder)
    shutil.rmtree(batch.folder / "mass=1")
    shutil.copytree(other.folder / "mass=1", batch.folder / "mass=1")  # its values, not its file
    assert ran(batch) == ["mass=1"]
    assert summaries(batch.folder) == before


def test_a_record_of_another_version_is_not_believed_and_what_it_had_is_kept(batch: Batch) -> None:
    place = batch.folder / "mass=0.5"
    found = json.loads((place / "run.json").read_text())
    (place / "run.json").write_text(json.dumps({**found, "eigassign_run": 2}))
    (place / "notes.md").write_text("mine")
    assert ran(batch) == ["mass=0.5"]
    assert (batch.folder / "mass=0.5.1" / "notes.md").read_text() == "mine"


@pytest.mark.parametrize("damage", [cut, flipped, Path.unlink])
def test_summaries_that_were_damaged_are_made_again(
    batch: Batch, damage: Callable[[Path], object]
) -> None:
    for path in (*batch.folder.glob("summary.*"), batch.folder / "junit.xml"):
        before = path.read_bytes()
        damage(path)
        assert ran(batch) == []
        assert path.read_bytes() == before, path


TOKENS = (
    *("null", "true", "-1", "1.5", "1e999", "NaN", "1" * 5000, '""', '"\\u0000"', '"\\ud800"'),
    *('"../../../etc/passwd"', '"/dev/zero"', '"' + "x" * 10**5 + '"', "[]", '["a", 1, 2, 3]'),
    *('{"": null}', "[" * 900 + "]" * 900, "[" * 10**5),
)


@pytest.mark.parametrize("token", TOKENS, ids=range(len(TOKENS)))
def test_a_record_that_says_anything_is_believed_where_it_can_be_or_the_case_runs_again(
    batch: Batch, token: str
) -> None:
    """Also where it has the hash that goes with it, as somebody writes who wants to be believed."""
    record = batch.folder / "mass=0.5" / "run.json"
    text = record.read_text()
    for place in [*json.loads(text), *(f"outcome.{key}" for key in json.loads(text)["outcome"])]:
        found = json.loads(text)
        inner = found["outcome"] if "." in place else found
        inner[place.rpartition(".")[2]] = "@"
        record.write_text(sealed(json.dumps(found).replace('"@"', token), record.parent))
        assert ran(batch) in ([], ["mass=0.5"]), place


def sealed(text: str, folder: Path) -> str:
    """The record with its hash, where it is one."""
    try:
        content = json.loads(text)
        content.pop("sha256", None)
        files = [hashlib.sha256((folder / name).read_bytes()) for name in content["files"]]
    except (ValueError, RecursionError, TypeError, OSError):
        return text
    own = json.dumps(content) + "".join(file.hexdigest() for file in files)
    return json.dumps({**content, "sha256": hashlib.sha256(own.encode()).hexdigest()})


def test_a_file_of_a_terabyte_is_not_read(batch: Batch) -> None:
    os.truncate(batch.folder / "mass=0.5" / "results.json", 2**40)  # takes no place on the disk
    assert ran(batch) == ["mass=0.5"]


@pytest.mark.skipif(os.fsencode("\udce9") != b"\xe9", reason="needs names that are bytes")
def test_a_case_file_may_have_a_name_that_is_no_text(tmp_path: Path) -> None:
    name = os.fsdecode(b"caf\xe9")
    case(tmp_path, f"{name}.yaml")
    batch = batch_of(tmp_path, MASSES, file=f"{name}.yaml")
    assert ran(batch) == DONE
    row = json.loads((batch.folder / "summary.json").read_text())["cases"][0]
    assert row["path"] == str(tmp_path / f"{name}.yaml")
    assert r"caf\udce9.yaml" in (batch.folder / "summary.csv").read_text()


@pytest.mark.parametrize("minutes", [-10, 10])
def test_a_clock_that_is_wrong_loses_no_variant(tmp_path: Path, minutes: int) -> None:
    case(tmp_path)
    ran(batch_of(tmp_path, "0,0.5"))
    batch = batch_of(tmp_path, "0,0.5,1")
    for path in batch.folder.rglob("*"):
        then = path.stat().st_mtime + 60.0 * minutes
        os.utime(path, (then, then))
    assert ran(batch) == ["mass=1"]
    rows = json.loads((batch.folder / "summary.json").read_text())["cases"]
    assert [row["name"] for row in rows] == ["mass=0", "mass=0.5", "mass=1"]


def test_a_file_that_a_value_names_is_a_part_of_the_case(tmp_path: Path) -> None:
    text = case(tmp_path).read_text()
    table = tmp_path / "q.csv"
    table.write_text("q1,q2\n0,0\n1,1\n")
    setting = "title=q.csv,other"
    first = batch_of(tmp_path, setting=setting)
    assert len(ran(first)) == 2
    table.write_text("q1,q2\n0,0\n1,2\n")
    assert (tmp_path / "arm.yaml").read_text() == text
    assert ran(batch_of(tmp_path, setting=setting)) == ["title=q.csv"]


# --- Processes


def changed(folder: Path) -> Batch:
    """A batch of which a case is new and one damaged."""
    case(folder)
    ran(batch_of(folder, "0,0.5,0.75"))
    out = folder / "out"
    cut(out / "mass=0.5" / "results.json")
    return batch_of(folder, MASSES)


needs_ptrace = pytest.mark.skipif(not can_stop(), reason="needs ptrace, on Linux")


@needs_ptrace
@pytest.mark.parametrize("every", [17, pytest.param(1, marks=pytest.mark.slow)])
def test_a_kill_between_any_two_writes_changes_nothing(tmp_path: Path, every: int) -> None:
    (tmp_path / "undisturbed").mkdir()
    undisturbed = changed(tmp_path / "undisturbed")
    ran(undisturbed)
    expected = summaries(undisturbed.folder)
    for call in count(1, every):
        folder = tmp_path / f"{call}"
        folder.mkdir()
        batch = changed(folder)
        stopped = stopped_at(lambda: len(ran(batch)) * 0, call, signal.SIGKILL)  # noqa: B023
        again = ran(batch)
        assert set(again) <= {"mass=0.5", "mass=1"}, call
        assert summaries(batch.folder) == expected, call
        assert ran(batch) == [], call
        assert not [*batch.folder.glob(".*")], call
        shutil.rmtree(folder)
        if not stopped.reached:
            assert call > 50
            return


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
@pytest.mark.parametrize("most", [0, 1, 100, 300, 500, 700, 1000, 2000, 5000, 20_000])
def test_a_disk_that_is_full_at_any_time_loses_nothing(tmp_path: Path, most: int) -> None:
    (tmp_path / "undisturbed").mkdir()
    undisturbed = changed(tmp_path / "undisturbed")
    ran(undisturbed)
    batch = changed(tmp_path)

    def starved() -> int:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))
        return len(ran(batch)) * 0

    os.waitpid(forked(starved), 0)
    ran(batch)
    assert summaries(batch.folder) == summaries(undisturbed.folder)
    assert ran(batch) == []
