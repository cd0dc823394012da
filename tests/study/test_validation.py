from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scenes import HEAD, SHIPPED, automatic, changed, scene_of

from eigassign.errors import CaseError
from eigassign.study import (
    BETWEEN,
    DESIGN_BOX,
    TRAJECTORY,
    reach_warnings,
    study_modes,
    unseen_points,
    validate_expansions,
)

CASES = Path(__file__).parents[2] / "cases"
MODE_ONLY_AT_A_POINT = HEAD + "expansion: {q: [1.8, 5.2]}\n"


def test_the_trajectory_row_is_the_exact_comparison_at_the_initial_design(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, SHIPPED)
    row = validate_expansions(scene)[0]
    exact = scene.model.frequencies(scene.path.q, [0, 0], 1)
    taylor = scene.expansions.full.frequencies(scene.path.q, [0, 0]) / exact - 1
    linear = scene.expansions.linear.frequencies(scene.path.q, [0, 0]) / exact - 1
    assert (row.where, row.points, row.mode, row.order) == (TRAJECTORY, 152, 1, 4)
    assert row.worst_taylor == np.abs(taylor).max()
    assert row.worst_linearised == np.abs(linear).max()
    assert row.rms_linearised == pytest.approx(np.sqrt(np.mean(linear**2)), rel=1e-12)


def test_what_is_stated_is_the_worst_where_nothing_was_expanded_with_a_margin(
    tmp_path: Path,
) -> None:
    scene = scene_of(tmp_path, SHIPPED)
    row, x = validate_expansions(scene)[-1], unseen_points(scene)
    exact = scene.model.frequencies(x[:, :2], x[:, 2:], 1)
    taylor = np.abs(scene.expansions.full.frequencies(x[:, :2], x[:, 2:]) / exact - 1.0)
    assert (row.where, row.points) == (BETWEEN, len(x))
    assert row.worst_taylor == pytest.approx(1.25 * taylor.max(), rel=1e-12)
    (study,) = study_modes(scene).rows
    stated = {"taylor": row.worst_taylor, "linearised": row.worst_linearised}
    assert study.max_relative["everywhere"] == stated


def test_it_is_judged_at_corners_and_between_samples_all_over_the_bounds(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, SHIPPED)
    (low, high), x = scene.bounds, unseen_points(scene)
    q, y = x[:, :2], x[:, 2:]
    corner = ((y == low) | (y == high)).all(axis=1)
    assert len(np.unique(y[corner], axis=0)) == 4
    assert (~corner).sum() >= 100
    assert np.ptp(y[~corner], axis=0) == pytest.approx(high - low, rel=0.05)
    sampled = {pose.tobytes() for pose in scene.path.q}
    assert all(pose.tobytes() in sampled for pose in q[corner])
    others = q[128 - len(q) :]
    assert not any(pose.tobytes() in sampled for pose in others)
    assert others.min() >= scene.path.q.min()
    assert others.max() <= scene.path.q.max()


def test_of_lists_only_listed_designs_are_looked_at(tmp_path: Path) -> None:
    """A tube of the least diameter and the thickest wall of these would be none."""
    tubes = """
  tube:
    choices:
      wide: {sections.upper.outer_diameter: 110 mm, sections.upper.thickness: 5 mm}
      narrow: {sections.upper.outer_diameter: 40 mm, sections.upper.thickness: 2 mm}
      thick: {sections.upper.outer_diameter: 120 mm, sections.upper.thickness: 40 mm}

expansion: {order: 2}
"""
    text = (CASES / "arm_6r.yaml").read_text().replace("samples: 101", "samples: 9")
    start, rest = text.split("design:")
    scene = scene_of(tmp_path, start + "design:" + tubes + "targets:" + rest.split("targets:")[1])
    designs = {tuple(y) for y in unseen_points(scene)[:, 6:]}
    assert designs == {(0.11, 0.005), (0.04, 0.002), (0.12, 0.04)}
    assert {row.where for row in validate_expansions(scene)} == {TRAJECTORY, DESIGN_BOX, BETWEEN}


