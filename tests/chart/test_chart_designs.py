"""Ways to a design end where they should, and gradients are what they say."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from chart_scenes import TINY
from scenes import SHIPPED, changed, scene_of

from eigassign.chart.designs import (
    SearchRecord,
    SpentError,
    UnitLimits,
    by_evolution,
    by_slsqp,
    chart_designs,
    design_task,
)
from eigassign.modal.slopes import eigenvalue_slopes
from eigassign.study.scene import Scene


def test_the_objective_has_the_slope_it_says(arm: Scene) -> None:
    task = design_task(arm, TINY, 1e-4)
    width = task.box[1]

    def at(y: np.ndarray) -> tuple[float, np.ndarray]:
        x = arm.model.x(task.q, y)
        lam, slopes = eigenvalue_slopes(arm.model.pencil, x, 1, np.append([0.0, 0.0], width))
        return task.objective(lam), task.slope(lam, slopes[..., 2:])

    y = np.array([0.1, 0.05])
    _, slope = at(y)
    for j in range(2):
        step = 1e-5 * np.eye(2)[j]
        difference = (at(y + step)[0] - at(y - step)[0]) / 2e-5
        assert slope[j] == pytest.approx(difference, rel=1e-6)


def test_ways_to_a_design_reach_the_exact_optimum_or_say_that_they_stopped(arm: Scene) -> None:
    runs, notes = chart_designs(arm, TINY, 1e-4, lambda line: None)
    assert not notes
    by_name = {run.method: run for run in runs}
    for name in ("SLSQP, analytic gradient", "programs in a row on reduced m = 2, 1 point"):
        assert by_name[name].excess < 1e-9, name
        assert by_name[name].design == pytest.approx((0.23984584, 0.0), abs=1e-6)
    one = by_name["program on the expansion"]
    assert one.design == pytest.approx((0.22868471, 0.0), abs=1e-7)  # that of `optimize`
    assert one.max_relative == pytest.approx(0.01548, abs=1e-5)
    assert one.excess == pytest.approx(0.0199, abs=1e-3)
    assert by_name["differential evolution"].note.startswith("stopped")
    for run in runs:
        values = [value for _, value in run.trace]
        assert values == sorted(values, reverse=True)
        lower, upper = arm.bounds
        assert np.all((np.array(run.design) >= lower) & (np.array(run.design) <= upper))


def test_linear_constraints_bind_every_way(tmp_path: Path) -> None:
    limited = changed(
        (
            "\nexpansion:",
            "\n  constraints: {all: {terms: {m1: 1, m2: 1}, max: 200 g}}\n\nexpansion:",
        )
    )
    runs, _ = chart_designs(scene_of(tmp_path, limited), TINY, 1e-4, lambda line: None)
    for run in runs:
        assert sum(run.design) <= 0.2 + 1e-6, run.method
    assert {run.method for run in runs if run.excess < 1e-6} >= {"SLSQP, analytic gradient"}


def test_a_long_trajectory_is_thinned_where_solves_are_dear(arm: Scene) -> None:
    dear = design_task(arm, TINY, TINY.searched_s)
    assert len(dear.rows) == 5
    assert dear.rows[[0, -1]].tolist() == [0, 151]


def test_a_case_without_targets_has_no_designs(tmp_path: Path) -> None:
    start, end = SHIPPED.index("targets:"), SHIPPED.index("validation:")
    scene = scene_of(tmp_path, SHIPPED[:start] + SHIPPED[end:])
    assert chart_designs(scene, TINY, 1e-4, lambda line: None) == ((), ())


def bowl(v: np.ndarray) -> tuple[float, np.ndarray]:
    off = v - np.array([0.3, 0.8])
    return float(off @ off) + 1e-3, 2.0 * off


FREE = UnitLimits(np.zeros((0, 2)), np.zeros(0), np.zeros(0))


def test_a_search_ends_when_its_evaluations_are_used_up() -> None:
    record = SearchRecord(bowl, FREE, 3)
    with pytest.raises(SpentError):
        by_evolution(record, np.array([0.5, 0.5]))
    assert record.calls == 3
    with pytest.raises(SpentError):
        record(np.zeros(2))


def test_a_design_that_breaks_a_limit_is_never_the_best() -> None:
    limits = UnitLimits(np.array([[1.0, 1.0]]), np.array([-np.inf]), np.array([0.5]))
    record = SearchRecord(bowl, limits, 100)
    by_slsqp(record, np.array([0.1, 0.1]), analytic=True)
    assert record.design == pytest.approx(np.array([0.0, 0.5]), abs=1e-6)
