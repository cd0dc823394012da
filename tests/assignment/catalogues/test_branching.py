from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.optimize import least_squares, linprog, minimize

from eigassign.assignment import (
    Bounds,
    CatalogueProblem,
    ListedValues,
    Relaxed,
    hull,
    search_catalogue,
)
from eigassign.errors import AccuracyError, InfeasibleError, UsageError


@dataclass
class Arm:
    """f = √(k/m) along a path, k and m affine in y ∈ [0, 1]ⁿ, the last column continuous or not.

    The error relative to a frequency that some y has on average; neither convex nor quadratic.
    """

    seed: int
    n_y: int = 7
    size: float = 3.0

    def __post_init__(self):
        rng = np.random.default_rng(self.seed)
        t = np.linspace(0, 1, 30)[:, np.newaxis]
        waves = 1 + 0.5 * np.cos(np.pi * t * np.arange(self.n_y) + rng.uniform(0, 6, self.n_y))
        self.K = self.size * waves * rng.uniform(0, 1, self.n_y) * (rng.random(self.n_y) < 0.7)
        self.M = self.size * waves * rng.uniform(0, 1, self.n_y) * (rng.random(self.n_y) < 0.7)
        self.k0, self.m0 = 1 + 0.3 * np.cos(3 * t[:, 0]), 1 + 0.3 * np.sin(2 * t[:, 0])
        self.calls = 0
        self.f_d = self.frequency(rng.uniform(0, 1, (1, self.n_y))).mean()

    def frequency(self, Y):
        return np.sqrt((self.k0 + Y @ self.K.T) / (self.m0 + Y @ self.M.T))

    def objective(self, Y):
        return np.mean((self.frequency(np.atleast_2d(Y)) / self.f_d - 1) ** 2, axis=1)

    def relax(self, catalogues):
        """Over the hull of a node, by SciPy."""

        def solved(node, near):
            self.calls += 1
            box, rows = hull(catalogues, node, Bounds(np.zeros(self.n_y), np.ones(self.n_y)))
            start = 0.5 * (box.lower + box.upper) if near is None else near
            start = np.clip(start, box.lower, box.upper)
            if rows:
                return self.constrained(start, box, rows)
            free, y = box.upper > box.lower, box.lower.copy()
            if free.any():

                def error(z):
                    y[free] = z
                    return (self.frequency(y) / self.f_d - 1) / np.sqrt(self.k0.size)

                limits = box.lower[free], box.upper[free]
                error(least_squares(error, start[free], bounds=limits, xtol=1e-12, ftol=1e-12).x)
            return y, self.objective(y)[0]

        return solved

    def constrained(self, start, box, rows):
        C = np.array([row.coefficients for row in rows])
        ends = np.array([[row.lower, row.upper] for row in rows])
        found = minimize(
            lambda y: 1e3 * self.objective(y)[0],
            start,
            bounds=np.stack([box.lower, box.upper], axis=1),
            constraints={
                "type": "ineq",
                "fun": lambda y: 1e-12 + np.concatenate([C @ y - ends[:, 0], ends[:, 1] - C @ y]),
            },
            method="SLSQP",
            options={"ftol": 1e-10},
        )
        return found.x, self.objective(found.x)[0]

    def fix(self, catalogues):
        def fixed(rows):
            y = self.design(catalogues, rows)
            return y, self.objective(y)[0]

        return fixed

    def design(self, catalogues, rows):
        y = np.zeros(self.n_y)
        for catalogue, row in zip(catalogues, rows, strict=True):
            y[list(catalogue.columns)] = catalogue.rows[row]
        return y

    def brute_force(self, catalogues):
        places = itertools.product(*(range(c.rows.shape[0]) for c in catalogues))
        return np.sort(self.objective(np.array([self.design(catalogues, r) for r in places])))


class Problem(CatalogueProblem):
    """An arm's relaxations and combinations, or others."""

    def __init__(self, arm, catalogues, relax=None, fix=None):
        super().__init__(catalogues, arm.n_y)
        self.relaxed = relax or arm.relax(catalogues)
        self.fixed = fix or arm.fix(catalogues)

    def relax(self, node, near):
        found = self.relaxed(node, near)
        return None if found is None else Relaxed(*found)

    def fix(self, rows, cutoff):
        return self.fixed(rows)


def lists(seed, n_y, widest):
    """Of random width up to ``widest``, of 2 to 5 rows."""
    rng, first, found = np.random.default_rng(seed + 1000), 0, []
    while first < n_y:
        last = min(first + int(rng.integers(1, widest + 1)), n_y)
        rows = rng.uniform(0, 1, (int(rng.integers(2, 6)), last - first))
        found.append(ListedValues(f"list{first}", tuple(range(first, last)), rows))
        first = last
    return found


