"""Lower sets and their product tables, by brute force over all small multi-indices."""

import itertools
import math

import numpy as np
import pytest

from eigassign.errors import UsageError
from eigassign.series import LowerSet, lower_set, partially_linear, total_degree

SETS = {
    "total degree": total_degree(3, 4),
    "one variable": total_degree(1, 7),
    "many variables": total_degree(7, 2),
    "constant": total_degree(3, 0),
    "no variables": total_degree(0, 4),
    "box": lower_set(list(np.ndindex(4, 2, 3))),
    "partially linear": partially_linear(2, 2, 4),
    "corner": lower_set([[0, 0], [1, 0], [2, 0], [3, 0], [0, 1], [0, 2], [1, 1]]),
}


def rows(space: LowerSet) -> set[tuple[int, ...]]:
    return {tuple(row) for row in space.indices.tolist()}


def everything(n: int, top: int) -> set[tuple[int, ...]]:
    return set(itertools.product(range(top + 1), repeat=n))


@pytest.mark.parametrize(("n", "order"), [(1, 5), (2, 4), (3, 6), (5, 3), (12, 2), (4, 0)])
def test_total_degree_has_a_binomial_number_of_members(n: int, order: int) -> None:
    assert len(total_degree(n, order)) == math.comb(n + order, order)
    assert rows(total_degree(n, order)) >= {(0,) * n}
    assert total_degree(n, order).degrees.max() == order


def test_the_papers_arm_needs_35_coefficients_instead_of_70_and_515_instead_of_367290() -> None:
    # design: partially linearised sets at n_q = 2, n_y = 2 and 50, order 4; q1 counts here
    assert len(partially_linear(2, 2, 4)) == 35
    assert len(total_degree(4, 4)) == 70
    assert len(partially_linear(2, 50, 4)) == 515
    assert math.comb(2 + 50 + 4, 4) == 367_290


@pytest.mark.parametrize("order", [0, 1, 3])
def test_partially_linear_keeps_what_the_definition_says(order: int) -> None:
    expected = {r for r in everything(4, order) if sum(r) <= order and r[2] + r[3] <= 1}
    assert rows(partially_linear(2, 2, order)) == expected


@pytest.mark.parametrize("name", SETS)
def test_members_are_sorted_by_degree_with_the_first_variable_leading(name: str) -> None:
    members = SETS[name].indices.tolist()
    assert members == sorted(members, key=lambda r: (sum(r), [-k for k in r]))
    starts, degrees = SETS[name].degree_starts, SETS[name].degrees
    for degree in range(SETS[name].order + 1):
        assert (degrees[starts[degree] : starts[degree + 1]] == degree).all()
    assert starts[-1] == len(members)


@pytest.mark.parametrize("name", SETS)
def test_the_product_table_holds_every_pair_once(name: str) -> None:
    space = SETS[name]
    members = space.indices.tolist()
    place = {tuple(row): k for k, row in enumerate(members)}
    expected = set()
    for i, j in itertools.product(range(len(members)), repeat=2):
        total = tuple(a + b for a, b in zip(members[i], members[j], strict=True))
        if total in place:
            expected.add((i, j, place[total]))
    table = space.table
    found = list(zip(table.left.tolist(), table.right.tolist(), table.target.tolist(), strict=True))
    assert len(found) == len(expected)
    assert set(found) == expected
    assert (np.diff(table.target) >= 0).all()
    assert table.target[table.starts].tolist() == list(range(len(members)))


@pytest.mark.parametrize("name", SETS)
def test_find_knows_members_from_strangers(name: str) -> None:
    space = SETS[name]
    shuffled = np.random.default_rng(0).permutation(len(space))
    np.testing.assert_array_equal(space.find(space.indices[shuffled]), shuffled)
    if space.n_variables:
        strangers = space.indices.copy()
        strangers[:, 0] += space.order + 1
        assert (space.find(strangers) == -1).all()


def test_a_set_may_be_given_in_any_order_and_twice() -> None:
    members = total_degree(2, 3).indices
    mixed = np.vstack([members[::-1], members])
    np.testing.assert_array_equal(lower_set(mixed).indices, members)


def test_oversized_sets_are_refused() -> None:
    with pytest.raises(UsageError, match="200000"):
        total_degree(2, 700)


def test_restricting_to_a_lower_part_works_and_to_another_part_does_not() -> None:
    space = total_degree(2, 4)
    assert rows(lower_set(space.indices[space.degrees <= 2])) == rows(total_degree(2, 2))
    with pytest.raises(UsageError, match="lower set"):
        lower_set(space.indices[space.degrees != 1])


def test_members_cannot_be_changed() -> None:
    with pytest.raises(ValueError, match="read-only"):
        total_degree(2, 2).indices[0, 0] = 5


def test_a_set_whose_products_would_fill_the_memory_is_refused_before_they_are_made(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    large = total_degree(5, 20)
    with pytest.raises(UsageError, match=r"order 20 in 5 variables: .* about 2\.7 GB.*LIMITS=4"):
        _ = large.table
    monkeypatch.setenv("EIGASSIGN_LIMITS", "1e-6")
    with pytest.raises(UsageError, match="lower the order"):
        _ = LowerSet(total_degree(2, 3).indices).table
    monkeypatch.setenv("EIGASSIGN_LIMITS", "1")
    assert len(LowerSet(total_degree(2, 3).indices).table.left) == 35
