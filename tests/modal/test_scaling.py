"""Large pencils: sparse and dense algebra say the same, and memory stays with the vectors."""

from __future__ import annotations

import itertools
import tracemalloc
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from chains import model_of, two_link
from pencils import crossing

from eigassign.errors import AccuracyError
from eigassign.mechanism.assembly import pencil as pencil_module
from eigassign.mechanism.assembly.pencil import Pencil
from eigassign.mechanism.elements.sparse_factor import factorise
from eigassign.modal import projection
from eigassign.modal.exact import solver
from eigassign.modal.exact import sparse as symmetric
from eigassign.modal.exact.dense import solve_single
from eigassign.modal.expansion import Expansion, expand
from eigassign.modal.model import Model
from eigassign.modal.reduced import residual
from eigassign.modal.reduced.basis import ritz_basis
from eigassign.modal.taylor import coefficients
from eigassign.modal.taylor.bordered import (
    add_product,
    factor_dense,
    factor_sparse,
    with_partial_pivoting,
)

HELD = {"stiffness": 2e3}
Q0, Y0 = np.array([1.817, 5.312]), np.array([0.125, 0.125])
MODULES = (coefficients, solver, projection)


def arm(drives: tuple[Any, Any] = ("free", "free"), elements: tuple[int, int] = (9, 7)) -> Model:
    return model_of(two_link(elements, drives=drives))


def sparsely(patch: pytest.MonkeyPatch, job: Callable[[], Any]) -> Any:
    """The job with every size counted as large."""
    with patch.context() as inside:
        for module in MODULES:
            inside.setattr(module, "DENSE_LIMIT", 0)
        inside.setattr(pencil_module, "STACK_LIMIT", 0)
        inside.setattr(pencil_module, "TINY_STACK", 0)
        return job()


def agree(thin: Expansion, full: Expansion, tolerance: float) -> None:
    """Coefficients and vectors, relative to the largest of their degree or kind."""
    starts = full.space.degree_starts
    for a, b in zip(thin.clusters, full.clusters, strict=True):
        assert a.modes == b.modes
        for first, last in itertools.pairwise(starts):
            right = b.coefficients[..., first:last]
            wrong = np.abs(a.coefficients[..., first:last] - right).max()
            assert wrong <= tolerance * np.abs(right).max()
    for v, w in zip(thin.vectors, full.vectors, strict=True):
        np.testing.assert_allclose(v, w, atol=10 * tolerance * np.abs(w).max())


DRIVES = [("free", "free"), ("locked", "locked"), ("locked", HELD), (HELD, "free"), (HELD, HELD)]


