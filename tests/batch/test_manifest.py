"""A manifest keeps every whole line, whoever was killed while writing the next."""

from __future__ import annotations

import errno
import os
import re
import threading
from pathlib import Path

import pytest

from eigassign.batch import Header, InOrder, Manifest, read_header, write_header
from eigassign.errors import StorageError, UsageError
from eigassign.output import CaseOutcome, from_line, to_line

PLAN = "abc"


def row(index: int, status: str = "ok") -> CaseOutcome:
    named = {"index": index, "key": f"{index:04x}", "design": [], "frequencies": []}
    return CaseOutcome(f"case {index}", "arm.yaml", status, 0.1, **named)  # type: ignore[arg-type]


def news(manifest: Manifest) -> list[CaseOutcome]:
    return [line.outcome for line in manifest.news()]


def in_order(folder: Path, cases: int = 10) -> list[CaseOutcome]:
    header = Header(PLAN, cases, ("arm.yaml",))
    return [from_line(text) for text in InOrder(folder, header)]


def test_rows_are_read_as_they_are_added_by_whomever(tmp_path: Path) -> None:
    one, other = Manifest(tmp_path, PLAN), Manifest(tmp_path, PLAN)
    assert news(one) == []
    one.append(row(1))
    other.append(row(0))
    assert news(one) == [row(1), row(0)]
    assert news(one) == []
    one.append(row(2))
    assert news(one) == [row(2)]
    assert news(other) == [row(1), row(0), row(2)]


