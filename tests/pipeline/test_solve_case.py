import re
from pathlib import Path

import numpy as np
import pytest
from run_cases import (
    ONE_SHOT,
    TARGET,
    TOOL_MASS,
    UNCACHED,
    automatic,
    case_of,
    chain,
    moving,
    shipped,
    solved,
)

from eigassign.pipeline import Options, Result, solve_case

ROD = "{area: 7.06317856e-4, bending_inertia: 3.97e-8}"
SHOULDER = "{joint: shoulder}"
POSES = ((1.75, 5.2), (1.8, 5.3), (1.83, 5.35))

MECHANISMS = {
    "the shipped arm": shipped(),
    "a chain of one link": chain(1, target=150),
    "a chain of three": chain(3, target=280),
    "a chain of three in absolute angles, locked": chain(3, "locked", "absolute", 30),
    "a chain of three on a spring": chain(3, "{stiffness: 3000}", target=60),
    "a locked shoulder": automatic(
        (SHOULDER, "{joint: shoulder, drive: locked}"), ("190 Hz", "38 Hz")
    ),
    "a designed drive stiffness": automatic(
        (SHOULDER, "{joint: shoulder, drive: {stiffness: 5000}}"),
        (TOOL_MASS, "k: {parameter: coordinates.q1.drive.stiffness, min: 4000, max: 6000}"),
        ("190 Hz", "19.5 Hz"),
    ),
    "a designed diameter": automatic(
        (ROD, "{shape: circle, diameter: 30 mm}"),
        (TOOL_MASS, "d: {parameter: sections.rod.diameter, min: 28 mm, max: 32 mm}"),
    ),
    "a designed modulus": automatic(
        (TOOL_MASS, "E: {parameter: materials.aluminium.youngs_modulus, min: 65 GPa, max: 72 GPa}"),
    ),
    "a designed length": moving(
        *POSES,
        text=automatic((TOOL_MASS, "L: {parameter: links.forearm.length, min: 0.43, max: 0.47}")),
    ),
    "two samples": moving((1.8, 5.2), (1.9, 5.4), text=automatic()),
    "a mechanism that stands still": moving((1.8, 5.2), (1.8, 5.2), text=automatic()),
    "two targets": automatic(
        (TARGET, TARGET + "\n  - {mode: 2, frequency: 450 Hz, weight: 0.5}"),
        ("max: 250 g", "max: 100 g"),
        ("max_error: 2 %", "max_error: 8 %"),
    ),
    "a target that moves": automatic(("190 Hz", "{time: [0, 1], frequency: [196, 190]}")),
    "a constraint between masses": automatic(
        (TOOL_MASS, TOOL_MASS + "\n  constraints:\n    total: {terms: {m1: 1, m2: 1}, max: 150 g}"),
    ),
}


@pytest.mark.parametrize("name", MECHANISMS)
def test_what_a_result_says_is_what_its_parts_compute(name: str, tmp_path: Path) -> None:
    text = MECHANISMS[name] + ONE_SHOT
    result = solved(tmp_path, text)
    case = case_of(tmp_path, text)
    q, y = case.trajectory.q, list(result.design.values())
    for k, target in enumerate(result.results.targets):
        column = result.linearised.modes.index(target.asked.mode)
        exact = case.model().frequencies(q, y, target.asked.mode)[:, -1]
        before = case.model().frequencies(q, case.initial_design, target.asked.mode)[:, -1]
        predicted = result.linearised.frequencies(q, y)[:, column]
        np.testing.assert_allclose(target.exact_hz, exact, rtol=1e-12)
        np.testing.assert_allclose(target.initial_hz, before, rtol=1e-12)
        np.testing.assert_allclose(target.predicted_hz, predicted, rtol=1e-9)  # another sum
        worst = np.abs(target.exact_hz / target.asked.hz - 1).max()
        assert target.error.exact.max_relative == worst
        assert result.assignment.lam[k].shape == (len(q),)
    np.testing.assert_array_equal(result.exact_hz, result.results.targets[0].exact_hz)


