"""The first minute: starters that run as they are, the manual, tabs, and the examples."""

import json
import re
import shlex
import shutil
from pathlib import Path

import click
import pytest
from commands import TWO_LINK

import eigassign as ea
from eigassign.cli import cli, main

CASES = TWO_LINK.parent
STARTERS = Path(ea.__file__).parent / "starters"
TEMPLATES = cli.commands["init"].params[0].type.choices  # type: ignore[attr-defined]
Captured = pytest.CaptureFixture[str]


@pytest.fixture(autouse=True)
def _in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("EIGASSIGN_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setenv("HOME", str(tmp_path))


def test_every_starter_is_listed_once_and_has_its_file() -> None:
    assert sorted(path.stem for path in STARTERS.glob("*.yaml")) == sorted(TEMPLATES)


@pytest.mark.parametrize("name", TEMPLATES)
def test_a_starter_is_written_with_its_name_and_is_in_order(name: str, capsys: Captured) -> None:
    assert main(["init", name, "--out", "new/mine.yaml"]) == 0
    out = capsys.readouterr().out
    assert "new/mine.yaml written\n" in out
    assert "next: eigassign check new/mine.yaml --draw\n" in out
    text = Path("new/mine.yaml").read_text(encoding="utf-8")
    assert "eigassign optimize new/mine.yaml" in text
    assert f"{name}.yaml" not in text
    assert text.count("#") > 12
    assert main(["check", "new/mine.yaml"]) == 0
    assert "warning" not in capsys.readouterr().err
    if name == "imported_part":
        assert Path("new/imported_part/mass.mtx").exists()


@pytest.mark.parametrize(
    "name",
    [n if n == "planar_arm" else pytest.param(n, marks=pytest.mark.slow) for n in TEMPLATES],
)
def test_a_starter_runs_as_it_is_and_reaches_its_targets(name: str, capsys: Captured) -> None:
    assert main(["init", name]) == 0
    capsys.readouterr()
    args = ["--study", "none", "--figures", "none", "--json"]
    assert main(["optimize", f"{name}.yaml", *args]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["assignment"]["verdict"] == "reached"


def test_init_overwrites_nothing(capsys: Captured) -> None:
    Path("imported_part").mkdir()
    mine = Path("imported_part/mass.mtx")
    mine.write_text("mine")
    assert main(["init", "imported_part"]) == 3
    assert "imported_part/mass.mtx exists and is left alone" in capsys.readouterr().err
    assert mine.read_text() == "mine"
    assert not Path("imported_part.yaml").exists()
    Path("planar_arm.yaml").symlink_to("nowhere")
    assert main(["init"]) == 3
    assert not Path("nowhere").exists()
    Path("sub").mkdir()
    assert main(["init", "gantry", "--out", "sub"]) == 0
    assert "eigassign check sub/gantry.yaml" in Path("sub/gantry.yaml").read_text()


def test_out_is_a_folder_or_the_name_of_the_case_file(capsys: Captured) -> None:
    assert main(["init", "gantry", "--out", "machines/new.2"]) == 0  # made where it is missing
    assert "machines/new.2/gantry.yaml written" in capsys.readouterr().out
    assert main(["init", "gantry", "--out", "machines/mine.yml"]) == 0
    assert sorted(path.name for path in Path("machines").iterdir()) == ["mine.yml", "new.2"]


def test_the_first_help_page_shows_six_commands_and_the_rest_below(capsys: Captured) -> None:
    _, _, commands = helped("eigassign", capsys).partition("\nCommands:\n")
    first, _, more = commands.partition("\nMore:\n")
    more, _, _ = more.partition("Examples:")
    listed = [re.findall(r"^  (\w+)  +\w.*[.]$", part, re.MULTILINE) for part in (first, more)]
    assert listed[0] == ["init", "check", "optimize", "update", "batch", "docs"]
    assert [*listed[0], *listed[1]] == list(cli.commands)  # each in one line


def test_the_manual_lists_its_pages_and_shows_one(capsys: Captured) -> None:
    assert main(["docs"]) == 0
    listed = capsys.readouterr().out.splitlines()
    assert listed[0].split(maxsplit=1) == ["tutorial", "Tutorial"]
    names = [line.split()[0] for line in listed]
    assert {"case-file", "own-arm", "keys", "theory"} <= set(names)
    for name in [*names, "how-to/own-arm.md", "case-file.md#targets"]:
        assert main(["docs", name]) == 0
        assert capsys.readouterr().out.startswith("# ")
    assert main(["docs", "case_file"]) == 2
    assert "did you mean 'case-file'?" in capsys.readouterr().err


# --- Help

COMMANDS = {
    " ".join(["eigassign", *path]): command
    for name, each in cli.commands.items()
    for path, command in [
        ((name,), each),
        *(((name, sub), c) for sub, c in getattr(each, "commands", {}).items()),
    ]
}


def helped(name: str, capsys: Captured) -> str:
    assert main([*name.split()[1:], "--help"]) == 0
    return capsys.readouterr().out


@pytest.mark.parametrize("name", COMMANDS)
def test_every_option_with_a_value_states_its_default(name: str, capsys: Captured) -> None:
    for option in COMMANDS[name].params:
        if isinstance(option, click.Option) and not (option.is_flag or option.count):
            stated = re.search(r"[(\[]default: ", option.help or "") or option.show_default
            assert stated, option.name


def examples(name: str, capsys: Captured) -> list[str]:
    _, _, listed = helped(name, capsys).partition("Examples:\n")
    return re.findall(r"^ +(eigassign .*)$", listed, re.MULTILINE)


@pytest.mark.parametrize("name", ["eigassign", *COMMANDS])
def test_the_help_of_every_command_has_examples_of_it(name: str, capsys: Captured) -> None:
    found = examples(name, capsys)
    assert found
    assert all(f"{line} ".startswith(f"{name} ") for line in found)


LONG = (
    "chart",
    "batch",
    "optimize",
    "expand",
    "compare",
    "update",
    "validate",
)  # each over 3 s
SLOW = {f"eigassign {name}": pytest.mark.slow for name in LONG} | {"eigassign": pytest.mark.slow}


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=SLOW.get(name, ())) for name in ["eigassign", *COMMANDS]]
)
def test_the_examples_of_the_help_run(name: str, capsys: Captured) -> None:
    lines = examples(name, capsys)
    if "init" not in lines[0]:
        for template in ("planar_arm", "four_bar"):
            assert main(["init", template]) == 0
            if name == "eigassign compare":
                assert main(["optimize", f"{template}.yaml", "--report", "none"]) == 0
        Path("cases/stress").mkdir(parents=True)
        shutil.copy(TWO_LINK, "cases")
        shutil.copy(CASES / "stress" / "straight_arm.yaml", "cases/stress")
        for path in CASES.glob("arm_update.*"):
            shutil.copy(path, ".")
    for line in lines:
        command, _, kept = line.partition(" > ")
        words = shlex.split(command)[1:]
        expanded = [
            name
            for word in words
            for name in (sorted(map(str, Path().glob(word))) if "*" in word else [word])
        ]
        capsys.readouterr()
        assert main(expanded) == 0, line
        if kept:
            Path(kept).write_text(capsys.readouterr().out)
