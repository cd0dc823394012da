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
from eigassign.study import Scene


def test_the_objective_has_the_slope_it_says(arm: Scene) -> None:
    task, y = design_task(arm, TINY, 1e-4), np.array([0.1, 0.05])
    value, slope = task.with_slope(y)
    assert value == pytest.approx(task.objective(y), rel=1e-9)
    for j in range(2):
        step = 1e-5 * np.eye(2)[j]
        difference = (task.objective(y + step) - task.objective(y - step)) / 2e-5
        assert slope[j] == pytest.approx(difference, rel=1e-6)


def test_ways_to_a_design_reach_the_exact_optimum_or_say_that_they_stopped(arm: Scene) -> None:
    runs, notes = chart_designs(arm, TINY, 1e-4, lambda line: None)
    assert not notes
    by_name = {run.method: run for run in runs}
    for name in ("sequential", "sequential, several starts", "SLSQP, analytic gradient"):
        assert by_name[name].excess < 1e-8, name
        assert by_name[name].rms_relative == pytest.approx(0.0129627, abs=5e-8)
        assert by_name[name].design == pytest.approx((0.2384, 0.0), abs=1e-4)
    one = by_name["one shot"]
    assert one.design == pytest.approx((0.22868471, 0.0), abs=1e-7)
    assert one.max_relative == pytest.approx(0.01548, abs=1e-5)
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
    assert {run.method for run in runs if run.excess < 1e-6} >= {
        "sequential",
        "SLSQP, analytic gradient",
    }


def test_a_long_trajectory_is_thinned_where_solves_are_dear(arm: Scene) -> None:
    dear = design_task(arm, TINY, TINY.searched_s)
    q = dear.scene.path.q
    assert len(q) == 5
    np.testing.assert_array_equal(q[[0, -1]], arm.path.q[[0, -1]])


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
