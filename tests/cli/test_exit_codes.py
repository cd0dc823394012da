"""What ends a process, and how: errors of ours and of the world, pipes, locales, signals."""

import errno
import os
import random
import re
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import NoReturn

import click
import pytest
from commands import SECONDS, TWO_LINK, eigassign_process, environment, python
from wrong_inputs import GOOD

import eigassign as ea
from eigassign.__main__ import main as started
from eigassign.cli import cli, main
from eigassign.errors import AccuracyError, EigassignError, InfeasibleError, StorageError

ERRORS: list[tuple[BaseException, int, str]] = [
    (InfeasibleError("limits contradict each other", ("a", "b")), 1, "limits contradict"),
    (AccuracyError("withheld"), 1, "error: withheld"),
    (StorageError("no space"), 3, "error: no space"),
    (OSError(errno.ENOSPC, "No space left on device", "x.h5"), 3, "x.h5: No space left on device"),
    (MemoryError(), 3, "out of memory"),
    (BrokenPipeError(errno.EPIPE, "Broken pipe"), 3, ""),
    (ZeroDivisionError("division by zero"), 4, "please report it"),
    (EigassignError("a state that cannot be"), 4, "please report it"),
    (KeyboardInterrupt(), 130, "interrupted"),
]
LITTLE = ("--study", "none", "--report", "none", "--figures", "none", "--no-cache")


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
    @click.command()
    def fail() -> None:
        raise error

    monkeypatch.setitem(cli.commands, "fail", fail)
    assert main(["fail"]) == code
    out, err = capsys.readouterr()
    assert out == ""
    assert says in err
    assert len(err.splitlines()) == bool(says)


