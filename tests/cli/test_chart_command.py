"""The chart command: its folder, its JSON, its exit codes; one case, or several side by side."""

import json
import sys
from pathlib import Path

import pytest
from charts import CANTILEVER, CASES

from eigassign.cli import main

Captured = pytest.CaptureFixture[str]


@pytest.fixture
def case(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "cases" / "cantilever.yaml"
    path.parent.mkdir()
    path.write_text(CANTILEVER)
    return path


@pytest.mark.parametrize("has_scikit_learn", [True, False])
def test_a_quick_chart_leaves_a_folder_and_says_what_to_write(
    has_scikit_learn: bool, case: Path, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    if not has_scikit_learn:
        monkeypatch.setitem(sys.modules, "sklearn", None)
    how = ["--quick", "--accuracy", "1e-3", "--figures", "none"]
    assert main(["chart", str(case), *how]) == 0
    told = capsys.readouterr()
    folder = Path("results/cantilever_chart")
    kept = json.loads((folder / "chart.json").read_text())
    names = {p.name for p in folder.iterdir()}
    assert names == {"chart.json", "report.html", "case.yaml", "run.json"}
    assert kept["asked"]["accuracy"] == 1e-3
    curves = {p["curve"] for p in kept["points"]}
    assert curves >= {"Taylor", "mesh"}
    assert ("Kriging" in curves) is has_scikit_learn
    need = ["Kriging needs scikit-learn: pip install 'eigassign[chart]'"]
    assert kept["notes"] == need * (not has_scikit_learn)
    assert told.out.startswith("The paper's method (series linearised in y, order 4) is ")
    assert "write `elements: 2` for every link" in told.out
    assert main(["chart", str(case), *how, "--json", "--quiet"]) == 0
    shown = capsys.readouterr()
    again = json.loads(shown.out)["points"]
    assert [p["method"] for p in again] == [p["method"] for p in kept["points"]]
    assert shown.err == ""


def test_a_folder_is_a_matrix_and_a_broken_case_does_not_stop_the_others(
    case: Path, capsys: Captured
) -> None:
    (case.parent / "broken.yaml").write_text("title: x")
    still = (CASES / "stress" / "straight_arm.yaml").read_text()
    (case.parent / "straight_arm.yaml").write_text(still)
    assert main(["chart", "cases", "--quick", "--json", "--quiet", "--out", "all"]) == 1
    kept = json.loads(Path("all/matrix.json").read_text())
    assert json.loads(capsys.readouterr().out)["cells"] == kept["cells"]
    assert sorted(kept["cases"]) == ["cantilever", "straight_arm"]
    ((name, why),) = kept["refused"]
    assert name == "broken"
    assert "mechanism: required key is missing" in why
    assert [f["kind"] for f in kept["findings"]["straight_arm"]] == ["straight or folded arm"]
    for cell in kept["cells"]:
        if cell["curve"] == "exact, eigassign":
            assert cell["cost_at_equal_accuracy"] == 1.0
    page = Path("all/report.html").read_text()
    assert "2 cases, methods fail by name in 1; 1 refused" in page
    above = page.partition("<details")[0]
    assert "Errors at equal cost" in above
    assert "Refused" in above


def test_cases_of_which_none_can_be_charted_are_refused(case: Path, capsys: Captured) -> None:
    case.write_text("title: x")
    (case.parent / "other.yaml").write_text("title: y")
    for given in (["cases"], [str(case)], [str(case), "cases/other.yaml"]):
        assert main(["chart", *given, "--quick", "--out", "out"]) == 2
        assert "mechanism: required key is missing" in capsys.readouterr().err
        assert not Path("out").exists()
    Path("empty").mkdir()
    assert main(["chart", "empty"]) == 2
    assert "no case files (*.yaml, *.yml) in empty" in capsys.readouterr().err


@pytest.mark.parametrize("value", ["0", "1e-20", "1", "nan"])
def test_an_accuracy_that_cannot_be_met_is_refused_by_name(
    value: str, case: Path, capsys: Captured
) -> None:
    assert main(["chart", str(case), "--accuracy", value, "--out", "out"]) == 2
    assert "'--accuracy'" in capsys.readouterr().err
    assert not Path("out").exists()


@pytest.mark.parametrize("given", ["cases/cantilever.yaml", "cases"])
def test_a_folder_of_something_else_is_not_replaced(
    given: str, case: Path, capsys: Captured
) -> None:
    Path("mine").mkdir()
    Path("mine/mine.txt").write_text("keep")
    assert main(["chart", given, "--quick", "--out", "mine"]) == 3
    assert "mine" in capsys.readouterr().err
    assert [p.name for p in Path("mine").iterdir()] == ["mine.txt"]
