"""The question is the same for all, repeatable, and features and poses belong together."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scenes import HEAD, SHIPPED, changed, scene_of

from eigassign.errors import CaseError
from eigassign.study.chart_question import build_features, build_points
from eigassign.study.plan import joint_map


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
