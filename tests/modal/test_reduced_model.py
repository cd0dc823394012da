"""The reduced model: its accuracy, the derivatives it shares, and where it says that it fails."""

from __future__ import annotations

import numpy as np
import pytest
from chains import model_of, random_chain, two_link

from eigassign import load_case
from eigassign.errors import UsageError
from eigassign.modal import reduce

Q0, Y0 = np.array([1.817, 5.312]), np.array([0.125, 0.125])
ELBOW = np.pi / 3.0


@pytest.fixture(scope="module")
def arm():
    case = load_case("cases/two_link.yaml")
    return case.model(), case.trajectory.q


def box(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Elbow within ±60° of the expansion point, masses over the whole design box."""
    rng = np.random.default_rng(11)
    q = Q0 + np.column_stack([np.zeros(count), rng.uniform(-ELBOW, ELBOW, count)])
    return q, rng.uniform(0.0, 0.25, (count, 2))


def worst(model, reduced, q, y) -> float:
    pick = np.array(reduced.modes) - 1
    exact = model.frequencies(q, y, max(reduced.modes))[:, pick]
    return float(np.abs(reduced.frequencies(q, y) / exact - 1.0).max())


def test_guards_bring_six_digits_more_than_the_polynomial_has(arm):
    model, q = arm
    reduced = reduce(model.pencil, Q0, Y0, (1,), 2)
    assert worst(model, reduced, q, [0.0, 0.0]) < 1e-11
    assert worst(model, reduced, *box(200)) < 1e-8


def test_three_modes_in_the_basis_reach_1e_9_everywhere(arm):
    model, q = arm
    reduced = reduce(model.pencil, Q0, Y0, (1, 2, 3), 2)
    assert worst(model, reduced, q, [0.0, 0.0]) < 1e-9
    assert worst(model, reduced, *box(200)) < 1e-9


def test_the_error_falls_with_twice_the_order_of_the_vectors():
    """φ to order m makes λ̂ right to order 2m + 1: the error grows as h^(2m + 2)."""
    model = model_of(two_link())
    reduced = reduce(model.pencil, Q0, Y0, (1,), 1)
    h = np.array([0.05, 0.1, 0.2])
    q = Q0 + np.column_stack([0.0 * h, h])
    exact = model.frequencies(q, Y0, 1)[:, 0]
    error = np.abs(reduced.frequencies(q, Y0)[:, 0] / exact - 1.0)
    slope = np.polyfit(np.log(h), np.log(error), 1)[0]
    assert slope == pytest.approx(4.0, abs=0.3)


def test_a_second_expansion_point_makes_the_far_end_exact(arm):
    model, q = arm
    points = np.array([q[0], q[-1]])
    near = reduce(model.pencil, points, Y0, (1,), 1)
    assert worst(model, near, q[-1], Y0) < 1e-11
    assert worst(model, near, q, Y0) < worst(model, reduce(model.pencil, q[0], Y0, (1,), 1), q, Y0)


def test_frequencies_are_never_below_the_exact_ones_beyond_round_off(arm):
    model, q = arm
    reduced = reduce(model.pencil, Q0, Y0, (1, 2), 1)
    exact = model.frequencies(q, [0.0, 0.0], 2)
    assert (reduced.frequencies(q, [0.0, 0.0]) > exact * (1.0 - 1e-11)).all()


def test_the_sparse_path_gives_the_same_model_as_the_dense_one():
    """100 elements a link is far above every dense limit; their round-off is all that is left."""
    model = model_of(two_link(elements=(100, 100)))
    reduced = reduce(model.pencil, Q0, Y0, (1, 2), 2)
    q, y = box(5)
    exact = model.frequencies(q, y, 2)
    np.testing.assert_allclose(reduced.frequencies(q, y), exact, rtol=1e-5)


@pytest.mark.parametrize("seed", [3, 7, 19])
def test_chunks_do_not_show(seed):
    tree, q0 = random_chain(seed)
    model = model_of(tree)
    reduced = reduce(model.pencil, q0, [], (1,), 2)
    q = q0 + np.random.default_rng(seed).uniform(-0.3, 0.3, (7, len(q0)))
    whole = reduced.frequencies(q, [])
    many = np.tile(q, (600, 1))  # 2048 at once at most
    np.testing.assert_allclose(reduced.frequencies(many, [])[-7:], whole, rtol=1e-11)


@pytest.mark.parametrize("half_order", [-1, 11])
def test_an_impossible_order_is_refused(arm, half_order):
    with pytest.raises(UsageError, match="half_order"):
        reduce(arm[0].pencil, Q0, Y0, (1,), half_order)


def test_more_modes_than_there_are_is_refused(arm):
    with pytest.raises(UsageError, match="modes"):
        reduce(arm[0].pencil, Q0, Y0, (50,), 1)
