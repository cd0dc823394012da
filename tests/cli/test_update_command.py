"""The update command: its folder, its JSON, its exit codes, the case it leaves."""

import json
import shutil
from pathlib import Path

import pytest

from eigassign.cli import main

CASES = Path(__file__).parents[2] / "cases"


@pytest.fixture
def case(tmp_path: Path) -> Path:
    for name in ("arm_update.yaml", "arm_update.csv"):
        shutil.copy(CASES / name, tmp_path)
    return tmp_path / "arm_update.yaml"


def run(case: Path, *options: str) -> int:
    return main(["update", str(case), "--quiet", "--out", str(case.parent / "out"), *options])


def test_an_update_leaves_a_whole_folder_and_a_case_that_can_be_used(
    case: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(case) == 0
    shown = capsys.readouterr().out
    assert shown.startswith("Explained: the model fits the measurements (χ² = ")
    assert "kN m/rad" in shown.splitlines()[0]
    folder = case.parent / "out"
    names = {path.name for path in folder.iterdir()}
    assert names == {"case.yaml", "figures", "report.html", "results.json", "run.json",
                     "updated.yaml"}  # fmt: skip
    assert {p.name for p in (folder / "figures").iterdir()} == {
        "measurements.png",
        "parameters.png",
    }
    kept = json.loads((folder / "results.json").read_text())
    page = (folder / "report.html").read_text()
    assert kept["headline"].replace("χ", "&#967;")[:20] in page
    assert page.count('class="plot"') == 2
    assert (kept["verdict"], len(kept["measurements"])) == ("fitted", 12)

    left = folder / "updated.yaml"
    assert main(["update", str(left), "--quiet", "--allow-outside"]) == 2  # it is one already
    error = capsys.readouterr().err
    assert "uncertain: update finds what is not known: write it under design" in error
    # with a design and targets it is a robust problem, and its deviations are those of the fit
    text = left.read_text().replace("targets: []", "targets: [{mode: 1, at_least: 9 Hz}]")
    text = text.replace("robust: false", "robust: true").replace("starts: auto", "starts: 1")
    tube = "{parameter: sections.tube.outer_diameter, min: 0.056, max: 0.07}"
    left.write_text(text.replace("design: {}", f"design: {{tube: {tube}, mass: {{price: 1}}}}"))
    assert main(["optimize", str(left), "--quiet", "--json", "--figures", "none",
                 "--out", str(case.parent / "robust")]) == 0  # fmt: skip
    robust = json.loads(capsys.readouterr().out)["assignment"]["robust"]
    assert robust["wanted"] == 0.95 <= robust["probability"]
    assert list(json.loads((case.parent / "robust/results.json").read_text())["design"]) == ["tube"]


def test_measurements_that_are_not_explained_set_the_exit_code(
    case: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = case.with_suffix(".csv")
    table.write_text(table.read_text().replace("0,60,3,", "0,60,3,9"))
    assert run(case, "--json", "--figures", "none") == 1
    found = json.loads(capsys.readouterr().out)
    assert found["verdict"] == "poor_fit"
    assert found["fit"]["p_value"] < 0.01
    assert [row["label"] for row in found["measurements"] if row["outlier"]]
    assert "NOT EXPLAINED" in found["headline"]


def test_parameters_that_are_not_identified_set_the_exit_code_and_are_null(
    case: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = case.read_text().replace(
        "\nmeasurements:",
        "  hub: {parameter: bodies.hub.mass, min: 0, max: 5}\n\nmeasurements:",
    )
    text = text.replace("  bodies:", "  bodies:\n    hub: {at: upper_arm.start, mass: 2}")
    case.write_text(text.replace("rad, 1.85]", "rad, 1.85, 2]"))
    assert run(case, "--json") == 1
    found = json.loads(capsys.readouterr().out)
    assert found["verdict"] == "not_identified"
    words = "hub can change from bound to bound without effect"
    assert found["not_identified"][0]["words"] == words
    assert found["parameters"]["hub"]["high_is_bound"]
    report = (case.parent / "out" / "report.html").read_text()
    assert "the whole range of its bounds is possible" in report


def test_wrong_measurements_are_named_by_line_and_leave_nothing(
    case: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = case.with_suffix(".csv")
    table.write_text(table.read_text().replace("0,60,2,", "0,60,0,"))
    assert run(case) == 2
    error = capsys.readouterr().err
    assert "arm_update.yaml:39:" in error
    assert "arm_update.csv:8: column mode: 0 is not a mode" in error
    assert not (case.parent / "out").exists()
