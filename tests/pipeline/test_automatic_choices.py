"""Mesh, order and expansion points left to auto meet the accuracy asked for, and say why."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from run_cases import changed, written

from eigassign import load_case
from eigassign.errors import AccuracyError
from eigassign.mechanism import with_elements
from eigassign.modal import NearestExpansion
from eigassign.pipeline import Stages, prepare, solve_case
from eigassign.study import build_model, corners

CASE = Path(__file__).parents[2] / "cases" / "two_link.yaml"


def automatic(tmp_path: Path, accuracy: str, *changes: tuple[str, str]) -> Path:
    auto = ("elements: 4", "elements: auto"), ("elements: 3", "elements: auto")
    order = "  order: 4", f"  order: auto\n  accuracy: {accuracy}"
    return written(tmp_path, changed(*auto, order, *changes))


@pytest.mark.parametrize(("accuracy", "limit"), [("1 %", 1e-2), ("0.2 %", 2e-3)])
def test_the_choice_is_within_the_accuracy_of_a_fine_mesh(
    tmp_path: Path, accuracy: str, limit: float
) -> None:
    fine = build_model(with_elements(load_case(CASE).file, {"upper_arm": 16, "forearm": 16}))
    case = load_case(automatic(tmp_path, accuracy))
    q, y = case.trajectory.q, np.zeros(2)
    expansions = solve_case(case).results.studies[0].over_time
    exact = fine.frequencies(q, y, 1)[:, 0]
    assert np.abs(expansions.taylor_hz / exact - 1.0).max() <= limit


def test_the_reasons_are_among_the_notes(tmp_path: Path) -> None:
    notes = solve_case(load_case(automatic(tmp_path, "0.2 %"))).results.notes
    assert any(note.startswith("2 elements: about") for note in notes)
    assert any(note.startswith("order 2: about") for note in notes)


def test_a_looser_accuracy_takes_a_lower_order_and_a_coarser_mesh(tmp_path: Path) -> None:
    cases = [load_case(automatic(tmp_path, accuracy)) for accuracy in ("3 %", "0.2 %")]
    loose, tight = (solve_case(case).results.studies[0].order for case in cases)
    assert loose < tight
    coarse, fine = (case.model().n_dof for case in cases)
    assert coarse < fine


def test_where_one_point_cannot_do_several_share_the_trajectory(tmp_path: Path) -> None:
    path = automatic(
        tmp_path, "0.001 %", ("elements: auto", "elements: 4"), ("max: 250 g", "max: 1 g"),
        ("  y: [0.125, 0.125] # kg, the middle of the box", "  y: [0, 0]"),
    )  # fmt: skip
    result = solve_case(load_case(path))
    study = result.results.studies[0].over_time
    assert study.worst["taylor"] <= 1e-5


def test_python_is_handed_all_of_several_points(tmp_path: Path) -> None:
    """The first point alone is right near it only, and farther off elsewhere than is asked."""
    text = (CASE.parent / "stress" / "wide_motion.yaml").read_text(encoding="utf-8")
    path = tmp_path / "several.yaml"
    path.write_text(
        text.replace("order: 8", "order: auto, accuracy: 1 %")
        + "targets: [{mode: 1, frequency: 100 Hz}]\nassignment: {method: one_shot}\n",
        encoding="utf-8",
    )
    case = load_case(path)
    result = solve_case(case)
    q, y = case.trajectory.q, case.initial_design
    study = result.results.studies[0].over_time
    assert isinstance(result.expansion, NearestExpansion)
    assert isinstance(result.linearised, NearestExpansion)
    np.testing.assert_allclose(result.expansion.frequencies(q, y)[:, 0], study.taylor_hz)
    np.testing.assert_allclose(result.linearised.frequencies(q, y)[:, 0], study.linearised_hz)
    first = result.expansion.parts[0].frequencies(q, y)[:, 0]
    assert np.abs(first / study.exact_hz - 1.0).max() > 0.01


def test_an_accuracy_out_of_reach_is_refused_with_the_reason(tmp_path: Path) -> None:
    case = load_case(automatic(tmp_path, "1e-14"))
    with pytest.raises(AccuracyError, match="elements"):
        case.model()


@pytest.mark.parametrize("name", ["five_bar", "arm_3r"])
def test_an_order_left_to_auto_holds_all_over_the_box_of_several_parameters(name: str) -> None:
    """Also where some parameters are at their upper bounds and others at their lower ones."""
    case = load_case(CASE.parent / f"{name}.yaml")
    run = replace(case.file, expansion=case.file.expansion.model_copy(
        update={"order": "auto", "accuracy": 1e-4}))  # fmt: skip
    scene = prepare(replace(case, file=run), Stages(lambda line: None), None)
    made = scene.expansions
    low, high = scene.bounds
    y = np.random.default_rng(3).uniform(low, high, (60, len(low)))
    y = np.vstack([y, np.where(corners(len(low)), high, low)])
    q = np.repeat(scene.path.q, len(y), axis=0)
    y = np.tile(y, (len(scene.path.q), 1))
    exact = scene.model.frequencies(q, y, max(made.modes))[:, np.array(made.modes) - 1]
    assert np.abs(made.taylor_hz(q, y) / exact - 1.0).max() <= 1e-4


def test_the_error_of_the_mesh_is_stated_at_the_optimum(tmp_path: Path) -> None:
    case = load_case(automatic(tmp_path, "1 %"))
    results = solve_case(case).results
    stated, y = results.discretisation, [row.optimal for row in results.design]
    assert (stated.design, stated.modes, stated.poses) == ("optimal", (1,), 5)
    fine = build_model(with_elements(case.file, {"upper_arm": 16, "forearm": 16}))
    q = case.trajectory.q
    true = case.model().frequencies(q, y, 1) / fine.frequencies(q, y, 1) - 1.0
    assert true.max() < stated.error[0] < 1.05 * true.max()
    assert any("of the optimal design" in note for note in results.notes)


def test_the_order_is_chosen_about_a_bound_where_a_place_is_0(tmp_path: Path) -> None:
    place = "  x: {parameter: joints.elbow.position.0, min: -60 mm, max: 0}\n\nexpansion:"
    y = "  y: [0.125, 0.125] # kg, the middle of the box", ""
    once = "targets:", "assignment: {starts: 1}\ntargets:"
    path = automatic(tmp_path, "1 %", ("\nexpansion:", place), y, once)
    assert solve_case(load_case(path)).results.assignment is not None
