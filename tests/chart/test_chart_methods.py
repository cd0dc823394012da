"""Every charted method answers the same question, at the price it states."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chart_scenes import TINY
from scenes import SHIPPED, scene_of

import eigassign
import eigassign as ea
from eigassign.chart import methods as own
from eigassign.chart import rivals
from eigassign.chart import study as chart_bench
from eigassign.chart.methods import fit_methods
from eigassign.chart.question import Points, build_features, build_points
from eigassign.chart.rivals import along, chebyshev, equal_nodes
from eigassign.chart.study import (
    Bench,
    Compared,
    Wish,
    _batch,
    compare_methods,
    errors,
    exact_frequencies,
)
from eigassign.chart.timing import Patience
from eigassign.errors import CaseError
from eigassign.modal.exact import solver
from eigassign.modal.expansion import expand, nearest
from eigassign.modal.fit.fit import FINE
from eigassign.study.scene import Scene


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    return scene_of(tmp_path_factory.mktemp("arm"), SHIPPED)


@pytest.fixture(scope="module")
def points(scene: Scene) -> Points:
    return build_points(scene, build_features(scene), 25, 2, 7)


@pytest.fixture(scope="module")
def compared(scene: Scene) -> Compared:
    return compare_methods(scene, TINY, Wish(budget_s=10.0, evaluations=1e4), lambda line: None)


class Spy:
    """Counts the exact eigenproblems solved while it watches."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.solved = 0
        solve = solver._solve

        def counted(pencil, theta, count, vectors):  # type: ignore[no-untyped-def]
            self.solved += theta.shape[1]
            return solve(pencil, theta, count, vectors)

        monkeypatch.setattr(solver, "_solve", counted)


def _methods(scene: Scene) -> Iterator[own.Method]:
    yield from own.taylor_methods(scene, [2], [3])
    yield from own.reciprocal_methods(scene, [2])
    yield from own.piecewise_methods(scene, [2], [3])
    yield from own.reduced_methods(scene, [0, 1, 2], [1, 3])


def _fits(scene: Scene, points: Points) -> Iterator[own.Method]:
    yield from fit_methods(scene, build_features(scene), points, [1e-3], [(2, 1)], 1000)


