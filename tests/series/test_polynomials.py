"""Prepared polynomials agree with the sum over all monomials."""

import numpy as np
import pytest

from eigassign.series import (
    LowerSet,
    lower_set,
    monomials,
    partially_linear,
    polynomials,
    total_degree,
)

SETS = [
    total_degree(1, 5),
    total_degree(2, 0),
    total_degree(3, 4),
    total_degree(5, 3),
    partially_linear(2, 3, 4),
    partially_linear(0, 3, 4),
    lower_set(list(np.ndindex(3, 1, 4, 2))),
]


@pytest.mark.parametrize("space", SETS, ids=lambda s: f"{s.n_variables}x{len(s)}")
def test_prepared_polynomials_are_the_sum_over_monomials(space: LowerSet) -> None:
    random = np.random.default_rng(1)
    coefficients = random.standard_normal((2, len(space)))
    x = random.uniform(-1.5, 1.5, (1200, space.n_variables))
    powers = monomials(space, x)
    size = np.abs(powers) @ np.abs(coefficients).T  # what a sum's round-off is relative to
    found = polynomials(space, coefficients)(x)
    assert np.all(np.abs(found - powers @ coefficients.T) <= 1e-14 * size)


@pytest.mark.parametrize("space", SETS, ids=lambda s: f"{s.n_variables}x{len(s)}")
def test_monomials_are_powers_in_the_order_of_their_set(space: LowerSet) -> None:
    x = np.random.default_rng(0).standard_normal((6, space.n_variables))
    expected = np.prod(x[:, None, :] ** space.indices[None], axis=2)
    np.testing.assert_allclose(monomials(space, x), expected, rtol=1e-13)
    assert monomials(space, 0.0 * x)[:, 0].tolist() == [1.0] * 6


def test_no_points_give_no_values() -> None:
    space = total_degree(2, 2)
    assert polynomials(space, np.ones((3, len(space))))(np.zeros((0, 2))).shape == (0, 3)
