import numpy as np
import pytest
from assignment_problems import goal, random_problem, wanted
from scipy.integrate import trapezoid

from eigassign.assignment import (
    Bounds,
    LinearConstraint,
    LinearModel,
    build_program,
    scaled_program,
    trapezoidal_weights,
)
from eigassign.errors import UsageError


def model_of(seed, n_t=30, n_y=3):
    rng = np.random.default_rng(seed)
    time = np.sort(rng.uniform(0.0, 2.0, n_t))
    return time, LinearModel(1e6 * (1 + rng.random(n_t)), 1e6 * rng.normal(size=(n_t, n_y)))


def test_the_program_of_one_constant_target_is_the_papers_up_to_a_factor():
    """R = ∫ l lᵀ dt and h = ∫ (l0 − λ_d) l dt of eqs. (13)–(14), by SciPy's trapezoidal rule."""
    time, model = model_of(2)
    lam_d = 1.3e6
    R = trapezoid(np.einsum("ti,tj->tij", model.l, model.l), time, axis=0)
    h = trapezoid((model.l0 - lam_d)[:, np.newaxis] * model.l, time, axis=0)
    program = build_program(
        [goal(model.l0, model.l, lam_d, weight=7.0)],
        trapezoidal_weights(time),
        np.zeros(3),
        np.zeros(3),
        Bounds(-np.ones(3), np.ones(3)),
    )
    factor = lam_d**2 * (time[-1] - time[0])
    np.testing.assert_allclose(program.A.T @ program.A, R / factor, rtol=1e-12)
    # entries of h cancel to a tenth of their terms at most
    np.testing.assert_allclose(program.A.T @ program.b, h / factor, rtol=1e-11)


def test_of_a_target_that_varies_the_program_is_the_papers_of_the_relative_model():
    time, model = model_of(1)
    lam_d = 1.2e6 * (1.0 + 0.1 * np.sin(time))
    program = build_program(
        [goal(model.l0, model.l, lam_d)],
        trapezoidal_weights(time),
        np.zeros(3),
        np.zeros(3),
        Bounds(-np.ones(3), np.ones(3)),
    )
    relative = model.l / lam_d[:, np.newaxis]
    R = trapezoid(np.einsum("ti,tj->tij", relative, relative), time, axis=0)
    h = trapezoid((model.l0 / lam_d - 1.0)[:, np.newaxis] * relative, time, axis=0)
    whole = time[-1] - time[0]
    np.testing.assert_allclose(program.A.T @ program.A, R / whole, rtol=1e-12)
    np.testing.assert_allclose(program.A.T @ program.b, h / whole, rtol=1e-11)


def test_the_objective_is_the_weighted_mean_square_relative_error_in_lambda():
    problem = random_problem(3, n_y=2, n_t=9)
    program = build_program(*problem.arguments)
    y = 0.3 * problem.lower + 0.7 * problem.upper
    time, total, expected = problem.time_s, 0.0, 0.0
    for g in problem.goals:
        error = (g.model.l0 + g.model.l @ (y - problem.y0)) / g.lam_d - 1.0
        expected += g.weight * trapezoid(error**2, time) / (time[-1] - time[0])
        total += g.weight
    assert program.objective(y) == pytest.approx(expected / total, rel=1e-12)


def test_the_gradient_is_the_slope_of_the_objective():
    problem = random_problem(4, n_y=3)
    program = build_program(*problem.arguments)
    y, step = problem.y_initial, 1e-3 * (problem.upper - problem.lower)
    for j, d in enumerate(np.diag(step)):
        slope = (program.objective(y + d) - program.objective(y - d)) / (2.0 * step[j])
        # central differences of a quadratic are exact but for cancellation over the step
        assert program.gradient(y)[j] == pytest.approx(slope, rel=1e-8)


def test_the_scaled_program_has_the_same_objective_up_to_its_scale_and_a_constant():
    problem = random_problem(5, n_y=4)
    limit = LinearConstraint("sum", 1.0 / (problem.upper - problem.lower), upper=3.0)
    program = build_program(*problem.arguments, [limit])
    scaled, unit = scaled_program(program), program.scales
    rng = np.random.default_rng(0)
    offsets = []
    for _ in range(4):
        x = rng.uniform(scaled.lower[:4], scaled.upper[:4])
        y = program.y_start + unit.y * x
        half = 0.5 * x @ scaled.P @ x + scaled.c @ x
        offsets.append(program.objective(y) / (2.0 * unit.objective) - half)
        inside = scaled.upper[4] - scaled.G[4] @ x
        assert inside * unit.rows[0] == pytest.approx(3.0 - limit.coefficients @ y, abs=1e-12)
    assert np.ptp(offsets) <= 1e-13 * max(1.0, abs(offsets[0]))


BOX = Bounds(np.zeros(1), np.ones(1))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: wanted(np.array([1.0, 0.0])), "above 0 Hz"),
        (lambda: wanted(np.ones(2), weight=0.0), "weight: 0.0"),
        (lambda: wanted(np.ones(2), weight=np.nan), "weight: nan"),
    ],
)
def test_goals_that_are_no_numbers_above_0_are_refused(make, words):
    with pytest.raises(UsageError, match=words):
        make()


def test_goals_on_some_of_the_samples_count_by_the_time_of_those():
    """J = Σ_i w_i ∫_i e_i² dt / Σ_i w_i ∫_i dt, with the second goal on the last three samples."""
    rng = np.random.default_rng(8)
    weights = rng.uniform(0.1, 2.0, 7)
    whole = goal(1e6 * (1 + rng.random(7)), rng.normal(size=(7, 1)), 1.3e6, weight=0.7)
    l0, slope = 1e6 * (1 + rng.random(3)), rng.normal(size=(3, 1))
    late = goal(l0, slope, 1.1e6, weight=2.0, rows=slice(4, 7))
    program = build_program([whole, late], weights, [0.0], [0.0], BOX)
    e1, e2 = (g.model(np.zeros(1)) / g.lam_d - 1.0 for g in (whole, late))
    above = 0.7 * weights @ e1**2 + 2.0 * weights[4:] @ e2**2
    below = 0.7 * weights.sum() + 2.0 * weights[4:].sum()
    assert program.objective(np.zeros(1)) == pytest.approx(above / below, rel=1e-12)
