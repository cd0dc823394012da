"""Terms of the pencil on a basis: from stacks, from their rows, and some of them at a time."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from large import DRIVES, HELD, arm, large

from eigassign.mechanism import Pencil
from eigassign.modal import project, project_at, project_terms


def one_by_one(pencil: Pencil, left: np.ndarray, right: np.ndarray, which: int) -> np.ndarray:
    """Wᵀ A_j V of every term, by a matrix each."""
    terms = (pencil.stiffness, pencil.mass)[which].toarray().T
    return np.array([left.T @ (pencil.sparse(data) @ right) for data in terms])


@pytest.mark.parametrize("drives", DRIVES, ids=str)
def test_terms_are_projected_alike_from_stacks_and_from_their_rows(drives: tuple[Any, Any]) -> None:
    pencil = arm(drives).pencil
    V = np.random.default_rng(2).standard_normal((pencil.n_dof, 4))
    for found in (project(pencil, V), project(large(pencil), V)):
        for which in (0, 1):
            right = one_by_one(pencil, V, V, which)
            np.testing.assert_allclose(found[which], right, atol=1e-12 * np.abs(right).max())


def test_terms_of_many_rows_are_projected_in_parts() -> None:
    pencil = arm(elements=(900, 800)).pencil  # more than 4000 rows of the terms of M
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
    pencil = large(arm(elements=(1, 1)).pencil, limit)
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


def test_no_rows_have_no_projection() -> None:
    for pencil in (arm().pencil, large(arm().pencil)):
        V = np.ones((2, pencil.n_dof))
        for part in project_terms(pencil, V[:0], V, np.arange(pencil.n_theta)):
            assert part.values.shape[2:] == (0, 2)


@pytest.mark.parametrize("limit", [0, 10**6])
def test_matrices_are_the_same_from_a_stack_and_from_their_pattern(limit: int) -> None:
    pencil = large(arm((HELD, "free"), (2, 1)).pencil, limit)
    theta = pencil.theta(np.array([[1.8, 5.3, 0.1, 0.2], [1.0, 4.0, 0.0, 0.1]]))
    for found, weights in zip(pencil.matrices(theta), (pencil.stiffness, pencil.mass), strict=True):
        for k in range(2):
            right = pencil.sparse(weights @ theta[:, k]).toarray()
            np.testing.assert_allclose(found[k], right, atol=1e-14 * np.abs(right).max())
