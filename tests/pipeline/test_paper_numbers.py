"""Belotti, Palomba, Wehrle, Vidoni, Appl. Sci. 2021, 11, 11558: what the shipped case must give.

Limits are the paper's figures widened by what its drawn trajectory leaves open.
"""

import numpy as np
import pytest
from run_cases import ONE_SHOT, SHIPPED, UNCACHED, shipped, solved

import eigassign as ea
from eigassign.pipeline import Result, validate


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> Result:
    """The paper's one shot."""
    return solved(tmp_path_factory.mktemp("one_shot"), shipped() + ONE_SHOT)


@pytest.fixture(scope="module")
def sequential() -> Result:
    return ea.assign(ea.load_case(SHIPPED))


def test_all_rows_of_the_shipped_case_are_within_its_two_percent() -> None:
    validation = validate(SHIPPED, UNCACHED)
    assert validation.passed
    assert [row.where for row in validation.rows] == [
        "trajectory",
        "box of y at q0",
        "between samples, all over the bounds",
    ]
    assert all(row.limit == 0.02 for row in validation.rows)


def test_the_prediction_the_optimum_rests_on_is_right_to_a_third_of_a_percent(
    result: Result,
) -> None:
    off = np.abs(result.predicted_hz / result.exact_hz - 1.0).max()
    assert off == result.results.targets[0].approximation_error
    assert 0.0 < off < 0.004


def test_the_paper_s_answer_stands_beside_the_exact_optimum(
    result: Result, sequential: Result
) -> None:
    row, error = sequential.results.assignment, sequential.results.error
    np.testing.assert_array_equal(row.one_shot, list(result.design.values()))
    assert error.one_shot == result.results.error.exact


def test_the_exact_optimum_is_that_of_least_squares_on_exact_frequencies(
    sequential: Result,
) -> None:
    """SciPy's `least_squares` on exact frequencies, several starts: rms 1.29627 %."""
    results = sequential.results
    assert results.error.exact.rms_relative == pytest.approx(0.0129627, abs=5e-8)
    assert results.assignment.objective_optimal == pytest.approx(0.0129627**2, rel=1e-5)
    assert results.assignment.verdict == "reached"
    assert results.shortcoming is None
    assert results.warnings == ()