def _feasible(name: str, result: Result, count: int) -> list[np.ndarray]:
    """Random designs within the bounds and, of the one case that has it, the constraint."""
    rows = result.results.design
    random = np.random.default_rng(1)
    lower, upper = (np.array([getattr(r, side) for r in rows]) for side in ("lower", "upper"))
    designs = random.uniform(lower, upper, (count, len(rows)))
    feasible = [y for y in designs if name != "a constraint between masses" or y.sum() <= 0.15]
    assert len(feasible) > 5
    return feasible


@pytest.mark.parametrize("name", MECHANISMS)
def test_no_random_design_within_the_limits_is_better_nor_is_the_start_or_the_one_shot(
    name: str, tmp_path: Path
) -> None:
    """By the exact objective; and what the results say of the answer is what the model says."""
    text = MECHANISMS[name]
    result = solved(tmp_path, text)
    case, error = case_of(tmp_path, text), result.results.error
    assert error.exact.rms_relative < error.initial.rms_relative
    assert result.results.targets[0].approximation_error <= 0.02
    assert result.results.warnings == ()
    model, targets = case.model(), result.results.targets
    times = [target.asked.weight * target.weight_s for target in targets]

    def rms(y: np.ndarray | list[float]) -> float:
        hz = model.frequencies(case.trajectory.q, y, max(t.asked.mode for t in targets))
        ours = np.trapezoid(
            [(hz[:, t.asked.mode - 1] / t.asked.hz - 1.0) ** 2 for t in targets], result.time_s
        )
        span = np.ptp(result.time_s)
        return float(np.sqrt(np.array(times) @ ours / span / sum(times)))

    row = result.results.assignment
    best = rms(list(result.design.values()))
    assert row.objective_optimal == pytest.approx(best**2, rel=1e-9)
    assert best <= rms(list(row.one_shot)) * (1.0 + 1e-9)
    for y in (case.initial_design, *_feasible(name, result, 30)):
        assert rms(y) >= best * (1.0 - 1e-6)


def test_a_heavier_target_is_met_more_closely(tmp_path: Path) -> None:
    def second_mode(weight: str) -> float:
        both = f"{TARGET}\n  - {{mode: 2, frequency: 450 Hz, weight: {weight}}}"
        results = solved(tmp_path, automatic((TARGET, both)) + ONE_SHOT).results
        return results.targets[1].error.predicted.rms_relative

    assert second_mode("20") < 0.9 * second_mode("0.05")


def test_the_three_modes_above_the_assigned_one_are_shown(tmp_path: Path) -> None:
    result = solved(tmp_path, shipped())
    case = case_of(tmp_path, shipped())
    others = result.results.other_modes
    assert [row.mode for row in others] == [2, 3, 4]
    exact = case.model().frequencies(case.trajectory.q, list(result.design.values()), 4)
    np.testing.assert_allclose([row.optimal_hz for row in others], exact[:, 1:].T, rtol=1e-12)


def test_expanded_modes_without_a_target_are_columns_before_and_after(tmp_path: Path) -> None:
    """The paper's Figure 5."""
    text = shipped(("modes: [1]", "modes: [1, 2, 3, 4]"))
    result, case = solved(tmp_path, text), case_of(tmp_path, text)
    columns, q = result.to_dict(), case.trajectory.q
    designs = {"initial": case.initial_design, "exact": list(result.design.values())}
    for when, y in designs.items():
        found = np.stack([columns[f"mode {mode} {when} [Hz]"] for mode in (2, 3, 4)], axis=1)
        np.testing.assert_allclose(found, case.model().frequencies(q, y, 4)[:, 1:], rtol=1e-12)
    plain = solved(tmp_path, shipped()).to_dict()
    assert [name for name in plain if name.startswith(("mode 2", "mode 3", "mode 4"))] == []


