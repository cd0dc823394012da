import numpy as np
import pytest
from assignment_problems import Problem, bounded_least_squares, goal, random_problem
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear, minimize

from eigassign.assignment import (
    LinearConstraint,
    relative_rows,
    solve_assignment,
    trapezoidal_weights,
)

LAM = 1.0e6
ACCEPT = 1e-8
INF = np.inf


def solve(l0, slope, lower, upper, y_initial=None, constraints=(), y0=None, names=None, time=None):
    """One goal at λ_d = LAM; l0 and slope (l) relative to it, one row for each sample."""
    slope = np.atleast_2d(np.asarray(slope, dtype=float))
    zero = np.zeros(slope.shape[1])
    return solve_assignment(
        [goal(LAM * np.asarray(l0, dtype=float), LAM * slope, LAM)],
        trapezoidal_weights(np.arange(slope.shape[0]) if time is None else time),
        zero if y0 is None else y0,
        zero if y_initial is None else y_initial,
        (np.asarray(lower, dtype=float), np.asarray(upper, dtype=float)),
        constraints,
        names,
    )


def residuals(result):
    return max(result.primal_residual, result.dual_residual, result.gap)


# ---- by hand


def test_a_multiplier_predicts_what_relaxing_its_limit_gains():
    problem = random_problem(11, n_y=3)
    result = solve_assignment(*problem.arguments)
    limit = next(a for a in result.active if a.multiplier > 0.0)
    j = int(limit.name[1:]) - 1
    step = 1e-6 * (problem.upper - problem.lower)[j]
    sides = {"lower": problem.lower.copy(), "upper": problem.upper.copy()}
    sides[limit.side][j] += step if limit.side == "upper" else -step
    relaxed = solve_assignment(*problem.arguments[:4], (sides["lower"], sides["upper"]))
    gained = result.objective - relaxed.objective
    assert gained == pytest.approx(limit.multiplier * step, rel=1e-4)  # first order in the step


# ---- independent oracles


@pytest.mark.parametrize("seed", range(60))
def test_the_answer_equals_an_independent_bounded_least_squares(seed):
    problem = random_problem(seed)
    result = solve_assignment(*problem.arguments)
    oracle, width = bounded_least_squares(problem), problem.upper - problem.lower
    assert np.max(np.abs(result.y - oracle) / width) <= 1e-6
    assert residuals(result) <= ACCEPT


def test_the_random_problems_reach_from_no_active_bound_to_all():
    active = [
        len(solve_assignment(*p.arguments).active) / p.y0.size
        for p in map(random_problem, range(60))
    ]
    assert min(active) == 0.0
    assert max(active) == 1.0
    assert sum(0.0 < share < 1.0 for share in active) >= 20


def with_constraints(seed):
    """A problem of up to 6 parameters with constraints that its initial design meets."""
    problem, rng = random_problem(seed), np.random.default_rng(1000 + seed)
    width, constraints = problem.upper - problem.lower, []
    for k in range(int(rng.integers(1, 4))):
        row = rng.normal(size=width.size) / width
        value = float(row @ problem.y_initial)
        low = value if rng.random() < 0.3 else -INF
        constraints.append(LinearConstraint(f"c{k}", row, low, value + rng.choice([0.0, 0.2])))
    return problem, constraints


@pytest.mark.parametrize("seed", range(25))
def test_with_constraints_the_answer_equals_a_sequential_quadratic_method(seed):
    problem, constraints = with_constraints(seed)
    result = solve_assignment(*problem.arguments, constraints)
    assert residuals(result) <= ACCEPT
    A, b = relative_rows(problem.goals, problem.weights)
    width = problem.upper - problem.lower
    rows = [
        {"type": "ineq", "fun": lambda z, c=c, s=s: s * (c.coefficients @ to_y(z) - edge(c, s))}
        for c in constraints
        for s in (1.0, -1.0)
        if np.isfinite(edge(c, s))
    ]

    def to_y(z):
        return problem.lower + width * z

    start = (problem.y_initial - problem.lower) / width
    found = minimize(
        lambda z: float(np.sum((A @ (to_y(z) - problem.y0) + b) ** 2)),
        start,
        jac=lambda z: 2.0 * A.T @ (A @ (to_y(z) - problem.y0) + b) * width,
        bounds=[(0.0, 1.0)] * width.size,
        constraints=rows,
        method="SLSQP",
        options={"ftol": 1e-15, "maxiter": 500},
    )
    # the oracle stops at some 1e-8 of the objective, from above or by stepping over a limit, which
    # gains it at most multiplier times step
    gained = sum(a.multiplier * beyond(constraints, a.name, to_y(found.x)) for a in result.active)
    assert result.objective <= found.fun * (1 + 1e-9) + gained + 1e-9
    assert result.objective == pytest.approx(found.fun, rel=1e-6, abs=1e-8)


def beyond(constraints, name, y):
    """How far y lies outside the constraint of that name; 0 for a bound, which the oracle keeps."""
    found = next((c for c in constraints if c.name == name), None)
    value = 0.0 if found is None else float(found.coefficients @ y)
    return 0.0 if found is None else max(found.lower - value, value - found.upper, 0.0)


def edge(constraint, sign):
    return constraint.lower if sign > 0.0 else constraint.upper


# ---- properties

repeatable = settings(derandomize=True, deadline=None, database=None, max_examples=40)
seeds = st.integers(0, 10**6)


