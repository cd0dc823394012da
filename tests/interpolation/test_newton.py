"""Newton's interpolation on lower sets: Leja points, the basis, and the coefficients as checks."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from eigassign.interpolation.adaptive import Adding
from eigassign.interpolation.margin import Border, decay, keys, rates_of, rows_of
from eigassign.interpolation.newton import (
    Interpolant,
    Nodes,
    basis,
    interval,
    leja,
    newton_polynomials,
    products,
)
from eigassign.series import total_degree

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
    inside = {tuple(g) for g in members.tolist()}
    brute = {
        g
        for g in itertools.product(range(4), range(4), range(10))
        if g not in inside
        and all(tuple(np.array(g) - np.eye(3, dtype=int)[j]) in inside for j in range(3) if g[j])
    }
    assert any(g[1] == 3 for g in brute)
    border = Border((3, 2, 9), (True, False, True))  # on the second axis one is missing beyond
    rng = np.random.default_rng(3)
    for part in np.split(np.array(sorted(inside, key=lambda g: (sum(g), rng.random()))), [1, 7, 9]):
        border.grow(keys(part).tolist())
    found = rows_of(np.array(list(border.next)), 3)
    assert {tuple(g) for g in found.tolist()} == brute
    outside = rows_of(np.array(list(border.outside)), 3)
    assert {tuple(g) for g in outside.tolist()} == {g for g in brute if g[1] > 2}


@pytest.mark.parametrize("d", [2, 3])
def test_the_margin_of_a_product_of_powers_is_predicted_exactly(d: int) -> None:
    rates = np.array([[0.5, 0.2, 0.1], [0.3, 0.7, 0.4]])[:, :d]
    members = total_degree(d, 3).indices
    sizes = np.prod(rates[:, None] ** members, axis=2)
    border = Border((9,) * d, (True,) * d)
    border.grow(keys(members).tolist())
    rows = rows_of(np.array(list(border.next)), d)
    expected = np.prod(rates[:, None] ** rows, axis=2)
    np.testing.assert_allclose(border.margin().predicted(sizes, rates), expected)


def test_that_of_an_even_function_too_whose_odd_coefficients_vanish() -> None:
    rates, members = np.array([[0.5, 0.2]]), total_degree(2, 3).indices
    even = (members % 2 == 0).all(axis=1)
    border = Border((9, 9), (True, True))
    border.grow(keys(members).tolist())
    rows = rows_of(np.array(list(border.next)), 2)
    expected = np.where((rows % 2 == 0).all(axis=1), np.prod(rates**rows, axis=1), 0.0)
    found = border.margin().predicted(
        np.where(even, np.prod(rates**members, axis=1), 0.0)[None], rates
    )
    np.testing.assert_allclose(found[0], expected)


def test_rates_are_those_of_the_layers_also_of_even_functions() -> None:
    degrees = np.arange(9)
    assert decay((0.3**degrees).tolist()) == pytest.approx(0.3)
    even = np.where(degrees % 2, 0.0, 0.3**degrees)
    assert decay(even.tolist()) == pytest.approx(0.3, rel=0.3)
    assert decay(np.where(degrees, 1e-16, 1.0).tolist()) == 0.0


def test_rates_along_an_axis_are_those_of_the_largest_of_each_degree() -> None:
    members = np.random.default_rng(1).permutation(total_degree(2, 5).indices)
    rates = np.array([[0.5, 0.2], [0.3, 0.7]])
    sizes = np.prod(rates[:, None] ** members, axis=2)
    np.testing.assert_allclose(rates_of(members, sizes), rates)


def test_what_is_added_is_the_largest_that_is_predicted_and_grows_the_set() -> None:
    members, rates = total_degree(2, 1).indices, np.array([0.5, 0.1])
    sizes = np.prod(rates**members, axis=1)
    border = Border((2, 9), (False, False))
    border.grow(keys(members).tolist())
    found = Interpolant(1.0, members, sizes[None], sizes, rates, 1.0)
    adding = Adding(border, found)
    for _ in range(3):
        adding.take(adding.ranked()[:1])
    assert adding.rows.tolist() == [[2, 0], [1, 1], [2, 1]]  # and none beyond degree 2
    assert adding.expected == pytest.approx(0.25 + 0.05 + 0.025)
    assert (border.places[keys(adding.rows)[2]], len(border.places)) == (5, 6)


def test_the_inverse_of_fewer_nodes_is_a_part_of_that_of_all() -> None:
    nodes = Nodes(interval(), 9)
    part = nodes.inverse[:5, :5] @ nodes.table[:5, :5]
    np.testing.assert_allclose(part, np.eye(5), atol=1e-14)
