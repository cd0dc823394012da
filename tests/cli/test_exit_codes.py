"""What ends a process, and how: errors of ours and of the world, pipes, locales, signals."""

from __future__ import annotations

import errno
import io
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from commands import SECONDS, TWO_LINK, eigassign_process, environment, python
from wrong_inputs import GOOD

from eigassign.cli import main
from eigassign.errors import AccuracyError, EigassignError, InfeasibleError, StorageError
from eigassign.pipeline import queries, run
from eigassign.process import Terminated, failure_of, say

ERRORS: list[tuple[BaseException, int, str]] = [
    (InfeasibleError("limits contradict each other", ("a", "b")), 1, "limits contradict"),
    (AccuracyError("withheld"), 1, "error: withheld"),
    (StorageError("no space"), 3, "error: no space"),
    (OSError(errno.ENOSPC, "No space left on device", "x.h5"), 3, "x.h5: No space left on device"),
    (MemoryError(), 3, "out of memory"),
    (ZeroDivisionError("division by zero"), 4, "please report it"),
    (EigassignError("a state that cannot be"), 4, "please report it"),
    (KeyboardInterrupt(), 130, "interrupted"),
    (Terminated(signal.SIGTERM), 143, "SIGTERM"),
]


@pytest.fixture(autouse=True)
def _in_a_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("good.yaml").write_text(GOOD)


