from pathlib import Path

import numpy as np
import pytest
from scenes import HEAD, SHIPPED, changed, scene_of

from eigassign.study import grid_over, q_grid, study_modes


def test_a_map_holds_at_each_point_what_a_solve_there_gives(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, SHIPPED)
    (study,) = study_modes(scene).rows
    chart = study.over_design
    assert chart is not None
    assert (chart.names, chart.units) == (("m1", "m2"), ("kg", "kg"))
    for i, k in ((0, 0), (0, 12), (12, 0), (5, 7)):
        y = [chart.axes[0][i], chart.axes[1][k]]
        exact = scene.model.frequencies(scene.q0, y, 1)[0, 0]
        assert chart.values.exact_hz[i, k] == pytest.approx(exact, rel=1e-12)
        taylor = scene.expansions.full.frequencies(scene.q0, y)[0, 0]
        assert chart.values.taylor_hz[i, k] == pytest.approx(taylor, rel=1e-12)
    assert chart.axes[0][[0, -1]].tolist() == [0.0, 0.25]


def test_the_map_over_q_moves_the_elbow_over_what_it_travels(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, SHIPPED)
    chart = study_modes(scene).rows[0].over_q
    assert chart is not None
    assert (chart.names, chart.units) == (("q2",), ("rad",))
    travelled = scene.path.q[:, 1] - scene.path.q[:, 0]
    elbow = chart.axes[0] - scene.q0[0]
    np.testing.assert_allclose([elbow[0], elbow[-1]], [travelled.min(), travelled.max()])


def test_variables_without_room_are_left_out_of_a_map(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, SHIPPED)
    low, high = np.array([0.0, 1.0, 2.0]), np.array([1.0, 1.0, 5.0])
    grid = grid_over(scene, (0, 1, 3), low, high)
    assert grid is not None
    assert (grid.names, grid.units, grid.shape) == (("q1", "m2"), ("rad", "kg"), (13, 13))
    assert grid.points()[:, 1].tolist() == [5.312] * 169
    assert grid.points()[-1].tolist() == [1.0, 5.312, 0.125, 5.0]
    assert grid_over(scene, (0, 1, 3), low, low) is None


def test_the_expansion_point_is_on_the_map_even_if_the_path_misses_it(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, changed(("q: [1.817, 5.312]", "q: [1.817, 4.8]")))
    grid = q_grid(scene)
    assert grid is not None
    assert grid.axes[0][0] == 4.8


def test_without_trajectory_and_design_there_is_nothing_to_map(tmp_path: Path) -> None:
    (study,) = study_modes(scene_of(tmp_path, HEAD + "expansion: {q: [1.8, 5.2]}\n")).rows
    assert (study.over_time, study.over_design, study.over_q) == (None, None, None)
