"""Ends of several searches are one optimum where no barrier parts them; how many are not seen."""

from collections.abc import Callable

import numpy as np
import pytest

from eigassign.assignment import Appraisal, DesignProblem, Optimum, Tally, minimise, with_end


def valley(y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """One sum of two parameters alone is felt: r = y0 + y1 − 1."""
    return np.array([y[0] + y[1] - 1.0, 0.3]), np.array([[1.0, 1.0, 0.0], np.zeros(3)])


def bend(y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """One product of two parameters alone is felt: the valley bends."""
    rate = np.array([y[1] + 0.1, y[0] + 0.1, 0.0])
    return np.array([(y[0] + 0.1) * (y[1] + 0.1) - 0.2, 0.3]), np.vstack([rate, np.zeros(3)])


def wells(y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two values of the first parameter are as good, the others are not felt."""
    residual = 10.0 * (y[0] - 0.2) * (y[0] - 0.8)
    return np.array([residual, 0.3]), np.array([[20.0 * y[0] - 10.0, 0.0, 0.0], np.zeros(3)])


@pytest.mark.parametrize(("felt", "count"), [(valley, 1), (bend, 1), (wells, 2)])
def test_directions_without_effect_make_no_optima_distinct(
    felt: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]], count: int
) -> None:
    none = np.zeros(0), np.zeros((0, 3))
    problem = DesignProblem(lambda y: Appraisal(*felt(y), *none), np.zeros(3), np.ones(3))
    optima: tuple[Optimum, ...] = ()
    ends = []
    for start in np.random.default_rng(0).random((12, 3)):
        ends.append(minimise(problem, start))
        optima = with_end(optima, ends[-1], problem)
    assert len(optima) == count
    assert np.ptp([one.y[2] for one in ends]) > 0.5  # what is not felt stays as it was


@pytest.mark.parametrize(
    ("starts", "optima", "unseen"), [(7, 1, 0.5), (6, 1, 2 / 3), (16, 2, 0.5), (12, 3, 12 / 7)]
)
def test_optima_not_seen_are_expected_by_the_rule_of_boender_and_rinnooy_kan(
    starts: int, optima: int, unseen: float
) -> None:
    assert Tally(starts, optima).unseen == pytest.approx(unseen)
    assert optima * (starts - 1) / (starts - optima - 2) - optima == pytest.approx(unseen)


@pytest.mark.parametrize(("starts", "optima"), [(1, 1), (3, 1), (9, 7)])
def test_few_starts_cannot_tell_how_many_optima_are_not_seen(starts: int, optima: int) -> None:
    assert Tally(starts, optima).unseen == np.inf