def test_lines_are_on_disk_soon_and_when_they_are_asked_to_be(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    synced, fsync, manifest = threading.Event(), os.fsync, Manifest(tmp_path, PLAN)

    def heard(descriptor: int) -> None:
        fsync(descriptor)
        synced.set()

    monkeypatch.setattr(os, "fsync", heard)
    for k in range(2):
        manifest.append(row(k))
        assert synced.wait(timeout=60)  # of itself, a second later
        synced.clear()
    manifest.append(row(2))
    manifest.sync()
    assert synced.is_set()


def test_a_disk_that_keeps_no_line_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(_descriptor: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    manifest = Manifest(tmp_path, PLAN)
    manifest.append(row(1))
    for _ in range(2):
        with pytest.raises(StorageError, match="No space left"):
            manifest.sync()
    with pytest.raises(StorageError, match="No space left"):
        manifest.append(row(2))
    assert news(Manifest(tmp_path, PLAN)) == [row(1), row(2)]


@pytest.mark.parametrize("torn", [b"x", b'{"index": 7, "na', b"y" * 10_000])
def test_a_torn_last_line_is_none_and_is_cut_off(tmp_path: Path, torn: bytes) -> None:
    manifest = Manifest(tmp_path, PLAN)
    manifest.append(row(1))
    whole = manifest.path.read_bytes()
    manifest.path.write_bytes(whole + torn)
    assert news(manifest) == [row(1)]
    manifest.append(row(2))
    assert news(manifest) == [row(2)]
    assert manifest.path.read_bytes().startswith(whole + b'{"index": 2')
    manifest.path.write_bytes(torn)
    manifest.append(row(3))
    assert news(Manifest(tmp_path, PLAN)) == [row(3)]


def test_rows_come_in_the_order_of_the_plan_and_the_last_of_a_case_counts(tmp_path: Path) -> None:
    manifest = Manifest(tmp_path, PLAN)
    for each in (row(5), row(3, "error"), row(4), row(3), row(99)):
        manifest.append(each)
    with open(manifest.path, "ab") as file:
        file.write(b"nonsense\n[1]\n")
    assert in_order(tmp_path, 8) == [row(3), row(4), row(5)]
    assert in_order(tmp_path, 3) == []
    assert in_order(tmp_path / "none") == []


def test_what_tells_rows_from_others_is_what_they_say_and_not_where_they_stand(
    tmp_path: Path,
) -> None:
    rows, header = [row(0), row(1), row(2)], Header(PLAN, 3, ("arm.yaml",))
    digests = []
    for name, every in (
        ("a", rows),
        ("b", rows[::-1]),
        ("c", [row(1, "error"), *rows, row(1)]),
        ("d", rows[:2]),
        ("e", [*rows, row(1, "error")]),
    ):
        (tmp_path / name).mkdir()
        for each in every:
            Manifest(tmp_path / name, PLAN).append(each)
        digests.append(InOrder(tmp_path / name, header).digest)
    assert digests[0] == digests[1] == digests[2]
    assert len(set(digests)) == 3


def test_a_line_of_which_any_byte_was_changed_is_no_result_and_the_one_behind_it_counts(
    tmp_path: Path,
) -> None:
    manifest = Manifest(tmp_path, PLAN)
    manifest.append(row(1))
    whole = manifest.path.read_bytes()
    for k in range(len(whole)):
        damaged = whole[:k] + bytes([whole[k] ^ 1]) + whole[k + 1 :]
        manifest.path.write_bytes(damaged)
        assert news(Manifest(tmp_path, PLAN)) == [], k
        manifest.path.write_bytes(damaged + b"\n" + whole)
        assert in_order(tmp_path) == [row(1)], k


def test_a_line_of_another_batch_is_none(tmp_path: Path) -> None:
    Manifest(tmp_path, "another").append(row(1))
    assert news(Manifest(tmp_path, PLAN)) == []
    assert in_order(tmp_path) == []


@pytest.mark.parametrize(
    ("was", "becomes"),
    [
        ('"ok"', '["ok"]'),
        ('"ok"', '"fine"'),
        ('"values": {}', '"values": null'),
        ('"seconds": 0.1', '"seconds": "0.1"'),
        ('"seconds": 0.1', '"seconds": NaN'),
        ('"design": []', '"design": 5'),
        ('"design": []', '"design": [["m", "1"]]'),
        ('"design": []', '"design": ' + 10**5 * "["),
        ('"frequencies": []', '"frequencies": [["mode 1", 1.0]]'),
        ('"frequencies": []', '"frequencies": [["mode 1", 1.0, 1e999, 2.0]]'),
        ('"seconds": 0.1', f'"seconds": 1{"0" * 400}'),
        ('"values": {}', '"values": {"mass": -1e999}'),
        ('"case 1"', "1"),
        ('"run_folder": null', '"run_folder": ["a"]'),
        ('"run_folder": null', '"run_folder": "\\u0000"'),
        ('"run_folder": null', '"run_folder": "\\ud800"'),
        ('"index": 1,', '"index": 1.0,'),
        ('"index": 1,', f'"index": 1{"0" * 5000},'),
    ],
)
def test_what_is_no_row_is_said_to_be_damaged(was: str, becomes: str) -> None:
    damaged = to_line(row(1)).replace(was, becomes)
    assert damaged != to_line(row(1))
    for text in (damaged, damaged.encode()):
        with pytest.raises(StorageError, match="delete it and run the batch again"):
            from_line(text)


def test_a_header_reads_back_and_a_damaged_one_is_refused(tmp_path: Path) -> None:
    assert read_header(tmp_path) is None
    header = Header("abc", 10, ("../arm.yaml",))
    write_header(tmp_path, header)
    assert read_header(tmp_path) == header
    whole = (tmp_path / "batch.json").read_bytes()
    many = (b": 1e9,", b': "10",', b": 1e999,", b": -1,", b": true,", b": 1" + b"0" * 99 + b",")
    wrong = [whole.replace(b": 10,", each) for each in many]
    wrong += [whole.replace(b'"abc"', b"7")]
    wrong += [whole.replace(b'"abc"', b'"\\ud800"')]
    wrong += [whole.replace(b'"../arm.yaml"', each) for each in (b"5", b'"a\\u0000b"')]
    wrong += [whole.replace(b'"keys": []', each) for each in (b'"keys": {}', b'"keys": "a"')]
    wrong += [re.sub(rb'"files": \[.*?\]', b'"files": "arm.yaml"', whole, flags=re.DOTALL)]
    assert whole not in wrong
    for damaged in (b"{", b"[]", b"[" * 10**5, b'{"format": 1}', b'{"format": 9}', *wrong):
        (tmp_path / "batch.json").write_bytes(damaged)
        with pytest.raises(UsageError):
            read_header(tmp_path)
