"""What is timed, and what a chart of the shipped arm shows."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes import HEAD, scene_of

from eigassign.chart import comparison, rivals
from eigassign.chart import methods as own
from eigassign.chart.comparison import (
    Bench,
    MethodComparison,
    errors,
    exact_frequencies,
    timed_batch,
)
from eigassign.chart.question import EvaluationPoints, build_features, build_points
from eigassign.chart.surrogates import KINDS, tensor_interpolation
from eigassign.chart.timing import Patience
from eigassign.errors import CaseError
from eigassign.modal import expand
from eigassign.study import Scene


def test_what_is_solved_anew_is_timed_by_whole_trajectories(
    arm: Scene, points: EvaluationPoints
) -> None:
    features = build_features(arm)
    hz = exact_frequencies(arm, points.x)
    bench = Bench(arm, points, hz, Patience(), points.whole_runs(features))
    fits = own.fit_methods(arm, features, points, [1e-3], [(2, 1)], 1000)
    for method in (*fits, *own.exact_methods(arm.model, (1,), 4)):
        evaluator = method.build(np.zeros((0, 1)))
        own_points = points.head(method.most or len(points.x))
        many, _ = timed_batch(bench, method, evaluator, own_points)
        if method.most:
            assert len(many.x) == 4
        elif method.per_design:
            assert len(many.x) == 2 * 152


def test_what_a_call_costs_by_itself_does_not_keep_a_method_from_large_batches(
    arm: Scene, points: EvaluationPoints, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = Bench(arm, points, points.x, Patience(), points.whole_runs(build_features(arm)))
    (method, *_) = own.series_methods(arm, [], [1])

    def asked(each_s: float, call_s: float) -> int:
        def spent(job: Any) -> tuple[object, float]:
            found = job()
            return found, call_s + each_s * len(found)

        monkeypatch.setattr(comparison, "timed", spent)
        return len(timed_batch(bench, method, lambda points: points.x, points)[0].x)

    assert asked(0.0, 1e-3) >= 32768
    assert asked(1e-7, 1e-3) >= 32768
    assert asked(1e-3, 0.0) == len(points.runs().x)


def test_stations_are_interpolated_for_every_design_alike(
    arm: Scene, points: EvaluationPoints
) -> None:
    features, runs = build_features(arm), points.runs()
    f = np.random.default_rng(1).random((points.designs * 5, 2))
    for method, kind in zip(rivals.station_methods(features, [5], 2), KINDS, strict=True):
        each = zip(f.reshape(-1, 5, 2), np.split(runs.u, points.designs), strict=True)
        wanted = np.vstack([tensor_interpolation(kind, 5, 1, own)(u[:, :1]) for own, u in each])
        np.testing.assert_allclose(method.build(f)(runs), wanted, atol=1e-12)


def test_errors_count_what_gives_no_number_as_infinitely_wrong() -> None:
    found = errors(np.array([[1.0], [np.nan], [4.0]]), np.array([[1.0], [2.0], [2.0]]))
    assert (found.worst_hz, found.failed, found.samples) == (np.inf, 1, 3)
    found = errors(np.array([[1.0], [4.0]]), np.array([[1.0], [2.0]]))
    assert found.worst_hz == 2.0
    assert found.rms_hz == pytest.approx(2.0**0.5)
    assert found.worst_relative == 1.0


def test_every_method_of_a_chart_has_numbers_and_a_name_of_its_own(
    compared: MethodComparison,
) -> None:
    names = [p.method for p in compared.points]
    assert len(set(names)) == len(names)
    assert not compared.skipped
    for p in compared.points:
        assert (p.estimate is not None) == p.method.startswith("fit "), p.method
        assert np.isfinite(p.everywhere.worst_hz), p.method
        assert p.everywhere.rms_hz <= p.everywhere.worst_hz
        assert p.online.median_s > 0.0
        assert p.trajectory is not None or p.solves_online == 1.0


def test_a_chart_shows_what_is_known_of_the_arm(compared: MethodComparison) -> None:
    by_name = {p.method: p for p in compared.points}
    worst = {name: p.everywhere.worst_relative for name, p in by_name.items()}
    assert worst["Taylor 4 full"] < worst["Taylor 2 full"] < worst["Taylor 1 full"] < 0.03
    assert worst["1/λ 4 full"] < worst["Taylor 4 full"]
    assert worst["reduced m = 2, 1 point"] < 1e-9
    assert worst["grid Chebyshev 4"] < worst["grid linear 4"]
    assert by_name["stations cubic 5"].random is None
    assert by_name["stations cubic 5"].solves_online == pytest.approx(5 / 152)
    assert by_name["grid linear 4"].solves == 64


def test_fronts_and_advice_are_made_of_charted_methods(compared: MethodComparison) -> None:
    names = {p.method for p in compared.points}
    assert {f.evaluations for f in compared.fronts} == {152.0, 152000.0, 1e4, None}
    for each in compared.fronts:
        assert set(each.methods) <= names
        if each.evaluations is None:
            assert not any(name.startswith("stations") for name in each.methods)
    assert {a.asked for a in compared.advice} == {"accuracy", "budget"}
    assert all(a.method in names for a in compared.advice if a.method)


def test_a_point_can_be_computed_again_from_its_parameters(
    arm: Scene, compared: MethodComparison
) -> None:
    features, asked = build_features(arm), compared.asked
    points = build_points(
        arm, features, asked.random_points, asked.designs, asked.samples_per_design, asked.seed
    )
    hz = exact_frequencies(arm, points.x)
    for p in compared.points:
        if p.family in ("Taylor, full", "Taylor, linearised"):
            how = p.parameters
            made = expand(
                arm.model.pencil, how["q0"], how["y0"], asked.modes, how["order"],
                how["linear_in_y"],
            )  # fmt: skip
            off = np.abs(made.frequencies(points.q, points.y) - hz).max()
            assert off == pytest.approx(p.everywhere.worst_hz, rel=1e-9)


def test_a_case_without_trajectory_cannot_be_charted(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, HEAD + "expansion: {q: [1.8, 5.3]}\n")
    with pytest.raises(CaseError, match="trajectory"):
        build_features(scene)