def test_a_signal_ends_a_command_with_its_code(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    @click.command()
    def die() -> None:
        os.kill(os.getpid(), signal.SIGTERM)

    monkeypatch.setitem(cli.commands, "die", die)
    assert main(["die"]) == 143
    assert capsys.readouterr().err == "eigassign: ended by SIGTERM\n"


def test_a_bug_is_told_with_its_place_and_with_a_traceback_only_when_asked(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    class Odd(dict[str, object]):
        def items(self) -> NoReturn:
            raise ZeroDivisionError("division by zero")

    @click.command()
    @click.option("--debug", is_flag=True)
    def fail(debug: bool) -> None:
        ea.load_case(Odd(title="odd"))

    monkeypatch.setitem(cli.commands, "fail", fail)
    assert main(["fail"]) == 4
    err = capsys.readouterr().err
    assert re.search(r"ZeroDivisionError: division by zero \(eigassign\.[\w.]+:\d+\)", err)
    assert "Traceback" not in err
    assert main(["fail", "--debug"]) == 4
    assert "Traceback (most recent call last)" in capsys.readouterr().err


def test_help_imports_click_and_nothing_heavy_and_blas_gets_one_thread_before_numpy() -> None:
    """One thread unless the user chose."""
    heavy = ["numpy", "scipy", "yaml", "pydantic", "h5py", "matplotlib", "jinja2"]
    code = (
        "import os, sys; from eigassign.cli import main\n"
        "main(['--help']); main(['optimize', '-h'])\n"
        "print(os.environ['OPENBLAS_NUM_THREADS'], os.environ['OMP_NUM_THREADS'])\n"
        f"sys.exit(repr([name for name in {heavy} if name in sys.modules] or 0))"
    )
    ours = {k: v for k, v in environment(OMP_NUM_THREADS="2").items() if "OPENBLAS" not in k}
    done = python("-c", code, env=ours)
    assert done.stderr.strip() == "0"
    assert done.stdout.splitlines()[-1] == "1 2"


def test_the_module_and_its_json_work_as_a_process() -> None:
    done = eigassign_process("modes", TWO_LINK, "--count", 1, "--json")
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.startswith('{"rigid_modes": 2, "frequencies_hz": [202.2195')


PRINTING = (["schema"], ["modes", str(TWO_LINK)])  # as text, and as a table


@pytest.mark.parametrize("command", PRINTING, ids=lambda command: command[0])
def test_a_closed_pipe_ends_in_silence(command: list[str]) -> None:
    reader, writer = os.pipe()
    os.close(reader)
    done = eigassign_process(*command, stdout=writer)
    os.close(writer)
    assert done.stderr == ""
    assert done.returncode == 3


@pytest.mark.parametrize("command", PRINTING, ids=lambda command: command[0])
def test_a_stdout_that_is_closed_from_the_start_is_told(command: list[str]) -> None:
    shell = ["sh", "-c", 'exec "$@" >&-', "sh", sys.executable, "-m", "eigassign", *command]
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


LOCALES = {
    "ascii": {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
    "coerced": {"LC_ALL": "C"},
    "latin-1": {"PYTHONIOENCODING": "latin-1"},
}


@pytest.mark.parametrize(
    "name", [n if n == "ascii" else pytest.param(n, marks=pytest.mark.slow) for n in LOCALES]
)
def test_any_character_set_is_enough(name: str, tmp_path: Path) -> None:
    title = "Kraftfahrzeug-Übergröße → ω"
    for file in ("ω.yaml", "omega.yaml"):
        Path(file).write_text(GOOD.replace("A small arm", title), encoding="utf-8")
    optimize = ["optimize", "omega.yaml", "--figures", "none", "--study", "none"]
    wrong = ["modes", "ω.yaml", "--q", "ω"]
    code = (
        "import sys; from eigassign.cli import main; args, codes = sys.argv[1:], []\n"
        "while args:\n    end = args.index('end'); codes.append(main(args[:end]))\n"
        "    del args[: end + 1]\n"
        "sys.exit(repr(codes))"
    )
    words = ["check", "ω.yaml", "end", "check", "ω.yaml", "--json", "end"]
    words += [*optimize, "end", *wrong, "end"]
    done = python("-c", code, *words, env=environment(**LOCALES[name]), cwd=tmp_path)
    assert done.stderr.splitlines()[-1] == "[0, 0, 0, 2]"
    assert "Traceback" not in done.stderr


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


@pytest.mark.parametrize(
    "name", ["gc", "typing", "dataclasses", "click", "eigassign.cli.runs", "pydantic", "numpy"]
)
def test_ctrl_c_while_packages_are_imported_ends_with_130(name: str) -> None:
    code = INTERRUPTED_IMPORT.format(name=name)
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 130
    assert done.stderr == "eigassign: interrupted\n"
    assert done.stdout == ""


SCRIPT = Path(sys.executable).with_name("eigassign")  # that of an installed package


@pytest.mark.slow
@pytest.mark.parametrize(
    "start",
    [
        (sys.executable, "-m", "eigassign"),
        pytest.param((str(SCRIPT),), marks=pytest.mark.skipif(not SCRIPT.exists(), reason="none")),
    ],
    ids=["module", "script"],
)
def test_ctrl_c_at_any_moment_of_the_start_shows_no_import_of_ours(start: tuple[str, ...]) -> None:
    """Before that it is Python that is interrupted."""
    draw, codes = random.Random(1), []
    for _ in range(60):
        command = [*start, "check", "good.yaml"]
        pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
        process = subprocess.Popen(command, **pipes, env=environment())
        time.sleep(draw.uniform(0.0, 0.12))
        process.send_signal(signal.SIGINT)
        _, err = process.communicate(timeout=SECONDS)
        assert "eigassign/" not in err, err
        codes.append(process.returncode)
        assert codes[-1] != 130 or err == "eigassign: interrupted\n"
    assert codes.count(130) > len(codes) / 4


def test_ctrl_c_while_a_class_is_made_is_ctrl_c(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    class Interrupting:
        def __set_name__(self, owner: type, name: str) -> None:
            raise KeyboardInterrupt

    def interrupted() -> None:
        type("Made", (), {"name": Interrupting()})

    monkeypatch.setattr(cli, "make_context", lambda *_: interrupted())
    assert main([]) == 130
    monkeypatch.setattr(sys.modules["eigassign.cli"], "main", interrupted)
    assert started() == 130
    assert capsys.readouterr().err == 2 * "eigassign: interrupted\n"


@pytest.mark.parametrize("out", ["good.yaml/run", "good.yaml", "/dev/null/run"])
def test_a_run_folder_that_cannot_be_is_an_io_error(
    out: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["optimize", "good.yaml", "--out", out]) == 3
    assert "eigassign: error: " in capsys.readouterr().err
    assert Path("good.yaml").read_text() == GOOD


def test_a_cache_that_cannot_be_written_costs_a_warning_and_no_result(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("EIGASSIGN_CACHE", "always")
    assert main(["optimize", "good.yaml", *LITTLE[:-1], "--cache-dir", "good.yaml"]) == 0
    assert "warning: the cache cannot be" in capsys.readouterr().err
    monkeypatch.setenv("EIGASSIGN_CACHE", "sometimes")
    assert main(["optimize", "good.yaml", *LITTLE]) == 2
    assert "expected one of always, auto, never" in capsys.readouterr().err


# The command, which lasts as soon as it begins to write its results. Worker processes import this
# file too.
SLOW = """
import sys, time
from pathlib import Path

def last(event, args):
    if event == "open" and str(args[0]).endswith("results.json") and "w" in str(args[1]):
        Path("ready").touch()
        time.sleep(600)

sys.addaudithook(last)
if __name__ == "__main__":
    from eigassign.cli import main
    sys.exit(main())
"""
SIGNALS = [
    ("optimize", signal.SIGINT, 130),
    ("batch", signal.SIGTERM, 143),
    pytest.param("optimize", signal.SIGTERM, 143, marks=pytest.mark.slow),
    pytest.param("batch", signal.SIGINT, 130, marks=pytest.mark.slow),
]


@pytest.mark.parametrize(("command", "number", "code"), SIGNALS)
def test_a_signal_during_a_run_cleans_up_and_ends_with_its_code(
    command: str, number: signal.Signals, code: int
) -> None:
    Path("slow.py").write_text(SLOW)
    how = LITTLE if command == "optimize" else ("--reports", "none", "--jobs", "2")
    args = [sys.executable, "slow.py", command, "good.yaml", *how]
    # where the tests run in the background of a shell, children would ignore Ctrl-C
    heed = lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)  # noqa: E731
    pipes = {"env": environment(), "stderr": subprocess.PIPE, "text": True}
    with subprocess.Popen(args, **pipes, preexec_fn=heed) as process:
        _wait_for(Path("ready"), process)
        process.send_signal(number)
        _, err = process.communicate(timeout=SECONDS)
    assert process.returncode == code, err
    assert "Traceback" not in err
    folder = Path("results")
    left = {path.name for path in folder.iterdir()} if folder.exists() else set()
    summaries = {"summary.csv", "summary.json", "junit.xml", "index.html"}
    assert left == (summaries if command == "batch" else set())


def test_nohup_is_respected() -> None:
    code = (
        "import os, signal, sys; signal.signal(signal.SIGHUP, signal.SIG_IGN)\n"
        "import click; from eigassign.cli import cli, main\n"
        "cli.add_command(click.command('hang-up')(lambda: os.kill(os.getpid(), signal.SIGHUP)))\n"
        "sys.exit(main(['hang-up']))\n"
    )
    assert python("-c", code).returncode == 0


def _wait_for(path: Path, process: subprocess.Popen[str]) -> None:
    deadline = time.monotonic() + SECONDS
    while not path.exists():
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < deadline
        time.sleep(0.02)
