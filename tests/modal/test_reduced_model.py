"""The reduced model: projections, its accuracy, and the derivatives it shares."""

from typing import Any

import large as held
import numpy as np
import pytest
from chains import model_of, two_link
from large import DRIVES, HELD, large
from spatial_random import random_open

from eigassign import load_case
from eigassign.mechanism import Pencil
from eigassign.modal import project, project_at, project_terms, reduce

# --- Terms of the pencil on a basis: from stacks, from their rows, and some of them at a time


def one_by_one(pencil: Pencil, left: np.ndarray, right: np.ndarray, which: int) -> np.ndarray:
    """Wᵀ A_j V of every term, by a matrix each."""
    terms = (pencil.stiffness, pencil.mass)[which].toarray().T
    return np.array([left.T @ (pencil.sparse(data) @ right) for data in terms])


@pytest.mark.parametrize("drives", DRIVES, ids=str)
def test_terms_are_projected_alike_from_stacks_and_from_their_rows(drives: tuple[Any, Any]) -> None:
    pencil = held.arm(drives).pencil
    V = np.random.default_rng(2).standard_normal((pencil.n_dof, 4))
    for found in (project(pencil, V), project(large(pencil), V)):
        for which in (0, 1):
            right = one_by_one(pencil, V, V, which)
            np.testing.assert_allclose(found[which], right, atol=1e-12 * np.abs(right).max())


def test_terms_of_many_rows_are_projected_in_parts() -> None:
    pencil = held.arm(elements=(900, 800)).pencil  # more than 4000 rows of the terms of M
    V = np.random.default_rng(2).standard_normal((pencil.n_dof, 2))
    found = project(pencil, V)
    for which, weights in enumerate((pencil.stiffness, pencil.mass)):
        for j in range(pencil.n_theta):
            right = V.T @ (pencil.sparse(weights[:, [j]].toarray()[:, 0]) @ V)
            np.testing.assert_allclose(found[which][j], right, atol=1e-12 * np.abs(right).max())
    theta = pencil.theta(np.array([[1.8, 5.3, 0.1, 0.2]]))
    terms = np.array(found) * theta[:, 0, None, None]
    for at, each in zip(project_at(pencil, theta, V.T), terms, strict=True):  # cut as well
        np.testing.assert_allclose(at, each.sum(axis=0), atol=1e-12 * np.abs(each).max())


@pytest.mark.parametrize("limit", [0, 10**6])
def test_many_vectors_are_projected_some_terms_at_a_time(limit: int) -> None:
    pencil = large(held.arm(elements=(1, 1)).pencil, limit)
    rng = np.random.default_rng(2)
    left, right = rng.standard_normal((2, 1500, pencil.n_dof))
    right = right[:900]
    parts = list(project_terms(pencil, left, right, np.arange(pencil.n_theta)))
    assert len(parts) > 2
    for part in parts:
        some = np.arange(pencil.n_theta)[part.terms]
        for each, which in zip(part.values, (0, 1)[part.matrices], strict=True):
            expected = one_by_one(pencil, left.T[:, :3], right.T[:, :3], which)[some]
            size = np.abs(expected).max(initial=0.0)
            np.testing.assert_allclose(each[:, :3, :3], expected, atol=1e-12 * size)


@pytest.mark.parametrize("limit", [0, 10**6])
def test_matrices_are_the_same_from_a_stack_and_from_their_pattern(limit: int) -> None:
    pencil = large(held.arm((HELD, "free"), (2, 1)).pencil, limit)
    theta = pencil.theta(np.array([[1.8, 5.3, 0.1, 0.2], [1.0, 4.0, 0.0, 0.1]]))
    for found, weights in zip(pencil.matrices(theta), (pencil.stiffness, pencil.mass), strict=True):
        for k in range(2):
            right = pencil.sparse(weights @ theta[:, k]).toarray()
            np.testing.assert_allclose(found[k], right, atol=1e-14 * np.abs(right).max())


# --- The reduced model: its accuracy, the derivatives it shares, and where it says that it fails


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


@pytest.mark.parametrize(
    ("modes", "moving", "anywhere"), [((1,), 1e-11, 1e-8), ((1, 2, 3), 1e-9, 1e-9)]
)
def test_guards_bring_six_digits_more_than_the_polynomial_has(arm, modes, moving, anywhere):
    model, q = arm
    reduced = reduce(model.pencil, Q0, Y0, modes, 2)
    assert worst(model, reduced, q, [0.0, 0.0]) < moving
    assert worst(model, reduced, *box(200)) < anywhere


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
    tree, q0 = random_open(seed, "planar")
    model = model_of(tree)
    reduced = reduce(model.pencil, q0, [], (1,), 2)
    q = q0 + np.random.default_rng(seed).uniform(-0.3, 0.3, (7, len(q0)))
    whole = reduced.frequencies(q, [])
    many = np.tile(q, (600, 1))  # 2048 at once at most
    np.testing.assert_allclose(reduced.frequencies(many, [])[-7:], whole, rtol=1e-11)
