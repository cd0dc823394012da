"""The chart command: its folder, its JSON, its exit codes."""

import json
from pathlib import Path

import pytest

from eigassign.cli import main

ARM = Path(__file__).parents[2] / "cases" / "two_link.yaml"


@pytest.mark.slow
def test_a_quick_chart_leaves_a_whole_folder_and_advises(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "chart"
    asked = ["--accuracy", "1e-6"]
    code = main(["chart", str(ARM), "--quick", "--json", "--quiet", "--out", str(out), *asked])
    shown = json.loads(capsys.readouterr().out)
    assert code == 0
    kept = json.loads((out / "chart.json").read_text())
    assert [p["method"] for p in shown["points"]] == [p["method"] for p in kept["points"]]
    assert [a["accuracy"] for a in kept["advice"]] == [1e-6]
    names = {p.name for p in out.iterdir()}
    assert names >= {"chart.json", "report.html", "figures", "case.yaml", "run.json"}
    assert len(list((out / "figures").glob("*.png"))) == 4
    assert kept["machine"]["cores"] >= 1


def test_a_case_without_a_trajectory_is_refused_and_leaves_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = ARM.read_text()
    start, end = text.index("trajectory:"), text.index("design:")
    case = tmp_path / "still.yaml"
    case.write_text(text[:start] + text[end:])
    assert main(["chart", str(case), "--quick", "--out", str(tmp_path / "out")]) == 2
    assert "trajectory" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("--accuracy", "0"), ("--accuracy", "1e-20"), ("--accuracy", "1"), ("--accuracy", "nan"),
    ],
)  # fmt: skip
def test_requests_that_cannot_be_met_are_refused_by_name(
    option: str, value: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["chart", str(ARM), option, value, "--out", str(tmp_path / "out")]) == 2
    assert f"'{option}'" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_folder_of_something_else_is_not_replaced(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "mine.txt").write_text("keep")
    assert main(["chart", str(ARM), "--quick", "--out", str(tmp_path)]) == 3
    assert str(tmp_path) in capsys.readouterr().err
    assert (tmp_path / "mine.txt").read_text() == "keep"


@pytest.mark.slow
def test_the_terminal_begins_with_the_advice_of_the_page(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "chart"
    case = Path(__file__).parents[2] / "benchmarks" / "small_arm.yaml"
    asked = ["--quick", "--quiet", "--figures", "none", "--accuracy", "0.02"]
    assert main(["chart", str(case), *asked, "--out", str(out)]) == 0
    shown = capsys.readouterr().out
    kept = json.loads((out / "chart.json").read_text())["advice"][0]
    assert shown.startswith(f"Write `{kept['key']}` under `expansion`: ")
    assert kept["key"].startswith("order: ")
    first = shown.splitlines()[0].replace("`", "")
    page = (out / "report.html").read_text().replace("<code>", "").replace("</code>", "")
    assert first in page.partition("<details>")[0]
    assert "What to write in the case" in shown
    assert "Designs" not in shown
