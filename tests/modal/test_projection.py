"""Terms of the pencil on a basis: from stacks, from their rows, and cut into pieces."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from large import DRIVES, HELD, arm, sparsely

from eigassign.mechanism.assembly import pencil as pencil_module
from eigassign.modal import projection


@pytest.mark.parametrize("drives", DRIVES, ids=str)
def test_terms_are_projected_alike_from_stacks_and_from_their_rows(
    drives: tuple[Any, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    V = np.random.default_rng(2).standard_normal((arm(drives).n_dof, 4))
    full = projection.project(arm(drives).pencil, V)
    thin = sparsely(monkeypatch, lambda: projection.project(arm(drives).pencil, V))
    monkeypatch.setattr(projection, "CHUNK", 7)  # terms cut into pieces
    cut = sparsely(monkeypatch, lambda: projection.project(arm(drives).pencil, V))
    monkeypatch.setattr(projection, "PIECE", 70)  # and some terms at a time
    few = projection.project(arm(drives).pencil, V)
    fewer = sparsely(monkeypatch, lambda: projection.project(arm(drives).pencil, V))
    for right, *others in zip(full, thin, cut, few, fewer, strict=True):
        for found in others:
            np.testing.assert_allclose(found, right, atol=1e-12 * np.abs(right).max())


def test_no_rows_have_no_projection(monkeypatch: pytest.MonkeyPatch) -> None:
    pencil = arm(DRIVES[0]).pencil
    V = np.ones((2, pencil.n_dof))
    for found in (list, lambda parts: sparsely(monkeypatch, lambda: list(parts))):
        for part in found(projection.project_terms(pencil, V[:0], V, np.arange(pencil.n_theta))):
            assert part.values.shape[2:] == (0, 2)


@pytest.mark.parametrize("limit", [0, 10**9])
def test_matrices_are_the_same_from_a_stack_and_from_their_pattern(
    limit: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pencil_module, "TINY_STACK", limit)
    model = arm((HELD, "free"), (2, 1))
    pencil, x = model.pencil, np.array([[1.8, 5.3, 0.1, 0.2], [1.0, 4.0, 0.0, 0.1]])
    theta = pencil.theta(x)
    for found, weights in zip(pencil.matrices(theta), (pencil.stiffness, pencil.mass), strict=True):
        for k in range(2):
            right = pencil.sparse(weights @ theta[:, k]).toarray()
            np.testing.assert_allclose(found[k], right, atol=1e-14 * np.abs(right).max())