def test_the_same_points_are_looked_at_every_time(tmp_path: Path) -> None:
    first, second = (validate_expansions(scene_of(tmp_path, SHIPPED)) for _ in range(2))
    assert first == second


def test_a_tolerance_that_is_not_met_fails_only_its_rows(tmp_path: Path) -> None:
    text = changed(("max_error: 2 %", "max_error: 1.5 %"))
    rows = validate_expansions(scene_of(tmp_path, text))
    assert {row.where: row.passed for row in rows} == {
        TRAJECTORY: False,
        DESIGN_BOX: True,
        BETWEEN: True,
    }


def test_every_expanded_mode_has_its_rows(tmp_path: Path) -> None:
    rows = validate_expansions(scene_of(tmp_path, changed(("modes: [1]", "modes: [1, 2]"))))
    assert [(row.where, row.mode) for row in rows] == [
        (where, mode) for where in (TRAJECTORY, DESIGN_BOX, BETWEEN) for mode in (1, 2)
    ]


def test_without_a_design_only_the_poses_count(tmp_path: Path) -> None:
    start, end = SHIPPED.index("design:"), SHIPPED.index("expansion:")
    text = (SHIPPED[:start] + SHIPPED[end:]).replace("  y: [0.125, 0.125]", "  y: []")
    rows = validate_expansions(scene_of(tmp_path, text))
    assert [row.where for row in rows] == [TRAJECTORY, BETWEEN]
    assert all(row.worst_taylor == pytest.approx(row.worst_linearised, rel=1e-6) for row in rows)


def test_a_single_link_has_frequencies_that_no_pose_changes(tmp_path: Path) -> None:
    text = """
title: Pendulum
mechanism:
  space: planar
  materials: {al: {youngs_modulus: 69 GPa, density: 2690}}
  sections: {rod: {shape: circle, diameter: 20 mm}}
  links: {arm: {length: 0.5, material: al, section: rod, elements: 3}}
  joints: {base: {type: revolute, base: ground, follower: arm.start}}
  bodies: {tip: {at: arm.end, mass: 0.05}}
coordinates: {q: {joint: base}}
trajectory: {duration: 1 s, q: [[0], [0.5], [1]]}
design: {m: {parameter: bodies.tip.mass, min: 0, max: 0.1}}
"""
    rows = validate_expansions(scene_of(tmp_path, text))
    assert [row.where for row in rows] == [TRAJECTORY, DESIGN_BOX, BETWEEN]
    assert rows[0].worst_taylor < rows[1].worst_taylor  # the pose changes nothing, the mass does


def test_where_there_is_nothing_to_look_at_that_is_said(tmp_path: Path) -> None:
    with pytest.raises(CaseError, match="validation: nothing to validate"):
        validate_expansions(scene_of(tmp_path, MODE_ONLY_AT_A_POINT))


def test_auto_is_within_tolerance_as_the_papers_point_is(tmp_path: Path) -> None:
    assert all(row.passed for row in validate_expansions(scene_of(tmp_path, automatic())))


def test_an_order_that_does_not_reach_along_the_trajectory_is_answered_with_auto(
    tmp_path: Path,
) -> None:
    scene = scene_of(tmp_path, SHIPPED)
    (warning,) = reach_warnings(scene, [(0.01, 1), (0.03, 2)])
    assert "order 4 is 3 % off in mode 2 along the trajectory, and 2 % are accepted" in warning
    assert "Write expansion: {order: auto}" in warning
    (warning,) = reach_warnings(scene, [(np.inf, 1), (0.03, 2)])
    assert "gives no frequency (λ < 0) in mode 1" in warning
    assert reach_warnings(scene, [(0.02, 1)]) == ()
    auto = scene.file.expansion.model_copy(update={"order": "auto"})
    chosen = replace(scene, file=replace(scene.file, expansion=auto))
    assert reach_warnings(chosen, [(0.03, 1)]) == ()
