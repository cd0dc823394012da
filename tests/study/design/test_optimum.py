"""The search of designs ends when it is told to, and keeps the best until then."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenes import SHIPPED, scene_of

from eigassign.assignment.requirements import Frequencies
from eigassign.assignment.sequential import End
from eigassign.study.design.optimum import Found, find_optimum
from eigassign.study.design.response import ExactResponse
from eigassign.study.design.wanted import target_frequencies


def found_of(folder: Path, text: str, starts: list[str]) -> Found:
    scene = scene_of(folder, text)
    wanted = target_frequencies(scene.file, scene.path)
    return find_optimum(scene, wanted, [], starts.append)


@pytest.mark.parametrize("call", [1, 3, 9, 12])
def test_ctrl_c_ends_the_whole_search_and_not_one_start_of_it(
    call: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls, solve = [0], ExactResponse.__call__

    def pressed(self: ExactResponse, y: np.ndarray) -> Frequencies:
        calls[0] += 1
        if calls[0] == call:
            raise KeyboardInterrupt
        return solve(self, y)

    monkeypatch.setattr(ExactResponse, "__call__", pressed)
    starts: list[str] = []
    found = found_of(tmp_path, SHIPPED, starts)
    assert found.best.end is End.INTERRUPTED
    assert len(starts) <= 3
    assert calls[0] <= call + 4  # what is known is judged on all samples, no step is made
    assert found.best.objective <= found.initial[1]


def test_no_time_leaves_the_initial_design_and_says_so(tmp_path: Path) -> None:
    starts: list[str] = []
    found = found_of(tmp_path, SHIPPED + "\nassignment: {seconds: 1e-9}\n", starts)
    assert found.best.end is End.SECONDS
    assert starts == ["  from start 1"]
    np.testing.assert_array_equal(found.best.y, [0.0, 0.0])
