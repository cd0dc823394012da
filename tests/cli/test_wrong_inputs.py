"""Wrong case files end in a clear message at the right place and exit code 2, never otherwise."""

import re
from pathlib import Path

import pytest
from wrong_inputs import GOOD, Wrong, wrong_inputs

from eigassign.cli import main

TABLE = list(wrong_inputs())


@pytest.fixture(autouse=True)
def _in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def test_the_case_that_the_wrong_ones_are_made_from_is_right(
    capsys: pytest.CaptureFixture[str],
) -> None:
    Path("good.yaml").write_text(GOOD)
    assert main(["check", "good.yaml"]) == 0
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("wrong", TABLE, ids=[wrong.name for wrong in TABLE])
def test_a_wrong_input_is_named_at_its_line(
    wrong: Wrong, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("wrong.yaml").write_bytes(wrong.content)
    assert main([wrong.command, "wrong.yaml"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert wrong.says in err
    assert re.search(r"^wrong\.yaml:\d+:\d+: ", err, re.MULTILINE)
    assert re.search(r"^eigassign: \d+ problems? in wrong\.yaml$", err, re.MULTILINE)
    assert "Traceback" not in err
    assert not list(Path().glob("results/*"))


def test_every_problem_has_a_line_and_the_first_ones_a_caret(
    capsys: pytest.CaptureFixture[str],
) -> None:
    changes = [("0.5, material", "-1, material"), ("order: 3", "order: 0"), ("180 Hz", "0 Hz")]
    text = GOOD
    for old, new in changes:
        text = text.replace(old, new)
    Path("wrong.yaml").write_text(text)
    assert main(["check", "wrong.yaml"]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert [line.split(": ")[1] for line in lines if line.startswith("wrong.yaml:")] == [
        "mechanism.links.upper.length",
        "expansion.order",
        "targets[0].frequency",
    ]
    shown, caret = lines[1], lines[2]
    assert shown[caret.index("^") :].startswith("length: -1")
    assert lines[-1] == "eigassign: 3 problems in wrong.yaml"


@pytest.mark.parametrize(
    ("args", "says"),
    [
        (["check", "gone.yaml"], "gone.yaml: no such case file"),
        (["check", "."], "expected a case file: it is a folder"),
        (["optimize", "gone.yaml"], "gone.yaml: no such case file"),
        (["validate", "gone.yaml"], "gone.yaml: no such file or folder"),
        (["validate"], "there are no case files in ./cases: name the cases"),
        (["batch", "gone"], "gone: no such file or folder"),
        (["batch", "."], "no case files (*.yaml, *.yml) in ."),
        (["batch"], "Missing argument 'PATHS...'"),
        (["batch", ".", "--jobs", "0"], "0 is not in the range"),
        (["optimise", "good.yaml"], "No such command 'optimise'"),
        (["good.yaml"], "'good.yaml' is a case: say what to do, 'eigassign check good.yaml'"),
        (["optimize"], "Missing argument 'CASE'"),
        (["optimize", "good.yaml", "--ouut", "x"], "No such option"),
        (["modes", "good.yaml", "--count", "0"], "0 is not in the range"),
        (["expand", "good.yaml", "--order", "0"], "0 is not in the range"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_wrong_usage_is_told_and_ends_with_2(
    args: list[str], says: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(args) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert says in err
    assert "Traceback" not in err
