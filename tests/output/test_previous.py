"""What has moved since an earlier result: frequencies, and how a case ended."""

import io
import json
from dataclasses import replace
from pathlib import Path

import pytest
from synthetic_results import make_results

from eigassign.errors import UsageError
from eigassign.output import (
    CaseOutcome,
    EarlierResult,
    Known,
    frequency_ranges,
    print_tables,
    summary_json,
    to_json,
)
from eigassign.study import ValidationRow

ROW = CaseOutcome(
    "arm", "arm.yaml", "ok", 0.1, frequencies=(("mode 1", 180.0, 190.0, 200.0),), verdict="reached"
)

UPDATED = b'{"schema": 1, "case": {"name": "arm"}, "parameters": {}, "not_identified": []}'


def summary(path, *rows):
    path.write_text(summary_json(rows))
    return path


def compared(path, now, tolerance_hz=0.01, kind="answers"):
    found = EarlierResult(path, kind, tolerance_hz)
    found.add(now)
    return found


def with_hz(*hz):
    return replace(ROW, frequencies=(("mode 1", *hz),))


def test_the_value_that_moved_most_is_named_and_small_moves_are_not(tmp_path):
    before = summary(tmp_path / "summary.json", ROW)
    assert compared(before, Known.of_outcome(with_hz(180.0, 190.009, 200.0))).moves == []
    (move,) = compared(before, Known.of_outcome(with_hz(180.0, 189.9, 199.5))).moves
    assert str(move) == "mode 1, highest: was 200 Hz, is 199.5 Hz, moved by -0.5 Hz"
    assert compared(before, Known.of_outcome(with_hz(180.0, 189.9, 199.5)), 0.6).moves == []


def test_a_case_that_ends_otherwise_has_moved(tmp_path):
    before = summary(tmp_path / "summary.json", ROW)
    failed = replace(ROW, status="error", verdict="", frequencies=())
    (move,) = compared(before, Known.of_outcome(failed)).moves
    assert str(move) == "verdict: was reached, is error"


def test_new_cases_and_frequencies_are_counted_and_do_not_count_as_moved(tmp_path):
    before = summary(tmp_path / "summary.json", ROW)
    found = compared(before, Known("arm", (*ROW.frequencies, ("mode 2", 1.0, 1.0, 1.0))))
    found.add(Known.of_outcome(replace(ROW, name="leg")))
    assert found.table().rows == ()
    assert found.table().caption.endswith("compared: 1, new ones: 2; tolerance 0.01 Hz.")
    text = io.StringIO()
    print_tables([found.table()], stream=text)
    assert text.getvalue().startswith("Nothing moved since")


def test_cases_that_are_gone_are_named_and_do_not_count_as_moved(tmp_path):
    rows = [replace(ROW, name=name) for name in ("arm", *"abcdef")]
    found = compared(summary(tmp_path / "summary.json", *rows), Known.of_outcome(ROW))
    assert found.moves == []
    assert "Cases that are missing now: 6 (a, b, c, d, e, …)." in found.table().caption


def test_a_run_compares_with_its_own_results_and_a_folder_of_runs_with_each(tmp_path):
    results = make_results(n_targets=2)
    (tmp_path / "arm").mkdir()
    (tmp_path / "arm" / "results.json").write_bytes(to_json(results))
    now = Known(results.case.name, frequency_ranges(results))
    for place in (tmp_path, tmp_path / "arm", tmp_path / "arm" / "results.json"):
        found = compared(place, now, 0.0)
        assert found.moves == []
        assert "compared: 2, new ones: 0" in found.table().caption


def test_an_update_in_a_folder_of_runs_has_no_answer_to_compare(tmp_path):
    results = make_results()
    for name, data in (("arm", to_json(results)), ("arm_update", UPDATED)):
        (tmp_path / name).mkdir()
        (tmp_path / name / "results.json").write_bytes(data)
    found = compared(tmp_path, Known(results.case.name, frequency_ranges(results)))
    assert found.moves == []
    with pytest.raises(UsageError, match="has no frequencies"):
        EarlierResult(tmp_path / "arm_update", "answers", 0.01)


