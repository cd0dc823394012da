"""What a chart of the shipped arm shows: every method, at the price and with its error."""

from dataclasses import replace
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from chart_scenes import TINY
from scenes import HEAD, SHIPPED, scene_of

import eigassign
import eigassign as ea
from eigassign.chart import ACCURACIES, Chart, build_bench, build_question, compare_methods
from eigassign.errors import CaseError
from eigassign.modal import NearestExpansion
from eigassign.study import Scene

CASES = Path(__file__).parents[2] / "cases"
FAMILIES = {
    *("exact", "exact by others", "Taylor, full", "Taylor, linearised", "1/λ, full"),
    *("1/λ, linearised", "Taylor, several points", "reduced, 1 point"),
    "reduced, 3 points",
}


def test_every_method_has_numbers_and_a_name_of_its_own(compared: Chart) -> None:
    names = [p.method for p in compared.points]
    assert len(set(names)) == len(names)
    assert {p.family for p in compared.points} == FAMILIES
    assert not compared.skipped
    for p in compared.points:
        assert np.isfinite(p.everywhere.worst_hz), p.method
        assert p.everywhere.rms_hz <= p.everywhere.worst_hz
        assert p.online.median_s > 0.0
        assert p.trajectory is not None or p.solves_online == 1.0


def test_it_pays_from_where_both_costs_are_equal(compared: Chart) -> None:
    """Set-up and n evaluations cost as much as n exact solves by the quickest solver."""
    solvers = [p for p in compared.points if p.family.startswith("exact")]
    exact_s = min(p.online.median_s for p in solvers)
    for p in compared.points:
        quicker = p not in solvers and p.online.median_s < exact_s
        assert (p.break_even is not None) is quicker, p.method
        if p.break_even is not None:
            cost_s = p.offline.median_s + p.break_even * p.online.median_s
            assert cost_s == pytest.approx(p.break_even * exact_s, abs=1e-15), p.method


def test_what_gives_no_number_is_infinitely_wrong(tmp_path: Path) -> None:
    """A first order in masses of up to 2 kg: λ is below 0 where both are heavy."""
    scene = scene_of(tmp_path, SHIPPED.replace("max: 250 g", "max: 2 kg"))
    few = replace(TINY, orders=(1,), half_orders=(1,), expansion_points=(1,))
    made = compare_methods(scene, few, (0.5,), lambda line: None)
    (taylor,) = [p for p in made.points if p.method == "Taylor 1 full"]
    assert 0 < taylor.everywhere.failed < taylor.everywhere.samples
    assert taylor.everywhere.worst_hz == taylor.everywhere.rms_hz == np.inf
    assert not any("Taylor 1 full" in each.methods for each in made.fronts)


def test_a_chart_shows_what_is_known_of_the_arm(compared: Chart) -> None:
    by_name = {p.method: p for p in compared.points}
    worst = {name: p.everywhere.worst_relative for name, p in by_name.items()}
    assert worst["Taylor 4 full"] < worst["Taylor 2 full"] < worst["Taylor 1 full"] < 0.03
    assert worst["1/λ 4 full"] < worst["Taylor 4 full"]
    assert worst["reduced m = 2, 1 point"] < 1e-9
    solves = {
        "Taylor 2 full": 1, "Taylor 2 at 3 points": 3, "reduced m = 1, 1 point": 2,
        "reduced m = 2, 3 points": 9,
    }  # fmt: skip
    assert {name: by_name[name].solves for name in solves} == solves
    for name in ("exact dense", "exact dense, SciPy one by one"):
        assert by_name[name].everywhere.worst_hz == compared.asked.floor_hz < 1e-8


def test_fronts_and_advice_are_made_of_charted_methods(compared: Chart) -> None:
    names = {p.method for p in compared.points}
    assert {f.evaluations for f in compared.fronts} == {152.0, 152000.0, None}
    for each in compared.fronts:
        assert set(each.methods) <= names
    assert all(a.method in names for a in compared.advice if a.method)
    orders = {p.key: p for p in compared.points if p.key}
    assert set(orders) == {"order: 1", "order: 2", "order: 4"}
    for advice in compared.advice:
        if advice.key in orders:
            assert orders[advice.key].everywhere.worst_relative <= advice.accuracy
            assert f"write `{advice.key}` under `expansion`" in advice.words
    assert {a.key for a in compared.advice if a.accuracy == 1e-2} == {"order: 2"}


def test_a_use_gives_the_method_with_the_errors_that_were_charted(
    arm: Scene, compared: Chart
) -> None:
    question = build_question(build_bench(arm, TINY))
    points, exact = question.points, question.exact_hz
    for p in compared.points:
        how: dict[str, Any] = dict(p.parameters)
        known = {
            "ea": ea, "eigassign": eigassign, "model": arm.model,
            "q0": how.get("q0", how.get("q")), "y0": how.get("y0", how.get("y")),
        }  # fmt: skip
        call = p.use.partition(", at a pose")[0]
        if not call:
            assert p.key or not p.ours or p.family == "exact", p.method
            continue
        made = eval(call, known)
        made = NearestExpansion(tuple(made)) if isinstance(made, list) else made
        off = np.abs(made.frequencies(points.q, points.y) - exact).max()
        assert off == pytest.approx(p.everywhere.worst_hz, rel=1e-6, abs=1e-10), p.method


