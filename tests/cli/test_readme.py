"""The README, held to what it describes."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import pytest
from commands import TWO_LINK

from eigassign.case import json_schema, parse
from eigassign.case.schema.joints import JOINTS
from eigassign.case.schema.links import LINKS, SHAPES
from eigassign.cli import cli

ROOT = TWO_LINK.parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", README, re.DOTALL | re.MULTILINE)


def test_the_case_shown_is_the_case_shipped() -> None:
    shown = next(block for block in blocks("yaml") if block.startswith("title:"))
    shipped = TWO_LINK.read_bytes()
    assert parse(shown.encode(), TWO_LINK) == parse(shipped, TWO_LINK)


def test_every_key_of_a_case_file_is_explained() -> None:
    definitions = json_schema()["$defs"].values()
    keys = {key for each in definitions for key in each.get("properties", {})}
    assert {key for key in keys if key not in README} == set()


def test_every_type_of_link_joint_and_section_is_explained() -> None:
    for names in (JOINTS, LINKS, SHAPES):
        for name in names:
            assert re.search(rf"`{name}`|: {name}`|^\| {name},", README, re.MULTILINE), name


def test_every_case_shipped_is_listed() -> None:
    for case in (ROOT / "cases").glob("*.yaml"):
        assert f"[{case.stem}](cases/{case.name})" in README


def test_every_command_and_shared_option_is_listed() -> None:
    for name, command in cli.commands.items():
        assert f"`eigassign {name}" in README
        long = {o for p in command.params for o in p.opts if o.startswith("--")}
        assert {o for o in long if o not in README} <= {"--verbose", "--linear", "--mode"}


def test_the_python_shown_runs(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "cases").mkdir()
    shutil.copy(TWO_LINK, tmp_path / "cases")
    monkeypatch.chdir(tmp_path)  # what it saves goes there
    names: dict[str, object] = {}
    for block in blocks("python"):
        exec(block, names)
    assert names["q"].shape == (152, 2)  # type: ignore[attr-defined]


def test_every_file_that_is_linked_is_there() -> None:
    links = re.findall(r"\]\((?!https?:)([^)#]+)\)", README)
    assert links
    assert all(Path(ROOT, link).exists() for link in links)


def test_every_benchmark_is_described_and_its_peers_can_be_installed() -> None:
    described = (ROOT / "benchmarks" / "README.md").read_text(encoding="utf-8")
    scripts = {p.name: p.read_text(encoding="utf-8") for p in ROOT.glob("benchmarks/*.py")}
    run = {name for name, text in scripts.items() if "__main__" in text}
    assert len(run) >= 10
    assert {name for name in run if f"`{name}`" not in described} == set()
    extra = (ROOT / "pyproject.toml").read_text(encoding="utf-8").split("bench = [")[1]
    peers = {"eastereig": "EasterEig", "openseespy": "openseespy", "exudyn": "exudyn"}
    peers |= {"smt": "smt", "sklearn": "scikit-learn"}
    used = {
        package
        for name, package in peers.items()
        if any(re.search(rf"(import|from) {name}\b", text) for text in scripts.values())
    }
    assert used == set(peers.values())
    assert {package for package in used if f'"{package}==' not in extra} == set()
