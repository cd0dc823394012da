"""What a file says, or is called, neither moves a cursor nor finds its way into a message."""

from pathlib import Path

import pytest
from wrong_inputs import GOOD

from eigassign.cli import main

ESCAPE = "\x1b[2Jevil\x1b]0;title\x07\u202e"


def said(capsys: pytest.CaptureFixture[str]) -> str:
    out, err = capsys.readouterr()
    assert not any(not c.isprintable() and c != "\n" for c in out + err), repr(out + err)
    return out + err


@pytest.fixture(autouse=True)
def _in_a_folder_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


@pytest.mark.parametrize("content", [GOOD, GOOD.replace("steel", "stel", 1), "x: ["])
def test_a_case_file_with_escapes_in_its_name_is_named_without_them(
    content: str, capsys: pytest.CaptureFixture[str]
) -> None:
    path = Path(f"{ESCAPE}.yaml")
    path.write_text(content)
    main(["check", str(path)])
    assert r"\x1b[2Jevil" in said(capsys)
    main(["modes", str(path), "--debug"])
    said(capsys)


def test_no_escape_of_a_name_stands_on_the_page(capsys: pytest.CaptureFixture[str]) -> None:
    Path("a\x1bb\x07.yaml").write_text(GOOD)
    main(["optimize", "a\x1bb\x07.yaml", "--figures", "none"])
    (page,) = Path("results").glob("*/report.html")
    assert not {"\x1b", "\x07"}.intersection(page.read_text("utf-8"))


def test_a_working_folder_that_is_gone_is_called_that(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "good.yaml").write_text(GOOD)
    (tmp_path / "gone").mkdir()
    monkeypatch.chdir(tmp_path / "gone")
    (tmp_path / "gone").rmdir()
    assert main(["optimize", str(tmp_path / "good.yaml")]) == 3
    assert "the working folder, where relative paths begin, does not exist any" in said(capsys)


@pytest.mark.parametrize(
    ("name", "typed"),
    [
        ("a\nb.yaml", r"$'a\nb.yaml'"),
        ("it's \\ \x1b.yaml", r"$'it\'s \\ \x1b.yaml'"),
        ("it's fine.yaml", "'it'\"'\"'s fine.yaml'"),
        ("-dash.yaml", "./-dash.yaml"),
    ],
)
def test_the_next_command_can_be_typed_and_a_name_stays_on_its_line(
    name: str, typed: str, capsys: pytest.CaptureFixture[str]
) -> None:
    Path(name).write_text(GOOD)
    assert main(["check", f"./{name}"]) == 0
    assert said(capsys).splitlines()[-1].split(maxsplit=2)[1:] == ["eigassign", f"optimize {typed}"]
    Path(name).write_text(GOOD.replace("steel", "stel", 1))
    for command in ("check", "modes"):
        assert main([command, f"./{name}"]) == 2
        assert "\nb.yaml" not in said(capsys)
    main(["init", "--out", f"new{name}"])
    assert "\nb.yaml" not in said(capsys)


def test_columns_with_escapes_are_named_without_them(capsys: pytest.CaptureFixture[str]) -> None:
    start, end = GOOD.index("trajectory:"), GOOD.index("design:")
    name = ESCAPE.replace("[", "").replace("]", "")
    Path("a.csv").write_text(f"time,q1,q2,{name}\n0,0.1,1,5\n1,0.2,1.1,5\n")
    Path("a.yaml").write_text(f"{GOOD[:start]}trajectory: {{file: a.csv}}\n{GOOD[end:]}")
    main(["check", "a.yaml"])
    assert r"ignored the columns \x1b2Jevil" in said(capsys)


def test_texts_with_escapes_of_a_case_file_stay_there(capsys: pytest.CaptureFixture[str]) -> None:
    start, end = GOOD.index("trajectory:"), GOOD.index("design:")
    file = GOOD[:start] + 'trajectory: {file: "a\\e[2Jb.csv"}\n' + GOOD[end:]
    title = GOOD.replace("title: A small arm", r'title: "a\e[2Jb"')
    for text in (file, title, GOOD.replace("steel", r'"s\e[2Jb"')):
        Path("a.yaml").write_text(text)
        assert main(["check", "a.yaml"]) == 2
        assert "a.yaml:" in said(capsys)


SECRETS = {
    "passwords": "root:hunter2:0:0:root:/root:/bin/bash\ndaemon:hunter2:1:1:daemon:/:/bin/sh\n",
    "environment": "PASSWORD=hunter2\nHOST=example\n",
    "key": "-----BEGIN hunter2 KEY-----\nhunter2,hunter2\n",
    "people": "user,password\nann,hunter2\nbob,hunter2\n",
    "one line": "hunter2,hunter2\n",
    "bracket": "hunter2 [[\nx\n",
}


@pytest.mark.parametrize("secret", SECRETS.values(), ids=SECRETS)
def test_a_file_that_is_no_table_of_numbers_is_not_quoted(
    secret: str, capsys: pytest.CaptureFixture[str]
) -> None:
    start, end = GOOD.index("trajectory:"), GOOD.index("design:")
    Path("secret").write_text(secret)
    with_path = f"{GOOD[:start]}trajectory: {{file: secret}}\n{GOOD[end:]}"
    for text in (with_path, GOOD + "measurements: {file: secret}\n"):
        Path("a.yaml").write_text(text)
        assert main(["check", "a.yaml"]) == 2
        told = said(capsys)
        assert "secret:1: expected a header with" in told
        assert "hunter2" not in told


@pytest.mark.parametrize("stem", ["x" * 250, "a\nb", "aux", "point."])
def test_the_folder_of_a_run_has_a_name_that_every_file_system_allows(stem: str) -> None:
    Path(f"{stem}.yaml").write_text(GOOD)
    assert main(["check", f"{stem}.yaml", "--draw", "--figures", "none"]) == 0
    (folder,) = Path("results").iterdir()
    assert folder.name.isprintable()
    assert len(folder.name) <= 111
    assert ("~" in folder.name) == (stem in ("x" * 250, "a\nb"))
