"""Optima at which modes meet: found, and known as optima, though the objective has a kink there."""

from collections.abc import Callable

import numpy as np
import pytest
from scipy.optimize import minimize

from eigassign.assignment import (
    AssignedFrequency,
    DesignProblem,
    End,
    Frequencies,
    HighestFrequency,
    LinearConstraint,
    LowerLimit,
    ModeGap,
    Objective,
    Optimum,
    Requirement,
    Requirements,
    first_order,
    minimise,
)

N = 12
TIME = np.linspace(0.0, 1.0, N)
EVERY = slice(0, N)
Matrices = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


def apart(y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two parts that know nothing of each other, stiffened by y_0 and y_1, both by y_2."""
    slopes = np.zeros((N, 2, 2, 3))
    slopes[:, 0, 0, 0] = 2.0 + TIME
    slopes[:, 1, 1, 1] = 3.0 - TIME
    slopes[:, 0, 0, 2] = 0.9
    slopes[:, 1, 1, 2] = 1.6 + 0.3 * TIME
    rest = np.einsum("nijk,k->nij", slopes, y)
    return np.diag([1.0, 1.4]) + rest - 0.2 * np.sum(y**2) * np.eye(2), slopes - 0.4 * np.einsum(
        "ij,k->ijk", np.eye(2), y
    )


def coupled(y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two modes of one symmetric body: y_0 tells them apart, y_1 couples them, y_2 stiffens."""
    D, C = np.diag([1.0, -1.0]), np.array([[0.0, 1.0], [1.0, 0.0]])
    slopes = np.stack([D + 0.3 * C, C - 0.2 * D, 0.5 * np.eye(2)], axis=-1)
    matrix = 4.0 * np.eye(2) + 0.6 * D - 0.3 * C + slopes @ y
    bent = 0.3 * y[2] ** 2
    slopes = slopes - np.einsum("ij,k->ijk", np.eye(2), [0.0, 0.0, 0.6 * y[2]])
    scale = 1.0 + 0.1 * TIME[:, None, None]
    return scale * (matrix - bent * np.eye(2)), scale[..., None] * slopes


def frequencies(matrices: Matrices) -> Callable[[np.ndarray], Frequencies]:
    """f from the eigenvalues f² of 2 × 2 matrices, with all slopes."""

    def response(y: np.ndarray) -> Frequencies:
        A, slopes = matrices(y)
        lam, phi = np.linalg.eigh(A)
        hz = np.sqrt(lam)
        small = np.einsum("nia,nijk,njb->nabk", phi, slopes, phi)
        small = small / (hz[:, :, None] + hz[:, None, :])[..., None]
        return Frequencies(hz, small[:, [0, 1], [0, 1]], small[:, [0], [1]])

    return response


def problem(
    matrices: Matrices,
    asked: tuple[Requirement, ...],
    objective: Objective = Objective.LEAST_SQUARES,
    constraints: tuple[LinearConstraint, ...] = (),
    **more: object,
) -> DesignProblem:
    together = Requirements(asked, np.ones(N), objective, **more)
    response = frequencies(matrices)
    return DesignProblem(
        lambda y: together.appraise(y, response(y)),
        np.array([0.0, 0.0, 0.0]) if matrices is apart else -np.ones(3),
        np.ones(3),
        constraints,
        objective=objective,
    )


def first(hz: float, mode: int = 1) -> AssignedFrequency:
    each = np.full(N, hz)
    return AssignedFrequency(f"mode {mode}", "", ((mode, 1.0),), EVERY, each, each)


def highest(mode: int) -> HighestFrequency:
    edges = np.zeros(N), np.full(N, np.inf)
    return HighestFrequency(f"mode {mode}", "", ((mode, 1.0),), EVERY, *edges)


BUDGET = (LinearConstraint("budget", np.array([1.0, 1.2, 1.5]), upper=1.0),)


def of_epigraph(wanted: float, worst: bool) -> float:
    """The same of two parts apart, by SLSQP on a smooth problem: g_k lies below both branches."""
    n = 1 if worst else N

    def room(v: np.ndarray) -> np.ndarray:
        A = apart(v[:3])[0]
        return np.concatenate([A[:, 0, 0] - v[3:] ** 2, A[:, 1, 1] - v[3:] ** 2])

    limits = [
        {"type": "ineq", "fun": room},
        {"type": "ineq", "fun": lambda v: 1.0 - BUDGET[0].coefficients @ v[:3]},
    ]
    found = minimize(
        lambda v: np.sum((1.0 - v[3:] / wanted) ** 2) / n,
        np.append([0.2, 0.2, 0.2], np.full(n, 1.0)), method="SLSQP", constraints=limits,
        bounds=[(0.0, 1.0)] * 3 + [(0.0, wanted)] * n, options={"ftol": 1e-15, "maxiter": 500},
    )  # fmt: skip
    assert room(found.x).min() > -1e-9
    return float(np.sqrt(found.fun)) if worst else float(found.fun)


# Where both modes of `coupled` are one, and as stiff as y_2 makes them there.
ONE = np.array([*np.linalg.solve([[1.0, -0.2], [0.3, 1.0]], [-0.6, 0.3]), 0.5 / 0.6])


def held_to(found: Optimum, asked: DesignProblem, best: float) -> None:
    assert found.objective == pytest.approx(best, rel=1e-6)
    assert found.end in (End.OPTIMAL, End.STALLED)
    assert first_order(asked, found.y, found.seen)[0] <= 1e-6  # the root of what F is rounded to


@pytest.mark.parametrize("start", [[0.0, 0.0, 0.0], [0.6, 0.0, 0.1], [0.0, 0.7, 0.0]])
def test_two_parts_that_share_a_budget_are_raised_together(start: list[float]) -> None:
    asked = problem(apart, (first(3.0),), constraints=BUDGET)
    found = minimise(asked, np.array(start))
    held_to(found, asked, of_epigraph(3.0, worst=False))
    hz = frequencies(apart)(found.y).hz
    assert (hz[:, 1] / hz[:, 0]).min() < 1.0 + 1e-6


@pytest.mark.parametrize("objective", [Objective.LEAST_SQUARES, Objective.WORST_CASE])
@pytest.mark.parametrize("start", [[0.0, 0.0, 0.0], [-0.8, 0.5, -0.5], [0.3, -0.9, 0.9]])
def test_the_modes_of_a_symmetric_body_are_one_at_the_optimum(
    start: list[float], objective: Objective
) -> None:
    """All samples at once, in a plane of designs where both modes may mix."""
    asked = problem(coupled, (first(4.0),), objective=objective)
    found = minimise(asked, np.array(start))
    np.testing.assert_allclose(found.y, ONE, atol=1e-5)
    held_to(found, asked, asked(ONE, asked.appraise(ONE)))
    assert found.appraisals < 20


@pytest.mark.parametrize("start", [[0.0, 0.0, 0.0], [-0.8, 0.5, -0.5], [0.3, -0.9, 0.9]])
def test_the_lowest_mode_of_a_symmetric_body_is_highest_where_both_are_one(
    start: list[float],
) -> None:
    asked = problem(coupled, (), Objective.LARGEST, aims=(highest(1),))
    found = minimise(asked, np.array(start))
    np.testing.assert_allclose(found.y, ONE, atol=1e-5)
    held_to(found, asked, asked(ONE, asked.appraise(ONE)))
    assert found.objective == pytest.approx(-frequencies(coupled)(ONE).hz.min(), rel=1e-9)
    assert found.end is End.OPTIMAL
    assert found.appraisals < 20


@pytest.mark.parametrize("start", [[0.0, 0.0, 0.0], [0.6, 0.0, 0.1], [0.0, 0.7, 0.0]])
def test_two_parts_that_share_a_budget_are_as_high_as_the_epigraph_says(start: list[float]) -> None:
    asked = problem(apart, (), Objective.LARGEST, BUDGET, aims=(highest(1),))
    found = minimise(asked, np.array(start))
    held_to(found, asked, 3.0 * of_epigraph(3.0, worst=True) - 3.0)
    assert found.end is End.OPTIMAL


def test_a_gap_is_widest_where_the_upper_mode_meets_the_next() -> None:
    """Modes at √(1 + y), √(4 + y), √(6 − y): the first two are farthest apart where two meet."""

    def response(y: np.ndarray) -> Frequencies:
        lam = np.array([1.0 + 0.1 * y[0], 4.0 + y[0], 6.0 - y[0]])
        order, slopes = np.argsort(lam), np.array([0.1, 1.0, -1.0])
        hz = np.sqrt(lam[order])
        each = (slopes[order] / (2.0 * hz))[None, :, None]
        return Frequencies(hz[None], each, np.zeros((1, 2, 1)))

    edges = np.full(1, 0.5), np.full(1, np.inf)
    gap = ModeGap("gap", "", ((2, 1.0), (1, -1.0)), slice(0, 1), *edges, modes=(1, 2))
    both = Requirements((gap,), np.ones(1), Objective.LARGEST, aims=(gap,))
    asked = DesignProblem(
        lambda y: both.appraise(y, response(y)), np.zeros(1), np.full(1, 2.0),
        objective=Objective.LARGEST,
    )  # fmt: skip
    found = minimise(asked, np.zeros(1))
    assert found.y == pytest.approx([1.0], abs=1e-9)
    assert found.end is End.OPTIMAL


def test_a_worst_case_at_a_kink_is_that_of_the_epigraph() -> None:
    asked = problem(apart, (first(3.0),), objective=Objective.WORST_CASE, constraints=BUDGET)
    found = minimise(asked, np.array([0.1, 0.6, 0.0]))
    held_to(found, asked, of_epigraph(3.0, worst=True))


def test_the_second_mode_is_lowered_to_where_it_meets_the_first() -> None:
    """The larger of two branches, from above: the same plane of designs as raising the smaller."""
    asked = problem(coupled, (first(1.0, mode=2),))
    found = minimise(asked, np.array([0.5, 0.5, 0.0]))
    hz = frequencies(coupled)(found.y).hz
    np.testing.assert_allclose(hz[:, 1], hz[:, 0], rtol=1e-6)
    assert found.y[2] == -1.0
    assert found.end is End.OPTIMAL


def test_a_limit_of_mode_one_is_kept_by_both_branches() -> None:
    start = np.array([0.3, 0.1, 0.1])
    edges = np.full(N, 1.35), np.full(N, np.inf)
    limit = LowerLimit("stiff", "", ((1, 1.0),), EVERY, *edges)
    asked = problem(apart, (limit,), least_change=(start, np.ones(3)))
    found = minimise(asked, start)
    assert found.seen.violation <= 1e-9
    assert found.end is End.OPTIMAL

    def room(y: np.ndarray) -> np.ndarray:
        A = apart(y)[0]
        return np.concatenate([A[:, 0, 0], A[:, 1, 1]]) - 1.35**2

    peer = minimize(
        lambda y: np.sum((y - start) ** 2), start, method="SLSQP", bounds=[(0.0, 1.0)] * 3,
        constraints={"type": "ineq", "fun": room}, options={"ftol": 1e-15, "maxiter": 500},
    )  # fmt: skip
    assert found.objective == pytest.approx(peer.fun, rel=1e-6)


def test_beside_a_kink_one_branch_is_no_optimum() -> None:
    """On one side of the kink the branch there has a slope, which is no more balanced."""
    asked = problem(coupled, (first(4.0),))
    away = ONE + np.array([1e-3, 0.0, 0.0])
    assert first_order(asked, away, asked.appraise(away))[0] > 1e-2


def test_neighbours_that_are_both_wanted_at_one_frequency_have_no_kink() -> None:
    asked = problem(coupled, (first(2.3), first(2.3, mode=2)))
    found = minimise(asked, np.array([0.5, 0.5, 0.5]))
    np.testing.assert_allclose(found.y, ONE, atol=1e-5)
    held_to(found, asked, asked(ONE, asked.appraise(ONE)))
