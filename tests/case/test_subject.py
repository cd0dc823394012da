"""What a chart is about stays the same however a case is written, and changes with what counts."""

from __future__ import annotations

from pathlib import Path

import pytest
from small_case import TEXT, edited

from eigassign.case import CaseFile, load, parse

MOTION = """\
  tip: hand.end
  waypoints: [[0.3, 0.1], [0.2, 0.2]]
  branch: {elbow: [10 deg, 170 deg]}
"""
ROWS = "time,q1,q2\n0,0,1\n1,0.5,1.5\n"


def subject(text: str) -> str:
    return parse(text.encode(), "case.yaml").subject_sha256


def of_file(folder: Path, rows: str = ROWS) -> CaseFile:
    folder.mkdir()
    (folder / "path.csv").write_text(rows)
    (folder / "case.yaml").write_text(edited(MOTION, "  file: path.csv\n"))
    return load(folder / "case.yaml")


def test_the_resolved_case_is_about_the_same(tmp_path: Path) -> None:
    file = parse(TEXT.encode(), "case.yaml")
    assert subject(file.resolved()) == file.subject_sha256


def test_what_is_asked_of_it_does_not_count() -> None:
    for old, new in (("frequency: 190 Hz", "frequency: 180 Hz"), ("title: ", "title: Another ")):
        assert old in TEXT
        assert subject(TEXT.replace(old, new)) == subject(TEXT)


@pytest.mark.parametrize(
    ("old", "new"), [("[0.3, 0.1]", "[0.3, 0.11]"), ("[10 deg, 170 deg]", "[11 deg, 170 deg]")]
)
def test_what_moves_counts(old: str, new: str) -> None:
    assert old in TEXT
    assert subject(TEXT.replace(old, new)) != subject(TEXT)


def test_a_bound_counts() -> None:
    assert subject(edited("max: 250 g", "max: 260 g")) != subject(TEXT)


def test_files_count_by_their_content_not_by_their_place(tmp_path: Path) -> None:
    here, there = of_file(tmp_path / "here"), of_file(tmp_path / "there")
    other = of_file(tmp_path / "other", ROWS.replace("1.5", "1.6"))
    assert here.subject_sha256 == there.subject_sha256
    assert here.subject_sha256 != other.subject_sha256


def test_the_line_for_the_case_file_says_what_was_said_and_what_is_new() -> None:
    file = parse(TEXT.encode(), "case.yaml")
    line = file.expansion_line(order="auto", accuracy=1e-6, chart="my charts/chart.json")
    assert line.startswith(
        'expansion: {order: auto, accuracy: 1e-06, chart: "my charts/chart.json"'
    )
