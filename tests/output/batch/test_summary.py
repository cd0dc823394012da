"""summary.csv, summary.json and junit.xml say how each case of a batch ended."""

import csv
import json
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from eigassign.output import CaseOutcome, to_plain, write_files

AHEAD = [
    "name", "status", "verdict", "seconds", "initial_max_relative", "predicted_max_relative",
    "exact_max_relative", "exact_rms_relative", "initial_violation", "exact_violation", "room",
    "mass", "price",
]  # fmt: skip
LAST = ["message", "path", "run_folder"]
GOOD = CaseOutcome(
    name="two_link",
    path="cases/two_link.yaml",
    status="ok",
    seconds=0.813,
    run_folder="two_link",
    initial_max_relative=0.083,
    predicted_max_relative=0.0148,
    exact_max_relative=0.1 + 0.2,
    design=(("m1", 0.2287), ("m2", 0.0)),
    values={"title": "=A1", "targets.0.frequency": "190 Hz", "load": [1, 2]},
    units={"m1": "kg", "targets.0.frequency": "Hz"},
)
LOOSE = CaseOutcome("loose", "cases/loose.yaml", "tolerance", 0.5, "5 % exceeds 2 %")
STUCK = CaseOutcome("stuck", "cases/stuck.yaml", "failed", 0.1, "no design meets 'total_mass'")
WRONG = CaseOutcome(
    "wrong <b>", "cases/wrong.yaml", "error", 0.1, "a,b\n\x1b[31m\x00 & <tag> \ud800\ufffe"
)
ALL = (GOOD, LOOSE, STUCK, WRONG)


def summary(folder: Path, rows: Sequence[CaseOutcome], keys: Sequence[str] = ()) -> list[dict]:
    """The rows of summary.csv; the other files are beside it."""
    write_files(folder, rows, keys)
    with open(folder / "summary.csv", encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture
def suite(tmp_path: Path) -> ET.Element:
    summary(tmp_path, ALL)
    return ET.parse(tmp_path / "junit.xml").getroot()[0]


def test_the_summary_has_one_line_a_case_that_reads_back(tmp_path):
    rows = summary(tmp_path, ALL[:3])
    assert [row["status"] for row in rows] == ["ok", "tolerance", "failed"]
    assert list(rows[0]) == [
        *AHEAD[:1], *("title", "targets.0.frequency [Hz]", "load"), *AHEAD[1:],
        *("design/m1 [kg]", "design/m2"), *LAST,
    ]  # fmt: skip
    assert float(rows[0]["exact_max_relative"]) == 0.1 + 0.2
    assert (rows[0]["design/m1 [kg]"], rows[0]["design/m2"]) == ("0.2287", "0.0")
    assert rows[1]["exact_max_relative"] == ""


def test_swept_keys_have_a_column_each(tmp_path):
    (row,) = summary(tmp_path, (GOOD,), tuple(GOOD.values))
    swept = (row["title"], row["targets.0.frequency [Hz]"], row["load"])
    assert swept == ("'=A1", "190.0", "[1, 2]")
    assert list(row)[:2] == ["name", "title"]


def test_a_key_that_has_words_beside_numbers_has_a_column_of_each(tmp_path):
    rows = [replace(GOOD, values={"order": value}) for value in (3, "auto")]
    found = summary(tmp_path, rows, ("order",))
    assert [(row["order"], row["order (text)"]) for row in found] == [("3.0", ""), ("", "auto")]


def test_a_summary_s_message_stays_on_its_line_and_is_no_formula(tmp_path):
    cases = (CaseOutcome("=1+1", "a.yaml", "error", 0.1, 'two\nlines, "quoted"'), WRONG)
    row, other = summary(tmp_path, cases)
    assert row["name"] == "'=1+1"
    assert row["message"] == 'two lines, "quoted"'
    assert other["message"] == "a,b \\x1b[31m\\x00 & <tag> \\ud800\\ufffe"
    assert len((tmp_path / "summary.csv").read_text().splitlines()) == 3


def test_the_summary_for_programs_has_the_rows_and_counts(tmp_path):
    summary(tmp_path, ALL)
    found = json.loads((tmp_path / "summary.json").read_text())
    assert found["cases"] == json.loads(json.dumps([to_plain(row) for row in ALL]))
    assert found["counts"] == {"error": 1, "failed": 1, "ok": 1, "tolerance": 1}


def test_junit_counts_and_names_what_happened(suite):
    assert suite.tag == "testsuite"
    assert [suite.get(k) for k in ("tests", "failures", "errors")] == ["4", "2", "1"]
    assert float(suite.get("time")) == 1.513
    kinds = [[child.tag for child in case if child.tag != "system-out"] for case in suite]
    assert kinds == [[], ["failure"], ["failure"], ["error"]]
    assert suite[1][0].get("message") == "5 % exceeds 2 %"
    assert suite[1][0].get("type") == "over tolerance"
    assert suite[0].get("file") == "cases/two_link.yaml"


def test_junit_has_a_line_a_case_and_shows_characters_that_xml_cannot_hold(tmp_path, suite):
    assert suite[3].get("name") == "wrong <b>"
    assert suite[3][0].text == "a,b\n\\x1b[31m\\x00 & <tag> \\ud800\\ufffe"
    assert suite[3][0].get("message") == "a,b"
    assert len((tmp_path / "junit.xml").read_text().splitlines()) == 6


def test_an_empty_batch_is_still_valid(tmp_path):
    assert summary(tmp_path, ()) == []
    assert ET.parse(tmp_path / "junit.xml").getroot()[0].get("tests") == "0"
    assert (tmp_path / "summary.csv").read_text() == ",".join([*AHEAD, *LAST]) + "\n"
