"""Whichever call of the system fails, and how: a command ends with its exit code and one line.

Nothing that was there is lost, and the same command, given again, ends as if nothing had failed.
"""

import builtins
import contextlib
import errno
import fcntl
import io
import json
import os
import shutil
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest
from beam import TEXT

from eigassign.cli import main
from eigassign.output import is_untouched

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
CALLS: dict[str, tuple[tuple[Any, str], ...]] = {
    "open": ((builtins, "open"), (io, "open"), (os, "open")),
    "rename": ((os, "rename"), (os, "replace")),
    "fsync": ((os, "fsync"),),
    "flock": ((fcntl, "flock"), (fcntl, "lockf")),
}
ERRORS = (errno.ENOSPC, errno.EIO, errno.EACCES, errno.ENOLCK)
OURS = str(Path(sys.modules["eigassign"].__file__ or "").parent)
FEW = 17  # calls between two that fail, in the default tests

LITTLE = ("--figures", "none", "--report", "none")
SWEEP = ("batch", "beam.yaml", "--jobs", "1", "--reports", "none", "--set")
TWO, THREE = ((*SWEEP, f"targets.0.frequency={hz}") for hz in ("185,1", "185,190,1"))
STUDY = ("--study", "none", "--cache-dir", "cache")
OPTIMIZE = ("optimize", "beam.yaml", "--out", "out", *STUDY, *LITTLE)
UPDATE = ("update", "measured.yaml", "--out", "out", *LITTLE)
MEASURED = "q1 [rad],mode,frequency [Hz],deviation [Hz]\n0.5,1,185,1\n1,1,185.4,1\n"
# The command, and those before it: it takes the place of what they left, or goes on from there.
COMMANDS: dict[str, tuple[tuple[str, ...], tuple[tuple[str, ...], ...]]] = {
    "optimize": (OPTIMIZE, (OPTIMIZE,)),
    "update": (UPDATE, (UPDATE,)),
    "batch": ((*THREE, "--out", "out"), ((*TWO, "--out", "out"),)),
}


@dataclass(frozen=True)
class Ended:
    """How a command ended: exit code, what it said on stderr, whether a call was made to fail."""

    code: int
    err: str
    reached: bool


def ended(command: tuple[str, ...], folder: Path, kind: str = "", turn: int = 0) -> Ended:
    """A command in a process of its own, in which the ``turn``-th call of a kind fails (from 1)."""
    told, heard = folder.parent / "told.json", folder.parent / "heard"
    pid = os.fork()
    if not pid:
        try:
            os.chdir(folder)
            os.environ.update(EIGASSIGN_CACHE="always", EIGASSIGN_CACHE_DIR=str(folder / "cache"))
            out, err, calls = io.StringIO(), io.StringIO(), [0]
            with contextlib.ExitStack() as stack:
                stack.enter_context(contextlib.redirect_stdout(out))
                stack.enter_context(contextlib.redirect_stderr(err))
                for module, name in CALLS.get(kind, ()):
                    wrapped = failing(getattr(module, name), turn, calls)
                    stack.enter_context(patch.object(module, name, wrapped))
                code = main([*command])
            heard.write_text(err.getvalue())
            told.write_text(json.dumps([code, calls[0] >= turn]))
        finally:
            os._exit(0)
    told.unlink(missing_ok=True)
    os.waitpid(pid, 0)
    code, reached = json.loads(told.read_text())
    return Ended(code, heard.read_text(), reached)


def failing(call: Callable[..., Any], turn: int, calls: list[int]) -> Callable[..., Any]:
    """The call, of which the ``turn``-th fails; those for what Python itself reads do not count."""

    def made(*args: Any, **how: Any) -> Any:
        if not str(args[0]).startswith(
            (sys.prefix, sys.base_prefix, OURS, "/proc", "/sys", "/dev")
        ):
            calls[0] += 1
            if calls[0] == turn:
                number = ERRORS[turn % len(ERRORS)]
                raise OSError(number, os.strerror(number), args[0])
        return call(*args, **how)

    return made


