"""summary.csv, summary.json and junit.xml say how each case of a batch ended."""

from __future__ import annotations

import csv
import io
import json
import xml.etree.ElementTree as ET
from collections.abc import Sequence

from eigassign.output import COLUMNS, CaseOutcome, Junit, SummaryCsv, SummaryJson, to_line

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
)
LOOSE = CaseOutcome("loose", "cases/loose.yaml", "tolerance", 0.5, "5 % exceeds 2 %")
STUCK = CaseOutcome("stuck", "cases/stuck.yaml", "failed", 0.1, "no design meets 'total_mass'")
WRONG = CaseOutcome(
    "wrong <b>", "cases/wrong.yaml", "error", 0.1, "a,b\n\x1b[31m\x00 & <tag> \ud800\ufffe"
)
ALL = (GOOD, LOOSE, STUCK, WRONG)


def summary_csv(rows: Sequence[CaseOutcome], keys: Sequence[str] = ()) -> str:
    text = io.StringIO()
    made = SummaryCsv(text, keys)
    for row in rows:
        made.add(row)
    return text.getvalue()


def junit_xml(rows: Sequence[CaseOutcome]) -> str:
    text = io.StringIO()
    made = Junit(text)
    for row in rows:
        made.add(row.name, row.path, row.seconds, row.status, row.message, row.run_folder or "")
    made.end()
    return text.getvalue()


def test_the_summary_has_one_line_a_case_that_reads_back():
    rows = list(csv.DictReader(io.StringIO(summary_csv(ALL[:3]))))
    assert [row["status"] for row in rows] == ["ok", "tolerance", "failed"]
    assert tuple(rows[0]) == COLUMNS
    assert float(rows[0]["exact_max_relative"]) == 0.1 + 0.2
    assert rows[0]["design"] == "m1=0.2287; m2=0.0"
    assert rows[1]["exact_max_relative"] == ""


def test_swept_keys_have_a_column_each():
    (row,) = csv.DictReader(io.StringIO(summary_csv((GOOD,), tuple(GOOD.values))))
    assert (row["title"], row["targets.0.frequency"], row["load"]) == ("'=A1", "190 Hz", "[1, 2]")
    assert list(row)[:2] == ["name", "title"]


def test_a_summary_s_message_stays_on_its_line_and_is_no_formula():
    cases = (CaseOutcome("=1+1", "a.yaml", "error", 0.1, 'two\nlines, "quoted"'), WRONG)
    row, other = csv.DictReader(io.StringIO(summary_csv(cases)))
    assert row["name"] == "'=1+1"
    assert row["message"] == 'two lines, "quoted"'
    assert other["message"] == "a,b \\x1b[31m\\x00 & <tag> \\ud800\\ufffe"
    assert len(summary_csv(cases).splitlines()) == 3


def test_the_summary_for_programs_has_the_rows_of_the_manifest_and_counts():
    text = io.StringIO()
    made = SummaryJson(text)
    for row in ALL:
        made.add(row.status, to_line(row))
    made.end()
    found = json.loads(text.getvalue())
    assert found["cases"] == [json.loads(to_line(row)) for row in ALL]
    assert found["counts"] == {"error": 1, "failed": 1, "ok": 1, "tolerance": 1}


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


def test_junit_has_a_line_a_case_and_shows_characters_that_xml_cannot_hold():
    suite = ET.fromstring(junit_xml((WRONG,)))[0]
    assert suite[0].get("name") == "wrong <b>"
    assert suite[0][0].text == "a,b\n\\x1b[31m\\x00 & <tag> \\ud800\\ufffe"
    assert suite[0][0].get("message") == "a,b"
    assert len(junit_xml(ALL).splitlines()) == 6


def test_an_empty_batch_is_still_valid():
    assert ET.fromstring(junit_xml(()))[0].get("tests") == "0"
    assert summary_csv(()) == ",".join(COLUMNS) + "\n"
