from types import SimpleNamespace

import numpy as np
import osqp
import pytest
from assignment_problems import goal, random_problem

from eigassign.assignment import (
    LinearConstraint,
    Program,
    judge,
    relative_rows,
    solve_assignment,
    solve_program,
)
from eigassign.errors import AccuracyError, UsageError

# ½ (0.2 − 0.5 x)² with 0 ≤ x ≤ 0.1, x ≤ 5
SMALL = Program(
    A=np.array([[-0.5]]),
    b=np.array([0.2]),
    G=np.ones((2, 1)),
    lower=np.array([0.0, -np.inf]),
    upper=np.array([0.1, 5.0]),
    cost=np.zeros(1),
)


def residuals(x, mu, nu=0.0):
    return judge(SMALL, np.array([x]), np.array([mu, nu]))


def test_the_optimum_by_hand_has_no_residual():
    # at the bound 0.1 the slope is −0.075, balanced by the bound's multiplier
    assert max(residuals(0.1, 0.075)) <= 1e-15
    x, mu, *_ = solve_program(SMALL)
    np.testing.assert_allclose([*x, *mu], [0.1, 0.075, 0.0], rtol=1e-12)


@pytest.mark.parametrize(
    ("wrong", "expected"),
    [
        ((0.1, 0.05), (0.0, 0.025, 0.0)),
        ((0.08, 0.08), (0.0, 0.0, 0.08 * 0.02)),
        ((0.12, 0.07), (0.02, 0.0, 0.07 * 0.02)),
        ((5.2, -1.2), (5.1, 0.0, 1.2 * 5.2)),
        ((0.1, 0.0, 0.075), (0.0, 0.0, 0.075 * 4.9)),
        ((0.1, 0.15, -0.075), (0.0, 0.0, np.inf)),  # no lower limit there
    ],
)
def test_each_residual_is_what_it_is_by_hand(wrong, expected):
    assert residuals(*wrong) == pytest.approx(expected, rel=1e-13, abs=1e-13)


def test_the_rounding_of_a_sum_of_large_numbers_is_not_held_against_it():
    low = np.full(3, 1e9)  # ranges of 1: a float64 at 1e9 is within 1e-7 of any number
    share = np.array([0.1, 0.7, 1.0 / 3.0])
    value = float(share @ (low + 0.3))
    total = LinearConstraint("total", share, value, value)
    model = goal(np.full(3, 1.2e6), -1e5 * np.eye(3), 1e6)
    result = solve_assignment([model], [0.5, 1.5, 1.0], low, low, (low, low + 1), [total])
    assert share @ (result.y - low) == pytest.approx(0.3 * share.sum(), abs=1e-6)


@pytest.mark.parametrize("seed", range(12))
def test_a_disturbed_optimum_is_told_by_its_residuals(seed):
    problem = random_problem(seed)
    A, b = relative_rows(problem.goals, problem.weights)
    width = problem.upper - problem.lower
    n, size = len(width), np.linalg.norm(A * width)
    error = A @ (problem.lower - problem.y0) + b
    program = Program(
        A * width / size, error / size, np.eye(n), np.zeros(n), np.ones(n), np.zeros(n)
    )
    x, mu, *_ = solve_program(program, np.zeros(n))
    assert max(judge(program, x, mu)) <= 1e-12
    inside = np.where(x > 0.5, -1.0, 1.0)
    assert max(judge(program, x + 1e-2 * inside, mu)) > 1e-8
    assert max(judge(program, x, mu + 1e-5)) > 1e-8


@pytest.mark.parametrize("part", ["A", "b", "G", "lower", "upper", "cost"])
def test_not_a_number_never_reaches_the_solver(part):
    poisoned = np.array(getattr(SMALL, part))
    poisoned.flat[0] = np.nan
    with pytest.raises(UsageError):
        solve_program(SMALL._replace(**{part: poisoned}), np.zeros(1))


def test_an_equality_said_twice_does_no_harm():
    twice = [
        LinearConstraint("same", np.array([1.0, -1.0]), 0.0, 0.0),
        LinearConstraint("again", np.array([-2.0, 2.0]), 0.0, 0.0),
    ]
    model = goal([0.0, -1e6], 1e6 * np.eye(2), 1e6)
    box = (np.full(2, -9.0), np.full(2, 9.0))
    found = solve_assignment([model], [0.5, 0.5], [0.0, 0.0], [0.0, 0.0], box, twice)
    np.testing.assert_allclose(found.y, [1.5, 1.5], rtol=1e-12)


@pytest.mark.parametrize("offset", [0.0, 1e-9, -1e-7])
def test_a_start_that_misses_limits_a_little_ends_at_round_off(offset):
    rows, n = np.random.default_rng(3).normal(size=(5, 3)), 3
    program = Program(rows, 4.0 * rows.sum(axis=1), np.eye(n), -np.ones(n), np.ones(n), np.zeros(n))
    x, mu, *_ = solve_program(program, -np.ones(n) + offset)
    assert max(judge(program, x, mu)) <= 1e-12


def test_an_answer_whose_residuals_are_too_large_is_withheld(monkeypatch):
    exact, bounded = np.linalg.lstsq, random_problem(0, n_y=4)
    assert solve_assignment(*bounded.arguments).active

    def disturbed(size):
        return lambda A, b, rcond: (exact(A, b, rcond)[0] + size,)

    monkeypatch.setattr(np.linalg, "lstsq", disturbed(1e-11))
    solve_assignment(*bounded.arguments)
    monkeypatch.setattr(np.linalg, "lstsq", disturbed(1e-6))
    with pytest.raises(AccuracyError, match=r"to 1e-08: primal .*e.*, dual .*e.*, gap .*e"):
        solve_assignment(*bounded.arguments)


# ---- OSQP


class Ended(osqp.OSQP):
    """An OSQP that does not say solved, and whose x is no number then."""

    status = osqp.SolverStatus.OSQP_MAX_ITER_REACHED

    def solve(self, **how):
        assert how == {"raise_error": False}
        n = super().solve(**how).x.size
        info = SimpleNamespace(status_val=int(self.status), iter=25)
        return SimpleNamespace(info=info, x=np.full(n, 2143289344.0))


@pytest.mark.parametrize("seed", range(4))
def test_without_osqp_the_active_set_finds_the_same_optimum(seed, monkeypatch):
    problem = random_problem(seed, n_y=3)
    expected = solve_assignment(*problem.arguments)
    assert (expected.status, expected.iterations > 0) == ("solved", True)
    monkeypatch.setattr(osqp, "OSQP", Ended)
    found = solve_assignment(*problem.arguments)
    assert (found.status, found.iterations) == ("max iter reached", 25)
    width = problem.upper - problem.lower
    assert np.max(np.abs(found.y - expected.y) / width) <= 1e-9


def test_an_interrupt_that_osqp_swallowed_is_raised_again(monkeypatch):
    monkeypatch.setattr(osqp, "OSQP", Ended)
    monkeypatch.setattr(Ended, "status", osqp.SolverStatus.OSQP_SIGINT)
    with pytest.raises(KeyboardInterrupt):
        solve_assignment(*random_problem(0).arguments)


def test_solving_prints_nothing(capfd):
    for seed in range(30):
        solve_assignment(*random_problem(seed).arguments)
    assert capfd.readouterr() == ("", "")