@pytest.mark.parametrize(("seed", "widest"), [(0, 1), (1, 1), (2, 1), (3, 3), (4, 3), (5, 2)])
def test_the_best_of_a_nonlinear_model_is_that_of_brute_force(seed, widest):
    arm, catalogues = Arm(seed), lists(seed, 7, widest)
    want = arm.brute_force(catalogues)
    search = search_catalogue(Problem(arm, catalogues))
    assert search.best[0].objective == pytest.approx(want[0], rel=1e-9)
    assert search.lower_bound <= want[0] * (1 + 1e-12)
    assert arm.calls < want.size
    np.testing.assert_array_equal(search.best[0].y, arm.design(catalogues, search.best[0].rows))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10, 90))
def test_so_it_is_on_many_models_narrow_and_wide(seed):
    arm = Arm(seed, size=(1.0, 10.0, 100.0)[seed % 3])
    catalogues = lists(seed, 7, 1 + seed % 2)
    search = search_catalogue(Problem(arm, catalogues))
    assert search.best[0].objective == pytest.approx(arm.brute_force(catalogues)[0], rel=1e-9)


def test_a_start_that_nothing_beats_is_the_answer_even_if_no_relaxation_is_solved():
    arm, catalogues = Arm(9), lists(9, 7, 1)
    best = search_catalogue(Problem(arm, catalogues)).best[0]
    blind = Problem(arm, catalogues, relax=lambda node, near: None)
    search = search_catalogue(blind, starts=[best.rows])
    assert search.best[0].rows == best.rows


def test_combinations_that_are_impossible_are_passed_over():
    arm, catalogues = Arm(10), lists(10, 7, 1)
    fix = arm.fix(catalogues)
    even = lambda rows: fix(rows) if sum(rows) % 2 == 0 else None  # noqa: E731
    search = search_catalogue(Problem(arm, catalogues, fix=even))
    every = itertools.product(*(range(c.rows.shape[0]) for c in catalogues))
    want = min(fix(rows)[1] for rows in every if sum(rows) % 2 == 0)
    assert search.best[0].objective == pytest.approx(want, rel=1e-9)


def test_without_any_possible_combination_the_lists_are_named():
    arm, catalogues = Arm(11, n_y=3), lists(11, 3, 1)
    impossible = Problem(arm, catalogues, fix=lambda rows: None)
    with pytest.raises(InfeasibleError, match="'list0', 'list1', 'list2'") as e:
        search_catalogue(impossible)
    assert e.value.constraints == ("list0", "list1", "list2")
    with pytest.raises(AccuracyError, match="met all limits in 1 nodes"):
        search_catalogue(impossible, seconds=0.0)


def test_a_column_with_two_owners_is_refused():
    twice = [ListedValues("a", (0,), [[1.0]]), ListedValues("b", (0,), [[1.0]])]
    with pytest.raises(UsageError, match="'a' and 'b' both set column 0"):
        Problem(Arm(0), twice)


@pytest.mark.parametrize("n_rows", [1, 2, 4, 9])
@pytest.mark.parametrize("width", [1, 2, 3])
def test_a_hull_holds_its_rows_and_is_exact_for_two_of_them(n_rows, width):
    rng = np.random.default_rng(10 * n_rows + width)
    unit = 10.0 ** rng.uniform(-6, 6, width)
    catalogue = ListedValues(
        "a", tuple(range(1, width + 1)), rng.normal(size=(n_rows + 3, width)) * unit
    )
    node = (tuple(range(2, n_rows + 2)),)
    outer = Bounds(np.append(-7.0, -9 * unit), np.append(7.0, 9 * unit))
    box, rows = hull([catalogue], node, outer)
    assert (box.lower[0], box.upper[0]) == (-7.0, 7.0)
    at = catalogue.rows[list(node[0])]
    for row in rows:
        along = at @ row.coefficients[1:]
        assert row.lower - 1e-12 <= along.min()
        assert along.max() <= row.upper + 1e-12
    lowest, highest = box.lower[1:] / unit, box.upper[1:] / unit
    if n_rows > 2 or width == 1:
        np.testing.assert_array_equal(box.lower[1:], at.min(axis=0))
        np.testing.assert_array_equal(box.upper[1:], at.max(axis=0))
        return
    # any linear function is least at one of the two rows
    C = np.array([row.coefficients[1:] * unit for row in rows]).reshape(-1, width)
    ends = np.array([[row.lower, row.upper] for row in rows]).reshape(-1, 2)
    for cost in rng.normal(size=(5, width)):
        least = linprog(
            cost,
            np.vstack([C, -C]),
            np.concatenate([ends[:, 1], -ends[:, 0]]) + 1e-12,
            bounds=np.stack([lowest, highest], axis=1),
        )
        assert least.fun == pytest.approx((at / unit @ cost).min(), abs=1e-6)
