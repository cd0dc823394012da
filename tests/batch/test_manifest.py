"""A manifest keeps every whole line, whoever was killed while writing the next."""

from __future__ import annotations

from pathlib import Path

import pytest

from eigassign.batch import Header, InOrder, Manifest, read_header, write_header
from eigassign.errors import StorageError, UsageError
from eigassign.output import CaseOutcome, from_line


def row(index: int, status: str = "ok") -> CaseOutcome:
    named = {"index": index, "key": f"{index:04x}", "design": [], "frequencies": []}
    return CaseOutcome(f"case {index}", "arm.yaml", status, 0.1, **named)  # type: ignore[arg-type]


def test_rows_are_read_as_they_are_added_by_whomever(tmp_path: Path) -> None:
    one, other = Manifest(tmp_path), Manifest(tmp_path)
    assert list(one.news()) == []
    one.append(row(1))
    other.append(row(0))
    assert list(one.news()) == [row(1), row(0)]
    assert list(one.news()) == []
    one.append(row(2))
    assert list(one.news()) == [row(2)]
    assert list(other.news()) == [row(1), row(0), row(2)]


@pytest.mark.parametrize("torn", [b"x", b'{"index": 7, "na', b"y" * 10_000])
def test_a_torn_last_line_is_none_and_is_cut_off(tmp_path: Path, torn: bytes) -> None:
    manifest = Manifest(tmp_path)
    manifest.append(row(1))
    whole = manifest.path.read_bytes()
    manifest.path.write_bytes(whole + torn)
    assert list(manifest.news()) == [row(1)]
    manifest.append(row(2))
    assert list(manifest.news()) == [row(2)]
    assert manifest.path.read_bytes().startswith(whole + b'{"index": 2')
    manifest.path.write_bytes(torn)
    manifest.append(row(3))
    assert list(Manifest(tmp_path).news()) == [row(3)]


def test_rows_come_in_the_order_of_the_plan_and_the_last_of_a_case_counts(tmp_path: Path) -> None:
    manifest = Manifest(tmp_path)
    for each in (row(5), row(3, "error"), row(4), row(3), row(99)):
        manifest.append(each)
    with open(manifest.path, "ab") as file:
        file.write(b"nonsense\n[1]\n")
    lines = InOrder(tmp_path, range(1, 8, 2))
    assert list(map(from_line, lines)) == [row(3), row(5)]
    assert len(lines) == 2
    assert list(InOrder(tmp_path, range(10, 12))) == []
    assert list(InOrder(tmp_path / "none", range(3))) == []


@pytest.mark.parametrize(
    ("was", "becomes"),
    [
        (b'"ok"', b'["ok"]'),
        (b'"ok"', b'"fine"'),
        (b'"values": {}', b'"values": null'),
        (b'"seconds": 0.1', b'"seconds": "0.1"'),
        (b'"design": []', b'"design": 5'),
        (b'"design": []', b'"design": [["m", "1"]]'),
        (b'"frequencies": []', b'"frequencies": [["mode 1", 1.0]]'),
        (b'"case 1"', b"1"),
        (b'"run_folder": null', b'"run_folder": ["a"]'),
        (b'"index": 1,', b'"index": 1.0,'),
        (b'"arm.yaml"', b"\xff"),
    ],
)
def test_a_damaged_line_is_no_result_and_the_one_behind_it_counts(
    tmp_path: Path, was: bytes, becomes: bytes
) -> None:
    manifest = Manifest(tmp_path)
    manifest.append(row(1))
    whole = manifest.path.read_bytes()
    damaged = whole.replace(was, becomes)
    assert damaged != whole
    with pytest.raises(StorageError, match="delete it and run the batch again"):
        from_line(damaged)
    manifest.path.write_bytes(damaged)
    assert list(Manifest(tmp_path).news()) == []
    manifest.path.write_bytes(damaged + whole)
    assert list(Manifest(tmp_path).news()) == [row(1)]
    assert list(map(from_line, InOrder(tmp_path, range(3)))) == [row(1)]


def test_a_header_reads_back_and_a_damaged_one_is_refused(tmp_path: Path) -> None:
    assert read_header(tmp_path) is None
    header = Header("abc", 10, (2, 3), ("../arm.yaml",))
    write_header(tmp_path, header)
    assert read_header(tmp_path) == header
    assert list(header.indices()) == [1, 4, 7]
    whole = (tmp_path / "batch.json").read_bytes()
    wrong = [whole.replace(b": 10,", each) for each in (b": 1e9,", b': "10",')]
    wrong += [whole.replace(b"    3\n", each) for each in (b"    0\n", b'    "3"\n')]
    wrong += [whole.replace(b"    2,\n", b"    0,\n")]
    assert whole not in wrong
    for damaged in (b"{", b"[]", b'{"format": 1}', b'{"format": 9}', *wrong):
        (tmp_path / "batch.json").write_bytes(damaged)
        with pytest.raises(UsageError):
            read_header(tmp_path)
