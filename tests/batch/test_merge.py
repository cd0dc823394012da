"""Shards of a batch become one, or it is said why not; no case is run here."""

from __future__ import annotations

import csv
import json
import os
import re
import xml.etree.ElementTree as ET
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pytest
from instant import write_run

from eigassign.batch import (
    Header,
    Manifest,
    limited,
    merge_shards,
    read_header,
    summarise,
    write_header,
)
from eigassign.cli import main
from eigassign.errors import UsageError
from eigassign.output import CaseOutcome

TOTAL = 7
RANGES = (("mode 1", 180.0, 190.0, 200.0),)


def row(k: int) -> CaseOutcome:
    values = {"body.mass": f"{k} g"}
    status = "failed" if k == 3 else "ok"
    found = CaseOutcome(f"mass={k}g", "arm.yaml", status, 0.1, values=values, index=k)
    return replace(found, frequencies=RANGES, verdict="reached", run_folder=f"mass={k}g")


def shard(folder: Path, i: int, n: int, *, columns: bool = False, **changes: object) -> Path:
    """The folder of a shard, its cases finished in no order."""
    header = Header("abc", TOTAL, (i, n), ("../arm.yaml",), ("body.mass",), columns)
    folder.mkdir(parents=True)
    write_header(folder, replace(header, **changes))
    manifest = Manifest(folder, "abc")
    for k in reversed(header.indices()[: len(range(i - 1, TOTAL, n))]):
        manifest.append(replace(row(k), run_folder=None) if columns else row(k))
        if not columns:
            write_run(folder / row(k).name, row(k))
    return folder


def names(folder: Path) -> list[str]:
    with open(folder / "summary.csv", newline="") as file:
        return [line["name"] for line in csv.DictReader(file)]


@pytest.mark.parametrize("columns", [False, True])
def test_shards_in_any_order_become_what_one_batch_is(tmp_path: Path, columns: bool) -> None:
    shards = [shard(tmp_path / str(i), i, 3, columns=columns) for i in (2, 3, 1)]
    out, whole = tmp_path / "out", shard(tmp_path / "whole", 1, 1, columns=columns)
    assert merge_shards(out, shards).ends == {"ok": TOTAL - 1, "failed": 1}
    assert merge_shards(whole, []).ends == {"ok": TOTAL - 1, "failed": 1}
    assert names(out) == [f"mass={k}g" for k in range(TOTAL)]
    if columns:
        for name in ("summary.csv", "summary.json", "junit.xml"):
            assert (out / name).read_text() == (whole / name).read_text(), name
    header = read_header(out)
    assert header is not None
    assert (header.shard, header.files) == ((1, 1), ("../arm.yaml",))


def external(path: Path) -> None:
    secret = path.with_name("secret")
    secret.write_bytes(b"a password" + bytes(100))
    with h5py.File(path, "r+") as file:
        (count,) = file["seconds"].shape
        del file["seconds"]
        raw = [(str(secret), 0, 8 * count)]
        file.create_dataset("seconds", (count,), np.float64, external=raw)


def bomb(path: Path) -> None:
    with h5py.File(path, "r+") as file:
        file.create_dataset("design/m1", (10**8,), np.float64, compression="gzip")[:] = 0.0


def pipe(path: Path) -> None:
    path.unlink()
    os.mkfifo(path)


@pytest.mark.parametrize(
    ("name", "change"),
    [
        ("columns.h5", external),
        pytest.param("columns.h5", bomb, marks=pytest.mark.slow),
        ("columns.h5", pipe),
        ("junit.xml", lambda path: path.write_text("<testsuites ")),
        ("summary.csv", lambda path: path.write_text("name,\nanother,\n")),
    ],
)
def test_what_others_made_of_a_shards_summaries_is_not_read(
    tmp_path: Path, name: str, change: Callable[[Path], object]
) -> None:
    shards = [shard(tmp_path / str(i), i, 2, columns=True) for i in (1, 2)]
    merge_shards(tmp_path / "before", shards)
    for folder in shards:
        merge_shards(folder, [])
    change(shards[0] / name)
    merge_shards(tmp_path / "out", shards)
    for name in ("summary.csv", "junit.xml", "columns.h5"):
        assert (tmp_path / "out" / name).read_bytes() == (tmp_path / "before" / name).read_bytes()
    assert b"a password" not in (tmp_path / "out" / "columns.h5").read_bytes()


