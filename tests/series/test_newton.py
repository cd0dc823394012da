"""Newton's interpolation on lower sets: Leja points, the basis, and the coefficients as checks."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from eigassign.series.lower_set import total_degree
from eigassign.series.margin import margin, rate
from eigassign.series.newton import basis, interval, leja, newton_polynomials, products

AXES = tuple(interval()[leja(interval(), k)] for k in (9, 7, 6))
TABLES = [basis(v, v) for v in AXES]


def test_leja_points_are_distinct_and_the_basis_is_at_most_one_everywhere() -> None:
    for candidates in (interval(), np.linspace(-1.0, 1.0, 152)):
        chosen = leja(candidates, 20)
        assert len(set(chosen.tolist())) == 20
        h = basis(candidates[chosen], candidates)
        assert np.abs(h).max() <= 1.0 + 1e-12
        np.testing.assert_allclose(np.diag(h[chosen]), 1.0)
        assert np.abs(np.triu(h[chosen], 1)).max() == 0.0


def test_fewer_candidates_than_points_are_all_taken() -> None:
    assert sorted(leja(np.linspace(-1.0, 1.0, 5), 20).tolist()) == [0, 1, 2, 3, 4]


def test_a_polynomial_of_the_set_is_reproduced_wherever_it_is_evaluated() -> None:
    members = total_degree(3, 4).indices
    at = np.random.default_rng(2).uniform(-1.0, 1.0, (700, 3))

    def f(v: np.ndarray) -> np.ndarray:
        x, y, z = v.T
        return 1.0 + x * y * z - 2.0 * x**3 * z + y**4 + z

    v = np.column_stack([nodes[members[:, j]] for j, nodes in enumerate(AXES)])
    c = np.linalg.solve(products(TABLES, members, members), f(v))
    made = newton_polynomials(members, AXES, np.array([c, -c]))(at)
    np.testing.assert_allclose(made, np.column_stack([f(at), -f(at)]), atol=1e-12)


def test_a_coefficient_is_the_error_of_the_interpolant_before_it() -> None:
    f = np.exp(AXES[0])
    c = np.linalg.solve(TABLES[0], f)
    for k in range(1, len(f)):
        before = newton_polynomials(np.arange(k)[:, None], AXES[:1], c[None, :k])
        assert c[k] == pytest.approx(f[k] - before(AXES[0][k : k + 1, None])[0, 0], abs=1e-15)


def test_the_margin_is_what_a_search_over_all_indices_finds() -> None:
    members = np.array([g for g in itertools.product(range(4), range(3), range(5)) if sum(g) < 4])
    inside, tops = {tuple(g) for g in members.tolist()}, np.array([3, 2, 9])
    brute = {
        g
        for g in itertools.product(range(4), range(3), range(10))
        if g not in inside
        and all(tuple(np.array(g) - np.eye(3, dtype=int)[j]) in inside for j in range(3) if g[j])
    }
    found = margin(members, tops)
    assert {tuple(g) for g in found.rows.tolist()} == brute


@pytest.mark.parametrize("d", [1, 3])
def test_the_margin_of_a_product_of_powers_is_predicted_exactly(d: int) -> None:
    rates = np.array([0.5, 0.2, 0.1])[:d]
    members = total_degree(d, 3).indices
    sizes = np.prod(rates**members, axis=1)
    found = margin(members, np.full(d, 9))
    expected = np.prod(rates**found.rows, axis=1)
    np.testing.assert_allclose(found.predicted(sizes, rates), expected)


def test_rates_are_those_of_the_layers_also_of_even_functions() -> None:
    degrees = np.arange(9)
    assert rate(degrees, 0.3**degrees) == pytest.approx(0.3)
    even = np.where(degrees % 2, 0.0, 0.3**degrees)
    assert rate(degrees, even) == pytest.approx(0.3, rel=0.3)
    assert rate(degrees, np.where(degrees, 1e-16, 1.0)) == 0.0
