"""What a terminal shows: the answer first, once, in a few lines that fit, with the room it has."""

import json
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from commands import ARM, eigassign_process, environment

from eigassign.cli import main

Captured = pytest.CaptureFixture[str]
TARGETS = ARM.partition("targets:")[2]
BEYOND = " [{mode: 1, at_least: 30 Hz}]\nassignment: {starts: 1}\n"


@pytest.fixture(autouse=True)
def _in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("EIGASSIGN_CACHE_DIR", str(tmp_path / "cache"))


def optimized(targets: str, capsys: Captured, code: int, *more: str) -> tuple[str, str]:
    """stdout in one line, and stderr, of `optimize` with these targets."""
    Path("arm.yaml").write_text(ARM.replace(TARGETS, targets))
    assert main(["optimize", "arm.yaml", "--report", "light", "--figures", "none", *more]) == code
    out, err = capsys.readouterr()
    return " ".join(out.split()), err


def results() -> dict[str, dict[str, object]]:
    return json.loads(Path("results/arm/results.json").read_text())


@pytest.mark.parametrize("columns", [60, 80, 120])
@pytest.mark.parametrize("targets", [TARGETS, BEYOND])
def test_an_answer_has_few_lines_and_none_is_wider_than_the_terminal(
    targets: str, columns: int, capsys: Captured, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", str(columns))
    Path("arm.yaml").write_text(ARM.replace(TARGETS, targets))
    main(["optimize", "arm.yaml", "--report", "none", "--figures", "none"])
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) <= (45 if columns == 60 else 35)
    assert max(map(len, lines)) <= columns
    main(["optimize", "arm.yaml", "--report", "none", "--figures", "none", "-v"])
    assert "Sensitivity" in capsys.readouterr().out


def test_an_answer_without_room_says_so_names_the_mode_and_is_not_green(capsys: Captured) -> None:
    out, _ = optimized(" [{keep_out: [12 Hz, 13.2 Hz]}]\n", capsys, 0)
    row, (target,) = results()["assignment"], results()["targets"]
    assert row["verdict"] == "reached"
    assert 0.0 <= target["room"] < 1e-3
    assert re.search(r"Mode 1 clear of 12 … 13.2 Hz (by 0.0\d+ %|lies at its limit)", out)
    assert "any deviation loses it" in out
    page = Path("results/arm/report.html").read_text()
    assert '<p class="verdict fair"><strong>Reached' in page
    wide, _ = optimized(" [{keep_out: [60 Hz, 61 Hz]}]\n", capsys, 0)
    assert "any deviation" not in wide
    assert results()["targets"][0]["room"] > 1e-3
    assert '<p class="verdict good">' in Path("results/arm/report.html").read_text()


def test_limits_of_the_design_have_room_and_no_warning(capsys: Captured) -> None:
    heavy = " [{mode: 1, at_most: 14 Hz}]\nassignment: {objective: {highest: 1}}\n"
    out, _ = optimized(heavy.replace("14", "40"), capsys, 0)
    assert "any deviation" not in out
    text = ARM.replace("design:", "design:\n  mass: {max: 3.3 kg}")
    Path("arm.yaml").write_text(text.replace(TARGETS, heavy.replace("14", "40")))
    main(["optimize", "arm.yaml", "--report", "none", "--figures", "none"])
    assert "any deviation" not in capsys.readouterr().out
    (limit,) = results()["assignment"]["limits"]
    assert limit["room"] == pytest.approx(1.0 - limit["optimal"] / 3.3, abs=1e-9)


def test_what_contradicts_has_one_name_everywhere_and_is_said_once(capsys: Captured) -> None:
    both = "{mode: 1, at_least: 12.4 Hz}, {mode: 1, at_most: 12 Hz}"
    wanted = f" [{{mode: 2, at_least: 5 Hz}}, {both}]\n"
    out, err = optimized(wanted, capsys, 1)
    assert out.startswith("Infeasible: no design within the bounds")
    assert "mode 2 at least" not in out.partition("Design")[0]
    assert out.count("Infeasible") == 1
    assert "nfeasible" not in err
    assert "<strong>Infeasible</strong>" in Path("results/arm/report.html").read_text()
    assert main(["batch", "arm.yaml", "--reports", "none", "--jobs", "1", "--out", "many"]) == 1
    assert "  Infeasible  " in capsys.readouterr().out
    assert "Infeasible" in Path("many/index.html").read_text()
    (case,) = ET.parse("many/junit.xml").getroot()[0]
    assert case[0].get("type") == "infeasible"


def test_what_is_out_of_reach_is_told_of_its_worst_sample_with_what_contradicts(
    capsys: Captured,
) -> None:
    out, _ = optimized(" [{mode: 1, frequency: 14 Hz}, {mode: 1, at_most: 12 Hz}]\n", capsys, 1)
    assert "14 Hz was asked, which mode 1 at most 12 Hz contradicts" in out
    target = results()["targets"][0]["frequencies"]
    worst = min(range(11), key=lambda k: target["exact_hz"][k])
    assert f"out of reach at sample {worst} " in out


def test_progress_is_a_few_lines_with_time_that_go_to_stderr(capsys: Captured) -> None:
    Path("arm.yaml").write_text(ARM)
    args = ("optimize", "arm.yaml", "--report", "none", "--figures", "none")
    done = eigassign_process(*args, env=environment(COLUMNS="80"))
    lines = [line for line in done.stderr.splitlines() if "warning" not in line]
    assert len(lines) <= 20
    assert "assembling" not in done.stdout
    told = eigassign_process(*args, "--force", "-v", env=environment(COLUMNS="80")).stderr
    assert re.search(r"choice \d of \d, start \d+ of \d+ at most, \d+ s", told)