def test_the_folders_of_cases_stay_and_are_found_from_the_new_place(tmp_path: Path) -> None:
    shards = [shard(tmp_path / "parts" / str(i), i, 2) for i in (1, 2)]
    merge_shards(tmp_path / "out", shards)
    found = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert found["cases"][2]["run_folder"] == "../parts/1/mass=2g"
    merge_shards(tmp_path / "out", shards)  # again, over itself


def refused(out: Path, *shards: Path) -> str:
    with pytest.raises(UsageError) as error:
        merge_shards(out, shards)
    assert not (out / "summary.csv").exists()
    return str(error.value)


def test_a_missing_shard_is_named(tmp_path: Path) -> None:
    shards = [shard(tmp_path / str(i), i, 5) for i in (1, 4)]
    assert "missing of 5 shards: 2, 3, 5" in refused(tmp_path / "out", *shards)


def test_an_unfinished_shard_is_named(tmp_path: Path) -> None:
    shards = [shard(tmp_path / str(i), i, 2) for i in (1, 2)]
    lines = (shards[1] / "manifest.jsonl").read_bytes()
    (shards[1] / "manifest.jsonl").write_bytes(lines[:-5])  # torn
    assert "shard 2/2, is not finished: 2 of 3 cases" in refused(tmp_path / "out", *shards)


def test_shards_of_other_batches_and_the_same_one_twice_are_named(tmp_path: Path) -> None:
    first = shard(tmp_path / "a", 1, 2)
    others = [
        shard(tmp_path / "b", 2, 2, plan="other"),
        shard(tmp_path / "c", 2, 2, version="0.0.1"),
        shard(tmp_path / "d", 1, 2),
    ]
    said = refused(tmp_path / "out", first, *others)
    for name in "bc":
        assert f"{tmp_path / name} is a shard of another batch than {first}" in said
    assert f"{tmp_path / 'd'} and {first} are the same shard, 1/2" in said


def test_a_header_of_more_cases_than_memory_holds_costs_none(tmp_path: Path) -> None:
    many = {"cases": 400_000_000, "files": ("../arm.yaml",) * 40}
    shards = [shard(tmp_path / str(i), i, 2, **many) for i in (1, 2)]
    of_many = [shard(tmp_path / f"{i} of many", i, 300_000_000, **many) for i in (1, 300_000_000)]
    with limited(None, 400.0):
        said = refused(tmp_path / "out", *shards)
        assert "shard 1/2, is not finished: 4 of 200000000 cases" in said
        said = refused(tmp_path / "out", *of_many)
        assert "missing of 300000000 shards: 2, 3, 4, 5, 6, 7, 8, 9, 10, 11 and 299999988" in said
        assert merge_shards(shards[0], []).ends == {"ok": 4}


def test_no_folder_of_a_batch_and_a_shard_as_target_are_refused(tmp_path: Path) -> None:
    shards = [shard(tmp_path / str(i), i, 2) for i in (1, 2)]
    (tmp_path / "empty").mkdir()
    assert "is not the folder of a batch" in refused(tmp_path / "out", tmp_path / "empty")
    assert "or one of the shards" in refused(shards[0], *shards)


def test_the_command_counts_and_names_what_has_moved(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("before", "now"):
        shard(Path(name), 1, 1)
    assert main(["merge", "before"]) == 1  # a case has failed
    moved = replace(row(5), frequencies=(("mode 1", 180.0, 190.0, 200.5),))
    write_run(Path("now", moved.name), moved)
    Manifest(Path("now"), "abc").append(moved)
    capsys.readouterr()
    assert main(["merge", "now", "--against", "before"]) == 1
    out, err = capsys.readouterr()
    assert re.search(r"mass=5g +mode 1, highest +200 Hz +200\.5 Hz +\+0\.5 Hz", out)
    assert "7 cases in now: 6 ok, 1 failed" in out
    assert "1 of 7 cases gave no answer to use" in err
    tests = {test.get("name"): test for test in ET.parse("now/junit.xml").iter("testcase")}
    failures = {name: test.find("failure") for name, test in tests.items()}
    assert [name for name, found in failures.items() if found is not None] == ["mass=3g", "mass=5g"]
    said = failures["mass=5g"]
    assert said is not None
    assert said.get("type") == "moved"
    assert said.text == "mode 1, highest: was 200 Hz, is 200.5 Hz, moved by +0.5 Hz"
    header = read_header(Path("now"))
    assert header is not None
    summarise(Path("now"), header)  # without a comparison
    assert "moved" not in Path("now/junit.xml").read_text()