def test_several_modes_on_several_trajectories_are_charted_too(tmp_path: Path) -> None:
    text = (CASES / "five_bar.yaml").read_text()
    scene = scene_of(tmp_path, text.replace("modes: [1]", "modes: [1, 2]"))
    few = replace(TINY, orders=(2,), half_orders=(1,), expansion_points=(1,))
    made = compare_methods(scene, few, (1e-3,), lambda line: None)
    assert made.asked.modes == scene.expansions.modes
    assert {p.family for p in made.points} >= {"exact", "Taylor, full", "reduced, 1 point"}
    for p in made.points:
        assert p.everywhere.failed == 0, p.method


def test_no_set_up_may_take_too_long(arm: Scene) -> None:
    hasty = replace(TINY, most_s=1e-9, expansion_points=(1,))
    made = compare_methods(arm, hasty, ACCURACIES, lambda line: None)
    assert any("have no answer: Taylor 1 full took" in note for note in made.notes)
    assert (made.asked.samples_per_design, made.asked.random_points) == (4, 4)  # at least


# --- The points of the question


def test_points_are_between_samples_and_the_designs_of_all_runs_are_corners(arm: Scene) -> None:
    question, again = (build_question(build_bench(arm, TINY)) for _ in range(2))
    np.testing.assert_array_equal(question.points.q, again.points.q)
    lower, upper = arm.bounds
    corners = ((question.points.y == lower) | (question.points.y == upper)).all(axis=1)
    n = question.asked.random_points
    assert not corners[:n].any()
    sampled = {pose.tobytes() for pose in arm.path.q}  # where nothing was expanded
    assert not any(pose.tobytes() in sampled for pose in question.points.q[:n])
    designs = {tuple(question.points.y[run.start]) for run in question.runs}
    assert designs == set(product(*zip(lower, upper, strict=True)))
    for run in question.runs:
        assert np.ptp(question.points.y[run], axis=0).max() == 0.0
        assert len(question.points[run]) == 9


def test_samples_are_fewer_where_an_exact_solve_takes_long(arm: Scene) -> None:
    bench = build_bench(arm, TINY)

    class Dear(type(bench)):
        solve_s = 0.1

    every = 30 + 5 * 9  # random ones, and runs at the initial design and four corners
    half = replace(TINY, most_s=0.5 * every * Dear.solve_s)
    made = build_question(Dear(arm, half, bench.lower, bench.upper))
    assert (made.asked.random_points, made.asked.samples_per_design) == (15, 4)
    assert len(made.runs) == 4  # the initial design is one of the corners


ABSOLUTE = "q2: {joint: elbow, angle: absolute}"


@pytest.mark.parametrize("head", [HEAD, HEAD.replace(ABSOLUTE, "q2: {joint: elbow}")])
def test_a_trajectory_that_stands_still_where_it_matters_is_refused_with_the_joint(
    head: str, tmp_path: Path
) -> None:
    second = 5.4 if "absolute" in head else 5.3  # the elbow does not turn
    still = f"trajectory: {{q: [[1.8, 5.3], [1.9, {second}]], duration: 1 s}}\n"
    scene = scene_of(tmp_path, head + still)
    with pytest.raises(
        CaseError, match=r"nothing moves .* \(joints: elbow\).* let it move, or give"
    ):
        build_bench(scene, TINY)


def test_a_case_without_a_trajectory_cannot_be_charted(tmp_path: Path) -> None:
    scene = scene_of(tmp_path, HEAD + "expansion: {q: [1.8, 5.3]}\n")
    with pytest.raises(CaseError, match="trajectory: is missing, and needed here"):
        build_bench(scene, TINY)


def test_a_case_in_which_nothing_can_change_a_frequency_says_so(tmp_path: Path) -> None:
    text = (
        "title: Pin\nmechanism:\n  space: planar\n"
        "  materials: {m: {youngs_modulus: 210 GPa, density: 7850}}\n"
        "  sections: {s: {shape: circle, diameter: 20 mm}}\n"
        "  links: {l: {length: 0.8, material: m, section: s, elements: 3}}\n"
        "  joints: {j: {type: revolute, base: ground, follower: l.start}}\n"
        "coordinates: {q: {joint: j}}\n"
        "trajectory: {q: [[0], [1]], duration: 1 s}\n"
    )
    with pytest.raises(CaseError, match=r"no coordinate changes a frequency, .*; give a design"):
        build_bench(scene_of(tmp_path, text), TINY)
