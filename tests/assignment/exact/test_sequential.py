"""Programs in a row reach the exact optimum, keep limits, and say where they stopped."""

from collections.abc import Callable, Sequence
from itertools import pairwise

import numpy as np
import pytest
from scipy.linalg import eigh
from scipy.optimize import least_squares, minimize

from eigassign.assignment import (
    Appraisal,
    Cost,
    DesignProblem,
    End,
    LinearConstraint,
    LowerLimit,
    Objective,
    Requirements,
    UpperLimit,
    best_first,
    first_order,
    limit_between,
    minimise,
)
from eigassign.errors import AccuracyError

TIME = np.linspace(0.0, 1.0, 40)
NONE = (np.zeros(0), np.zeros((0, 3)))


def frequencies(y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """f = √(k/m) with stiffness and mass affine in y, (40,) and slopes (40, 3)."""
    k = 4.0 + np.outer(1.0 + TIME, [1.0, 0.0, 0.3]) @ y
    m = 1.0 + np.outer(1.0 + TIME**2, [0.0, 0.8, 0.1]) @ y
    dk, dm = np.outer(1.0 + TIME, [1.0, 0.0, 0.3]), np.outer(1.0 + TIME**2, [0.0, 0.8, 0.1])
    f = np.sqrt(k / m)
    return f, 0.5 * f[:, None] * (dk / k[:, None] - dm / m[:, None])


def towards(wanted: float, scale: float = 1.0) -> Callable[[np.ndarray], Appraisal]:
    def appraise(y: np.ndarray) -> Appraisal:
        f, slopes = frequencies(y)
        return Appraisal(scale * (f / wanted - 1.0), scale * slopes / wanted, *NONE)

    return appraise


def problem(wanted: float = 1.7, **more: object) -> DesignProblem:
    appraise = towards(wanted, 1.0 / np.sqrt(40))
    return DesignProblem(appraise, np.zeros(3), np.array([2.0, 2.0, 5.0]))._replace(**more)


@pytest.mark.parametrize("wanted", [0.9, 1.7, 2.4, 5.0])
def test_the_optimum_is_that_of_bounded_least_squares(wanted: float) -> None:
    asked = problem(wanted)
    start = np.array([1.0, 0.5, 2.0])
    found = minimise(asked, start)
    peers = [
        least_squares(
            lambda y: asked.appraise(y).residual,
            np.clip(x, 1e-6, asked.upper - 1e-6),
            jac=lambda y: asked.appraise(y).slopes,
            bounds=(asked.lower, asked.upper),
            xtol=1e-14,
            ftol=1e-14,
            gtol=1e-14,
        ).cost
        for x in (start, asked.upper, asked.lower)
    ]
    assert found.objective <= 2.0 * min(peers) * (1.0 + 1e-9) + 1e-20
    assert found.end is End.OPTIMAL
    assert first_order(asked, found.y, found.seen)[0] <= 1e-7


def test_every_step_that_is_taken_lowers_the_objective() -> None:
    found = minimise(problem(), np.array([2.0, 0.0, 5.0]))
    values = [step.objective for step in found.steps if step.taken]
    assert len(values) > 1
    assert all(after < before for before, after in pairwise(values))
    assert found.objective == values[-1]
    first = minimise(problem(), np.array([2.0, 0.0, 5.0]), steps=1)
    assert first.end is End.STEPS
    assert len(first.steps) == 1


def test_linear_constraints_hold_and_their_multiplier_is_the_slope_of_the_optimum() -> None:
    def at(limit: float) -> tuple[float, tuple]:
        row = LinearConstraint("sum", np.array([1.0, 1.0, 0.2]), upper=limit)
        found = minimise(problem(2.4, constraints=(row,)), np.array([0.2, 0.1, 0.3]))
        assert row.coefficients @ found.y <= limit + 1e-9
        return found.objective, found.limits

    value, limits = at(0.8)
    (active,) = [limit for limit in limits if limit.kind == "constraint"]
    step = 1e-4
    slope = (at(0.8 - step)[0] - at(0.8 + step)[0]) / (2.0 * step)
    assert active.multiplier == pytest.approx(slope, rel=1e-4)
    assert value > 0.0


def test_the_worst_case_is_that_of_the_epigraph() -> None:
    asked = problem()._replace(appraise=towards(1.7), objective=Objective.WORST_CASE)
    found = minimise(asked, np.array([1.0, 0.5, 2.0]))
    best = np.inf
    for x in ([1.0, 0.5, 2.0], [0.1, 0.1, 0.1], [2.0, 1.0, 4.0]):
        y0 = np.array(x)
        z0 = np.abs(towards(1.7)(y0).residual).max()
        peer = minimize(
            lambda v: v[-1],
            np.append(y0, z0),
            jac=lambda v: np.append(np.zeros(3), 1.0),
            bounds=[(0.0, 2.0), (0.0, 2.0), (0.0, 5.0), (0.0, None)],
            constraints={
                "type": "ineq",
                "fun": lambda v: np.concatenate(
                    [v[-1] - towards(1.7)(v[:3]).residual, v[-1] + towards(1.7)(v[:3]).residual]
                ),
            },
            options={"ftol": 1e-14, "maxiter": 300},
        )
        best = min(best, np.abs(towards(1.7)(np.clip(peer.x[:3], 0, [2, 2, 5])).residual).max())
    assert found.objective <= best * (1.0 + 1e-6)


def test_inequalities_are_met_at_the_least_change_of_the_design() -> None:
    start = np.array([0.5, 1.0, 1.0])

    def appraise(y: np.ndarray) -> Appraisal:
        f, slopes = frequencies(y)
        return Appraisal(y - start, np.eye(3), (1.6 - f) / 1.6, -slopes / 1.6)

    found = minimise(problem(appraise=appraise), start)
    assert found.seen.violation <= 1e-9
    assert frequencies(found.y)[0].min() == pytest.approx(1.6, rel=1e-8)
    random = np.random.default_rng(0)
    for _ in range(2000):
        y = np.clip(found.y + random.normal(0.0, 0.3, 3), 0.0, [2.0, 2.0, 5.0])
        if frequencies(y)[0].min() >= 1.6:
            assert np.sum((y - start) ** 2) >= found.objective * (1.0 - 1e-7)


def test_prices_alone_go_to_the_cheapest_design_that_meets_the_limits() -> None:
    def appraise(y: np.ndarray) -> Appraisal:
        f, slopes = frequencies(y)
        return Appraisal(np.zeros(0), np.zeros((0, 3)), (2.2 - f) / 2.2, -slopes / 2.2)

    prices = np.array([3.0, 1.0, 1.5])
    asked = problem(appraise=appraise, cost=Cost(prices, np.zeros(3)))
    found = minimise(asked, np.array([1.0, 0.0, 1.0]))
    assert found.seen.violation <= 1e-9
    random = np.random.default_rng(1)
    for y in random.uniform(0.0, [2.0, 2.0, 5.0], (5000, 3)):
        if frequencies(y)[0].min() >= 2.2:
            assert prices @ y >= found.objective - 1e-7


@pytest.mark.parametrize(("limit", "dear"), [(0.7, 1.0), (0.7, 3.0), (1.5, 3.0), (1.5, 0.3)])
def test_slopes_balance_where_the_fall_of_the_price_is_round_off(limit: float, dear: float) -> None:
    """The cheapest springs of a chain: first-order optimal, not nearly so."""

    def appraise(y: np.ndarray) -> Appraisal:
        values, slopes = [], []
        for c in np.linspace(-0.5, 1.0, 9):
            mass = np.array([[2.0 + c, 1.0 + c / 2], [1.0 + c / 2, 1.0]])
            lam, modes = eigh(np.diag(y), mass)
            values.append(np.sqrt(lam[0]))
            slopes.append(modes[:, 0] ** 2 / (2.0 * values[-1]))
        f = np.array(values)
        return Appraisal(
            np.zeros(0), np.zeros((0, 2)), (limit - f) / limit, -np.array(slopes) / limit
        )

    start, bounds = np.array([6.0, 3.0]), (np.array([0.5, 0.25]), np.array([50.0, 20.0]))
    prices = np.array([1.0, dear])
    found = minimise(DesignProblem(appraise, *bounds, cost=Cost(prices, start)), start)
    assert found.end is End.OPTIMAL
    assert found.stationarity <= 1e-7
    assert found.seen.violation <= 1e-9


def test_equal_violations_are_told_apart_by_the_objective() -> None:
    missed = [(0.09090909090909097, 6e-3), (0.091, 1e-4), (0.09090909090909100, 7e-4)]
    met = [(1e-10, 3.0), (0.0, 4.0), (5e-10, 2.0)]
    ordered = best_first([*missed, *met], lambda each: each)
    assert [value for _, value in ordered] == [2.0, 3.0, 4.0, 7e-4, 6e-3, 1e-4]


def test_limits_of_frequencies_and_quantities_have_a_side() -> None:
    hz, endless, rows = np.ones(2), np.full(2, np.inf), slice(0, 2)
    limits = (
        LowerLimit("stiff", "", ((1, 1.0),), rows, hz, endless),
        UpperLimit("soft", "", ((2, 1.0),), rows, -endless, hz),
        limit_between(1.0, 2.0, lambda y: (1.0, y), "mass", ""),
    )
    asked = Requirements(limits, np.ones(2))
    sides = [asked.owner(k) for k in (1, 2, 4, 5)]
    assert sides == [("stiff", "lower"), ("soft", "upper"), ("mass", "lower"), ("mass", "upper")]


def test_what_cannot_be_met_is_missed_as_little_as_possible() -> None:
    def appraise(y: np.ndarray) -> Appraisal:
        f, slopes = frequencies(y)
        return Appraisal(y, np.eye(3), (9.0 - f) / 9.0, -slopes / 9.0)

    found = minimise(problem(appraise=appraise), np.array([0.1, 1.0, 0.1]))
    np.testing.assert_allclose(found.y, [2.0, 0.0, 0.0], atol=1e-6)  # stiffest and lightest


def test_a_start_outside_its_limits_is_put_inside() -> None:
    row = LinearConstraint("sum", np.ones(3), upper=1.0)
    found = minimise(problem(constraints=(row,)), np.array([9.0, -3.0, 4.0]))
    assert found.y.sum() <= 1.0 + 1e-9
    assert np.all((found.y >= 0.0) & (found.y <= [2.0, 2.0, 5.0]))


def test_ctrl_c_keeps_the_best_design_so_far() -> None:
    asked, calls = problem(), [0]

    def interrupted(y: np.ndarray) -> Appraisal:
        calls[0] += 1
        if calls[0] == 4:
            raise KeyboardInterrupt
        return asked.appraise(y)

    start = np.array([2.0, 0.0, 5.0])
    found = minimise(asked._replace(appraise=interrupted), start, deadline=np.inf)
    assert found.end is End.INTERRUPTED
    assert found.objective < asked(start, asked.appraise(start))
    calls[0] = 0
    with pytest.raises(KeyboardInterrupt):  # without a deadline no part of it is an answer
        minimise(asked._replace(appraise=interrupted), start)


def test_a_step_to_where_no_design_is_goes_nowhere() -> None:
    asked = problem()

    def partly(y: np.ndarray) -> Appraisal:
        if y[0] > 1.2:
            raise AccuracyError("no answer here")
        return asked.appraise(y)

    found = minimise(asked._replace(appraise=partly), np.array([0.2, 0.5, 0.5]))
    assert found.y[0] <= 1.2
    assert found.objective < asked(found.y * 0.0, asked.appraise(np.array([0.2, 0.5, 0.5])))


def test_a_parameter_on_its_bound_is_exactly_there() -> None:
    found = minimise(problem(5.0), np.array([1.0, 0.5, 2.0]))
    bounds = [limit for limit in found.limits if limit.kind == "bound"]
    assert bounds
    for limit in bounds:
        side = problem().upper if limit.upper else problem().lower
        assert found.y[limit.index] == side[limit.index]


def test_steps_go_on_until_the_limit_is_met_to_round_off() -> None:
    """Steps may land a little beyond a curved limit: f = 1/√(1 + y) ≤ 0.6."""

    def appraise(y: np.ndarray) -> Appraisal:
        f, slope = 1.0 / np.sqrt(1.0 + y), -0.5 * (1.0 + y) ** -1.5
        return Appraisal(y, np.eye(1), f / 0.6 - 1.0, slope[:, None] / 0.6)

    asked = DesignProblem(appraise, np.zeros(1), np.array([5.0]))
    for start in np.linspace(0.0, 5.0, 26):
        found = minimise(asked, np.array([start]))
        # 1e-9 of excess, where it falls by 0.18 per unit of y
        assert found.y[0] == pytest.approx(1.0 / 0.36 - 1.0, abs=1e-8)


def chain(wanted: Sequence[float], n: int = 15) -> DesignProblem:
    """A chain of n masses on n springs, all to be chosen, whose load grows along the way."""
    D = np.eye(n) - np.eye(n, k=-1)

    def appraise(y: np.ndarray) -> Appraisal:
        residual, slopes = [], []
        for load in np.linspace(0.5, 1.5, 4):
            masses = np.append(y[n:-1], y[-1] + load)
            K = D.T @ (y[:n, None] * D)
            lam, phi = eigh(K, np.diag(masses), subset_by_index=[0, len(wanted) - 1])
            f = np.sqrt(lam)
            residual += list(f / wanted - 1.0)
            rates = np.vstack([(D @ phi) ** 2, -lam * phi**2]) / (2.0 * f * wanted)
            slopes += list(rates.T)
        share = 1.0 / np.sqrt(len(residual))
        none = np.zeros(0), np.zeros((0, 2 * n))
        return Appraisal(share * np.array(residual), share * np.array(slopes), *none)

    return DesignProblem(appraise, np.repeat([1.0, 0.1], n), np.repeat([30.0, 3.0], n))


@pytest.mark.parametrize("share", [0.2, 0.8])
def test_thirty_parameters_that_few_residuals_feel_end_first_order_optimal(share: float) -> None:
    """Residuals of 12 rows fall a thousandfold on the way: curvature must keep up with them."""
    asked = chain([0.2, 0.45, 0.7])
    found = minimise(asked, asked.lower + share * (asked.upper - asked.lower))
    assert found.end is End.OPTIMAL
    assert first_order(asked, found.y, found.seen)[0] <= 1e-7
