"""The workflow and the hook of the manual are well formed, and their commands do their work."""

import re
import shlex
from pathlib import Path
from typing import Any

import beam
import pytest
import yaml

from eigassign.cli import main

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "eigassign" / "docs" / "how-to" / "ci.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```yaml\n# (\S+)\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE)
FILES: dict[str, Any] = {name: yaml.safe_load(text) for name, text in BLOCKS}
WORKFLOW = FILES[".github/workflows/eigassign.yml"]


@pytest.fixture(autouse=True)
def _in_a_clone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("EIGASSIGN_CACHE_DIR", str(tmp_path / "cache"))
    Path("cases").mkdir()
    Path("cases", "two_link.yaml").write_text(beam.TEXT)


def commands(job: str) -> list[str]:
    """The lines of a job that are ours."""
    steps = WORKFLOW["jobs"][job]["steps"]
    lines = [line for step in steps for line in step.get("run", "").splitlines()]
    return [line for line in lines if line.startswith("eigassign ")]


def run(line: str) -> int:
    line = line.partition(" > ")[0]
    words = [
        name
        for word in shlex.split(line)[1:]
        for name in (sorted(map(str, Path().glob(word))) if "*" in word else [word])
    ]
    return main(words)


def test_the_workflow_is_one() -> None:
    assert WORKFLOW[True] == ["push"]  # YAML 1.1 takes `on` for true, and so do the servers
    jobs = WORKFLOW["jobs"]
    for job in jobs.values():
        assert job["runs-on"]
        assert job.get("needs", next(iter(jobs))) in jobs
        for step in job["steps"]:
            assert ("uses" in step) != ("run" in step)
            assert set(step) <= {"uses", "with", "run", "if"}
            assert re.fullmatch(r"actions/[a-z-]+@v\d", step.get("uses", "actions/checkout@v4"))
    assert all(commands(job) for job in jobs)


def test_the_first_job_passes_and_fails_when_an_expansion_is_too_far_off() -> None:
    assert [run(line) for line in commands("validate")] == [0, 0]
    strict = beam.TEXT.replace("50 %", "1e-9")
    Path("cases", "two_link.yaml").write_text(strict)
    assert [run(line) for line in commands("validate")] == [0, 1]


def test_the_sweep_leaves_its_folder(capsys: pytest.CaptureFixture[str]) -> None:
    (sweep,) = commands("sweep")
    run(f"{sweep} --reports none --jobs 1 --quiet")
    assert "sweep/index.html: 5 cases, " in capsys.readouterr().out


def test_the_hook_takes_good_cases_and_no_wrong_one() -> None:
    (repository,) = FILES[".pre-commit-config.yaml"]["repos"]
    (hook,) = repository["hooks"]
    assert repository["repo"] == "local"
    assert set(hook) == {"id", "name", "entry", "language", "files"}
    wrong = Path("cases", "wrong.yml")
    wrong.write_text("title: x")
    names = [str(path) for path in Path("cases").iterdir()]
    assert all(re.search(hook["files"], name) for name in names)
    assert not re.search(hook["files"], "cases/README.md")
    assert run(f"{hook['entry']} cases/two_link.yaml") == 0
    assert run(f"{hook['entry']} {' '.join(names)}") == 2