def test_methods_solve_exactly_as_often_as_they_say(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    for method in _methods(scene):
        with monkeypatch.context() as patch:
            spy = Spy(patch)
            method.fit(np.zeros((0, 1)))
            assert spy.solved == method.solves, method.name


def test_evaluating_solves_nothing_exactly(
    scene: Scene, points: Points, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = [method.fit(np.zeros((0, 1))) for method in _methods(scene)]
    spy = Spy(monkeypatch)
    for evaluate in made:
        assert evaluate(points).shape == (len(points.x), 1)
    assert spy.solved == 0


def test_fits_solve_as_often_as_they_say_and_are_as_accurate_as_asked(
    scene: Scene, points: Points, monkeypatch: pytest.MonkeyPatch
) -> None:
    hz = exact_frequencies(scene, points.x)
    for method in _fits(scene, points):
        with monkeypatch.context() as patch:
            spy = Spy(patch)
            made: Any = method.fit(np.zeros((0, 1)))
            looked = sum(f.error_estimate < FINE for f in made.fits)  # at round-off, once each
            assert spy.solved == made.solves + looked, method.name
            asked = points.runs() if method.per_design else points
            found = made(asked)
            assert spy.solved == made.solves + looked
        off = float(np.abs(found / hz[-len(found) :] - 1.0).max())
        assert off <= method.parameters.get("accuracy", max(f.error_estimate for f in made.fits))
        assert method.parameters.get("solves", 0) * len(made.fits) in (0, made.solves)


def test_all_exact_solvers_agree(scene: Scene, points: Points) -> None:
    hz = exact_frequencies(scene, points.x)
    for method in (
        *own.exact_methods(scene.model, (1,), None),
        rivals.lapack(scene.model, (1,), 9),
    ):
        found = method.fit(np.zeros((0, 1)))(points)
        np.testing.assert_allclose(found, hz, rtol=1e-10)


def test_several_modes_have_a_column_each(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, SHIPPED.replace("modes: [1]", "modes: [1, 2]"))
    features = build_features(scene)
    points = build_points(scene, features, 10, 2, 5)
    exact_hz = exact_frequencies(scene, points.x)
    assert exact_hz.shape == (20, 2)
    rivals_too = rivals.surrogate_methods(features, [27], [27])
    for method in (*_methods(scene), *rivals_too, *rivals.grid_methods(features, [4])):
        x = method.train(points)
        assert method.fit(exact_frequencies(scene, x) if len(x) else x)(points).shape == (20, 2)


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
        wanted = method.fit(np.zeros((0, 2)))(points.runs() if method.per_design else points)
        wanted = wanted[: whole.stop - 4] if method.per_design else wanted[whole]
        call = method.use.removeprefix("no argument of ea.reduce: ").partition(", at a pose")[0]
        found = _asked(call, scene, dict(method.parameters), y)
        if isinstance(found, list):
            owner = nearest(found, scene.path.q)
            each = np.array([one.frequencies(scene.path.q, y) for one in found])
            found = each[owner, np.arange(len(owner))]
        elif not isinstance(found, np.ndarray):
            found = found.frequencies(scene.path.q, y)
        np.testing.assert_allclose(found.reshape(wanted.shape), wanted, rtol=1e-9)


def test_a_call_allows_as_many_frequencies_as_its_chart_did(scene: Scene, points: Points) -> None:
    made = {
        most: list(fit_methods(scene, build_features(scene), points, [1e-3], [], most))
        for most in (1500, 5000)
    }
    over = {most: next(m for m in each if m.name == "fit 1e-03") for most, each in made.items()}
    assert over[1500].parameters == {"accuracy": 1e-3, "most": 1500}
    assert "most" not in over[1500].use
    assert over[5000].use.endswith("accuracy=0.001, most=5000).along(designs)")
    along = next(m for m in made[5000] if m.name == "fit 1e-03 along")
    assert along.parameters["most"] == 2000


def test_what_is_solved_anew_is_timed_by_whole_trajectories(scene: Scene, points: Points) -> None:
    features = build_features(scene)
    hz = exact_frequencies(scene, points.x)
    bench = Bench(scene, points, hz, Patience(), points.whole(features))
    for method in (*_fits(scene, points), *own.exact_methods(scene.model, (1,), 4)):
        evaluator = method.fit(np.zeros((0, 1)))
        own_points = points.head(method.most or len(points.x))
        many, _ = _batch(bench, method, evaluator, own_points)
        if method.most:
            assert len(many.x) == 4
        elif method.per_design:
            assert len(many.x) == 2 * 152


def test_what_a_call_costs_by_itself_does_not_keep_a_method_from_large_batches(
    scene: Scene, points: Points, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = Bench(scene, points, points.x, Patience(), points.whole(build_features(scene)))
    (method, *_) = own.taylor_methods(scene, [1], [])

    def asked(each_s: float, call_s: float) -> int:
        def spent(job: Any) -> tuple[object, float]:
            found = job()
            return found, call_s + each_s * len(found)

        monkeypatch.setattr(chart_bench, "timed", spent)
        return len(_batch(bench, method, lambda points: points.x, points)[0].x)

    assert asked(0.0, 1e-3) >= 32768
    assert asked(1e-7, 1e-3) >= 32768
    assert asked(1e-3, 0.0) == len(points.runs().x)


def test_stations_are_interpolated_for_every_design_alike(scene: Scene, points: Points) -> None:
    features, runs = build_features(scene), points.runs()
    f = np.random.default_rng(1).random((points.designs * 5, 2))
    linear, cubic, polynomial = rivals.trajectory_methods(features, [5], 2)
    for method, one in (
        (linear, lambda own: along(equal_nodes(5), own, False)),
        (cubic, lambda own: along(equal_nodes(5), own, True)),
        (polynomial, lambda own: chebyshev(5, 1, own)),
    ):
        each = zip(f.reshape(-1, 5, 2), np.split(runs.u, points.designs), strict=True)
        wanted = np.vstack([one(own)(u[:, :1]) for own, u in each])
        np.testing.assert_allclose(method.fit(f)(runs), wanted, atol=1e-12)


def test_errors_count_what_gives_no_number_as_infinitely_wrong() -> None:
    found = errors(np.array([[1.0], [np.nan], [4.0]]), np.array([[1.0], [2.0], [2.0]]))
    assert (found.worst_hz, found.failed, found.samples) == (np.inf, 1, 3)
    found = errors(np.array([[1.0], [4.0]]), np.array([[1.0], [2.0]]))
    assert found.worst_hz == 2.0
    assert found.rms_hz == pytest.approx(2.0**0.5)
    assert found.worst_relative == 1.0


def test_every_method_of_a_chart_has_numbers_and_a_name_of_its_own(compared: Compared) -> None:
    names = [p.method for p in compared.points]
    assert len(set(names)) == len(names)
    assert not compared.skipped
    for p in compared.points:
        assert (p.estimate is not None) == p.method.startswith("fit "), p.method
        assert np.isfinite(p.everywhere.worst_hz), p.method
        assert p.everywhere.rms_hz <= p.everywhere.worst_hz
        assert p.online.median_s > 0.0
        assert p.trajectory is not None or p.solves_online == 1.0


def test_a_chart_shows_what_is_known_of_the_arm(compared: Compared) -> None:
    by_name = {p.method: p for p in compared.points}
    worst = {name: p.everywhere.worst_relative for name, p in by_name.items()}
    assert worst["Taylor 4 full"] < worst["Taylor 2 full"] < worst["Taylor 1 full"] < 0.03
    assert worst["1/λ 4 full"] < worst["Taylor 4 full"]
    assert worst["reduced m = 2, 1 point"] < 1e-9
    assert worst["grid Chebyshev 4"] < worst["grid linear 4"]
    assert by_name["stations cubic 5"].random is None
    assert by_name["stations cubic 5"].solves_online == pytest.approx(5 / 152)
    assert by_name["grid linear 4"].solves == 64


def test_fronts_and_advice_are_made_of_charted_methods(compared: Compared) -> None:
    names = {p.method for p in compared.points}
    assert {f.evaluations for f in compared.fronts} == {152.0, 152000.0, 1e4, None}
    for each in compared.fronts:
        assert set(each.methods) <= names
        if each.evaluations is None:
            assert not any(name.startswith("stations") for name in each.methods)
    assert {a.asked for a in compared.advice} == {"accuracy", "budget"}
    assert all(a.method in names for a in compared.advice if a.method)


def test_a_point_can_be_computed_again_from_its_parameters(
    scene: Scene, compared: Compared
) -> None:
    features, asked = build_features(scene), compared.asked
    points = build_points(
        scene, features, asked.random_points, asked.designs, asked.samples_per_design, asked.seed
    )
    hz = exact_frequencies(scene, points.x)
    for p in compared.points:
        if p.family in ("Taylor, full", "Taylor, linearised"):
            how = p.parameters
            made = expand(
                scene.model.pencil, how["q0"], how["y0"], asked.modes, how["order"],
                how["linear_in_y"],
            )  # fmt: skip
            off = np.abs(made.frequencies(points.q, points.y) - hz).max()
            assert off == pytest.approx(p.everywhere.worst_hz, rel=1e-9)


def test_a_case_without_trajectory_cannot_be_charted(tmp_path: Path) -> None:
    from scenes import HEAD

    scene = scene_of(tmp_path, HEAD + "expansion: {q: [1.8, 5.3]}\n")
    with pytest.raises(CaseError, match="trajectory"):
        build_features(scene)
