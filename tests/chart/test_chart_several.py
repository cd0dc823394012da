"""Charts of several trajectories: the same objective as `optimize`, and no path over a seam."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from chart_scenes import TINY
from scenes import scene_of

from eigassign.chart.designs import design_task
from eigassign.chart.question import build_features
from eigassign.study.design.one_shot import assign_design
from eigassign.study.design.wanted import target_frequencies
from eigassign.study.scene import Scene

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


def test_the_charted_objective_is_the_program_s(scene: Scene) -> None:
    task = design_task(scene, TINY, 1e-6)
    assert len(task.rows) == len(scene.path.time_s)
    found = assign_design(scene, target_frequencies(scene.file, scene.path))
    lam = np.full((len(task.q), 1), np.nan)
    for goal, wanted in zip(found.lam, task.wanted, strict=True):
        lam[wanted.rows, 0] = goal
    assert task.objective(lam) == pytest.approx(found.objective_optimal, rel=1e-12)


def test_its_slope_is_its_finite_difference(scene: Scene) -> None:
    task = design_task(scene, TINY, 1e-6)
    rng = np.random.default_rng(3)
    lam, slopes = 27e3 * (1 + 0.1 * rng.random((14, 1))), 1e3 * rng.normal(size=(14, 1, 2))
    for k, direction in enumerate(np.eye(2)):
        ahead, behind = (task.objective(lam + h * slopes @ direction) for h in (1e-4, -1e-4))
        assert task.slope(lam, slopes)[k] == pytest.approx((ahead - behind) / 2e-4, rel=1e-6)


def test_few_affordable_samples_still_hold_both_ends_of_each(scene: Scene) -> None:
    dear = design_task(scene, TINY, TINY.searched_s)
    assert {0, 6, 7, 13} <= set(dear.rows.tolist())
    assert len(dear.rows) < 14
    assert [own.rows.stop - own.rows.start for own in dear.wanted] == [
        len(part.trajectory.q) for part in dear.path.parts
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
