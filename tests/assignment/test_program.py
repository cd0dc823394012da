import numpy as np
import pytest
from assignment_problems import goal, random_problem, wanted
from scipy.integrate import trapezoid

from eigassign.assignment import LinearModel, relative_rows, trapezoidal_weights
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
    goals = [goal(model.l0, model.l, lam_d, weight=7.0)]
    A, b = relative_rows(goals, trapezoidal_weights(time))
    factor = lam_d**2 * (time[-1] - time[0])
    np.testing.assert_allclose(A.T @ A, R / factor, rtol=1e-12)
    # entries of h cancel to a tenth of their terms at most
    np.testing.assert_allclose(A.T @ b, h / factor, rtol=1e-11)


def test_of_a_target_that_varies_the_program_is_the_papers_of_the_relative_model():
    time, model = model_of(1)
    lam_d = 1.2e6 * (1.0 + 0.1 * np.sin(time))
    A, b = relative_rows([goal(model.l0, model.l, lam_d)], trapezoidal_weights(time))
    relative = model.l / lam_d[:, np.newaxis]
    R = trapezoid(np.einsum("ti,tj->tij", relative, relative), time, axis=0)
    h = trapezoid((model.l0 / lam_d - 1.0)[:, np.newaxis] * relative, time, axis=0)
    whole = time[-1] - time[0]
    np.testing.assert_allclose(A.T @ A, R / whole, rtol=1e-12)
    np.testing.assert_allclose(A.T @ b, h / whole, rtol=1e-11)


def test_the_objective_is_the_weighted_mean_square_relative_error_in_lambda():
    problem = random_problem(3, n_y=2, n_t=9)
    A, b = relative_rows(problem.goals, problem.weights)
    y = 0.3 * problem.lower + 0.7 * problem.upper
    time, total, expected = problem.time_s, 0.0, 0.0
    for g in problem.goals:
        error = (g.model.l0 + g.model.l @ (y - problem.y0)) / g.lam_d - 1.0
        expected += g.weight * trapezoid(error**2, time) / (time[-1] - time[0])
        total += g.weight
    assert np.sum((A @ (y - problem.y0) + b) ** 2) == pytest.approx(expected / total, rel=1e-12)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: wanted(np.ones(2), weight=0.0), "weight: 0.0"),
        (lambda: wanted(np.ones(2), weight=np.nan), "weight: nan"),
    ],
)
def test_weights_that_are_no_numbers_above_0_are_refused(make, words):
    with pytest.raises(UsageError, match=words):
        make()


def test_goals_on_some_of_the_samples_count_by_the_time_of_those():
    """J = Σ_i w_i ∫_i e_i² dt / Σ_i w_i ∫_i dt, with the second goal on the last three samples."""
    rng = np.random.default_rng(8)
    weights = rng.uniform(0.1, 2.0, 7)
    whole = goal(1e6 * (1 + rng.random(7)), rng.normal(size=(7, 1)), 1.3e6, weight=0.7)
    l0, slope = 1e6 * (1 + rng.random(3)), rng.normal(size=(3, 1))
    late = goal(l0, slope, 1.1e6, weight=2.0, rows=slice(4, 7))
    b = relative_rows([whole, late], weights)[1]
    e1, e2 = (g.model(np.zeros(1)) / g.lam_d - 1.0 for g in (whole, late))
    above = 0.7 * weights @ e1**2 + 2.0 * weights[4:] @ e2**2
    below = 0.7 * weights.sum() + 2.0 * weights[4:].sum()
    assert b @ b == pytest.approx(above / below, rel=1e-12)
