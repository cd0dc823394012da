"""Combinations of catalogues on problems that are not linear: the same as trying them all."""

from __future__ import annotations

import itertools
import time
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from eigassign.assignment import (
    Appraisal,
    Cost,
    DesignProblem,
    LinearConstraint,
    ListedValues,
    choose,
    minimise,
)
from eigassign.errors import InfeasibleError

Floats = NDArray[np.float64]
MET = 1e-9
slow = pytest.mark.slow  # half a minute each; the pipeline has a short one


def curved(rng: np.random.Generator, n: int, m: int, limit: float) -> DesignProblem:
    """Residuals A y + ½ (B y)² − b of mild curvature, and |y|² at most ``limit``."""
    A, B, b = rng.normal(size=(m, n)), 0.3 * rng.normal(size=(m, n)), rng.normal(size=m)

    def appraise(y: Floats) -> Appraisal:
        residual = A @ y + 0.5 * (B @ y) ** 2 - b
        excess = np.array([(y @ y - limit) / limit])
        return Appraisal(residual, A + (B @ y)[:, None] * B, excess, 2.0 * y[None] / limit)

    return DesignProblem(appraise, np.full(n, -1.0), np.full(n, 1.0))


def lists(rng: np.random.Generator) -> tuple[ListedValues, ...]:
    """Two lists of four values, and one of five pairs; one column stays continuous."""
    values = [np.sort(rng.uniform(-1, 1, (4, 1)), axis=0) for _ in range(2)]
    return (
        ListedValues("a", (0,), values[0]),
        ListedValues("b", (2,), values[1]),
        ListedValues("pair", (1, 4), rng.uniform(-1, 1, (5, 2))),
    )


def brute_force(
    problem: DesignProblem, catalogues: tuple[ListedValues, ...]
) -> list[tuple[float, float, tuple[int, ...]]]:
    found = []
    for rows in itertools.product(*(range(len(own.rows)) for own in catalogues)):
        lower, upper = problem.lower.copy(), problem.upper.copy()
        for own, row in zip(catalogues, rows, strict=True):
            lower[list(own.columns)] = upper[list(own.columns)] = own.rows[row]
        best = minimise(replace(problem, lower=lower, upper=upper), 0.5 * (lower + upper))
        found.append((max(best.seen.violation, MET), best.objective, rows))
    return sorted(found)


@slow
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("limit", [100.0, 1.2])
def test_the_best_combination_is_that_of_brute_force(seed: int, limit: float) -> None:
    rng = np.random.default_rng(seed)
    problem, catalogues = curved(rng, 5, 7, limit), lists(rng)
    chosen = choose(problem, catalogues, [np.zeros(5), np.full(5, 0.3)])
    violation, objective, rows = brute_force(problem, catalogues)[0]
    assert violation == MET
    assert chosen.rows[0] == rows
    assert chosen.optima[0].objective == pytest.approx(objective, rel=1e-7)
    assert chosen.search is not None
    assert chosen.search.exhausted


@slow
def test_where_no_combination_meets_the_limits_the_one_that_misses_them_least_is_found() -> None:
    rng = np.random.default_rng(1)
    problem, catalogues = curved(rng, 5, 7, 0.01), lists(rng)
    chosen = choose(problem, catalogues, [np.zeros(5)])
    violation, _, rows = brute_force(problem, catalogues)[0]
    assert violation > 1.0
    assert chosen.rows[0] == rows
    assert chosen.optima[0].seen.violation == pytest.approx(violation, rel=1e-7)