def validated(results, hz):
    common = {"case": results.case.name, "mode": 1, "order": 4, "points": hz.size, "limit": 0.02}
    errors = dict.fromkeys(
        ("worst_taylor", "worst_linearised", "rms_taylor", "rms_linearised"), 1e-4
    )
    exact = {"lowest_hz": hz.min(), "mean_hz": hz.mean(), "highest_hz": hz.max()}
    return ValidationRow(where="trajectory", passed=True, **common, **errors, **exact)


def test_a_validation_compares_with_the_initial_design_of_a_run_and_with_its_own_json(tmp_path):
    results = make_results()
    row = validated(results, results.targets[0].initial_hz)
    run, own = tmp_path / "results.json", tmp_path / "before.json"
    run.write_bytes(to_json(results))
    own.write_text(json.dumps([vars(row), {"case": "broken", "error": "CaseError"}]))
    for path in (run, own):
        same = compared(path, Known.of_validation(results.case.name, [row]), 1e-9, "validations")
        assert same.moves == []
        assert "compared: 1, new ones: 0" in same.table().caption
        off = [replace(row, highest_hz=row.highest_hz + 0.1)]
        assert len(
            compared(path, Known.of_validation(results.case.name, off), 0.05, "validations").moves
        )


@pytest.mark.parametrize("name", ["arm", "pick"])
def test_files_of_earlier_versions_are_read(tmp_path, name):
    """Written by version 0.3.0, schema 1: a wanted frequency and a limit; two trajectories."""
    folder = Path(__file__).parent / "earlier"
    lines = json.loads((folder / "summary.json").read_text())["cases"]
    (row,) = [CaseOutcome(**line) for line in lines if line["name"] == name]
    for file in ("summary.json", f"{name}.json"):
        found = compared(folder / file, Known.of_outcome(row), 1e-9)
        assert found.moves == []
        assert f"compared: {len(row.frequencies)}, new ones: 0" in found.table().caption
        off = replace(row, frequencies=[(n, *(hz + 0.1 for hz in h)) for n, *h in row.frequencies])
        assert len(compared(folder / file, Known.of_outcome(off), 0.05).moves) == len(lines)
    rows = json.loads((folder / "validation.json").read_text())
    rows = [ValidationRow(**line) for line in rows if line["case"] == name]
    now = Known.of_validation(name, rows)
    assert compared(folder / "validation.json", now, 1e-9, "validations").moves == []
    along = compared(folder / f"{name}.json", now, 1e-6, "validations")
    assert along.moves == []
    assert "compared: 0" not in along.table().caption


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("{", "is not results.json"),
        ('{"a": 1}', "is not results.json"),
        ("[]", "has no frequencies to compare with"),
        ('{"cases": []}', "has no frequencies to compare with"),
        ('{"cases": [{"name": 1}]}', "is not results.json"),
        ('{"case": {"name": ["arm"]}, "targets": [], "assignment": null}', "is not results.json"),
        (summary_json([ROW]).replace("190.0", "null"), "is not results.json"),
        (summary_json([ROW]).replace("190.0, ", ""), "is not results.json"),
    ],
)
def test_what_is_no_earlier_result_is_refused(tmp_path, text, said):
    (tmp_path / "x.json").write_text(text)
    with pytest.raises(UsageError, match=said):
        EarlierResult(tmp_path / "x.json", "answers", 0.01)


@pytest.mark.parametrize("case", ["5", "null", "[1]"])
def test_validations_of_cases_without_a_name_are_refused(tmp_path, case):
    row = f'{{"case": {case}, "mode": 1, "where": "x", "lowest_hz": 1, "mean_hz": 1, '
    (tmp_path / "x.json").write_text(f'[{row}"highest_hz": 1}}]')
    with pytest.raises(UsageError, match=r"is not results\.json"):
        EarlierResult(tmp_path / "x.json", "validations", 0.01)


def test_results_of_other_cases_are_refused(tmp_path):
    found = compared(summary(tmp_path / "s.json", ROW), Known("leg", ROW.frequencies))
    with pytest.raises(UsageError, match="its cases are arm"):
        found.table()


def test_a_folder_without_results_and_a_file_that_is_not_there_are_refused(tmp_path):
    with pytest.raises(UsageError, match="has no frequencies"):
        EarlierResult(tmp_path, "answers", 0.01)
    with pytest.raises(UsageError, match="No such file"):
        EarlierResult(tmp_path / "gone.json", "answers", 0.01)
