from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scenes import HEAD, SHIPPED, automatic, changed, scene_of

from eigassign.errors import CaseError
from eigassign.study import (
    DESIGN_BOX,
    RANDOM_BOX,
    TRAJECTORY,
    box_points,
    random_q,
    reach_warnings,
    validate_expansions,
)

MODE_ONLY_AT_A_POINT = HEAD + "expansion: {q: [1.8, 5.2]}\n"


def random() -> np.random.Generator:
    return np.random.default_rng(7)


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


def test_the_default_box_in_q_is_what_the_elbow_travels(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, SHIPPED)
    q = random_q(scene, random())
    assert q is not None
    assert q.shape == (200, 2)
    elbow, travelled = q[:, 1] - q[:, 0], scene.path.q[:, 1] - scene.path.q[:, 0]
    assert travelled.min() <= elbow.min() < elbow.max() <= travelled.max()
    assert np.ptp(elbow) > 0.9 * np.ptp(travelled)


def test_a_span_is_a_box_around_the_expansion_point(tmp_path: Path) -> None:
    text = changed(("max_error: 2 %", "max_error: 2 %\n  q_span: [0.1, 0.3]\n  samples: 300"))
    q = random_q(scene_of(tmp_path, text), random())
    assert q is not None
    low, high = q.min(axis=0), q.max(axis=0)
    assert q.shape == (300, 2)
    np.testing.assert_allclose([low, high], [[1.717, 5.012], [1.917, 5.612]], atol=0.005)


@pytest.mark.parametrize(("d", "points"), [(1, 61), (2, 169), (3, 343), (4, 216), (10, 456)])
def test_a_box_holds_its_corners(d: int, points: int) -> None:
    lower, upper = np.arange(d) - 5.0, np.arange(d) + 1.0
    found = box_points(lower, upper, 200, random())
    assert found.shape == (points, d)
    assert np.all((found >= lower) & (found <= upper))
    rows = {tuple(row) for row in found}
    assert tuple(lower) in rows
    assert tuple(upper) in rows
    if d <= 4:
        corners = {
            row
            for row in rows
            if all(v in (a, b) for v, a, b in zip(row, lower, upper, strict=True))
        }
        assert len(corners) == 2**d


def test_the_same_points_are_looked_at_every_time(tmp_path: Path) -> None:
    first, second = (validate_expansions(scene_of(tmp_path, SHIPPED)) for _ in range(2))
    assert first == second


def test_a_tolerance_that_is_not_met_fails_only_its_rows(tmp_path: Path) -> None:
    text = changed(("max_error: 2 %", "max_error: 1.5 %"))
    rows = validate_expansions(scene_of(tmp_path, text))
    assert {row.where: row.passed for row in rows} == {
        TRAJECTORY: False,
        DESIGN_BOX: True,
        RANDOM_BOX: True,
    }


def test_a_negative_eigenvalue_is_infinitely_wrong(tmp_path: Path) -> None:
    text = changed(("max_error: 2 %", "max_error: 2 %\n  q_span: 1.5"))
    row = validate_expansions(scene_of(tmp_path, text))[2]
    assert (row.worst_taylor, row.worst_linearised) == (np.inf, np.inf)
    assert (row.rms_taylor, row.rms_linearised) == (np.inf, np.inf)
    assert not row.passed


def test_every_expanded_mode_has_its_rows(tmp_path: Path) -> None:
    rows = validate_expansions(scene_of(tmp_path, changed(("modes: [1]", "modes: [1, 2]"))))
    assert [(row.where, row.mode) for row in rows] == [
        (where, mode) for where in (TRAJECTORY, DESIGN_BOX, RANDOM_BOX) for mode in (1, 2)
    ]


def test_without_a_design_only_the_poses_count(tmp_path: Path) -> None:
    start, end = SHIPPED.index("design:"), SHIPPED.index("expansion:")
    text = (SHIPPED[:start] + SHIPPED[end:]).replace("  y: [0.125, 0.125]", "  y: []")
    rows = validate_expansions(scene_of(tmp_path, text))
    assert [row.where for row in rows] == [TRAJECTORY, RANDOM_BOX]
    assert all(row.worst_taylor == pytest.approx(row.worst_linearised, rel=1e-6) for row in rows)


def test_a_single_link_has_no_box_in_q(tmp_path: Path) -> None:
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
    assert [row.where for row in rows] == [TRAJECTORY, DESIGN_BOX]
    assert rows[0].worst_taylor < rows[1].worst_taylor  # the pose changes nothing, the mass does


def test_where_there_is_nothing_to_look_at_that_is_said(tmp_path: Path) -> None:
    with pytest.raises(CaseError, match="validation: nothing to validate"):
        validate_expansions(scene_of(tmp_path, MODE_ONLY_AT_A_POINT))
    spanned = MODE_ONLY_AT_A_POINT + "validation: {q_span: 0.1}\n"
    assert [row.where for row in validate_expansions(scene_of(tmp_path, spanned))] == [RANDOM_BOX]


def test_a_span_for_other_coordinates_is_refused(tmp_path: Path) -> None:
    text = changed(("max_error: 2 %", "max_error: 2 %\n  q_span: [0.1, 0.3, 0.2]"))
    with pytest.raises(CaseError, match="q_span"):
        validate_expansions(scene_of(tmp_path, text))


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
