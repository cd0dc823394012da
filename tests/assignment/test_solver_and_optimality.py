import ctypes
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from assignment_problems import goal, random_problem

from eigassign.assignment import (
    Bounds,
    Certificate,
    LinearConstraint,
    ProgramAnswer,
    Status,
    best_candidate,
    build_program,
    judge,
    scaled_program,
    solve_assignment,
    solve_program,
    solve_scaled,
    unscaled,
)
from eigassign.errors import AccuracyError, UsageError


def small_program(upper=0.1):
    """J = (0.2 − 0.5 y)² on [0, upper], y + 0 ≤ 5."""
    box, free = (
        Bounds(np.zeros(1), np.array([upper])),
        LinearConstraint("loose", np.array([1.0]), upper=5.0),
    )
    return build_program([goal([1.2e6], [[-5e5]], 1e6)], [1.0], [0.0], [0.0], box, [free])


def answer(y, mu, nu=0.0):
    return ProgramAnswer(np.array([y]), np.array([mu]), np.array([nu]))


def test_the_optimum_by_hand_has_no_residual():
    # at the bound 0.1: dJ/dy = −0.15, balanced by the bound's multiplier
    assert judge(small_program(), answer(0.1, 0.15)).worst <= 1e-15


# Units by hand: parameter 0.1 (its range), a = 0.5 · 0.1 = 0.05, e = 0.2, objective 0.05 · 0.2.
# Constraint row: 1 · 0.1.
@pytest.mark.parametrize(
    ("wrong", "expected"),
    [
        (answer(0.1, 0.10), Certificate(0.0, 0.05 * 0.1 / 0.02, 0.0)),
        (answer(0.08, 0.16), Certificate(0.0, 0.0, 0.16 * 0.02 / 0.02)),
        (answer(0.12, 0.14), Certificate(0.02 / 0.1, 0.0, 0.14 * 0.02 / 0.02)),
        (answer(5.2, -2.4), Certificate(51.0, 0.0, 2.4 * 5.2 / 0.02)),
        (answer(0.1, 0.0, 0.15), Certificate(0.0, 0.0, 0.15 * 4.9 / 0.02)),
        (answer(0.1, 0.3, -0.15), Certificate(0.0, 0.0, np.inf)),  # no lower limit there
    ],
)
def test_each_residual_is_what_it_is_by_hand(wrong, expected):
    found = judge(small_program(), wrong)
    assert found.primal_residual == pytest.approx(expected.primal_residual, rel=1e-13, abs=1e-13)
    assert found.dual_residual == pytest.approx(expected.dual_residual, abs=1e-13)
    assert found.gap == pytest.approx(expected.gap, rel=1e-13, abs=1e-13)
    assert not found.accepted


def test_the_rounding_of_a_sum_of_large_numbers_is_not_held_against_it():
    low = np.full(3, 1e9)  # ranges of 1: a float64 at 1e9 is within 1e-7 of any number
    share = np.array([0.1, 0.7, 1.0 / 3.0])
    value = float(share @ (low + 0.3))
    total = LinearConstraint("total", share, value, value)
    model = goal(np.full(3, 1.2e6), -1e5 * np.eye(3), 1e6)
    result = solve_assignment([model], [0.5, 1.5, 1.0], low, low, Bounds(low, low + 1), [total])
    assert share @ result.dy == pytest.approx(0.3 * share.sum(), abs=1e-6)


def test_the_last_bit_of_a_sum_of_large_numbers_is_no_violation_but_a_hundred_are():
    model, box = goal([1.2e6], [[-5e5]], 1e6), Bounds(np.array([1e9]), np.array([1e9 + 1]))
    for bits, met in ((1, True), (100, False)):
        value = 1e9 + bits * np.spacing(1e9)
        limit = LinearConstraint("limit", np.array([1.0]), lower=value)
        program = build_program([model], [1.0], [1e9], [1e9], box, [limit])
        assert (judge(program, answer(1e9, 0.0)).primal_residual == 0.0) is met


def test_an_answer_within_rounding_of_a_bound_is_on_it():
    program = small_program(upper=0.3)
    scaled = scaled_program(program)
    for x, y in ((1e-11, 0.0), (scaled.upper[0] - 1e-11, 0.3)):
        assert unscaled(program, scaled, np.array([x]), np.zeros(2)).y[0] == y


@pytest.mark.parametrize("seed", range(12))
def test_a_disturbed_optimum_is_rejected_and_withheld_and_a_good_one_preferred(seed):
    problem = random_problem(seed)
    program = build_program(*problem.arguments)
    good = solve_program(program).candidates[0]
    assert judge(program, good).accepted
    width = problem.upper - problem.lower
    inside = np.where(good.y > 0.5 * (problem.lower + problem.upper), -1.0, 1.0) * width
    moved = replace(good, y=good.y + 1e-3 * inside)
    units = 2.0 * program.scales.objective / program.scales.y
    off = replace(good, bound_multipliers=good.bound_multipliers + 1e-5 * units)
    for wrong in (moved, off):
        assert not judge(program, wrong).accepted
        assert best_candidate(program, [wrong, good])[0] is good
    with pytest.raises(AccuracyError, match=r"to 1e-08: primal .*e.*, dual .*e.*, gap .*e"):
        best_candidate(program, [moved, off])