def test_a_prediction_over_the_tolerance_is_said_with_advice_that_helps(tmp_path: Path) -> None:
    text = shipped(("max_error: 2 %", "max_error: 0.1 %")) + ONE_SHOT
    results = solved(tmp_path, text).results
    assert results.targets[0].approximation_error > 0.001
    assert results.shortcoming is not None
    (warning,) = results.warnings
    assert "0.32 % off" in warning
    assert "try expansion.y: [0.2287, 0]" in warning
    again = solved(tmp_path, text.replace("y: [0.125, 0.125]", "y: [0.2287, 0]")).results
    off = (each.targets[0].approximation_error for each in (again, results))
    assert next(off) < next(off)


MISLEADING = automatic(
    (
        "elbow_mass: {at: upper_arm.end, mass: 0}",
        "elbow_mass: {at: upper_arm.end, mass: 220 g}",
    ),
    ("elbow_mass.mass, min: 0, max: 250 g", "elbow_mass.mass, min: 0, max: 1"),
)


def test_a_one_shot_that_misleads_is_no_optimum_and_the_sequential_answer_is_better(
    tmp_path: Path,
) -> None:
    results = solved(tmp_path, MISLEADING + ONE_SHOT).results
    assert results.error.exact.rms_relative > results.error.initial.rms_relative
    assert results.assignment.verdict == "do_not_use"
    assert results.shortcoming is not None
    results = solved(tmp_path, MISLEADING).results
    error = results.error
    assert error.exact.rms_relative < error.initial.rms_relative < error.one_shot.rms_relative
    assert results.warnings == ()


def test_solving_twice_gives_the_same_bits(tmp_path: Path) -> None:
    case = case_of(tmp_path, shipped())
    first, second = (solve_case(case, UNCACHED) for _ in range(2))
    assert first.design == second.design
    np.testing.assert_array_equal(first.exact_hz, second.exact_hz)
    np.testing.assert_array_equal(first.predicted_hz, second.predicted_hz)


def test_stages_are_announced_in_order_and_timed(tmp_path: Path) -> None:
    told: list[str] = []
    result = solve_case(
        case_of(tmp_path, shipped()), Options(use_cache=False, progress=told.append)
    )
    stages = [line for line in told if not line.startswith("  ")]
    assert len(stages) == len(result.results.timing_s) == 8
    assert list(result.results.timing_s) == [
        "model",
        "trajectory",
        "expansion",
        "assignment",
        "initial",
        "verification",
        "comparison",
        "meaning",
    ]


def test_coordinates_follow_lengths_that_move_the_tip(tmp_path: Path) -> None:
    lengths = (
        "  a: {parameter: links.upper_arm.length, min: 0.57, max: 0.61}\n"
        "  b: {parameter: links.forearm.length, min: 0.44, max: 0.5}\n"
    )
    text = shipped(("217 deg", "300 deg"), ("190 Hz", "205 Hz"), ("  m2: {", lengths + "  m2: {"))
    text = re.sub(r"^expansion:.*?(?=^targets:)", "", text, flags=re.M | re.S)
    text += ONE_SHOT
    case = case_of(tmp_path, text)
    result = solve_case(case, UNCACHED)
    errors, y = result.results.targets[0], np.array(list(result.design.values()))
    assert np.abs(y - case.initial_design).max() > 0.01
    q, model = case.trajectory.at(y)[0], case.model()
    np.testing.assert_allclose(result.exact_hz, model.frequencies(q, y, 1)[:, 0], rtol=1e-9)
    # predicted by a program that is linear in everything; without dq/dy it would not even improve
    assert errors.error.predicted.rms_relative < 0.5 * errors.error.initial.rms_relative
    assert errors.error.exact.rms_relative < 0.5 * errors.error.initial.rms_relative
    assert any("m1" not in note and "for every a, b" in note for note in result.results.notes)
