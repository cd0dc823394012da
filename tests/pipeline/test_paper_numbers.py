"""Belotti, Palomba, Wehrle, Vidoni, Appl. Sci. 2021, 11, 11558: what the shipped case must give.

Limits are the paper's figures widened by what its drawn trajectory leaves open.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pytest
from run_cases import ONE_SHOT, SHIPPED, UNCACHED, shipped, solved

import eigassign as ea
from eigassign.pipeline import Result, modes, validate
from eigassign.study import ValidationRow


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Result:
    """The paper's one shot."""
    return solved(tmp_path_factory.mktemp("one_shot"), shipped() + ONE_SHOT)


@pytest.fixture(scope="module")
def sequential() -> Result:
    return ea.assign(ea.load_case(SHIPPED))


@pytest.fixture(scope="module")
def rows() -> Mapping[str, ValidationRow]:
    return {row.where: row for row in validate(SHIPPED, UNCACHED).rows}


def test_order_four_over_the_box_of_masses_is_off_by_a_twentieth_of_a_percent(
    rows: Mapping[str, ValidationRow],
) -> None:
    row = rows["box of y at q0"]
    assert 0.0005 <= row.worst_taylor <= 0.0006
    assert 0.0130 <= row.worst_linearised <= 0.0140


def test_along_the_trajectory_order_four_is_off_by_a_tenth_of_a_percent(
    rows: Mapping[str, ValidationRow],
) -> None:
    row = rows["trajectory"]
    assert 0.0008 <= row.worst_taylor <= 0.0010
    assert 0.0155 <= row.worst_linearised <= 0.0170


def test_all_rows_of_the_shipped_case_are_within_its_two_percent() -> None:
    validation = validate(SHIPPED, UNCACHED)
    assert validation.passed
    assert [row.where for row in validation.rows] == [
        "trajectory",
        "box of y at q0",
        "box of q and y",
    ]
    assert all(row.limit == 0.02 for row in validation.rows)


def test_the_optimum_adds_no_tool_mass_and_some_elbow_mass(result: Result) -> None:
    assert result.design["m2"] == 0.0
    assert result.design["m1"] == pytest.approx(0.2287, abs=5e-5)


def test_the_worst_error_falls_from_eight_to_one_and_a_half_percent(result: Result) -> None:
    error = result.results.error
    assert error is not None
    assert error.predicted is not None
    assert 0.082 <= error.initial.max_relative <= 0.084
    assert error.predicted.max_relative == pytest.approx(0.0166, abs=5e-5)
    assert error.exact.max_relative == pytest.approx(0.0155, abs=5e-5)


def test_the_prediction_the_optimum_rests_on_is_right_to_a_third_of_a_percent(
    result: Result,
) -> None:
    off = np.abs(result.predicted_hz / result.exact_hz - 1.0).max()
    assert off == result.results.approximation_error
    assert 0.0 < off < 0.004
    assert result.results.within_tolerance


def test_the_paper_s_answer_stands_beside_the_exact_optimum(
    result: Result, sequential: Result
) -> None:
    row, error = sequential.results.assignment, sequential.results.error
    assert row is not None
    assert error is not None
    np.testing.assert_array_equal(row.one_shot, list(result.design.values()))
    assert result.results.error is not None
    assert error.one_shot == result.results.error.exact


def test_the_exact_optimum_is_that_of_least_squares_on_exact_frequencies(
    sequential: Result,
) -> None:
    """SciPy's `least_squares` on exact frequencies, several starts: rms 1.29627 %."""
    results = sequential.results
    assert results.error is not None
    assert results.error.exact.rms_relative == pytest.approx(0.0129627, abs=5e-8)
    assert results.assignment is not None
    assert results.assignment.objective_optimal == pytest.approx(0.0129627**2, rel=1e-5)
    assert results.assignment.verdict == "reached"
    assert results.shortcoming is None
    assert results.warnings == ()


@pytest.mark.parametrize(
    ("y", "published"),
    [
        ([0.0, 0.0], [202.2196, 513.1562, 736.4196]),
        ([0.125, 0.125], [193.1130, 427.1499, 708.2169]),
    ],
)
def test_frequencies_at_the_expansion_point(y: list[float], published: list[float]) -> None:
    answer = modes(SHIPPED, [1.817, 5.312], y, 3)
    assert answer.rigid_modes == 2
    np.testing.assert_allclose(answer.frequencies_hz, published, atol=6e-5)  # four digits printed


def test_the_expansion_finds_that_turning_the_whole_arm_changes_nothing(result: Result) -> None:
    assert result.expansion.space.n_variables == 3  # elbow, m1, m2
    assert any("no frequency depends" in note for note in result.results.notes)
