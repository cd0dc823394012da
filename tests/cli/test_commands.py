"""Each command by its result: text and JSON on stdout, everything else on stderr."""

import json
import re
from contextlib import chdir, redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from commands import TWO_LINK, python
from wrong_inputs import GOOD

from eigassign import __version__
from eigassign.cli import main, print_json

# Belotti et al. 2021, recomputed with an independent frame program (same mesh)
REFERENCE = {
    "0 0": [202.219554, 513.156239, 736.419559],
    "0.125 0.125": [193.113002, 427.149912, 708.216892],
}

Captured = pytest.CaptureFixture[str]
LITTLE = ("--study", "none", "--report", "none", "--figures", "none")


class Ran(NamedTuple):
    """A finished run."""

    folder: Path
    out: str
    err: str


@pytest.fixture(autouse=True)
def _in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("EIGASSIGN_CACHE_DIR", str(tmp_path / "cache"))
    Path("good.yaml").write_text(GOOD)


@pytest.fixture(scope="module")
def ran(tmp_path_factory: pytest.TempPathFactory) -> Ran:
    """`optimize` of the small arm with all that it draws, in a folder of its own."""
    folder = tmp_path_factory.mktemp("ran")
    (folder / "good.yaml").write_text(GOOD)
    out, err = StringIO(), StringIO()
    with chdir(folder), redirect_stdout(out), redirect_stderr(err):
        assert main(["optimize", "good.yaml", "--no-cache"]) == 0
    return Ran(folder, out.getvalue(), err.getvalue())


def answer(capsys: Captured, *args: object, code: int = 0) -> str:
    """What the command prints on stdout."""
    assert main([str(arg) for arg in args]) == code
    return capsys.readouterr().out


@pytest.mark.parametrize("y", list(REFERENCE))
def test_modes_prints_the_reference_frequencies_as_json_and_nothing_else(
    y: str, capsys: Captured
) -> None:
    args = ("--q", "1.817, 5.312", "--y", y, "--count", 3, "--json")
    found = json.loads(answer(capsys, "modes", TWO_LINK, *args))
    beside = ["round_off", "discretisation_error", "weight", "levers"]
    assert list(found) == ["rigid_modes", "frequencies_hz", *beside]
    assert 1e-15 < found["round_off"] < 1e-9
    assert found["rigid_modes"] == 2
    assert 2e-4 < found["discretisation_error"][0] < 4e-4  # 3e-4, against the converged mesh
    assert found["frequencies_hz"] == pytest.approx(REFERENCE[y], rel=1e-6)


def test_modes_takes_units_negative_numbers_and_either_separator(capsys: Captured) -> None:
    ways = [
        ("1.817 -0.971185307179586", "0.125;0"),
        ("1.817,-971.185307179586 mrad", "125 g;.0e3 kg"),
        ("1817 mrad 5.312", "125 g 0 kg"),
        ("[1.817, 5.312]", " [125 g, 0] "),
    ]
    found = [
        json.loads(answer(capsys, "modes", TWO_LINK, "--q", q, "--y", y, "--json")) for q, y in ways
    ]
    for other in found[1:]:
        assert other["frequencies_hz"] == pytest.approx(found[0]["frequencies_hz"], rel=1e-12)


def test_modes_drawn_leave_a_folder_and_print_the_same(capsys: Captured) -> None:
    plain = json.loads(answer(capsys, "modes", TWO_LINK, "--count", 2, "--json"))
    assert main(["modes", str(TWO_LINK), "--count", "2", "--json", "--draw"]) == 0
    out, err = capsys.readouterr()
    assert err == "results/two_link_modes written\n"
    assert list(json.loads(out)) == list(plain)
    hz = json.loads(out)["frequencies_hz"]
    assert hz == pytest.approx(plain["frequencies_hz"], rel=1e-12)
    folder = Path("results/two_link_modes")
    figures = sorted(path.name for path in (folder / "figures").iterdir())
    assert figures == ["mode_1.png", "mode_2.png"]
    text = answer(capsys, "modes", TWO_LINK, "--count", 1, "--out", "shapes", "--figures", "none")
    assert text.endswith("shapes written\n")


