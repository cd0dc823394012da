"""A band is called clear only where no mode is in it anywhere along the motion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenes import SHIPPED, changed, scene_of

from eigassign.pipeline.run import solve_case
from eigassign.study.built_case import load_case
from eigassign.study.design.clearance import Band, prove_clear
from eigassign.study.scene import Scene


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    return scene_of(tmp_path_factory.mktemp("arm"), SHIPPED)


def band(scene: Scene, low: float, high: float, below: int) -> Band:
    q = scene.path.q
    return Band("band", q, np.full(len(q), low), np.full(len(q), high), below)


def test_room_is_the_least_distance_to_an_edge(arm: Scene) -> None:
    hz = arm.model.frequencies(arm.path.q, arm.initial, 2)
    found = prove_clear(arm.model, band(arm, 230.0, 300.0, 1), arm.initial)
    assert found.clear
    assert found.counted
    exact = min(1.0 - hz[:, 0].max() / 230.0, hz[:, 1].min() / 300.0 - 1.0)
    assert found.room == pytest.approx(exact, rel=0.05)
    assert found.room <= exact


def test_a_forged_answer_is_rejected(arm: Scene) -> None:
    for low, high, below in ((150.0, 300.0, 1), (230.0, 300.0, 2), (230.0, 300.0, 0)):
        assert not prove_clear(arm.model, band(arm, low, high, below), arm.initial).clear


@pytest.mark.parametrize("low", [196.0, 203.0])
def test_answers_called_clear_stay_clear_at_random_instants(low: float, tmp_path: Path) -> None:
    text = changed(("  - {mode: 1, frequency: 190 Hz}", f"  - {{keep_out: [{low}, {low + 12}]}}"))
    path = tmp_path / "case.yaml"
    path.write_text(text)
    case = load_case(path)
    result = solve_case(case)
    row = result.results.assignment
    assert row is not None
    assert row.verdict == "reached"
    assert all(one.clear for one in row.clearances)
    q, y = case.trajectory.q, np.array(list(result.design.values()))
    at = np.random.default_rng(0).uniform(0, len(q) - 1, 2000)
    between = np.column_stack([np.interp(at, np.arange(len(q)), column) for column in q.T])
    hz = case.model().frequencies(between, y, 3)
    assert not ((hz > low) & (hz < low + 12.0)).any()
