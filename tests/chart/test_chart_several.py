"""Charts of several trajectories: the same objective as `optimize`, and no path over a seam."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from chart_scenes import TINY
from scenes import scene_of

from eigassign.chart.designs import design_task
from eigassign.chart.question import build_features
from eigassign.study import Scene, time_weights

CASES = Path(__file__).parents[2] / "cases"


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    """Five bars on two trajectories, the second raised so that the seam is a jump of its own."""
    text = (CASES / "five_bar.yaml").read_text()
    text = text.replace("- [114 deg, 56 deg]\n      - [115", "- [113 deg, 60 deg]\n      - [115")
    target = "- {mode: 1, frequency: 27 Hz}"
    assert target in text
    more = target.replace("Hz}", "Hz, trajectory: cut}")
    more += "\n  - {mode: 1, frequency: 26 Hz, weight: 3, trajectory: return}"
    return scene_of(tmp_path_factory.mktemp("bars"), text.replace(target, more))


def test_the_charted_objective_weighs_targets_by_weight_and_time(scene: Scene) -> None:
    task, y = design_task(scene, TINY, 1e-6), scene.initial
    hz = scene.model.frequencies(scene.path.q, y, 1)[:, 0]
    w = np.concatenate([np.full(7, 1.0), np.full(7, 3.0)]) * time_weights(scene.path)
    off = hz / np.repeat([27.0, 26.0], 7) - 1.0
    assert task.objective(y) == pytest.approx(w @ off**2 / w.sum(), rel=1e-9)


def test_few_affordable_samples_still_hold_both_ends_of_each(scene: Scene) -> None:
    dear = design_task(scene, TINY, TINY.searched_s)
    assert {0, 6, 7, 13} <= set(scene.path.spread(5).tolist())
    assert len(dear.scene.path.q) < 14
    assert [own.rows.stop - own.rows.start for own in dear.wanted] == [
        len(part.trajectory.q) for part in dear.scene.path.parts
    ]


def test_places_lead_back_to_their_poses_and_the_seam_to_neither_side_s_spline(
    scene: Scene,
) -> None:
    features = build_features(scene)
    assert features.place is not None
    np.testing.assert_allclose(features.pose(features.place), scene.path.q, atol=1e-12)
    end, start = features.place[6:8]
    middle = features.pose(np.array([0.5 * (end + start)]))[0]
    np.testing.assert_allclose(middle, scene.path.q[6:8].mean(axis=0), rtol=1e-12)