@pytest.mark.parametrize("drives", DRIVES, ids=str)
@pytest.mark.parametrize("linear", [False, True])
def test_every_kind_of_drive_is_expanded_sparsely_to_the_same_series(
    drives: tuple[Any, Any], linear: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    def job() -> Expansion:
        return expand(arm(drives).pencil, Q0, Y0, (1, 2), 4, linear)

    # round-off of K0 itself: 1e-16 (elements)^4 times its stiffest over its softest, ~1e-9
    agree(sparsely(monkeypatch, job), job(), 1e-8)


def test_clusters_are_expanded_sparsely_to_the_same_series(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def job() -> Expansion:
        return expand(arm().pencil, Q0, Y0, (1, 5), 5, cluster_gap=0.5)

    full = job()
    assert [c.modes for c in full.clusters] == [(1,), (4, 5, 6)]
    agree(sparsely(monkeypatch, job), full, 1e-8)


def test_no_array_of_unknowns_times_coefficients_is_ever_stored(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    pencil = arm(elements=(500, 400)).pencil
    expand(pencil, Q0, Y0, (1,), 2)
    tracemalloc.start()
    found = expand(pencil, Q0, Y0, (1,), 9)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    vectors = found.vectors[0].nbytes
    assert len(found.space) > 6 * len(found.vector_space)
    assert peak < 6 * vectors
    assert peak < pencil.n_dof * len(found.space) * 8


def mode_system(pencil: Pencil, x0: np.ndarray, mode: int) -> tuple[np.ndarray, ...]:
    """Non-zeros of K0 − λM0, the border M0 φ0 and φ0 as rows."""
    theta = pencil.theta(x0[None])
    found = solver.modes(pencil, x0[None], mode)
    lam, phi = found.lam[0, -1], found.phi[0][:, -1]
    data = (pencil.stiffness - lam * pencil.mass) @ theta[:, 0]
    border = pencil.sparse(pencil.mass @ theta[:, 0]) @ phi
    return data, border[None], phi[None]


@pytest.mark.parametrize("drives", DRIVES, ids=str)
@pytest.mark.parametrize("mode", [1, 4])
def test_the_bordered_system_is_solved_without_its_dense_rows(
    drives: tuple[Any, Any], mode: int
) -> None:
    pencil = arm(drives).pencil
    data, border, phi = mode_system(pencil, np.concatenate([Q0, Y0]), mode)
    rows = np.random.default_rng(1).standard_normal((5, pencil.n_dof))
    A = pencil.sparse(data).toarray()
    x, values = factor_sparse(pencil, data, border, phi)(rows)
    right, right_values = factor_dense(A, border)(rows)
    np.testing.assert_allclose(x, right, atol=1e-8 * np.abs(right).max())
    np.testing.assert_allclose(values, right_values, rtol=1e-7)
    rest = x @ A - values @ border - rows
    assert np.abs(rest).max() < 1e-12 * (np.abs(x) @ np.abs(A)).max()
    assert np.abs(x @ border.T).max() < 1e-9 * np.abs(x).max() * np.abs(border).sum()


def test_pivots_that_fail_are_replaced_by_safe_ones() -> None:
    pencil = arm().pencil
    data, border, phi = mode_system(pencil, np.concatenate([Q0, Y0]), 1)
    rows = np.random.default_rng(1).standard_normal((2, pencil.n_dof))
    right, _ = factor_sparse(pencil, data, border, phi)(rows)

    class Spoiled:
        def __init__(self, matrix: Any) -> None:
            self.inner = factorise(matrix)

        def solve(self, rhs: np.ndarray) -> np.ndarray:
            return np.asarray(self.inner.solve(rhs) * (1.0 + 1e-4))

    spoiled: Any = Spoiled
    x, _ = factor_sparse(pencil, data, border, phi, (spoiled, with_partial_pivoting))(rows)
    np.testing.assert_allclose(x, right, atol=1e-8 * np.abs(right).max())
    with pytest.raises(AccuracyError, match="singular"):
        factor_sparse(pencil, data, border, phi, (spoiled, spoiled))


def test_a_double_mode_with_half_its_border_is_refused() -> None:
    pencil = crossing(0.0)
    x0 = np.zeros(2)
    theta = pencil.theta(x0[None])
    found = solver.modes(pencil, x0[None], 2)
    assert found.lam[0, 1] == pytest.approx(found.lam[0, 0], rel=1e-12)
    data = (pencil.stiffness - found.lam[0, 0] * pencil.mass) @ theta[:, 0]
    M = pencil.sparse(pencil.mass @ theta[:, 0])
    phi = found.phi[0].T
    rows = np.random.default_rng(1).standard_normal((1, 6))
    whole, _ = factor_sparse(pencil, data, phi @ M, phi)(rows)
    assert np.abs(whole).max() < 1e3
    try:  # singular to round-off: refused, or an answer that shows it by its size
        half, _ = factor_sparse(pencil, data, phi[:1] @ M, phi[:1])(rows)
    except AccuracyError:
        return
    assert np.abs(half).max() > 1e10


@pytest.mark.parametrize("drives", DRIVES, ids=str)
def test_terms_are_projected_alike_from_stacks_and_from_their_rows(
    drives: tuple[Any, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    V = np.random.default_rng(2).standard_normal((arm(drives).n_dof, 4))
    full = projection.project(arm(drives).pencil, V)
    thin = sparsely(monkeypatch, lambda: projection.project(arm(drives).pencil, V))
    monkeypatch.setattr(projection, "CHUNK", 7)  # terms cut into pieces
    cut = sparsely(monkeypatch, lambda: projection.project(arm(drives).pencil, V))
    for a, b, c in zip(full, thin, cut, strict=True):
        np.testing.assert_allclose(b, a, atol=1e-12 * np.abs(a).max())
        np.testing.assert_allclose(c, a, atol=1e-12 * np.abs(a).max())


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


def test_a_principal_part_is_what_slicing_gives() -> None:
    pencil = arm((HELD, "free")).pencil
    data = pencil.mass @ pencil.theta(np.concatenate([Q0, Y0])[None])[:, 0]
    whole = pencil.sparse(data).toarray()
    dofs = np.flatnonzero(np.random.default_rng(3).random(pencil.n_dof) < 0.6)
    np.testing.assert_array_equal(
        symmetric.principal(pencil, data, dofs).toarray(), whole[np.ix_(dofs, dofs)]
    )
    assert symmetric.principal(pencil, data, dofs).nnz == np.count_nonzero(
        whole[np.ix_(dofs, dofs)]
    )
    np.testing.assert_array_equal(symmetric.block(pencil, data, dofs), whole[dofs])


@pytest.mark.parametrize("drives", [("free", "free"), ("free", HELD), (HELD, "free")], ids=str)
@pytest.mark.parametrize("elements", [(4, 3), (20, 15)])
def test_one_sample_has_the_modes_of_the_batch(
    drives: tuple[Any, Any], elements: tuple[int, int]
) -> None:
    model = arm(drives, elements)
    x = model.x(np.tile(Q0, (2, 1)), np.tile(Y0, (2, 1)))
    batch = solver.modes(model.pencil, x, 4)
    lam, phi = solve_single(model.pencil, model.pencil.theta(x[:1]), 4)
    np.testing.assert_allclose(lam, batch.lam[0], rtol=1e-10)
    np.testing.assert_allclose(phi, batch.phi[0], atol=1e-7 * np.abs(phi).max())


def test_products_are_added_in_place_whatever_the_layout() -> None:
    rng = np.random.default_rng(4)
    A, B = rng.standard_normal((3, 4)), rng.standard_normal((4, 5))
    for out in (np.ones((3, 5)), np.ones((3, 10))[:, ::2], np.ones((5, 3)).T):
        add_product(out, A, B)
        np.testing.assert_allclose(out, 1.0 + A @ B, rtol=1e-14)


@pytest.mark.parametrize("drives", DRIVES, ids=str)
def test_residuals_have_the_same_size_from_unit_and_from_chosen_vectors(
    drives: tuple[Any, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """From half a solve with a basis of the residuals' span, against L⁻¹ B_j."""
    pencil = arm(drives).pencil
    basis = ritz_basis(pencil, np.concatenate([Q0, Y0])[None], (1,), 2, True, None)
    given = pencil, basis.K0, factorise(basis.K0), basis.wide
    right = residual.residual_terms(*given)
    monkeypatch.setattr(residual, "UNIT_LIMIT", 0)
    found = residual.residual_terms(*given)
    np.testing.assert_array_equal(found.stiffness_terms, right.stiffness_terms)
    np.testing.assert_array_equal(found.mass_terms, right.mass_terms)
    rng = np.random.default_rng(5)
    for a, b in ((found.stiffness, right.stiffness), (found.mass, right.mass)):
        # any combination of the terms, applied to any vector, has the same length
        coefficients = rng.standard_normal((30, len(b), b.shape[2]))
        lengths = [
            np.linalg.norm(np.einsum("tak,stk->sa", r, coefficients), axis=1) for r in (a, b)
        ]
        np.testing.assert_allclose(*lengths, rtol=1e-6)