@pytest.mark.parametrize(
    ("error", "code", "says"), ERRORS, ids=[type(error).__name__ for error, _, _ in ERRORS]
)
def test_every_error_has_its_exit_code_and_one_line(
    error: BaseException,
    code: int,
    says: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def fail(*_args: object, **_how: object) -> None:
        raise error

    monkeypatch.setattr(run, "optimize", fail)
    assert main(["optimize", "good.yaml"]) == code
    out, err = capsys.readouterr()
    assert out == ""
    assert says in err
    assert len(err.splitlines()) == 1


def test_a_bug_is_told_with_its_place_and_with_a_traceback_only_when_asked(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(queries, "load_case", lambda *_: 1 / 0)
    assert main(["modes", "good.yaml"]) == 4
    err = capsys.readouterr().err
    assert "ZeroDivisionError: division by zero (eigassign.pipeline.queries:" in err
    assert "Traceback" not in err
    assert main(["modes", "good.yaml", "--debug"]) == 4
    assert "Traceback (most recent call last)" in capsys.readouterr().err


def test_a_case_error_is_no_bug_even_where_it_wraps_another() -> None:
    assert failure_of(StorageError("x")).exit_code == 3
    assert failure_of(BrokenPipeError(errno.EPIPE, "Broken pipe")).summary == ""


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_errors_and_warnings_have_colours_on_a_terminal_only(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("TERM", "xterm-256color")
    monkeypatch.delenv("NO_COLOR", raising=False)
    lines = ["eigassign: error: no", "a.yaml:3:1: warning: thin", "a.yaml:4:2: title: missing"]

    def said(stream: io.StringIO) -> list[str]:
        monkeypatch.setattr(sys, "stderr", stream)
        say(lines)
        return stream.getvalue().splitlines()

    error, warning, problem = said(Terminal())
    assert error == "\x1b[1;31meigassign: \x1b[0merror: no\x1b[K"
    assert warning == "\x1b[1ma.yaml:3:1: \x1b[0m\x1b[1;33mwarning: \x1b[0mthin\x1b[K"
    assert problem == "\x1b[1ma.yaml:4:2: \x1b[0mtitle: missing\x1b[K"
    assert said(io.StringIO()) == lines
    monkeypatch.setenv("NO_COLOR", "1")
    assert said(Terminal()) == [f"{line}\x1b[K" for line in lines]
    monkeypatch.setenv("TERM", "dumb")
    assert said(Terminal()) == lines


def test_help_imports_click_and_nothing_heavy() -> None:
    heavy = ["numpy", "scipy", "yaml", "pydantic", "osqp", "h5py", "matplotlib", "rich", "jinja2"]
    code = (
        "import sys; from eigassign.cli import main; main(['--help']); main(['optimize', '-h'])\n"
        f"sys.exit(repr([name for name in {heavy} if name in sys.modules] or 0))"
    )
    done = python("-c", code)
    assert done.stderr.strip() == "0"


def test_blas_gets_one_thread_before_numpy_unless_the_user_chose(tmp_path: Path) -> None:
    code = (
        "import os, sys; from eigassign.cli import main\n"
        "main(['modes', 'good.yaml', '--json'])\n"
        "print(os.environ['OPENBLAS_NUM_THREADS'], os.environ['OMP_NUM_THREADS'])"
    )
    done = python("-c", code, env=environment(OMP_NUM_THREADS="2"), cwd=tmp_path)
    assert done.stdout.splitlines()[-1] == "1 2"


def test_the_module_and_its_json_work_as_a_process() -> None:
    done = eigassign_process("modes", TWO_LINK, "--count", 1, "--json")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith('{"rigid_modes": 2, "frequencies_hz": [202.2195')


@pytest.mark.parametrize("command", [["schema"], ["modes", str(TWO_LINK)]], ids=lambda c: c[0])
def test_a_closed_pipe_ends_in_silence(command: list[str]) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    done = eigassign_process(*command, stdout=writer)
    os.close(writer)
    assert done.stderr == ""
    assert done.returncode == 3


@pytest.mark.parametrize("args", [["--json"], []], ids=["json", "text"])
def test_a_stdout_that_is_closed_from_the_start_is_told(args: list[str]) -> None:
    command = [sys.executable, "-m", "eigassign", "modes", str(TWO_LINK), *args]
    shell = ["sh", "-c", 'exec "$@" >&-', "sh", *command]
    done = subprocess.run(
        shell, env=environment(), stderr=subprocess.PIPE, text=True, timeout=SECONDS, check=False
    )
    assert done.returncode == 3
    assert done.stderr == "eigassign: error: standard output is closed\n"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_a_full_disk_behind_stdout_is_told() -> None:
    with open("/dev/full", "w") as full:
        done = eigassign_process("schema", stdout=full)
    assert done.returncode == 3
    assert "No space left on device" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize(
    "locale",
    [
        {"LC_ALL": "C"},
        {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
        {"PYTHONIOENCODING": "latin-1"},
    ],
    ids=["coerced", "ascii", "latin-1"],
)
def test_any_character_set_is_enough(locale: dict[str, str], tmp_path: Path) -> None:
    title = "Kraftfahrzeug-Übergröße → ω"
    for name in ("ω.yaml", "omega.yaml"):
        Path(name).write_text(GOOD.replace("A small arm", title), encoding="utf-8")
    env = environment(**locale)
    for args in (
        ["check", "ω.yaml"],
        ["check", "ω.yaml", "--json"],
        ["optimize", "omega.yaml", "--figures", "none"],
    ):
        done = eigassign_process(*args, env=env, cwd=tmp_path)
        assert done.returncode == 0, done.stderr
    wrong = eigassign_process("modes", "ω.yaml", "--q", "ω", env=env, cwd=tmp_path)
    assert wrong.returncode == 2
    assert "Traceback" not in wrong.stderr


INTERRUPTED_IMPORT = """
import sys
class Stop:
    def find_spec(self, name, *_):
        if name == {name!r}:
            raise KeyboardInterrupt
sys.meta_path.insert(0, Stop())
sys.argv = ["eigassign", "check", "good.yaml"]
from eigassign.__main__ import main
sys.exit(main())
"""


@pytest.mark.parametrize("name", ["click", "eigassign.cli.runs", "pydantic", "numpy"])
def test_ctrl_c_while_packages_are_imported_ends_with_130(name: str) -> None:
    code = INTERRUPTED_IMPORT.format(name=name)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 130
    assert done.stderr == "eigassign: interrupted\n"
    assert done.stdout == ""


@pytest.mark.parametrize("out", ["good.yaml/run", "good.yaml", "/dev/null/run"])
def test_a_run_folder_that_cannot_be_is_an_io_error(
    out: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["optimize", "good.yaml", "--out", out]) == 3
    assert "eigassign: error: " in capsys.readouterr().err
    assert Path("good.yaml").read_text() == GOOD


def test_a_cache_that_cannot_be_written_costs_a_warning_and_no_result(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["optimize", "good.yaml", "--cache-dir", "good.yaml"]) == 0
    assert "warning: the cache cannot be" in capsys.readouterr().err


SLOW = """
import sys, time
from pathlib import Path
from eigassign.output.reports import page as report

def write_run(results, folder, formats, kind):
    (folder / "half").touch()
    Path(f"{results.case_name}.ready").touch()
    time.sleep(600)

report.write_run = write_run  # in worker processes too: they import this file
if __name__ == "__main__":
    from eigassign.cli import main
    sys.exit(main())
"""


@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
@pytest.mark.parametrize("command", ["optimize", "batch"])
def test_a_signal_during_a_run_cleans_up_and_ends_with_its_code(
    command: str, number: signal.Signals, code: int, tmp_path: Path
) -> None:
    Path("slow.py").write_text(SLOW)
    args = [sys.executable, "slow.py", command, "good.yaml", "--no-cache"]
    with subprocess.Popen(
        args, env=environment(), stderr=subprocess.PIPE, text=True, preexec_fn=_heed_signals
    ) as process:
        _wait_for(tmp_path / "good.ready", process)
        process.send_signal(number)
        _, err = process.communicate(timeout=SECONDS)
    assert process.returncode == code, err
    assert "Traceback" not in err
    folder = Path("results")
    left = {path.name for path in folder.iterdir()} if folder.exists() else set()
    summaries = {"summary.csv", "summary.json", "junit.xml", "index.html"}
    kept = {".lock", "batch.json", "manifest.jsonl", *summaries}
    assert left == (kept if command == "batch" else set())


def _heed_signals() -> None:
    """Where the tests run in the background of a shell, children would ignore Ctrl-C."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


def test_nohup_is_respected(tmp_path: Path) -> None:
    code = (
        "import os, signal, sys; signal.signal(signal.SIGHUP, signal.SIG_IGN)\n"
        "from eigassign.process import terminable\n"
        "with terminable():\n    os.kill(os.getpid(), signal.SIGHUP)\n"
    )
    assert python("-c", code).returncode == 0


def _wait_for(path: Path, process: subprocess.Popen[str]) -> None:
    deadline = time.monotonic() + SECONDS
    while not path.exists():
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.02)
