"""summary.csv and junit.xml say how each case of a batch ended."""

from __future__ import annotations

import csv
import io
import xml.etree.ElementTree as ET

from eigassign.output.batch.junit import junit_xml, write_junit
from eigassign.output.batch.outcome import CaseOutcome
from eigassign.output.batch.summary import COLUMNS, summary_csv, write_summary

GOOD = CaseOutcome(
    name="two_link",
    path="cases/two_link.yaml",
    status="ok",
    seconds=0.813,
    run_folder="results/two_link",
    initial_max_relative=0.083,
    predicted_max_relative=0.0148,
    exact_max_relative=0.1 + 0.2,
    design=(("m1", 0.2287), ("m2", 0.0)),
)
LOOSE = CaseOutcome("loose", "cases/loose.yaml", "tolerance", 0.5, "5 % exceeds 2 %")
STUCK = CaseOutcome("stuck", "cases/stuck.yaml", "failed", 0.1, "no design meets 'total_mass'")
WRONG = CaseOutcome(
    "wrong <b>", "cases/wrong.yaml", "error", 0.1, "a,b\n\x1b[31m\x00 & <tag> \ud800\ufffe"
)
ALL = (GOOD, LOOSE, STUCK, WRONG)


def test_the_summary_has_one_line_a_case_that_reads_back():
    rows = list(csv.DictReader(io.StringIO(summary_csv(ALL[:3]))))
    assert [row["status"] for row in rows] == ["ok", "tolerance", "failed"]
    assert tuple(rows[0]) == COLUMNS
    assert float(rows[0]["exact_max_relative"]) == 0.1 + 0.2
    assert rows[0]["design"] == "m1=0.2287; m2=0.0"
    assert rows[1]["exact_max_relative"] == ""


def test_a_summary_s_message_stays_on_its_line_and_is_no_formula():
    cases = (CaseOutcome("=1+1", "a.yaml", "error", 0.1, 'two\nlines, "quoted"'),)
    (row,) = csv.DictReader(io.StringIO(summary_csv(cases)))
    assert row["name"] == "'=1+1"
    assert row["message"] == 'two lines, "quoted"'


def test_junit_counts_and_names_what_happened():
    root = ET.fromstring(junit_xml(ALL))
    (suite,) = root
    assert (root.tag, suite.tag) == ("testsuites", "testsuite")
    assert [suite.get(k) for k in ("tests", "failures", "errors")] == ["4", "2", "1"]
    assert float(suite.get("time")) == 1.513
    kinds = [[child.tag for child in case if child.tag != "system-out"] for case in suite]
    assert kinds == [[], ["failure"], ["failure"], ["error"]]
    assert suite[1][0].get("message") == "5 % exceeds 2 %"
    assert suite[1][0].get("type") == "tolerance"
    assert suite[0].get("file") == "cases/two_link.yaml"


def test_junit_shows_characters_that_xml_cannot_hold():
    suite = ET.fromstring(junit_xml((WRONG,)))[0]
    assert suite[0].get("name") == "wrong <b>"
    assert suite[0][0].text == "a,b\n\\x1b[31m\\x00 & <tag> \\ud800\\ufffe"
    assert suite[0][0].get("message") == "a,b"


def test_an_empty_batch_is_still_valid():
    assert ET.fromstring(junit_xml(()))[0].get("tests") == "0"
    assert summary_csv(()) == ",".join(COLUMNS) + "\n"


def test_files_are_replaced_whole(tmp_path):
    for cases in (ALL[:3], ALL[:1]):
        write_summary(tmp_path / "summary.csv", cases)
        write_junit(tmp_path / "junit.xml", cases)
    assert (tmp_path / "summary.csv").read_text() == summary_csv(ALL[:1])
    assert (tmp_path / "junit.xml").read_bytes() == junit_xml(ALL[:1])
    assert len(list(tmp_path.iterdir())) == 2
