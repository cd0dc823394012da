"""Ways to a design end where they should, and gradients are what they say."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from chart_scenes import TINY
from scenes import SHIPPED, changed, scene_of

from eigassign.assignment import time_weights
from eigassign.chart import DesignRun, chart_designs
from eigassign.study import Scene

CASES = Path(__file__).parents[2] / "cases"


def ways(
    scene: Scene, objectives: int = TINY.objectives
) -> tuple[dict[str, DesignRun], tuple[str, ...]]:
    effort = replace(TINY, objectives=objectives)
    runs, notes = chart_designs(scene, effort, 1e-4, lambda line: None)
    return {run.method: run for run in runs}, notes


def test_ways_to_a_design_reach_the_exact_optimum_or_say_that_they_stopped(arm: Scene) -> None:
    runs, notes = ways(arm)
    assert not notes
    assert len(runs) == 6
    for name in ("sequential", "sequential, several starts", "SLSQP, analytic gradient"):
        assert runs[name].excess < 1e-8, name
        assert runs[name].rms_relative == pytest.approx(0.0129627, abs=5e-8)
        assert runs[name].design == pytest.approx((0.2384, 0.0), abs=1e-4)
    one = runs["one shot"]
    assert one.design == pytest.approx((0.22868471, 0.0), abs=1e-7)
    assert one.max_relative == pytest.approx(0.01548, abs=1e-5)
    assert runs["differential evolution"].note.startswith("stopped")
    assert runs["differential evolution"].parameters["evaluations"] == TINY.objectives
    lower, upper = arm.bounds
    for run in runs.values():
        values = [value for _, value in run.trace]
        assert values == sorted(values, reverse=True)
        assert np.all((np.array(run.design) >= lower) & (np.array(run.design) <= upper))


def test_a_search_that_is_timed_again_solves_again(arm: Scene) -> None:
    """The problem that a design is sought with remembers what it has solved."""
    seconds = []
    for repeats in (0, 3):
        effort = replace(TINY, objectives=1, repeats=repeats, repeat_s=10.0)
        (run,) = [r for r in chart_designs(arm, effort, 1e-4, print)[0] if r.method == "sequential"]
        seconds.append(run.seconds.median_s)
    assert run.seconds.repeats == 3
    assert seconds[1] > 0.5 * seconds[0]  # 0.22 of it where answers were remembered


def test_linear_constraints_bind_every_way_on_few_samples_where_solves_are_dear(
    tmp_path: Path,
) -> None:
    limit = "\n  constraints: {all: {terms: {m1: 1, m2: 1}, max: 200 g}}\n\nexpansion:"
    scene = scene_of(tmp_path, changed(("\nexpansion:", limit)))
    effort = replace(TINY, most_s=30.0)
    runs, notes = chart_designs(scene, effort, 0.1, lambda line: None)
    assert notes == (
        "searches of a design see 7 of 152 samples, because an exact solve takes long",
    )
    for run in runs:
        assert sum(run.design) <= 0.2 + 1e-6, run.method
    best = {run.method for run in runs if run.excess < 1e-6}
    assert best >= {"sequential", "SLSQP, analytic gradient"}


def test_the_objective_weighs_targets_by_weight_and_time(tmp_path: Path) -> None:
    """Five bars on two trajectories."""
    text, target = (CASES / "five_bar.yaml").read_text(), "- {mode: 1, frequency: 27 Hz}"
    assert target in text
    more = target.replace("Hz}", "Hz, trajectory: cut}")
    more += "\n  - {mode: 1, frequency: 26 Hz, weight: 3, trajectory: return}"
    scene = scene_of(tmp_path, text.replace(target, more))
    w = np.concatenate([np.full(7, 1.0), np.full(7, 3.0)]) * time_weights(scene.path)
    for run in ways(scene, 3)[0].values():
        hz = scene.model.frequencies(scene.path.q, np.array(run.design), 1)[:, 0]
        off = hz / np.repeat([27.0, 26.0], 7) - 1.0
        assert run.objective == pytest.approx(w @ off**2 / w.sum(), rel=1e-9)


def test_a_case_without_targets_has_no_designs(tmp_path: Path) -> None:
    start, end = SHIPPED.index("targets:"), SHIPPED.index("validation:")
    assert ways(scene_of(tmp_path, SHIPPED[:start] + SHIPPED[end:])) == ({}, ())