# ---- OSQP's traps


@pytest.mark.parametrize("part", ["A", "b", "G", "lower", "upper"])
def test_not_a_number_never_reaches_the_solver(part, monkeypatch):
    scaled = scaled_program(small_program())
    poisoned = np.array(getattr(scaled, part))
    poisoned.flat[0] = np.nan
    monkeypatch.setitem(sys.modules, "osqp", SimpleNamespace(OSQP=None))  # cannot be called
    with pytest.raises(UsageError):
        solve_scaled(replace(scaled, **{part: poisoned}))


def fake_osqp(monkeypatch, status, x=2143289344.0, y=2143289344.0):
    """An OSQP that ends with ``status`` and these numbers; returns what it was called with."""
    seen = {}

    class Fake:
        def __init__(self, algebra):
            seen["algebra"] = algebra

        def setup(self, P, q, A, l, u, **settings):  # noqa: E741
            seen.update(P=P.toarray(), settings=settings, shape=A.shape)

        def solve(self, raise_error):
            seen["raise_error"] = raise_error
            m, n = seen["shape"]
            info = SimpleNamespace(status_val=int(status), iter=25)
            return SimpleNamespace(info=info, x=np.full(n, x), y=np.full(m, y))

    monkeypatch.setitem(sys.modules, "osqp", SimpleNamespace(OSQP=Fake))
    return seen


def test_an_interrupt_that_osqp_swallowed_is_raised_again(monkeypatch):
    fake_osqp(monkeypatch, Status.INTERRUPTED)
    with pytest.raises(KeyboardInterrupt):
        solve_assignment(*random_problem(0).arguments)


def test_osqp_is_given_the_upper_triangle_and_asked_for_more_than_is_accepted(monkeypatch):
    seen = fake_osqp(monkeypatch, Status.MAX_ITER_REACHED)
    scaled = scaled_program(build_program(*random_problem(0, n_y=4).arguments))
    solve_scaled(scaled)
    np.testing.assert_array_equal(seen["P"], np.triu(scaled.P))
    assert seen["raise_error"] is False
    settings = seen["settings"]
    assert max(settings["eps_abs"], settings["eps_rel"]) <= 1e-9
    assert settings["verbose"] is False
    assert settings["polishing"] is False  # it prints, and may spoil


FAILURES = [s for s in Status if s not in (Status.SOLVED, Status.INTERRUPTED)]


@pytest.mark.parametrize("status", FAILURES)
def test_without_help_from_osqp_the_active_set_finds_the_same_optimum(status, monkeypatch):
    total = [LinearConstraint("c", np.array([1.0, 1.0, 1.0]), upper=1e12)]
    for seed in range(3):
        problem = random_problem(seed, n_y=3)
        expected = solve_assignment(*problem.arguments, total)
        with monkeypatch.context() as patch:
            fake_osqp(patch, status)
            found = solve_assignment(*problem.arguments, total)
        width = problem.upper - problem.lower
        assert np.max(np.abs(found.y - expected.y) / width) <= 1e-9
        assert found.status == f"solved (active set; {status.words})"


def test_an_equality_said_twice_does_no_harm(monkeypatch):
    fake_osqp(monkeypatch, Status.MAX_ITER_REACHED)
    twice = [
        LinearConstraint("same", np.array([1.0, -1.0]), 0.0, 0.0),
        LinearConstraint("again", np.array([-2.0, 2.0]), 0.0, 0.0),
    ]
    model = goal([0.0, -1e6], 1e6 * np.eye(2), 1e6)
    box = Bounds(np.full(2, -9.0), np.full(2, 9.0))
    found = solve_assignment([model], [0.5, 0.5], [0.0, 0.0], [0.0, 0.0], box, twice)
    np.testing.assert_allclose(found.y, [1.5, 1.5], rtol=1e-12)


@pytest.mark.parametrize("offset", [0.0, 1e-9, -1e-7, 1e-3])
def test_what_osqp_calls_solved_is_polished_to_round_off(offset, monkeypatch):
    problem = random_problem(3, n_y=3)
    fake_osqp(monkeypatch, Status.SOLVED, x=offset, y=0.0)
    found = solve_assignment(*problem.arguments)
    assert max(found.primal_residual, found.dual_residual, found.gap) <= 1e-12


def test_solving_prints_nothing(capfd):
    for seed in range(30):
        solve_assignment(*random_problem(seed).arguments)
    ctypes.CDLL(None).fflush(None)  # what C wrote, too
    out, err = capfd.readouterr()
    assert (out, err) == ("", "")
