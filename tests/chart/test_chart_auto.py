"""What auto takes, charted: the very choice of a run, and within what it promised."""

from __future__ import annotations

from pathlib import Path

import pytest
from chart_scenes import TINY
from scenes import SHIPPED, scene_of

from eigassign.chart.comparison import Bench, MethodComparison, chart_methods, exact_frequencies
from eigassign.chart.front import beside_auto
from eigassign.chart.methods import auto_methods, auto_orders, exact_methods
from eigassign.chart.question import build_features, build_points
from eigassign.chart.results import Advice
from eigassign.modal.adaptive import order as expansion_choice
from eigassign.study import Scene

CASES = Path(__file__).parents[2] / "cases"


def test_it_is_what_a_run_takes(arm: Scene, tmp_path: Path) -> None:
    (taken,), _ = auto_orders(arm, [1e-4], 1e9)
    order = next(line for line in SHIPPED.splitlines(True) if line.startswith("  order: 4"))
    text = SHIPPED.replace(order, "  order: auto\n  accuracy: 1e-4\n")
    assert taken.choice is not None
    assert scene_of(tmp_path, text).expansions.order == taken.choice.order
    assert taken.method == f"Taylor {taken.choice.order} full"


def test_it_is_charted_and_as_accurate_as_promised(compared: MethodComparison) -> None:
    known = {p.method: p for p in compared.points}
    charted = [a for a in compared.advice if a.auto is not None and a.auto.method]
    assert len(charted) >= 2
    for advice in charted:
        assert advice.auto is not None
        assert advice.accuracy is not None
        point = known[str(advice.auto.method)]
        assert point.everywhere.worst_relative <= advice.accuracy
        assert advice.auto.total_s == point.total_s(advice.evaluations)
        assert f"`expansion.order: auto` takes {point.method}" in advice.words


def test_a_refusal_is_given_in_words(
    arm: Scene, compared: MethodComparison, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(expansion_choice, "MOST_TERMS", 50)
    autos, _ = auto_orders(arm, [1e-8], 1e9)
    given = next(a for a in compared.advice if a.accuracy == 1e-8)
    advice = beside_auto(given, compared.points, autos)
    assert advice.auto is not None
    assert advice.auto.method is None
    assert advice.auto.refused.startswith("no expansion of order up to 4 at up to 32 points")
    assert f"`expansion.order: auto` refuses: {advice.auto.refused}" in advice.words


def test_below_round_off_nothing_is_said_of_it(arm: Scene, compared: MethodComparison) -> None:
    taken, _ = auto_orders(arm, [1e-2], 1e9)
    below = Advice("accuracy", 1e-2, None, 1.0, None, {}, None, None, "words", True)
    assert beside_auto(below, compared.points, taken) == below


def test_a_choice_that_took_long_is_the_last(arm: Scene) -> None:
    taken, (note,) = auto_orders(arm, [1e-3, 1e-2, 1e-6], 0.0)
    assert [t.accuracy for t in taken] == [1e-2]
    assert note.startswith("what auto takes is not charted from 1e-03 on")


def test_choices_at_several_points_are_charted_as_they_are_evaluated(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(expansion_choice, "MOST_TERMS", 200)
    text = SHIPPED.replace("max: 250 g", "max: 1 g").replace("  y: [0.125, 0.125]", "  y: [0, 0]")
    scene = scene_of(tmp_path, text)
    taken, _ = auto_orders(scene, [1e-8], 1e9)
    assert taken[0].choice is not None
    assert taken[0].choice.more_q
    (method,) = auto_methods(scene, taken)
    features = build_features(scene)
    points = build_points(scene, features, 30, 2, 9)
    hz = exact_frequencies(scene, points.x)
    bench = Bench(scene, points, hz, TINY.patience, points.whole_runs(features))
    exact = exact_methods(scene.model, (1,), 1)
    (_, _, point), _ = chart_methods(bench, [*exact, method], 0.0, lambda line: None)
    assert point.everywhere.worst_relative <= 1e-8
    assert point.parameters["q0"].shape == (1 + len(taken[0].choice.more_q), 2)