@repeatable
@given(seeds, st.integers(-20, 20), st.integers(-20, 20))
def test_units_of_y_and_of_time_and_the_size_of_lambda_do_not_matter(seed, y_power, lam_power):
    p, unit, size = random_problem(seed), 2.0**y_power, 2.0**lam_power
    goals = [
        goal(size * g.model.l0, size / unit * g.model.l, size * g.lam_d, 3.0 * g.weight)
        for g in p.goals
    ]
    other = Problem(
        goals, 60 * p.time_s, unit * p.y0, unit * p.y_initial, unit * p.lower, unit * p.upper
    )
    one, two = solve_assignment(*p.arguments), solve_assignment(*other.arguments)
    width = p.upper - p.lower
    assert np.max(np.abs(two.y / unit - one.y) / width) <= 1e-9
    assert two.objective == pytest.approx(one.objective, rel=1e-9)


@repeatable
@given(seeds)
def test_the_expansion_point_and_the_start_do_not_change_a_determined_answer(seed):
    p = random_problem(seed)
    shift = 0.3 * (p.upper - p.lower)
    goals = [goal(g.model.l0 + g.model.l @ shift, g.model.l, g.lam_d, g.weight) for g in p.goals]
    one = solve_assignment(*p.arguments)
    two = solve_assignment(goals, p.weights, p.y0 + shift, p.lower, p.bounds)
    assert np.max(np.abs(two.y - one.y) / (p.upper - p.lower)) <= 1e-8


# ---- corners


def test_no_parameters_at_all_leave_the_frequencies_as_they_are():
    result = solve([1.1, 0.9], np.zeros((2, 0)), [], [])
    assert result.y.shape == (0,)
    assert result.objective == pytest.approx(0.01, rel=1e-12)
    assert residuals(result) == 0.0


def test_a_fixed_parameter_stays_and_tells_what_freeing_it_would_gain():
    result = solve([1.0, 1.2], [[1, 0], [0, -0.5]], [0.3, 0.0], [0.3, 1.0], names=["a", "b"])
    np.testing.assert_allclose(result.y, [0.3, 0.4], atol=1e-12)
    assert result.y[0] == 0.3
    (limit,) = result.active
    # J = ½ (y1² + …): dJ/dy1 = 0.3, so a smaller y1 is what would help
    assert (limit.name, limit.side) == ("a", "lower")
    assert limit.multiplier == pytest.approx(0.3, rel=1e-10)


@pytest.mark.parametrize(
    ("fast", "lower", "upper"),
    [(1e-6, [0.0, -INF], [INF, INF]), (-0.7, [0.0, 0.0], [1e12, 1.0])],
    ids=["open ranges", "a huge maximum meant as none"],
)
def test_a_wide_range_is_no_obstacle_and_does_not_drown_the_others(fast, lower, upper):
    result = solve([1.2, 1.5], [[-0.5, 0], [0, fast]], lower, upper)
    np.testing.assert_allclose(result.y, [0.4, -0.5 / fast], rtol=1e-10)


# ---- undetermined designs


def test_two_parameters_that_do_the_same_share_the_change_by_their_ranges():
    slope = -0.1 * np.ones((3, 2))  # 10 % a unit: the ranges 1 and 3 are the units
    result = solve([1.1, 1.1, 1.1], slope, [0, 0], [1, 3])
    np.testing.assert_allclose(result.y, [0.1, 0.9], atol=1e-12)  # y ∝ range², in units of range
    assert result.objective <= 1e-24


def test_nothing_that_has_any_effect_leaves_the_initial_design():
    result = solve([1.2], [[0.0, 0.0]], [0, 0], [1, INF], y_initial=[0.3, 0.7])
    np.testing.assert_array_equal(result.y, [0.3, 0.7])
    assert result.undetermined == 2


@pytest.mark.parametrize("seed", range(20))
def test_an_undetermined_answer_is_the_nearest_of_all_optima(seed):
    """Independent: a bounded least squares pulled to the start by a vanishing weight."""
    rng = np.random.default_rng(seed)
    slope, start = 0.1 * rng.normal(size=(2, 5)), rng.random(5)
    result = solve(1.0 + 0.2 * rng.normal(size=2), slope, np.zeros(5), np.ones(5), start)
    pull = 1e-5
    found = lsq_linear(
        np.vstack([slope, pull * np.eye(5)]),
        np.append(slope @ result.y, pull * start),  # what the optimum reaches, reached again
        (0.0, 1.0),
        method="bvls",
        tol=1e-15,
    )
    # the pull spoils the fit by pull² / slope², some 1e-8, and more where bounds meet flatly
    assert np.max(np.abs(found.x - result.y)) <= 1e-4
    assert result.undetermined == 3


@pytest.mark.parametrize("seed", range(10))
def test_degenerate_corners_with_more_constraints_than_parameters_are_solved(seed):
    """Many constraints through one point: working sets that are linearly dependent."""
    rng = np.random.default_rng(seed)
    rows = rng.integers(-2, 3, (12, 3)).astype(float)
    rows = rows[np.any(rows != 0.0, axis=1)]
    constraints = [
        LinearConstraint(f"c{k}", row, upper=0.5 * row.sum()) for k, row in enumerate(rows)
    ]
    l0, slope = 1.0 + rng.normal(size=6), rng.normal(size=(6, 3))
    result = solve(l0, slope, np.zeros(3), np.ones(3), constraints=constraints)
    assert residuals(result) <= ACCEPT


def test_fifty_parameters_of_which_some_hardly_matter_are_certified():
    rng = np.random.default_rng(8)
    slope = rng.normal(size=(152, 50)) * 10.0 ** rng.uniform(-6, 0, 50)
    result = solve(1.0 + 0.3 * rng.normal(size=152), slope, np.zeros(50), np.ones(50))
    assert residuals(result) <= ACCEPT