@pytest.mark.parametrize(
    ("option", "value", "says"),
    [
        ("--q", "1.8", "--q: expected 2 values, q1, q2; got 1 in '1.8'"),
        (
            "--q",
            "1,817 5,312",
            "expected 2 values, q1, q2; got 4 in '1,817 5,312'; decimals take a point",
        ),
        ("--q", "90, 30", "--q: q1: 90 rad is more than two turns: write 90 deg, or 90 rad if"),
        ("--q", "1.8 -30", "--q: q2: -30 rad is more than two turns: write -30 deg, or"),
        ("--q", "1.8 m, 2", "--q: q1: expected an angle"),
        ("--q", "1.8, nan", "--q: q2: expected an angle"),
        ("--q", "nan 1.8", "--q: q1: expected an angle"),
        ("--y", "1", "--y: expected 2 values, m1, m2; got 1"),
        ("--y", "0 -1", "--y: m2: must be >= 0 kg"),
        ("--y", "0 1e999", "--y: m2: must be a finite number"),
        ("--y", "1 deg, 1", "--y: m1: expected a mass"),
        ("--y", "", "expected 2 values, m1, m2; got 0"),
    ],
)
def test_a_wrong_point_is_refused_by_its_name(
    option: str, value: str, says: str, capsys: Captured
) -> None:
    assert main(["modes", str(TWO_LINK), option, value]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert says in err


def test_a_design_outside_its_bounds_is_warned_of(capsys: Captured) -> None:
    args = ("modes", TWO_LINK, "--y", "0.3 0", "--count", 1, "--json")
    assert main([str(a) for a in args]) == 0
    out, err = capsys.readouterr()
    assert "warning: m1 = 300 g is outside its bounds, 0 g to 250 g" in err
    beyond = json.loads(out)["frequencies_hz"][0]
    inside = json.loads(answer(capsys, *args[:3], "0.25 0", *args[4:]))["frequencies_hz"][0]
    assert beyond < inside


def test_check_describes_a_case_and_warns_with_its_line(capsys: Captured) -> None:
    misprint = TWO_LINK.read_text(encoding="utf-8").replace("3.97e-8}", "3.97e-4}")
    Path("misprint.yaml").write_text(misprint, encoding="utf-8")
    assert main(["check", "misprint.yaml", "good.yaml"]) == 0
    out, err = capsys.readouterr()
    assert "misprint.yaml: Two-link pick-and-place manipulator" in out
    assert "good.yaml: A small arm" in out
    assert re.search(r"^misprint\.yaml:\d+:\d+: warning: mechanism\.sections\.rod", err)


def test_check_goes_on_after_a_wrong_case(capsys: Captured) -> None:
    Path("wrong.yaml").write_text("title: x")
    assert main(["check", "wrong.yaml", "good.yaml", "--json"]) == 2
    out, err = capsys.readouterr()
    answers = json.loads(out)
    assert list(answers) == ["wrong.yaml", "good.yaml"]
    assert answers["wrong.yaml"]["problems"][0]["line"] > 0
    assert "wrong.yaml:1:1: mechanism: required key is missing" in err


def test_optimize_leaves_a_run_folder_and_prints_what_it_found(ran: Ran) -> None:
    written = {path.name for path in (ran.folder / "results/good").iterdir()}
    assert {"results.json", "report.html", "figures", "case.yaml", "log.txt"} <= written
    assert "results/good/report.html written in" in ran.out
    assert len(ran.out.splitlines()) <= 25
    assert not [line for line in ran.err.splitlines() if "start" in line and "at most" not in line]


def test_optimize_as_json_prints_the_results_file_and_where_it_is_and_quiet_is_quiet(
    capsys: Captured,
) -> None:
    args = ["optimize", "good.yaml", "--out", "run", "--json", "--quiet", *LITTLE]
    assert main(args) == 0
    out, err = capsys.readouterr()
    printed, kept = json.loads(out), json.loads(Path("run/results.json").read_text())
    assert err == ""
    assert printed.pop("run_folder") == "run"
    assert printed == kept
    assert kept["eigassign_version"] == __version__


def test_optimize_ends_with_1_when_the_expansion_is_over_the_asked_tolerance(
    capsys: Captured,
) -> None:
    text = GOOD.replace("50 %", "1e-9") + "assignment: {method: one_shot}\n"
    Path("strict.yaml").write_text(text)
    assert main(["optimize", "strict.yaml", *LITTLE]) == 1
    assert "validation.max_error" in capsys.readouterr().out
    assert Path("results/strict/results.json").exists()


def test_a_target_out_of_reach_ends_with_1_and_says_what_can_be_reached(capsys: Captured) -> None:
    Path("far.yaml").write_text(GOOD.replace("180 Hz", "100 Hz"))
    assert main(["optimize", "far.yaml", *LITTLE]) == 1
    out, err = capsys.readouterr()
    assert re.match(r"Unreachable: mode 1 at 100 Hz .*between 1\d\d.\d and 1\d\d.\d Hz", out)
    assert "100 Hz" not in err
    assert main(["optimize", "far.yaml", "--json", *LITTLE]) == 1
    assert "eigassign: unreachable: mode 1 at 100 Hz" in capsys.readouterr().err


LIMITS_ONLY = (
    "targets:\n  - {mode: 1, at_most: 175 Hz}\n  - {modes: all, keep_out: [177 Hz, 179 Hz]}\n"
)


@pytest.mark.parametrize("command", ["optimize", "expand", "validate", "batch"])
def test_a_case_of_limits_alone_is_worked_on_by_every_command(
    command: str, capsys: Captured
) -> None:
    target = "targets:\n  - {mode: 1, frequency: 180 Hz}\n"
    assert target in GOOD
    Path("limits.yaml").write_text(GOOD.replace(target, LIMITS_ONLY))
    less = {"validate": [], "batch": ["--reports", "none", "--jobs", "1"]}
    assert main([command, "limits.yaml", *less.get(command, LITTLE[2:])]) == 0
    out, _ = capsys.readouterr()
    if command == "optimize":
        assert out.startswith("Reached: every target is met. Worst violation of a limit")
        assert "Limits and bands" in out


@pytest.mark.parametrize("command", [("optimize", *LITTLE), ("modes", "--figures", "none")])
def test_a_foreign_folder_is_left_alone_unless_forced(
    command: tuple[str, ...], capsys: Captured
) -> None:
    Path("mine").mkdir()
    Path("mine/thesis.txt").write_text("years of work")
    args = [command[0], "good.yaml", "--out", "mine", *command[1:]]
    assert main(args) == 3
    assert "mine is not a run folder of eigassign" in capsys.readouterr().err
    assert [path.name for path in Path("mine").iterdir()] == ["thesis.txt"]
    assert main([*args, "--force"]) == 0
    assert Path("mine.1/thesis.txt").read_text() == "years of work"


def test_no_cache_leaves_no_cache(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("EIGASSIGN_CACHE", "always")
    assert main(["optimize", "good.yaml", "--no-cache", *LITTLE]) == 0
    assert not Path("cache").exists()
    assert main(["optimize", "good.yaml", "--cache-dir", "elsewhere", *LITTLE]) == 0
    assert list(Path("elsewhere").iterdir())


def test_expand_writes_coefficients_of_the_order_asked_for_beside_a_run(capsys: Captured) -> None:
    out = answer(capsys, "expand", "good.yaml", "--order", "2", "--figures", "none")
    assert "results/good_expansion/report.html written in" in out
    assert Path("results/good_expansion/coefficients.json").exists()
    assert not Path("results/good").exists()


def test_validate_takes_all_of_cases_when_none_is_named(capsys: Captured) -> None:
    Path("cases").mkdir()
    Path("cases/a.yaml").write_text(GOOD)
    Path("cases/b.yml").write_text(GOOD)
    rows = json.loads(answer(capsys, "validate", "--json"))
    assert {row["case"] for row in rows} == {"a", "b"}
    assert all(row["passed"] for row in rows)


def test_validate_goes_on_after_what_is_wrong_and_ends_with_its_code(capsys: Captured) -> None:
    Path("wrong.yaml").write_text("title: x")
    Path("strict.yaml").write_text(GOOD.replace("50 %", "1e-9"))
    table = answer(capsys, "validate", "strict.yaml", "good.yaml", code=1)
    assert "strict" in table
    assert "good" in table
    rows = json.loads(answer(capsys, "validate", "wrong.yaml", "good.yaml", "--json", code=2))
    assert {row["case"] for row in rows if "error" not in row} == {"good"}
    (failed,) = (row for row in rows if "error" in row)
    assert (failed["case"], failed["error"], failed["exit_code"]) == ("wrong", "CaseError", 2)


FAILURES = [
    (["modes", "wrong.yaml"], 2, "CaseError"),
    (["optimize", "wrong.yaml"], 2, "CaseError"),
    (["modes", "good.yaml", "--q", "1 m"], 2, "UsageError"),
    (["modes", "good.yaml", "--count", "many"], 2, "UsageError"),
    (["expand"], 2, "UsageError"),
    (["chart", "good.yaml", "--out", "good.yaml/x"], 3, "StorageError"),
    (["update", "nowhere.yaml"], 2, "UsageError"),
]


@pytest.mark.parametrize(("args", "code", "kind"), FAILURES, ids=str)
def test_failures_have_one_form_of_json_on_stdout_and_are_told_on_stderr_too(
    args: list[str], code: int, kind: str, capsys: Captured
) -> None:
    Path("wrong.yaml").write_text("title: x")
    assert main([*args, "--json"]) == code
    out, err = capsys.readouterr()
    said = json.loads(out)
    assert list(said) == ["error", "exit_code", "message", "problems"]
    assert said["exit_code"] == code
    assert said["error"] == kind
    assert said["message"]
    for problem in said["problems"]:
        assert list(problem) == ["file", "line", "column", "path", "message"]
        assert problem["message"] in err
    assert main(args) == code
    out, again = capsys.readouterr()
    assert (out, again) == ("", err)


def test_schema_prints_a_json_schema(capsys: Captured) -> None:
    found = json.loads(answer(capsys, "schema"))
    assert found["$schema"].endswith("2020-12/schema")
    assert {"mechanism", "targets", "validation"} <= set(found["properties"])


def test_version_and_help_are_results(capsys: Captured) -> None:
    assert __version__ in answer(capsys, "--version")
    assert "Exit codes" in answer(capsys, "-h")
    assert "--no-cache" in answer(capsys, "optimize", "--help")


def test_json_is_ascii_and_has_null_for_what_is_not_finite(capsys: Captured) -> None:
    print_json({"ω": [np.array([1.5, np.inf]), float("nan"), Path("a/b"), np.float64(2.0)]})
    assert capsys.readouterr().out == '{"\\u03c9": [[1.5, null], null, "a/b", 2.0]}\n'


def test_figures_are_written_in_every_format_asked_for(capsys: Captured) -> None:
    """``modes --figures`` draws as ``--draw`` does; without either nothing is written."""
    answer(capsys, "modes", "good.yaml")
    assert not Path("results").exists()
    answer(capsys, "modes", "good.yaml", "--count", 1, "--figures", "svg, PDF")
    drawn = Path("results/good_modes/figures")
    assert sorted(p.name for p in drawn.iterdir()) == ["mode_1.pdf", "mode_1.svg"]
    answer(capsys, "modes", "good.yaml", "--count", 1, "--figures", "none")
    assert not drawn.exists()


@pytest.mark.parametrize(
    ("formats", "words"),
    [
        ("gif", "'gif' is not one of png, svg, pdf (or none)"),
        ("png,none", "none cannot be combined with other formats"),
        ("", "'' is not one of png, svg, pdf (or none)"),
        ("png,,svg", "'' is not one of png, svg, pdf (or none)"),
    ],
)
def test_wrong_formats_of_figures_are_named(capsys: Captured, formats: str, words: str) -> None:
    assert main(["optimize", "good.yaml", "--figures", formats]) == 2
    assert words in capsys.readouterr().err
    assert not Path("results").exists()


def test_a_run_without_figures_does_not_load_matplotlib() -> None:
    script = (
        "import sys; from eigassign.cli import main\n"
        "assert main(['optimize', 'good.yaml', '--study', 'none', '--figures', 'none']) == 0\n"
        "assert 'matplotlib' not in sys.modules\n"
    )
    done = python("-c", script)
    assert done.returncode == 0, done.stderr
    left = {path.name for path in Path("results/good").iterdir()}
    assert {"results.json", "report.html"} <= left
    assert "figures" not in left


def test_lengths_that_look_like_millimetres_are_named_beside_a_path_out_of_reach(
    capsys: Captured,
) -> None:
    text = Path(TWO_LINK).read_text().replace("length: 0.6,", "length: 600,")
    Path("mm.yaml").write_text(text)
    assert main(["check", "mm.yaml"]) == 2
    said = capsys.readouterr().err
    assert "trajectory.waypoints" in said
    assert "may be why the trajectory cannot be followed: length 600 is 600 m without a un" in said
    assert "did you mean 600 mm?" in said
