"""A sweep whose parent and workers are killed at random instants ends as one that nobody disturbed.

So does one of which results are damaged between. Slow: sixty kills, each followed by the same
command again, some of them after a file of a case was cut, emptied or deleted.
"""

import json
import os
import random
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import pytest

import eigassign

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="needs Linux"),
]
CASES, KILLS, DAMAGES, JOBS = 40, 60, 20, 2
SIGNALS = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
ROOT = Path(eigassign.__file__).parents[1]
SMALL = ROOT / "benchmarks" / "small_arm.yaml"

# The command, which writes the name of every case that it begins to `begun`: each begins with the
# hidden folder of its run, `.<name>.<pid>-<8 digits>.tmp`. Its workers import it.
PROGRAM = Path(__file__).with_name("noting_program.py.txt").read_text("utf-8")
COMMAND = (
    *("program.py", "batch", "arm.yaml", "--reports", "none", "--jobs", str(JOBS), "--out", "out"),
    *("--set", f"mechanism.bodies.tool.mass=0..0.5:{CASES // 4}"),
    *("--set", "targets.0.frequency=170 Hz..190 Hz:4"),
)


def begun(folder: Path, command: tuple[str, ...] = COMMAND) -> subprocess.Popen[bytes]:
    """The command at work in this folder."""
    path = os.pathsep.join(filter(None, [str(ROOT), os.environ.get("PYTHONPATH", "")]))
    environment, nowhere = {**os.environ, "PYTHONPATH": path}, subprocess.DEVNULL
    return subprocess.Popen(
        [sys.executable, *command],
        cwd=folder,
        env=environment,
        stdout=nowhere,
        stderr=nowhere,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )


def workers(pid: int) -> list[int]:
    """Processes that this one has started and that are at work."""
    try:
        children = Path(f"/proc/{pid}/task/{pid}/children").read_text().split()
    except OSError:
        return []
    return [int(child) for child in children]


def made(folder: Path) -> dict[str, tuple[object, object]]:
    """All that a batch leaves, but for times."""
    found: dict[str, tuple[object, object]] = {}
    for row in json.loads((folder / "out" / "summary.json").read_text())["cases"]:
        results = {}
        if row["run_folder"] is not None:  # else there is no answer
            results = json.loads((folder / "out" / row["run_folder"] / "results.json").read_text())
            del results["timing_s"]
        del row["seconds"]
        found[row["name"]] = (row, results)
    return found


def placed(folder: Path) -> Path:
    folder.mkdir()
    (folder / "arm.yaml").write_text(SMALL.read_text())
    (folder / "program.py").write_text(PROGRAM)
    return folder


def damaged(out: Path, draw: random.Random) -> bool:
    """Cut, empty or delete a file of a case that is done; False where there is none."""
    done = [path.parent for path in sorted(out.glob("*/run.json")) if path.parent.name[0] != "."]
    whole = [each for each in done if not (out / each.name.rpartition(".")[0]).is_dir()]
    if not whole:
        return False
    name = draw.choice(("results.json", "run.json", "case.yaml"))
    path = draw.choice(whole) / name
    if not path.exists():
        return False
    data = path.read_bytes()
    draw.choice((path.unlink, lambda: path.write_bytes(data[:3]), lambda: path.write_bytes(b"")))()
    return True


def disturbed(folder: Path, draw: random.Random, kills: int, damages: int) -> tuple[int, int]:
    """Run the command until it is done, with at most so many kills on the way; how many they were.

    Every other one hits the parent, by each signal in turn, and the command is given again, perhaps
    after a damage; and once the kills are used up, until the damages are.
    """
    done = harmed = 0
    while True:
        if harmed < damages and damaged(folder / "out", draw):
            harmed += 1
        process = begun(folder)
        while process.poll() is None and done < kills:
            if not _goes_on(process, lambda: len(starts(folder))):
                break
            time.sleep(draw.uniform(0.0, 1.0))
            victims = workers(process.pid) if done % 2 else [process.pid]
            if victims and process.poll() is None:
                how = signal.SIGKILL if done % 2 else SIGNALS[done // 2 % len(SIGNALS)]
                os.kill(draw.choice(victims), how)
                done += 1
        if process.wait() in (0, 1) and (done < kills or harmed == damages):
            break
    assert begun(folder).wait() == 1  # what was killed twice was an error, and is tried again
    return done, harmed


def starts(folder: Path) -> list[str]:
    """The names of all cases that were begun."""
    return (folder / "begun").read_text().splitlines() if (folder / "begun").exists() else []


def _goes_on(process: subprocess.Popen[bytes], count: Callable[[], int]) -> bool:
    """Wait until the count grows; False where the command ends before."""
    before = count()
    while process.poll() is None:
        if count() > before:
            return True
        time.sleep(0.01)
    return False


def test_sweeps_that_are_killed_sixty_times_end_as_if_they_had_not_been(tmp_path: Path) -> None:
    undisturbed = placed(tmp_path / "undisturbed")
    assert begun(undisturbed).wait() == 1  # some miss their target
    expected, draw, sweeps, twice = made(undisturbed), random.Random(1), 0, 0
    left, unharmed = KILLS, DAMAGES
    assert len(expected) == CASES
    assert sum(bool(results) for _, results in expected.values()) > CASES / 2
    while left:
        folder, sweeps = placed(tmp_path / f"killed {sweeps}"), sweeps + 1
        done, harmed = disturbed(folder, draw, left, unharmed)
        left, unharmed = left - done, unharmed - harmed
        assert made(folder) == expected
        every = Counter(starts(folder))
        assert len(every) == CASES
        assert every.total() - CASES <= JOBS * done + harmed
        twice += every.total() - CASES
    assert not unharmed
    said = f"{KILLS} kills and {DAMAGES} damages in {sweeps} sweeps"
    sys.stdout.write(f"{said}, {twice} cases begun again\n")
