"""Killed or told to end before any change that it makes to a file, a run loses nothing.

What it leaves is swept by the next. Whole runs of `eigassign optimize` are stopped at random
instants too, forked from a process that has imported everything, so that they are met at work.
"""

import random
import signal
import sys
import time
from collections.abc import Callable, Mapping
from itertools import count
from pathlib import Path

import click
import pytest
from run_scenes import (
    EARLIER,
    Stage,
    added,
    case_text,
    edited,
    empty_cache,
    faults,
    optimize,
    write_a_few_files,
)
from stopping import can_stop, stopped_after, stopped_at

from eigassign.cli import cli, main

pytestmark = pytest.mark.skipif(not can_stop(), reason="needs ptrace, on Linux")


@pytest.mark.parametrize(
    ("earlier", "exchange"),
    [
        pytest.param(earlier, exchange, marks=[] if earlier is added else pytest.mark.slow)
        for earlier in EARLIER
        for exchange in (True, False)
    ],
    ids=lambda given: (
        ("exchanged" if given else "renamed twice") if isinstance(given, bool) else given.__name__
    ),
)
def test_a_kill_before_any_change_of_a_file_loses_nothing_and_the_next_start_sweeps_up(
    tmp_path: Path,
    earlier: Callable[[Path], Mapping[str, str]],
    exchange: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    if not exchange:
        monkeypatch.setattr(sys, "platform", "darwin")  # which cannot swap two folders
    scenes = Stage(tmp_path, write_a_few_files).scenes(earlier)
    for call, scene in zip(count(1), scenes, strict=False):
        stopped = stopped_at(scene.run, call, signal.SIGKILL)
        assert stopped.code == (-signal.SIGKILL if stopped.reached else 0), call
        if not exchange:
            scene.start_in_vain()
        assert not faults(scene), call
        if not stopped.reached:
            assert call > 20  # few files, but many changes
            return


@pytest.mark.parametrize(
    "number",
    [
        signal.SIGTERM,
        *(pytest.param(each, marks=pytest.mark.slow) for each in (signal.SIGINT, signal.SIGHUP)),
    ],
)
def test_a_signal_before_any_change_of_a_file_loses_nothing_and_leaves_nothing(
    tmp_path: Path, number: signal.Signals
) -> None:
    scenes = Stage(tmp_path, write_a_few_files).scenes(added)
    # the first file that a command opens is that in place of a closed stdout
    for call, scene in zip(count(2), scenes, strict=False):
        stopped = stopped_at(lambda: as_a_command(scene.run), call, number)  # noqa: B023
        assert stopped.code == (128 + number if stopped.reached else 0), call
        hidden = [path.name for path in scene.target.parent.iterdir() if path.name[0] == "."]
        assert not hidden, call
        assert not faults(scene), call
        if not stopped.reached:
            return


@pytest.mark.slow
def test_whole_runs_killed_before_a_change_of_a_file_lose_nothing(tmp_path: Path) -> None:
    """With an empty cache, in the place of a run that was edited."""
    scenes = Stage(tmp_path, optimize, case_text()).scenes(edited)
    for call, scene in zip(count(1, 3), scenes, strict=False):
        empty_cache(scene)
        stopped = stopped_at(scene.run, call, signal.SIGKILL)
        assert not faults(scene), call
        if not stopped.reached:
            return


@pytest.mark.slow
@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize("earlier", EARLIER)
def test_whole_runs_stopped_at_random_instants_lose_nothing(
    tmp_path: Path, earlier: Callable[[Path], Mapping[str, str]], number: signal.Signals
) -> None:
    draw, start = random.Random(number), time.perf_counter()
    scenes = Stage(tmp_path, optimize, case_text()).scenes(earlier)  # the first run is timed
    scene = next(scenes)
    longest = 1.3 * (time.perf_counter() - start)
    for turn in range(6):
        if turn % 2:
            empty_cache(scene)
        code = stopped_after(scene.run, draw.uniform(0.0, longest), number)
        assert code in (0, -number, 128 + number)
        assert not faults(scene), turn
        scene = next(scenes)


def as_a_command(job: Callable[[], int]) -> int:
    """The exit code of a command that does the job."""
    cli.add_command(click.command("job")(job))
    return main(["job"])
