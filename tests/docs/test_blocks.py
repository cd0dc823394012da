"""Every block of the manual is what it says: commands run, cases are valid, Python runs.

Page by page, from top to bottom, in a folder with `cases/`:

    bash    line by line; `# exit code 1` behind a command is the code that it must have. A script
            with `#SBATCH --array=1-2` is run once for each number
    yaml    with a title a whole case, otherwise top-level keys in the place of those of a case; a
            comment in its first line names the file, else it is a part of the paper's arm
    python  one after the other
    csv     a file, which a comment in its first line names
    text    below commands: lines that they print, `…` for what is left out; else no output

A comment `<!-- not run: reason -->` above a block leaves it out. By default only quick commands and
Python run, without drawings, and what they print is compared; all of it with `-m slow`.
"""

import re
import shlex
import shutil
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import pytest

from eigassign.case import load
from eigassign.cli import main

ROOT = Path(__file__).parents[2]
MANUAL = ROOT / "eigassign" / "docs"
GENERATED = MANUAL / "reference"  # examples of the help: tests/cli/test_start.py runs them
PAGES = [
    ROOT / "README.md",
    *(page for page in sorted(MANUAL.rglob("*.md")) if page.parent != GENERATED),
    *sorted((ROOT / "cases").rglob("README.md")),
    *sorted((ROOT / "benchmarks").rglob("*.md")),
]
QUICK = ("init", "check", "modes", "expand", "schema", "docs")
BLOCK = re.compile(r"(?:^<!-- not run: (.+) -->\n)?^```(\w*)\n(.*?)^```", re.DOTALL | re.MULTILINE)
Captured = pytest.CaptureFixture[str]


def blocks(page: Path) -> Iterator[tuple[str, str]]:
    """Language and text of what is not left out."""
    for reason, language, text in BLOCK.findall(page.read_text(encoding="utf-8")):
        if not reason:
            yield language, text


@dataclass
class Reader:
    """Does what a page says."""

    capsys: Captured
    all_of_it: bool
    names: dict[str, object] = field(default_factory=dict)
    printed: str | None = None  # by the commands above; None where some were left out, or none

    def follow(self, page: Path) -> None:
        for language, text in blocks(page):
            if language == "text":
                self.compare(text)
                continue
            self.printed = None
            if language == "bash":
                self.run(text)
            elif language == "yaml":
                self.write_case(text)
            elif language == "csv":
                name, _, rest = text.partition("\n")
                Path(name.removeprefix("# ")).write_text(rest, encoding="utf-8")
            else:
                assert language == "python", f"{page}: a block of {language or 'nothing'}"
                exec(text, self.names)

    def run(self, text: str) -> None:
        array = re.search(r"^#SBATCH --array=1-(\d+)$", text, re.MULTILINE)
        printed = []
        for task in range(1, int(array[1] if array else 1) + 1):
            for line in text.replace("$SLURM_ARRAY_TASK_ID", str(task)).splitlines():
                if line and not line.startswith("#"):
                    printed.append(self.command(line))
                    if printed[-1] is None:
                        return
        self.printed = "".join(filter(None, printed))

    def command(self, line: str) -> str | None:
        """What it prints; None if it is left to the slow tests."""
        command, _, code = line.partition("  # exit code ")
        command, _, into = command.partition(" > ")
        program, *words = (name for word in shlex.split(command) for name in expanded(word))
        assert program == "eigassign", line
        if not self.all_of_it:
            words = [word for word in words if word != "--draw"]
            if words[0] not in QUICK:
                return None
        assert main(words) == int(code or 0), line
        said = self.capsys.readouterr().out
        if into:
            Path(into).write_text(said, encoding="utf-8")
        return "" if into else said

    def compare(self, text: str) -> None:
        if self.printed is not None:
            lines = [" ".join(line.split()) for line in self.printed.splitlines()]
            for line in text.splitlines():
                shown = ".*".join(map(re.escape, " ".join(line.split()).split("…")))
                assert any(re.fullmatch(shown, each) for each in ["", *lines]), line

    def write_case(self, text: str) -> None:
        named = re.match(r"# (?:in )?(\S+\.yaml)\n", text)
        path = Path(named[1] if named else "part.yaml")
        keys = parts(text)
        if "title" not in keys:
            whole = path if named else Path("cases", "two_link.yaml")
            keys = {**parts(whole.read_text(encoding="utf-8")), **keys}
            if "design" in parts(text):
                keys.pop("expansion", None)  # it may be about another design
        path.write_text("".join(keys.values()), encoding="utf-8")
        load(path)


def expanded(word: str) -> list[str]:
    """The files that a pattern means."""
    return sorted(map(str, Path().glob(word))) if "*" in word else [word]


def parts(text: str) -> dict[str, str]:
    """Text of each top-level key, what is above it included."""
    found = re.split(r"^(?=[a-z_]+:)", text, flags=re.MULTILINE)
    return {part.partition(":")[0]: part for part in found if not part.startswith("#")}


def follow(page: Path, folder: Path, capsys: Captured, *, all_of_it: bool) -> None:
    shutil.copytree(ROOT / "cases", folder / "cases", ignore=shutil.ignore_patterns("*.png"))
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setenv("EIGASSIGN_CACHE_DIR", str(folder / "cache"))
        Reader(capsys, all_of_it).follow(page)


with_blocks = [page for page in PAGES if any(blocks(page))]
with_commands = [page for page in with_blocks if any(kind == "bash" for kind, _ in blocks(page))]


def page_id(page: Path) -> str:
    return str(page.relative_to(ROOT))


@pytest.mark.parametrize("page", with_blocks, ids=page_id)
def test_cases_python_and_quick_commands_run(page: Path, tmp_path: Path, capsys: Captured) -> None:
    follow(page, tmp_path, capsys, all_of_it=False)


@pytest.mark.slow
@pytest.mark.parametrize("page", with_commands, ids=page_id)
def test_all_commands_run_and_print_what_is_shown(
    page: Path, tmp_path: Path, capsys: Captured
) -> None:
    follow(page, tmp_path, capsys, all_of_it=True)


def test_the_tutorial_writes_the_case_that_is_shipped(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Captured
) -> None:
    monkeypatch.chdir(tmp_path)
    reader = Reader(capsys, all_of_it=False)
    for language, text in blocks(MANUAL / "tutorial.md"):
        if language == "yaml":
            reader.write_case(text)
    written, shipped = load(Path("arm.yaml")), load(ROOT / "cases" / "two_link.yaml")
    for key in ("mechanism", "coordinates", "trajectory", "design", "targets"):
        assert getattr(written, key) == getattr(shipped, key), key


def test_blocks_that_are_not_run_are_few() -> None:
    reasons = [r for page in PAGES for r, _, _ in BLOCK.findall(page.read_text()) if r]
    assert len(reasons) <= 8, reasons