@slow
def test_combinations_keep_linear_limits() -> None:
    rng = np.random.default_rng(2)
    catalogues = lists(rng)
    row = LinearConstraint("sum", np.array([1.0, 0.0, 1.0, 0.0, 0.0]), -np.inf, -1.2)
    problem = replace(curved(rng, 5, 7, 100.0), constraints=(row,))
    free = choose(replace(problem, constraints=()), catalogues, [np.zeros(5)])
    kept = choose(problem, catalogues, [np.zeros(5)])
    assert free.optima[0].y[[0, 2]].sum() > -1.2  # the limit matters
    assert all(optimum.y[[0, 2]].sum() <= -1.2 for optimum in kept.optima)
    impossible = replace(row, upper=-3.0)
    with pytest.raises(InfeasibleError):
        choose(replace(problem, constraints=(impossible,)), catalogues, [np.zeros(5)])


@slow
def test_without_time_the_nearest_combination_is_the_answer() -> None:
    rng = np.random.default_rng(3)
    problem, catalogues = curved(rng, 5, 7, 100.0), lists(rng)
    start = np.array([catalogues[0].rows[2, 0], *[0.0] * 4])
    start[2] = catalogues[1].rows[1, 0]
    start[[1, 4]] = catalogues[2].rows[3]
    chosen = choose(problem, catalogues, [start], deadline=time.monotonic() - 1.0)
    assert chosen.search is None
    assert chosen.rows[0] == (2, 1, 3)


# --- Prices of whole rows


def priced_list(rng: np.random.Generator, name: str, columns: tuple[int, ...]) -> ListedValues:
    """Nine rows whose price rises with their values, and by chance."""
    rows = rng.uniform(-1, 1, (9, len(columns)))
    prices = rows.sum(axis=1) + rng.normal(0.0, 0.3, 9)
    return ListedValues(name, columns, rows, prices=tuple(prices.tolist()))


@pytest.mark.parametrize("seed", range(20))
def test_the_linear_price_of_some_rows_is_above_none_of_theirs(seed: int) -> None:
    rng = np.random.default_rng(seed)
    own = priced_list(rng, "a", tuple(range(rng.integers(1, 4))))
    rows = tuple(rng.permutation(9)[: rng.integers(1, 10)].tolist())
    slopes, constant = own.price_below(rows)
    prices = np.array(own.prices)[list(rows)]
    room = prices - own.rows[list(rows)] @ slopes - constant
    assert room.min() == pytest.approx(0.0, abs=1e-12)
    if len(rows) <= 1 + len(own.columns):  # a plane through all of them
        assert np.abs(room).max() < 1e-9


@slow
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("wanted", [True, False])
def test_of_more_combinations_than_are_gone_through_the_cheapest_is_found(
    seed: int, wanted: bool
) -> None:
    rng = np.random.default_rng(seed)
    A, b, C = rng.normal(size=(3, 6)), rng.normal(size=3), rng.normal(size=(1, 6))
    catalogues = tuple(
        priced_list(rng, name, columns) for name, columns in
        (("a", (0,)), ("b", (1, 2)), ("c", (3,)), ("d", (4, 5)))
    )  # fmt: skip

    def appraise(y: Floats) -> Appraisal:
        residual, slopes = (A @ y - b, A) if wanted else (np.zeros(0), np.zeros((0, 6)))
        return Appraisal(residual, slopes, C @ y + 0.5, C)

    def price(y: Floats) -> float:
        return sum(own.price(y) for own in catalogues)

    cost = Cost(np.zeros(6), np.zeros(6), listed=price)
    problem = DesignProblem(appraise, np.full(6, -1.0), np.full(6, 1.0), cost=cost)
    every = np.array(list(itertools.product(range(9), repeat=4)))
    Y = np.hstack([own.rows[k] for own, k in zip(catalogues, every.T, strict=True)])
    F = sum(np.array(own.prices)[k] for own, k in zip(catalogues, every.T, strict=True))
    F = F + (np.sum((Y @ A.T - b) ** 2, axis=1) if wanted else 0.0)
    F[(Y @ C.T + 0.5).max(axis=1) > 0.0] = np.inf
    chosen = choose(problem, catalogues, [np.zeros(6)])
    assert chosen.count == 9**4
    assert chosen.optima[0].objective == pytest.approx(F.min(), rel=1e-9)
