"""Killed before any change that it makes to a file, a run loses nothing, and the next sweeps up."""

from __future__ import annotations

import signal
from collections.abc import Callable, Mapping
from itertools import count
from pathlib import Path

import pytest
from run_scenes import EARLIER, Stage, added, write_a_few_files
from stopping import can_stop, stopped_at

from eigassign.output import storage

pytestmark = pytest.mark.skipif(not can_stop(), reason="needs ptrace, on Linux")


@pytest.mark.parametrize(
    ("earlier", "exchange"),
    [
        *((earlier, True) for earlier in EARLIER),
        *(pytest.param(e, False, marks=[] if e is added else pytest.mark.slow) for e in EARLIER),
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
        monkeypatch.setattr(storage, "exchange", lambda first, second: False)
    scenes = Stage(tmp_path, write_a_few_files).scenes(earlier)
    for call, scene in zip(count(1), scenes, strict=False):
        stopped = stopped_at(scene.run, call, signal.SIGKILL)
        assert stopped.code == (-signal.SIGKILL if stopped.reached else 0), call
        if not exchange:
            scene.start_in_vain()
        assert scene.whole(), call
        assert not scene.lost(), call
        scene.run()
        assert scene.whole(), call
        assert scene.aside(), call
        assert scene.left() == [], call
        if not stopped.reached:
            assert call > 20  # few files, but many changes
            return