def made(folder: Path) -> Any:
    """What a command left in ``out``, but for times; None where that is not whole."""
    out = folder / "out"
    if (out / "summary.json").exists():
        rows = json.loads((out / "summary.json").read_text())["cases"]
        cases = [out / row["run_folder"] for row in rows if row["run_folder"]]
        return [{**row, "seconds": 0} for row in rows], all(map(is_untouched, cases))
    if not (out / "results.json").exists():
        return None
    found = json.loads((out / "results.json").read_text())
    del found["timing_s"]
    found["notes"] = [note for note in found.get("notes", []) if "from the cache" not in note]
    return found, is_untouched(out)


@dataclass(frozen=True)
class Scene:
    """A folder before a command, and how the command ends where nothing fails."""

    command: tuple[str, ...]
    before: Path
    expected: Any
    code: int
    old: Any

    def copied(self, to: Path) -> Path:
        """A folder of its own for a trial."""
        shutil.rmtree(to, ignore_errors=True)
        shutil.copytree(self.before, to, symlinks=True)
        return to


@pytest.fixture(scope="module")
def scenes(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Scene]:
    found: dict[str, Scene] = {}

    def scene(name: str) -> Scene:
        if name not in found:
            command, first = COMMANDS[name]
            before = tmp_path_factory.mktemp(name) / "before"
            before.mkdir()
            (before / "beam.yaml").write_text(TEXT)
            (before / "measured.yaml").write_text(TEXT + "measurements: {file: measured.csv}\n")
            (before / "measured.csv").write_text(MEASURED)
            for each in first:
                assert ended(each, before).code in (0, 1)
            if name in ("optimize", "update"):
                (before / "out" / "notes.md").write_text("precious")
            shutil.rmtree(before / "cache", ignore_errors=True)
            old, trial = made(before), before.with_name("undisturbed")
            shutil.copytree(before, trial)
            code = ended(command, trial).code
            found[name] = Scene(command, before, made(trial), code, old)
            assert found[name].expected
            assert code in (0, 1)
        return found[name]

    return scene


def faults(scene: Scene, folder: Path, how: Ended) -> Iterator[str]:
    """What is wrong after a command of which a call failed, and after the next one."""
    if how.code not in (scene.code, 1, 3):
        yield f"exit code {how.code}: {how.err}"
    if "internal error" in how.err or "Traceback" in how.err:
        yield how.err
    if how.code == 3 and not how.err.splitlines()[-1].startswith("eigassign: error: "):
        yield f"no reason: {how.err}"
    if how.code == scene.code and not _is_as(made(folder), scene.expected):
        yield "something else than without the failure"
    if scene.command[0] in ("optimize", "update"):
        if how.code != scene.code and made(folder) not in (scene.old, scene.expected):
            yield "neither the old run nor a new one"
        seen = [path.parent for path in folder.rglob("notes.md") if path.read_text() == "precious"]
        if not any(path.name.startswith("out") or str(path) in how.err for path in seen):
            yield "what was mine is nowhere"
    after = ended(scene.command, folder)
    if (after.code, made(folder)) != (scene.code, scene.expected):
        yield f"the next command ends otherwise: {after.code} {after.err}"
    hidden = {path.name for path in folder.rglob(".*")}
    if hidden:
        yield f"left is {hidden}"


def _is_as(found: Any, expected: Any) -> bool:
    """Whether all is as expected but for cases of a batch that ended in an error, and say so."""
    if not isinstance(expected[0], list) or found is None:
        return bool(found == expected)
    pairs = zip(found[0], expected[0], strict=True)
    return found[1] and all(one == other or one["status"] == "error" for one, other in pairs)


@pytest.mark.parametrize("every", [FEW, pytest.param(1, marks=pytest.mark.slow)])
@pytest.mark.parametrize("kind", CALLS)
@pytest.mark.parametrize("name", COMMANDS)
def test_a_call_that_fails_costs_the_command_alone(
    name: str, kind: str, every: int, scenes: Callable[[str], Scene], tmp_path: Path
) -> None:
    scene, wrong = scenes(name), list[str]()
    for turn in count(1, every):
        folder = scene.copied(tmp_path / "trial")
        how = ended(scene.command, folder, kind, turn)
        wrong += [f"{kind} {turn}: {fault}" for fault in faults(scene, folder, how)]
        if not how.reached:
            break
    assert not wrong, "\n".join(wrong)
    assert turn > 1
