"""Every charted method answers the same question, at the price it states."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes import SHIPPED, scene_of

import eigassign
import eigassign as ea
from eigassign.chart import methods as own
from eigassign.chart import rivals
from eigassign.chart.comparison import exact_frequencies
from eigassign.chart.methods import fit_methods
from eigassign.chart.question import EvaluationPoints, build_features, build_points
from eigassign.modal import FINE, NearestExpansion
from eigassign.modal.exact import solver
from eigassign.study import Scene


class Spy:
    """Counts the exact eigenproblems solved while it watches."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.solved = 0
        solve = solver.solve_dense

        def counted(pencil, theta, count, vectors):  # type: ignore[no-untyped-def]
            self.solved += theta.shape[1]
            return solve(pencil, theta, count, vectors)

        monkeypatch.setattr(solver, "solve_dense", counted)


def _methods(scene: Scene) -> Iterator[own.Method]:
    yield from own.series_methods(scene, [2], [3])
    yield from own.piecewise_methods(scene, [2], [3])
    yield from own.reduced_methods(scene, [0, 1, 2], [1, 3])


def _fits(arm: Scene, points: EvaluationPoints) -> Iterator[own.Method]:
    yield from fit_methods(arm, build_features(arm), points, [1e-3], [(2, 1)], 1000)


def test_methods_solve_exactly_as_often_as_they_say(
    arm: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    for method in _methods(arm):
        with monkeypatch.context() as patch:
            spy = Spy(patch)
            method.build(np.zeros((0, 1)))
            assert spy.solved == method.solves, method.name


def test_evaluating_solves_nothing_exactly(
    arm: Scene, points: EvaluationPoints, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = [method.build(np.zeros((0, 1))) for method in _methods(arm)]
    spy = Spy(monkeypatch)
    for evaluate in made:
        assert evaluate(points).shape == (len(points.x), 1)
    assert spy.solved == 0


def test_fits_solve_as_often_as_they_say_and_are_as_accurate_as_asked(
    arm: Scene, points: EvaluationPoints, monkeypatch: pytest.MonkeyPatch
) -> None:
    hz = exact_frequencies(arm, points.x)
    for method in _fits(arm, points):
        with monkeypatch.context() as patch:
            spy = Spy(patch)
            made: Any = method.build(np.zeros((0, 1)))
            looked = 9 * sum(
                f.error_estimate < FINE for f in made.fits
            )  # round-off: scaled 8 times
            assert spy.solved == made.solves + looked, method.name
            asked = points.runs() if method.per_design else points
            found = made(asked)
            assert spy.solved == made.solves + looked
        off = float(np.abs(found / hz[-len(found) :] - 1.0).max())
        assert off <= method.parameters.get("accuracy", max(f.error_estimate for f in made.fits))
        assert method.parameters.get("solves", 0) * len(made.fits) in (0, made.solves)


def test_all_exact_solvers_agree(arm: Scene, points: EvaluationPoints) -> None:
    hz = exact_frequencies(arm, points.x)
    for method in (
        *own.exact_methods(arm.model, (1,), None),
        rivals.dense_by_scipy(arm.model, (1,), 9),
    ):
        found = method.build(np.zeros((0, 1)))(points)
        np.testing.assert_allclose(found, hz, rtol=1e-10)


def test_several_modes_have_a_column_each(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, SHIPPED.replace("modes: [1]", "modes: [1, 2]"))
    features = build_features(scene)
    points = build_points(scene, features, 10, 2, 5)
    exact_hz = exact_frequencies(scene, points.x)
    assert exact_hz.shape == (20, 2)
    rivals_too = rivals.surrogate_methods(features, [27])
    for method in (*_methods(scene), *rivals_too, *rivals.grid_methods(features, [4])):
        x = np.zeros((0, 4)) if method.train is None else method.train(points)
        assert method.build(exact_frequencies(scene, x))(points).shape == (20, 2)


def _asked(use: str, scene: Scene, how: dict[str, Any], y: np.ndarray) -> Any:
    """What the call gives, with the names that it uses."""
    features = build_features(scene)
    q0 = how.get("q0", how.get("q"))
    y0 = how.get("y0", how.get("y"))
    known = {
        "ea": ea, "eigassign": eigassign, "model": scene.model, "q": scene.path.q, "y": y,
        "lower": features.lower, "upper": features.upper, "designs": y[None], "q0": q0, "y0": y0,
    }  # fmt: skip
    return eval(use, known)


def test_calls_give_what_was_charted(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, SHIPPED.replace("modes: [1]", "modes: [1, 2]"))
    points = build_points(scene, build_features(scene), 4, 2, 200)
    y, whole = points.y[4], slice(4, 4 + len(scene.path.q))
    fits = fit_methods(scene, build_features(scene), points, [1e-2], [(2, 1)], 150)
    for method in (*_methods(scene), *fits):
        few = method.parameters.get("solves", 7) not in (7, 120)
        if few or method.use.startswith("in the case file"):
            continue
        wanted = method.build(np.zeros((0, 2)))(points.runs() if method.per_design else points)
        wanted = wanted[: whole.stop - 4] if method.per_design else wanted[whole]
        call = method.use.removeprefix("no argument of ea.reduce: ").partition(", at a pose")[0]
        found = _asked(call, scene, dict(method.parameters), y)
        if isinstance(found, list):
            found = NearestExpansion(tuple(found))
        if not isinstance(found, np.ndarray):
            found = found.frequencies(scene.path.q, y)
        np.testing.assert_allclose(found.reshape(wanted.shape), wanted, rtol=1e-9)


def test_a_call_allows_as_many_frequencies_as_its_chart_did(
    arm: Scene, points: EvaluationPoints
) -> None:
    made = {
        most: list(fit_methods(arm, build_features(arm), points, [1e-3], [], most))
        for most in (1500, 5000)
    }
    over = {most: next(m for m in each if m.name == "fit 1e-03") for most, each in made.items()}
    assert over[1500].parameters == {"accuracy": 1e-3, "most": 1500}
    assert "most" not in over[1500].use
    assert over[5000].use.endswith("accuracy=0.001, most=5000).along(designs)")
    along = next(m for m in made[5000] if m.name == "fit 1e-03 along")
    assert along.parameters["most"] == 2000
