"""Many cases on the command line: one folder each, a summary, and nothing lost to what fails."""

import csv
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from commands import ARM
from wrong_inputs import GOOD

from eigassign.batch import cases_in, folder_names
from eigassign.cli import main

STRICT = GOOD.replace("50 %", "1e-9") + "assignment: {method: one_shot}\n"
BOUND = "max: 1}\n  constraints: {heavy: {terms: {m: 1}, min: 3}}"
SWEEP = """
sweep: {parameters: {trajectory.duration: [0.6 s, 2 s], coordinates.q2.drive.stiffness: [6e3, 8e3]}}
"""
INFEASIBLE = GOOD.replace("max: 1}", BOUND)


@pytest.fixture(autouse=True)
def _in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("EIGASSIGN_CACHE_DIR", str(tmp_path / "cache"))


def write(path: str, text: str = GOOD) -> Path:
    """A case file at ``path``, and the folders above it."""
    file = Path(path)
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(text)
    return file


def summary(folder: str = "results") -> dict[str, dict[str, str]]:
    """The rows of summary.csv by name."""
    with open(Path(folder, "summary.csv"), newline="") as file:
        return {row["name"]: row for row in csv.DictReader(file)}


def test_a_batch_keeps_going_past_every_kind_of_failure(
    capsys: pytest.CaptureFixture[str],
) -> None:
    texts = {"good": GOOD, "strict": STRICT, "infeasible": INFEASIBLE, "wrong": "title: x"}
    for name, text in texts.items():
        write(f"cases/{name}.yaml", text)
    assert main(["batch", "cases", "--jobs", "1", "--reports", "none"]) == 1
    out, err = capsys.readouterr()
    rows = summary()
    assert {name: row["status"] for name, row in rows.items()} == {
        "good": "ok",
        "infeasible": "failed",
        "strict": "tolerance",
        "wrong": "error",
    }
    assert "heavy" in rows["infeasible"]["message"]
    assert "mechanism: required key is missing" in rows["wrong"]["message"]
    assert float(rows["good"]["design/m [kg]"]) > 0.0
    written = {path.name for path in Path("results").iterdir()}
    assert {"good", "strict", "infeasible", "summary.csv", "junit.xml"} < written
    assert "wrong" not in written
    assert "eigassign: 3 of 4 cases gave no answer to use" in err
    assert "assembling" not in err
    for word in ("Reached", "Do not use", "Infeasible", "Failed"):
        assert f"  {word}  " in out
    lines = out.splitlines()
    assert len(lines) == 3 + len(texts) + 2  # one a case
    assert max(map(len, lines)) <= 100
    assert lines[-1].startswith("results/index.html: 4 cases, 1 meets what is asked")
    suite = ET.parse("results/junit.xml").getroot()
    assert (suite.get("tests"), suite.get("failures"), suite.get("errors")) == ("4", "2", "1")


def test_a_sweep_of_speed_has_columns_of_torque() -> None:
    write("arm.yaml", ARM + SWEEP)
    main(["batch", "arm.yaml", "--jobs", "1", "--reports", "none", "--out", "out"])
    rows = [*summary("out").values()]
    torque = [float(row["drives/peak torque of q2 [N m]"]) for row in rows]
    assert torque[0] == pytest.approx(torque[2] * (2.0 / 0.6) ** 2, rel=0.05)  # of two designs
    assert "frequencies/mode 2 clear of 24 … 26 Hz/lowest_hz" in rows[0]
    page = Path("out/index.html").read_text()
    assert '["peak torque of q1","N m","number"]' in page


def test_a_batch_writes_figures_in_the_formats_asked_for() -> None:
    write("a.yaml")
    assert main(["batch", "a.yaml", "--jobs", "1", "--figures", "none"]) == 0
    assert Path("results/a/report.html").exists()
    assert not Path("results/a/figures").exists()


def test_a_dry_run_counts_what_would_run(
    capsys: pytest.CaptureFixture[str],
) -> None:
    write("a.yaml")
    sweep = ["batch", "a.yaml", "--jobs", "1", "--set", "targets.0.frequency=176 Hz..184 Hz:9"]
    assert main([*sweep, "--dry-run"]) == 0
    assert capsys.readouterr().out == "9 cases would run, 0 are done and still current\n"
    assert not Path("results").exists()
    one = ["--set", "targets.0.frequency=180 Hz", "--reports", "none", "--jobs", "1"]
    assert main(["batch", "a.yaml", *one]) == 0
    capsys.readouterr()
    assert main([*sweep, "--dry-run"]) == 0
    assert "8 cases would run, 1 are done and still current" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ("{targets.0.freqency: [1, 2]}", "did you mean 'targets.0.frequency'"),
        ("{targets.0.frequency: [100 Hz, 1 kg]}", "frequency=1kg: expected a frequency"),
    ],
)
def test_check_sees_a_wrong_sweep(
    values: str, said: str, capsys: pytest.CaptureFixture[str]
) -> None:
    write("a.yaml", f"{GOOD}sweep: {{parameters: {values}}}\n")
    assert main(["check", "a.yaml"]) == 2
    assert said in capsys.readouterr().err
    write("a.yaml", f"{GOOD}sweep: {{parameters: {{mechanism.bodies.tool.mass: [0.1, 0.2]}}}}\n")
    assert main(["check", "a.yaml"]) == 0
    assert re.search(
        r"sweep: 2 variants, all of them valid: eigassign batch a.yaml",
        " ".join(capsys.readouterr().out.split()),
    )


def test_stems_that_collide_get_folders_that_tell_them_apart() -> None:
    cases = [Path(p) for p in ("x/arm.yaml", "y/arm.yaml", "y/ARM.yml", "leg.yaml", "leg.yml")]
    names = folder_names(cases)
    assert names[:2] == ["x-arm", "y-arm"]
    assert names[3] == "leg"
    assert len({name.casefold() for name in names}) == len(cases)


def test_folder_names_do_not_hide_the_summaries_and_need_no_common_stem() -> None:
    assert folder_names([Path("summary.csv.yaml")]) == ["summary.csv-2"]
    assert folder_names([Path("a.yaml"), Path("sub/b.yaml")]) == ["a", "b"]
    assert folder_names([]) == []


def test_folders_are_searched_but_not_their_runs_and_nothing_comes_twice() -> None:
    kept = [write(f"cases/{name}") for name in ("a.yaml", "b.yml", "deep/c.yaml")]
    for name in ("results/a/case.yaml", ".hidden/d.yaml", ".e.yaml", "notes.txt"):
        write(f"cases/{name}")
    write("cases/results/a/run.json", "{}")
    found = cases_in([Path("cases"), Path("cases/a.yaml"), Path("cases/../cases")])
    assert found == kept
