"""README and manual, held to what they describe."""

import ast
import importlib.util
import keyword
import re
import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from types import ModuleType

import pytest

import eigassign
from eigassign import errors
from eigassign.case import json_schema, parse
from eigassign.cli import cli, main

ROOT = Path(__file__).parents[2]
PACKAGE = ROOT / "eigassign"
TWO_LINK = ROOT / "cases" / "two_link.yaml"
README = ROOT / "README.md"
MANUAL = PACKAGE / "docs"
PAGES = [
    README,
    *sorted(MANUAL.rglob("*.md")),
    ROOT / "cases" / "README.md",
    ROOT / "cases" / "stress" / "README.md",
    ROOT / "benchmarks" / "README.md",
    *sorted((ROOT / "benchmarks" / "results").glob("*.md")),
]
MOST_WORDS = 1500


def builder(name: str) -> ModuleType:
    """A script of page_builder as a module."""
    spec = importlib.util.spec_from_file_location(name, ROOT / "page_builder" / f"{name}.py")
    sys.modules[name] = module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


reference = builder("reference")


def page_id(page: Path) -> str:
    return str(page.relative_to(ROOT))


def read(page: Path) -> str:
    return page.read_text(encoding="utf-8")


def blocks(page: Path, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", read(page), re.DOTALL | re.MULTILINE)


def prose(page: Path) -> str:
    """A page without its code blocks."""
    return re.sub(r"^```.*?^```", "", read(page), flags=re.DOTALL | re.MULTILINE)


def quoted(page: Path) -> list[str]:
    """What stands between backticks."""
    return re.findall(r"`([^`\n]+)`", prose(page))


def anchors_of(text: str) -> Iterator[str]:
    """Names that headings get on the common hosts: lower case, no punctuation, dashes."""
    for heading in re.findall(r"^#+ (.*)$", text, re.MULTILINE):
        yield re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")


def all_options() -> set[str]:
    groups = [cli, *cli.commands.values()]
    groups += [
        sub for each in cli.commands.values() for sub in getattr(each, "commands", {}).values()
    ]
    return {o for command in groups for p in command.params for o in p.opts if o[:2] == "--"} | {
        "--help"
    }


def test_the_readme_is_short() -> None:
    assert len(prose(README).split()) <= MOST_WORDS


def test_two_commands_do_all_set_up_and_the_ci_runs_the_same() -> None:
    main_job, tests = blocks(README, "bash")
    assert main_job.endswith("eigassign optimize cases/two_link.yaml\n")
    assert tests.endswith("python -m pytest -n 2\n")
    ci = (ROOT / ".ci" / "run").read_text(encoding="utf-8").splitlines()
    assert "python -m pytest -n 2" in ci


def test_the_case_shown_is_the_case_shipped() -> None:
    shown = next(block for block in blocks(README, "yaml") if block.startswith("title:"))
    assert parse(shown.encode(), TWO_LINK) == parse(TWO_LINK.read_bytes(), TWO_LINK)


def test_every_key_of_a_case_file_says_what_it_is_for() -> None:
    """In the list `Keys:` of its model's docstring, for editors and for the reference."""
    models = json_schema()["$defs"].values()
    silent = [
        f"{model['title']}.{key}"
        for model in models
        for key, node in model.get("properties", {}).items()
        if "const" not in node and node.get("description", "")[:1] in ("", "\n")
    ]
    assert silent == []
    listed = [k for m in models for k in re.findall(r"^    (\w+):", m["description"], re.MULTILINE)]
    assert listed == []


@pytest.mark.parametrize("name", reference.PAGES)
def test_the_reference_is_current(name: str) -> None:
    written = read(MANUAL / "reference" / name)
    assert reference.PAGES[name]() == written, "python page_builder/reference.py writes it anew"


def test_the_log_shown_is_the_log_written(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    case = re.sub(r"(elements|order): \d+", r"\1: auto", read(TWO_LINK))
    (tmp_path / "arm.yaml").write_text(case, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    assert main(["expand", "arm.yaml", "--no-cache", "--quiet"]) == 0
    log = (tmp_path / "results" / "arm_expansion" / "log.txt").read_text(encoding="utf-8")
    shown = next(block for block in blocks(MANUAL / "case-file.md", "text") if "order" in block)
    assert [line for line in shown.splitlines() if line not in log] == []


def test_every_command_is_in_the_readme() -> None:
    assert [name for name in cli.commands if f"`eigassign {name}" not in read(README)] == []


@pytest.mark.parametrize("page", PAGES, ids=page_id)
def test_every_command_and_option_named_exists(page: Path) -> None:
    code = [*quoted(page), *blocks(page, "bash")]
    named = {name for text in code for name in re.findall(r"\beigassign ([a-z]+)\b", text)}
    assert named - set(cli.commands) == set()
    ours = [text for text in code if re.match(r"(\.venv/bin/)?eigassign |--", text)]
    options = {o for text in ours for o in re.findall(r"--[a-z][a-z-]*", text)}
    assert options - all_options() == set()


@pytest.mark.parametrize("page", PAGES, ids=page_id)
def test_every_link_leads_somewhere(page: Path) -> None:
    links = re.findall(r"\]\((?!https?:)([^)#]*)(?:#([^)]*))?\)", prose(page))
    for path, anchor in links:
        target = page.parent / path if path else page
        assert target.exists(), path
        if anchor:
            assert anchor in set(anchors_of(prose(target))), f"{path}#{anchor}"


def names_code(name: str) -> bool:
    """Whether ``modal.taylor.recursion`` is a module, or ``pipeline.run.solve_case`` is in one."""
    place = PACKAGE.joinpath(*name.split("."))
    if place.is_dir() or place.with_suffix(".py").exists():
        return True
    module = place.parent.with_suffix(".py")
    module = module if module.exists() else place.parent / "__init__.py"
    return module.exists() and bool(
        re.search(rf"^(def |class )?{place.name}\b", read(module), re.MULTILINE)
    )


@cache
def case_keys() -> set[str]:
    listed = re.findall(r"^`([\w.]+)`", read(MANUAL / "reference" / "keys.md"), re.MULTILINE)
    return {
        *listed,
        *(f"mechanism.{key}" for key in json_schema()["$defs"]["Mechanism"]["properties"]),
    }


def wrong_places(text: list[str]) -> list[str]:
    """Dotted names that begin as a module or package of ours, and are neither code nor a key."""
    parts = {path.stem for path in PACKAGE.iterdir() if path.suffix in ("", ".py")}
    names = [name.removeprefix("eigassign.") for name in text]
    keys = case_keys()
    return [
        name
        for name in names
        if re.fullmatch(r"[a-z_]+(\.\w+)+", name)
        and name.split(".")[0] in parts
        and not name.endswith((".py", ".json", ".yaml", ".png", ".csv"))
        and not keys & {name, ".".join(name.split(".")[:2])}
        and not names_code(name)
    ]


@pytest.mark.parametrize("page", PAGES, ids=page_id)
def test_every_module_and_file_named_exists(page: Path) -> None:
    assert wrong_places(quoted(page)) == []
    for text in quoted(page):
        for path in re.findall(r"\b(?:eigassign|tests|benchmarks|cases)/[\w./-]*", text):
            assert (ROOT / path).exists(), path
        if re.fullmatch(r"[a-z_]+(/\w+)+\.py", text):
            assert (ROOT / text).exists() or (PACKAGE / text).exists(), text


def test_names_of_docstrings_and_of_the_pages_on_the_code_exist() -> None:
    """Single words in backticks are names in the code, or values there: whole strings."""
    known = {word for key in case_keys() for word in key.split(".")} | {*keyword.kwlist, "no"}
    known |= {"chromium", "mypy"}
    pages = (MANUAL / f"{name}.md" for name in ("architecture", "theory", "contributing"))
    said = {page.name: quoted(page) for page in pages}
    for path in PACKAGE.rglob("*.py"):
        known |= {*path.relative_to(PACKAGE).with_suffix("").parts}
        said[str(path)] = []
        for node in ast.walk(ast.parse(read(path))):
            names = [getattr(node, field, None) for field in ("name", "id", "arg", "attr", "value")]
            known |= {name for name in names if isinstance(name, str)}
            if isinstance(node, ast.FunctionDef | ast.ClassDef | ast.Module):
                text = ast.get_docstring(node) or ""
                said[str(path)] += re.findall(r"(?<!`)`([\w.]+)`(?!`)", text)
    wrong = {
        place: wrong_places(texts)
        + [one for one in texts if re.fullmatch(r"[A-Za-z_]\w+", one) and one not in known]
        for place, texts in said.items()
    }
    assert {place: names for place, names in wrong.items() if names} == {}


def test_every_section_of_the_theory_names_its_place_in_the_code() -> None:
    _, *sections = re.split(r"^## ", read(MANUAL / "theory.md"), flags=re.MULTILINE)
    about_it = ("Symbols", "Where this differs from the paper")
    for section in sections:
        named = re.findall(r"`([\w./]+)`", section)
        places = [name for name in named if names_code(name.removesuffix(".py").replace("/", "."))]
        assert places or section.startswith(about_it), section.partition("\n")[0]


def test_the_places_of_the_equations_name_these_equations() -> None:
    _, _, listed = read(MANUAL / "theory.md").partition("## Where each equation is\n")
    rows = re.findall(r"^\| (\(.*?)\|.*\|(.*)\|$", listed, re.MULTILINE)
    assert len(rows) == 5
    for equations, places in rows:
        for name in re.findall(r"`(\w+\.[\w.]+)`", places):
            source = PACKAGE.joinpath(*name.split(".")).with_suffix(".py")
            text = read(source) if source.exists() else read(source.with_suffix("") / "__init__.py")
            assert any(f"({n})" in text for n in re.findall(r"\d+", equations)), name


def test_the_architecture_page_names_every_package() -> None:
    packages = {path.parent.name for path in PACKAGE.glob("*/__init__.py")}
    assert packages - set(quoted(MANUAL / "architecture.md")) == set()


def test_every_public_name_and_error_is_explained() -> None:
    text = read(MANUAL / "python.md")
    names = {f"`ea.{name}" for name in eigassign.__all__ if name[0].islower()}
    names |= {f"`{name}`" for name in vars(errors) if name.endswith("Error")}
    assert {name for name in names if name not in text} <= {"`EigassignError`"}


def test_the_manual_s_index_lists_every_page_and_all_are_installed() -> None:
    index = re.findall(r"^- \[.*?\]\((.*?)\)", read(MANUAL / "index.md"), re.MULTILINE)
    pages = {str(page.relative_to(MANUAL)) for page in MANUAL.rglob("*.md")} - {"index.md"}
    assert sorted(index) == sorted(pages)
    assert '"docs/*.md", "docs/*/*.md"' in read(ROOT / "pyproject.toml")


def test_every_how_to_page_has_its_picture_and_all_are_small() -> None:
    pages = {page.stem: read(page) for page in (MANUAL / "how-to").glob("*.md")}
    assert set(builder("pictures").PICTURES) == set(pages)
    assert [name for name, text in pages.items() if f"]({name}.png)" not in text] == []
    assert sum(path.stat().st_size for path in MANUAL.rglob("*.png")) < 1e6


def test_every_case_shipped_is_listed() -> None:
    for folder in (ROOT / "cases", ROOT / "cases" / "stress"):
        text = read(folder / "README.md")
        assert {c.name for c in folder.glob("*.yaml") if f"]({c.name})" not in text} == set()


def test_every_phenomenon_has_its_test() -> None:
    explained, listed = (
        re.findall(r"^\| (?!phenomenon|---)([^|]+?) \|", read(page), re.MULTILINE)
        for page in (MANUAL / "when-methods-fail.md", ROOT / "cases" / "stress" / "README.md")
    )
    assert explained == listed
    for name in re.findall(r"`(test_\w+\.py)`", read(ROOT / "cases" / "stress" / "README.md")):
        assert (ROOT / "tests" / "stability" / name).exists(), name


def test_every_benchmark_is_described_and_its_peers_can_be_installed() -> None:
    described = read(ROOT / "benchmarks" / "README.md")
    scripts = {p.name: read(p) for p in ROOT.glob("benchmarks/*.py")}
    run = {name for name, text in scripts.items() if "__main__" in text}
    assert len(run) >= 10
    assert {name for name in run if f"`{name}`" not in described} == set()
    extra = read(ROOT / "pyproject.toml").split("bench = [")[1]
    peers = {"eastereig": "EasterEig", "openseespy": "openseespy", "exudyn": "exudyn"}
    used = {
        package
        for name, package in peers.items()
        if any(re.search(rf"(import|from) {name}\b", text) for text in scripts.values())
    }
    assert used == set(peers.values())
    assert {package for package in used if f'"{package}==' not in extra} == set()
