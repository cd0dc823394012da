"""The question is the same for all, repeatable, and features and poses belong together."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenes import HEAD, SHIPPED, changed, scene_of

from eigassign.chart.comparison import affordable_points
from eigassign.chart.effort import QUICK, Effort
from eigassign.chart.question import EvaluationPoints, box_corners, build_features, build_points
from eigassign.errors import CaseError
from eigassign.study import joint_map


def test_features_lead_back_to_poses_with_the_same_frequencies(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, SHIPPED)
    features = build_features(scene)
    assert features.names == ("place along the trajectory", "m1", "m2")
    points = build_points(scene, features, 20, 2, 7)
    back = features.x(points.u)
    S = joint_map(scene.model)
    np.testing.assert_allclose(back[:, :2] @ S.T, points.q @ S.T, atol=1e-12)
    np.testing.assert_allclose(back[:, 2:], points.y, atol=1e-15)


def test_with_several_joints_the_place_is_the_distance_travelled(tmp_path: Path) -> None:
    three = changed(
        (
            "  bodies:",
            "    hand: {type: revolute, base: forearm.end, follower: hand.start}\n  bodies:",
        ),
        (
            "  joints:",
            "    hand: {length: 0.2, material: aluminium, section: rod, elements: 2}\n  joints:",
        ),
        ("# the paper measures", "\n  q3: {joint: hand} #"),
        text=HEAD,
    )
    q = "[[0.1, 0.4, 0.0], [0.2, 0.9, 0.3], [0.4, 1.1, 0.9], [0.5, 1.2, 1.0]]"
    scene = scene_of(tmp_path, f"{three}trajectory: {{q: {q}, duration: 1 s}}\n")
    features = build_features(scene)
    points = build_points(scene, features, 10, 2, 7)
    S = joint_map(scene.model)
    np.testing.assert_allclose(features.x(points.u) @ S.T, points.q @ S.T, atol=1e-9)


def test_points_are_the_same_every_time_and_inside_the_box(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, SHIPPED)
    features = build_features(scene)
    one, two = (build_points(scene, features, 50, 3, 11) for _ in range(2))
    assert np.array_equal(one.x, two.x)
    assert one.u.min() >= 0.0
    assert one.u.max() <= 1.0
    assert len(one.x) == 50 + 3 * 11
    assert one.runs().designs == 3
    assert one.head(10).designs == 0
    assert len(one.repeated(3).x) == 3 * len(one.x)


def at_corners(points: EvaluationPoints, rows: slice) -> int:
    """Of these points how many have a design at a corner of the box; places do not count."""
    u = points.u[rows, 1:]
    return int(((u == 0.0) | (u == 1.0)).all(axis=1).sum())


def test_a_third_of_the_points_and_of_the_designs_followed_arebox_corners(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, SHIPPED)
    points = build_points(scene, build_features(scene), 60, 9, 11)
    assert at_corners(points, slice(0, 60)) == 20
    assert len(np.unique(points.y[2:60:3], axis=0)) == 4
    runs = points.y[60::11]
    assert len(np.unique(runs, axis=0)) == points.designs == 9
    assert at_corners(points, slice(60, None, 11)) == 4
    few = build_points(scene, build_features(scene), 4, 3, 5)
    assert at_corners(few, slice(4, None, 5)) >= 1


def test_of_many_corners_random_ones_and_their_opposites_are_taken() -> None:
    found = box_corners(7, 40, np.random.default_rng(1))
    assert found.shape == (7, 40)
    np.testing.assert_array_equal(found[1::2], 1.0 - found[:-1:2])
    assert len(np.unique(found, axis=0)) == 7
    all_three = box_corners(16, 3, np.random.default_rng(1))
    assert len(np.unique(all_three[:8], axis=0)) == len(np.unique(all_three[8:], axis=0)) == 8


def test_without_room_for_designs_one_is_followed(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, HEAD + "trajectory: {q: [[1.8, 5.3], [1.9, 5.9]], duration: 1 s}\n")
    points = build_points(scene, build_features(scene), 5, 9, 7)
    assert points.designs == 1
    assert len(points.x) == 5 + len(points.along)


def test_as_many_designs_are_followed_as_the_exact_solves_allow(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, SHIPPED)
    features = build_features(scene)
    for effort, wanted in ((QUICK, 9), (Effort(), 15)):
        cheap = affordable_points(scene, features, effort, 1e-4)
        assert (cheap.designs, cheap.n_random) == (wanted, effort.random_points)
        dear = affordable_points(scene, features, effort, effort.reference_s / 100.0)
        assert dear.designs == 3
        assert len(dear.x) <= 100


def test_whole_trajectories_are_those_of_the_same_designs(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, SHIPPED)
    features = build_features(scene)
    points = build_points(scene, features, 5, 3, 7)
    whole = points.whole_runs(features)
    assert len(whole.x) == 3 * 152
    assert whole.n_random == 0
    thinned = whole.x.reshape(3, 152, -1)[:, points.along].reshape(21, -1)
    np.testing.assert_array_equal(thinned, points.runs().x)
    np.testing.assert_array_equal(points.runs(2).x, points.runs().x[:14])
    assert points.runs(2).designs == 2


ABSOLUTE = "q2: {joint: elbow, angle: absolute}"


@pytest.mark.parametrize("head", [HEAD, HEAD.replace(ABSOLUTE, "q2: {joint: elbow}")])
def test_a_trajectory_that_stands_still_where_it_matters_is_refused_with_the_joint(
    head: str, tmp_path: Path
) -> None:
    second = 5.4 if "absolute" in head else 5.3  # the elbow does not turn
    still = f"trajectory: {{q: [[1.8, 5.3], [1.9, {second}]], duration: 1 s}}\n"
    scene = scene_of(tmp_path, head + still)
    with pytest.raises(
        CaseError, match=r"nothing moves .* \(joints: elbow\).* let it move, or give"
    ):
        build_features(scene)


def test_a_case_in_which_nothing_can_change_a_frequency_says_so(tmp_path: Path) -> None:
    text = (
        "title: Pin\nmechanism:\n  space: planar\n"
        "  materials: {m: {youngs_modulus: 210 GPa, density: 7850}}\n"
        "  sections: {s: {shape: circle, diameter: 20 mm}}\n"
        "  links: {l: {length: 0.8, material: m, section: s, elements: 3}}\n"
        "  joints: {j: {type: revolute, base: ground, follower: l.start}}\n"
        "coordinates: {q: {joint: j}}\n"
        "trajectory: {q: [[0], [1]], duration: 1 s}\n"
    )
    with pytest.raises(CaseError, match=r"no coordinate changes a frequency, .*; give a design"):
        build_features(scene_of(tmp_path, text))
